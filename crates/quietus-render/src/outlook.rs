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
use crate::steering::Aim;
use crate::tracer::Tracer;
use crate::weights::Weights;

/// Looks cost a pass over all pixels: not before this much more time, relative and absolute.
const PAUSE: (f64, Duration) = (1.03, Duration::from_millis(40));

/// Samples per pixel before which pixels are not scouted: halves of fewer are no guide to where the error is.
const LEAST_SAMPLES: f64 = 3.0;

/// Share of all samples, as far as that is known, that is drawn for the guess in the first round;
const SCOUTED: f64 = 0.015;

/// or that many, if they are no more than such a share of the first round: fewer do not even say how many are needed.
const LEAST_SCOUTED: (f64, f64) = (65536.0, 0.08);

/// Relative error of what scouted pixels say, one standard deviation, from which on it is not told.
const LARGEST_DEVIATION: f64 = 0.35;

/// Towards a target error, what is left comes to `1 + CREEP.0` times what quotas say, for every doubling of the samples, up to
/// `1 + CREEP.1` times: at every update some quotas come out larger by chance, and what was drawn for them stays drawn.
const CREEP: (f64, f64) = (0.3, 0.9);

/// Towards a noise it comes to `1 + STEERED_CREEP.0 + STEERED_CREEP.1 * creep of the round before` times that: while there is another
/// round to come, and in the last one, which has as many updates for an eighth more samples as others have for a quarter.
const STEERED_CREEP: [(f64, f64); 2] = [(0.0, 0.5), (0.15, 1.1)];

/// Creep of a round that nothing is known of.
const USUAL_CREEP: f64 = 0.2;

/// Deviation of the logarithm of the factor that quotas need, by halves of the film and by scouted pixels whose picture was
/// measured, over the logarithm of the samples that are drawn for it: how fast error falls is not known at first.
const UNKNOWN_FALL: [f64; 2] = [0.4, 0.2];

/// Deviation of the logarithm of what is left from what it comes to, of guesses by scouted pixels beyond what their number
/// explains;
const SCOUTED_SPREAD: f64 = 0.5;

/// of those by the steering while there is another round to come, and in the last one. `docs/noise.md` has what they are from.
const STEERED_SPREADS: [f64; 2] = [0.35, 0.3];

/// That of what is left after the first round beyond what the factor explains: what measurements will say.
const MEASURED_SPREAD: f64 = 0.15;

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
#[derive(Clone, Debug)]
struct Way {
    /// What steering multiplies the quotas of this round by until the end.
    factor: f64,
    is_last: bool,
    /// What the squared error of its beginning is to be multiplied by.
    fall: Option<f64>,
    began: Option<Beginning>,
}

/// Where a round began.
#[derive(Clone, Debug)]
struct Beginning {
    /// Samples that there were, and those it should come to, as quotas said then.
    foreseen: [f64; 2],
    /// Samples of scouted pixels.
    scouted: Vec<f64>,
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
        let Some(Way { began: Some(Beginning { foreseen: [before, foreseen], .. }), .. }) = self.way else {
            return;
        };
        let crept = (sampling.counts().total() as f64 - before) / (foreseen - before) - 1.0;
        self.crept = crept.is_finite().then(|| crept.max(0.0));
    }

    /// Another round begins, towards `aim`. The squared error measured before it is to be multiplied by `fall`, where that is
    /// known.
    pub(crate) fn begin(&mut self, aim: &Aim, fall: Option<f64>) {
        self.way = Some(Way { factor: aim.factor_left, is_last: aim.is_last, fall, began: None });
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
            Goal::Noise(asked) if self.way.is_none() => self.by_scouts(asked, sampling, seen.film, &costs),
            Goal::Noise(_) => self.by_steering(sampling, &costs),
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
        let dealt = dealt.towards_a_noise();
        let square = |factor: f64| self.scout.square(|number| dealt.asked(number, factor));
        let (factor, deviation) = factor_to(&self.scout, asked.powi(2), square)?;
        let [samples, drawn, left] = dealt.left(factor, costs);
        let is_at_the_least = samples < 1.5 * self.first_samples;
        let spread = if is_at_the_least { STEERED_SPREADS[1] } else { deviation.hypot(SCOUTED_SPREAD) };
        Some(Left { samples, seconds: left + self.measuring() * (drawn + left), spread })
    }

    /// From what the steering has decided and, until a round has shown how it creeps, from scouted pixels.
    fn by_steering(&mut self, sampling: &AdaptiveSampling, costs: &[f64]) -> Option<Left> {
        let now = sampling.counts().total() as f64;
        let dealt = Dealt::of(sampling, self.scout.pixels())?;
        let Self { way, scout, .. } = self;
        let way = way.as_mut()?;
        let began = way.began.get_or_insert_with(|| Beginning {
            foreseen: [now, dealt.left(1.0, costs)[0]],
            scouted: dealt.asked_now(),
        });
        let is_last = usize::from(way.is_last);
        let dealt = dealt.towards_a_noise();
        let (factor, spread) = match way.is_last || self.crept.is_some() {
            true => (way.factor, STEERED_SPREADS[is_last]),
            false => unknown_factor(way.factor, way.fall, scout, began, &dealt),
        };
        let [samples, drawn, left] = dealt.left(factor, costs);
        let (least, share) = STEERED_CREEP[is_last];
        let creep = match self.sampling {
            Sampling::Uniform => 1.0,
            _ => 1.0 + (least + share * self.crept.unwrap_or(USUAL_CREEP)).min(CREEP.1),
        };
        let (samples, seconds) = (now + creep * (samples - now), creep * left);
        Some(Left { samples, seconds: seconds + self.measuring() * (drawn + seconds), spread })
    }

    /// How much more comes, as a share of what quotas say, where nothing was learnt yet.
    fn expected_creep(now: f64, then: f64) -> f64 {
        let (each, most) = CREEP;
        (each * (then / now.max(1.0)).max(1.0).log2()).min(most)
    }

    /// Samples that measure the noise, over those in the picture.
    fn measuring(&self) -> f64 {
        // Rounds before the last have a third of the samples, all together.
        Effort::REPORT.expected_share(self.pixels) + 0.4 * Effort::STEP.expected_share(self.pixels)
    }
}

/// What quotas are to be multiplied by in the round after the first, and the deviation of the logarithm of what comes of it: by
/// halves of the film `steered`, by scouted pixels what makes the error fall as it has to, to `fall` times what it was.
fn unknown_factor(
    steered: f64,
    fall: Option<f64>,
    scout: &Scout,
    began: &Beginning,
    dealt: &Dealt,
) -> (f64, f64) {
    let from = |number: usize| began.scouted[number];
    let falls = |factor: f64| scout.fall(from, |number| dealt.asked(number, factor));
    let scouted = fall.and_then(|fall| factor_to(scout, fall, falls));
    // Where scouted pixels find it out of reach, the steering knows what it does instead.
    let scouted = scouted.filter(|(factor, _)| *factor < LARGEST_FACTOR);
    both(steered, scouted, (dealt.samples(steered) / began.foreseen[0]).ln().max(0.0))
}

/// The least factor of quotas at which the square that `square` says, with its relative deviation, comes to `goal`; and that
/// deviation. `None` where scouted pixels know too little.
fn factor_to(scout: &Scout, goal: f64, square: impl Fn(f64) -> (f64, f64)) -> Option<(f64, f64)> {
    let factor = least_factor(FACTOR_STEP, |factor| square(factor).0 <= goal).unwrap_or(LARGEST_FACTOR);
    let (square, deviation) = square(factor);
    let is_known = scout.is_enough() && square > 0.0 && (0.0..LARGEST_DEVIATION).contains(&deviation);
    is_known.then_some((factor, deviation))
}

/// The factor by which quotas are multiplied, from that by halves of the film and, where it is known, that by scouted pixels with the
/// deviation of its logarithm, and the deviation of what comes of it. Samples grow by so many e-foldings.
fn both(steered: f64, scouted: Option<(f64, f64)>, foldings: f64) -> (f64, f64) {
    let [by_halves, by_scouts] = UNKNOWN_FALL.map(|deviation| (deviation * foldings).max(1e-3));
    let (mut sum, mut precision) = (steered.ln() / by_halves.powi(2), by_halves.powi(-2));
    if let Some((factor, deviation)) = scouted {
        let each = by_scouts.hypot(deviation).powi(-2);
        sum += each * factor.max(1.0).ln();
        precision += each;
    }
    ((sum / precision).exp(), precision.powf(-0.5).hypot(MEASURED_SPREAD))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_known_better_counts_more() {
        // Nothing else is known: the steering's factor, as uncertain as the way is long.
        let (factor, near) = both(3.0, None, 0.5);
        let (same, far) = both(3.0, None, 2.0);
        assert!((factor / 3.0 - 1.0).abs() < 1e-9 && (same / 3.0 - 1.0).abs() < 1e-9);
        assert!(near < far);
        // Between the two, nearer to what is known better, and better known than either.
        let (precise, rough) = (both(3.0, Some((6.0, 0.01)), 1.0), both(3.0, Some((6.0, 2.0)), 1.0));
        assert!(precise.0 > 4.8 && precise.0 < 6.0, "{precise:?}");
        assert!(rough.0 > 3.0 && rough.0 < 3.2, "{rough:?}");
        assert!(precise.1 < rough.1 && rough.1 < both(3.0, None, 1.0).1);
        // The quotas of a round that has begun do not shrink.
        assert!(both(1.0, Some((1e-12, 0.1)), 1.0).0 >= 1.0);
    }
}
