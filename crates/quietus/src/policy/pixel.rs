//! A baseline: each pixel stops on its own error, unless a neighbour goes on; what path tracers with per-pixel
//! adaptive sampling do.

use std::sync::Arc;

use super::{ActivePixels, HomeMasks, RuleSettings, StoppingRule};
use crate::{ErrorPlane, PixelRect, region_error::region_error};

/// Pixels that stop on their own.
pub struct PixelRule {
    masks: HomeMasks,
    error_rect: PixelRect,
    errors: Vec<u32>,
    target_error: f64,
    frame_area: f64,
}

impl PixelRule {
    /// The pixels of a region before their first update.
    pub fn new(settings: &RuleSettings, region: u32) -> Self {
        let error_rect = settings.regions.error_rect(region);
        Self {
            masks: HomeMasks::full(&settings.regions, region),
            error_rect,
            errors: Vec::new(),
            target_error: settings.target_error,
            frame_area: settings.frame_area,
        }
    }
}

impl ActivePixels for PixelRule {
    fn active(&self, tile: u32) -> u64 {
        self.masks.active(tile)
    }
}

impl StoppingRule for PixelRule {
    fn update(&mut self, errors: &ErrorPlane) {
        errors.copy_rect(&self.error_rect, &mut self.errors);
        self.masks.clear();
        let rect = self.error_rect;
        for (i, &steps) in self.errors.iter().enumerate() {
            // A pixel is a region of its own: N = 1.
            if region_error(steps.into(), 1.0, self.frame_area) < self.target_error {
                continue;
            }
            let (x, y) = (rect.x0 + i as u32 % rect.width(), rect.y0 + i as u32 / rect.width());
            self.masks.add(&PixelRect::new(x.saturating_sub(1), y.saturating_sub(1), x + 2, y + 2));
        }
    }

    fn check(&self) -> Arc<dyn ActivePixels> {
        Arc::new(self.masks.clone())
    }

    fn is_complete(&self) -> bool {
        self.masks.is_empty()
    }
}
