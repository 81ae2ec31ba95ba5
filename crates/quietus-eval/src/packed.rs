//! One sample in eight bytes: three 21-bit floats and a bit of alpha.
//!
//! A 21-bit float is an `f32` without its sign (radiance is never negative) and without its 10 lowest bits,
//! rounded to nearest, ties to even: the full range of `f32` at a relative error of at most 2^-14.

use glam::Vec3;

/// A sample that the film would have rejected: not finite, or beyond reason.
pub(crate) const REJECTED: u64 = u64::MAX;

/// Largest radiance that is kept; the film has the same limit.
pub(crate) const MAX_RADIANCE: f32 = 1e28;

const CHANNEL_BITS: u32 = 21;
const DROPPED_BITS: u32 = 10;
const CHANNEL_MASK: u64 = (1 << CHANNEL_BITS) - 1;

/// A sample with a negative channel, which no path tracer may produce.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Negative(pub Vec3);

/// Packs radiance and alpha (0 or 1). What is not finite or above [`MAX_RADIANCE`] becomes [`REJECTED`].
pub(crate) fn pack(radiance: Vec3, alpha: f32) -> Result<u64, Negative> {
    let channels = radiance.to_array();
    // Written so that NaN fails too.
    if !channels.iter().all(|v| v.abs() <= MAX_RADIANCE) {
        return Ok(REJECTED);
    }
    if channels.iter().any(|&v| v < 0.0) {
        return Err(Negative(radiance));
    }
    let word = u64::from(alpha > 0.5) << 63;
    Ok((0..3).fold(word, |word, i| word | u64::from(round(channels[i])) << (CHANNEL_BITS * i as u32)))
}

/// The 21 high bits after the sign, rounded.
fn round(value: f32) -> u32 {
    let bits = value.abs().to_bits(); // abs: -0 is 0
    let tie = (1 << (DROPPED_BITS - 1)) - 1 + ((bits >> DROPPED_BITS) & 1);
    (bits + tie) >> DROPPED_BITS
}

/// Red, green, blue and alpha of a word that is not [`REJECTED`].
#[inline]
pub(crate) fn unpack(word: u64) -> [f32; 4] {
    let channel =
        |i: u32| f32::from_bits((((word >> (CHANNEL_BITS * i)) & CHANNEL_MASK) as u32) << DROPPED_BITS);
    [channel(0), channel(1), channel(2), (word >> 63) as f32]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_come_back_within_half_a_step() {
        for v in [0.0, -0.0, 1.0, 0.1, 1e-30, 420.0, 65_504.0, 3.0e7, 1e28, 0.999_999_9] {
            let word = pack(Vec3::new(v, 0.5 * v, 2.0), 1.0).unwrap();
            let [r, g, b, a] = unpack(word);
            assert!((r - v).abs() <= v.abs() * f32::powi(0.5, 14), "{v} {r}");
            assert!((g - 0.5 * v).abs() <= v.abs() * f32::powi(0.5, 15), "{v} {g}");
            assert_eq!([b, a], [2.0, 1.0]);
        }
    }

    #[test]
    fn ties_go_to_even_so_that_rounding_has_no_bias() {
        let step = f32::powi(0.5, 13);
        assert_eq!(unpack(pack(Vec3::splat(1.0 + 0.5 * step), 0.0).unwrap())[0], 1.0);
        assert_eq!(unpack(pack(Vec3::splat(1.0 + 1.5 * step), 0.0).unwrap())[0], 1.0 + 2.0 * step);
    }

    #[test]
    fn what_the_film_rejects_is_marked_and_negative_light_is_an_error() {
        for v in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 2e28] {
            assert_eq!(pack(Vec3::new(1.0, v, 1.0), 1.0), Ok(REJECTED));
        }
        assert!(pack(Vec3::new(0.0, -1e-9, 0.0), 1.0).is_err());
        assert_ne!(pack(Vec3::splat(1e28), 1.0), Ok(REJECTED));
    }
}
