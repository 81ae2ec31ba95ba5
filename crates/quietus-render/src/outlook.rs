//! How much a render will have drawn when it is done: what the guess at its end is made of.

use std::sync::Arc;
use std::time::{Duration, Instant};

use quietus::AdaptiveSampling;
use quietus_film::{Film, Window};

use crate::costs::Costs;
use crate::dealt::{Dealt, samples_in};
use crate::forecast::least_factor;
use crate::noise::{Copied, Effort};
use crate::process;
use crate::scout::{Known, Scout};
use crate::settings::{Goal, RenderSettings, Sampling};
use crate::steering::Aim;
use crate::tracer::Tracer;
use crate::weights::Weights;

/// Looks cost a pass over all pixels: not before this much more time, relative and absolute.
const PAUSE: (f64, Duration) = (1.03, Duration::from_millis(40));

/// Samples per pixel before which pixels are not scouted: halves of fewer are no guide to where the error is.
const LEAST_SAMPLES: f64 = 3.0;

/// Share of all samples, as far as that is known, that is drawn for the guess;
const SCOUTED: f64 = 0.02;

/// or that many, if they are no more than such a share of them: fewer do not even say how many are needed.
const LEAST_SCOUTED: (f64, f64) = (262144.0, 0.06);

/// Share of the samples drawn so far that pixels are scouted with at most: a render that ends soon needs no guess.
const SCOUTED_SO_FAR: f64 = 0.2;

/// Relative error of what scouted pixels say, one standard deviation, from which on it is not told.
const LARGEST_DEVIATION: f64 = 0.5;

/// Towards a target error, what is left comes to `1 + CREEP.0` times what quotas say, for every doubling of the samples, up to
/// `1 + CREEP.1` times: at every update some quotas come out larger by chance, and what was drawn for them stays drawn.
const CREEP: (f64, f64) = (0.3, 0.9);

/// Deviation of the logarithm of the samples that it takes by halves of the film, over the logarithm of what they are multiplied by:
/// how fast error falls is not known at first.
const UNKNOWN_FALL: f64 = 0.6;

/// Deviation of the logarithm of what is left from what it comes to, of guesses by scouted pixels in the first round beyond what their
/// number explains, and in later ones: what measurements will say.
const SCOUTED_SPREADS: [f64; 2] = [0.4, 0.2];

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

impl Left {
    /// Between two guesses of what is left after `now` samples, nearer to the one that is known better.
    fn between(self, other: Self, now: f64) -> Self {
        let [own, others] = [self, other].map(|left| left.spread.max(1e-3).powi(-2));
        let share = others / (own + others);
        let mean = |a: f64, b: f64| a.max(1e-9).powf(1.0 - share) * b.max(1e-9).powf(share);
        Self {
            samples: now + mean(self.samples - now, other.samples - now),
            seconds: mean(self.seconds, other.seconds),
            spread: (own + others).powf(-0.5),
        }
    }
}

/// What a round is on the way to.
struct Way {
    /// What steering multiplies the quotas of this round by until the end.
    factor: f64,
    is_last: bool,
    /// What will come beyond what quotas say, as a share of what they add.
    creep: f64,
    /// The squared error of its beginning.
    measured: Option<Known>,
    /// Samples that scouted pixels had then.
    began: Vec<f64>,
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
    looked: Option<Duration>,
    /// Samples in all, and seconds of one thread in all: what was drawn is taken off later.
    total: Option<Left>,
    scout: Scout,
    threads: f64,
    /// Since when, and how much processors' time the process had taken by then.
    began: (Instant, Option<Duration>),
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
            looked: None,
            total: None,
            scout: Scout::default(),
            threads: settings.threads.get() as f64,
            began: (Instant::now(), process::cpu_time()),
        }
    }

    /// Another noise is asked for.
    pub(crate) fn ask(&mut self, noise: f64) {
        self.goal = Goal::Noise(noise);
    }

    /// Another round begins, towards `aim`, from what `sampling` has drawn, whose squared error was `measured`; quotas will `creep`.
    pub(crate) fn begin(
        &mut self,
        aim: &Aim,
        creep: f64,
        sampling: &AdaptiveSampling,
        measured: Option<Known>,
    ) {
        let Aim { factor_left: factor, is_last, .. } = *aim;
        let began = samples_in(sampling, self.scout.pixels());
        self.way = Some(Way { factor, is_last, creep, measured, began });
        self.looked = None;
    }

    /// Samples that were drawn for the guess.
    pub(crate) fn scouted(&self) -> u64 {
        self.scout.samples() as u64
    }

    /// Draws a few pixels where that helps to guess.
    pub(crate) fn scout<T: Tracer>(&mut self, tracer: &T, samples: u64, film: &Film) {
        let is_last = self.way.as_ref().is_some_and(|way| way.is_last);
        let is_wanted = matches!(self.goal, Goal::Noise(_)) && !is_last && !self.has_aovs;
        if !is_wanted || (samples as f64) < LEAST_SAMPLES * self.pixels {
            return;
        }
        if !self.scout.has_picks() {
            self.scout.choose(&Copied::of(film, self.weights.as_deref(), None).finished());
        }
        let (least, share) = LEAST_SCOUTED;
        let total = self.total.map_or(0.0, |total| total.samples).max(self.first_samples);
        let most = (SCOUTED * total).max(least.min(share * total));
        self.scout.advance(tracer, self.window, most.min(SCOUTED_SO_FAR * samples as f64));
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
                self.total = Some(Left { seconds: spent + self.undisturbed() * left.seconds, ..left });
            }
        }
        self.known()
    }

    /// What a sample will cost over what it cost so far, while this thread scouted pixels on a processor that others needed.
    fn undisturbed(&self) -> f64 {
        let (start, cpu_start) = self.began;
        let cpu = cpu_start.zip(process::cpu_time()).map(|(before, now)| now.saturating_sub(before));
        let Some(cpu) = cpu.filter(|cpu| !cpu.is_zero()) else { return 1.0 };
        // Where there are more processors than threads nobody waited.
        let shared = cpu.as_secs_f64().min(self.threads * start.elapsed().as_secs_f64());
        ((cpu.as_secs_f64() - self.scout.seconds()) / shared).clamp(0.5, 1.0)
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
            Goal::Noise(asked) => self.by_steering(asked, sampling, &costs),
        }
    }

    /// In the first round: from what scouted pixels say of the error, and quotas or what will make them.
    fn by_scouts(
        &mut self,
        asked: f64,
        sampling: &AdaptiveSampling,
        film: &Film,
        costs: &[f64],
    ) -> Option<Left> {
        if self.has_aovs || !self.scout.has_picks() {
            return None;
        }
        let dealt = Dealt::of(sampling, self.scout.pixels()).unwrap_or_else(|| {
            let picture = Copied::of(film, self.weights.as_deref(), None);
            Dealt::before_quotas(sampling, &picture.finished(), self.scout.pixels())
        });
        let dealt = dealt.towards_a_noise();
        let square = |factor| self.scout.square(|number| dealt.asked(number, factor));
        let (left, factor) = scouted_left(&square, asked, &dealt, costs)?;
        self.scout.want(|number| dealt.asked(number, factor));
        if left.spread > LARGEST_DEVIATION {
            return None;
        }
        let is_at_the_least = left.samples < 1.5 * self.first_samples;
        let spread = if is_at_the_least { STEERED_SPREADS[1] } else { left.spread.hypot(SCOUTED_SPREADS[0]) };
        let drawn = dealt.left(1.0, costs)[1];
        Some(Left { seconds: left.seconds + self.measuring(drawn, left.seconds, false), spread, ..left })
    }

    /// From what the steering has decided and, until the last round, from scouted pixels.
    fn by_steering(&mut self, asked: f64, sampling: &AdaptiveSampling, costs: &[f64]) -> Option<Left> {
        let now = sampling.counts().total() as f64;
        let dealt = Dealt::of(sampling, self.scout.pixels())?;
        let &Way { factor, is_last, creep, .. } = self.way.as_ref()?;
        let dealt = dealt.towards_a_noise();
        let [samples, drawn, seconds] = dealt.left(factor, costs);
        let [samples, seconds] = [now + (1.0 + creep) * (samples - now), (1.0 + creep) * seconds];
        let steered = Left { samples, seconds, spread: STEERED_SPREADS[usize::from(is_last)] };
        let left = if is_last { steered } else { self.both(steered, asked, &dealt, costs) };
        Some(Left { seconds: left.seconds + self.measuring(drawn, left.seconds, is_last), ..left })
    }

    /// What the steering foresees and what scouted pixels do, given what was measured before this round.
    fn both(&mut self, steered: Left, asked: f64, dealt: &Dealt, costs: &[f64]) -> Left {
        let Some(&Way { measured: Some(measured), ref began, .. }) = self.way.as_ref() else {
            return steered;
        };
        // Pixels may have been chosen since.
        if began.is_empty() {
            return steered;
        }
        let now = dealt.now();
        let fall = UNKNOWN_FALL * (steered.samples / now).ln().max(0.0);
        let steered = Left { spread: fall.hypot(measured.variance.sqrt()), ..steered };
        let from = |number: usize| began[number];
        let square = |factor| self.scout.square_given(measured, from, |number| dealt.asked(number, factor));
        let by_scouts = scouted_left(&square, asked, dealt, costs);
        let left = by_scouts.map_or(steered, |(left, factor)| {
            self.scout.want(|number| dealt.asked(number, factor));
            steered.between(left, now)
        });
        Left { spread: left.spread.hypot(SCOUTED_SPREADS[1]), ..left }
    }

    /// How much more comes, as a share of what quotas say, where nothing was learnt yet.
    fn expected_creep(now: f64, then: f64) -> f64 {
        let (each, most) = CREEP;
        (each * (then / now.max(1.0)).max(1.0).log2()).min(most)
    }

    /// Seconds that measure the noise, where `drawn` were drawn and `left` are to be.
    fn measuring(&self, drawn: f64, left: f64, is_last: bool) -> f64 {
        let steps = if is_last { 0.0 } else { Effort::STEP.expected_share(self.pixels) };
        // Rounds before the last have half of the samples, all together, and are measured better the further it is.
        Effort::REPORT.expected_share(self.pixels) * (drawn + left) + 0.9 * steps * left
    }
}

/// What is left until the square that `square` says at a factor of quotas comes to that of the noise `asked`, and this factor.
/// `None` where scouted pixels know too little, or find it out of reach.
fn scouted_left(
    square: &impl Fn(f64) -> Option<Known>,
    asked: f64,
    dealt: &Dealt,
    costs: &[f64],
) -> Option<(Left, f64)> {
    let is_enough = |factor: f64| square(factor).is_none_or(|square| square.value <= asked.powi(2));
    let factor = least_factor(FACTOR_STEP, is_enough)?;
    let spread = square(factor)?.variance.sqrt();
    let [samples, _, seconds] = dealt.left(factor, costs);
    Some((Left { samples, seconds, spread }, factor))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_known_better_counts_more() {
        let left = |left: f64, spread: f64| Left { samples: 100.0 + left, seconds: left, spread };
        let between = left(300.0, 0.2).between(left(600.0, 0.2), 100.0);
        assert!((between.samples - 100.0 - 180_000f64.sqrt()).abs() < 1e-6, "{between:?}");
        assert!((between.spread - 0.02f64.sqrt()).abs() < 1e-9);
        let near = left(300.0, 0.2).between(left(600.0, 0.02), 100.0);
        assert!(near.seconds > 550.0 && near.seconds < 600.0 && near.spread < 0.02, "{near:?}");
    }
}
