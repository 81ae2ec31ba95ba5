//! Progress in words.

use std::time::Duration;

use quietus_render::{NoiseProgress, Progress};

use super::{Measure, Snapshot};

/// How far it is, as a share of `measure`, and the time left.
pub(super) fn share(measure: Measure, snapshot: &Snapshot) -> String {
    let share = match measure.share(snapshot) {
        Some((share, name)) => format!("{:.1} % {name}", 100.0 * share),
        None => "noise not measured yet".to_owned(),
    };
    format!("{share}, {} left", left(&snapshot.progress))
}

/// The time left, or its range where that is wide.
fn left(progress: &Progress) -> String {
    match (progress.remaining, progress.wide_range()) {
        (_, Some([low, high])) => format!("{}-{}", duration(low), duration(high)),
        (Some(left), None) => duration(left),
        (None, None) => "?".to_owned(),
    }
}

/// Noise, samples, speed and time: what fits into 80 columns.
pub(super) fn status(snapshot: &Snapshot) -> String {
    let Snapshot { progress, spp_max, .. } = snapshot;
    format!(
        "{}{:.1} spp (max {spp_max}), {:.2} Mrays/s, {} done",
        progress.noise.as_ref().map_or_else(String::new, noise),
        progress.spp_mean,
        progress.rays_per_second / 1e6,
        duration(progress.elapsed),
    )
}

/// In percent of white.
fn noise(&NoiseProgress { asked, measured, expected }: &NoiseProgress) -> String {
    let percent = |share: f64| format!("{} %", (1e4 * share).round() / 100.0);
    let measured = measured.map_or_else(|| "?".to_owned(), |noise| percent(noise.reached));
    let end = expected.map_or_else(String::new, |noise| format!(", will end at {}", percent(noise)));
    format!("noise {measured} of {} asked{end}, ", percent(asked))
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
    use quietus_render::noise::Noise;

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
            remaining_range: None,
            foreseen_samples: None,
            foreseen_range: None,
            noise: None,
        }
    }

    #[test]
    fn words_tell_share_speed_and_time() {
        let snapshot = Snapshot { progress: progress(), spp_max: 64, measured_at: 5 };
        let expected = "12.3 spp (max 64), 12.34 Mrays/s, 1:03 done";
        assert_eq!(status(&snapshot), expected);
        assert_eq!(share(Measure::Converged, &snapshot), "50.0 % converged, 1:02:03 left");
        assert_eq!(share(Measure::Samples(40.0), &snapshot), "25.0 % drawn, 1:02:03 left");
        let ranged = |[low, high]: [u64; 2]| {
            let range = Some([low, high].map(Duration::from_secs));
            left(&Progress { remaining_range: range, ..progress() })
        };
        assert_eq!(ranged([120, 300]), "2:00-5:00");
        assert_eq!(ranged([3_600, 3_900]), "1:02:03");
        assert_eq!(
            share(Measure::Time(Duration::from_secs(7)), &snapshot),
            "100.0 % of the time, 1:02:03 left"
        );
        let unknown =
            Snapshot { progress: Progress { remaining: None, ..progress() }, spp_max: 64, measured_at: 5 };
        assert!(share(Measure::Converged, &unknown).ends_with(", ? left"));
    }

    #[test]
    fn noise_is_told_as_far_as_it_is_known() {
        let asked = NoiseProgress { asked: 0.01, measured: None, expected: None };
        let of = |noise| Snapshot {
            progress: Progress { noise: Some(noise), ..progress() },
            spp_max: 64,
            measured_at: 5,
        };
        assert!(status(&of(asked)).starts_with("noise ? of 1 % asked, 12.3 spp"));
        assert_eq!(share(Measure::Noise, &of(asked)), "noise not measured yet, 1:02:03 left");
        let noise = Noise { reached: 0.0231, low: 0.02, high: 0.03 };
        let known = NoiseProgress { measured: Some(noise), expected: Some(0.0125), ..asked };
        assert!(status(&of(known)).starts_with("noise 2.31 % of 1 % asked, will end at 1.25 %, 12.3"));
        // (1 / 2.31)^2 of the samples when it was measured, and twice as many now.
        assert_eq!(share(Measure::Noise, &of(known)), "37.5 % of the way, 1:02:03 left");
        let mut foreseen = of(known);
        foreseen.progress.foreseen_samples = Some(40.0);
        assert_eq!(share(Measure::Noise, &foreseen), "25.0 % of the way, 1:02:03 left");
    }
}
