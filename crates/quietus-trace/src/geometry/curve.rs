//! Where a ray meets a thin strip along a cubic Bezier curve.
//!
//! The strip faces the ray: it is met where the ray passes the curve at less than half its width. Seen along the ray
//! (Nakamaru and Ohno 2002, "Ray Tracing for Curves Primitive"; Pharr, Jakob and Humphreys 2023, "Physically Based
//! Rendering", 4th edition, section 6.7) that is a question in two dimensions. Instead of halving the curve until it
//! is flat, eight pieces are looked at at once: where the chord of a piece comes near enough, Gauss-Newton's iteration
//! from the nearest point of the chord finds the nearest point of the curve itself.
//!
//! Long curves run across their boxes, so they are cut into parts with boxes of their own. Pieces that are
//! neighbours, of one part or two, start and end in the same point, bit for bit, and overlap: nothing slips through
//! between them.

use glam::{DVec3, Vec2, Vec3};

use super::{BLOCK, Candidates};
use crate::bvh::Bounds;
use crate::desc::CurveSegment;
use crate::frame::Frame;
use crate::isa::{Isa, Lanes};

/// How far, in units of the parameter, a curve is continued at its ends: more than rounding can leave open between
/// two curves that touch.
const END_SLACK: f32 = 1e-5;

/// Most parts a curve is cut into.
pub const MAX_PARTS: u32 = 8;

/// A part of a curve, with what the caller calls it: one cache line.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct CurvePart {
    /// Control points of the whole curve.
    points: [Vec3; 4],
    /// Widths at the ends of the whole curve.
    widths: [f32; 2],
    /// Which part.
    part: u16,
    /// Of how many: a power of two.
    parts: u16,
    /// What the caller calls it.
    id: u32,
}

/// A part of a ribbon: a strip that faces along its normals instead of along the ray.
#[derive(Clone, Copy, Debug)]
pub struct RibbonPart {
    part: CurvePart,
    normals: [Vec3; 2],
}

/// A ray as curves want it.
#[derive(Clone, Copy, Debug)]
pub struct CurveRay {
    origin: Vec3,
    /// Its z axis is the ray's direction.
    frame: Frame,
    /// Of the direction.
    length: f32,
}

impl CurveRay {
    /// For a direction that is finite and not 0.
    #[inline(always)]
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        let length = direction.length();
        Self { origin, frame: Frame::from_normal(direction / length), length }
    }
}

impl CurvePart {
    /// Part number `part` of `parts`, a power of two up to [`MAX_PARTS`].
    pub fn new(segment: &CurveSegment, part: u32, parts: u32, id: u32) -> Self {
        debug_assert!(parts.is_power_of_two() && parts <= MAX_PARTS && part < parts);
        let (part, parts) = (part as u16, parts as u16);
        Self { points: segment.points, widths: segment.widths, part, parts, id }
    }

    /// What [`CurvePart::new`] was told.
    #[inline(always)]
    pub fn id(&self) -> u32 {
        self.id
    }

    /// Where the ray meets the strip in (`t_min`, `t_max`]: `u` along the whole curve, `v` across it from 0 to 1, in
    /// the direction of the normal that faces the ray times the tangent.
    #[inline(always)]
    pub fn intersect<I: Isa>(
        &self,
        isa: I,
        ray: &CurveRay,
        t_min: I::F32x8,
        t_max: I::F32x8,
    ) -> Option<Candidates> {
        let curve = self.seen(ray);
        let step = 1.0 / (BLOCK as f32 * f32::from(self.parts));
        let first = isa.add(isa.splat(BLOCK as f32 * f32::from(self.part)), isa.load(&COUNT));
        let start = isa.mul(first, isa.splat(step));
        let end = isa.mul(isa.add(first, isa.splat(1.0)), isa.splat(step));
        let along = curve.near_chords(isa, start, end, 0.5 * self.widths[0].max(self.widths[1]), step)?;
        let guess = isa.add(start, isa.mul(along, isa.splat(step)));
        let near = curve.nearest(isa, guess, step);
        let (u, slack) = (near.u, isa.splat(0.5 * step));
        let mut mask = near.mask & isa.le(isa.sub(start, slack), u) & isa.le(u, isa.add(end, slack));
        mask &= isa.le(isa.splat(-END_SLACK), u) & isa.le(u, isa.splat(1.0 + END_SLACK));
        let width =
            isa.add(isa.splat(self.widths[0]), isa.mul(u, isa.splat(self.widths[1] - self.widths[0])));
        let half = isa.mul(width, isa.splat(0.5));
        let [x, y, z] = near.point;
        mask &= isa.le(dot(isa, [x, y], [x, y]), isa.mul(half, half));
        let t = isa.div(z, isa.splat(ray.length));
        mask &= isa.lt(t_min, t) & isa.le(t, t_max);
        if mask == 0 {
            return None;
        }
        let [dx, dy] = near.tangent;
        // The ray lies at minus the point from the curve; across is the facing normal, -z, times the tangent.
        let area = isa.sub(isa.mul(y, dx), isa.mul(x, dy));
        let length = isa.sqrt(dot(isa, near.tangent, near.tangent));
        let v = isa.add(isa.splat(0.5), isa.div(area, isa.mul(length, width)));
        let (u, v) = (clamp_unit(isa, u), clamp_unit(isa, v));
        Some(Candidates { mask, t: isa.store(t), u: isa.store(u), v: isa.store(v) })
    }

    /// The control points seen along the ray.
    #[inline(always)]
    fn seen(&self, ray: &CurveRay) -> Seen {
        let [a, b, c, d] = self.points;
        let [a, b, c, d] = [
            ray.frame.to_local(a - ray.origin),
            ray.frame.to_local(b - ray.origin),
            ray.frame.to_local(c - ray.origin),
            ray.frame.to_local(d - ray.origin),
        ];
        Seen { x: [a.x, b.x, c.x, d.x], y: [a.y, b.y, c.y, d.y], z: [a.z, b.z, c.z, d.z] }
    }
}

impl RibbonPart {
    /// A part of a segment that is a ribbon, see [`CurvePart::new`].
    pub fn new(segment: &CurveSegment, part: u32, parts: u32, id: u32) -> Self {
        Self { part: CurvePart::new(segment, part, parts, id), normals: segment.normals }
    }

    /// What [`RibbonPart::new`] was told.
    #[inline(always)]
    pub fn id(&self) -> u32 {
        self.part.id
    }

    /// As [`CurvePart::intersect`], where the strip is narrowed by the cosine under which its normal is seen.
    #[inline(always)]
    pub fn intersect<I: Isa>(
        &self,
        isa: I,
        ray: &CurveRay,
        t_min: I::F32x8,
        t_max: I::F32x8,
    ) -> Option<Candidates> {
        let mut found = self.part.intersect(isa, ray, t_min, t_max)?;
        for lane in 0..BLOCK {
            let cosine = normal_at(&self.normals, found.u.0[lane]).dot(ray.frame.normal).abs();
            let across = (found.v.0[lane] - 0.5) / cosine;
            // NaN, seen edge-on, is not met.
            let met = across.abs() <= 0.5;
            found.mask &= !(u32::from(!met) << lane);
            found.v.0[lane] = 0.5 + across;
        }
        (found.mask != 0).then_some(found)
    }
}

/// Lane numbers.
const COUNT: Lanes = Lanes([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);

/// Control points in a space where the ray is the z axis.
struct Seen {
    x: [f32; 4],
    y: [f32; 4],
    z: [f32; 4],
}

impl Seen {
    /// For the pieces between `start` and `end`, of length `step`, how far along their chords, in 0..=1, they come
    /// nearest to the ray; none where no piece comes nearer than `radius`.
    #[inline(always)]
    fn near_chords<I: Isa>(
        &self,
        isa: I,
        start: I::F32x8,
        end: I::F32x8,
        radius: f32,
        step: f32,
    ) -> Option<I::F32x8> {
        let (from, to) = (bernstein(isa, start), bernstein(isa, end));
        let a = [weigh(isa, from, self.x), weigh(isa, from, self.y)];
        let b = [weigh(isa, to, self.x), weigh(isa, to, self.y)];
        let chord = [isa.sub(b[0], a[0]), isa.sub(b[1], a[1])];
        let square = dot(isa, chord, chord);
        let along = isa.div(isa.sub(isa.splat(0.0), dot(isa, a, chord)), square);
        let along = clamp_unit(isa, along);
        let x = isa.add(a[0], isa.mul(along, chord[0]));
        let y = isa.add(a[1], isa.mul(along, chord[1]));
        // A curve whose second derivative is at most 6 b strays from a chord over h by at most 6 b h^2 / 8. Doubled:
        // room for rounding.
        let reach = radius + 1.5 * self.bend() * step * step;
        let near = isa.le(dot(isa, [x, y], [x, y]), isa.splat(reach * reach));
        (near != 0).then_some(along)
    }

    /// Bounds a sixth of the second derivative.
    #[inline(always)]
    fn bend(&self) -> f32 {
        let at = |i: usize| {
            let x = self.x[i] - 2.0 * self.x[i + 1] + self.x[i + 2];
            let y = self.y[i] - 2.0 * self.y[i + 1] + self.y[i + 2];
            x * x + y * y
        };
        at(0).max(at(1)).sqrt()
    }

    /// Two steps of Gauss-Newton, the second along the tangent, towards the parameters at which the curve is nearest
    /// to the ray. Where even the second goes far, nothing is near: its lane is left out.
    #[inline(always)]
    fn nearest<I: Isa>(&self, isa: I, u: I::F32x8, step: f32) -> Nearest<I> {
        let weights = bernstein(isa, u);
        let p = [weigh(isa, weights, self.x), weigh(isa, weights, self.y)];
        let weights = slopes(isa, u);
        let tangent = [slope(isa, weights, self.x), slope(isa, weights, self.y)];
        let u = isa.sub(u, isa.div(dot(isa, p, tangent), dot(isa, tangent, tangent)));
        let weights = bernstein(isa, u);
        let [x, y, z] =
            [weigh(isa, weights, self.x), weigh(isa, weights, self.y), weigh(isa, weights, self.z)];
        let weights = slopes(isa, u);
        let [dx, dy, dz] =
            [slope(isa, weights, self.x), slope(isa, weights, self.y), slope(isa, weights, self.z)];
        let tangent = [dx, dy];
        let on = isa.div(dot(isa, [x, y], tangent), dot(isa, tangent, tangent));
        let far = isa.splat(0.25 * step);
        let mask = isa.le(on, far) & isa.le(isa.sub(isa.splat(0.0), far), on);
        let point = [isa.sub(x, isa.mul(on, dx)), isa.sub(y, isa.mul(on, dy)), isa.sub(z, isa.mul(on, dz))];
        Nearest { mask, u: isa.sub(u, on), point, tangent }
    }
}

/// Where a curve is nearest to a ray.
struct Nearest<I: Isa> {
    /// Lanes in which it is.
    mask: u32,
    u: I::F32x8,
    point: [I::F32x8; 3],
    tangent: [I::F32x8; 2],
}

/// The cubic Bernstein polynomials; exactly 0 or 1 at the ends.
#[inline(always)]
fn bernstein<I: Isa>(isa: I, u: I::F32x8) -> [I::F32x8; 4] {
    let s = isa.sub(isa.splat(1.0), u);
    let us = isa.mul(isa.splat(3.0), isa.mul(u, s));
    [isa.mul(s, isa.mul(s, s)), isa.mul(us, s), isa.mul(us, u), isa.mul(u, isa.mul(u, u))]
}

#[inline(always)]
fn weigh<I: Isa>(isa: I, w: [I::F32x8; 4], p: [f32; 4]) -> I::F32x8 {
    let outer = isa.add(isa.mul(w[0], isa.splat(p[0])), isa.mul(w[3], isa.splat(p[3])));
    isa.add(outer, isa.add(isa.mul(w[1], isa.splat(p[1])), isa.mul(w[2], isa.splat(p[2]))))
}

/// Weights of the differences of control points in the derivative.
#[inline(always)]
fn slopes<I: Isa>(isa: I, u: I::F32x8) -> [I::F32x8; 3] {
    let s = isa.sub(isa.splat(1.0), u);
    let three = isa.splat(3.0);
    [isa.mul(three, isa.mul(s, s)), isa.mul(isa.splat(6.0), isa.mul(u, s)), isa.mul(three, isa.mul(u, u))]
}

#[inline(always)]
fn slope<I: Isa>(isa: I, w: [I::F32x8; 3], p: [f32; 4]) -> I::F32x8 {
    let outer = isa.add(isa.mul(w[0], isa.splat(p[1] - p[0])), isa.mul(w[2], isa.splat(p[3] - p[2])));
    isa.add(outer, isa.mul(w[1], isa.splat(p[2] - p[1])))
}

#[inline(always)]
fn dot<I: Isa>(isa: I, a: [I::F32x8; 2], b: [I::F32x8; 2]) -> I::F32x8 {
    isa.add(isa.mul(a[0], b[0]), isa.mul(a[1], b[1]))
}

/// Into 0..=1; not-a-number becomes 0.
#[inline(always)]
fn clamp_unit<I: Isa>(isa: I, x: I::F32x8) -> I::F32x8 {
    isa.min(isa.max(x, isa.splat(0.0)), isa.splat(1.0))
}

/// Point of a curve.
#[inline]
pub fn point(points: &[Vec3; 4], u: f32) -> Vec3 {
    let s = 1.0 - u;
    s * s * s * points[0] + 3.0 * u * s * (s * points[1] + u * points[2]) + u * u * u * points[3]
}

/// Derivative by u; the chord where that vanishes.
#[inline]
pub fn tangent(points: &[Vec3; 4], u: f32) -> Vec3 {
    let s = 1.0 - u;
    let [a, b, c, d] = *points;
    let tangent = 3.0 * (s * s * (b - a) + 2.0 * u * s * (c - b) + u * u * (d - c));
    if tangent.length_squared() > 0.0 { tangent } else { d - a }
}

/// Normal of a ribbon, of unit length: turned evenly from one end to the other.
#[inline]
pub fn normal_at(normals: &[Vec3; 2], u: f32) -> Vec3 {
    let [a, b] = *normals;
    let cosine = a.dot(b).clamp(-1.0, 1.0);
    let angle = cosine.acos();
    let sine = angle.sin();
    // Parallel normals need no turn, opposite ones have no plane to turn in.
    if sine < 1e-4 {
        return a.lerp(b, u).normalize_or(a);
    }
    ((((1.0 - u) * angle).sin() * a + (u * angle).sin() * b) / sine).normalize_or(a)
}

/// How a point on a strip is oriented.
#[derive(Clone, Copy, Debug)]
pub struct Strip {
    /// Along the curve, of unit length.
    pub tangent: Vec3,
    /// The normal, perpendicular to it and of unit length.
    pub normal: Vec3,
    /// How far across, in 0..=1, in the direction of `normal x tangent`.
    pub v: f32,
}

impl Strip {
    /// A strip that faces a ray in `direction` and was met at `v` of the kernel.
    #[inline]
    pub fn facing(tangent: Vec3, direction: Vec3, v: f32) -> Self {
        let tangent = tangent.normalize_or(Vec3::X);
        let toward = tangent * tangent.dot(direction) - direction;
        Self {
            tangent,
            normal: toward.try_normalize().unwrap_or_else(|| tangent.any_orthonormal_vector()),
            v,
        }
    }

    /// The same, shaded as a round tube.
    #[inline]
    pub fn rounded(self) -> Self {
        let sine = 2.0 * self.v - 1.0;
        let cosine = (1.0 - sine * sine).max(0.0).sqrt();
        Self { normal: cosine * self.normal + sine * self.normal.cross(self.tangent), ..self }
    }

    /// The same, facing as near to `normal` as it can.
    #[inline]
    pub fn turned(self, normal: Vec3) -> Self {
        let across = normal - self.tangent * self.tangent.dot(normal);
        let normal = across.normalize_or(self.normal);
        let from_behind = normal.dot(self.normal) < 0.0;
        Self { normal, v: if from_behind { 1.0 - self.v } else { self.v }, ..self }
    }
}

/// Into how many parts, a power of two of at most `most`, a curve should be cut.
///
/// The area of a part's box is the chance that a ray looks at it: cutting in half is worth its memory while it takes
/// at least a quarter off the sum of areas. And no piece of a part may bend by more than a quarter turn or so, for
/// Gauss-Newton to start near enough.
pub fn parts(segment: &CurveSegment, most: u32) -> u32 {
    let [a, b, c, d] = segment.points;
    let bend = (a - 2.0 * b + c).length().max((b - 2.0 * c + d).length());
    let length = (b - a).length() + (c - b).length() + (d - c).length();
    let area = |parts: u32| -> f32 {
        (0..parts)
            .map(|part| {
                let size = bounds(segment, part, parts);
                let size = size.max - size.min;
                size.x * size.y + size.y * size.z + size.z * size.x
            })
            .sum()
    };
    let mut parts = 1;
    let mut now = area(1);
    while parts < most {
        let halved = area(2 * parts);
        // Over a piece the derivative, about the length, changes by 6 times the bend.
        let bends = 6.0 * bend > 1.5 * length * (BLOCK as f32 * parts as f32);
        if halved > 0.75 * now && !bends {
            break;
        }
        (parts, now) = (2 * parts, halved);
    }
    parts
}

/// Bounds of part number `part` of `parts`: those of its control points, with the strip's reach to all sides.
pub fn bounds(segment: &CurveSegment, part: u32, parts: u32) -> Bounds {
    let at = |i: u32| f64::from(i) / f64::from(parts);
    let (from, to) = (at(part), at(part + 1));
    let p = segment.points.map(Vec3::as_dvec3);
    let hull = [[from, from, from], [from, from, to], [from, to, to], [to, to, to]].map(|at| blossom(&p, at));
    let [a, b, c, d] = hull;
    let (min, max) = (a.min(b).min(c.min(d)).as_vec3(), a.max(b).max(c.max(d)).as_vec3());
    let width = |u: f64| segment.widths[0] + (segment.widths[1] - segment.widths[0]) * u as f32;
    // The kernel's parameter and distances are off by roundings of the ray's origin, which only the ray knows;
    // this is room for those of the curve.
    let reach = 0.5 * width(from).max(width(to)) * (1.0 + 1e-5);
    let room = reach + 8.0 * f32::EPSILON * min.abs().max(max.abs());
    // NaN passes min and max unseen.
    let broken = hull.iter().any(|p| p.is_nan());
    if broken { Bounds::EMPTY } else { Bounds { min: min - room, max: max + room } }
}

/// De Casteljau's algorithm with a parameter for each level: control points of a part are the blossom at its ends.
fn blossom(p: &[DVec3; 4], [u, v, w]: [f64; 3]) -> DVec3 {
    let q = [p[0].lerp(p[1], u), p[1].lerp(p[2], u), p[2].lerp(p[3], u)];
    let r = [q[0].lerp(q[1], v), q[1].lerp(q[2], v)];
    r[0].lerp(r[1], w)
}

/// Texture coordinates: along the curve, across it.
#[inline]
pub fn uv(segment: &CurveSegment, u: f32, v: f32) -> Vec2 {
    Vec2::new(segment.u_range[0] + (segment.u_range[1] - segment.u_range[0]) * u, v)
}

/// Width at u.
#[inline]
pub fn width(segment: &CurveSegment, u: f32) -> f32 {
    segment.widths[0] + (segment.widths[1] - segment.widths[0]) * u
}

#[cfg(test)]
mod tests;
