//! The progress bar; nothing where stderr is not a terminal.

use std::io::IsTerminal;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use quietus_render::Progress;

/// Steps of the bar: a tenth of a percent each.
const STEPS: u64 = 1000;

/// What the bar shows the share of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Measure {
    /// Pixels that are done.
    Converged,
    /// So many samples.
    Samples(f64),
    /// So much time.
    Time(Duration),
}

/// A bar on stderr.
pub(crate) struct Bar {
    bar: ProgressBar,
    measure: Measure,
}

impl Bar {
    /// An empty bar.
    pub(crate) fn new(measure: Measure) -> Self {
        let target = match std::io::stderr().is_terminal() {
            true => ProgressDrawTarget::stderr_with_hz(10),
            false => ProgressDrawTarget::hidden(),
        };
        let bar = ProgressBar::with_draw_target(Some(STEPS), target);
        if let Ok(style) = ProgressStyle::with_template("{wide_bar:.cyan/blue} {msg}") {
            bar.set_style(style);
        }
        Self { bar, measure }
    }

    /// Shows `progress`.
    pub(crate) fn update(&self, progress: &Progress) {
        let (share, what) = match self.measure {
            Measure::Converged => (progress.converged_fraction, "converged"),
            Measure::Samples(all) => (progress.samples as f64 / all, "drawn"),
            Measure::Time(all) => (progress.elapsed.as_secs_f64() / all.as_secs_f64(), "of the time"),
        };
        self.bar.set_position((share.clamp(0.0, 1.0) * STEPS as f64) as u64);
        self.bar.set_message(line(progress, share, what));
    }

    /// Takes the bar away.
    pub(crate) fn clear(&self) {
        self.bar.finish_and_clear();
    }
}

fn line(progress: &Progress, share: f64, what: &str) -> String {
    let left = progress.remaining.map_or_else(|| "?".to_owned(), duration);
    format!(
        "{:.1} % {what}, {:.1} spp, {:.2} M samples/s, {} done, {left} left",
        100.0 * share,
        progress.spp_mean,
        progress.samples_per_second / 1e6,
        duration(progress.elapsed),
    )
}

/// Hours, minutes and seconds as `1:02:03` or `2:03`.
fn duration(time: Duration) -> String {
    let seconds = time.as_secs();
    let (hours, minutes, seconds) = (seconds / 3600, seconds / 60 % 60, seconds % 60);
    match hours {
        0 => format!("{minutes}:{seconds:02}"),
        _ => format!("{hours}:{minutes:02}:{seconds:02}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_tells_share_speed_and_time() {
        let progress = Progress {
            elapsed: Duration::from_secs(63),
            samples: 10,
            spp_mean: 12.34,
            samples_per_second: 2_340_000.0,
            rays: 50,
            rays_per_second: 12_500_000.0,
            converged_fraction: 0.5,
            remaining: Some(Duration::from_secs(3_723)),
        };
        let expected = "50.0 % converged, 12.3 spp, 2.34 M samples/s, 1:03 done, 1:02:03 left";
        assert_eq!(line(&progress, 0.5, "converged"), expected);
        let unknown = Progress { remaining: None, ..progress };
        assert!(line(&unknown, 0.5, "converged").ends_with("? left"));
    }
}
