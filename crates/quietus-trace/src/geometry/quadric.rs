//! Where a ray meets a part of a sphere, a disk or a cylinder around the z axis.
//!
//! In double precision: what the ray's and the surface's f32 numbers say is met where they say it, to far less than
//! an f32 rounding, and the point that an interaction speaks of is brought back to the surface. So a ray that starts
//! off the surface by as much as that point's error bound does not find it again.

use std::f64::consts::TAU;

use glam::{DVec3, Vec2, Vec3};

use super::gamma;
use crate::bvh::Bounds;
use crate::desc::Quadric;

/// Nearest distance in (`t_min`, `t_max`] at which a ray meets a quadric, in units of the direction.
pub fn intersect(
    origin: Vec3,
    direction: Vec3,
    (t_min, t_max): (f32, f32),
    quadric: &Quadric,
) -> Option<f32> {
    let (o, d) = (origin.as_dvec3(), direction.as_dvec3());
    let flat = DVec3::new(1.0, 1.0, 0.0);
    let roots = match *quadric {
        Quadric::Disk { height, .. } => [(f64::from(height) - o.z) / d.z, f64::NAN],
        Quadric::PartialSphere { radius, .. } => roots(o, d, radius.into())?,
        Quadric::Cylinder { radius, .. } => roots(o * flat, d * flat, radius.into())?,
    };
    roots.into_iter().find_map(|t| {
        let single = t as f32;
        let inside = single > t_min && single <= t_max && has(quadric, o + t * d);
        inside.then_some(single)
    })
}

/// Both distances, in order, at which a line is `radius` away from 0: the stable form of [`super::sphere`].
fn roots(f: DVec3, d: DVec3, radius: f64) -> Option<[f64; 2]> {
    let a = d.length_squared();
    let b = -f.dot(d);
    let nearest = f + d * (b / a);
    let discriminant = radius * radius - nearest.length_squared();
    // NaN: no direction across.
    if discriminant.is_nan() || discriminant < 0.0 {
        return None;
    }
    let q = b + (a * discriminant).sqrt().copysign(b);
    let (first, second) = ((f.length_squared() - radius * radius) / q, q / a);
    Some(if first < second { [first, second] } else { [second, first] })
}

/// Whether a point of the whole surface belongs to the part.
fn has(quadric: &Quadric, p: DVec3) -> bool {
    let phi_max = match *quadric {
        Quadric::PartialSphere { radius, z_min, z_max, phi_max } => {
            // The poles' own roundings must not open them.
            if z_min > -radius && p.z < z_min.into() || z_max < radius && p.z > z_max.into() {
                return false;
            }
            phi_max
        }
        Quadric::Disk { radius, inner_radius, phi_max, .. } => {
            let r2 = p.x * p.x + p.y * p.y;
            let [outer, inner] = [radius, inner_radius].map(f64::from);
            if !(r2 <= outer * outer && r2 >= inner * inner) {
                return false;
            }
            phi_max
        }
        Quadric::Cylinder { z_min, z_max, phi_max, .. } => {
            if !(p.z >= z_min.into() && p.z <= z_max.into()) {
                return false;
            }
            phi_max
        }
    };
    is_whole(phi_max) || angle(p) <= phi_max.into()
}

/// Whether a swept angle is all of the circle, as near as f32 can say it.
fn is_whole(phi_max: f32) -> bool {
    phi_max >= std::f32::consts::TAU * (1.0 - 2.0 * f32::EPSILON)
}

/// Angle around the z axis in `0..=2 pi`.
fn angle(p: DVec3) -> f64 {
    let phi = p.y.atan2(p.x);
    if phi < 0.0 { phi + TAU } else { phi }
}

/// Bounds of a quadric.
pub fn bounds(quadric: &Quadric) -> Bounds {
    let (radius, z) = match *quadric {
        Quadric::PartialSphere { radius, z_min, z_max, .. } => (radius, [z_min, z_max]),
        Quadric::Disk { height, radius, .. } => (radius, [height, height]),
        Quadric::Cylinder { radius, z_min, z_max, .. } => (radius, [z_min, z_max]),
    };
    // The angle's and the heights' roundings are far below a float's.
    let reach = radius.next_up();
    Bounds { min: Vec3::new(-reach, -reach, z[0].next_down()), max: Vec3::new(reach, reach, z[1].next_up()) }
}

/// A point on a quadric.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// Where.
    pub position: Vec3,
    /// Bound on how far that may be off, per axis, with room for the test of the ray that starts there.
    pub error: Vec3,
    /// The geometric normal, of unit length.
    pub normal: Vec3,
    /// Derivative of the position by u.
    pub along_u: Vec3,
    /// Texture coordinates.
    pub uv: Vec2,
}

/// The point on a quadric next to `p`, which a ray's distance gives only roughly.
pub fn point(quadric: &Quadric, p: Vec3) -> Point {
    let p = p.as_dvec3();
    let across = p.x.hypot(p.y);
    let (position, normal, v) = match *quadric {
        Quadric::PartialSphere { radius, z_min, z_max, .. } => {
            let position = p * (f64::from(radius) / p.length());
            let polar = |z: f64| (z / f64::from(radius)).clamp(-1.0, 1.0).acos();
            let [low, high] = [polar(z_min.into()), polar(z_max.into())];
            (position, position / f64::from(radius), (polar(position.z) - low) / (high - low))
        }
        Quadric::Disk { height, radius, inner_radius, .. } => {
            let [outer, inner] = [radius, inner_radius].map(f64::from);
            (p.with_z(height.into()), DVec3::Z, (outer - across) / (outer - inner))
        }
        Quadric::Cylinder { radius, z_min, z_max, .. } => {
            let [low, high] = [z_min, z_max].map(f64::from);
            let normal = DVec3::new(p.x / across, p.y / across, 0.0);
            ((normal * f64::from(radius)).with_z(p.z), normal, (p.z - low) / (high - low))
        }
    };
    let phi_max = f64::from(phi_max(quadric));
    let along_u = phi_max * DVec3::new(-position.y, position.x, 0.0);
    let position = position.as_vec3();
    Point {
        position,
        error: gamma(8) * (position.abs() + Vec3::splat(radius(quadric))),
        normal: normal.as_vec3().normalize_or(Vec3::Z),
        along_u: along_u.as_vec3(),
        uv: Vec2::new((angle(p) / phi_max).clamp(0.0, 1.0) as f32, v.clamp(0.0, 1.0) as f32),
    }
}

fn phi_max(quadric: &Quadric) -> f32 {
    match *quadric {
        Quadric::PartialSphere { phi_max, .. }
        | Quadric::Disk { phi_max, .. }
        | Quadric::Cylinder { phi_max, .. } => phi_max,
    }
}

fn radius(quadric: &Quadric) -> f32 {
    match *quadric {
        Quadric::PartialSphere { radius, .. }
        | Quadric::Disk { radius, .. }
        | Quadric::Cylinder { radius, .. } => radius,
    }
}

#[cfg(test)]
mod tests;
