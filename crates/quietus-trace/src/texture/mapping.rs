//! From a point on a surface to texture coordinates.

use std::f32::consts::{PI, TAU};

use glam::{Affine3A, Vec2, Vec3};

use super::SurfacePoint;
use crate::desc::Mapping;

impl Mapping {
    /// Texture coordinates of `point`. A solid mapping has the first two of its three.
    #[inline]
    pub(super) fn coordinates(&self, point: &SurfacePoint) -> Vec2 {
        match self {
            Self::Uv { set, transform } => transform.transform_point2(point.uv[usize::from(*set)]),
            other => other.of_position(point.position),
        }
    }

    /// Texture coordinates of a place in the world; 0 for those that do not depend on it.
    fn of_position(&self, position: Vec3) -> Vec2 {
        let local = |from_world: &Affine3A| from_world.transform_point3(position);
        match self {
            Self::Uv { .. } => Vec2::ZERO,
            Self::Planar { from_world, axes, offset } => {
                let p = local(from_world);
                Vec2::new(p.dot(axes[0]), p.dot(axes[1])) + offset
            }
            Self::Spherical { from_world } => {
                let p = local(from_world).normalize_or(Vec3::Z);
                Vec2::new(p.z.clamp(-1.0, 1.0).acos() / PI, turns(p))
            }
            Self::Cylindrical { from_world } => {
                let p = local(from_world);
                Vec2::new(turns(p), p.z)
            }
            Self::Solid { from_world } => local(from_world).truncate(),
        }
    }

    /// What the texture coordinates change by along the two half axes of the footprint of `point`.
    #[inline]
    pub(super) fn footprint(&self, point: &SurfacePoint) -> [Vec2; 2] {
        match self {
            Self::Uv { set, transform } => {
                point.footprint.uv[usize::from(*set)].map(|step| transform.transform_vector2(step))
            }
            other => point.footprint.axes.map(|axis| {
                let step = other.of_position(point.position + axis) - other.of_position(point.position);
                // Across the seam of an angle the short way is meant.
                match other {
                    Self::Spherical { .. } => step - Vec2::new(0.0, step.y.round()),
                    Self::Cylindrical { .. } => step - Vec2::new(step.x.round(), 0.0),
                    _ => step,
                }
            }),
        }
    }

    /// Whether `point` lies in a cell of odd coordinate sum of the chess board of unit cells. Points without a place
    /// lie in an even one.
    pub(super) fn is_odd_cell(&self, point: &SurfacePoint) -> bool {
        let cells = match self {
            Self::Solid { from_world } => from_world.transform_point3(point.position).floor(),
            other => other.coordinates(point).floor().extend(0.0),
        };
        // Exact: sums of whole numbers, of which those beyond 2^24 are even.
        cells.element_sum().rem_euclid(2.0) == 1.0
    }
}

/// The angle around the z axis from +x towards +y, in turns, 0 to 1.
fn turns(p: Vec3) -> f32 {
    let turns = p.y.atan2(p.x) / TAU;
    if turns < 0.0 { turns + 1.0 } else { turns }
}
