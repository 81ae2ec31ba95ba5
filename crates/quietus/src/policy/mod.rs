//! Policies: which pixels go on, decided per region from the errors of its pixels.
//!
//! The talk's tree, and the baselines that prove its gain, behind one interface. A policy holds no lock and knows
//! no thread; the coordinator calls it when a region's last visit of a pass is finished.

mod dammertz;
mod pixel;
mod quota;
mod tile;
mod tree;
mod unbiased;

pub use dammertz::DammertzRule;
pub use pixel::PixelRule;
pub use quota::{CREDIBLE_SAMPLES, QuotaRule};
pub use tile::TileRule;
pub use tree::{Rebuild, TreeRule};
pub use unbiased::UnbiasedRule;

use std::sync::Arc;

use crate::{
    DammertzMetric, ErrorMetric, ErrorPlane, PassCounts, PixelRect, RegionTree, Regions, SampleNoise,
    TILE_PIXELS, protocol::Misfit,
};

/// How sampling is steered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum Policy {
    /// Every pixel gets the maximum number of samples.
    Uniform,
    /// Each tile stops for good on its own error: the talk's "previous generation", with its box artefacts.
    Tile,
    /// The method of Dammertz et al. 2010: blocks with integer bounds that are split, and discarded for good.
    Dammertz,
    /// Each pixel stops on its own error, unless one of its eight neighbours goes on.
    Pixel,
    /// The talk's tree, tiles drawn over the bounding rectangle of their active pixels as published practice
    /// does.
    Talk,
    /// A tree that deals each pixel its number of samples, in proportion to the noise around it. Its metric is
    /// [`SampleNoise`].
    #[default]
    Quietus,
    /// Counts from pilots of other pixels only, so that every pixel's mean is unbiased.
    Unbiased,
}

/// What a policy needs to know of the picture and the request.
#[derive(Clone, Debug)]
pub struct RuleSettings {
    /// The partition.
    pub regions: Regions,
    /// The region error asked for.
    pub target_error: f64,
    /// N_img of the region error.
    pub frame_area: f64,
    /// How trees are rebuilt.
    pub rebuild: Rebuild,
    /// How counts grow.
    pub counts: PassCounts,
}

/// Which pixels are active, as of one update.
pub trait ActivePixels: Send + Sync {
    /// The active pixels of one of the region's home tiles.
    fn active(&self, tile: u32) -> u64;
}

/// The state of a policy in one region.
///
/// With unchanged errors, from unchanged numbers of samples, an update never activates a pixel: otherwise a finished
/// picture would not stay so.
pub trait StoppingRule: ActivePixels {
    /// Takes in the errors as they are now. The coordinator calls this only from when every pixel of the region has its
    /// minimum of samples, or, for the policy `quietus`, will have it by the time this takes effect; before, all pixels
    /// are active. In deterministic mode the first call for the other policies is made with the errors of pass
    /// [`PassCounts::min_passes`] - 1, the next ones with those of each pass that follows, until a pass draws nothing in
    /// the region.
    fn update(&mut self, errors: &ErrorPlane);

    /// What the last update decided, kept as it is now: readers under a lock look into this while the rule
    /// itself is updated again.
    fn check(&self) -> Arc<dyn ActivePixels>;

    /// Whether no pixel of the region is active any more.
    fn is_complete(&self) -> bool;

    /// What it remembers beyond the masks of its latest update.
    fn memory(&self) -> RuleMemory {
        RuleMemory::Nothing
    }

    /// Goes on from the `masks` of the home tiles and the `memory` that another rule of the region had after its latest
    /// update. `errors` are those of that update, or newer ones where another update is to come: a rule that looks at
    /// nothing but errors takes them in.
    fn restore(&mut self, masks: &[u64], memory: &RuleMemory, errors: &ErrorPlane) -> Result<(), Misfit> {
        let _ = masks;
        Misfit::unless(*memory == RuleMemory::Nothing, "it is of another policy")?;
        self.update(errors);
        Ok(())
    }

    /// Samples that each pixel of one of the region's home tiles is to have, row by row, where the policy deals samples;
    /// 0 outside the window.
    fn quotas(&self, _tile: u32) -> Option<[f32; TILE_PIXELS]> {
        None
    }

    /// The tree, where the policy has one.
    fn tree(&self) -> Option<&RegionTree> {
        None
    }
}

/// What a policy remembers of a region from update to update, beyond its masks.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum RuleMemory {
    /// All it needs is in the errors or in the masks.
    #[default]
    Nothing,
    /// The blocks that are still sampled ([`DammertzRule`]).
    Blocks(Vec<PixelRect>),
    /// What was decided when the pilot was over ([`UnbiasedRule`]).
    Decided {
        /// Samples that each pixel of the home tiles should have, row by row.
        wanted: Vec<f64>,
        /// The pass that will consult the next tree.
        pass: u64,
        /// Samples of a pixel that all passes before it draw.
        count: u32,
    },
}

impl Policy {
    /// The metric that the policy is made for. [`ErrorMetric`] says what one of the renderer's own must mean.
    pub fn metric(self) -> &'static (dyn ErrorMetric + Sync) {
        match self {
            Self::Quietus => &SampleNoise,
            _ => &DammertzMetric,
        }
    }

    /// The state of this policy in a region, before its first update: all pixels active.
    #[doc(hidden)]
    pub fn rule(self, settings: &RuleSettings, region: u32) -> Box<dyn StoppingRule> {
        match self {
            Self::Uniform => Box::new(UniformRule { regions: settings.regions.clone() }),
            Self::Tile => Box::new(TileRule::new(settings, region)),
            Self::Dammertz => Box::new(DammertzRule::new(settings, region)),
            Self::Pixel => Box::new(PixelRule::new(settings, region)),
            Self::Talk => Box::new(TreeRule::new(settings, region).filling_bounding_rectangles()),
            Self::Quietus => Box::new(QuotaRule::new(settings, region)),
            Self::Unbiased => Box::new(UnbiasedRule::new(settings, region)),
        }
    }
}

/// Never stops.
#[derive(Clone)]
struct UniformRule {
    regions: Regions,
}

impl ActivePixels for UniformRule {
    fn active(&self, tile: u32) -> u64 {
        self.regions.grid().full_mask(tile)
    }
}

impl StoppingRule for UniformRule {
    fn update(&mut self, _: &ErrorPlane) {}

    fn check(&self) -> Arc<dyn ActivePixels> {
        Arc::new(self.clone())
    }

    fn is_complete(&self) -> bool {
        false
    }
}

/// What has these masks in the home tiles of a region.
pub(crate) fn home_masks(regions: &Regions, region: u32, masks: Vec<u64>) -> Arc<dyn ActivePixels> {
    Arc::new(HomeMasks { masks, ..HomeMasks::full(regions, region) })
}

/// Masks of the home tiles of a region.
#[derive(Clone, Debug)]
struct HomeMasks {
    regions: Regions,
    home: crate::PixelRect,
    masks: Vec<u64>,
}

impl ActivePixels for HomeMasks {
    fn active(&self, tile: u32) -> u64 {
        let (column, row) = self.regions.grid().coordinates(tile);
        self.masks[self.slot(column, row)]
    }
}

impl HomeMasks {
    /// All pixels active.
    fn full(regions: &Regions, region: u32) -> Self {
        let home = regions.home_rect(region);
        let masks = regions.home_tiles(region).map(|tile| regions.grid().full_mask(tile)).collect();
        Self { regions: regions.clone(), home, masks }
    }

    fn slot(&self, column: u32, row: u32) -> usize {
        let first = (self.home.x0 / crate::TILE_SIZE, self.home.y0 / crate::TILE_SIZE);
        let stride = self.home.width().div_ceil(crate::TILE_SIZE);
        ((row - first.1) * stride + column - first.0) as usize
    }

    fn clear(&mut self) {
        self.masks.fill(0);
    }

    /// Adds the pixels of `rect` that lie in the home tiles.
    fn add(&mut self, rect: &crate::PixelRect) {
        let part = rect.intersection(&self.home);
        if part.is_empty() {
            return;
        }
        let tiles = |start: u32, end: u32| start / crate::TILE_SIZE..=(end - 1) / crate::TILE_SIZE;
        for row in tiles(part.y0, part.y1) {
            for column in tiles(part.x0, part.x1) {
                let origin = crate::PixelRect::new(column * 8, row * 8, column * 8 + 8, row * 8 + 8);
                let slot = self.slot(column, row);
                self.masks[slot] |= crate::active_mask::rect_in_tile(&origin, &part);
            }
        }
    }

    /// Adds one pixel, which lies in a home tile.
    fn add_pixel(&mut self, x: u32, y: u32) {
        let slot = self.slot(x / crate::TILE_SIZE, y / crate::TILE_SIZE);
        self.masks[slot] |= 1 << (y % crate::TILE_SIZE * crate::TILE_SIZE + x % crate::TILE_SIZE);
    }

    /// Makes active the pixels of the home tiles that `is_active` names.
    fn draw(&mut self, is_active: impl Fn(u32, u32) -> bool) {
        self.clear();
        for y in self.home.y0..self.home.y1 {
            for x in self.home.x0..self.home.x1 {
                let slot = self.slot(x / crate::TILE_SIZE, y / crate::TILE_SIZE);
                self.masks[slot] |= u64::from(is_active(x, y))
                    << (y % crate::TILE_SIZE * crate::TILE_SIZE + x % crate::TILE_SIZE);
            }
        }
    }

    fn is_empty(&self) -> bool {
        self.masks.iter().all(|&mask| mask == 0)
    }
}
