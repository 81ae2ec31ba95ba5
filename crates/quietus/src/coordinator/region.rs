//! A region's share of the coordinator: its policy, behind the region's lock, and the update by the last one out.

use std::time::Instant;

use super::{AdaptiveSampling, FinishRule, RebuildRecord, RegionState, Statistics};
use crate::{
    ErrorPlane, RegionTree, Regions, TILE_PIXELS,
    policy::StoppingRule,
    protocol::{Misfit, Outcome, Update},
    striped_locks::nanoseconds_since,
    sync::{AtomicU64, Ordering},
};

/// What a region's lock guards.
pub(super) struct Region {
    rule: Box<dyn StoppingRule>,
    home_tiles: Box<[u32]>,
    error_tiles: Box<[u32]>,
    /// Masks of the home tiles after the latest update.
    masks: Box<[u64]>,
    /// Whether the rule has seen errors.
    is_updated: bool,
    /// How many of the latest trees are the same as the one before.
    unchanged: u64,
    rebuilds: Vec<RebuildRecord>,
    lock_wait_nanoseconds: u64,
    reopened_pixels: u64,
    reopened_regions: u64,
}

/// What may be seen of a region without its lock.
pub(super) struct Progress {
    /// Active pixels of the home tiles in the latest tree.
    pub(super) active_pixels: AtomicU64,
}

impl Region {
    /// A region before its first visit, whose rule has seen errors of an earlier sampling or none.
    pub(super) fn new(regions: &Regions, region: u32, rule: Box<dyn StoppingRule>, is_updated: bool) -> Self {
        let home_tiles: Box<[u32]> = regions.home_tiles(region).collect();
        Self {
            masks: home_tiles.iter().map(|&tile| rule.active(tile)).collect(),
            rule,
            home_tiles,
            error_tiles: regions.error_tiles(region).collect(),
            is_updated,
            // Every slot holds what there is.
            unchanged: u64::MAX / 2,
            rebuilds: Vec::new(),
            lock_wait_nanoseconds: 0,
            reopened_pixels: 0,
            reopened_regions: 0,
        }
    }

    /// What may be seen of it now.
    pub(super) fn progress(&self) -> Progress {
        let active = self.masks.iter().map(|mask| u64::from(mask.count_ones())).sum();
        Progress { active_pixels: AtomicU64::new(active) }
    }

    pub(super) fn state(&self) -> RegionState {
        RegionState {
            is_updated: self.is_updated,
            unchanged: self.unchanged,
            memory: self.rule.memory(),
            rebuilds: self.rebuilds.clone(),
            reopened_pixels: self.reopened_pixels,
            reopened_regions: self.reopened_regions,
        }
    }

    /// Goes on from `state`, whose latest tree has these masks and was made of these errors or newer ones.
    pub(super) fn restore(
        &mut self,
        state: &RegionState,
        masks: Box<[u64]>,
        errors: &ErrorPlane,
    ) -> Result<(), Misfit> {
        if state.is_updated {
            self.rule.restore(&masks, &state.memory, errors)?;
        }
        self.masks = masks;
        self.is_updated = state.is_updated;
        self.unchanged = state.unchanged.min(u64::MAX / 2);
        self.rebuilds.clone_from(&state.rebuilds);
        self.reopened_pixels = state.reopened_pixels;
        self.reopened_regions = state.reopened_regions;
        Ok(())
    }

    pub(super) fn tree(&self) -> Option<&RegionTree> {
        self.rule.tree().filter(|_| self.is_updated)
    }

    /// Samples that the pixels of a home tile are to have.
    pub(super) fn quotas(&self, tile: u32) -> Option<[f32; TILE_PIXELS]> {
        self.rule.quotas(tile).filter(|_| self.is_updated)
    }

    pub(super) fn add_to(&self, statistics: &mut Statistics) {
        statistics.rebuilds.extend_from_slice(&self.rebuilds);
        statistics.lock_wait_nanoseconds += self.lock_wait_nanoseconds;
        statistics.reopened_pixels += self.reopened_pixels;
        statistics.reopened_regions += self.reopened_regions;
    }

    /// Compares the masks with those before, and keeps them. Returns the number of active pixels.
    fn take_masks(&mut self) -> u64 {
        let (mut before, mut active, mut reopened) = (0, 0, 0);
        for (&tile, mask) in self.home_tiles.iter().zip(&mut self.masks) {
            let new = self.rule.active(tile);
            before += u64::from(mask.count_ones());
            active += u64::from(new.count_ones());
            reopened += u64::from((new & !*mask).count_ones());
            *mask = new;
        }
        self.reopened_pixels += reopened;
        self.reopened_regions += u64::from(before == 0 && active > 0);
        active
    }
}

impl AdaptiveSampling {
    /// The last one out of a region rebuilds its tree (the talk, section 4.1).
    pub(super) fn update(&self, update: Update<'_, Region>) {
        let Update { region: index, generation, drew, waited_nanoseconds, state } = update;
        state.lock_wait_nanoseconds += waited_nanoseconds;
        let version = match &self.finish {
            FinishRule::AtRest(rest) => rest.version_at_rest(),
            FinishRule::QuietPasses(_) => None,
        };
        if drew || !state.is_updated {
            if self.may_ask_rule(state, generation) {
                self.rebuild(index, generation, state);
            }
        } else {
            self.repeat(index, generation, state);
        }
        let finished = match (&self.finish, version) {
            (FinishRule::QuietPasses(ledger), _) => {
                ledger.region_finished(generation, drew || self.is_spreading(generation))
            }
            (FinishRule::AtRest(rest), Some(version)) if !self.can_draw(state) => {
                rest.region_is_quiet(index, version)
            }
            (FinishRule::AtRest(_), _) => false,
        };
        if finished {
            self.protocol.end(Outcome::Finished);
        }
    }

    /// Whether every tile of the region's error area has been visited often enough for a tree to be made.
    fn may_ask_rule(&self, state: &Region, generation: u64) -> bool {
        state.is_updated
            || match &self.finish {
                // In this mode tree k is made after pass k of each of the tiles.
                FinishRule::QuietPasses(_) => generation + 1 >= self.untreed_passes,
                FinishRule::AtRest(_) => state
                    .error_tiles
                    .iter()
                    .all(|&tile| self.protocol.finished_visits(tile) >= self.untreed_passes),
            }
    }

    fn rebuild(&self, index: u32, generation: u64, state: &mut Region) {
        let plane = self.plane(generation);
        let mut start = Instant::now();
        let rule = &mut *state.rule;
        let waited = self.checks.replace(index, generation, &state.home_tiles, rule, |rule| {
            start = Instant::now();
            rule.update(plane);
        });
        let nanoseconds = nanoseconds_since(start);
        state.is_updated = true;
        state.unchanged = 0;
        state.lock_wait_nanoseconds += waited;
        let active_pixels = state.take_masks();
        // Relaxed: a progress report.
        self.progress[index as usize].active_pixels.store(active_pixels, Ordering::Relaxed);
        let nodes = state.rule.tree().map_or(0, |tree| tree.nodes().len());
        let record = RebuildRecord { region: index, generation, nanoseconds, nodes, active_pixels };
        state.rebuilds.push(record);
        if let Some(observer) = &self.observer {
            observer(&record);
        }
    }

    /// Nothing was drawn, so the errors are what they were: the latest tree is this one, too. The rule is not
    /// asked, so that a finished picture stays as it is under any rule.
    fn repeat(&self, index: u32, generation: u64, state: &mut Region) {
        state.unchanged += 1;
        // After as many repeats as there are slots, every slot holds this tree.
        if state.unchanged < u64::from(self.settings.mode.slots()) {
            state.lock_wait_nanoseconds += self.checks.repeat(index, generation, &state.home_tiles);
        }
    }

    /// Whether a home tile has a pixel to draw.
    fn can_draw(&self, state: &Region) -> bool {
        (state.home_tiles.iter().zip(&state.masks))
            .any(|(&tile, &mask)| self.below_maximum(tile, mask | self.below_minimum(tile)) != 0)
    }
}
