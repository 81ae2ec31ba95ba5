//! The talk's policy: a tree over the region, rebuilt from scratch at each update.

use std::sync::Arc;

use super::{ActivePixels, HomeMasks, RuleSettings, StoppingRule};
use crate::{
    ErrorPlane, PixelRect, RegionTree, TileGrid,
    active_mask::fill_to_bounding_rectangle,
    region_tree::{Split, TreeSettings},
    summed_area::{Resummed, SummedArea},
};

/// How a tree is rebuilt. Both give the same tree, bit for bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Rebuild {
    /// Errors are summed anew for every node, and a tile is checked by walking the tree: the talk's way.
    Resummed,
    /// One summed-area table per update; the masks of all tiles are drawn once from the active leaves.
    #[default]
    SummedArea,
}

/// The talk's tree over one region.
pub struct TreeRule {
    error_rect: PixelRect,
    settings: TreeSettings,
    rebuilder: Rebuilder,
    tree: RegionTree,
    masks: HomeMasks,
    fills: bool,
}

enum Rebuilder {
    Resummed(Resummed),
    SummedArea(SummedArea),
}

impl TreeRule {
    /// A region's tree before its first update.
    pub fn new(settings: &RuleSettings, region: u32) -> Self {
        Self {
            error_rect: settings.regions.error_rect(region),
            settings: TreeSettings {
                target_error: settings.target_error,
                frame_area: settings.frame_area,
                split: Split::Continuous,
            },
            rebuilder: match settings.rebuild {
                Rebuild::Resummed => Rebuilder::Resummed(Resummed::default()),
                Rebuild::SummedArea => Rebuilder::SummedArea(SummedArea::default()),
            },
            tree: RegionTree::default(),
            masks: HomeMasks::full(&settings.regions, region),
            fills: false,
        }
    }

    /// Draws tiles over the bounding rectangle of their active pixels, as published practice does.
    pub fn filling_bounding_rectangles(mut self) -> Self {
        self.fills = true;
        self
    }
}

/// Checks a tile by walking the tree.
struct TreeWalk {
    tree: RegionTree,
    grid: TileGrid,
    fills: bool,
}

impl ActivePixels for TreeWalk {
    fn active(&self, tile: u32) -> u64 {
        filled(self.tree.active(&self.grid.tile_rect(tile)), self.fills)
    }
}

/// Checks a tile by the mask that was drawn for it.
struct DrawnMasks {
    masks: HomeMasks,
    fills: bool,
}

impl ActivePixels for DrawnMasks {
    fn active(&self, tile: u32) -> u64 {
        filled(self.masks.active(tile), self.fills)
    }
}

fn filled(mask: u64, fills: bool) -> u64 {
    if fills { fill_to_bounding_rectangle(mask) } else { mask }
}

impl ActivePixels for TreeRule {
    fn active(&self, tile: u32) -> u64 {
        let mask = match &self.rebuilder {
            Rebuilder::Resummed(_) => self.tree.active(&self.masks.regions.grid().tile_rect(tile)),
            Rebuilder::SummedArea(_) => self.masks.active(tile),
        };
        filled(mask, self.fills)
    }
}

impl StoppingRule for TreeRule {
    fn update(&mut self, errors: &ErrorPlane) {
        match &mut self.rebuilder {
            Rebuilder::Resummed(sums) => {
                sums.load(errors, self.error_rect);
                self.tree.rebuild(sums, &self.settings);
            }
            Rebuilder::SummedArea(sums) => {
                sums.load(errors, self.error_rect);
                self.tree.rebuild(sums, &self.settings);
                self.masks.clear();
                self.tree.for_each_active(|rect| self.masks.add(rect));
            }
        }
    }

    fn check(&self) -> Arc<dyn ActivePixels> {
        let (grid, fills) = (*self.masks.regions.grid(), self.fills);
        match &self.rebuilder {
            Rebuilder::Resummed(_) => Arc::new(TreeWalk { tree: self.tree.clone(), grid, fills }),
            Rebuilder::SummedArea(_) => Arc::new(DrawnMasks { masks: self.masks.clone(), fills }),
        }
    }

    fn is_complete(&self) -> bool {
        self.tree.is_complete()
    }

    fn tree(&self) -> Option<&RegionTree> {
        Some(&self.tree)
    }
}
