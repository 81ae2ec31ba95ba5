//! The colour spaces of pbrt's `rgb`, turned into linear Rec.709.

use glam::{DMat3, DVec2, DVec3, Vec3};

/// A colour space that `ColorSpace` can name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in super::super) enum ColorSpace {
    /// Rec.709 primaries, D65.
    #[default]
    Srgb,
    /// DCI-P3 primaries, D65.
    DciP3,
    /// Rec.2020 primaries, D65.
    Rec2020,
    /// ACES AP0 primaries, about D60.
    Aces,
}

/// Chromaticity of the CIE's D65.
const D65: DVec2 = DVec2::new(0.3127, 0.3290);
/// White point of ACES (SMPTE ST 2065-1).
const ACES_WHITE: DVec2 = DVec2::new(0.32168, 0.33767);

impl ColorSpace {
    /// The names in scene files.
    pub(in super::super) const NAMES: [&'static str; 4] = ["srgb", "dci-p3", "rec2020", "aces2065-1"];

    /// By its name in scene files, in capitals or not.
    pub(in super::super) fn named(name: &str) -> Option<Self> {
        let all = [Self::Srgb, Self::DciP3, Self::Rec2020, Self::Aces];
        Self::NAMES.iter().position(|known| known.eq_ignore_ascii_case(name)).map(|index| all[index])
    }

    /// Chromaticities of red, green, blue and white (ITU-R BT.709 and BT.2020, SMPTE RP 431-2, SMPTE ST 2065-1).
    fn chromaticities(self) -> [DVec2; 4] {
        let [red, green, blue] = match self {
            Self::Srgb => [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]],
            Self::DciP3 => [[0.680, 0.320], [0.265, 0.690], [0.150, 0.060]],
            Self::Rec2020 => [[0.708, 0.292], [0.170, 0.797], [0.131, 0.046]],
            Self::Aces => [[0.7347, 0.2653], [0.0, 1.0], [0.0001, -0.0770]],
        }
        .map(DVec2::from_array);
        let white = if self == Self::Aces { ACES_WHITE } else { D65 };
        [red, green, blue, white]
    }

    /// From its RGB to CIE XYZ, white having Y = 1.
    fn to_xyz(self) -> DMat3 {
        let [red, green, blue, white] = self.chromaticities().map(xyz_of);
        let primaries = DMat3::from_cols(red, green, blue);
        primaries * DMat3::from_diagonal(primaries.inverse() * white)
    }

    /// Emitted light as linear Rec.709: white stays the white of its own space.
    pub(in super::super) fn light(self, rgb: Vec3) -> Vec3 {
        if self == Self::Srgb {
            return rgb;
        }
        rgb_from_xyz(self.to_xyz() * rgb.as_dvec3()).as_vec3().max(Vec3::ZERO)
    }

    /// A reflectance or another factor as linear Rec.709: 1 means 1 at all wavelengths and stays (1, 1, 1).
    pub(in super::super) fn factor(self, rgb: Vec3) -> Vec3 {
        if self == Self::Srgb {
            return rgb;
        }
        let of = |rgb: DVec3| rgb_from_xyz(self.to_xyz() * rgb);
        (of(rgb.as_dvec3()) / of(DVec3::ONE)).as_vec3().max(Vec3::ZERO)
    }
}

/// XYZ of a chromaticity, with Y = 1 (with X + Y + Z = 1 where that is impossible).
pub(super) fn xyz_of(xy: DVec2) -> DVec3 {
    let sum = DVec3::new(xy.x, xy.y, 1.0 - xy.x - xy.y);
    if xy.y == 0.0 { sum } else { sum / xy.y }
}

/// Linear Rec.709 of CIE XYZ; below 0 for colours outside its gamut.
pub(super) fn rgb_from_xyz(xyz: DVec3) -> DVec3 {
    ColorSpace::Srgb.to_xyz().inverse() * xyz
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whites_stay_white() {
        for name in ColorSpace::NAMES {
            let space = ColorSpace::named(name).expect("a name");
            assert!((space.factor(Vec3::ONE) - Vec3::ONE).abs().max_element() < 1e-6, "{name}");
            let luminance = space.light(Vec3::ONE).dot(Vec3::new(0.2126, 0.7152, 0.0722));
            assert!((luminance - 1.0).abs() < 1e-3, "{name}: {luminance}");
        }
        let aces = ColorSpace::Aces.light(Vec3::ONE);
        assert!(aces.x > aces.z, "the white of ACES is warmer than D65: {aces}");
    }

    #[test]
    fn rec_709_as_the_standard_prints_it() {
        let expected = [[0.4124, 0.2126, 0.0193], [0.3576, 0.7152, 0.1192], [0.1805, 0.0722, 0.9505]];
        let found = ColorSpace::Srgb.to_xyz().to_cols_array_2d();
        for (found, expected) in found.as_flattened().iter().zip(expected.as_flattened()) {
            // IEC 61966-2-1 gives four digits.
            assert!((found - expected).abs() < 1e-4, "{found} {expected}");
        }
    }

    #[test]
    fn wider_spaces_lie_outside() {
        let red = ColorSpace::Rec2020.light(Vec3::X);
        assert!(red.x > 1.0 && red.y == 0.0, "{red}");
    }
}
