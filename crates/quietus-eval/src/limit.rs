//! The limit: what the best allocation of samples could gain over uniform sampling, if it knew every pixel's
//! noise and did not look at the values it keeps.
//!
//! With a squared error of `w s^2 n^-a` in a pixel of `n` samples (a = 1 for independent ones, more for
//! low-discrepancy sequences), the sum over pixels is least, at a given number of samples, for n in
//! proportion to `(w s^2)^(1 / (1 + a))` (Lagrange). Against uniform sampling the error then falls by `E =
//! mean(w s^2) / mean((w s^2)^(1 / (1 + a)))^(1 + a)`, and at equal error the samples by `L = E^(1 / a)`; for
//! a = 1 both are `mean(w s^2) / mean(sqrt(w) s)^2`.
//!
//! Samples do not cost the same everywhere. At a given sum of costs, with a cost c of each sample of a pixel, the error is
//! least for n in proportion to `(w s^2 / c)^(1 / (1 + a))`.

use serde::{Deserialize, Serialize};

use crate::{Reference, measure::Measure};

/// Side of the square of pixels that variances are pooled over. Raw variances of heavy-tailed samples are so
/// uneven by chance that they would put the limit far too high.
const POOL: i64 = 5;

/// Least exponent that the limit is stated for. Errors that fall more slowly are not the noise this model
/// speaks of: clipped ones, for instance, which more samples of a heavy tail can even raise.
const LEAST_EXPONENT: f64 = 0.5;

/// The limit L of the gain in samples at equal error, for errors that fall as `n^-exponent`; none below
/// an exponent of one half.
pub fn limit(reference: &Reference, measure: Measure, exponent: f64) -> Option<f64> {
    if exponent.is_nan() || exponent < LEAST_EXPONENT {
        return None;
    }
    let noise = pooled_noise(reference, measure);
    let n = noise.len() as f64;
    let uniform = noise.iter().sum::<f64>() / n;
    let best = noise.iter().map(|v| v.powf(1.0 / (1.0 + exponent))).sum::<f64>() / n;
    Some((uniform / best.powf(1.0 + exponent)).powf(1.0 / exponent))
}

/// Limits of the gain in rays, at equal error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RayLimits {
    /// Of the allocation that is best at equal samples: it knows every pixel's noise, but not what its samples cost.
    pub blind: f64,
    /// Of the best there is: it knows the mean rays of each pixel's samples, too.
    pub knowing: f64,
}

/// The limits of the gain in rays for errors that fall as `n^-exponent`, where a sample of a pixel takes `rays` rays;
/// none below an exponent of one half.
pub fn ray_limits(reference: &Reference, measure: Measure, exponent: f64, rays: &[f32]) -> Option<RayLimits> {
    if exponent.is_nan() || exponent < LEAST_EXPONENT {
        return None;
    }
    let noise = pooled_noise(reference, measure);
    let sum = |term: &dyn Fn(f64, f64) -> f64| -> f64 {
        noise.iter().zip(rays).map(|(&v, &c)| term(v, f64::from(c))).sum()
    };
    // Counts of (v / c^b)^(1 / (1 + a)) times any number, b = 0 or 1: what cost and error are is taken to the same power,
    // so that the number does not matter.
    let gain = |b: f64| {
        let count = |v: f64, c: f64| (v / c.powf(b)).powf(1.0 / (1.0 + exponent));
        let error = sum(&|v, c| if v > 0.0 { v * count(v, c).powf(-exponent) } else { 0.0 });
        let cost = sum(&|v, c| c * count(v, c));
        (sum(&|v, _| v) / error).powf(1.0 / exponent) * sum(&|_, c| c) / cost
    };
    Some(RayLimits { blind: gain(0.0), knowing: gain(1.0) })
}

/// `w s^2` of every pixel, summed over its channels: s^2 is the pooled variance of a sample.
fn pooled_noise(reference: &Reference, measure: Measure) -> Vec<f64> {
    let (width, height) = (i64::from(reference.mean.width), i64::from(reference.mean.height));
    let noise = |x: i64, y: i64| {
        let mut sums = [0.0; 3];
        let mut count = 0.0;
        for v in (y - POOL / 2).max(0)..=(y + POOL / 2).min(height - 1) {
            for u in (x - POOL / 2).max(0)..=(x + POOL / 2).min(width - 1) {
                let variance = reference.sample_variance[(v * width + u) as usize];
                (0..3).for_each(|c| sums[c] += f64::from(variance[c]));
                count += 1.0;
            }
        }
        let mean = reference.mean.rgb[(y * width + x) as usize];
        (0..3).map(|c| measure.weight(mean[c]) * sums[c] / count).sum()
    };
    (0..height).flat_map(|y| (0..width).map(move |x| noise(x, y))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::tests::flat;

    #[test]
    fn limits_of_known_noise() {
        let mut reference = flat(40, 10, 0.5, 0.0);
        assert!(
            (limit(&reference, Measure::Mse, 1.0).unwrap() - 1.0).abs() < 1e-12,
            "even noise: nothing to gain"
        );
        // Two halves of standard deviations 1 and 3, far larger than the pool: mean of squares 5, square of
        // the mean 4.
        let mut wide = flat(4000, 10, 0.5, 0.0);
        wide.sample_variance.iter_mut().enumerate().for_each(|(i, v)| {
            *v = [if i % 4000 < 2000 { 1.0 } else { 9.0 }; 3];
        });
        let found = limit(&wide, Measure::Mse, 1.0).unwrap();
        assert!((found - 1.25).abs() < 1e-3, "{found}");
        // a = 2: E = 5 / ((1 + 9^(1/3)) / 2)^3, L = sqrt(E).
        let expected = (5.0 / ((1.0 + 9.0_f64.cbrt()) / 2.0).powi(3)).sqrt();
        assert!((limit(&wide, Measure::Mse, 2.0).unwrap() - expected).abs() < 1e-3);
        // One pixel in 400 with all the noise is noise of its 25 neighbours.
        reference.sample_variance.fill([0.0; 3]);
        reference.sample_variance[5 * 40 + 20] = [1.0; 3];
        let found = limit(&reference, Measure::Mse, 1.0).unwrap();
        assert!((found - 16.0).abs() < 1e-9, "{found}");
        assert_eq!(limit(&reference, Measure::Mse, -0.1), None);
    }
    #[test]
    fn ray_limits_of_known_noise_and_costs() {
        // Halves of standard deviations 1 and 3 whose samples cost 1 and 4. Equal counts: 5 x 2.5 (means of squares and
        // costs). Counts of 1 and 3: errors (1 + 3) / 2, costs (1 + 12) / 2. Of 1 and 3 / 2: (1 + 6) / 2 of both.
        let mut wide = flat(4000, 10, 0.5, 0.0);
        wide.sample_variance.iter_mut().enumerate().for_each(|(i, v)| {
            *v = [if i % 4000 < 2000 { 1.0 } else { 9.0 }; 3];
        });
        let rays: Vec<f32> = (0..40_000).map(|i| if i % 4000 < 2000 { 1.0 } else { 4.0 }).collect();
        let found = ray_limits(&wide, Measure::Mse, 1.0, &rays).unwrap();
        assert!((found.blind - 12.5 / 13.0).abs() < 1e-3, "{found:?}");
        assert!((found.knowing - 12.5 / 12.25).abs() < 1e-3, "{found:?}");
        // Where all samples cost the same there is nothing to know, for any exponent.
        let even = ray_limits(&wide, Measure::Mse, 1.3, &[2.5; 40_000]).unwrap();
        let plain = limit(&wide, Measure::Mse, 1.3).unwrap();
        assert!((even.blind - plain).abs() < 1e-9 && (even.knowing - plain).abs() < 1e-9, "{even:?} {plain}");
        assert_eq!(ray_limits(&wide, Measure::Mse, 0.4, &rays), None);
    }
}
