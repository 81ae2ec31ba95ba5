//! The watertight ray-triangle test of Woop, Benthin and Wald 2013, "Watertight Ray/Triangle Intersection".
//!
//! Vertices are moved and sheared into a space where the ray starts at 0 and runs along +z; each vertex is
//! rounded there once, whichever triangle it belongs to, so two triangles see their shared edge in the same
//! place. The edge functions are differences of two rounded products. Rounding is monotonic, so their sign is
//! never wrong, only 0 where the truth is not; 0 counts as inside, hence a ray may meet both triangles at an
//! edge but never slips between them. (The paper resolves zeros in double precision; being generous to both
//! sides is as tight against leaks.) A fused multiply-add in an edge function would break this.

use glam::Vec3;

use super::gamma;

/// A ray made ready for the triangle test: see the module.
#[derive(Clone, Copy, Debug)]
pub struct Sheared {
    /// Axes, the last the one along which the direction is longest.
    pub axes: [usize; 3],
    /// Factors of the shear in x and y, and of the scale in z.
    pub shear: Vec3,
}

impl Sheared {
    /// For a direction that is finite and not 0.
    #[inline(always)]
    pub fn new(direction: Vec3) -> Self {
        let d = direction.abs();
        let z = if d.x > d.y && d.x > d.z {
            0
        } else if d.y > d.z {
            1
        } else {
            2
        };
        let x = if z == 2 { 0 } else { z + 1 };
        let y = if x == 2 { 0 } else { x + 1 };
        let scale = 1.0 / direction[z];
        Self { axes: [x, y, z], shear: Vec3::new(direction[x] * scale, direction[y] * scale, scale) }
    }
}

/// Distance in units of the direction, and the barycentric coordinates of the second and third vertex.
#[inline]
pub fn intersect(origin: Vec3, ray: &Sheared, vertices: [Vec3; 3]) -> Option<(f32, f32, f32)> {
    let [kx, ky, kz] = ray.axes;
    let [a, b, c] = vertices.map(|v| {
        let p = v - origin;
        Vec3::new(p[kx] - ray.shear.x * p[kz], p[ky] - ray.shear.y * p[kz], ray.shear.z * p[kz])
    });
    let u = c.x * b.y - c.y * b.x;
    let v = a.x * c.y - a.y * c.x;
    let w = b.x * a.y - b.y * a.x;
    let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    let det = u + v + w;
    if !inside || det == 0.0 {
        return None;
    }
    let t = (u * a.z + v * b.z + w * c.z) / det;
    Some((t, v / det, w / det))
}

/// The point with barycentric coordinates `u` of the second and `v` of the third vertex.
#[inline]
pub fn point(vertices: [Vec3; 3], u: f32, v: f32) -> Vec3 {
    (1.0 - u - v) * vertices[0] + u * vertices[1] + v * vertices[2]
}

/// How far [`point`] may be off per axis, with room for the rounding of the test of the ray that starts there.
///
/// The first part is "Physically Based Rendering", 4th edition, section 6.8.5, with its `gamma(7)`; the
/// second bounds what the next ray's own test against this triangle makes of its height above the plane: a
/// handful of roundings of differences no longer than the triangle's extent.
#[inline]
pub fn point_error(vertices: [Vec3; 3], u: f32, v: f32) -> Vec3 {
    let [a, b, c] = vertices;
    let sum = ((1.0 - u - v) * a).abs() + (u * b).abs() + (v * c).abs();
    let extent = a.max(b).max(c) - a.min(b).min(c);
    gamma(7) * sum + gamma(8) * extent.max_element()
}
