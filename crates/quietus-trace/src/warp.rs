//! Mappings from the unit square to the domains that are sampled, all of them area-preserving up to a constant.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};

use glam::{Vec2, Vec3};

/// Uniform in the unit disk, by Shirley and Chiu's concentric map ("A Low Distortion Map Between Disk and
/// Square", 1997): density `1 / pi`.
#[inline]
pub fn disk(u: Vec2) -> Vec2 {
    let p = 2.0 * u - Vec2::ONE;
    if p == Vec2::ZERO {
        return Vec2::ZERO;
    }
    if p.x.abs() > p.y.abs() {
        let (sin, cos) = sin_cos_octant(FRAC_PI_4 * (p.y / p.x));
        p.x * Vec2::new(cos, sin)
    } else {
        let (sin, cos) = sin_cos_octant(FRAC_PI_4 * (p.x / p.y));
        p.y * Vec2::new(sin, cos)
    }
}

/// Directions around +z in proportion to their cosine: density `z / pi` per steradian (Malley's method).
#[inline]
pub fn cosine_hemisphere(u: Vec2) -> Vec3 {
    let d = disk(u);
    d.extend((1.0 - d.length_squared()).max(0.0).sqrt())
}

/// Uniform over the directions with `z >= 0`: density `1 / 2 pi` per steradian.
#[inline]
pub fn uniform_hemisphere(u: Vec2) -> Vec3 {
    around_z(1.0 - u.x, u.y)
}

/// Uniform over all directions: density `1 / 4 pi` per steradian.
#[inline]
pub fn uniform_sphere(u: Vec2) -> Vec3 {
    around_z(1.0 - 2.0 * u.x, u.y)
}

/// Uniform over the directions within an angle of +z, which is given by `1 - cos`: unlike the cosine this keeps
/// its digits for small cones. Density `1 / (2 pi one_minus_cos)` per steradian.
#[inline]
pub fn uniform_cone(u: Vec2, one_minus_cos: f32) -> Vec3 {
    let height = u.x * one_minus_cos;
    let radius = (height * (2.0 - height)).max(0.0).sqrt();
    let (sin, cos) = sin_cos_turns(u.y);
    Vec3::new(radius * cos, radius * sin, 1.0 - height)
}

/// Barycentric coordinates `(b0, b1)` uniform in a triangle, by Heitz's low-distortion map ("A Low-Distortion
/// Map Between Triangle and Square", 2019); the third is `1 - b0 - b1`.
#[inline]
pub fn triangle(u: Vec2) -> Vec2 {
    if u.y > u.x { Vec2::new(0.5 * u.x, u.y - 0.5 * u.x) } else { Vec2::new(u.x - 0.5 * u.y, 0.5 * u.y) }
}

/// Sine and cosine of `turns >= 0` full turns: to about 1e-7 over the first turn, at a fraction of the cost of the
/// standard library's, which also has to serve huge angles.
#[inline]
pub(crate) fn sin_cos_turns(turns: f32) -> (f32, f32) {
    let quarters = 4.0 * turns;
    let nearest = (quarters + 0.5) as i32;
    let (sin, cos) = sin_cos_octant(FRAC_PI_2 * (quarters - nearest as f32));
    let (s, c) = if nearest & 1 == 0 { (sin, cos) } else { (cos, sin) };
    // Sines are negative in the third and fourth quarter, cosines in the second and third.
    (if nearest & 2 == 0 { s } else { -s }, if (nearest + 1) & 2 == 0 { c } else { -c })
}

/// Sine and cosine for angles in -pi/4..pi/4: Taylor's series until its remainder is below an `f32`'s rounding.
#[inline]
fn sin_cos_octant(x: f32) -> (f32, f32) {
    let x2 = x * x;
    let sin = x
        * (1.0
            - x2 * (1.0 / 6.0)
                * (1.0 - x2 * (1.0 / 20.0) * (1.0 - x2 * (1.0 / 42.0) * (1.0 - x2 * (1.0 / 72.0)))));
    let cos = 1.0
        - x2 * (1.0 / 2.0)
            * (1.0 - x2 * (1.0 / 12.0) * (1.0 - x2 * (1.0 / 30.0) * (1.0 - x2 * (1.0 / 56.0))));
    (sin, cos)
}

/// The direction at height `z` and angle `turn` (1 is once around).
#[inline]
fn around_z(z: f32, turn: f32) -> Vec3 {
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = sin_cos_turns(turn);
    Vec3::new(radius * cos, radius * sin, z)
}

#[cfg(test)]
mod tests {
    use std::f32::consts::{FRAC_1_PI, TAU};

    use super::*;
    use crate::testing::{Rng, Suite, chi_square, chi_square_directions};

    #[test]
    fn directions_follow_their_densities() {
        let mut suite = Suite::new(6);
        let mut judge = |name: &str, map: &dyn Fn(Vec2) -> Vec3, pdf: &dyn Fn(Vec3) -> f32| {
            let p = chi_square_directions(1, 500_000, |rng: &mut Rng| Some(map(rng.next_2d())), pdf);
            suite.judge(p, name);
        };
        let upper = |w: Vec3, pdf: f32| if w.z >= 0.0 { pdf } else { 0.0 };
        judge("cosine", &cosine_hemisphere, &|w| w.z.max(0.0) * FRAC_1_PI);
        judge("hemisphere", &uniform_hemisphere, &|w| upper(w, 0.5 * FRAC_1_PI));
        judge("sphere", &uniform_sphere, &|_| 0.25 * FRAC_1_PI);
        for one_minus_cos in [0.01, 0.4, 1.7] {
            let pdf = |w: Vec3| {
                if 1.0 - w.z <= one_minus_cos { 0.5 * FRAC_1_PI / one_minus_cos } else { 0.0 }
            };
            judge("cone", &|u| uniform_cone(u, one_minus_cos), &pdf);
        }
    }

    #[test]
    fn turns_are_as_exact_as_numbers_allow() {
        for i in 0..=100_000 {
            let turns = i as f32 / 100_000.0;
            let (sin, cos) = sin_cos_turns(turns);
            let (true_sin, true_cos) = (std::f64::consts::TAU * f64::from(turns)).sin_cos();
            // The octant's angle and the series round a few times each.
            let error = (f64::from(sin) - true_sin).abs().max((f64::from(cos) - true_cos).abs());
            assert!(error < 2.0 * f64::from(f32::EPSILON), "{turns}: {error}");
        }
    }

    /// A cone of a microradian: its directions stay apart where `1 - cos` alone could not tell them.
    #[test]
    fn narrow_cones_keep_their_digits() {
        let one_minus_cos = 0.5e-12;
        let w = uniform_cone(Vec2::new(0.25, 0.0), one_minus_cos);
        assert!((w.x / 0.5e-6 - 1.0).abs() < 1e-5, "{w}");
    }

    #[test]
    fn disk_and_triangle_are_uniform() {
        let mut rng = Rng::new(2);
        let mut suite = Suite::new(2);
        let mut by_ring = vec![0u64; 20 * 16];
        let mut by_cell = vec![0u64; 400];
        for _ in 0..200_000 {
            let d = disk(rng.next_2d());
            let turn = (d.y.atan2(d.x) / TAU).rem_euclid(1.0);
            by_ring[(d.length_squared() * 20.0) as usize * 16 + ((turn * 16.0) as usize).min(15)] += 1;
            // The square root unfolds the triangle into a square: 1 - b0 = sqrt(u), b1 = v sqrt(u).
            let b = triangle(rng.next_2d());
            let s = 1.0 - b.x;
            let (row, column) = (s * s * 20.0, b.y / s * 20.0);
            by_cell[(row as usize).min(19) * 20 + (column as usize).min(19)] += 1;
        }
        suite.judge(chi_square(&by_ring, &[200_000.0 / 320.0; 320]), "disk");
        suite.judge(chi_square(&by_cell, &[500.0; 400]), "triangle");
    }

    #[test]
    fn corners_of_the_square_stay_inside() {
        let last = 1.0 - f32::EPSILON / 2.0;
        for u in [Vec2::ZERO, Vec2::splat(last), Vec2::new(0.0, last), Vec2::new(last, 0.0), Vec2::splat(0.5)]
        {
            assert!(disk(u).length() <= 1.0 + f32::EPSILON, "{u}");
            let b = triangle(u);
            assert!(b.min_element() >= 0.0 && b.x + b.y <= 1.0, "{u}");
            for w in [cosine_hemisphere(u), uniform_hemisphere(u), uniform_sphere(u), uniform_cone(u, 2.0)] {
                assert!((w.length() - 1.0).abs() < 4.0 * f32::EPSILON, "{u}: {w}");
            }
        }
        assert!(uniform_hemisphere(Vec2::splat(last)).z > 0.0);
    }
}
