//! Reconstruction filters, importance-sampled: a sample belongs to the one pixel that asked for it.
//!
//! Instead of splatting a sample into every pixel its filter reaches, each pixel draws its sample positions with
//! the filter's magnitude as their density (Ernst, Stamminger, Greiner 2006, "Filter importance sampling"), so that
//! pixels stay independent, which is what adaptive sampling asks for.
//!
//! Where the filter is nowhere negative, every sample has the weight 1. Where it is (Mitchell-Netravali, windowed
//! sinc), samples from its negative lobes are *subtracted*: they have the weight `-n`, others `n`, with
//! `n = integral |f| / integral f`, so that weights are 1 on average and a pixel's mean is an unbiased estimate of
//! the filtered picture. The price: variance grows by `n^2` (1.31 for Mitchell-Netravali, 3.35 for Lanczos), an even
//! area is noisy in the share of samples that fell into lobes (stratification makes that fall like 1 over their
//! number), and pixels beside a bright edge can be negative, as this filter wants them. Replicates weigh their own
//! samples and stay independent and unbiased: errors estimated from their differences hold all of this noise.

use glam::Vec2;
use thiserror::Error;

/// A filter, separable in x and y, centred on the pixel's centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filter {
    /// Its form.
    pub shape: FilterShape,
    /// Half width of its support in x and y, in pixels, above 0 and at most [`MAX_RADIUS`].
    pub radius: Vec2,
}

/// The form of a filter along one axis, over a distance `x` from the centre in pixels and the radius `r`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FilterShape {
    /// 1.
    Box,
    /// `r - |x|`.
    Triangle,
    /// A Gaussian, lowered to reach 0 at the radius.
    Gaussian {
        /// Its standard deviation in pixels, above 0.
        sigma: f32,
    },
    /// The 4-term Blackman-Harris window (Harris 1978, table 1), close to a Gaussian but compact.
    BlackmanHarris,
    /// The cubics of Mitchell and Netravali 1988, "Reconstruction Filters in Computer Graphics", stretched to the
    /// radius (2 is theirs). They have negative lobes.
    Mitchell {
        /// Blur.
        b: f32,
        /// Ringing.
        c: f32,
    },
    /// `sinc(x) sinc(x / tau)`. It has negative lobes.
    LanczosSinc {
        /// Pixels to the first zero of the window, above 0.
        tau: f32,
    },
}

/// Widest filter, in pixels: far beyond it, pictures are blurred better when they are finished.
pub const MAX_RADIUS: f32 = 64.0;

/// Why a filter cannot be used.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum FilterError {
    /// A radius of nothing, or of too much.
    #[error("the filter's radius is {0} x {1} pixels; expected more than 0 and at most {MAX_RADIUS}")]
    Radius(f32, f32),
    /// A parameter out of its range.
    #[error("the filter's {name} is {value}; expected {expected}")]
    Parameter {
        /// What it is called.
        name: &'static str,
        /// What it is.
        value: f32,
        /// Its range.
        expected: &'static str,
    },
    /// The negative lobes outweigh the rest.
    #[error(
        "the filter's integral along one axis is {0} of that of its magnitude; expected at least {MIN_SHARE}"
    )]
    Cancels(f32),
}

/// Least share of a filter's magnitude that may be left of it: below, weights would be far larger than the picture.
const MIN_SHARE: f32 = 0.25;

impl Filter {
    /// Constant over the pixel.
    pub const BOX: Self = Self::new(FilterShape::Box, 0.5);
    /// Of radius 2.
    pub const TRIANGLE: Self = Self::new(FilterShape::Triangle, 2.0);
    /// Standard deviation 0.5, radius 1.5.
    pub const GAUSSIAN: Self = Self::new(FilterShape::Gaussian { sigma: 0.5 }, 1.5);
    /// Radius 1.5.
    pub const BLACKMAN_HARRIS: Self = Self::new(FilterShape::BlackmanHarris, 1.5);
    /// Radius 2, B = C = 1/3: what its inventors recommend.
    pub const MITCHELL: Self = Self::new(FilterShape::Mitchell { b: 1.0 / 3.0, c: 1.0 / 3.0 }, 2.0);
    /// Radius 4, tau 3.
    pub const LANCZOS_SINC: Self = Self::new(FilterShape::LanczosSinc { tau: 3.0 }, 4.0);

    /// A filter with the same radius in x and y.
    pub const fn new(shape: FilterShape, radius: f32) -> Self {
        Self { shape, radius: Vec2::splat(radius) }
    }

    /// Finds what cannot be drawn with.
    fn check(&self) -> Result<(), FilterError> {
        let Vec2 { x, y } = self.radius;
        if ![x, y].iter().all(|r| *r > 0.0 && *r <= MAX_RADIUS) {
            return Err(FilterError::Radius(x, y));
        }
        let positive = |name, value: f32| match value > 0.0 && value.is_finite() {
            true => Ok(()),
            false => Err(FilterError::Parameter { name, value, expected: "a finite number above 0" }),
        };
        let finite = |name, value: f32| match value.is_finite() {
            true => Ok(()),
            false => Err(FilterError::Parameter { name, value, expected: "a finite number" }),
        };
        match self.shape {
            FilterShape::Gaussian { sigma } => positive("sigma", sigma),
            FilterShape::LanczosSinc { tau } => positive("tau", tau),
            FilterShape::Mitchell { b, c } => finite("B", b).and(finite("C", c)),
            FilterShape::Box | FilterShape::Triangle | FilterShape::BlackmanHarris => Ok(()),
        }
    }
}

impl Default for Filter {
    fn default() -> Self {
        Self::BLACKMAN_HARRIS
    }
}

impl FilterShape {
    /// The filter of half width `radius` at a distance `x` from the centre, not normalised.
    pub fn weight(self, x: f32, radius: f32) -> f32 {
        if x.abs() > radius {
            return 0.0;
        }
        match self {
            Self::Box => 1.0,
            Self::Triangle => radius - x.abs(),
            Self::Gaussian { sigma } => {
                let gauss = |x: f32| (-x * x / (2.0 * sigma * sigma)).exp();
                (gauss(x) - gauss(radius)).max(0.0)
            }
            Self::BlackmanHarris => {
                let t = std::f32::consts::PI * (x / radius + 1.0);
                let window =
                    0.35875 - 0.48829 * t.cos() + 0.14128 * (2.0 * t).cos() - 0.01168 * (3.0 * t).cos();
                window.max(0.0)
            }
            Self::Mitchell { b, c } => mitchell(2.0 * (x / radius).abs(), b, c),
            Self::LanczosSinc { tau } => sinc(x) * sinc(x / tau),
        }
    }
}

/// Mitchell and Netravali 1988, equation 8, for `x` of at least 0.
fn mitchell(x: f32, b: f32, c: f32) -> f32 {
    let (x2, x3) = (x * x, x * x * x);
    if x < 1.0 {
        ((12.0 - 9.0 * b - 6.0 * c) * x3 + (-18.0 + 12.0 * b + 6.0 * c) * x2 + (6.0 - 2.0 * b)) / 6.0
    } else if x < 2.0 {
        ((-b - 6.0 * c) * x3 + (6.0 * b + 30.0 * c) * x2 + (-12.0 * b - 48.0 * c) * x + (8.0 * b + 24.0 * c))
            / 6.0
    } else {
        0.0
    }
}

/// `sin(pi x) / (pi x)`.
fn sinc(x: f32) -> f32 {
    let t = std::f32::consts::PI * x;
    if t.abs() < 1e-4 { 1.0 } else { t.sin() / t }
}

/// Cells of the tabulated density over one half of the axis. Chosen so that the interpolation error (at most
/// `h^2 f'' / 8`, relative to the peak below 4e-4 for all filters of their own radius) disappears in 10^6 samples.
const CELLS: usize = 128;

/// Where in its filter a sample lies, and how much it counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterSample {
    /// Offset from the pixel's centre in pixels.
    pub offset: Vec2,
    /// What the sample is multiplied by: 1 for filters without negative lobes.
    pub weight: f32,
}

/// Draws sample positions with the magnitude of a [`Filter`] as density.
#[derive(Clone, Debug)]
pub struct FilterSampler {
    filter: Filter,
    axes: [Axis; 2],
    /// Whether weights can be negative.
    signed: bool,
}

/// The density of one half axis: tabulated, linear inside each cell, inverted exactly.
#[derive(Clone, Debug)]
struct Axis {
    radius: f32,
    /// Density at the cell borders, in units of `1 / radius`, over `|x| / radius` in 0..1.
    density: [f32; CELLS + 1],
    /// Distribution function at the cell borders, 0 to 1.
    cdf: [f32; CELLS + 1],
    /// Weight of samples in each cell: the sign of the filter in its middle, times `integral |f| / integral f`.
    weight: [f32; CELLS],
}

impl FilterSampler {
    /// Tabulates `filter`.
    ///
    /// # Errors
    /// A radius or parameter out of its range; negative lobes that outweigh the rest.
    pub fn new(filter: Filter) -> Result<Self, FilterError> {
        filter.check()?;
        let axes = [Axis::new(filter.shape, filter.radius.x)?, Axis::new(filter.shape, filter.radius.y)?];
        let signed = axes.iter().flat_map(|axis| axis.weight).any(|weight| weight != 1.0);
        Ok(Self { filter, axes, signed })
    }

    /// The filter this draws from.
    pub fn filter(&self) -> Filter {
        self.filter
    }

    /// Where a sample lies and what it counts, for `u` in `[0, 1)^2`.
    #[inline]
    pub fn sample(&self, u: Vec2) -> FilterSample {
        if self.filter.shape == FilterShape::Box {
            return FilterSample { offset: (2.0 * u - 1.0) * self.filter.radius, weight: 1.0 };
        }
        let ((x, cell_x), (y, cell_y)) = (self.axes[0].sample(u.x), self.axes[1].sample(u.y));
        let weight =
            if self.signed { self.axes[0].weight[cell_x] * self.axes[1].weight[cell_y] } else { 1.0 };
        FilterSample { offset: Vec2::new(x, y), weight }
    }
}

impl Axis {
    fn new(shape: FilterShape, radius: f32) -> Result<Self, FilterError> {
        let h = 1.0 / CELLS as f64;
        let filter = |cells: f64| f64::from(shape.weight(radius * (cells * h) as f32, radius));
        let magnitude: Vec<f64> = (0..=CELLS).map(|i| filter(i as f64).abs()).collect();
        let sign: Vec<f64> =
            (0..CELLS).map(|i| filter(i as f64 + 0.5)).map(|f| if f < 0.0 { -1.0 } else { 1.0 }).collect();
        // Integrals of what is sampled rather than of the filter, so that weights are 1 on average to the last digit.
        let mut sums = vec![0.0];
        let mut integral = 0.0;
        for (pair, sign) in magnitude.windows(2).zip(&sign) {
            let mass = 0.5 * h * (pair[0] + pair[1]);
            sums.push(sums.last().unwrap_or(&0.0) + mass);
            integral += sign * mass;
        }
        let total = sums[CELLS];
        let share = integral / total;
        // Also where a Gaussian is so wide that it is flat to the last digit, and nothing is left of it.
        if !(share >= f64::from(MIN_SHARE) && share.is_finite()) {
            return Err(FilterError::Cancels(share as f32));
        }
        Ok(Self {
            radius,
            density: std::array::from_fn(|i| (magnitude[i] / total) as f32),
            cdf: std::array::from_fn(|i| (sums[i] / total) as f32),
            weight: std::array::from_fn(|i| (sign[i] / share) as f32),
        })
    }

    /// Place on the axis, and its cell. Both halves are the same: the upper half of `u` goes right, the lower left,
    /// both monotonically.
    #[inline]
    fn sample(&self, u: f32) -> (f32, usize) {
        let centred = 2.0 * u - 1.0;
        let (x, cell) = self.invert(centred.abs());
        (x.copysign(centred) * self.radius, cell)
    }

    /// Solves `cdf(x) = u` for x in 0..1; returns its cell too.
    #[inline]
    fn invert(&self, u: f32) -> (f32, usize) {
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
        ((cell as f32 + t) / CELLS as f32, cell)
    }
}

#[cfg(test)]
mod tests;
