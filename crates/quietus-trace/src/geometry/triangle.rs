//! The watertight ray-triangle test of Woop, Benthin and Wald 2013, "Watertight Ray/Triangle Intersection".
//!
//! Vertices are moved and sheared into a space where the ray starts at 0 and runs along +z; each vertex is
//! rounded there once, whichever triangle it belongs to, so two triangles see their shared edge in the same
//! place. The edge functions are differences of two rounded products. Rounding is monotonic, so their sign is
//! never wrong, only 0 where the truth is not; 0 counts as inside, hence a ray may meet both triangles at an
//! edge but never slips between them. (The paper resolves zeros in double precision; being generous to both
//! sides is as tight against leaks.) A fused multiply-add in an edge function would break this.

use glam::Vec3;

use super::{BLOCK, Candidates, gamma};
use crate::isa::{Isa, Lanes};

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
///
/// The plain form of [`TriangleBlock::intersect`], operation by operation.
pub fn intersect(origin: Vec3, ray: &Sheared, vertices: [Vec3; 3]) -> Option<(f32, f32, f32)> {
    let [kx, ky, kz] = ray.axes;
    let [a, b, c] = vertices.map(|v| {
        let p = v - origin;
        Vec3::new(p[kx] - ray.shear.x * p[kz], p[ky] - ray.shear.y * p[kz], p[kz])
    });
    let u = c.x * b.y - c.y * b.x;
    let v = a.x * c.y - a.y * c.x;
    let w = b.x * a.y - b.y * a.x;
    let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    let reciprocal = 1.0 / (u + v + w);
    let [u, v, w] = [u, v, w].map(|x| x * reciprocal);
    let t = (u * a.z + v * b.z + w * c.z) * ray.shear.z;
    (inside && t.is_finite()).then_some((t, v, w))
}

/// Up to 8 triangles: five cache lines.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct TriangleBlock {
    /// By vertex and axis. Lanes without a triangle are NaN, so that no ray meets them.
    vertices: [[Lanes; 3]; 3],
    /// What the caller calls them.
    ids: [u32; BLOCK],
}

impl Default for TriangleBlock {
    /// No triangle.
    fn default() -> Self {
        Self { vertices: [[Lanes([f32::NAN; BLOCK]); 3]; 3], ids: [u32::MAX; BLOCK] }
    }
}

/// A ray as a block of triangles wants it.
#[derive(Clone, Copy)]
pub struct ShearedLanes<I: Isa> {
    axes: [usize; 3],
    origin: [I::F32x8; 3],
    shear: [I::F32x8; 3],
}

impl<I: Isa> ShearedLanes<I> {
    /// For a direction that is finite and not 0.
    #[inline(always)]
    pub fn new(isa: I, origin: Vec3, direction: Vec3) -> Self {
        let Sheared { axes, shear } = Sheared::new(direction);
        Self {
            axes,
            origin: [isa.splat(origin[axes[0]]), isa.splat(origin[axes[1]]), isa.splat(origin[axes[2]])],
            shear: [isa.splat(shear.x), isa.splat(shear.y), isa.splat(shear.z)],
        }
    }
}

impl TriangleBlock {
    /// Puts a triangle into a lane.
    pub fn set(&mut self, lane: usize, vertices: [Vec3; 3], id: u32) {
        for (lanes, vertex) in self.vertices.iter_mut().zip(vertices) {
            for axis in 0..3 {
                lanes[axis].0[lane] = vertex[axis];
            }
        }
        self.ids[lane] = id;
    }

    /// What [`TriangleBlock::set`] was told.
    #[inline(always)]
    pub fn ids(&self) -> &[u32; BLOCK] {
        &self.ids
    }

    /// A vertex of all triangles, from the ray's origin along one of the ray's axes.
    #[inline(always)]
    fn moved<I: Isa>(&self, isa: I, ray: &ShearedLanes<I>, vertex: usize, axis: usize) -> I::F32x8 {
        debug_assert!(ray.axes[axis] < 3);
        // SAFETY: `Sheared::new` makes axes a permutation of 0, 1, 2, and nothing else sets them.
        let lanes = unsafe { self.vertices[vertex].get_unchecked(ray.axes[axis]) };
        isa.sub(isa.load(lanes), ray.origin[axis])
    }

    /// A vertex of all triangles in the ray's space, but for the scale of z.
    #[inline(always)]
    fn sheared<I: Isa>(&self, isa: I, ray: &ShearedLanes<I>, vertex: usize) -> [I::F32x8; 3] {
        let z = self.moved(isa, ray, vertex, 2);
        let x = isa.sub(self.moved(isa, ray, vertex, 0), isa.mul(ray.shear[0], z));
        let y = isa.sub(self.moved(isa, ray, vertex, 1), isa.mul(ray.shear[1], z));
        [x, y, z]
    }

    /// The triangles that `ray` meets in (`t_min`, `t_max`].
    #[inline(always)]
    pub fn intersect<I: Isa>(
        &self,
        isa: I,
        ray: &ShearedLanes<I>,
        t_min: I::F32x8,
        t_max: I::F32x8,
    ) -> Option<Candidates> {
        let [a, b, c] = [self.sheared(isa, ray, 0), self.sheared(isa, ray, 1), self.sheared(isa, ray, 2)];
        ray.meets(isa, [a, b, c], t_min, t_max)
    }
}

impl<I: Isa> ShearedLanes<I> {
    /// The triangles among those with these vertices, in the ray's space but for the scale of z, that the ray meets
    /// in (`t_min`, `t_max`].
    #[inline(always)]
    fn meets(
        &self,
        isa: I,
        [a, b, c]: [[I::F32x8; 3]; 3],
        t_min: I::F32x8,
        t_max: I::F32x8,
    ) -> Option<Candidates> {
        let u = isa.sub(isa.mul(c[0], b[1]), isa.mul(c[1], b[0]));
        let v = isa.sub(isa.mul(a[0], c[1]), isa.mul(a[1], c[0]));
        let w = isa.sub(isa.mul(b[0], a[1]), isa.mul(b[1], a[0]));
        let zero = isa.splat(0.0);
        let front = isa.le(zero, isa.min(u, isa.min(v, w)));
        let back = isa.le(isa.max(u, isa.max(v, w)), zero);
        let inside = front | back;
        if inside == 0 {
            return None;
        }
        // Normalised first, so that distances do not go by the cube of the scale and vanish.
        let reciprocal = isa.div(isa.splat(1.0), isa.add(isa.add(u, v), w));
        let [u, v, w] = [isa.mul(u, reciprocal), isa.mul(v, reciprocal), isa.mul(w, reciprocal)];
        let sum = isa.add(isa.add(isa.mul(u, a[2]), isa.mul(v, b[2])), isa.mul(w, c[2]));
        let t = isa.mul(sum, self.shear[2]);
        // Seen edge-on, a triangle has an infinite reciprocal and t is infinite or NaN; t_max is finite.
        let mask = inside & isa.lt(t_min, t) & isa.le(t, t_max);
        if mask == 0 {
            return None;
        }
        Some(Candidates { mask, t: isa.store(t), u: isa.store(v), v: isa.store(w) })
    }
}

/// Up to 8 triangles whose vertices move along straight lines.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub struct MovingBlock {
    /// At time 0.
    start: TriangleBlock,
    /// By vertex and axis: what is added until time 1. Unlike the place at time 1 it keeps vertices that do not move
    /// exactly where they are, as still triangles that share them have them.
    way: [[Lanes; 3]; 3],
}

impl MovingBlock {
    /// Puts a triangle that moves from `start` to `end` into a lane.
    pub fn set(&mut self, lane: usize, start: [Vec3; 3], end: [Vec3; 3], id: u32) {
        self.start.set(lane, start, id);
        for (vertex, lanes) in self.way.iter_mut().enumerate() {
            let way = end[vertex] - start[vertex];
            for axis in 0..3 {
                lanes[axis].0[lane] = way[axis];
            }
        }
    }

    /// What [`MovingBlock::set`] was told.
    #[inline(always)]
    pub fn ids(&self) -> &[u32; BLOCK] {
        &self.start.ids
    }

    /// The triangles that `ray` meets at `time` in (`t_min`, `t_max`].
    #[inline(always)]
    pub fn intersect<I: Isa>(
        &self,
        isa: I,
        ray: &ShearedLanes<I>,
        time: f32,
        t_min: I::F32x8,
        t_max: I::F32x8,
    ) -> Option<Candidates> {
        let time = isa.splat(time);
        let [a, b, c] = [
            self.sheared(isa, ray, time, 0),
            self.sheared(isa, ray, time, 1),
            self.sheared(isa, ray, time, 2),
        ];
        ray.meets(isa, [a, b, c], t_min, t_max)
    }

    /// A vertex of all triangles in the ray's space, but for the scale of z.
    #[inline(always)]
    fn sheared<I: Isa>(&self, isa: I, ray: &ShearedLanes<I>, time: I::F32x8, vertex: usize) -> [I::F32x8; 3] {
        let z = self.moved(isa, ray, time, vertex, 2);
        let x = isa.sub(self.moved(isa, ray, time, vertex, 0), isa.mul(ray.shear[0], z));
        let y = isa.sub(self.moved(isa, ray, time, vertex, 1), isa.mul(ray.shear[1], z));
        [x, y, z]
    }

    /// A vertex of all triangles at `time`, from the ray's origin along one of the ray's axes.
    #[inline(always)]
    fn moved<I: Isa>(
        &self,
        isa: I,
        ray: &ShearedLanes<I>,
        time: I::F32x8,
        vertex: usize,
        axis: usize,
    ) -> I::F32x8 {
        let start = isa.load(&self.start.vertices[vertex][ray.axes[axis]]);
        let way = isa.load(&self.way[vertex][ray.axes[axis]]);
        isa.sub(isa.add(start, isa.mul(way, time)), ray.origin[axis])
    }
}

/// Where the corners of a triangle that moves from `start` to `end` are at `time`, as [`MovingBlock`] has them.
#[inline]
pub fn corners_at(start: [Vec3; 3], end: [Vec3; 3], time: f32) -> [Vec3; 3] {
    [0, 1, 2].map(|i| start[i] + (end[i] - start[i]) * time)
}

/// How far [`corners_at`] may be off per axis: a difference, a product and a sum, here and in the kernel, of numbers
/// no greater than the sum of both.
#[inline]
pub fn motion_error(start: [Vec3; 3], end: [Vec3; 3]) -> Vec3 {
    let size = |i: usize| start[i].abs() + end[i].abs();
    gamma(6) * size(0).max(size(1)).max(size(2))
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
