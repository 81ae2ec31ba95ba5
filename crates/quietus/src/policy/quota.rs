//! The library's own policy: a tree over the noise of the region, rebuilt from scratch at each update, deals each
//! pixel its number of samples. docs/method.md has the measurements behind it.
//!
//! Samples that minimise the sum of squared errors `v_p / n_p`, for a given sum of counts `n_p`, are dealt in
//! proportion to `sqrt(v_p)` (Lagrange). What a pixel's own samples say of its `v_p` is next to nothing, so the
//! tree pools it. Each node's mean is one estimate, and the deeper the node, the more local and the less certain.
//! They are mixed from the root down by *credibility* (Bühlmann 1967): of a node that holds m samples, in a region whose
//! mean noise is v
//!
//! ```text
//! V = z * mean of v_p + (1 - z) * V of its parent,   z = m / (m + 3000 v)
//! ```
//!
//! A node is half believed when the error of its mean colour, `v / m`, is down to 1/3000: about half a percent of white,
//! as it is displayed. Where noise is low that is a handful of pixels; where nearly all light comes by rare bright paths
//! hundreds are pooled, and where they found nothing it counts what was found around them. A leaf's V makes its quota, a
//! pixel's quota is that of the leaves over it, each by the part of the pixel that it covers; and a pixel goes on until it
//! has its quota.

use std::sync::Arc;

use super::{ActivePixels, HomeMasks, Rebuild, RuleSettings, StoppingRule};
use crate::{
    Area, ErrorPlane, PixelError, PixelRect, RegionTree, TILE_PIXELS, TILE_SIZE,
    error_metric::NOMINAL_SAMPLES,
    region_tree::{Grown, MIN_SIDE, Split, split_position},
    summed_area::{ErrorSums, Resummed, SummedArea},
};

/// Samples, for each unit of the region's mean noise, at which a node's own mean counts as much as what it inherits. With
/// fewer, noise that rare paths carry is taken for absent where none was met, and the picture loses light; with more,
/// samples go where there is no noise.
pub const CREDIBLE_SAMPLES: f64 = 3000.0;

/// Pixels of the region for which the target error has the meaning that Dammertz et al. gave to it: those that the least
/// leaves touch.
const NOMINAL_PIXELS: f64 = 9.0;

/// Steps of [`PixelError`] in 1.
const STEPS: f64 = (1u64 << PixelError::FRACTION_BITS) as f64;

/// Quotas from the tree over one region.
pub struct QuotaRule {
    error_rect: PixelRect,
    /// A leaf's quota is this times the root of its noise.
    quota_scale: f64,
    sums: Sums,
    tree: RegionTree,
    quotas: Quotas,
    masks: HomeMasks,
}

/// Sums of noise and of samples.
enum Sums {
    Resummed([Resummed; 2]),
    SummedArea([SummedArea; 2]),
}

impl QuotaRule {
    /// A region's quotas before their first update.
    pub fn new(settings: &RuleSettings, region: u32) -> Self {
        // A region of N pixels that all have the error e has the region error e sqrt(N / N_img). With n samples e^2 is
        // v / n; what is to be the same everywhere is e^2 / n, which at 64 samples is that of the target.
        let pixel_error = settings.target_error * (settings.frame_area / NOMINAL_PIXELS).sqrt();
        Self {
            error_rect: settings.regions.error_rect(region),
            quota_scale: NOMINAL_SAMPLES.sqrt() / pixel_error,
            sums: match settings.rebuild {
                Rebuild::Resummed => Sums::Resummed(Default::default()),
                Rebuild::SummedArea => Sums::SummedArea(Default::default()),
            },
            quotas: Quotas {
                rect: settings.regions.error_rect(region),
                quotas: Vec::new(),
                samples: Vec::new(),
            },
            tree: RegionTree::default(),
            masks: HomeMasks::full(&settings.regions, region),
        }
    }
}

/// Grows the tree over sums of noise and of samples; `deal` is given the area of each leaf, and its noise.
fn grow(tree: &mut RegionTree, [noise, samples]: &[impl ErrorSums; 2], mut deal: impl FnMut(&Area, f64)) {
    let mean_noise = |rect: &PixelRect| noise.sum(rect) as f64 / rect.area() as f64 / STEPS;
    // Above 0, so that what holds no sample is never believed.
    let credible = (CREDIBLE_SAMPLES * mean_noise(&noise.bounds())).max(f64::MIN_POSITIVE);
    tree.grow(noise.bounds().into(), None, |area, inherited: Option<f64>| {
        let rect = area.rounded_outward();
        let (own, held) = (mean_noise(&rect), samples.sum(&rect) as f64);
        let credibility = held / (held + credible);
        let mixed = inherited.map_or(own, |inherited| credibility * own + (1.0 - credibility) * inherited);
        let splits = area.longer_side() > 2.0 * MIN_SIDE;
        if !splits {
            deal(area, mixed);
        }
        let position = || split_position(area, noise, noise.sum(&rect), Split::Continuous);
        Grown { error: mixed, complete: false, split: splits.then(|| (position(), Some(mixed))) }
    });
}

/// What each pixel of a rectangle is to have, and has, row by row.
struct Quotas {
    rect: PixelRect,
    quotas: Vec<f32>,
    samples: Vec<u32>,
}

impl Quotas {
    /// No quotas yet, for the samples of a plane.
    fn start(&mut self, errors: &ErrorPlane) {
        errors.copy_samples(&self.rect, &mut self.samples);
        self.quotas.clear();
        self.quotas.resize(self.samples.len(), 0.0);
    }

    fn index(&self, x: u32, y: u32) -> usize {
        (y - self.rect.y0) as usize * self.rect.width() as usize + (x - self.rect.x0) as usize
    }

    /// Adds a leaf's quota to its pixels, each by the part that lies in the leaf.
    fn add(&mut self, area: &Area, quota: f64) {
        let rect = area.rounded_outward();
        let part =
            |start: f64, end: f64, pixel: u32| end.min(f64::from(pixel + 1)) - start.max(f64::from(pixel));
        for y in rect.y0..rect.y1 {
            let quota = quota * part(area.y0, area.y1, y);
            let first = self.index(rect.x0, y);
            for (sum, x) in self.quotas[first..].iter_mut().zip(rect.x0..rect.x1) {
                *sum += (quota * part(area.x0, area.x1, x)) as f32;
            }
        }
    }

    fn is_below(&self, x: u32, y: u32) -> bool {
        let index = self.index(x, y);
        // In double precision, where every count is exact.
        f64::from(self.samples[index]) < f64::from(self.quotas[index])
    }

    /// Whether all pixels that an area touches have their quota.
    fn are_met(&self, area: &Area) -> bool {
        let rect = area.rounded_outward();
        !(rect.y0..rect.y1).any(|y| (rect.x0..rect.x1).any(|x| self.is_below(x, y)))
    }
}

impl ActivePixels for QuotaRule {
    fn active(&self, tile: u32) -> u64 {
        self.masks.active(tile)
    }
}

impl StoppingRule for QuotaRule {
    fn update(&mut self, errors: &ErrorPlane) {
        let Self { error_rect, quota_scale, sums, tree, quotas, masks } = self;
        quotas.start(errors);
        let deal = |area: &Area, noise: f64| quotas.add(area, *quota_scale * noise.sqrt());
        match sums {
            Sums::Resummed(sums) => {
                sums[0].load(errors, *error_rect);
                sums[1].load_samples(errors, *error_rect);
                grow(tree, sums, deal);
            }
            Sums::SummedArea(sums) => {
                sums[0].load(errors, *error_rect);
                sums[1].load_samples(errors, *error_rect);
                grow(tree, sums, deal);
            }
        }
        tree.mark_complete(|area| quotas.are_met(area));
        masks.draw(|x, y| quotas.is_below(x, y));
    }

    fn check(&self) -> Arc<dyn ActivePixels> {
        Arc::new(self.masks.clone())
    }

    fn is_complete(&self) -> bool {
        self.tree.is_complete()
    }

    fn quotas(&self, tile: u32) -> Option<[f32; TILE_PIXELS]> {
        let rect = self.masks.regions.grid().tile_rect(tile);
        let mut quotas = [0.0; TILE_PIXELS];
        for y in rect.y0..rect.y1 {
            for x in rect.x0..rect.x1 {
                let place = (y - rect.y0) * TILE_SIZE + x - rect.x0;
                // Before the first update there are none.
                quotas[place as usize] = *self.quotas.quotas.get(self.quotas.index(x, y))?;
            }
        }
        Some(quotas)
    }

    fn tree(&self) -> Option<&RegionTree> {
        Some(&self.tree)
    }
}
