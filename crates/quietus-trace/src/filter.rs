//! Reconstruction filters, importance-sampled: a sample belongs to the one pixel that asked for it.
//!
//! Instead of splatting a sample into every pixel its filter reaches, each pixel draws its sample positions with
//! the filter as their density (Ernst, Stamminger, Greiner 2006, "Filter importance sampling"). All filters here
//! are non-negative, so every sample has weight 1 and pixels stay independent, which is what adaptive
//! sampling asks for.

use glam::Vec2;

/// The shape of the filter, separable in x and y, centred on the pixel's centre. Lengths in pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Filter {
    /// 1 over the pixel itself: radius 0.5.
    Box,
    /// A Gaussian of standard deviation 0.5, cut at radius 1.5 and lowered to reach 0 there.
    Gaussian,
    /// The 4-term Blackman-Harris window of radius 1.5 (Harris 1978, table 1), close to a Gaussian but compact.
    #[default]
    BlackmanHarris,
}

impl Filter {
    /// Half width of the support.
    pub fn radius(self) -> f32 {
        match self {
            Filter::Box => 0.5,
            Filter::Gaussian | Filter::BlackmanHarris => 1.5,
        }
    }

    /// One axis of the filter at a distance `x` from the centre, not normalised.
    pub fn weight(self, x: f32) -> f32 {
        if x.abs() > self.radius() {
            return 0.0;
        }
        match self {
            Filter::Box => 1.0,
            Filter::Gaussian => {
                let gauss = |x: f32| (-x * x / (2.0 * 0.5 * 0.5)).exp();
                (gauss(x) - gauss(self.radius())).max(0.0)
            }
            Filter::BlackmanHarris => {
                let t = std::f32::consts::PI * (x / self.radius() + 1.0);
                let window =
                    0.35875 - 0.48829 * t.cos() + 0.14128 * (2.0 * t).cos() - 0.01168 * (3.0 * t).cos();
                window.max(0.0)
            }
        }
    }
}

/// Cells of the tabulated density over one half of the axis. Chosen so that the interpolation error (at most
/// `h^2 f'' / 8`, relative to the peak below 4e-4) disappears in 10^6 samples.
const CELLS: usize = 128;

/// Draws sample positions with a [`Filter`] as density.
///
/// The density of one half axis is tabulated, linear inside each cell, and inverted exactly.
#[derive(Clone, Debug)]
pub struct FilterSampler {
    filter: Filter,
    /// Density at the cell borders, in units of `1 / radius`, over `|x| / radius` in 0..1.
    density: [f32; CELLS + 1],
    /// Distribution function at the cell borders, 0 to 1.
    cdf: [f32; CELLS + 1],
}

impl FilterSampler {
    /// Tabulates `filter`.
    pub fn new(filter: Filter) -> Self {
        let h = 1.0 / CELLS as f64;
        let weight: Vec<f64> =
            (0..=CELLS).map(|i| f64::from(filter.weight(filter.radius() * (i as f64 * h) as f32))).collect();
        let mut sums = vec![0.0];
        for pair in weight.windows(2) {
            sums.push(sums.last().unwrap_or(&0.0) + 0.5 * h * (pair[0] + pair[1]));
        }
        let total = sums[CELLS];
        Self {
            filter,
            density: std::array::from_fn(|i| (weight[i] / total) as f32),
            cdf: std::array::from_fn(|i| (sums[i] / total) as f32),
        }
    }

    /// The filter this draws from.
    pub fn filter(&self) -> Filter {
        self.filter
    }

    /// Offset from the pixel's centre in pixels, for `u` in `[0, 1)^2`.
    #[inline]
    pub fn sample(&self, u: Vec2) -> Vec2 {
        match self.filter {
            Filter::Box => u - 0.5,
            _ => Vec2::new(self.sample_axis(u.x), self.sample_axis(u.y)),
        }
    }

    /// Both halves are the same: the upper half of `u` goes right, the lower left, both monotonically.
    #[inline]
    fn sample_axis(&self, u: f32) -> f32 {
        let centred = 2.0 * u - 1.0;
        let x = self.invert(centred.abs()) * self.filter.radius();
        if centred < 0.0 { -x } else { x }
    }

    /// Solves `cdf(x) = u` for x in 0..1.
    #[inline]
    fn invert(&self, u: f32) -> f32 {
        let mut cell = 0;
        let mut step = CELLS / 2;
        while step > 0 {
            cell += if self.cdf[cell + step] <= u { step } else { 0 };
            step /= 2;
        }
        let (d0, d1) = (self.density[cell], self.density[cell + 1]);
        // Inside the cell: mass(t) = h (d0 t + (d1 - d0) t^2 / 2), solved in the form without cancellation.
        let mass = (u - self.cdf[cell]) * CELLS as f32;
        let root = (d0 * d0 + 2.0 * (d1 - d0) * mass).max(0.0).sqrt();
        let t = if d0 + root > 0.0 { (2.0 * mass / (d0 + root)).clamp(0.0, 1.0) } else { 0.0 };
        (cell as f32 + t) / CELLS as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Rng, Suite, chi_square};

    /// Positions fall into bins as the integral of the filter says, along both axes.
    #[test]
    fn filters_are_sampled_with_their_weight() {
        const SAMPLES: usize = 200_000;
        const BINS: usize = 60;
        let mut suite = Suite::new(6);
        for filter in [Filter::Box, Filter::Gaussian, Filter::BlackmanHarris] {
            let sampler = FilterSampler::new(filter);
            let radius = f64::from(filter.radius());
            let bin_integral = |bin: usize| -> f64 {
                let place =
                    |i: usize| (2.0 * (bin as f64 + (i as f64 + 0.5) / 64.0) / BINS as f64 - 1.0) * radius;
                (0..64).map(|i| f64::from(filter.weight(place(i) as f32))).sum()
            };
            let integrals: Vec<f64> = (0..BINS).map(bin_integral).collect();
            let total: f64 = integrals.iter().sum();
            let expected: Vec<f64> = integrals.iter().map(|w| w / total * SAMPLES as f64).collect();
            let mut rng = Rng::new(2);
            let mut observed = [[0u64; BINS]; 2];
            for _ in 0..SAMPLES {
                let place = sampler.sample(rng.next_2d());
                for axis in 0..2 {
                    let bin = (f64::from(place[axis]) / radius + 1.0) * 0.5 * BINS as f64;
                    observed[axis][(bin as usize).min(BINS - 1)] += 1;
                }
            }
            for (axis, observed) in observed.iter().enumerate() {
                suite.judge(chi_square(observed, &expected), format_args!("{filter:?}, axis {axis}"));
            }
        }
    }

    #[test]
    fn filters_end_at_their_radius() {
        for filter in [Filter::Gaussian, Filter::BlackmanHarris] {
            assert!(filter.weight(filter.radius()) < 1e-4 * filter.weight(0.0), "{filter:?}");
            assert_eq!(filter.weight(1.001 * filter.radius()), 0.0);
        }
    }
}
