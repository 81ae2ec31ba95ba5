//! Colours in 8 bytes: maps of the sky are larger than caches, and every path that leaves the scene asks them.

use glam::Vec3;

/// RGB, at least 0, of 16 bits each below one exponent: to 1/65,536 of the brightest channel or better. Pictures in
/// Ward's RGBE and the brightest channel of those in half floats are kept exactly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(align(8))]
pub(super) struct SharedExponent {
    mantissas: [u16; 3],
    /// Exponent bits of the `f32` that is one unit of the mantissas.
    unit: u16,
}

impl SharedExponent {
    /// The nearest to finite `rgb`.
    pub(super) fn new(rgb: Vec3) -> Self {
        let brightest = rgb.max_element();
        // 2^15 <= brightest / unit < 2^16, but for numbers that are next to nothing.
        let unit = (brightest.to_bits() >> 23).saturating_sub(15).max(1);
        // What would be rounded up to 2^16 becomes the greatest there is: casts of floats saturate.
        let mantissas = (rgb / f32::from_bits(unit << 23)).round().to_array().map(|m| m as u16);
        Self { mantissas, unit: unit as u16 }
    }

    /// The colour.
    #[inline(always)]
    pub(super) fn rgb(self) -> Vec3 {
        let [r, g, b] = self.mantissas;
        Vec3::new(f32::from(r), f32::from(g), f32::from(b)) * f32::from_bits(u32::from(self.unit) << 23)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Rng;

    #[test]
    fn colours_are_kept_to_their_brightest_channel() {
        assert_eq!(SharedExponent::new(Vec3::ZERO).rgb(), Vec3::ZERO);
        let mut rng = Rng::new(1);
        for exponent in -100..=127 {
            let scale = 2f32.powi(exponent);
            for _ in 0..100 {
                let rgb = scale * Vec3::from_array([0; 3].map(|_| rng.next_1d()));
                let off = (SharedExponent::new(rgb).rgb() - rgb).abs().max_element();
                assert!(off <= rgb.max_element() / 65_536.0, "{rgb} is off by {off}");
            }
            let rgbe = scale * (Vec3::new(255.0, 17.0, 1.0) / 256.0);
            assert_eq!(SharedExponent::new(rgbe).rgb(), rgbe);
        }
        assert!(SharedExponent::new(Vec3::splat(f32::MAX)).rgb().is_finite());
    }
}
