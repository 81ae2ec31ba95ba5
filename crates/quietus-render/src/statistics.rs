//! Figures of a finished render.

use std::time::Duration;

use quietus::{AdaptiveSampling, RebuildRecord};
use quietus_film::Film;
use serde::{Deserialize, Serialize};

use crate::noise::{Aov, Noise, OfAovs};
use crate::process;

/// Percentiles of the samples per pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct SampleStatistics {
    /// Mean accepted samples per pixel.
    pub spp_mean: f64,
    /// Median.
    pub spp_p50: u32,
    /// 99th percentile.
    pub spp_p99: u32,
    /// Largest.
    pub spp_max: u32,
}

impl SampleStatistics {
    /// Of the given counts, one per pixel. Percentiles by nearest rank: the smallest count that at least that share
    /// of pixels does not exceed.
    pub fn of(counts: &[u32]) -> Self {
        let mut sorted = counts.to_vec();
        sorted.sort_unstable();
        let Some(&spp_max) = sorted.last() else { return Self::default() };
        let rank = |percent: usize| sorted[(sorted.len() * percent).div_ceil(100).max(1) - 1];
        let sum: u64 = sorted.iter().map(|&count| u64::from(count)).sum();
        let spp_mean = sum as f64 / sorted.len() as f64;
        Self { spp_mean, spp_p50: rank(50), spp_p99: rank(99), spp_max }
    }
}

/// Most rebuilds that [`Statistics::rebuild_log`] lists. Passes grow, so that even long renders stay below; only
/// many regions go beyond.
pub const MOST_LOGGED: usize = 4096;

/// One rebuild of one region's tree.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LoggedRebuild {
    /// The region, row by row.
    pub region: u32,
    /// Which of the region's trees it made, from 0.
    pub generation: u64,
    /// Nodes of the tree; 0 where the policy has none.
    pub nodes: usize,
    /// Pixels of the region that go on being sampled.
    pub active_pixels: u64,
    /// How long it took.
    pub milliseconds: f64,
}

impl LoggedRebuild {
    /// In the units of the statistics.
    pub(crate) fn new(record: &RebuildRecord) -> Self {
        let &RebuildRecord { region, generation, nanoseconds, nodes, active_pixels, .. } = record;
        Self { region, generation, nodes, active_pixels, milliseconds: nanoseconds as f64 * 1e-6 }
    }
}

/// What a render did. The names are part of the program's interface, see `docs/stats.md`.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Statistics {
    /// Seconds from the start of the first thread to the end of the last.
    pub wall_seconds: f64,
    /// CPU seconds of the process in that time; absent where the system does not tell.
    pub cpu_seconds: Option<f64>,
    /// Samples drawn, rejected ones included.
    pub samples: u64,
    /// Rays traced.
    pub rays: u64,
    /// Samples per pixel.
    #[serde(flatten)]
    pub per_pixel: SampleStatistics,
    /// Passes finished everywhere.
    pub passes: u64,
    /// Share of pixels that have an estimate and are complete in the latest trees; 0 with uniform sampling.
    pub converged_fraction: f64,
    /// Pixels in which sampling stopped although all samples of a replicate were rejected.
    pub rejected_pixels: u64,
    /// Rebuilds of trees (updates of blocks and masks with the other policies), all regions together.
    pub rebuilds: usize,
    /// Their median time.
    pub rebuild_ms_median: f64,
    /// Their longest time.
    pub rebuild_ms_max: f64,
    /// The rebuilds one by one, region by region; the first [`MOST_LOGGED`].
    pub rebuild_log: Vec<LoggedRebuild>,
    /// Nodes of the largest tree.
    pub tree_nodes_max: usize,
    /// Time waited for locks over threads x wall time.
    pub lock_wait_fraction: f64,
    /// Time threads slept for want of an eligible tile over threads x wall time.
    pub idle_fraction: f64,
    /// Tile visits that drew samples.
    pub visits: u64,
    /// Tile visits that found nothing to draw.
    pub skips: u64,
    /// Pixels that were complete in a tree and active in the next.
    pub reopened_pixels: u64,
    /// Regions that were complete in a tree and active in the next.
    pub reopened_regions: u64,
    /// The noise asked for, in percent of white; absent where none was.
    pub noise_asked: Option<f64>,
    /// Whether errors were multiplied by the weights of a map before they were dealt by and measured.
    pub noise_is_weighted: bool,
    /// Root mean square error of the finished picture in display space, in percent of white, measured by samples that
    /// decided nothing ([`crate::noise`]); absent where it was not measured.
    pub noise_reached: Option<f64>,
    /// Lower end of its 95 % confidence interval.
    pub noise_low: Option<f64>,
    /// Upper end.
    pub noise_high: Option<f64>,
    /// The noise of alpha, albedo and normal, where one of them was asked for.
    pub aov_noise: Vec<AovStatistics>,
    /// Samples drawn to measure the noise; they are not in the picture, nor in `samples`.
    pub noise_samples: u64,
    /// Samples drawn in the last session to guess when the render would end. They decide nothing and are not in the picture;
    /// how many depends on the clock.
    pub outlook_samples: u64,
    /// Rounds of sampling, each to a target that the ones before have set.
    pub rounds: u32,
    /// Samples rejected because they were not finite.
    pub nonfinite_samples: u64,
    /// Most memory held at once, in bytes; absent where the system does not tell.
    pub peak_rss_bytes: Option<u64>,
}

/// The noise of alpha, albedo or normal, in percent of 1.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AovStatistics {
    /// Which of them.
    pub name: &'static str,
    /// The noise asked for; absent where it was that of another one.
    pub asked: Option<f64>,
    /// Root mean square error over all pixels and channels, measured as that of the picture.
    pub reached: f64,
    /// Lower end of its 95 % confidence interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Statistics {
    /// Takes in what was measured of alpha, albedo and normal.
    pub(crate) fn set_aov_noise(&mut self, measured: &OfAovs<Noise>, asked: &OfAovs<f64>) {
        let percent = |share: f64| 100.0 * share;
        let all = Aov::ALL.into_iter().zip(measured).zip(asked);
        self.aov_noise = all
            .filter_map(|((aov, noise), asked)| {
                let Noise { reached, low, high } = (*noise)?;
                let [reached, low, high] = [reached, low, high].map(percent);
                Some(AovStatistics { name: aov.name(), asked: asked.map(percent), reached, low, high })
            })
            .collect();
    }

    /// Takes in what was measured of the noise.
    pub fn set_noise(&mut self, noise: Noise) {
        let percent = |share: f64| Some(100.0 * share);
        self.noise_reached = percent(noise.reached);
        self.noise_low = percent(noise.low);
        self.noise_high = percent(noise.high);
    }
}

/// Sums over the rounds of a render.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Totals {
    /// Of the rounds that are over. The rebuilds of each region are numbered anew in each.
    sampling: quietus::Statistics,
    rounds: u32,
    /// Samples that measured the noise.
    pub(crate) noise_samples: u64,
}

impl Totals {
    /// Whether a render can have counted so much, with room for more.
    pub(crate) fn is_possible(&self) -> bool {
        let all = &self.sampling;
        let counts = [
            all.visits,
            all.skips,
            all.passes,
            all.lock_wait_nanoseconds,
            all.idle_nanoseconds,
            all.reopened_pixels,
            all.reopened_regions,
            self.noise_samples,
        ];
        counts.iter().all(|&count| count < 1 << 60) && self.rounds < u32::MAX / 2
    }

    /// Adds a round that is over.
    pub(crate) fn add(&mut self, sampling: &AdaptiveSampling) {
        let round = sampling.statistics();
        let all = &mut self.sampling;
        all.visits += round.visits;
        all.skips += round.skips;
        all.passes += round.passes;
        all.rebuilds.extend(round.rebuilds);
        all.lock_wait_nanoseconds += round.lock_wait_nanoseconds;
        all.idle_nanoseconds += round.idle_nanoseconds;
        all.reopened_pixels += round.reopened_pixels;
        all.reopened_regions += round.reopened_regions;
        self.rounds += 1;
    }

    /// The figures of a render that took `wall` with `threads` threads and ended with `sampling` and `film`. Samples, rays
    /// and noise are not among them.
    pub(crate) fn statistics(
        &self,
        sampling: &AdaptiveSampling,
        film: &Film,
        threads: usize,
        wall: Duration,
    ) -> Statistics {
        let all = &self.sampling;
        let thread_seconds = wall.as_secs_f64() * threads as f64;
        let share = |nanoseconds: u64| nanoseconds as f64 * 1e-9 / thread_seconds.max(1e-9);
        let milliseconds = |nanoseconds: u64| nanoseconds as f64 * 1e-6;
        let rejected_pixels = sampling.rejected_pixels();
        let pixels = sampling.grid().rect().area() as f64;
        Statistics {
            wall_seconds: wall.as_secs_f64(),
            per_pixel: SampleStatistics::of(&film.sample_counts()),
            passes: all.passes,
            converged_fraction: (sampling.converged_fraction() - rejected_pixels as f64 / pixels).max(0.0),
            rejected_pixels,
            rebuilds: all.rebuilds.len(),
            rebuild_ms_median: milliseconds(all.rebuild_nanoseconds_median()),
            rebuild_ms_max: all.slowest_rebuild().map_or(0.0, |rebuild| milliseconds(rebuild.nanoseconds)),
            rebuild_log: all.rebuilds.iter().take(MOST_LOGGED).map(LoggedRebuild::new).collect(),
            tree_nodes_max: all.rebuilds.iter().map(|rebuild| rebuild.nodes).max().unwrap_or(0),
            lock_wait_fraction: share(all.lock_wait_nanoseconds),
            idle_fraction: share(all.idle_nanoseconds),
            visits: all.visits,
            skips: all.skips,
            reopened_pixels: all.reopened_pixels,
            reopened_regions: all.reopened_regions,
            noise_samples: self.noise_samples,
            rounds: self.rounds,
            nonfinite_samples: film.rejected().count(),
            peak_rss_bytes: process::peak_rss_bytes(),
            ..Statistics::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_by_nearest_rank() {
        let counts: Vec<u32> = (1..=200).rev().collect();
        let statistics = SampleStatistics::of(&counts);
        assert_eq!(
            statistics,
            SampleStatistics { spp_mean: 100.5, spp_p50: 100, spp_p99: 198, spp_max: 200 }
        );
        let one = SampleStatistics::of(&[7]);
        assert_eq!(one, SampleStatistics { spp_mean: 7.0, spp_p50: 7, spp_p99: 7, spp_max: 7 });
        assert_eq!(SampleStatistics::of(&[]), SampleStatistics::default());
    }
}
