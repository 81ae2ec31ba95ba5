//! Gradient noise, and what is made of it: Perlin 2002, "Improving Noise", with the gradients that pbrt-v4 gives the
//! last four hashes, so that patterns look as they do there.

use glam::{Vec3, Vec3A};

/// Perlin's permutation of 0..256.
#[rustfmt::skip]
const PERMUTATION: [u8; 256] = [
    151, 160, 137, 91, 90, 15, 131, 13, 201, 95, 96, 53, 194, 233, 7, 225, 140, 36, 103, 30, 69, 142, 8, 99, 37, 240,
    21, 10, 23, 190, 6, 148, 247, 120, 234, 75, 0, 26, 197, 62, 94, 252, 219, 203, 117, 35, 11, 32, 57, 177, 33, 88,
    237, 149, 56, 87, 174, 20, 125, 136, 171, 168, 68, 175, 74, 165, 71, 134, 139, 48, 27, 166, 77, 146, 158, 231, 83,
    111, 229, 122, 60, 211, 133, 230, 220, 105, 92, 41, 55, 46, 245, 40, 244, 102, 143, 54, 65, 25, 63, 161, 1, 216, 80,
    73, 209, 76, 132, 187, 208, 89, 18, 169, 200, 196, 135, 130, 116, 188, 159, 86, 164, 100, 109, 198, 173, 186, 3, 64,
    52, 217, 226, 250, 124, 123, 5, 202, 38, 147, 118, 126, 255, 82, 85, 212, 207, 206, 59, 227, 47, 16, 58, 17, 182,
    189, 28, 42, 223, 183, 170, 213, 119, 248, 152, 2, 44, 154, 163, 70, 221, 153, 101, 155, 167, 43, 172, 9, 129, 22,
    39, 253, 19, 98, 108, 110, 79, 113, 224, 232, 178, 185, 112, 104, 218, 246, 97, 228, 251, 34, 242, 193, 238, 210,
    144, 12, 191, 179, 162, 241, 81, 51, 145, 235, 249, 14, 239, 107, 49, 192, 214, 31, 181, 199, 106, 157, 184, 84,
    204, 176, 115, 121, 50, 45, 127, 4, 150, 254, 138, 236, 205, 93, 222, 114, 67, 29, 24, 72, 243, 141, 128, 195, 78,
    66, 215, 61, 156, 180,
];

/// How much finer each octave is than the one before: not quite 2, so that their lattices do not meet.
const LACUNARITY: f32 = 1.99;

/// Noise at `p`, in -1..1, 0 at all points of integers.
pub(crate) fn noise(p: Vec3) -> f32 {
    let cell = p.floor();
    let d = Vec3A::from(p - cell);
    // Saturating: far from the origin there is some noise or other.
    let [x, y, z] = cell.to_array().map(|c| c as i64 as u8);
    let hash = |i: u8, last: u8| PERMUTATION[usize::from(i.wrapping_add(last))];
    let corner = |i: u8, j: u8, k: u8| {
        let first = PERMUTATION[usize::from(x.wrapping_add(i))];
        // Perlin adds before he hashes, over a table twice as long: the same, but for overflow.
        let second = hash(y.wrapping_add(j), first);
        gradient(hash(z.wrapping_add(k), second), d - Vec3A::new(f32::from(i), f32::from(j), f32::from(k)))
    };
    let weight = d * d * d * (d * (d * 6.0 - 15.0) + 10.0);
    let lerp = |t: f32, a: f32, b: f32| a + t * (b - a);
    let along = |j: u8, k: u8| lerp(weight.x, corner(0, j, k), corner(1, j, k));
    let face = |k: u8| lerp(weight.y, along(0, k), along(1, k));
    lerp(weight.z, face(0), face(1))
}

/// The product of a vector to an edge of the cube, chosen by `hash`, with `d`.
fn gradient(hash: u8, d: Vec3A) -> f32 {
    let hash = hash & 15;
    let special = hash == 12 || hash == 13;
    let u = if hash < 8 || special { d.x } else { d.y };
    let v = if hash < 4 || special { d.y } else { d.z };
    (if hash & 1 != 0 { -u } else { u }) + (if hash & 2 != 0 { -v } else { v })
}

/// How noise changes at `p`, by differences over a hundredth.
pub(crate) fn noise_gradient(p: Vec3) -> Vec3 {
    const STEP: f32 = 0.01;
    let here = noise(p);
    Vec3::new(noise(p + STEP * Vec3::X), noise(p + STEP * Vec3::Y), noise(p + STEP * Vec3::Z)) / STEP
        - Vec3::splat(here / STEP)
}

/// Sums of noise that becomes finer and, by `roughness` from one octave to the next, weaker. Octaves finer than
/// `width`, over which the pattern is looked at, fade out.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Octaves {
    pub(crate) roughness: f32,
    pub(crate) count: u32,
    pub(crate) width: f32,
}

impl Octaves {
    /// How many octaves are fine enough: whole ones, and the weight of the next.
    fn seen(self) -> (u32, f32) {
        let seen = (-1.0 - self.width.log2()).clamp(0.0, self.count as f32);
        let whole = seen.floor();
        let t = ((seen - whole - 0.3) / 0.4).clamp(0.0, 1.0);
        (whole as u32, t * t * (3.0 - 2.0 * t))
    }

    /// Fractional Brownian motion: the sum of noise.
    pub(crate) fn brownian(self, p: Vec3) -> f32 {
        let (whole, rest) = self.seen();
        let (mut sum, mut fineness, mut strength) = (0.0, 1.0, 1.0);
        for _ in 0..whole {
            sum += strength * noise(fineness * p);
            fineness *= LACUNARITY;
            strength *= self.roughness;
        }
        if rest > 0.0 { sum + rest * strength * noise(fineness * p) } else { sum }
    }

    /// Turbulence: the sum of noise without its sign. What is too fine to be seen counts by its mean.
    pub(crate) fn turbulence(self, p: Vec3) -> f32 {
        const MEAN: f32 = 0.2;
        let (whole, rest) = self.seen();
        let (mut sum, mut fineness, mut strength) = (0.0, 1.0, 1.0);
        for _ in 0..whole {
            sum += strength * noise(fineness * p).abs();
            fineness *= LACUNARITY;
            strength *= self.roughness;
        }
        if whole < self.count {
            let seen = if rest > 0.0 { noise(fineness * p).abs() } else { MEAN };
            sum += strength * (MEAN + rest * (seen - MEAN));
        }
        for _ in whole + 1..self.count {
            strength *= self.roughness;
            sum += strength * MEAN;
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Rng;

    fn points(seed: u64) -> impl Iterator<Item = Vec3> {
        let mut rng = Rng::new(seed);
        std::iter::from_fn(move || {
            Some(100.0 * (Vec3::new(rng.next_1d(), rng.next_1d(), rng.next_1d()) - 0.5))
        })
    }

    #[test]
    fn the_table_is_a_permutation() {
        let mut sorted = PERMUTATION;
        sorted.sort_unstable();
        assert!(sorted.iter().enumerate().all(|(i, &entry)| i == usize::from(entry)));
    }

    /// 0 on the lattice, within its range, smooth over the borders of cells, and repeating after 256 of them.
    #[test]
    fn noise_is_what_perlin_asks_of_it() {
        for p in points(1).take(2000) {
            assert_eq!(noise(p.floor()), 0.0);
            assert!(noise(p).abs() <= 1.0, "{p}");
            let border = Vec3::new(p.x.floor(), p.y, p.z);
            let step = Vec3::X * 1e-3;
            let (left, right) = (noise(border) - noise(border - step), noise(border + step) - noise(border));
            assert!((left - right).abs() < 1e-4, "{border}: {left} {right}");
            let far = p.floor() + Vec3::new(0.25, 0.5, 0.75);
            assert_eq!(noise(far), noise(far + 256.0));
        }
        assert!(noise(Vec3::splat(1e30)).is_finite());
    }

    #[test]
    fn gradients_are_those_of_the_noise() {
        for p in points(2).take(200) {
            let (step, gradient) = (2e-3, noise_gradient(p));
            for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
                let difference = (noise(p + step * axis) - noise(p)) / step;
                // Curvature is below 20 or so, and the steps are 0.01 and 0.002 long.
                assert!((gradient.dot(axis) - difference).abs() < 0.1, "{p}");
            }
        }
    }

    /// What is looked at from too far is even; from close by every octave counts.
    #[test]
    fn octaves_fade_out() {
        for p in points(3).take(500) {
            let octaves = |width| Octaves { roughness: 0.5, count: 6, width };
            assert_eq!(octaves(10.0).brownian(p), 0.0);
            let mean: f32 = (0..6).map(|i| 0.2 * 0.5_f32.powi(i)).sum();
            assert!((octaves(10.0).turbulence(p) - mean).abs() < 1e-5);
            let plain = |absolute: bool| -> f32 {
                let octave = |i| {
                    let noise = noise(1.99_f32.powi(i) * p);
                    0.5_f32.powi(i) * if absolute { noise.abs() } else { noise }
                };
                (0..6).map(octave).sum()
            };
            assert!((octaves(0.0).brownian(p) - plain(false)).abs() < 1e-2, "{p}");
            assert!((octaves(0.0).turbulence(p) - plain(true)).abs() < 1e-2, "{p}");
            for width in [0.02, 0.021, 0.1, 0.3] {
                let (a, b) = (octaves(width).brownian(p), octaves(width * 1.0001).brownian(p));
                assert!((a - b).abs() < 1e-3);
            }
        }
    }
}
