//! The error of a pixel: how far its mean may still be from the truth.
//!
//! Dammertz, Hanika, Keller and Lensch 2010, *A Hierarchical Automatic Stopping Condition for Monte Carlo Global
//! Illumination*: two estimates of the same pixel, made from different samples, differ by about as much as either
//! is wrong. A renderer brings its own metric and channels by implementing [`ErrorMetric`]; the library never
//! sees a colour.

/// The error of one pixel: finite, at least 0, capped at [`PixelError::MAX`], in fixed point.
///
/// Fixed point, because sums of integers are exact in any order: the picture must not depend on which thread
/// added first, and the fast rebuild of the tree must equal the plain one bit for bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PixelError(u32);

impl PixelError {
    /// Bits after the binary point: a step is 2^-20, about 1e-6.
    pub const FRACTION_BITS: u32 = 20;
    /// No error.
    pub const ZERO: Self = Self(0);
    /// The largest error, just below 4096. An infinity would poison every sum that holds it.
    pub const MAX: Self = Self(u32::MAX - 1);
    /// A pixel without a usable estimate, because its samples were rejected. It adds nothing to its region's
    /// error, so that it never keeps a region open; its area stays part of the region's, which therefore stops a
    /// little early where such pixels are many. Who reports them is the renderer, which rejected the samples.
    pub const REJECTED: Self = Self(u32::MAX);

    /// Rounds to the nearest step. Values above the cap, and infinity, become [`Self::MAX`]; negative ones 0;
    /// NaN means that there is no estimate and becomes [`Self::REJECTED`].
    pub fn from_f32(error: f32) -> Self {
        if error.is_nan() {
            return Self::REJECTED;
        }
        let steps = f64::from(error) * f64::from(1 << Self::FRACTION_BITS);
        Self((steps.round().max(0.0) as u32).min(Self::MAX.0))
    }

    /// The error as a number; `None` for a rejected pixel.
    pub fn to_f32(self) -> Option<f32> {
        (!self.is_rejected()).then(|| self.0 as f32 / (1 << Self::FRACTION_BITS) as f32)
    }

    /// Whether the pixel has no usable estimate.
    pub fn is_rejected(self) -> bool {
        self == Self::REJECTED
    }

    /// Its share in a sum of errors, in steps: 0 for a rejected pixel.
    pub fn steps(self) -> u64 {
        if self.is_rejected() { 0 } else { u64::from(self.0) }
    }

    /// The bits kept in the error plane.
    pub(crate) const fn to_bits(self) -> u32 {
        self.0
    }

    /// From bits kept in the error plane.
    pub(crate) const fn from_bits(bits: u32) -> Self {
        Self(bits)
    }
}

/// The mean of one replicate of a pixel: an estimate from samples that no other replicate uses.
#[derive(Clone, Copy, Debug)]
pub struct ReplicateMean<'a> {
    /// How many samples were accepted into it.
    pub count: u32,
    /// Its mean in each channel; what the channels are is between the renderer and its metric.
    pub channels: &'a [f32],
}

/// Turns the replicates of a pixel into its error.
///
/// [`AdaptiveSampling::pixel_error`](crate::AdaptiveSampling::pixel_error) uses the one that the policy is made for. One
/// of your own must mean the same as that, in whatever unit and from whatever channels:
///
/// - for [`Policy::Quietus`](crate::Policy::Quietus), as [`SampleNoise`]: the *variance of one sample*, which does not
///   change on average while samples come in. The policy divides by the numbers of samples itself; an error of the mean
///   in its place, such as [`DammertzMetric`], ends sampling far too early;
/// - for all others, as [`DammertzMetric`]: the *standard error of the mean*, which falls with the root of the number of
///   samples, and is compared with [`Settings::target_error`](crate::Settings::target_error).
///
/// [`mean_and_standard_error`] is what both are made of:
///
/// ```
/// use quietus::{ErrorMetric, PixelError, ReplicateMean, mean_and_standard_error};
///
/// /// Noise of linear light in one channel, for [`Policy::Quietus`](quietus::Policy::Quietus).
/// struct LinearNoise;
///
/// impl ErrorMetric for LinearNoise {
///     fn pixel_error(&self, replicates: &[ReplicateMean<'_>]) -> PixelError {
///         let samples: u32 = replicates.iter().map(|replicate| replicate.count).sum();
///         // NaN where fewer than two replicates hold samples: the pixel counts as rejected.
///         let (_, standard_error) = mean_and_standard_error(replicates, 0);
///         PixelError::from_f32((f64::from(samples) * standard_error.powi(2)) as f32)
///     }
/// }
/// # let [a, b] = [[0.2], [0.4]];
/// # let half = |channels| ReplicateMean { count: 8, channels };
/// # assert_eq!(LinearNoise.pixel_error(&[half(&a), half(&b)]), PixelError::from_f32(0.16));
/// # assert!(LinearNoise.pixel_error(&[half(&a), ReplicateMean { count: 0, channels: &b }]).is_rejected());
/// ```
pub trait ErrorMetric {
    /// The error of a pixel from its replicates, at least two of which should hold samples;
    /// [`PixelError::REJECTED`] where they do not.
    fn pixel_error(&self, replicates: &[ReplicateMean<'_>]) -> PixelError;
}

/// The metric of Dammertz et al. 2010, for every policy but [`Policy::Quietus`](crate::Policy::Quietus), from linear
/// channels R, G, B and, optionally, alpha:
///
/// ```text
/// e_p = (|I_r - A_r| + |I_g - A_g| + |I_b - A_b|) / sqrt(I_r + I_g + I_b)
/// ```
///
/// with I the mean of all samples and A that of one half. The square root stands for the display's gamma. A
/// black pixel has the difference of its alpha for its error, as published practice has it.
///
/// With halves of equal counts `|I - A|` is the one-degree-of-freedom estimate of the standard error of I. For
/// replicates of any number and any counts it is replaced by the estimate that it is a case of:
/// `sqrt(sum_r n_r (m_r - I)^2 / ((R - 1) n))`.
///
/// # Panics
/// Where a replicate with samples has fewer than three channels.
#[derive(Clone, Copy, Debug, Default)]
pub struct DammertzMetric;

impl ErrorMetric for DammertzMetric {
    fn pixel_error(&self, replicates: &[ReplicateMean<'_>]) -> PixelError {
        dammertz(replicates).map_or(PixelError::REJECTED, |error| PixelError::from_f32(error as f32))
    }
}

/// The metric of Dammertz et al. 2010 as a number; `None` where fewer than two replicates hold samples.
fn dammertz(replicates: &[ReplicateMean<'_>]) -> Option<f64> {
    if replicates.iter().filter(|r| r.count > 0).count() < 2 {
        return None;
    }
    let (mut sum, mut deviation) = (0.0, 0.0);
    for channel in 0..3 {
        let (mean, standard_error) = mean_and_standard_error(replicates, channel);
        sum += mean;
        deviation += standard_error;
    }
    if sum > 0.0 {
        return Some(deviation / sum.sqrt());
    }
    let has_alpha = replicates.iter().all(|r| r.channels.len() > 3);
    Some(if has_alpha { mean_and_standard_error(replicates, 3).1 } else { 0.0 })
}

/// Samples at which the target error has the meaning that Dammertz et al. gave to it, for policies that deal counts
/// instead of stopping at an error: in a picture of this many samples per pixel a target means about the same to all.
pub const NOMINAL_SAMPLES: f64 = 64.0;

/// What a channel's mean is raised by before the noise is set against it, in [`SampleNoise`]: keeps the noise of
/// near-black pixels finite. One part in a hundred of white is displayed as a tenth.
const DARKEST: f64 = 0.01;

/// The noise of a single sample of the pixel, as it is displayed, for [`Policy::Quietus`](crate::Policy::Quietus): from
/// linear channels R, G, B
///
/// ```text
/// v_p = n sum_c s_c^2 / (I_c + 0.01)
/// ```
///
/// with I the mean of all n samples and s its standard error, estimated from the differences between replicates.
/// `v_p / n` is about the square of the error of Dammertz et al. 2010, summed over channels in squares.
///
/// It belongs to the pixel and not to the number of its samples: neighbours that stopped at different numbers can
/// be averaged. The policy `quietus` does, and divides by a pixel's own samples afterwards.
///
/// # Panics
/// Where a replicate with samples has fewer than three channels.
#[derive(Clone, Copy, Debug, Default)]
pub struct SampleNoise;

impl ErrorMetric for SampleNoise {
    fn pixel_error(&self, replicates: &[ReplicateMean<'_>]) -> PixelError {
        if replicates.iter().filter(|r| r.count > 0).count() < 2 {
            return PixelError::REJECTED;
        }
        let samples: f64 = replicates.iter().map(|r| f64::from(r.count)).sum();
        let noise = |channel| {
            let (mean, standard_error) = mean_and_standard_error(replicates, channel);
            // Filters with negative lobes can leave a negative mean.
            standard_error.powi(2) / (mean.max(0.0) + DARKEST)
        };
        PixelError::from_f32((samples * (0..3).map(noise).sum::<f64>()) as f32)
    }
}

/// Mean of a channel over all replicates, and the standard error of that mean estimated from their differences. The mean
/// is NaN where no replicate holds samples, the standard error where fewer than two do.
///
/// # Panics
/// Where a replicate with samples lacks the channel.
pub fn mean_and_standard_error(replicates: &[ReplicateMean<'_>], channel: usize) -> (f64, f64) {
    let sampled = || replicates.iter().filter(|r| r.count > 0);
    let value = |r: &ReplicateMean<'_>| f64::from(r.channels[channel]);
    let n: f64 = sampled().map(|r| f64::from(r.count)).sum();
    let mean = sampled().map(|r| f64::from(r.count) * value(r)).sum::<f64>() / n;
    let spread: f64 = sampled().map(|r| f64::from(r.count) * (value(r) - mean).powi(2)).sum();
    let freedom = sampled().count() as f64 - 1.0;
    (mean, (spread / (freedom * n)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(halves: &[(u32, [f32; 4])]) -> PixelError {
        let replicates: Vec<_> =
            halves.iter().map(|(count, c)| ReplicateMean { count: *count, channels: c }).collect();
        DammertzMetric.pixel_error(&replicates)
    }

    #[test]
    fn equal_halves_give_the_published_formula() {
        let (a, b) = ([0.2, 0.5, 0.7, 1.0], [0.4, 0.4, 0.1, 1.0]);
        let i: Vec<f32> = a.iter().zip(b).map(|(a, b)| (a + b) / 2.0).collect();
        let expected = (0..3).map(|c| (i[c] - a[c]).abs()).sum::<f32>() / i[..3].iter().sum::<f32>().sqrt();
        assert_eq!(error(&[(8, a), (8, b)]), PixelError::from_f32(expected));
    }

    #[test]
    fn unequal_counts_estimate_the_same_standard_error() {
        // Var(B - A) = s^2 (1/n_a + 1/n_b) and SE(I)^2 = s^2 / n, so SE = |B - A| sqrt(n_a n_b) / n.
        let (a, b) = ([0.5; 4], [0.8; 4]);
        let (n_a, n_b) = (2.0f32, 3.0f32);
        let mean = (n_a * 0.5 + n_b * 0.8) / 5.0;
        let expected = 3.0 * 0.3 * (n_a * n_b).sqrt() / 5.0 / (3.0 * mean).sqrt();
        let got = error(&[(2, a), (3, b)]).to_f32().unwrap();
        assert!((got - expected).abs() <= 2.0 * f32::EPSILON + 1.0 / (1 << 20) as f32, "{got} {expected}");
    }

    #[test]
    fn noise_of_a_sample_is_its_variance_over_the_mean() {
        // Halves of 8 samples at 0.2 and 0.4: s = 0.1, n s^2 = 0.16, over 0.3 + 0.01.
        let (a, b) = ([0.2, 0.5, 0.0, 1.0], [0.4, 0.5, 0.0, 0.0]);
        let noise = |count, a: &[f32], b: &[f32]| {
            let half = |channels| ReplicateMean { count, channels };
            SampleNoise.pixel_error(&[half(a), half(b)])
        };
        assert_eq!(noise(8, &a, &b), PixelError::from_f32(0.16 / 0.31));
        // The same difference of halves from four times the samples: four times the noise of each.
        assert_eq!(noise(32, &a, &b), PixelError::from_f32(4.0 * 0.16 / 0.31));
        assert_eq!(noise(0, &a, &b), PixelError::REJECTED);
        assert_eq!(noise(8, &[0.0; 3], &[0.0; 3]), PixelError::ZERO);
        assert_eq!(noise(8, &[-0.1; 3], &[0.1; 3]), PixelError::from_f32(3.0 * 0.16 / 0.01));
        assert_eq!(noise(8, &[0.0; 3], &[1e38; 3]), PixelError::MAX);
    }

    #[test]
    fn black_pixels_are_judged_by_alpha() {
        assert_eq!(error(&[(4, [0.0; 4]), (4, [0.0; 4])]), PixelError::ZERO);
        assert_eq!(error(&[(4, [0.0, 0.0, 0.0, 0.0]), (4, [0.0, 0.0, 0.0, 1.0])]), PixelError::from_f32(0.5));
    }

    #[test]
    fn errors_are_always_finite_and_rejection_is_explicit() {
        assert_eq!(PixelError::from_f32(f32::INFINITY), PixelError::MAX);
        assert_eq!(PixelError::from_f32(1e30), PixelError::MAX);
        assert_eq!(PixelError::from_f32(-1.0), PixelError::ZERO);
        assert_eq!(PixelError::from_f32(f32::NAN), PixelError::REJECTED);
        assert_eq!(PixelError::REJECTED.steps(), 0);
        assert_eq!(PixelError::REJECTED.to_f32(), None);
        assert_eq!(error(&[(0, [0.0; 4]), (5, [1.0; 4])]), PixelError::REJECTED);
        assert_eq!(error(&[(5, [1e38; 4]), (5, [0.0; 4])]), PixelError::MAX);
    }

    /// The half-difference is an honest estimate: its mean over many pixels is sqrt(2 / pi) standard errors a
    /// channel (the mean of a half-normal), within five standard errors of that mean.
    #[test]
    fn mean_error_of_gaussian_noise_is_the_half_normal_mean() {
        let (pixels, sigma, base) = (40_000u32, 0.01f64, 0.5f64);
        let mut state = 1u64;
        let mut uniform = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            ((state >> 40) as f64 + 0.5) / (1u64 << 24) as f64
        };
        let mut normal = || (-2.0 * uniform().ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos();
        let mut sum = 0.0;
        for _ in 0..pixels {
            let half: [[f32; 4]; 2] = std::array::from_fn(|_| {
                std::array::from_fn(|_| (base + sigma * std::f64::consts::SQRT_2 * normal()) as f32)
            });
            sum += f64::from(error(&[(1, half[0]), (1, half[1])]).to_f32().unwrap());
        }
        let scale = sigma / (3.0 * base).sqrt();
        let expected = 3.0 * (2.0 / std::f64::consts::PI).sqrt() * scale;
        let standard_error =
            (3.0 * (1.0 - 2.0 / std::f64::consts::PI)).sqrt() * scale / f64::from(pixels).sqrt();
        let got = sum / f64::from(pixels);
        assert!((got - expected).abs() < 5.0 * standard_error, "{got} {expected} {standard_error}");
    }
}
