//! The state of a sampling at rest, from which another one goes on: also in another process, on other threads.

use std::fmt;

use super::{AdaptiveSampling, FinishRule, RebuildRecord, Settings, SettingsError};
use crate::{
    PixelError, TILE_PIXELS,
    policy::{RuleMemory, home_masks},
    protocol::{Misfit, Outcome, Standing},
    sync::Ordering,
};

/// Everything that decides what is drawn from here on, besides the settings. In [`Mode::Deterministic`](crate::Mode::Deterministic) a sampling
/// that goes on from it draws exactly what the one would have drawn that it is taken from.
///
/// Tiles are in the order of [`TileGrid`](crate::TileGrid), 64 pixels each, row by row; *slots* are
/// [`Mode::slots`](crate::Mode::slots) many, by the number of the pass. Fields may be added.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SamplingState {
    /// How far tiles and regions have come.
    pub standing: Standing,
    /// Samples of each replicate: tile by tile, replicate by replicate, 64 pixels each.
    pub counts: Vec<u32>,
    /// Errors in fixed point, slot by slot, tile by tile.
    pub errors: Vec<u32>,
    /// Samples that the errors are made of, in the same order.
    pub samples: Vec<u32>,
    /// Masks of active pixels, slot by slot, tile by tile.
    pub masks: Vec<u64>,
    /// What each region remembers.
    pub regions: Vec<RegionState>,
    /// How many of the last complete passes drew nothing; without meaning when free-running.
    pub quiet_passes: u32,
    /// Of each later pass that a region has finished, whether one drew anything in it.
    pub open_passes: Vec<bool>,
    /// Passes of the sampling that it went on from with another target, 0 if there was none.
    pub first_pass: u64,
    /// Whether it went on from pixels below the minimum of samples.
    pub lacks_minimum: bool,
    /// Tile visits that drew samples, and those that found nothing to draw.
    pub visits: [u64; 2],
}

/// What a region remembers from update to update.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RegionState {
    /// Whether its rule has seen errors.
    pub is_updated: bool,
    /// How many of the latest trees are the same as the one before.
    pub unchanged: u64,
    /// What its rule remembers.
    pub memory: RuleMemory,
    /// Its rebuilds so far.
    pub rebuilds: Vec<RebuildRecord>,
    /// Pixels that were complete in a tree and active in the next, counted each time.
    pub reopened_pixels: u64,
    /// How often it was complete in a tree and active in the next.
    pub reopened_regions: u64,
}

/// More passes than any sampling makes: each adds a sample to some pixel.
const MOST_PASSES: u64 = 1 << 40;

/// More than any sampling counts of anything, and little enough that sums do not overflow.
const MOST_COUNTED: u64 = 1 << 56;

/// Why a sampling cannot go on from a state.
#[derive(Clone, Debug, PartialEq)]
pub enum StateError {
    /// The settings make no sense.
    Settings(SettingsError),
    /// No sampling with these settings can have left this state.
    State(Misfit),
}

impl fmt::Display for StateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Settings(error) => error.fmt(f),
            Self::State(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for StateError {}

impl From<SettingsError> for StateError {
    fn from(error: SettingsError) -> Self {
        Self::Settings(error)
    }
}

impl From<Misfit> for StateError {
    fn from(error: Misfit) -> Self {
        Self::State(error)
    }
}

/// A sampling in which nobody draws, until this is dropped.
#[derive(Debug)]
pub struct Paused<'a>(&'a AdaptiveSampling);

impl Drop for Paused<'_> {
    fn drop(&mut self) {
        self.0.protocol.go_on();
    }
}

impl Paused<'_> {
    /// Copies the state out. A renderer copies its film in the same pause: then the two belong together.
    pub fn state(&self) -> SamplingState {
        let sampling = self.0;
        let tiles = || 0..sampling.grid().tiles();
        let per_plane = |load: &dyn Fn(&crate::ErrorPlane, u32) -> [u32; TILE_PIXELS]| {
            sampling.planes.iter().flat_map(|plane| tiles().flat_map(|tile| load(plane, tile))).collect()
        };
        let slots = u64::from(sampling.settings.mode.slots());
        let masks = (0..slots).flat_map(|slot| tiles().map(move |tile| sampling.mask_in_slot(tile, slot)));
        let regions = 0..sampling.regions.len();
        let region = |region| sampling.protocol.with_state(region, |state| state.state());
        let [drawn, skipped, _] = sampling.counters.load();
        let (quiet_passes, open_passes) = match &sampling.finish {
            FinishRule::QuietPasses(ledger) => ledger.state(),
            FinishRule::AtRest(_) => (0, Vec::new()),
        };
        SamplingState {
            standing: sampling.protocol.standing(),
            counts: sampling.counts.to_vec(),
            errors: per_plane(&|plane, tile| plane.load_tile(tile).map(PixelError::to_bits)),
            samples: per_plane(&|plane, tile| plane.load_samples(tile)),
            masks: masks.collect(),
            regions: regions.map(region).collect(),
            quiet_passes,
            open_passes,
            first_pass: sampling.first_pass,
            lacks_minimum: sampling.lacks_minimum,
            visits: [drawn, skipped],
        }
    }
}

impl AdaptiveSampling {
    /// Waits until every visit that has begun is finished, and lets none begin until what it returns is dropped: what
    /// threads have drawn and what the sampling knows belong together meanwhile. Threads go to sleep where they would
    /// begin one. `None` where a visit was dropped unfinished, so that the two may never belong together again.
    ///
    /// Not for a thread that has a [`Visit`](super::Visit): it would wait for itself.
    pub fn pause(&self) -> Option<Paused<'_>> {
        let is_whole = self.protocol.pause();
        let paused = Paused(self);
        is_whole.then_some(paused)
    }

    /// How many visits of each tile are finished. Exact once the workers are done.
    pub fn finished_visits(&self) -> Vec<u64> {
        (0..self.grid().tiles()).map(|tile| self.protocol.finished_visits(tile)).collect()
    }

    /// Goes on in the middle of a sampling: from `state`, which was taken from one with the same `settings`. In deterministic mode it draws
    /// exactly what that one would have drawn; free-running it only loses nothing.
    ///
    /// # Errors
    /// Where settings make no sense, or no sampling with these settings can have left the state. A state may come from
    /// anywhere: what passes can be drawn from without a panic.
    pub fn restored(settings: Settings, state: &SamplingState) -> Result<Self, StateError> {
        let mut sampling = Self::new(settings)?;
        sampling.restore(state)?;
        Ok(sampling)
    }

    /// Deals only the first `visits[t]` visits of tile t, as [`Self::finished_visits`] of a sampling that was stopped:
    /// in deterministic mode this one draws the same, whatever its threads. It ends without an [`Outcome`].
    ///
    /// # Errors
    /// Where no sampling with these settings can have been stopped there.
    pub fn stop_after(mut self, visits: &[u64]) -> Result<Self, StateError> {
        self.protocol.stop_after(visits)?;
        Ok(self)
    }

    fn mask_in_slot(&self, tile: u32, slot: u64) -> u64 {
        self.checks.active(tile, self.protocol.home(tile), slot)
    }

    fn restore(&mut self, state: &SamplingState) -> Result<(), Misfit> {
        self.protocol.restore(&state.standing)?;
        self.counts.restore(&state.counts)?;
        self.restore_planes(state)?;
        self.restore_masks(&state.masks)?;
        Misfit::unless(state.regions.len() == self.progress.len(), "it has another number of regions")?;
        for (region, state) in (0..).zip(&state.regions) {
            self.restore_region(region, state)?;
        }
        Misfit::unless(state.first_pass < MOST_PASSES, "it has too many passes")?;
        let mut counted = state.visits.iter().chain(
            state.regions.iter().flat_map(|region| [&region.reopened_pixels, &region.reopened_regions]),
        );
        Misfit::unless(counted.all(|&count| count < MOST_COUNTED), "it has counted too much")?;
        (self.first_pass, self.lacks_minimum) = (state.first_pass, state.lacks_minimum);
        self.counters.set(state.visits);
        if let FinishRule::QuietPasses(ledger) = &mut self.finish {
            let trees: Vec<u64> = (0..self.regions.len()).map(|r| self.protocol.published(r)).collect();
            if ledger.restore(&trees, state.quiet_passes, &state.open_passes)? {
                self.protocol.end(Outcome::Finished);
            }
        }
        Ok(())
    }

    fn restore_planes(&self, state: &SamplingState) -> Result<(), Misfit> {
        let pixels = self.planes.len() * self.grid().tiles() as usize * TILE_PIXELS;
        let fits = state.errors.len() == pixels && state.samples.len() == pixels;
        Misfit::unless(fits, "it has another number of errors")?;
        let tiles =
            self.planes.iter().flat_map(|plane| (0..self.grid().tiles()).map(move |tile| (plane, tile)));
        let (errors, _) = state.errors.as_chunks::<TILE_PIXELS>();
        let (samples, _) = state.samples.as_chunks::<TILE_PIXELS>();
        for ((plane, tile), (errors, samples)) in tiles.zip(errors.iter().zip(samples)) {
            plane.store_tile(tile, &errors.map(PixelError::from_bits));
            plane.store_samples(tile, samples);
        }
        Ok(())
    }

    fn restore_masks(&self, masks: &[u64]) -> Result<(), Misfit> {
        let tiles = self.grid().tiles() as usize;
        let slots = self.settings.mode.slots() as usize;
        Misfit::unless(masks.len() == tiles * slots, "it has another number of masks")?;
        let inside = |(tile, mask): (usize, &u64)| mask & !self.grid().full_mask((tile % tiles) as u32) == 0;
        Misfit::unless(masks.iter().enumerate().all(inside), "a mask has pixels outside the picture")?;
        for (slot, masks) in (0..).zip(masks.chunks_exact(tiles)) {
            for region in 0..self.regions.len() {
                let home = || self.regions.home_tiles(region);
                let masks = home().map(|tile| masks[tile as usize]).collect();
                self.checks.restore(region, slot, home(), &home_masks(&self.regions, region, masks));
            }
        }
        Ok(())
    }

    fn restore_region(&mut self, index: u32, state: &RegionState) -> Result<(), Misfit> {
        let last = self.protocol.published(index).saturating_sub(1);
        let masks: Box<[u64]> =
            self.regions.home_tiles(index).map(|tile| self.checks.active(tile, index, last)).collect();
        let active = masks.iter().map(|mask| u64::from(mask.count_ones())).sum();
        self.progress[index as usize].active_pixels.store(active, Ordering::Relaxed);
        let plane = &self.planes[(last % self.planes.len() as u64) as usize];
        self.protocol.state_mut(index).restore(state, masks, plane)
    }
}
