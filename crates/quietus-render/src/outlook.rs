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

/// Samples per pixel before which pixels are not scouted.
const LEAST_SAMPLES: f64 = 2.0;

/// Share of all samples, as far as that is known, that is drawn for the guess in the first round;
const SCOUTED: f64 = 0.015;

/// or that many, if they are no more than such a share of the first round: small pictures need more to say anything.
const LEAST_SCOUTED: (f64, f64) = (8192.0, 0.06);

/// What is left comes to this times what quotas say: where rare bright paths carry the light, trees find more noise the longer
/// they look.
const CREEP: f64 = 1.15;

/// Factors are found to this precision.
const FACTOR_STEP: f64 = 1.01;

/// What a render comes to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Left {
    /// Samples in the picture in the end.
    pub(crate) samples: f64,
    /// Seconds of one thread, measurements of the noise included.
    pub(crate) seconds: f64,
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
    /// What steering multiplies the quotas of the present round by until the end; `None` in the first, where nobody knows.
    factor: Option<f64>,
    /// Rounds that are over.
    rounds: u32,
    /// The mean squared error, over what scouted pixels say of it.
    level: Option<f64>,
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
            factor: None,
            rounds: 0,
            level: None,
            looked: None,
            total: None,
            scout: Scout::default(),
        }
    }

    /// Another noise is asked for.
    pub(crate) fn ask(&mut self, noise: f64) {
        self.goal = Goal::Noise(noise);
    }

    /// A new round begins, whose quotas will be multiplied by `factor` in the rounds that follow; `square` is the mean squared
    /// error of the picture of the one before, which was `sampling`.
    pub(crate) fn begin(&mut self, factor: f64, square: Option<f64>, sampling: &AdaptiveSampling) {
        let now = Dealt::of(sampling, self.scout.pixels())
            .and_then(|dealt| self.scout.square(|number| dealt.asked(number, 1.0 / LARGEST_FACTOR)));
        self.level = square.zip(now).map(|(square, now)| square / now);
        tracing::debug!("scouted {now:?}, measured {square:?}");
        (self.factor, self.looked, self.rounds) = (Some(factor), None, self.rounds + 1);
    }

    /// Samples that were drawn for the guess.
    pub(crate) fn scouted(&self) -> u64 {
        self.scout.samples() as u64
    }

    /// Draws a few pixels where that helps to guess.
    pub(crate) fn scout<T: Tracer>(&mut self, tracer: &T, samples: u64, film: &Film) {
        let is_first = matches!(self.goal, Goal::Noise(_)) && self.factor.is_none() && !self.has_aovs;
        if !is_first || (samples as f64) < LEAST_SAMPLES * self.pixels {
            return;
        }
        if !self.scout.has_picks() {
            self.scout.choose(&Copied::of(film, self.weights.as_deref(), None).finished());
        }
        let (least, share) = LEAST_SCOUTED;
        let total = self.total.map_or(0.0, |total| total.samples).max(self.first_samples);
        let most = (SCOUTED * total).max(least.min(share * self.first_samples));
        self.scout.advance(tracer, self.window, most, total / self.pixels);
    }

    /// What there will be in the end, without end while a noise was asked for and nobody knows; `None` where the share of
    /// pixels that are done says more. `spent` seconds have been drawn.
    pub(crate) fn total(
        &mut self,
        elapsed: Duration,
        spent: f64,
        sampling: &AdaptiveSampling,
        costs: &Costs,
    ) -> Option<Left> {
        let (factor, pause) = PAUSE;
        let is_early = self.looked.is_some_and(|at| elapsed < at.mul_f64(factor).max(at + pause));
        if !is_early {
            self.looked = Some(elapsed);
            if let Some(left) = self.look(sampling, costs) {
                let now = sampling.counts().total() as f64;
                let creep = if self.is_at_the_least(&left) { 1.0 } else { CREEP };
                let samples = now + creep * (left.samples - now);
                self.total = Some(Left { samples, seconds: spent + creep * left.seconds });
            }
        }
        self.known()
    }

    /// What was found last.
    pub(crate) fn known(&self) -> Option<Left> {
        let unknown = Left { samples: f64::INFINITY, seconds: f64::INFINITY };
        self.total.or(matches!(self.goal, Goal::Noise(_)).then_some(unknown))
    }

    /// What quotas say of the end: samples in all and seconds that are left.
    fn look(&self, sampling: &AdaptiveSampling, costs: &Costs) -> Option<Left> {
        let costs = costs.seconds()?;
        let scouted = if self.is_scouted() { Some(self.scout.pixels()) } else { None };
        let dealt = || Dealt::of(sampling, scouted.into_iter().flatten());
        let (dealt, factor, measuring) = match self.goal {
            Goal::Limits => return None,
            Goal::TargetError(_) if self.sampling == Sampling::Uniform => return None,
            Goal::TargetError(_) => (dealt()?, 1.0, 0.0),
            Goal::Noise(asked) => {
                let dealt = dealt()?;
                let scouted = if self.is_scouted() { self.factor_to(asked, &dealt) } else { None };
                (dealt, scouted.or(self.factor)?, self.measuring())
            }
        };
        let [samples, drawn, left] = dealt.left(factor, &costs);
        Some(Left { samples, seconds: left + measuring * (drawn + left) })
    }

    /// Whether nothing is expected to be drawn but what all pixels get in any case.
    fn is_at_the_least(&self, left: &Left) -> bool {
        left.samples < 1.5 * self.first_samples
    }

    /// Whether scouted pixels say more than the steering knows: one measurement tells how large the error is, but not how it
    /// falls.
    fn is_scouted(&self) -> bool {
        !self.has_aovs && (self.rounds == 0 || self.rounds == 1 && self.level.is_some())
    }

    /// What quotas are to be multiplied by for the noise `asked` for, going by the scouted pixels.
    fn factor_to(&self, asked: f64, dealt: &Dealt) -> Option<f64> {
        let goal = asked.powi(2) / self.level.unwrap_or(1.0);
        let square = |factor: f64| self.scout.square(|number| dealt.asked(number, factor));
        // Nothing is known where too little was scouted.
        square(1.0 / LARGEST_FACTOR)?;
        let is_enough = |factor: f64| square(factor).is_none_or(|square| square <= goal);
        Some(least_factor(FACTOR_STEP, is_enough).unwrap_or(LARGEST_FACTOR))
    }

    /// Samples that measure the noise, over those in the picture.
    fn measuring(&self) -> f64 {
        // Rounds before the last have a third of the samples, all together.
        Effort::REPORT.expected_share(self.pixels) + 0.4 * Effort::STEP.expected_share(self.pixels)
    }
}
