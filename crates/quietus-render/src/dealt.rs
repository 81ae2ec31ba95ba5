//! What is dealt while a round is drawn, and the counts by which pixels come to it.

use quietus::{AdaptiveSampling, PassCounts, Policy};

use crate::forecast::{PIXELS, even, towards_a_noise};
use crate::noise::{Finished, pooled_noises};

/// The counts that a pixel comes by.
#[derive(Clone)]
pub(crate) struct Steps {
    policy: Policy,
    /// None where any number will do, as with uniform sampling.
    steps: Vec<u32>,
    counts: PassCounts,
}

impl Steps {
    /// Of a policy whose passes draw `counts`.
    pub(crate) fn of(policy: Policy, counts: PassCounts) -> Self {
        let next = |&count: &u32| (count < counts.max_samples).then(|| counts.next(count));
        let is_dealt = policy != Policy::Uniform;
        let steps = if is_dealt { std::iter::successors(Some(0), next).collect() } else { Vec::new() };
        Self { policy, steps, counts }
    }

    /// The same where passes draw other `counts`.
    pub(crate) fn by(&self, counts: PassCounts) -> Self {
        Self::of(self.policy, counts)
    }

    /// What no pixel exceeds.
    pub(crate) fn most(&self) -> u32 {
        self.counts.max_samples
    }

    /// What a pixel of `count` samples will have that is to have `quota`.
    pub(crate) fn count(&self, count: u32, quota: f64) -> u32 {
        if f64::from(count) >= quota {
            return count;
        }
        let Some(&last) = self.steps.last() else {
            return even(quota).clamp(count, self.counts.max_samples.max(count));
        };
        // Trees that lag behind draw a pixel again that has its quota, and at least as often as they lag.
        let lag = self.counts.lag as usize;
        let now = self.steps.partition_point(|&step| step < count);
        let enough = self.steps.partition_point(|&step| f64::from(step) < quota);
        let then = (enough + lag - 1).max(now + lag);
        self.steps.get(then).copied().unwrap_or(last).max(count)
    }
}

/// A pixel and what it is to have.
#[derive(Clone, Copy, Debug)]
struct DealtPixel {
    tile: u32,
    count: u32,
    quota: f64,
}

/// Counts and quotas of a picture that is being drawn.
pub(crate) struct Dealt {
    /// Some, spread evenly.
    pixels: Vec<DealtPixel>,
    /// Pixels that each of them stands for.
    stands_for: f64,
    /// Those that were asked for.
    asked: Vec<DealtPixel>,
    steps: Steps,
    /// What every pixel will have in any case.
    least: u32,
}

impl Dealt {
    /// Of a round of sampling, and of the pixels `asked` (row by row). `None` where samples are to be dealt and there are no
    /// quotas yet.
    pub(crate) fn of(sampling: &AdaptiveSampling, asked: impl Iterator<Item = usize>) -> Option<Self> {
        let grid = sampling.grid();
        let is_dealt = sampling.settings().policy != Policy::Uniform;
        if is_dealt && (0..grid.tiles()).any(|tile| sampling.quotas(tile).is_none()) {
            return None;
        }
        let quotas =
            |tile: u32, pixel: u8| sampling.quotas(tile).map(|quotas| quotas[usize::from(pixel)].into());
        Some(Self::with_quotas(sampling, quotas, asked))
    }

    /// The same before there are quotas, by what they will be made from: as the noise of a sample is pooled over the pixels
    /// around. They are known but for a factor.
    pub(crate) fn before_quotas(
        sampling: &AdaptiveSampling,
        picture: &Finished<'_>,
        asked: impl Iterator<Item = usize>,
    ) -> Self {
        let (grid, noises) = (sampling.grid(), pooled_noises(picture));
        let quotas = |tile: u32, pixel: u8| {
            let rect = grid.tile_rect(tile);
            let (x, y) = (rect.x0 + u32::from(pixel) % 8, rect.y0 + u32::from(pixel) / 8);
            Some(noises[y as usize * grid.width() as usize + x as usize].sqrt())
        };
        Self::with_quotas(sampling, quotas, asked)
    }

    fn with_quotas(
        sampling: &AdaptiveSampling,
        quotas: impl Fn(u32, u8) -> Option<f64>,
        asked: impl Iterator<Item = usize>,
    ) -> Self {
        let (grid, settings) = (sampling.grid(), sampling.settings());
        let counts = settings.pass_counts();
        let least = counts.least();
        let stride = (grid.rect().area() as usize).div_ceil(PIXELS).max(1);
        let dealt = |tile: u32, pixel: u8| {
            let count = sampling.counts().pixel(tile, pixel);
            DealtPixel { tile, count, quota: quotas(tile, pixel).unwrap_or(f64::from(least)) }
        };
        let tile_pixels =
            |tile| quietus::active_mask::pixels(grid.full_mask(tile)).map(move |pixel| (tile, pixel));
        let all = (0..grid.tiles()).flat_map(tile_pixels);
        let pixels = all.skip(stride - 1).step_by(stride).map(|(tile, pixel)| dealt(tile, pixel)).collect();
        let asked = asked.map(|pixel| {
            let (tile, pixel) = tile_and_pixel(sampling, pixel);
            dealt(tile, pixel)
        });
        let asked = asked.collect();
        let steps = Steps::of(settings.policy, counts);
        Self { pixels, stands_for: stride as f64, asked, steps, least }
    }

    /// The same with the counts by which pixels come to a noise.
    pub(crate) fn towards_a_noise(self) -> Self {
        Self { steps: self.steps.by(towards_a_noise(self.steps.counts)), ..self }
    }

    /// What a pixel will have if quotas are multiplied by `factor`.
    fn then(&self, pixel: &DealtPixel, factor: f64) -> u32 {
        self.steps.count(pixel.count.max(self.least), factor * pixel.quota)
    }

    /// The same for the pixel that was asked for as number `asked`.
    pub(crate) fn asked(&self, asked: usize, factor: f64) -> f64 {
        self.then(&self.asked[asked], factor).into()
    }

    /// Samples of all pixels.
    pub(crate) fn now(&self) -> f64 {
        self.stands_for * self.pixels.iter().map(|pixel| f64::from(pixel.count)).sum::<f64>()
    }

    /// Samples of all pixels if quotas are multiplied by `factor`; and what was drawn and is left then, where samples of each
    /// tile cost `costs`.
    pub(crate) fn left(&self, factor: f64, costs: &[f64]) -> [f64; 3] {
        let sums = self.pixels.iter().fold([0.0; 3], |[samples, drawn, left], pixel| {
            let (now, then) = (f64::from(pixel.count), f64::from(self.then(pixel, factor)));
            let cost = costs[pixel.tile as usize];
            [samples + then, drawn + cost * now, left + cost * (then - now)]
        });
        sums.map(|sum| sum * self.stands_for)
    }
}

/// Samples that a picture has in the pixels `asked` (row by row), at least those that every pixel gets.
pub(crate) fn samples_in(sampling: &AdaptiveSampling, asked: impl Iterator<Item = usize>) -> Vec<f64> {
    let least = sampling.settings().pass_counts().least();
    let samples = |pixel| {
        let (tile, pixel) = tile_and_pixel(sampling, pixel);
        f64::from(sampling.counts().pixel(tile, pixel).max(least))
    };
    asked.map(samples).collect()
}

/// The tile of a pixel (row by row), and its place there.
fn tile_and_pixel(sampling: &AdaptiveSampling, pixel: usize) -> (u32, u8) {
    let width = sampling.grid().width();
    let (x, y) = (pixel as u32 % width, pixel as u32 / width);
    (y / 8 * width.div_ceil(8) + x / 8, (y % 8 * 8 + x % 8) as u8)
}
