//! A baseline: each tile stops for good on its own error, the talk's "previous generation" (section 3).

use std::sync::Arc;

use super::{ActivePixels, HomeMasks, RuleMemory, RuleSettings, StoppingRule};
use crate::{ErrorPlane, protocol::Misfit, region_error::region_error};

/// Tiles that stop on their own.
pub struct TileRule {
    masks: HomeMasks,
    home_tiles: Vec<u32>,
    target_error: f64,
    frame_area: f64,
}

impl TileRule {
    /// The tiles of a region before their first update.
    pub fn new(settings: &RuleSettings, region: u32) -> Self {
        Self {
            masks: HomeMasks::full(&settings.regions, region),
            home_tiles: settings.regions.home_tiles(region).collect(),
            target_error: settings.target_error,
            frame_area: settings.frame_area,
        }
    }
}

impl ActivePixels for TileRule {
    fn active(&self, tile: u32) -> u64 {
        self.masks.active(tile)
    }
}

impl StoppingRule for TileRule {
    fn update(&mut self, errors: &ErrorPlane) {
        for (&tile, mask) in self.home_tiles.iter().zip(&mut self.masks.masks) {
            let sum = errors.load_tile(tile).iter().map(|e| e.steps()).sum();
            let pixels = errors.grid().tile_rect(tile).area() as f64;
            if region_error(sum, pixels, self.frame_area) < self.target_error {
                *mask = 0;
            }
        }
    }

    /// Tiles that stopped once stay so, whatever their errors are now.
    fn restore(&mut self, masks: &[u64], memory: &RuleMemory, _: &ErrorPlane) -> Result<(), Misfit> {
        Misfit::unless(*memory == RuleMemory::Nothing, "it is of another policy")?;
        self.masks.masks = masks.to_vec();
        Ok(())
    }

    fn check(&self) -> Arc<dyn ActivePixels> {
        Arc::new(self.masks.clone())
    }

    fn is_complete(&self) -> bool {
        self.masks.is_empty()
    }
}
