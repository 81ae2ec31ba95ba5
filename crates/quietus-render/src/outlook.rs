//! How much a render will have drawn when it is done: what the guess at its end is made of.

use std::sync::Arc;
use std::time::Duration;

use quietus::AdaptiveSampling;
use quietus_film::{Film, Window};

use crate::costs::Costs;
use crate::forecast::{Dealt, LARGEST_FACTOR, least_factor};
use crate::noise::{Copied, Effort};
use crate::scout::Scout;
use crate::settings::{Goal, RenderSettings, Sampling};
use crate::tracer::Tracer;
use crate::weights::Weights;

/// Looks cost a pass over all pixels: not before this much more time, relative and absolute.
const PAUSE: (f64, Duration) = (1.03, Duration::from_millis(40));

/// Samples per pixel before which pixels are not scouted: halves of fewer are no guide to where the error is.
const LEAST_SAMPLES: f64 = 6.0;

/// Share of all samples, as far as that is known, that is drawn for the guess in the first round;
const SCOUTED: f64 = 0.015;

/// or that many, if they are no more than such a share of the first round: fewer do not even say how many are needed.
const LEAST_SCOUTED: (f64, f64) = (65536.0, 0.04);

/// What is left comes to `1 + CREEP.0` times what quotas say, for every doubling of the samples, up to `1 + CREEP.1` times: at
/// every update some quotas come out larger by chance, and what was drawn for them stays drawn. The last round has as many
/// updates for an eighth more samples as others have for a quarter: twice the creep of the one before it.
const CREEP: (f64, f64) = (0.3, 0.9);

/// Deviation of the logarithm of what is left from what it comes to, of guesses by scouted pixels beyond what their number
/// explains;
const SCOUTED_SPREAD: f64 = 0.5;

/// of those by the steering while there is another round to come, and in the last one. `docs/noise.md` has what they are from.
const STEERED_SPREADS: [f64; 2] = [0.35, 0.3];

/// Factors are found to this precision.
const FACTOR_STEP: f64 = 1.01;

/// What a render comes to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Left {
    /// Samples in the picture in the end.
    pub(crate) samples: f64,
    /// Seconds of one thread, measurements of the noise included.
    pub(crate) seconds: f64,
    /// Standard deviation of the logarithm of what is left of both.
    pub(crate) spread: f64,
}

/// What a round is on the way to.
#[derive(Clone, Copy, Debug)]
struct Way {
    /// What steering multiplies the quotas of this round by until the end.
    factor: f64,
    is_last: bool,
    /// Samples that there were when it began, and those it should come to, as quotas said then.
    foreseen: Option<[f64; 2]>,
}

/// What a look goes by besides the sampling.
#[derive(Clone, Copy)]
pub(crate) struct Seen<'a> {
    pub(crate) film: &'a Film,
    pub(crate) costs: &'a Costs,
}

/// The samples a render will have drawn, as far as that is known.
pub(crate) struct Outlook {
    goal: Goal,
    sampling: Sampling,
    window: Window,
    pixels: f64,
    first_samples: f64,
    weights: Option<Arc<Weights>>,
    /// Whether alpha, albedo or normal have to be clean too, which scouted pixels know nothing of.
    has_aovs: bool,
    /// Of the present round; `None` in the first, where nobody knows.
    way: Option<Way>,
    /// By how much the last round that came to its end went beyond what quotas had said, as a share of that.
    crept: Option<f64>,
    looked: Option<Duration>,
    /// Samples in all, and seconds of one thread in all: what was drawn is taken off later.
    total: Option<Left>,
    scout: Scout,
}

impl Outlook {
    pub(crate) fn new(settings: &RenderSettings) -> Self {
        let pixels = settings.window.pixels() as f64;
        Self {
            goal: settings.goal,
            sampling: settings.sampling,
            window: settings.window,
            pixels,
            first_samples: pixels * f64::from(settings.min_samples),
            weights: settings.weights.clone(),
            has_aovs: settings.aov_noise.iter().any(Option::is_some),
            way: None,
            crept: None,
            looked: None,
            total: None,
            scout: Scout::default(),
        }
    }

    /// Another noise is asked for.
    pub(crate) fn ask(&mut self, noise: f64) {
        self.goal = Goal::Noise(noise);
    }

    /// A round came to its end, with `sampling`.
    pub(crate) fn end(&mut self, sampling: &AdaptiveSampling) {
        let Some([before, foreseen]) = self.way.and_then(|way| way.foreseen) else { return };
        let crept = (sampling.counts().total() as f64 - before) / (foreseen - before) - 1.0;
        self.crept = crept.is_finite().then(|| crept.max(0.0));
    }

    /// Another round begins. Its quotas will be multiplied by `factor` in those that follow, unless it is the last.
    pub(crate) fn begin(&mut self, factor: f64, is_last: bool) {
        self.way = Some(Way { factor, is_last, foreseen: None });
        self.looked = None;
    }

    /// Samples that were drawn for the guess.
    pub(crate) fn scouted(&self) -> u64 {
        self.scout.samples() as u64
    }

    /// Draws a few pixels where that helps to guess.
    pub(crate) fn scout<T: Tracer>(&mut self, tracer: &T, samples: u64, film: &Film) {
        let is_first = matches!(self.goal, Goal::Noise(_)) && self.way.is_none() && !self.has_aovs;
        if !is_first || (samples as f64) < LEAST_SAMPLES * self.pixels {
            return;
        }
        if !self.scout.has_picks() {
            self.scout.choose(&Copied::of(film, self.weights.as_deref(), None).finished());
        }
        let (least, share) = LEAST_SCOUTED;
        let total = self.total.map_or(0.0, |total| total.samples).max(self.first_samples);
        let most = (SCOUTED * total).max(least.min(share * self.first_samples));
        self.scout.advance(tracer, self.window, most);
    }

    /// What there will be in the end, without end where limits alone bring it or nobody knows; `None` where the share of pixels
    /// that are done says more. `spent` seconds have been drawn.
    pub(crate) fn total(
        &mut self,
        elapsed: Duration,
        spent: f64,
        sampling: &AdaptiveSampling,
        seen: Seen<'_>,
    ) -> Option<Left> {
        let (factor, pause) = PAUSE;
        let is_early = self.looked.is_some_and(|at| elapsed < at.mul_f64(factor).max(at + pause));
        if !is_early {
            self.looked = Some(elapsed);
            if let Some(left) = self.look(sampling, seen) {
                self.total = Some(Left { seconds: spent + left.seconds, ..left });
            }
        }
        self.known()
    }

    /// What was found last.
    pub(crate) fn known(&self) -> Option<Left> {
        let unknown = Left { samples: f64::INFINITY, seconds: f64::INFINITY, spread: 0.0 };
        // Pixels that are done in one round go on in the next.
        self.total.or(matches!(self.goal, Goal::Noise(_) | Goal::Limits).then_some(unknown))
    }

    /// What is foreseen: samples in all, and seconds that are left.
    fn look(&mut self, sampling: &AdaptiveSampling, seen: Seen<'_>) -> Option<Left> {
        let costs = seen.costs.seconds()?;
        match self.goal {
            Goal::Limits => None,
            Goal::TargetError(_) if self.sampling == Sampling::Uniform => None,
            Goal::TargetError(_) => {
                let dealt = Dealt::of(sampling, std::iter::empty())?;
                let now = sampling.counts().total() as f64;
                let [samples, _, left] = dealt.left(1.0, &costs);
                let creep = 1.0 + Self::expected_creep(now, samples);
                Some(Left {
                    samples: now + creep * (samples - now),
                    seconds: creep * left,
                    spread: STEERED_SPREADS[0],
                })
            }
            Goal::Noise(asked) => match self.way {
                None => self.by_scouts(asked, sampling, seen.film, &costs),
                Some(way) => self.by_steering(way, sampling, &costs),
            },
        }
    }

    /// In the first round: from what scouted pixels say of the error, and quotas or what will make them.
    fn by_scouts(&self, asked: f64, sampling: &AdaptiveSampling, film: &Film, costs: &[f64]) -> Option<Left> {
        if self.has_aovs || !self.scout.has_picks() {
            return None;
        }
        let dealt = Dealt::of(sampling, self.scout.pixels()).unwrap_or_else(|| {
            let picture = Copied::of(film, self.weights.as_deref(), None);
            Dealt::before_quotas(sampling, &picture.finished(), self.scout.pixels())
        });
        let (factor, deviation) = self.factor_to(asked, &dealt)?;
        let [samples, drawn, left] = dealt.left(factor, costs);
        let is_at_the_least = samples < 1.5 * self.first_samples;
        let spread = if is_at_the_least { STEERED_SPREADS[1] } else { deviation.hypot(SCOUTED_SPREAD) };
        Some(Left { samples, seconds: left + self.measuring() * (drawn + left), spread })
    }

    /// From what the steering has decided.
    fn by_steering(&mut self, way: Way, sampling: &AdaptiveSampling, costs: &[f64]) -> Option<Left> {
        let dealt = Dealt::of(sampling, std::iter::empty())?;
        let now = sampling.counts().total() as f64;
        if let Some(Way { foreseen: foreseen @ None, .. }) = &mut self.way {
            *foreseen = Some([now, dealt.left(1.0, costs)[0]]);
        }
        let [samples, drawn, left] = dealt.left(way.factor, costs);
        let creep = match self.crept.filter(|_| way.is_last) {
            Some(crept) => (2.0 * crept).min(CREEP.1),
            None => Self::expected_creep(now, samples),
        };
        let seconds = (1.0 + creep) * left;
        let spread = STEERED_SPREADS[usize::from(way.is_last)];
        let samples = now + (1.0 + creep) * (samples - now);
        Some(Left { samples, seconds: seconds + self.measuring() * (drawn + seconds), spread })
    }

    /// How much more comes, as a share of what quotas say, where nothing was learnt yet.
    fn expected_creep(now: f64, then: f64) -> f64 {
        let (each, most) = CREEP;
        (each * (then / now.max(1.0)).max(1.0).log2()).min(most)
    }

    /// What quotas are to be multiplied by for the noise `asked` for, going by the scouted pixels, and the relative deviation of
    /// the squared error that they find there.
    fn factor_to(&self, asked: f64, dealt: &Dealt) -> Option<(f64, f64)> {
        let goal = asked.powi(2);
        let square = |factor: f64| self.scout.square(|number| dealt.asked(number, factor));
        // Nothing is known where too little was scouted.
        square(1.0 / LARGEST_FACTOR)?;
        let is_enough = |factor: f64| square(factor).is_none_or(|(square, _)| square <= goal);
        let factor = least_factor(FACTOR_STEP, is_enough).unwrap_or(LARGEST_FACTOR);
        Some((factor, square(factor).map_or(1.0, |(_, deviation)| deviation)))
    }

    /// Samples that measure the noise, over those in the picture.
    fn measuring(&self) -> f64 {
        // Rounds before the last have a third of the samples, all together.
        Effort::REPORT.expected_share(self.pixels) + 0.4 * Effort::STEP.expected_share(self.pixels)
    }
}
