//! FLIP: the difference that is seen when two pictures are flipped back and forth on the same screen
//! (Andersson, Nilsson, Akenine-Moeller, Oskarsson, Astroem and Fairchild 2020, "FLIP: A Difference Evaluator
//! for Alternating Images", HPG). Low dynamic range: what a display shows of linear values, clamped to 0..1.

use glam::{DMat3, DVec3};

use crate::Picture;

/// Pixels per degree of the viewing angle that the paper takes as default (section 3): a 4K monitor of 0.7 m
/// width seen from 0.7 m.
pub const PIXELS_PER_DEGREE: f64 = 67.0206;

/// Exponent of the colour difference (section 4.1.3, `q_c`).
const COLOR_EXPONENT: f64 = 0.7;
/// Where the remapping of colour differences bends: at the share `p_c` of the largest one, mapped to `p_t`.
const REMAP: [f64; 2] = [0.4, 0.95];
/// Width of the feature detectors in degrees (section 4.2, `w`).
const FEATURE_WIDTH: f64 = 0.082;
/// Exponent of the feature difference (section 4.2, `q_f`).
const FEATURE_EXPONENT: f64 = 0.5;

/// Mean FLIP of two pictures in linear Rec.709: 0 where they look the same, at most 1.
///
/// # Panics
/// Where the two differ in size.
pub fn flip(picture: &Picture, reference: &Picture) -> f64 {
    let map = flip_map(picture, reference);
    map.iter().sum::<f64>() / map.len() as f64
}

/// FLIP of every pixel.
///
/// # Panics
/// Where the two differ in size.
pub fn flip_map(picture: &Picture, reference: &Picture) -> Vec<f64> {
    let sizes = [picture, reference].map(|p| [p.width, p.height]);
    assert_eq!(sizes[0], sizes[1], "FLIP compares pictures of the same size");
    let [a, b] = [picture, reference].map(opponent);
    let colors = color_differences(&a, &b);
    let features = feature_differences(&a, &b);
    // Section 4.3: features raise what colours say.
    colors.into_iter().zip(features).map(|(color, feature)| color.powf(1.0 - feature)).collect()
}

/// A plane of values, row by row.
#[derive(Clone)]
struct Plane {
    width: usize,
    values: Vec<f64>,
}

impl Plane {
    /// Convolved with a kernel along x and another along y, both of odd length; edges are repeated outwards.
    fn convolve(&self, along_x: &[f64], along_y: &[f64]) -> Self {
        let height = self.values.len() / self.width;
        let pass = |values: &[f64], kernel: &[f64], position: &dyn Fn(usize) -> (usize, usize, usize)| {
            let reach = (kernel.len() / 2) as isize;
            let at = |i: usize| {
                let (start, offset, stride) = position(i);
                let length = if stride == 1 { self.width } else { height } as isize;
                let tap = |(k, weight): (usize, &f64)| {
                    let place = (offset as isize + k as isize - reach).clamp(0, length - 1) as usize;
                    weight * values[start + place * stride]
                };
                kernel.iter().enumerate().map(tap).sum::<f64>()
            };
            (0..values.len()).map(at).collect::<Vec<f64>>()
        };
        let w = self.width;
        let rows = pass(&self.values, along_x, &|i| (i / w * w, i % w, 1));
        Self { width: w, values: pass(&rows, along_y, &|i| (i % w, i / w, w)) }
    }

    fn plus(&self, other: &Self, scales: [f64; 2]) -> Self {
        let pairs = self.values.iter().zip(&other.values);
        Self { width: self.width, values: pairs.map(|(a, b)| scales[0] * a + scales[1] * b).collect() }
    }
}

/// Linear Rec.709 with D65 to CIE XYZ: the matrix whose columns are the primaries of IEC 61966-2-1 with
/// white's luminance 1, to the digits that its chromaticities give.
fn rgb_to_xyz() -> DMat3 {
    // x, y of red, green, blue and white.
    let xyz = |x: f64, y: f64| DVec3::new(x / y, 1.0, (1.0 - x - y) / y);
    let primaries = DMat3::from_cols(xyz(0.64, 0.33), xyz(0.30, 0.60), xyz(0.15, 0.06));
    let scale = primaries.inverse() * xyz(0.3127, 0.3290);
    primaries * DMat3::from_diagonal(scale)
}

/// Luminance and two chrominances, linear in radiance (section 4.1.1): YCxCz.
fn opponent(picture: &Picture) -> [Plane; 3] {
    let to_xyz = rgb_to_xyz();
    let white = to_xyz * DVec3::ONE;
    let pixels: Vec<DVec3> = picture
        .rgb
        .iter()
        .map(|rgb| {
            let rgb = DVec3::from_array(rgb.map(|v| f64::from(v).clamp(0.0, 1.0)));
            let DVec3 { x, y, z } = to_xyz * rgb / white;
            DVec3::new(116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z))
        })
        .collect();
    [0, 1, 2].map(|c| Plane { width: picture.width as usize, values: pixels.iter().map(|p| p[c]).collect() })
}

/// From YCxCz to linear Rec.709, clamped to what a display shows.
fn to_rgb(opponent: DVec3, from_xyz: &DMat3, white: DVec3) -> DVec3 {
    let y = (opponent.x + 16.0) / 116.0;
    let xyz = DVec3::new(y + opponent.y / 500.0, y, y - opponent.z / 200.0) * white;
    (*from_xyz * xyz).clamp(DVec3::ZERO, DVec3::ONE)
}

/// CIELAB with chroma scaled by lightness, as the Hunt effect has it (section 4.1.2).
fn hunt_lab(rgb: DVec3, to_xyz: &DMat3, white: DVec3) -> DVec3 {
    const DELTA: f64 = 6.0 / 29.0;
    let root = |t: f64| {
        if t > DELTA.powi(3) { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    };
    let xyz = *to_xyz * rgb / white;
    let f = DVec3::new(root(xyz.x), root(xyz.y), root(xyz.z));
    let lightness = 116.0 * f.y - 16.0;
    DVec3::new(lightness, 0.01 * lightness * 500.0 * (f.x - f.y), 0.01 * lightness * 200.0 * (f.y - f.z))
}

/// Distance of two colours (section 4.1.3): city blocks along lightness, Euclidean in chroma.
fn hyab(a: DVec3, b: DVec3) -> f64 {
    (a.x - b.x).abs() + (a.y - b.y).hypot(a.z - b.z)
}

/// The colour pipeline (section 4.1).
fn color_differences(a: &[Plane; 3], b: &[Plane; 3]) -> Vec<f64> {
    let to_xyz = rgb_to_xyz();
    let (from_xyz, white) = (to_xyz.inverse(), to_xyz * DVec3::ONE);
    let seen = |planes: &[Plane; 3]| -> Vec<DVec3> {
        let planes = contrast_sensitivity(planes);
        let pixels = 0..planes[0].values.len();
        let rgb = |i: usize| {
            let color = DVec3::from_array([0, 1, 2].map(|c: usize| planes[c].values[i]));
            to_rgb(color, &from_xyz, white)
        };
        pixels.map(|i| hunt_lab(rgb(i), &to_xyz, white)).collect()
    };
    let (green, blue) = (hunt_lab(DVec3::Y, &to_xyz, white), hunt_lab(DVec3::Z, &to_xyz, white));
    // The largest distance of any two colours on screen.
    let largest = hyab(green, blue).powf(COLOR_EXPONENT);
    let [bend, height] = REMAP;
    let remap = |difference: f64| {
        let bend = bend * largest;
        if difference < bend {
            height / bend * difference
        } else {
            height + (difference - bend) / (largest - bend) * (1.0 - height)
        }
    };
    let pairs = seen(a).into_iter().zip(seen(b));
    pairs.map(|(a, b)| remap(hyab(a, b).powf(COLOR_EXPONENT)).clamp(0.0, 1.0)).collect()
}

/// What the eye's contrast sensitivity leaves of each channel (section 4.1.1, table 1): convolution with sums
/// of Gaussians `a sqrt(pi / b) exp(-pi^2 x^2 / b)`, x in degrees.
fn contrast_sensitivity(planes: &[Plane; 3]) -> [Plane; 3] {
    /// `[a_1, b_1, a_2, b_2]` of luminance, red-green and blue-yellow.
    const GAUSSIANS: [[f64; 4]; 3] =
        [[1.0, 0.0047, 0.0, 1e-5], [1.0, 0.0053, 0.0, 1e-5], [34.1, 0.04, 13.5, 0.025]];
    /// The widest of them; its radius of three standard deviations is used for all.
    const WIDEST: f64 = 0.04;
    let pi = std::f64::consts::PI;
    let radius = (3.0 * (WIDEST / (2.0 * pi * pi)).sqrt() * PIXELS_PER_DEGREE).ceil() as i32;
    let gaussian = |b: f64| -> Vec<f64> {
        let at = |i: i32| (-(pi * f64::from(i) / PIXELS_PER_DEGREE).powi(2) / b).exp();
        (-radius..=radius).map(at).collect()
    };
    [0, 1, 2].map(|c| {
        let [a1, b1, a2, b2] = GAUSSIANS[c];
        let kernels = [gaussian(b1), gaussian(b2)];
        // Sums over the plane, weighted as the kernels are: together they integrate to 1.
        let mass = |kernel: &[f64]| kernel.iter().sum::<f64>().powi(2);
        let weights = [a1 * (pi / b1).sqrt(), a2 * (pi / b2).sqrt()];
        let total = weights[0] * mass(&kernels[0]) + weights[1] * mass(&kernels[1]);
        let first = planes[c].convolve(&kernels[0], &kernels[0]);
        if a2 == 0.0 {
            return first.plus(&first, [weights[0] / total, 0.0]);
        }
        let second = planes[c].convolve(&kernels[1], &kernels[1]);
        first.plus(&second, weights.map(|w| w / total))
    })
}

/// The feature pipeline (section 4.2): edges and points, from first and second derivatives of a Gaussian.
fn feature_differences(a: &[Plane; 3], b: &[Plane; 3]) -> Vec<f64> {
    let deviation = 0.5 * FEATURE_WIDTH * PIXELS_PER_DEGREE;
    let radius = (3.0 * deviation).ceil() as i32;
    let taps = || (-radius..=radius).map(f64::from);
    let gaussian: Vec<f64> = taps().map(|x| (-x * x / (2.0 * deviation * deviation)).exp()).collect();
    let first = taps().zip(&gaussian).map(|(x, g)| -x * g).collect();
    let second = taps().zip(&gaussian).map(|(x, g)| (x * x / (deviation * deviation) - 1.0) * g).collect();
    let mass: f64 = gaussian.iter().sum();
    let smooth: Vec<f64> = gaussian.iter().map(|g| g / mass).collect();
    let detect = |luminance: &Plane, kernel: &[f64]| -> Vec<f64> {
        let across = luminance.convolve(kernel, &smooth);
        let down = luminance.convolve(&smooth, kernel);
        across.values.iter().zip(&down.values).map(|(x, y)| x.hypot(*y)).collect()
    };
    let luminance = |planes: &[Plane; 3]| Plane {
        width: planes[0].width,
        values: planes[0].values.iter().map(|y| (y + 16.0) / 116.0).collect(),
    };
    let (a, b) = (luminance(a), luminance(b));
    let [edges, points] = [normalized(first), normalized(second)].map(|kernel| {
        let pairs = detect(&a, &kernel).into_iter().zip(detect(&b, &kernel));
        pairs.map(|(a, b)| (a - b).abs()).collect::<Vec<f64>>()
    });
    let largest = edges.into_iter().zip(points).map(|(edge, point)| edge.max(point));
    largest.map(|d| (d / std::f64::consts::SQRT_2).powf(FEATURE_EXPONENT).clamp(0.0, 1.0)).collect()
}

/// Positive weights scaled to sum to 1, negative ones to -1.
fn normalized(mut kernel: Vec<f64>) -> Vec<f64> {
    let positive: f64 = kernel.iter().filter(|w| **w > 0.0).sum();
    let negative: f64 = -kernel.iter().filter(|w| **w < 0.0).sum::<f64>();
    kernel.iter_mut().for_each(|w| *w /= if *w > 0.0 { positive } else { negative });
    kernel
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(color: impl Fn(usize, usize) -> [f32; 3]) -> Picture {
        let mut picture = Picture::black(40, 24);
        picture.rgb.iter_mut().enumerate().for_each(|(i, pixel)| *pixel = color(i % 40, i / 40));
        picture
    }

    #[test]
    fn equal_pictures_differ_by_nothing_and_green_from_blue_by_all() {
        let a = picture(|x, y| [x as f32 / 40.0, y as f32 / 24.0, 0.5]);
        assert_eq!(flip(&a, &a), 0.0);
        let (green, blue) = (picture(|_, _| [0.0, 1.0, 0.0]), picture(|_, _| [0.0, 0.0, 1.0]));
        assert!((flip(&green, &blue) - 1.0).abs() < 1e-9);
    }

    /// The authors' own program (PyPI, flip-evaluator 1.7) on the same two pictures, as linear Rec.709:
    /// `evaluate(pic(0), pic(1), "LDR", inputsRGB=False)`.
    #[test]
    fn agrees_with_the_authors_program() {
        let pic = |k: usize| {
            picture(|x, y| {
                let red = ((7 * x + 3 * y + k * (x / 8)) % 17) as f32 / 16.0;
                let green = 0.5 + 0.5 * (0.3 * x as f64 + 0.2 * y as f64 + 0.1 * k as f64).sin();
                let blue = if x >= 20 { ((x * y + k) % 7) as f32 / 6.0 } else { 0.0 };
                [red, green as f32, blue]
            })
        };
        let map = flip_map(&pic(1), &pic(0));
        let mean = map.iter().sum::<f64>() / 960.0;
        let found = [mean, map[0], map[12 * 40 + 20], map[959]];
        let expected = [0.234_674_29, 0.264_310_96, 0.228_118_08, 0.295_754_5];
        for (found, expected) in found.into_iter().zip(expected) {
            // The authors work in f32 and round the colour matrix to seven digits: about 1e-7 of XYZ, a
            // hundred times that after the steep roots of dark colours.
            assert!((found - expected).abs() < 1e-5, "{found} {expected}");
        }
    }
}
