//! Where a ray meets triangles, spheres, quadrics, patches and curves, and where the next ray starts.

use glam::Vec3;

use crate::isa::Lanes;

pub mod curve;
pub mod motion;
pub mod patch;
pub mod quadric;
pub mod sphere;
pub mod triangle;

/// Primitives in a block.
pub const BLOCK: usize = 8;

/// What a ray meets in a block of primitives, lane by lane.
#[derive(Clone, Copy, Debug)]
pub struct Candidates {
    /// Bit i is set where lane i is met; never 0.
    pub mask: u32,
    /// Distances.
    pub t: Lanes,
    /// Barycentric coordinates of the second vertex; first parameters of patches and curves.
    pub u: Lanes,
    /// Barycentric coordinates of the third vertex; second parameters of patches and curves.
    pub v: Lanes,
}

impl Candidates {
    /// One hit, in lane 0.
    pub fn single(t: f32, u: f32, v: f32) -> Self {
        let lane = |x| {
            let mut lanes = Lanes::default();
            lanes.0[0] = x;
            lanes
        };
        Self { mask: 1, t: lane(t), u: lane(u), v: lane(v) }
    }
}

/// Half the distance from 1 to the next float.
const UNIT_ROUNDOFF: f32 = f32::EPSILON / 2.0;

/// Higham's `gamma_n`: bounds the relative error of n roundings in a row (Pharr, Jakob and Humphreys 2023,
/// "Physically Based Rendering", 4th edition, section 6.8.1).
pub const fn gamma(n: u32) -> f32 {
    let nu = n as f32 * UNIT_ROUNDOFF;
    nu / (1.0 - nu)
}

/// Where a ray in direction `w` may start so that it does not meet the surface it leaves.
///
/// `p` is a point on the surface, `error` bounds how far it may be off per axis (from
/// [`triangle::point_error`] or [`sphere::point_error`], carried through the instance by
/// [`transform_error`]), `normal` is the geometric normal, on either side. The point is moved along the
/// normal, to the side `w` leaves to, until the box of possible points is behind it, then rounded away
/// from the surface ("Physically Based Rendering", 4th edition, section 6.8.6).
#[inline]
pub fn offset_ray_origin(p: Vec3, error: Vec3, normal: Vec3, w: Vec3) -> Vec3 {
    let distance = normal.abs().dot(error);
    let offset = if w.dot(normal) < 0.0 { -distance * normal } else { distance * normal };
    let moved = p + offset;
    Vec3::new(away(moved.x, offset.x), away(moved.y, offset.y), away(moved.z, offset.z))
}

/// The next float after `x` in the direction of `offset`.
#[inline]
fn away(x: f32, offset: f32) -> f32 {
    if offset > 0.0 {
        x.next_up()
    } else if offset < 0.0 {
        x.next_down()
    } else {
        x
    }
}

/// Error bound per axis of `transform * p`, where `p` itself is off by at most `error` ("Physically Based
/// Rendering", 4th edition, section 6.8.4).
pub fn transform_error(transform: &glam::Affine3A, p: Vec3, error: Vec3) -> Vec3 {
    let m = transform.matrix3;
    let absolute = glam::Mat3A::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs());
    let carried = (1.0 + gamma(3)) * Vec3::from(absolute * glam::Vec3A::from(error));
    let rounding = absolute * glam::Vec3A::from(p.abs()) + transform.translation.abs();
    carried + gamma(4) * Vec3::from(rounding)
}
