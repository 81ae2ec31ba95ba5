//! Counters for everything worth knowing about a run.

use crate::sync::{AtomicU64, CacheLine, Ordering};

/// One rebuild of one region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct RebuildRecord {
    /// The region.
    pub region: u32,
    /// Number of the tree in its region, from 0.
    pub generation: u64,
    /// Time from having the region's locks to having everything of the new tree in place.
    pub nanoseconds: u64,
    /// Nodes of the tree, 0 where the policy has none.
    pub nodes: usize,
    /// Active pixels of the home tiles.
    pub active_pixels: u64,
}

/// What happened so far.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct Statistics {
    /// Tile visits that drew samples.
    pub visits: u64,
    /// Tile visits that found nothing to draw.
    pub skips: u64,
    /// Passes that are finished (deterministic mode), or were dealt (free-running).
    pub passes: u64,
    /// Every rebuild, region by region.
    pub rebuilds: Vec<RebuildRecord>,
    /// Time waited for locks: striped locks, by readers and by writers, and the regions' update locks.
    pub lock_wait_nanoseconds: u64,
    /// Time threads slept because nothing was eligible.
    pub idle_nanoseconds: u64,
    /// Pixels that were complete in a tree and active in the next, counted each time.
    pub reopened_pixels: u64,
    /// Regions that were complete in a tree and active in the next, counted each time.
    pub reopened_regions: u64,
}

impl Statistics {
    /// Median time of a rebuild in nanoseconds; 0 without rebuilds.
    pub fn rebuild_nanoseconds_median(&self) -> u64 {
        let mut times: Vec<u64> = self.rebuilds.iter().map(|r| r.nanoseconds).collect();
        let middle = times.len() / 2;
        if times.is_empty() { 0 } else { *times.select_nth_unstable(middle).1 }
    }

    /// The slowest rebuild.
    pub fn slowest_rebuild(&self) -> Option<&RebuildRecord> {
        self.rebuilds.iter().max_by_key(|r| r.nanoseconds)
    }
}

/// Counters that all workers add to, each now and then from its own [`Tally`].
#[derive(Debug, Default)]
pub(super) struct Counters(CacheLine<[AtomicU64; 3]>);

/// What one worker has counted since it last added to the shared counters.
#[derive(Debug, Default)]
pub(super) struct Tally {
    pub(super) visits: u64,
    pub(super) skips: u64,
    pub(super) idle_nanoseconds: u64,
}

impl Counters {
    /// Adds a worker's tally and clears it.
    pub(super) fn add(&self, tally: &mut Tally) {
        let Tally { visits, skips, idle_nanoseconds } = std::mem::take(tally);
        for (counter, value) in self.0.iter().zip([visits, skips, idle_nanoseconds]) {
            // Relaxed: statistics.
            counter.fetch_add(value, Ordering::Relaxed);
        }
    }

    /// Goes on from these visits and skips.
    pub(super) fn set(&self, visits: [u64; 2]) {
        self.0.iter().zip(visits).for_each(|(counter, value)| counter.store(value, Ordering::Relaxed));
    }

    /// Visits, skips and idle nanoseconds so far.
    pub(super) fn load(&self) -> [u64; 3] {
        [0, 1, 2].map(|i| self.0[i].load(Ordering::Relaxed))
    }
}
