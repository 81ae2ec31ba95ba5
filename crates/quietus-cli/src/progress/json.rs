//! Progress for machines: one JSON object per line on stdout.

use std::time::Duration;

use quietus_render::Progress;
use serde::Serialize;

use super::{Measure, Show, Snapshot};
use crate::say::{self, Kind};

/// The first line comes soon, so that a caller sees that it works.
const INTERVAL: Duration = Duration::from_millis(500);

/// Lines of JSON.
pub(super) struct Json {
    measure: Measure,
    next: Duration,
    newest: Option<Snapshot>,
}

/// Keys of a `progress` event; `docs/terminal.md` explains them.
#[derive(Serialize)]
struct ProgressEvent {
    share: Option<f64>,
    share_of: &'static str,
    elapsed_seconds: f64,
    remaining_seconds: Option<f64>,
    remaining_low_seconds: Option<f64>,
    remaining_high_seconds: Option<f64>,
    samples_foreseen: Option<u64>,
    noise_asked: Option<f64>,
    noise_reached: Option<f64>,
    noise_low: Option<f64>,
    noise_high: Option<f64>,
    noise_expected: Option<f64>,
    converged_fraction: f64,
    samples: u64,
    spp_mean: f64,
    spp_max: u32,
    samples_per_second: f64,
    rays: u64,
    rays_per_second: f64,
}

impl ProgressEvent {
    fn new(measure: Measure, snapshot: &Snapshot) -> Self {
        let &Snapshot { progress, spp_max, .. } = snapshot;
        let Progress { elapsed, samples, spp_mean, samples_per_second, .. } = progress;
        let percent = |share: f64| 100.0 * share;
        let measured = progress.noise.and_then(|noise| noise.measured);
        Self {
            share: measure.share(snapshot).map(|(share, _)| share),
            share_of: match measure {
                Measure::Converged => "pixels",
                Measure::Noise | Measure::Samples(_) => "samples",
                Measure::Time(_) => "time",
            },
            elapsed_seconds: elapsed.as_secs_f64(),
            remaining_seconds: progress.remaining.map(|left| left.as_secs_f64()),
            remaining_low_seconds: progress.remaining_range.map(|[low, _]| low.as_secs_f64()),
            remaining_high_seconds: progress.remaining_range.map(|[_, high]| high.as_secs_f64()),
            samples_foreseen: progress.foreseen_samples.map(|samples| samples as u64),
            noise_asked: progress.noise.map(|noise| percent(noise.asked)),
            noise_reached: measured.map(|noise| percent(noise.reached)),
            noise_low: measured.map(|noise| percent(noise.low)),
            noise_high: measured.map(|noise| percent(noise.high)),
            noise_expected: progress.noise.and_then(|noise| noise.expected).map(percent),
            converged_fraction: progress.converged_fraction,
            samples,
            spp_mean,
            spp_max,
            samples_per_second,
            rays: progress.rays,
            rays_per_second: progress.rays_per_second,
        }
    }
}

impl Json {
    pub(super) fn new(measure: Measure) -> Self {
        Self { measure, next: Duration::ZERO, newest: None }
    }
}

impl Show for Json {
    fn progress(&mut self, snapshot: &Snapshot) {
        self.newest = Some(*snapshot);
        if snapshot.progress.elapsed >= self.next {
            self.next = snapshot.progress.elapsed + INTERVAL;
            self.newest = None;
            say::event("progress", &ProgressEvent::new(self.measure, snapshot));
        }
    }

    fn words(&mut self, kind: Kind, text: &str) {
        say::directly(kind, text);
    }

    /// The last look is always told.
    fn close(&mut self) {
        if let Some(snapshot) = self.newest.take() {
            say::event("progress", &ProgressEvent::new(self.measure, &snapshot));
        }
    }
}
