//! Tone curves: from linear light to what a display is sent.

use crate::png_file::srgb8;

/// How light becomes the codes of an 8-bit picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ToneCurve {
    /// Codes in proportion to light: for data, not for the eye.
    Linear,
    /// The sRGB curve (IEC 61966-2-1); what is brighter than white is clipped.
    #[default]
    Srgb,
    /// AgX (Sobotka 2022): ten stops below middle grey and six and a half above it, highlights lose their colour
    /// instead of being clipped.
    AgX,
}

impl ToneCurve {
    /// Codes of a colour in linear Rec.709. What is below 0 or not a number becomes 0.
    pub fn encode(self, rgb: [f32; 3]) -> [u8; 3] {
        match self {
            Self::Linear => rgb.map(|value| code(f64::from(value))),
            Self::Srgb => rgb.map(srgb8),
            Self::AgX => agx(rgb.map(f64::from)).map(code),
        }
    }
}

/// The nearest code to a value of 0..=1.
fn code(value: f64) -> u8 {
    // NaN becomes 0.
    (value.clamp(0.0, 1.0) * 255.0).round() as u8
}

/// Rec.709 into the narrower primaries in which AgX applies its curve.
const INSET: [[f64; 3]; 3] = [
    [0.842_479_062_253_094, 0.078_433_599_999_999_2, 0.079_223_745_147_764_3],
    [0.042_328_242_261_012_3, 0.878_468_636_469_772, 0.079_166_127_460_543_4],
    [0.042_375_654_905_705_1, 0.078_433_6, 0.879_142_973_793_104],
];
/// Stops below and above middle grey that the curve spans.
const STOPS: [f64; 2] = [10.0, 6.5];
/// Middle grey in linear light, and the value that a display is sent for it.
const GREY: [f64; 2] = [0.18, 0.5];
/// Slope of the curve at middle grey, and how sharply it bends below and above it.
const SLOPE: f64 = 2.0;
const TOE: f64 = 3.0;
const SHOULDER: f64 = 3.25;

fn agx(rgb: [f64; 3]) -> [f64; 3] {
    // NaN becomes 0, and so does what no display shows.
    let light = rgb.map(|value| value.max(0.0));
    let curved = multiply(&INSET, light).map(|value| {
        let stops = (value / GREY[0]).max(1e-10).log2();
        sigmoid(((stops + STOPS[0]) / (STOPS[0] + STOPS[1])).clamp(0.0, 1.0))
    });
    multiply(&inverse(&INSET), curved)
}

/// The curve of AgX over 0..=1: a hyperbolic sigmoid through (0, 0), middle grey and (1, 1).
fn sigmoid(x: f64) -> f64 {
    let pivot = STOPS[0] / (STOPS[0] + STOPS[1]);
    // How far the curve goes on either side of the pivot, and the limit it would tend to so that it arrives there.
    let (side, rise, power) =
        if x < pivot { (-pivot, GREY[1], TOE) } else { (1.0 - pivot, 1.0 - GREY[1], SHOULDER) };
    let reach = SLOPE * side.abs();
    let limit = (rise.powf(-power) - reach.powf(-power)).powf(-1.0 / power);
    let t = SLOPE * (x - pivot).abs() / limit;
    GREY[1] + side.signum() * limit * t / (1.0 + t.powf(power)).powf(1.0 / power)
}

fn multiply(matrix: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// By cofactors.
fn inverse(m: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let minor = |r: usize, c: usize| {
        let ([a, b], [d, e]) = ([(r + 1) % 3, (r + 2) % 3], [(c + 1) % 3, (c + 2) % 3]);
        m[a][d] * m[b][e] - m[a][e] * m[b][d]
    };
    let determinant: f64 = (0..3).map(|c| m[0][c] * minor(0, c)).sum();
    std::array::from_fn(|r| std::array::from_fn(|c| minor(c, r) / determinant))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_keep_black_grey_and_order() {
        for curve in [ToneCurve::Linear, ToneCurve::Srgb, ToneCurve::AgX] {
            assert_eq!(curve.encode([0.0; 3]), [0; 3]);
            assert_eq!(curve.encode([f32::NAN, -1.0, f32::NEG_INFINITY]), [0; 3], "{curve:?}");
            let codes: Vec<u8> = (0..4000).map(|i| curve.encode([0.005 * i as f32; 3])[1]).collect();
            assert!(codes.is_sorted(), "{curve:?}");
            let [r, g, b] = curve.encode([0.3; 3]);
            assert!(r == g && g == b, "{curve:?}: grey stays grey");
        }
        assert_eq!(ToneCurve::Linear.encode([0.5; 3]), [128; 3]);
        assert_eq!(ToneCurve::Srgb.encode([0.214, 1.0, 9.0]), [127, 255, 255]);
    }

    #[test]
    fn agx_maps_the_ends_of_its_range_and_middle_grey() {
        assert_eq!(sigmoid(STOPS[0] / (STOPS[0] + STOPS[1])), 0.5);
        assert!(sigmoid(0.0).abs() < 1e-12 && (sigmoid(1.0) - 1.0).abs() < 1e-12);
        // Half-way between two codes.
        assert!(ToneCurve::AgX.encode([0.18; 3]).iter().all(|code| (127..=128).contains(code)));
        let brightest = (0.18 * 6.5_f64.exp2()) as f32;
        assert_eq!(ToneCurve::AgX.encode([1.01 * brightest; 3]), [255; 3]);
        assert!(ToneCurve::AgX.encode([4.0; 3])[0] < 255, "sRGB clips this");
        // Bright red turns pale.
        let [r, g, b] = ToneCurve::AgX.encode([60.0, 0.0, 0.0]);
        assert!(r > 200 && g > 50 && b > 50, "{r} {g} {b}");
    }

    #[test]
    fn the_slope_at_middle_grey_is_the_same_from_both_sides() {
        let (pivot, step) = (STOPS[0] / (STOPS[0] + STOPS[1]), 1e-6);
        let below = (sigmoid(pivot) - sigmoid(pivot - step)) / step;
        let above = (sigmoid(pivot + step) - sigmoid(pivot)) / step;
        assert!((below - SLOPE).abs() < 1e-3 && (above - SLOPE).abs() < 1e-3, "{below} {above}");
    }
}
