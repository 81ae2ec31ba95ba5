//! Where a ray meets a sphere.

use glam::Vec3;

use super::gamma;

/// Nearest distance in (t_min, t_max] at which a ray meets a sphere, in units of the direction.
///
/// The stable quadratic of Haines, Günther and Akenine-Möller 2019, "Precision Improvements for Ray/Sphere
/// Intersection" (Ray Tracing Gems, chapter 7): the discriminant from the ray's nearest point, the smaller root
/// from the product of both.
#[inline(always)]
pub fn intersect(
    origin: Vec3,
    direction: Vec3,
    t_min: f32,
    t_max: f32,
    center: Vec3,
    radius: f32,
) -> Option<f32> {
    let f = origin - center;
    let a = direction.length_squared();
    let b = -f.dot(direction);
    let nearest = f + direction * (b / a);
    let discriminant = radius * radius - nearest.length_squared();
    if !(discriminant >= 0.0) {
        return None;
    }
    let q = b + (a * discriminant).sqrt().copysign(b);
    let c = f.length_squared() - radius * radius;
    let (first, second) = (c / q, q / a);
    let (near, far) = if first <= second { (first, second) } else { (second, first) };
    let inside = |t: f32| t > t_min && t <= t_max;
    if inside(near) { Some(near) } else { inside(far).then_some(far) }
}

/// The point on the sphere next to `p`, which a ray's distance gives only roughly.
#[inline]
pub fn point(p: Vec3, center: Vec3, radius: f32) -> Vec3 {
    let from_center = p - center;
    center + from_center * (radius / from_center.length())
}

/// How far [`point`] may be off per axis, with room for the rounding of the test of the ray that starts there.
#[inline]
pub fn point_error(p: Vec3, center: Vec3, radius: f32) -> Vec3 {
    gamma(8) * (p.abs() + center.abs() + Vec3::splat(radius))
}
