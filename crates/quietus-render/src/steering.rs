//! What the next round aims at: from what was asked for, what was measured, and what more samples will bring.
//!
//! **Noise.** After each round the noise is measured with fresh samples. How it falls with larger quotas is forecast from
//! the difference of halves, pixel by pixel, and the exponent of the fall is learnt from round to round. Far from the goal a
//! round multiplies the samples; then one goes half of the way, in samples, and the last one all of it. The last round is
//! decided *before* it is measured, and the report is that measurement: it has no part in the decision. Only where all of its
//! 95 % interval lies above the goal does another round follow, with a measurement of its own. Stopping at the first
//! measurement that happens to be low enough would make reports too good.
//!
//! **Time.** Each round is dealt what fits into a good half of the time that is left, at the speed of the one before, until
//! little is left; the last one is dealt more than fits, and is cut off.

use std::time::Duration;

use quietus::{AdaptiveSampling, Approach, PassCounts};
use serde::{Deserialize, Serialize};

use crate::aov_demand::AovDemand;
use crate::calibration::Calibration;
use crate::creep::Creep;
use crate::forecast::{Ahead, Forecast, Past, even, towards_a_noise};
use crate::noise::{Copied, Effort, Foretold, Measured, Noise, OfAovs};
use crate::pixel_errors::REPLICATES;
use crate::progress::NoiseProgress;
use crate::run::Bound;
use crate::scout::Known;
use crate::settings::{Goal, RenderSettings, Sampling};

/// Target error of the first round: no quota is above the minimum of samples.
const FIRST_TARGET: f64 = 1e3;

/// Target error below which every pixel goes to its maximum.
const ALL_TO_MAXIMUM: f64 = 1e-12;

/// Most that a round multiplies the samples by.
const LARGEST_STEP: f64 = 4.0;

/// Where the goal is further away than that, in samples, one goes half of the way first.
const LAST_STEP: f64 = 2.2;

/// The squared error falls as samples to the power of minus this, before a scene has shown how it does: independent samples
/// have 1, low-discrepancy points more.
const FIRST_FALL: f64 = 1.1;

/// The same for alpha, albedo and normal: edges, where low-discrepancy points gain more.
const FIRST_EDGE_FALL: f64 = 1.25;

/// Variance of the logarithm of what low-discrepancy points have gained at edges, before a measurement says: between nothing and
/// several times.
const EDGE_VARIANCE: f64 = 0.6;

/// Falls that are believed.
const FALLS: std::ops::RangeInclusive<f64> = 0.6..=1.6;

/// Samples that creep go where noise was found, and where there is none: they help half as much as others.
const CREEP_HELPS: f64 = 0.5;

/// Rounds after which the noise is what it is: no scene needs half as many.
const MOST_ROUNDS: u32 = 24;

/// Steps that change so little are not worth a round.
const SMALLEST_STEP: f64 = 1.01;

/// Share of the time left that a round is dealt.
const SHARE_OF_TIME: f64 = 0.6;

/// Share of all time in which the last round is dealt, and cut off.
const CUT_OFF: f64 = 0.06;

/// What a round aims at.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Aim {
    /// Target error for the library.
    pub(crate) target_error: f64,
    /// Samples per pixel, with uniform sampling.
    pub(crate) samples: u32,
    /// Passes that trees lag behind.
    pub(crate) lag: u32,
    /// How pixels come to their minimum.
    pub(crate) approach: Approach,
    /// Whether counts grow in fine steps, so that they end where they should.
    pub(crate) fine_steps: bool,
    /// Whether this should be where it ends.
    pub(crate) is_last: bool,
    /// What quotas will be multiplied by in the rounds that follow.
    pub(crate) factor_left: f64,
    /// What is asked of alpha, albedo and normals.
    pub(crate) aov_demand: Option<AovDemand>,
}

/// What is to be done after a round.
pub(crate) enum Verdict {
    /// Nothing: the picture is as it was asked for, or as it can be.
    Finished,
    /// Another round.
    GoOn(Aim),
    /// The picture is done; the measurement that says so decided it, so that the report needs another one.
    MeasureAgain,
}

/// What is known of the noise, and what follows from it.
pub(crate) struct Steering {
    settings: RenderSettings,
    learnt: Learnt,
    /// What independent samples would have multiplied the squared error of alpha, albedo and normal by in the last round.
    edges_fell: Option<f64>,
    /// The noise with the most samples that there may be, by the last measurement; `None` where nothing was said of that.
    at_most: Option<Foretold>,
}

/// What the rounds so far have taught: all that the next decision needs besides the settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Learnt {
    /// Rounds so far.
    rounds: u32,
    /// The noise measured last, and whether it may be reported.
    measured: Option<(Noise, bool)>,
    /// That of alpha, albedo and normal, measured with it.
    aovs: OfAovs<Noise>,
    calibration: Calibration,
    /// The same for alpha, albedo and normal, whose variances the film knows: what low-discrepancy points gain.
    edge_calibration: Calibration,
    /// The mean squared errors of alpha, albedo and normal over those asked for, added up, by all that was measured.
    edge_square: Option<f64>,
    /// The squared error falls as samples to the power of minus this.
    fall: f64,
    /// The same for alpha, albedo and normal.
    edge_fall: f64,
    /// As of the end of the round before.
    before: Option<Past>,
    creep: Creep,
    bound: Option<Bound>,
    /// The noise it will end with, where that is not the one asked for.
    expected: Option<f64>,
}

impl Steering {
    pub(crate) fn new(settings: &RenderSettings) -> Self {
        let learnt = Learnt {
            rounds: 0,
            measured: None,
            aovs: OfAovs::default(),
            calibration: Calibration::default(),
            edge_calibration: Calibration { ratio: 0.0, variance: EDGE_VARIANCE },
            edge_square: None,
            fall: FIRST_FALL,
            edge_fall: FIRST_EDGE_FALL,
            before: None,
            creep: Creep::default(),
            bound: None,
            expected: None,
        };
        Self { settings: settings.clone(), learnt, edges_fell: None, at_most: None }
    }

    /// What was learnt so far.
    pub(crate) fn learnt(&self) -> &Learnt {
        &self.learnt
    }

    /// Goes on from what another one has learnt. False where nobody can have learnt that.
    pub(crate) fn restore(&mut self, learnt: Learnt) -> bool {
        self.learnt = learnt;
        self.learnt.rounds < u32::MAX / 2
    }

    /// Another noise is asked for, whatever the goal was.
    pub(crate) fn ask(&mut self, noise: f64) {
        self.settings.goal = Goal::Noise(noise);
        (self.learnt.bound, self.learnt.expected) = (None, None);
    }

    /// What the first round aims at.
    pub(crate) fn first(&self) -> Aim {
        let RenderSettings { goal, min_samples, max_samples, .. } = self.settings;
        let (target_error, samples, is_last) = match goal {
            Goal::TargetError(target_error) => (target_error, max_samples, true),
            Goal::Limits if !self.has_rounds() => (ALL_TO_MAXIMUM, max_samples, true),
            Goal::Noise(_) | Goal::Limits => (FIRST_TARGET, min_samples.max(1), false),
        };
        let lag = self.settings.machinery.lag;
        Aim {
            target_error,
            samples,
            lag,
            approach: self.approach(),
            fine_steps: false,
            is_last,
            factor_left: 1.0,
            aov_demand: self.aov_demand(),
        }
    }

    /// How pixels come to their minimum: where time may end a render before they have it, so that it shows nowhere.
    fn approach(&self) -> Approach {
        let may_end_anywhere = self.settings.time_limit.is_some() && self.settings.sampling.can_forecast();
        if may_end_anywhere { Approach::Spread } else { Approach::Whole }
    }

    fn aov_demand(&self) -> Option<AovDemand> {
        AovDemand::of(&self.settings)
    }

    /// Whether there may be more than one round.
    pub(crate) fn has_rounds(&self) -> bool {
        match self.settings.goal {
            Goal::Noise(_) => true,
            // Uniform sampling is as good as it gets at any time.
            Goal::Limits => self.settings.sampling == Sampling::Quietus && self.settings.time_limit.is_some(),
            Goal::TargetError(_) => false,
        }
    }

    /// The noise asked for.
    pub(crate) fn asked(&self) -> Option<f64> {
        match self.settings.goal {
            Goal::Noise(noise) => Some(noise),
            Goal::TargetError(_) | Goal::Limits => None,
        }
    }

    /// The measurement to report.
    pub(crate) fn reported(&self) -> Option<Noise> {
        self.learnt.measured.filter(|(_, is_report)| *is_report).map(|(noise, _)| noise)
    }

    /// The noise of alpha, albedo and normal to report with it.
    pub(crate) fn reported_aovs(&self) -> OfAovs<Noise> {
        if self.reported().is_some() { self.learnt.aovs } else { OfAovs::default() }
    }

    /// Noises of alpha, albedo and normal as they are, and as they were asked for.
    fn asked_aovs(&self) -> impl Iterator<Item = (Noise, f64)> {
        let pairs = self.learnt.aovs.into_iter().zip(self.settings.aov_noise);
        pairs.filter_map(|(noise, asked)| noise.zip(asked))
    }

    /// What the mean squared errors of alpha, albedo and normal may be multiplied by, if they fell as those of independent
    /// samples.
    fn edges_goal(&self) -> f64 {
        let goals = self.asked_aovs().map(|(noise, asked)| (asked / noise.reached).powi(2));
        // One measurement knows which of them is furthest from its goal; how far, all of them do.
        let measured = self.aovs_together().map_or(1.0, |noise| noise.reached.powi(2));
        let believed = self.learnt.edge_square.filter(|&square| square > 0.0).unwrap_or(measured);
        (goals.fold(f64::INFINITY, f64::min) * measured / believed).powf(1.0 / self.learnt.edge_fall)
    }

    /// The noises of alpha, albedo and normal over those asked for, added up as squares, with the precision of the least
    /// known; `None` where nothing was asked for, or there is none.
    fn aovs_together(&self) -> Option<Noise> {
        let square: f64 = self.asked_aovs().map(|(noise, asked)| (noise.reached / asked).powi(2)).sum();
        let deviation = self.asked_aovs().filter(|(noise, _)| noise.reached > 0.0);
        let width = deviation.map(|(noise, _)| noise.reached / noise.low).reduce(f64::max)?;
        let reached = square.sqrt();
        Some(Noise { reached, low: reached / width, high: reached * width })
    }

    /// What keeps the picture from what was asked for.
    pub(crate) fn bound(&self) -> Option<Bound> {
        self.learnt.bound
    }

    /// The squared error that was measured last.
    pub(crate) fn measured(&self) -> Option<Known> {
        let (noise, _) = self.learnt.measured.filter(|(noise, _)| noise.reached > 0.0)?;
        Some(Known { value: noise.reached.powi(2), variance: (2.0 * noise.log_deviation()).powi(2) })
    }

    /// What a watcher is told.
    pub(crate) fn progress(&self) -> Option<NoiseProgress> {
        let measured = self.learnt.measured.map(|(noise, _)| noise);
        self.asked().map(|asked| NoiseProgress { asked, measured, expected: self.learnt.expected })
    }

    /// Looks at the picture at the end of a round.
    pub(crate) fn look(&mut self, picture: &Copied, sampling: &AdaptiveSampling) -> Forecast {
        self.learnt.rounds += 1;
        let now = Forecast::new(&picture.finished(), sampling, self.counts());
        self.learnt.creep.learn(sampling.counts().total() as f64);
        if let Some(fall) = self.learnt.before.as_ref().and_then(|before| before.fall_to(&now)) {
            self.learnt.fall = 0.5 * (self.learnt.fall + fall.clamp(*FALLS.start(), *FALLS.end()));
        }
        self.edges_fell = self.learnt.before.as_ref().and_then(|before| before.edges_to(&now));
        let now = now.with_fall(self.learnt.fall);
        self.learnt.before = Some(now.past());
        now
    }

    /// How passes draw on the way.
    fn counts(&self) -> PassCounts {
        self.settings.library(REPLICATES as u32, FIRST_TARGET).pass_counts()
    }

    /// What the next round, or the last one, will come to beyond what quotas say, as a share of what they add.
    pub(crate) fn creep(&self, is_last: bool) -> f64 {
        match self.settings.sampling {
            Sampling::Uniform => 0.0,
            _ => self.learnt.creep.expected(is_last),
        }
    }

    /// Takes in a measurement; whether it may be reported depends on what follows.
    pub(crate) fn take(&mut self, measured: &Measured, forecast: &Forecast) {
        let noise = measured.noise;
        (self.learnt.measured, self.learnt.aovs) = (Some((noise, false)), measured.aovs);
        let limit = Some(self.settings.max_samples).filter(|&limit| limit < u32::MAX);
        self.at_most = limit.and_then(|limit| measured.falling.at(limit, noise));
        self.learn_edges(forecast);
        self.learnt.calibration.take(noise, forecast.square);
    }

    /// Learns how large the squared error of alpha, albedo and normal is, and how fast it falls.
    fn learn_edges(&mut self, forecast: &Forecast) {
        let Some(noise) = self.aovs_together() else { return };
        self.learnt.edge_calibration.take(noise, forecast.edges);
        let now = self.learnt.edge_calibration.square(forecast.edges);
        let before = self.learnt.edge_square.replace(now);
        if let (Some(before), Some(expected)) = (before, self.edges_fell) {
            let fall = (now / before).ln() / expected.ln();
            if fall.is_finite() {
                let fall = fall.clamp(*FALLS.start(), *FALLS.end());
                self.learnt.edge_fall = 0.5 * (self.learnt.edge_fall + fall);
            }
        }
    }

    /// How well to measure a step: the further it goes from there, the more is lost by not knowing how far.
    pub(crate) fn effort(&self, forecast: &Forecast) -> Effort {
        let square = self.learnt.calibration.square(forecast.square);
        let goal = self.asked().unwrap_or(1.0).powi(2) / square;
        let last = self.in_the_last_round(forecast);
        let reach = last.least(|ahead| ahead.square <= goal).unwrap_or_else(|| last.limit());
        Effort::STEP.for_way_of(reach.samples)
    }

    /// What larger quotas bring in the last round towards a noise.
    fn in_the_last_round(&self, forecast: &Forecast) -> Forecast {
        forecast.by(towards_a_noise(self.counts()), CREEP_HELPS * self.creep(true))
    }

    /// Whether quotas have been set by what was found.
    pub(crate) fn is_past_the_first(&self) -> bool {
        self.learnt.rounds > 0
    }

    /// What is to be done after the round that aimed at `aim`.
    pub(crate) fn verdict(&mut self, aim: &Aim, forecast: &Forecast, time: &TimeLeft) -> Verdict {
        let (next, is_last, goal) = match self.asked() {
            Some(asked) => match self.next_for_noise(asked, aim, forecast) {
                Ok(next) => next,
                Err(verdict) => return verdict,
            },
            None => (forecast.limit(), true, forecast.limit()),
        };
        let (next, is_last) = match time.fitting(forecast) {
            None => return Verdict::Finished,
            Some((fits, is_over)) if fits.samples < next.samples => (fits, is_over),
            Some(_) => (next, is_last),
        };
        let ends_at_a_noise = is_last && self.asked().is_some();
        let counts = if ends_at_a_noise { towards_a_noise(self.counts()) } else { self.counts() };
        let foreseen = time.samples * forecast.by(counts, 0.0).at(next.factor).samples;
        self.learnt.creep.foresee(time.samples, foreseen);
        Verdict::GoOn(Aim {
            target_error: aim.target_error / next.factor,
            samples: even(f64::from(aim.samples) * next.factor),
            // Every step of a lag is one further than asked for: too far for the end.
            lag: if ends_at_a_noise { 1 } else { self.settings.machinery.lag },
            approach: self.approach(),
            fine_steps: ends_at_a_noise,
            is_last,
            factor_left: (goal.factor / next.factor).max(1.0),
            aov_demand: self.aov_demand(),
        })
    }

    /// The next step towards the noise asked for, whether it is the last, and the step all of the way.
    fn next_for_noise(
        &mut self,
        asked: f64,
        aim: &Aim,
        forecast: &Forecast,
    ) -> Result<(Ahead, bool, Ahead), Verdict> {
        let Some((measured, _)) = self.learnt.measured else { return Err(Verdict::Finished) };
        let is_any_missed = measured.low > asked || self.asked_aovs().any(|(noise, asked)| noise.low > asked);
        let is_missed = is_any_missed && self.learnt.rounds < MOST_ROUNDS;
        if aim.is_last && !is_missed {
            return Err(self.finish(measured));
        }
        let square = self.learnt.calibration.square(forecast.square);
        let (goal, edges) = (asked.powi(2) / square, self.edges_goal());
        let last = self.in_the_last_round(forecast);
        let best = last.limit();
        let reach = last.least(|ahead| ahead.square <= goal && ahead.edges <= edges);
        self.foretell(asked, reach.is_none());
        // Where it is out of reach: almost as far as one gets, as the rest would go to pixels that hardly matter.
        let reach = reach.or_else(|| {
            let limit = |ahead: &Ahead| {
                ahead.square <= goal.max(1.005 * best.square) && ahead.edges <= edges.max(1.005 * best.edges)
            };
            last.least(limit)
        });
        let Some(reach) = reach.filter(|reach| reach.samples > SMALLEST_STEP) else {
            return Err(self.finish_early(measured, asked));
        };
        if reach.samples <= LAST_STEP {
            return Ok((reach, true, reach));
        }
        let step = LARGEST_STEP.min(0.5 * reach.samples);
        let step = forecast.least(|ahead| ahead.samples >= step).unwrap_or(reach);
        Ok((step, false, reach))
    }

    /// Says what noise the maximum of samples allows, where that is out of reach, or will be by all that was measured: by more
    /// than that is uncertain.
    fn foretell(&mut self, asked: f64, is_out_of_reach: bool) {
        self.learnt.bound = is_out_of_reach.then_some(Bound::MaxSamples);
        let least = |at_most: &Foretold| asked * if is_out_of_reach { 1.0 } else { at_most.deviation.exp() };
        self.learnt.expected =
            self.at_most.filter(|at_most| at_most.noise > least(at_most)).map(|at_most| at_most.noise);
    }

    fn finish(&mut self, measured: Noise) -> Verdict {
        self.learnt.measured = Some((measured, true));
        Verdict::Finished
    }

    /// The goal is reached before a round was meant to be the last.
    fn finish_early(&mut self, measured: Noise, asked: f64) -> Verdict {
        if self.learnt.rounds == 1 && self.learnt.bound.is_none() {
            self.learnt.bound = Some(Bound::MinSamples);
        }
        // Nothing else can have come of a measurement that is that far from what was asked for.
        let is_clear =
            measured.is_clear_of(asked) && self.asked_aovs().all(|(noise, asked)| noise.is_clear_of(asked));
        match is_clear {
            true => self.finish(measured),
            false => Verdict::MeasureAgain,
        }
    }

    /// Takes in the measurement that was asked for by [`Verdict::MeasureAgain`].
    pub(crate) fn take_report(&mut self, measured: &Measured) {
        (self.learnt.measured, self.learnt.aovs) = (Some((measured.noise, true)), measured.aovs);
    }
}

/// The time that is left, and what may be done in it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TimeLeft {
    /// Time in all; `None` for no limit.
    pub(crate) limit: Option<Duration>,
    /// Time since the start.
    pub(crate) elapsed: Duration,
    /// Samples there are.
    pub(crate) samples: f64,
    /// Samples drawn per second in the last round.
    pub(crate) pace: f64,
}

impl TimeLeft {
    /// What fits into the time that is left, and whether that is the last round. `None` where nothing does.
    fn fitting(&self, forecast: &Forecast) -> Option<(Ahead, bool)> {
        let Some(limit) = self.limit else { return Some((forecast.limit(), true)) };
        let left = limit.saturating_sub(self.elapsed).as_secs_f64();
        if left <= 0.0 || forecast.limit().samples <= 1.0 {
            return None;
        }
        let is_last = left < CUT_OFF * limit.as_secs_f64();
        let fits = self.pace * left * if is_last { 2.0 } else { SHARE_OF_TIME };
        let samples = 1.0 + fits / self.samples.max(1.0);
        let ahead = forecast.least(|ahead| ahead.samples >= samples).unwrap_or_else(|| forecast.limit());
        Some((ahead, is_last))
    }
}
