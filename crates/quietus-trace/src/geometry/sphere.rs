//! Where a ray meets a sphere.

use glam::Vec3;

use super::{BLOCK, Candidates, gamma};
use crate::isa::{Isa, Lanes};

/// Nearest distance in (`t_min`, `t_max`] at which a ray meets a sphere, in units of the direction.
///
/// The stable quadratic of Haines, Günther and Akenine-Möller 2019, "Precision Improvements for Ray/Sphere
/// Intersection" (Ray Tracing Gems, chapter 7): the discriminant from the line's nearest point, one root from
/// the product of both. The plain form of [`SphereBlock::intersect`], operation by operation.
pub fn intersect(
    origin: Vec3,
    direction: Vec3,
    (t_min, t_max): (f32, f32),
    center: Vec3,
    radius: f32,
) -> Option<f32> {
    let f = origin - center;
    let d = direction;
    let a = d.x * d.x + d.y * d.y + d.z * d.z;
    let b = -(f.x * d.x + f.y * d.y + f.z * d.z);
    let along = b / a;
    let [x, y, z] = [f.x + d.x * along, f.y + d.y * along, f.z + d.z * along];
    let discriminant = radius * radius - (x * x + y * y + z * z);
    let root = (a * discriminant.max(0.0)).sqrt();
    let c = f.x * f.x + f.y * f.y + f.z * f.z - radius * radius;
    let q = b + if b < 0.0 { -root } else { root };
    let (first, second) = (c / q, q / a);
    let (near, far) = if first < second { (first, second) } else { (second, first) };
    let inside = |t: f32| discriminant >= 0.0 && t > t_min && t <= t_max;
    if inside(near) { Some(near) } else { inside(far).then_some(far) }
}

/// Up to 8 spheres.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct SphereBlock {
    center: [Lanes; 3],
    /// NaN in lanes without a sphere, so that no ray meets them.
    radius: Lanes,
    /// What the caller calls them.
    ids: [u32; BLOCK],
}

impl Default for SphereBlock {
    /// No sphere.
    fn default() -> Self {
        Self { center: [Lanes::default(); 3], radius: Lanes([f32::NAN; BLOCK]), ids: [u32::MAX; BLOCK] }
    }
}

impl SphereBlock {
    /// Puts a sphere into a lane.
    pub fn set(&mut self, lane: usize, center: Vec3, radius: f32, id: u32) {
        for axis in 0..3 {
            self.center[axis].0[lane] = center[axis];
        }
        self.radius.0[lane] = radius;
        self.ids[lane] = id;
    }

    /// What [`SphereBlock::set`] was told.
    #[inline(always)]
    pub fn ids(&self) -> &[u32; BLOCK] {
        &self.ids
    }

    /// The spheres that a ray meets in (`t_min`, `t_max`], each at its nearest point.
    #[inline(always)]
    pub fn intersect<I: Isa>(
        &self,
        isa: I,
        origin: Vec3,
        direction: Vec3,
        (t_min, t_max): (I::F32x8, I::F32x8),
    ) -> Option<Candidates> {
        let zero = isa.splat(0.0);
        let d = [isa.splat(direction.x), isa.splat(direction.y), isa.splat(direction.z)];
        let f = [
            isa.sub(isa.splat(origin.x), isa.load(&self.center[0])),
            isa.sub(isa.splat(origin.y), isa.load(&self.center[1])),
            isa.sub(isa.splat(origin.z), isa.load(&self.center[2])),
        ];
        let a = dot(isa, d, d);
        let b = isa.sub(zero, dot(isa, f, d));
        let along = isa.div(b, a);
        let nearest = [
            isa.add(f[0], isa.mul(d[0], along)),
            isa.add(f[1], isa.mul(d[1], along)),
            isa.add(f[2], isa.mul(d[2], along)),
        ];
        let radius = isa.load(&self.radius);
        let squared = isa.mul(radius, radius);
        let discriminant = isa.sub(squared, dot(isa, nearest, nearest));
        let real = isa.le(zero, discriminant);
        if real == 0 {
            return None;
        }
        let root = isa.sqrt(isa.mul(a, isa.max(discriminant, zero)));
        let c = isa.sub(dot(isa, f, f), squared);
        let q = isa.add(b, isa.select_lt(b, zero, isa.sub(zero, root), root));
        let (first, second) = (isa.div(c, q), isa.div(q, a));
        let near = isa.select_lt(first, second, first, second);
        let far = isa.select_lt(first, second, second, first);
        let near_mask = real & isa.lt(t_min, near) & isa.le(near, t_max);
        let far_mask = real & isa.lt(t_min, far) & isa.le(far, t_max);
        let mask = near_mask | far_mask;
        if mask == 0 {
            return None;
        }
        let (near, far) = (isa.store(near), isa.store(far));
        let mut t = far;
        for lane in 0..BLOCK {
            if near_mask >> lane & 1 == 1 {
                t.0[lane] = near.0[lane];
            }
        }
        Some(Candidates { mask, t, u: Lanes::default(), v: Lanes::default() })
    }
}

#[inline(always)]
fn dot<I: Isa>(isa: I, a: [I::F32x8; 3], b: [I::F32x8; 3]) -> I::F32x8 {
    isa.add(isa.add(isa.mul(a[0], b[0]), isa.mul(a[1], b[1])), isa.mul(a[2], b[2]))
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
