//! Where a ray meets a bilinear patch: Reshetov 2019, "Cool Patches: A Geometric Approach to Ray/Bilinear Patch
//! Intersections" (Ray Tracing Gems, chapter 8).
//!
//! In double precision, with a little more than the unit square: a ray that runs between two patches that share an
//! edge meets at least one of them, since their edges lie within far less of the same place.

use glam::{DVec3, Vec3};

use super::gamma;
use crate::bvh::Bounds;

/// How far patches reach over their edges, in units of their parameters. The kernel's roundings are a thousand times
/// less, unless the ray starts a million times the patch's size away.
const EDGE_SLACK: f64 = 1e-9;

/// Corners `[p(0,0), p(1,0), p(0,1), p(1,1)]`.
pub type Corners = [Vec3; 4];

/// Nearest distance in (`t_min`, `t_max`] at which a ray meets a patch, in units of the direction, and the
/// parameters there.
pub fn intersect(
    origin: Vec3,
    direction: Vec3,
    (t_min, t_max): (f32, f32),
    corners: &Corners,
) -> Option<(f32, f32, f32)> {
    let direction = direction.as_dvec3();
    let [p00, p10, p01, p11] = corners.map(|p| p.as_dvec3() - origin.as_dvec3());
    // Lines of constant u that pass the ray without distance: a u^2 + b u + c = 0.
    let a = (p10 - p00).cross(p01 - p11).dot(direction);
    let c = p00.cross(direction).dot(p01 - p00);
    let b = p10.cross(direction).dot(p11 - p10) - (a + c);
    let discriminant = b * b - 4.0 * a * c;
    if discriminant.is_nan() || discriminant < 0.0 {
        return None;
    }
    // The root that does not cancel, and the other from their product.
    let q = -0.5 * (b + discriminant.sqrt().copysign(b));
    let at = |u: f64| on_line(direction, p00.lerp(p10, u), p01.lerp(p11, u), u, (t_min, t_max));
    match (at(q / a), at(c / q)) {
        (Some(first), Some(second)) => Some(if second.0 < first.0 { second } else { first }),
        (first, second) => first.or(second),
    }
}

/// Where the ray from the origin meets the segment of constant `u`, if the segment reaches that far.
fn on_line(
    direction: DVec3,
    from: DVec3,
    to: DVec3,
    u: f64,
    (t_min, t_max): (f32, f32),
) -> Option<(f32, f32, f32)> {
    const RANGE: std::ops::RangeInclusive<f64> = -EDGE_SLACK..=1.0 + EDGE_SLACK;
    if !RANGE.contains(&u) {
        return None;
    }
    let along = to - from;
    let perpendicular = direction.cross(along);
    let square = perpendicular.length_squared();
    let v = from.cross(direction).dot(perpendicular) / square;
    let t = from.cross(along).dot(perpendicular) / square;
    // Before it is rounded: what lies just behind the end of a ray is not in its way.
    let met = RANGE.contains(&v) && t > f64::from(t_min) && t <= f64::from(t_max) && t as f32 > t_min;
    met.then_some((t as f32, u.clamp(0.0, 1.0) as f32, v.clamp(0.0, 1.0) as f32))
}

/// Vertex data at the parameters `u`, `v`.
#[inline]
pub fn blend<T>(corners: [T; 4], u: f32, v: f32) -> T
where
    T: Copy + std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>,
{
    let [p00, p10, p01, p11] = corners;
    (p00 * (1.0 - u) + p10 * u) * (1.0 - v) + (p01 * (1.0 - u) + p11 * u) * v
}

/// How far [`blend`] of the corners may be off per axis. Rays that leave the patch and rays that end on it are rounded
/// along all axes, as far as it extends, even where it lies at 0 along one.
pub fn point_error(corners: &Corners) -> Vec3 {
    let [p00, p10, p01, p11] = corners.map(Vec3::abs);
    let Bounds { min, max } = bounds(corners);
    // "Physically Based Rendering", 4th edition, section 6.8.5: gamma(6), and as much for the corners' own roundings.
    gamma(12) * p00.max(p10).max(p01.max(p11)) + gamma(8) * (max - min).max_element()
}

/// Derivatives of the position by u and v.
#[inline]
pub fn derivatives(corners: &Corners, u: f32, v: f32) -> [Vec3; 2] {
    let [p00, p10, p01, p11] = *corners;
    [(p10 - p00) * (1.0 - v) + (p11 - p01) * v, (p01 - p00) * (1.0 - u) + (p11 - p10) * u]
}

/// The geometric normal, of unit length; 0 where the patch is flattened to a line.
#[inline]
pub fn normal(corners: &Corners, u: f32, v: f32) -> Vec3 {
    let [along_u, along_v] = derivatives(corners, u, v);
    let normal = along_u.cross(along_v);
    if normal.length_squared() > 0.0 {
        return normal.normalize_or_zero();
    }
    // A corner where two edges are one, as at a triangle's tip: the middle has a normal.
    let [along_u, along_v] = derivatives(corners, 0.5, 0.5);
    along_u.cross(along_v).normalize_or_zero()
}

/// Bounds; a patch lies within the hull of its corners.
pub fn bounds(corners: &Corners) -> Bounds {
    let [a, b, c, d] = *corners;
    if (a + b + c + d).is_nan() {
        return Bounds::EMPTY;
    }
    Bounds { min: a.min(b).min(c.min(d)), max: a.max(b).max(c.max(d)) }
}

#[cfg(test)]
mod tests;
