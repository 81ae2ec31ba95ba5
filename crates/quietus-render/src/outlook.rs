//! How many samples a render will have drawn when it is done: what the guess at its end is made of.

use std::time::Duration;

use quietus::{AdaptiveSampling, Policy};
use quietus_film::Film;

use crate::forecast::{Forecast, samples_at};
use crate::noise::{Copied, Effort};
use crate::settings::{Goal, RenderSettings, Sampling};

/// Looks cost a pass over all pixels: not before this much more time, relative and absolute.
const PAUSE: (f64, Duration) = (1.05, Duration::from_millis(150));

/// Samples per pixel below which halves say nothing.
const LEAST_SAMPLES: f64 = 4.0;

/// The samples a render will have drawn, as far as that is known.
pub(crate) struct Outlook {
    goal: Goal,
    sampling: Sampling,
    pixels: f64,
    min_samples: f64,
    /// What steering multiplies the quotas of the present round by until the end; `None` in the first, where nobody knows.
    factor: Option<f64>,
    looked: Option<Duration>,
    total: Option<f64>,
}

impl Outlook {
    pub(crate) fn new(settings: &RenderSettings) -> Self {
        Self {
            goal: settings.goal,
            sampling: settings.sampling,
            pixels: settings.window.pixels() as f64,
            min_samples: settings.min_samples.into(),
            factor: None,
            looked: None,
            total: None,
        }
    }

    /// Another noise is asked for.
    pub(crate) fn ask(&mut self, noise: f64) {
        self.goal = Goal::Noise(noise);
    }

    /// A new round begins, whose quotas will be multiplied by `factor` in the rounds that follow.
    pub(crate) fn begin(&mut self, factor: f64) {
        (self.factor, self.looked) = (Some(factor), None);
    }

    /// The samples there will be in the end, those that measure the noise included; `None` while that is not known.
    pub(crate) fn total(
        &mut self,
        elapsed: Duration,
        samples: u64,
        film: &Film,
        sampling: &AdaptiveSampling,
    ) -> Option<f64> {
        let (factor, pause) = PAUSE;
        let is_early = self.looked.is_some_and(|at| elapsed < at.mul_f64(factor).max(at + pause));
        if !is_early {
            self.looked = Some(elapsed);
            self.total = self.look(samples as f64, film, sampling).or(self.total);
        }
        self.total
    }

    /// What was found last.
    pub(crate) fn known(&self) -> Option<f64> {
        self.total
    }

    fn look(&self, samples: f64, film: &Film, sampling: &AdaptiveSampling) -> Option<f64> {
        match (self.goal, self.factor) {
            (Goal::Limits, _) => None,
            (Goal::TargetError(_), _) if self.sampling == Sampling::Uniform => None,
            (Goal::TargetError(_), _) => samples_at(sampling, 1.0),
            (Goal::Noise(asked), None) if samples >= LEAST_SAMPLES * self.pixels => {
                let picture = Copied::of(film);
                let is_dealt = sampling.settings().policy == Policy::Quietus;
                let guess = Forecast::guess(&picture.finished(), asked, self.min_samples, is_dealt);
                Some(guess * (1.0 + self.measuring()))
            }
            (Goal::Noise(_), None) => None,
            (Goal::Noise(_), Some(factor)) => {
                let picture = match self.sampling {
                    Sampling::Uniform => f64::from(sampling.settings().max_samples) * self.pixels * factor,
                    _ => samples_at(sampling, factor)?,
                };
                Some(picture * (1.0 + self.measuring()))
            }
        }
    }

    /// Samples that measure the noise, over those in the picture.
    fn measuring(&self) -> f64 {
        // Rounds before the last have a third of the samples, all together.
        Effort::REPORT.expected_share(self.pixels) + 0.4 * Effort::STEP.expected_share(self.pixels)
    }
}
