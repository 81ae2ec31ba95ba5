//! Whether renders that are asked for a noise or a time get it: live renders with seeds of their own, against a
//! reference.

use std::{
    num::NonZeroUsize,
    sync::atomic::AtomicBool,
    time::{Duration, Instant},
};

use quietus_film::Window;
use quietus_render::{
    Bound, Control, Goal, Machinery, PathTracer, RenderSettings, Sampling, Watched, render, shown_error,
};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{EvalError, Look, Picture, Reference, Subject, measure::Measure, measure::errors};

/// What is asked of the renders.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Asked {
    /// A noise, as a share of white. Runs share the machine.
    Noise(f64),
    /// A time. Runs have it one after the other.
    Time(Duration),
}

/// How often, and with what.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GoalPlan {
    /// What is asked for.
    pub asked: Asked,
    /// Renders, each with a seed of its own.
    pub runs: u32,
    /// No more renders are begun after this time.
    pub time: Option<Duration>,
    /// Seed of the first.
    pub seed: u64,
    /// Samples that every pixel gets.
    pub min_samples: u32,
    /// Samples that no pixel exceeds.
    pub max_samples: u32,
}

/// A render, and what it came to. Noise is a share of white.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GoalRun {
    /// The noise it reported, and the ends of its interval; none where it was stopped before it could.
    pub reported: Option<[f64; 3]>,
    /// Its squared error against the reference, less that of the reference: the mean over pixels and channels as they are
    /// displayed.
    pub true_square: f64,
    /// Mean samples per pixel in the picture.
    pub spp: f64,
    /// Samples drawn to measure the noise, over those in the picture.
    pub measuring: f64,
    /// Rounds of sampling.
    pub rounds: u32,
    /// Whether the minimum or the maximum of samples kept it from what was asked for.
    pub bound: bool,
    /// The noise it said it would reach instead, when it first said so, and the share of its samples that it had by then.
    pub foretold: Option<[f64; 2]>,
    /// Seconds it took.
    pub seconds: f64,
    /// The time it was expected to take in all, over the time it took: as it said at [`MOMENTS`]. `None` where it said
    /// nothing.
    pub expected: [Option<f64>; MOMENTS.len()],
    /// The samples it was expected to draw in all, over those it drew: as it said at [`MOMENTS`] of its samples. Unlike times
    /// they do not depend on what else the machine had to do.
    pub expected_samples: [Option<f64>; MOMENTS.len()],
    /// Whether the range of samples that it gave then held them.
    pub expected_held: [Option<bool>; MOMENTS.len()],
    /// What it said all along, as far as it said something: seconds since its start, and those it would take in all.
    pub foreseen: Vec<[f64; 2]>,
}

/// Shares of a render's time at which its guess at the end is looked at.
pub const MOMENTS: [f64; 4] = [0.1, 0.25, 0.5, 0.75];

impl GoalRun {
    /// The true noise.
    pub fn truth(&self) -> f64 {
        self.true_square.max(0.0).sqrt()
    }

    /// Whether the reported interval holds the truth.
    pub fn is_covered(&self) -> Option<bool> {
        self.reported.map(|[_, low, high]| (low..=high).contains(&self.truth()))
    }
}

/// Renders `subject` as the plan says, and compares with the reference. At least one render.
///
/// # Errors
/// Where the scene cannot be drawn.
pub fn goal_runs(
    subject: &Subject,
    reference: &Reference,
    plan: &GoalPlan,
) -> Result<Vec<GoalRun>, EvalError> {
    let start = Instant::now();
    let is_late = || plan.time.is_some_and(|time| start.elapsed() >= time);
    let run = |k: u32| {
        let may_begin = k == 0 || !is_late();
        may_begin.then(|| goal_run(subject, reference, plan, plan.seed.wrapping_add(k.into())))
    };
    match plan.asked {
        Asked::Noise(_) => (0..plan.runs).into_par_iter().with_max_len(1).filter_map(run).collect(),
        Asked::Time(_) => (0..plan.runs).filter_map(run).collect(),
    }
}

fn goal_run(
    subject: &Subject,
    reference: &Reference,
    plan: &GoalPlan,
    seed: u64,
) -> Result<GoalRun, EvalError> {
    let look = &reference.spec.look;
    let view = subject.view(look, seed)?;
    let tracer = PathTracer { scene: &subject.scene, view: &view };
    let (mut readings, mut foreseen_samples, mut foretold) = (Vec::new(), Vec::new(), None);
    let mut watch = |watched: &Watched<'_>| {
        let progress = &watched.progress;
        let samples = (progress.samples as f64, progress.foreseen_samples, progress.foreseen_range);
        readings.push((progress.elapsed.as_secs_f64(), progress.remaining.map(|left| left.as_secs_f64())));
        foreseen_samples.push(samples);
        let expected = progress.noise.and_then(|noise| noise.expected);
        foretold = foretold.or(expected.map(|noise| [noise, samples.0]));
    };
    let mut control = Control { cancel: &AtomicBool::new(false), watch: &mut watch, live: None };
    let rendered = render(&tracer, &settings(look, plan), &mut control)
        .map_err(|e| EvalError::Request(format!("a render of {} failed: {e}", subject.name)))?;
    let picture = rendered.film.picture(shown_error);
    let rgb = picture.beauty.iter().map(|c| [c[0], c[1], c[2]]).collect();
    let picture = Picture { width: look.width, height: look.height, rgb };
    let statistics = &rendered.statistics;
    let seconds = statistics.wall_seconds;
    let expected = MOMENTS.map(|share| {
        let reading = readings.iter().find(|(elapsed, _)| *elapsed >= share * seconds)?;
        Some((reading.0 + reading.1?) / seconds)
    });
    let samples = statistics.samples as f64;
    let reading = |share: f64| foreseen_samples.iter().find(|(drawn, ..)| *drawn >= share * samples);
    let expected_samples = MOMENTS.map(|share| Some(reading(share)?.1? / samples));
    let expected_held = MOMENTS.map(|share| {
        let [low, high] = reading(share)?.2?;
        Some((low..=high).contains(&samples))
    });
    let foreseen = readings.iter().filter_map(|&(elapsed, left)| Some([elapsed, elapsed + left?])).collect();
    Ok(GoalRun {
        reported: rendered.noise.map(|noise| [noise.reached, noise.low, noise.high]),
        true_square: errors(&picture, reference).mean(Measure::Display),
        spp: statistics.per_pixel.spp_mean,
        measuring: statistics.noise_samples as f64 / statistics.samples.max(1) as f64,
        rounds: statistics.rounds,
        bound: matches!(rendered.bound, Some(Bound::MinSamples | Bound::MaxSamples)),
        foretold: foretold.map(|[noise, drawn]| [noise, drawn / samples.max(1.0)]),
        seconds,
        expected,
        expected_samples,
        expected_held,
        foreseen,
    })
}

fn settings(look: &Look, plan: &GoalPlan) -> RenderSettings {
    let (goal, time_limit) = match plan.asked {
        Asked::Noise(noise) => (Goal::Noise(noise), None),
        Asked::Time(time) => (Goal::Limits, Some(time)),
    };
    RenderSettings {
        frame: [look.width, look.height],
        window: Window { x0: 0, y0: 0, x1: look.width, y1: look.height },
        sampling: Sampling::Quietus,
        goal,
        min_samples: plan.min_samples,
        max_samples: plan.max_samples,
        time_limit,
        threads: NonZeroUsize::MIN,
        machinery: Machinery::default(),
        weights: None,
        aov_noise: [None; 3],
    }
}
