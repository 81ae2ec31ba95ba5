//! Progress in words.

use std::time::Duration;

use super::{Measure, Snapshot};

/// How far it is, as a share of `measure`.
pub(super) fn share(measure: Measure, snapshot: &Snapshot) -> String {
    let (share, name) = measure.share(&snapshot.progress);
    format!("{:.1} % {name}", 100.0 * share)
}

/// Samples, speed and time.
pub(super) fn status(snapshot: &Snapshot) -> String {
    let Snapshot { progress, spp_max } = snapshot;
    let left = progress.remaining.map_or_else(|| "?".to_owned(), duration);
    format!(
        "{:.1} spp (at most {spp_max}), {:.2} Mrays/s, {} done, {left} left",
        progress.spp_mean,
        progress.rays_per_second / 1e6,
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
pub(super) mod tests {
    use quietus_render::Progress;

    use super::*;

    /// A look at some render.
    pub(in crate::progress) fn progress() -> Progress {
        Progress {
            elapsed: Duration::from_secs(63),
            samples: 10,
            spp_mean: 12.34,
            samples_per_second: 2_340_000.0,
            rays: 50,
            rays_per_second: 12_340_000.0,
            converged_fraction: 0.5,
            remaining: Some(Duration::from_secs(3_723)),
            noise: None,
        }
    }

    #[test]
    fn words_tell_share_speed_and_time() {
        let snapshot = Snapshot { progress: progress(), spp_max: 64 };
        let expected = "12.3 spp (at most 64), 12.34 Mrays/s, 1:03 done, 1:02:03 left";
        assert_eq!(status(&snapshot), expected);
        assert_eq!(share(Measure::Converged, &snapshot), "50.0 % converged");
        assert_eq!(share(Measure::Samples(40.0), &snapshot), "25.0 % drawn");
        assert_eq!(share(Measure::Time(Duration::from_secs(7)), &snapshot), "100.0 % of the time");
        let unknown = Snapshot { progress: Progress { remaining: None, ..progress() }, spp_max: 64 };
        assert!(status(&unknown).ends_with("? left"));
    }
}
