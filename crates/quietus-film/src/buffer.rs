//! What one thread collects during one visit to one tile, before the film sees it.

use quietus_trace::tile::{PixelWork, Sample, SampleSink};

use crate::layout::TILE_PIXELS;
use crate::rejected::{RejectedSample, RejectedSamples};

/// Largest magnitude the film takes. Sums are kept in f32 (up to 3.4e38); 2^32 samples below this stay finite.
const MAX_MAGNITUDE: f32 = 1e28;

/// Sums of one replicate of one pixel within one visit, in f64 so that their order hardly matters.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct VisitReplicate {
    /// Red, green, blue, alpha.
    pub sum: [f64; 4],
    pub count: u32,
}

/// Sums of the other quantities of one pixel within one visit.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct VisitAovs {
    /// Albedo, normal, depth.
    pub sum: [f64; 7],
    /// Squares of alpha, albedo and normal, the channels of each added up.
    pub squares: [f64; 3],
    /// Samples whose camera ray hit a surface: the ones with a depth.
    pub hits: u32,
}

/// How many samples a visit brought.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct VisitSummary {
    /// All samples drawn, also the rejected ones.
    pub drawn: u64,
    /// The ones that were not finite.
    pub rejected: u64,
}

/// The thread's own accumulator: no lock and no allocation per sample. Cleared by [`crate::Film::commit`].
pub struct TileBuffer {
    replicates_per_pixel: usize,
    replicates: Vec<VisitReplicate>,
    aovs: Vec<VisitAovs>,
    /// Pixels that got samples since the last commit, one bit each.
    touched: u64,
    drawn: u64,
    rejected: RejectedSamples,
}

impl TileBuffer {
    /// A buffer for films with that many replicates per pixel.
    pub fn new(replicates_per_pixel: usize) -> Self {
        Self {
            replicates_per_pixel,
            replicates: vec![VisitReplicate::default(); TILE_PIXELS * replicates_per_pixel],
            aovs: vec![VisitAovs::default(); TILE_PIXELS],
            touched: 0,
            drawn: 0,
            rejected: RejectedSamples::default(),
        }
    }

    /// What was collected since it was last cleared.
    pub fn summary(&self) -> VisitSummary {
        VisitSummary { drawn: self.drawn, rejected: self.rejected.count() }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        let replicates = self.replicates_per_pixel;
        for pixel in pixels_of(self.touched) {
            self.replicates[pixel * replicates..][..replicates].fill(VisitReplicate::default());
            self.aovs[pixel] = VisitAovs::default();
        }
        self.touched = 0;
        self.drawn = 0;
        self.rejected.clear();
    }

    pub(crate) fn replicates_per_pixel(&self) -> usize {
        self.replicates_per_pixel
    }

    pub(crate) fn rejected(&self) -> &RejectedSamples {
        &self.rejected
    }

    /// Every touched pixel with its replicates and other quantities.
    pub(crate) fn touched(&self) -> impl Iterator<Item = (usize, &[VisitReplicate], &VisitAovs)> {
        let replicates = self.replicates_per_pixel;
        pixels_of(self.touched)
            .map(move |p| (p, &self.replicates[p * replicates..][..replicates], &self.aovs[p]))
    }
}

/// The numbers of the bits set.
fn pixels_of(mut mask: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let pixel = (mask != 0).then(|| mask.trailing_zeros() as usize)?;
        mask &= mask - 1;
        Some(pixel)
    })
}

/// Radiance, alpha, albedo, normal and depth in a row.
fn values(sample: &Sample) -> ([f32; 4], [f32; 7]) {
    let (c, a, n) = (sample.radiance, sample.albedo, sample.normal);
    ([c.x, c.y, c.z, sample.alpha], [a.x, a.y, a.z, n.x, n.y, n.z, sample.depth])
}

/// Squares of alpha, albedo and normal; finite, as no magnitude is beyond the largest.
#[inline]
fn squares(sample: &Sample) -> [f32; 3] {
    let squares =
        [sample.alpha * sample.alpha, sample.albedo.length_squared(), sample.normal.length_squared()];
    squares.map(|square| square.min(MAX_MAGNITUDE))
}

impl SampleSink for TileBuffer {
    /// Takes a sample; one that is not finite in any of its parts is counted and otherwise dropped whole, so that
    /// colour, alpha and AOVs of a pixel always speak of the same samples.
    #[inline]
    fn add(&mut self, work: &PixelWork, index: u32, sample: &Sample) {
        let pixel = usize::from(work.pixel);
        let (color, aovs) = values(sample);
        self.drawn += 1;
        // Written so that NaN fails too.
        if !color.iter().chain(&aovs).all(|value| value.abs() <= MAX_MAGNITUDE) {
            let (x, y, replicate) = (work.x, work.y, work.replicate);
            self.rejected.push(RejectedSample { y, x, replicate, index });
            return;
        }
        self.touched |= 1 << pixel;
        let replicate = &mut self.replicates[pixel * self.replicates_per_pixel + usize::from(work.replicate)];
        replicate.count += 1;
        for (sum, value) in replicate.sum.iter_mut().zip(color) {
            *sum += f64::from(value);
        }
        let target = &mut self.aovs[pixel];
        for (sum, square) in target.squares.iter_mut().zip(squares(sample)) {
            *sum += f64::from(square);
        }
        target.hits += u32::from(sample.depth > 0.0);
        for (sum, value) in target.sum.iter_mut().zip(aovs) {
            *sum += f64::from(value);
        }
    }
}
