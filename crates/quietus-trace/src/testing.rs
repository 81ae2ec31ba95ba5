//! Statistical tests for tests: p-values, and the one place where they are judged.
//!
//! A [`Suite`] states beforehand how many hypotheses it will test; together they fail a correct program with
//! probability [`SUITE_SIGNIFICANCE`] at most, whatever the seed. No tolerances are picked by hand.

use std::f64::consts::{PI, TAU};
use std::fmt::Display;

use glam::{Vec2, Vec3};
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

/// Probability that a suite fails although everything it tests is right.
pub(crate) const SUITE_SIGNIFICANCE: f64 = 1e-6;

/// Significance of each of `tests` independent tests that together have significance `all` (Sidak 1967).
pub(crate) fn sidak(all: f64, tests: usize) -> f64 {
    // 1 - (1 - all)^(1 / tests), without the cancellation.
    -((-all).ln_1p() / tests as f64).exp_m1()
}

/// A known number of hypothesis tests with a common significance.
pub(crate) struct Suite {
    significance: f64,
    left: usize,
}

impl Suite {
    /// A suite of exactly `tests` hypotheses.
    pub(crate) fn new(tests: usize) -> Self {
        Self { significance: sidak(SUITE_SIGNIFICANCE, tests), left: tests }
    }

    /// Judges one hypothesis by its p-value.
    ///
    /// # Panics
    /// If it has to be rejected (or the p-value is NaN), or if the suite is used up.
    #[track_caller]
    pub(crate) fn judge(&mut self, p: f64, what: impl Display) {
        assert!(self.left > 0, "{what}: the suite stated fewer tests than it makes");
        self.left -= 1;
        assert!(p >= self.significance, "{what}: p = {p:.3e} is below {:.3e}", self.significance);
    }
}

impl Drop for Suite {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            assert_eq!(self.left, 0, "the suite stated more tests than it made");
        }
    }
}

/// Plain random numbers for tests (SplitMix64), so that samplers under test are not judged by themselves.
#[derive(Clone, Debug)]
pub(crate) struct Rng(u64);

impl Rng {
    /// A stream of its own for each seed.
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0xd134_2543_de82_ef95))
    }

    /// 64 random bits.
    pub(crate) fn next_u64(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }

    /// Uniform in `[0, 1)`.
    pub(crate) fn next_1d(&mut self) -> f32 {
        (self.next_u64() >> 40) as f32 / 16_777_216.0
    }

    /// Uniform in `[0, 1)^2`.
    pub(crate) fn next_2d(&mut self) -> Vec2 {
        Vec2::new(self.next_1d(), self.next_1d())
    }

    /// Uniform over the unit sphere.
    pub(crate) fn next_direction(&mut self) -> Vec3 {
        let z = 1.0 - 2.0 * f64::from(self.next_1d());
        direction(z.acos(), TAU * f64::from(self.next_1d()))
    }
}

/// Running mean and variance (Welford 1962).
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Mean {
    n: f64,
    mean: f64,
    m2: f64,
}

impl Mean {
    /// Of `n` values drawn by `draw`.
    pub(crate) fn of(n: usize, mut draw: impl FnMut() -> f64) -> Self {
        let mut mean = Self::default();
        (0..n).for_each(|_| mean.push(draw()));
        mean
    }

    /// Of `n` values, given their sum and the sum of their squares.
    pub(crate) fn from_sums(n: usize, sum: f64, squares: f64) -> Self {
        let (n, mean) = (n as f64, sum / n as f64);
        Self { n, mean, m2: (squares - n * mean * mean).max(0.0) }
    }

    /// Takes in one value.
    pub(crate) fn push(&mut self, x: f64) {
        self.n += 1.0;
        let delta = x - self.mean;
        self.mean += delta / self.n;
        self.m2 += delta * (x - self.mean);
    }

    /// The mean.
    pub(crate) fn mean(&self) -> f64 {
        self.mean
    }

    /// Unbiased variance of one value.
    pub(crate) fn variance(&self) -> f64 {
        self.m2 / (self.n - 1.0)
    }

    /// Standard error of the mean; never below the rounding of an `f32`, which is what the values were before.
    pub(crate) fn standard_error(&self) -> f64 {
        (self.variance() / self.n).sqrt().max(f64::from(f32::EPSILON) * self.mean.abs())
    }

    /// p-value of "the expectation is `expected`".
    pub(crate) fn p_equals(&self, expected: f64) -> f64 {
        2.0 * normal_tail(((self.mean - expected) / self.standard_error()).abs())
    }

    /// p-value of "the expectation is `bound` or less".
    pub(crate) fn p_at_most(&self, bound: f64) -> f64 {
        normal_tail((self.mean - bound) / self.standard_error())
    }

    /// p-value of "the expectation is `bound` or more".
    pub(crate) fn p_at_least(&self, bound: f64) -> f64 {
        normal_tail((bound - self.mean) / self.standard_error())
    }

    /// A value known exactly.
    pub(crate) fn exact(mean: f64) -> Self {
        Self { n: 2.0, mean, m2: 0.0 }
    }

    /// p-value of "the expectations differ by a share of `bias` of the larger at most", for independent values.
    pub(crate) fn p_within(&self, other: &Self, bias: f64) -> f64 {
        let error = self.standard_error().hypot(other.standard_error());
        let allowed = bias * self.mean.abs().max(other.mean.abs());
        2.0 * normal_tail((((self.mean - other.mean).abs() - allowed) / error).max(0.0))
    }

    /// p-value of "both have the same expectation", for independent values.
    pub(crate) fn p_same(&self, other: &Self) -> f64 {
        let error = self.standard_error().hypot(other.standard_error());
        2.0 * normal_tail(((self.mean - other.mean) / error).abs())
    }
}

/// Probability that a standard normal variable exceeds `z`; 1 where `z` is 0/0.
pub(crate) fn normal_tail(z: f64) -> f64 {
    if z.is_nan() { 0.0 } else { Normal::standard().sf(z) }
}

/// p-value of "`observed` counts come from a distribution that expects `expected`" (Pearson 1900). Cells that
/// expect fewer than 5 are pooled, as the chi-square limit wants; a count where none is expected gives 0.
pub(crate) fn chi_square(observed: &[u64], expected: &[f64]) -> f64 {
    assert_eq!(observed.len(), expected.len());
    let (mut statistic, mut cells, mut pool) = (0.0, 0u32, (0.0, 0.0));
    let mut add = |o: f64, e: f64| {
        statistic += (o - e) * (o - e) / e;
        cells += 1;
    };
    for (&o, &e) in observed.iter().zip(expected) {
        let o = o as f64;
        // Expectations of 0 are exact: the density says "never".
        if e == 0.0 && o > 0.0 {
            return 0.0;
        }
        if e >= 5.0 { add(o, e) } else { pool = (pool.0 + o, pool.1 + e) }
    }
    if pool.1 >= 5.0 {
        add(pool.0, pool.1);
    } else if pool.0 > 0.0 {
        // Too few even together: a Poisson tail, by its Chernoff bound, guards what the limit cannot.
        let (o, e): (f64, f64) = pool;
        if o > e && (e - o + o * (o / e).ln()) > -SUITE_SIGNIFICANCE.ln() * 2.0 {
            return 0.0;
        }
    }
    assert!(cells > 1, "nothing left to compare: draw more samples");
    ChiSquared::new(f64::from(cells - 1)).expect("above 0").sf(statistic)
}

/// Unit vector at polar angle `theta` from +z and azimuth `phi`.
pub(crate) fn direction(theta: f64, phi: f64) -> Vec3 {
    let (sin, cos) = theta.sin_cos();
    Vec3::new((sin * phi.cos()) as f32, (sin * phi.sin()) as f32, cos as f32)
}

/// Rows of polar angle (an even number: the horizon is a border) and columns of azimuth of the test grid.
const GRID: (usize, usize) = (18, 32);
/// Share of its own sampling noise (a standard deviation, that of one sample at least) that a cell's expected
/// count may be off by.
const QUADRATURE_SHARE: f64 = 0.02;
/// A density is computed with some dozens of `f32` operations: its integral may exceed 1 by this rounding.
const DENSITY_ROUNDING: f64 = 64.0 * f32::EPSILON as f64;

/// Compares a sampler of directions with its density: p-value of "`sample` draws from `pdf`, and returns `None`
/// with the probability that `pdf` is short of 1". Expectations are integrals of `pdf` per cell of a grid over
/// the sphere, adaptively refined and guided by a pilot run, so that narrow lobes are not missed.
///
/// # Panics
/// If `pdf` integrates to more than 1, or a direction drawn is not of unit length.
pub(crate) fn chi_square_directions(
    seed: u64,
    samples: usize,
    mut sample: impl FnMut(&mut Rng) -> Option<Vec3>,
    pdf: impl Fn(Vec3) -> f32,
) -> f64 {
    let (rows, columns) = GRID;
    let mut rng = Rng::new(seed);
    let mut draw = || {
        let w = sample(&mut rng)?;
        assert!((w.length() - 1.0).abs() < 1e-4, "direction {w} is not of unit length");
        Some(angles(w))
    };
    let cell_of = |[theta, phi]: [f64; 2]| {
        let row = ((theta / PI * rows as f64) as usize).min(rows - 1);
        row * columns + ((phi / TAU * columns as f64) as usize).min(columns - 1)
    };
    let mut pilots = vec![Vec::new(); rows * columns];
    for angles in (0..PILOTS).filter_map(|_| draw()) {
        pilots[cell_of(angles)].push(angles);
    }
    let mut observed = vec![0u64; rows * columns + 1];
    for _ in 0..samples {
        observed[draw().map_or(rows * columns, cell_of)] += 1;
    }
    let integrand = |theta: f64, phi: f64| f64::from(pdf(direction(theta, phi))) * theta.sin();
    let mut error = DENSITY_ROUNDING;
    let mut expected: Vec<f64> = pilots
        .iter_mut()
        .enumerate()
        .map(|(i, pilots)| {
            let (row, column) = ((i / columns) as f64, (i % columns) as f64);
            let size = [PI / rows as f64, TAU / columns as f64];
            let cell = Cell { low: [row * size[0], column * size[1]], size };
            let count = (samples * pilots.len()) as f64 / PILOTS as f64;
            let tolerance = QUADRATURE_SHARE * count.max(1.0).sqrt() / samples as f64;
            samples as f64 * cell.integrate(&integrand, pilots, tolerance, &mut error, 0)
        })
        .collect();
    let lost = 1.0 - expected.iter().sum::<f64>() / samples as f64;
    assert!(lost >= -error, "the density integrates to {} (known to {error:.1e})", 1.0 - lost);
    // Of what the quadrature cannot tell, the sampler has the benefit.
    let [least, most] = [lost - error, lost + error].map(|share| (samples as f64 * share).max(0.0));
    expected.push((observed[rows * columns] as f64).clamp(least, most));
    chi_square(&observed, &expected)
}

/// Integral of a density over the whole sphere; `samples` as in [`chi_square_directions`] guide the refinement.
pub(crate) fn integrate_directions(guide: &[Vec3], pdf: impl Fn(Vec3) -> f64) -> f64 {
    let pilots: Vec<_> = guide.iter().map(|&w| angles(w)).collect();
    let integrand = |theta: f64, phi: f64| pdf(direction(theta, phi)) * theta.sin();
    // The horizon is a border.
    let (upper, lower): (Vec<_>, Vec<_>) = pilots.into_iter().partition(|p| p[0] < 0.5 * PI);
    [(0.0, upper), (0.5 * PI, lower)]
        .into_iter()
        .map(|(low, mut pilots)| {
            Cell { low: [low, 0.0], size: [0.5 * PI, TAU] }.integrate(
                &integrand,
                &mut pilots,
                1e-7,
                &mut 0.0,
                0,
            )
        })
        .sum()
}

/// Pilot samples that guide the quadrature.
const PILOTS: usize = 4096;
/// A cell with more pilots than this is split without asking.
const MAX_PILOTS: usize = 64;
/// Cells are halved this often at most: 2^-11 of a grid cell is below the width of the narrowest lobe.
const MAX_DEPTH: u32 = 11;

/// Polar angle in 0..pi, azimuth in 0..2 pi.
fn angles(w: Vec3) -> [f64; 2] {
    let w = w.as_dvec3();
    [w.x.hypot(w.y).atan2(w.z), w.y.atan2(w.x).rem_euclid(TAU)]
}

/// A rectangle of polar angle and azimuth.
#[derive(Clone, Copy)]
struct Cell {
    low: [f64; 2],
    size: [f64; 2],
}

impl Cell {
    /// Adaptive quadrature: halved along both axes until the rule and its halves agree within `tolerance`;
    /// how far they were apart is added to `error`.
    fn integrate(
        &self,
        f: &impl Fn(f64, f64) -> f64,
        pilots: &mut [[f64; 2]],
        tolerance: f64,
        error: &mut f64,
        depth: u32,
    ) -> f64 {
        let quarters = self.quarters();
        if pilots.len() <= MAX_PILOTS || depth == MAX_DEPTH {
            let coarse = self.gauss(f);
            let fine: f64 = quarters.iter().map(|q| q.gauss(f)).sum();
            // Gauss nodes keep away from the border, where the edge of a lobe may hide: corners must agree roughly.
            let hidden = (self.corners(f) - fine).abs() > 0.2 * fine + tolerance;
            if (fine - coarse).abs() <= tolerance && !hidden || depth == MAX_DEPTH {
                *error += (fine - coarse).abs();
                return fine;
            }
        }
        let middle = [self.low[0] + 0.5 * self.size[0], self.low[1] + 0.5 * self.size[1]];
        pilots.sort_unstable_by_key(|p| (p[0] >= middle[0], p[1] >= middle[1]));
        let mut rest = pilots;
        let mut sum = 0.0;
        for (i, quarter) in quarters.iter().enumerate() {
            let inside =
                |p: &[f64; 2]| usize::from(p[0] >= middle[0]) * 2 + usize::from(p[1] >= middle[1]) == i;
            let (mine, others) = rest.split_at_mut(rest.partition_point(inside));
            sum += quarter.integrate(f, mine, 0.5 * tolerance, error, depth + 1);
            rest = others;
        }
        sum
    }

    fn quarters(&self) -> [Self; 4] {
        let size = [0.5 * self.size[0], 0.5 * self.size[1]];
        [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]]
            .map(|[i, j]| Self { low: [self.low[0] + i * size[0], self.low[1] + j * size[1]], size })
    }

    /// Trapezoidal rule, its corners pulled in a little so that none lies on a border of the grid, the horizon say.
    fn corners(&self, f: &impl Fn(f64, f64) -> f64) -> f64 {
        const INSET: f64 = 1e-3;
        let at = |x: f64, y: f64| f(self.low[0] + x * self.size[0], self.low[1] + y * self.size[1]);
        let sum: f64 = [INSET, 1.0 - INSET].map(|x| at(x, INSET) + at(x, 1.0 - INSET)).iter().sum();
        0.25 * sum * self.size[0] * self.size[1]
    }

    /// Product Gauss-Legendre rule with three points per axis.
    fn gauss(&self, f: &impl Fn(f64, f64) -> f64) -> f64 {
        const NODE: f64 = 0.387_298_334_620_741_7; // sqrt(3 / 5) / 2
        const RULE: [(f64, f64); 3] = [(0.5 - NODE, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.5 + NODE, 5.0 / 18.0)];
        let mut sum = 0.0;
        for (x, wx) in RULE {
            for (y, wy) in RULE {
                sum += wx * wy * f(self.low[0] + x * self.size[0], self.low[1] + y * self.size[1]);
            }
        }
        sum * self.size[0] * self.size[1]
    }
}

/// The kit judged by itself: it must pass what is right and fail what is slightly wrong.
#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sidak_of_one_test_changes_nothing() {
        assert!((sidak(1e-6, 1) - 1e-6).abs() < 1e-18);
        let p = sidak(1e-6, 100);
        assert!((1.0 - (1.0 - p).powi(100) - 1e-6).abs() < 1e-12);
    }

    #[test]
    fn chi_square_tells_a_fair_die_from_a_loaded_one() {
        let mut rng = Rng::new(1);
        let mut counts = [0u64; 6];
        (0..600_000).for_each(|_| counts[(rng.next_1d() * 6.0) as usize] += 1);
        let mut suite = Suite::new(1);
        suite.judge(chi_square(&counts, &[100_000.0; 6]), "a fair die");
        counts[0] += 3_000;
        assert!(chi_square(&counts, &[100_500.0; 6]) < SUITE_SIGNIFICANCE);
    }

    #[test]
    fn directions_match_only_their_own_density() {
        let uniform = |rng: &mut Rng| Some(rng.next_direction());
        let mut suite = Suite::new(1);
        let p = chi_square_directions(2, 200_000, uniform, |_| (0.25 / PI) as f32);
        suite.judge(p, "uniform sphere");
        let tilted = |w: Vec3| (0.25 / PI) as f32 * (1.0 + 0.1 * w.x);
        assert!(chi_square_directions(2, 200_000, uniform, tilted) < SUITE_SIGNIFICANCE);
    }

    #[test]
    fn lost_samples_count() {
        let half = |rng: &mut Rng| Some(rng.next_direction()).filter(|w| w.z > 0.0);
        let upper = |scale: f32| move |w: Vec3| if w.z > 0.0 { scale * (0.25 / PI) as f32 } else { 0.0 };
        let mut suite = Suite::new(1);
        suite.judge(chi_square_directions(3, 200_000, half, upper(1.0)), "upper half, the rest lost");
        assert!(chi_square_directions(3, 200_000, half, upper(1.05)) < SUITE_SIGNIFICANCE);
    }

    #[test]
    #[should_panic(expected = "the density integrates to")]
    fn too_much_density_is_refused() {
        let uniform = |rng: &mut Rng| Some(rng.next_direction());
        chi_square_directions(4, 10_000, uniform, |_| (0.2501 / PI) as f32);
    }

    #[test]
    fn means_are_told_apart() {
        let mut rng = Rng::new(5);
        let mean = Mean::of(100_000, || f64::from(rng.next_1d()));
        let mut suite = Suite::new(3);
        suite.judge(mean.p_equals(0.5), "mean of uniform numbers");
        suite.judge(mean.p_at_most(0.5), "mean of uniform numbers, from above");
        suite.judge(mean.p_at_least(0.5), "mean of uniform numbers, from below");
        assert!(mean.p_at_least(0.51) < SUITE_SIGNIFICANCE);
        assert!(mean.p_equals(0.51) < SUITE_SIGNIFICANCE);
        assert!(mean.p_at_most(0.49) < SUITE_SIGNIFICANCE);
        assert!((mean.variance() - 1.0 / 12.0).abs() < 1e-3);
    }

    #[test]
    fn narrow_peaks_are_integrated() {
        // A normal distribution of width 0.001 around a direction off the grid.
        let mut rng = Rng::new(6);
        let axis = direction(1.0, 2.0);
        let guide: Vec<_> =
            (0..1000).map(|_| (axis + 0.002 * (rng.next_direction() * rng.next_1d())).normalize()).collect();
        let total = integrate_directions(&guide, |w| {
            let r2 = (w - axis).as_dvec3().length_squared();
            (-0.5 * r2 / 1e-6).exp() / (TAU * 1e-6)
        });
        // Directions are rounded to f32, 6e-8 against a width of 1e-3.
        assert!((total - 1.0).abs() < 1e-4, "{total}");
    }
}
