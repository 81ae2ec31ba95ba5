//! The last words of a render.

use std::path::PathBuf;

use quietus_film::RejectedSamples;
use quietus_render::{AovStatistics, Bound, Rendered, Sampling, StoppedBy};
use serde::Serialize;

use crate::plan::Plan;
use crate::report::stopped_by;
use crate::say;

/// Warns of samples that were left out.
pub(crate) fn warn_of_rejected(rejected: &RejectedSamples, seed: u64) {
    if rejected.count() == 0 {
        return;
    }
    let mut text = format!("{} samples were not finite and left out; the first ones:", rejected.count());
    for sample in rejected.first() {
        let (x, y, replicate, index) = (sample.x, sample.y, sample.replicate, sample.index);
        text.push_str(&format!("\n  pixel ({x}, {y}), replicate {replicate}, sample {index}, seed {seed}"));
    }
    say::warning(text);
}

/// What the `end` event says; `docs/terminal.md` explains the keys.
pub(crate) fn ending(frame: Option<u32>, rendered: &Rendered, wrote: &[PathBuf]) -> End {
    let statistics = &rendered.statistics;
    End {
        stopped_by: stopped_by(rendered.stopped_by),
        frame,
        wrote: wrote.to_vec(),
        wall_seconds: statistics.wall_seconds,
        samples: statistics.samples,
        rays: statistics.rays,
        spp_mean: statistics.per_pixel.spp_mean,
        spp_max: statistics.per_pixel.spp_max,
        converged_fraction: statistics.converged_fraction,
        noise_reached: statistics.noise_reached,
        noise_low: statistics.noise_low,
        noise_high: statistics.noise_high,
    }
}

/// The `end` event.
#[derive(Serialize)]
pub(crate) struct End {
    stopped_by: &'static str,
    frame: Option<u32>,
    wrote: Vec<PathBuf>,
    wall_seconds: f64,
    samples: u64,
    rays: u64,
    spp_mean: f64,
    spp_max: u32,
    converged_fraction: f64,
    noise_reached: Option<f64>,
    noise_low: Option<f64>,
    noise_high: Option<f64>,
}

/// The last words: how far it came, and where the pictures are.
pub(crate) fn summary(plan: &Plan, frame: Option<u32>, rendered: &Rendered, wrote: &[PathBuf]) -> String {
    let statistics = &rendered.statistics;
    let ending = match rendered.stopped_by {
        StoppedBy::Done => "done",
        StoppedBy::TimeLimit => "time is up",
        StoppedBy::Cancelled => "interrupted",
    };
    let converged = match plan.sampling {
        Sampling::Uniform => String::new(),
        _ => format!("{:.1} % converged, ", 100.0 * statistics.converged_fraction),
    };
    let frame_name = frame.map_or_else(String::new, |frame| format!("frame {frame} "));
    let mut text = format!(
        "{frame_name}{ending}: {converged}{:.1} samples per pixel (at most {}), {:.1} s, {:.2} M samples/s",
        statistics.per_pixel.spp_mean,
        statistics.per_pixel.spp_max,
        statistics.wall_seconds,
        statistics.samples as f64 / statistics.wall_seconds.max(1e-9) / 1e6,
    );
    text.push_str(&noise(rendered));
    for path in wrote {
        let shown = std::fs::canonicalize(path).unwrap_or_else(|_| path.clone());
        text.push_str(&format!("\nwrote {}", shown.display()));
    }
    text
}

/// The noise that was reached, of the picture and of the AOVs it was asked of, each on a line of its own.
fn noise(rendered: &Rendered) -> String {
    let statistics = &rendered.statistics;
    let mut text = String::new();
    if let (Some(reached), Some(low), Some(high)) =
        (statistics.noise_reached, statistics.noise_low, statistics.noise_high)
    {
        let interval = format!("(95 % interval {low:.2}-{high:.2})");
        let weighted = if statistics.noise_is_weighted { ", weighted" } else { "" };
        text.push_str(&match statistics.noise_asked {
            Some(asked) => {
                format!(
                    "\nnoise{weighted}: asked {asked} %, reached {reached:.2} % of white {interval}{}",
                    bound(rendered)
                )
            }
            None => format!("\nnoise{weighted} {reached:.2} % of white {interval}"),
        });
    } else if rendered.stopped_by == StoppedBy::TimeLimit {
        text.push_str("\nnoise: not measured, as time was up");
    }
    for aov in statistics.aov_noise.iter().filter(|aov| aov.asked.is_some()) {
        let AovStatistics { name, asked, reached, low, high } = aov;
        let asked = asked.unwrap_or_default();
        text.push_str(&format!(
            "\nnoise of {name}: asked {asked} %, reached {reached:.2} % (95 % interval {low:.2}-{high:.2})"
        ));
    }
    text
}

/// What kept the noise from being what was asked for.
fn bound(rendered: &Rendered) -> &'static str {
    match rendered.bound {
        None => "",
        Some(Bound::MinSamples) => "; --min-samples alone comes to that",
        Some(Bound::MaxSamples) => "; --max-samples keeps it from less",
    }
}
