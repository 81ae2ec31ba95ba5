//! How far a render is, and a guess at how long it will still take.

use std::collections::VecDeque;
use std::time::Duration;

use crate::noise::Noise;
use crate::outlook::Left;

/// What is known of the noise of a render that was asked for it, as a share of white.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseProgress {
    /// The noise asked for.
    pub asked: f64,
    /// What was measured last.
    pub measured: Option<Noise>,
    /// The noise it is expected to end with, where limits of samples keep it from the one asked for.
    pub expected: Option<f64>,
}

/// A look at a running render.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Since rendering started.
    pub elapsed: Duration,
    /// Samples drawn so far.
    pub samples: u64,
    /// Mean samples per pixel so far.
    pub spp_mean: f64,
    /// Samples drawn per second, lately.
    pub samples_per_second: f64,
    /// Rays traced so far: camera, bounce and shadow rays.
    pub rays: u64,
    /// Rays traced per second, lately.
    pub rays_per_second: f64,
    /// Share of pixels that will not be sampled any more, 0..=1.
    pub converged_fraction: f64,
    /// Guessed time until the end; `None` while there is nothing to guess from.
    pub remaining: Option<Duration>,
    /// The range that nine in ten of such guesses come to lie in; `None` where there is no guess, or no more to be said of it.
    pub remaining_range: Option<[Duration; 2]>,
    /// Guessed samples of the picture in the end; `None` while there is nothing to guess from.
    pub foreseen_samples: Option<f64>,
    /// The range that nine in ten of such guesses come to lie in.
    pub foreseen_range: Option<[f64; 2]>,
    /// The noise, where it was asked for.
    pub noise: Option<NoiseProgress>,
}

impl Progress {
    /// The range of the time left, where it is too wide for the guess alone to be told: nobody is helped by seconds that may
    /// be minutes.
    pub fn wide_range(&self) -> Option<[Duration; 2]> {
        self.remaining_range.filter(|[low, high]| high.as_secs() > LEAST_TOLD && *high > low.mul_f64(WIDE))
    }
}

/// A range is told from this upper end over the lower one on: a fifth to either side;
const WIDE: f64 = 1.5;

/// and where it goes beyond so many seconds.
const LEAST_TOLD: u64 = 9;

/// How much of the past counts as "lately", as a share of the time elapsed. Long enough to smooth over passes,
/// short enough to follow a render that slows down.
const RECENT: f64 = 0.3;

/// 95 % quantile of the normal distribution: nine tenths lie no further from its middle.
const RANGE: f64 = 1.645;

/// Below this share converged, its growth says nothing yet.
const LEAST_SHARE: f64 = 0.02;

#[derive(Clone, Copy)]
struct Point {
    seconds: f64,
    samples: u64,
    /// Seconds of one thread, those that measured the noise included.
    spent: f64,
    rays: u64,
    converged: f64,
}

/// What was drawn so far.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Drawn {
    /// Samples in the picture.
    pub(crate) samples: u64,
    /// Rays traced for the picture.
    pub(crate) rays: u64,
    /// Seconds of one thread that were spent, for the picture and on measuring its noise.
    pub(crate) spent: f64,
    /// What there is expected to be in the end, where that is known.
    pub(crate) total: Option<Left>,
}

/// Turns readings into [`Progress`].
pub(crate) struct Estimator {
    pixels: f64,
    /// Samples after which the render ends in any case.
    most_samples: Option<f64>,
    /// Seconds after which the render ends in any case.
    limit: Option<f64>,
    /// The first reading.
    began: Option<Point>,
    history: VecDeque<Point>,
}

impl Estimator {
    pub(crate) fn new(pixels: u64, most_samples: Option<f64>, limit: Option<Duration>) -> Self {
        let limit = limit.map(|l| l.as_secs_f64());
        Self { pixels: pixels as f64, most_samples, limit, began: None, history: VecDeque::new() }
    }

    pub(crate) fn reading(&mut self, elapsed: Duration, drawn: Drawn, converged: f64) -> Progress {
        let Drawn { samples, rays, spent, total } = drawn;
        let now = Point { seconds: elapsed.as_secs_f64(), samples, spent, rays, converged };
        let since = now.seconds * (1.0 - RECENT);
        while self.history.len() > 1 && self.history[1].seconds <= since {
            self.history.pop_front();
        }
        let start = Point { seconds: 0.0, samples: 0, spent: 0.0, rays: 0, converged: 0.0 };
        let before = self.history.front().copied().unwrap_or(start);
        self.history.push_back(now);
        self.began.get_or_insert(now);
        let span = (now.seconds - before.seconds).max(1e-9);
        let rate = now.samples.saturating_sub(before.samples) as f64 / span;
        let remaining = self.remaining(before, now, total);
        let foreseen = total.filter(|total| total.samples.is_finite());
        let rays_per_second = now.rays.saturating_sub(before.rays) as f64 / span;
        Progress {
            elapsed,
            samples,
            spp_mean: samples as f64 / self.pixels,
            samples_per_second: rate,
            rays,
            rays_per_second,
            converged_fraction: converged,
            remaining: remaining.map(Duration::from_secs_f64),
            remaining_range: remaining.zip(total).map(|(remaining, total)| {
                let factor = (RANGE * total.spread).exp();
                let ends = [remaining / factor, self.before_the_limit(now, remaining * factor)];
                ends.map(|end| Duration::from_secs_f64(end.max(0.0)))
            }),
            foreseen_samples: foreseen.map(|total| total.samples),
            foreseen_range: foreseen.map(|total| {
                let (factor, samples) = ((RANGE * total.spread).exp(), samples as f64);
                let left = (total.samples - samples).max(0.0);
                [samples + left / factor, samples + left * factor]
            }),
            noise: None,
        }
    }

    /// Seconds, or those that the limit leaves.
    fn before_the_limit(&self, now: Point, seconds: f64) -> f64 {
        self.limit.map_or(seconds, |limit| seconds.min(limit - now.seconds)).min(1e9)
    }

    /// The least of three ends: the work that the render is expected to take or, where nobody knows, the share converged
    /// grows on as lately; the most samples possible; the time limit.
    fn remaining(&self, before: Point, now: Point, total: Option<Left>) -> Option<f64> {
        let span = (now.seconds - before.seconds).max(1e-9);
        let at_rate = |left: f64, rate: f64| (rate > 0.0).then(|| left.max(0.0) / rate);
        let growth = (now.converged - before.converged) / span;
        let by_share =
            || (now.converged >= LEAST_SHARE && growth > 0.0).then(|| (1.0 - now.converged) / growth);
        // Threads work alike all the time, but for pauses between rounds: all of it says more than the last moments.
        let began = self.began.unwrap_or(now);
        let by_work = |total: Left| {
            at_rate(total.seconds - now.spent, (now.spent - began.spent) / (now.seconds - began.seconds))
        };
        let by_share = if total.is_some() { total.and_then(by_work) } else { by_share() };
        let rate = now.samples.saturating_sub(before.samples) as f64 / span;
        let by_samples = self.most_samples.and_then(|most| at_rate(most - now.samples as f64, rate));
        let by_limit = self.limit.map(|limit| limit - now.seconds);
        let least = [by_share, by_samples, by_limit].into_iter().flatten().reduce(f64::min)?;
        // A guess of centuries helps nobody, and would not fit a `Duration` for ever.
        (least < 1e9).then_some(least.max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(estimator: &mut Estimator, converged: impl Fn(f64) -> f64) -> Progress {
        let seconds = |i: u32| Duration::from_millis(100 * u64::from(i));
        let mut last = None;
        for i in 1..=50 {
            let (samples, rays) = (1000 * u64::from(i), 5000 * u64::from(i));
            let drawn = Drawn { samples, rays, spent: 0.5 * f64::from(i), ..Drawn::default() };
            last = Some(estimator.reading(seconds(i), drawn, converged(f64::from(i) / 50.0)));
        }
        last.unwrap()
    }

    fn left(progress: &Progress) -> f64 {
        progress.remaining.unwrap().as_secs_f64()
    }

    #[test]
    fn steady_work_ends_when_its_samples_are_drawn() {
        let progress = run(&mut Estimator::new(100, Some(100_000.0), None), |_| 0.0);
        assert!((progress.samples_per_second - 10_000.0).abs() < 1e-6);
        assert!((progress.rays_per_second - 50_000.0).abs() < 1e-6);
        assert!((progress.spp_mean - 500.0).abs() < 1e-9);
        assert!((left(&progress) - 5.0).abs() < 1e-6);
    }

    #[test]
    fn what_is_known_of_the_end_goes_before_what_is_guessed_of_it() {
        let mut estimator = Estimator::new(100, None, None);
        run(&mut estimator, |t| 0.25 * t);
        // Five threads.
        let total = Some(Left { samples: 0.0, seconds: 35.5, spread: 0.0 });
        let drawn = Drawn { samples: 51_000, spent: 25.5, total, ..Drawn::default() };
        let progress = estimator.reading(Duration::from_millis(5100), drawn, 0.25);
        assert!((left(&progress) - 2.0).abs() < 0.1, "{progress:?}");
    }

    #[test]
    fn steady_convergence_is_carried_on() {
        let progress = run(&mut Estimator::new(100, None, None), |t| 0.25 * t);
        assert!((left(&progress) - 15.0).abs() < 1e-6, "{progress:?}");
    }

    #[test]
    fn the_time_limit_bounds_the_guess_and_nothing_known_gives_none() {
        let limit = Some(Duration::from_secs(7));
        assert!((left(&run(&mut Estimator::new(100, Some(1e12), limit), |_| 0.0)) - 2.0).abs() < 1e-6);
        assert_eq!(run(&mut Estimator::new(100, None, None), |_| 0.0).remaining, None);
    }
}
