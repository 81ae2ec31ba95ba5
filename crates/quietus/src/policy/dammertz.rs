//! A baseline: Dammertz et al. 2010, a queue of blocks with integer bounds that are split, and discarded for good
//! when their error is below the target.

use std::sync::Arc;

use super::{ActivePixels, HomeMasks, RuleMemory, RuleSettings, StoppingRule};
use crate::{
    ErrorPlane, PixelRect,
    pixel_rect::{Area, Axis},
    protocol::Misfit,
    region_error::region_error,
    region_tree::SPLIT_FACTOR,
    summed_area::{ErrorSums, SummedArea},
};

/// The queue of blocks that are still sampled.
pub struct DammertzRule {
    masks: HomeMasks,
    error_rect: PixelRect,
    blocks: Vec<PixelRect>,
    sums: SummedArea,
    target_error: f64,
    frame_area: f64,
}

impl DammertzRule {
    /// A region before its first update: one block.
    pub fn new(settings: &RuleSettings, region: u32) -> Self {
        let error_rect = settings.regions.error_rect(region);
        Self {
            masks: HomeMasks::full(&settings.regions, region),
            error_rect,
            blocks: vec![error_rect],
            sums: SummedArea::default(),
            target_error: settings.target_error,
            frame_area: settings.frame_area,
        }
    }
}

impl ActivePixels for DammertzRule {
    fn active(&self, tile: u32) -> u64 {
        self.masks.active(tile)
    }
}

impl StoppingRule for DammertzRule {
    fn update(&mut self, errors: &ErrorPlane) {
        self.sums.load(errors, self.error_rect);
        let mut kept = Vec::with_capacity(self.blocks.len());
        // Each update looks at each block once: it is discarded, split in two, or left as it is.
        for block in self.blocks.drain(..) {
            let error = region_error(self.sums.sum(&block), block.area() as f64, self.frame_area);
            if error < self.target_error {
                continue;
            }
            match split(&block, &self.sums) {
                Some((first, second)) if error < SPLIT_FACTOR * self.target_error => {
                    kept.extend([first, second]);
                }
                _ => kept.push(block),
            }
        }
        self.blocks = kept;
        self.masks.clear();
        self.blocks.iter().for_each(|block| self.masks.add(block));
    }

    fn memory(&self) -> RuleMemory {
        RuleMemory::Blocks(self.blocks.clone())
    }

    fn restore(&mut self, masks: &[u64], memory: &RuleMemory, _: &ErrorPlane) -> Result<(), Misfit> {
        let RuleMemory::Blocks(blocks) = memory else { return Err(Misfit("it is of another policy")) };
        let inside = |block: &PixelRect| !block.is_empty() && self.error_rect.contains_rect(block);
        Misfit::unless(blocks.iter().all(inside), "a block leaves its region")?;
        self.blocks.clone_from(blocks);
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

/// Two blocks of nearly equal error, cut across the longer axis at a pixel boundary; `None` for a single pixel.
fn split(block: &PixelRect, sums: &SummedArea) -> Option<(PixelRect, PixelRect)> {
    let axis = Area::from(*block).longer_axis();
    let (start, end) = match axis {
        Axis::X => (block.x0, block.x1),
        Axis::Y => (block.y0, block.y1),
    };
    if end - start < 2 {
        return None;
    }
    let total = sums.sum(block);
    let middle = (start + end) / 2;
    // The boundary nearer to half of the error: before or after the column (row) that reaches it.
    let cut = sums.half_way(block, axis, total).map_or(middle, |half| {
        let after = 2 * (half.before + half.within) - total;
        let before = total - 2 * half.before;
        if after <= before { half.index + 1 } else { half.index }
    });
    let cut = cut.clamp(start + 1, end - 1);
    Some(match axis {
        Axis::X => (PixelRect { x1: cut, ..*block }, PixelRect { x0: cut, ..*block }),
        Axis::Y => (PixelRect { y1: cut, ..*block }, PixelRect { y0: cut, ..*block }),
    })
}
