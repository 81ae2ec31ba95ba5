//! The two ways to check a tile against its region's tree, behind one interface.

use std::sync::Arc;

use super::settings::{Checks, Settings};
use crate::{
    Regions, TileGrid,
    policy::{ActivePixels, StoppingRule},
    published_masks::PublishedMasks,
    striped_locks::StripedLocks,
};

/// What the locks of a region guard: its last few trees, by slot.
type Trees = Vec<Arc<dyn ActivePixels>>;

/// Where checks find the trees.
pub(super) enum TreeChecks {
    Striped { locks: Vec<StripedLocks<Trees>>, grid: TileGrid, slots: u64 },
    Published(PublishedMasks),
}

impl TreeChecks {
    /// Checks that find what the rules say before their first update.
    pub(super) fn new(settings: &Settings, regions: &Regions, rules: &[Box<dyn StoppingRule>]) -> Self {
        let (grid, slots) = (settings.grid(), settings.mode.slots());
        match settings.checks {
            Checks::StripedLocks => {
                let locks = rules.iter().map(|rule| {
                    let trees: Trees = vec![rule.check(); slots as usize];
                    StripedLocks::new(settings.stripes, || trees.clone())
                });
                Self::Striped { locks: locks.collect(), grid, slots: slots.into() }
            }
            Checks::Published => {
                let masks = PublishedMasks::new(grid.tiles(), slots);
                for (region, rule) in (0..regions.len()).zip(rules) {
                    for tile in regions.home_tiles(region) {
                        (0..slots).for_each(|k| masks.store(tile, k.into(), rule.active(tile)));
                    }
                }
                Self::Published(masks)
            }
        }
    }

    /// The active pixels of a tile in tree `k` of its home region; in free-running mode, in its latest.
    pub(super) fn active(&self, tile: u32, home: u32, k: u64) -> u64 {
        match self {
            Self::Striped { locks, grid, slots } => {
                let (column, row) = grid.coordinates(tile);
                locks[home as usize].read(column, row)[(k % slots) as usize].active(tile)
            }
            Self::Published(masks) => masks.load(tile, k),
        }
    }

    /// Lets `rebuild` change the rule and makes the result tree `k` of the region. With locks, all of them are
    /// held meanwhile, as in the talk; returns the time they were waited for.
    pub(super) fn replace(
        &self,
        region: u32,
        k: u64,
        home_tiles: &[u32],
        rule: &mut dyn StoppingRule,
        rebuild: impl FnOnce(&mut dyn StoppingRule),
    ) -> u64 {
        match self {
            Self::Striped { locks, slots, .. } => {
                let (mut guards, waited) = locks[region as usize].write_all();
                rebuild(rule);
                let check = rule.check();
                for trees in &mut guards {
                    trees[(k % slots) as usize] = Arc::clone(&check);
                }
                waited
            }
            Self::Published(masks) => {
                rebuild(rule);
                home_tiles.iter().for_each(|&tile| masks.store(tile, k, rule.active(tile)));
                0
            }
        }
    }

    /// Makes tree `k` of the region the same as the one before. Returns the time that locks were waited for.
    pub(super) fn repeat(&self, region: u32, k: u64, home_tiles: &[u32]) -> u64 {
        match self {
            Self::Striped { locks, slots, .. } => {
                let (mut guards, waited) = locks[region as usize].write_all();
                for trees in &mut guards {
                    trees[(k % slots) as usize] = Arc::clone(&trees[((k - 1) % slots) as usize]);
                }
                waited
            }
            Self::Published(masks) => {
                home_tiles.iter().for_each(|&tile| masks.store(tile, k, masks.load(tile, k - 1)));
                0
            }
        }
    }

    /// Makes `active` the tree of the region in a slot, before any thread reads it.
    pub(super) fn restore(
        &self,
        region: u32,
        slot: u64,
        home_tiles: impl Iterator<Item = u32>,
        active: &Arc<dyn ActivePixels>,
    ) {
        match self {
            Self::Striped { locks, .. } => {
                for trees in &mut locks[region as usize].write_all().0 {
                    trees[slot as usize] = Arc::clone(active);
                }
            }
            Self::Published(masks) => {
                home_tiles.for_each(|tile| masks.store(tile, slot, active.active(tile)));
            }
        }
    }

    /// Time that readers have waited for locks.
    pub(super) fn read_wait_nanoseconds(&self) -> u64 {
        match self {
            Self::Striped { locks, .. } => locks.iter().map(StripedLocks::read_wait_nanoseconds).sum(),
            Self::Published(_) => 0,
        }
    }
}
