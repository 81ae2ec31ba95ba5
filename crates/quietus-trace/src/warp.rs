//! Mappings from the unit square to the domains that are sampled, all of them area-preserving up to a constant.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

use glam::{Vec2, Vec3};

/// Uniform in the unit disk, by Shirley and Chiu's concentric map ("A Low Distortion Map Between Disk and
/// Square", 1997): density `1 / pi`.
#[inline]
pub fn disk(u: Vec2) -> Vec2 {
    let p = 2.0 * u - Vec2::ONE;
    if p == Vec2::ZERO {
        return Vec2::ZERO;
    }
    let (radius, angle) = if p.x.abs() > p.y.abs() {
        (p.x, FRAC_PI_4 * (p.y / p.x))
    } else {
        (p.y, FRAC_PI_2 - FRAC_PI_4 * (p.x / p.y))
    };
    let (sin, cos) = angle.sin_cos();
    radius * Vec2::new(cos, sin)
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
    let (sin, cos) = (TAU * u.y).sin_cos();
    Vec3::new(radius * cos, radius * sin, 1.0 - height)
}

/// Barycentric coordinates `(b0, b1)` uniform in a triangle, by Heitz's low-distortion map ("A Low-Distortion
/// Map Between Triangle and Square", 2019); the third is `1 - b0 - b1`.
#[inline]
pub fn triangle(u: Vec2) -> Vec2 {
    if u.y > u.x { Vec2::new(0.5 * u.x, u.y - 0.5 * u.x) } else { Vec2::new(u.x - 0.5 * u.y, 0.5 * u.y) }
}

/// The direction at height `z` and angle `turn` (1 is once around).
#[inline]
fn around_z(z: f32, turn: f32) -> Vec3 {
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = (TAU * turn).sin_cos();
    Vec3::new(radius * cos, radius * sin, z)
}
