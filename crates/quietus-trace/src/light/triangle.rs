//! Triangles that shine: chosen uniformly over their area.

use glam::{Affine3A, Vec2, Vec3};

use super::bounds::LightBounds;
use super::{AreaSample, Emitter, Target};
use crate::bvh::Bounds;
use crate::geometry::transform_error;
use crate::geometry::triangle::point_error;
use crate::warp;

/// A triangle of an emissive mesh, in the world.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TriangleLight {
    corner: Vec3,
    edges: [Vec3; 2],
    /// Geometric normal towards the front, of unit length.
    normal: Vec3,
    area: f32,
    /// Bound on how far the corners may be off, per axis.
    corner_error: Vec3,
}

impl TriangleLight {
    /// The triangle with these object-space corners under `to_world`. Its front is where they run
    /// counter-clockwise in object space, unless it is flipped.
    pub(crate) fn new(corners: [Vec3; 3], to_world: &Affine3A, flipped: bool) -> Self {
        let error = |p: Vec3| transform_error(to_world, p, Vec3::ZERO);
        let corner_error = error(corners[0]).max(error(corners[1])).max(error(corners[2]));
        let corners = corners.map(|p| to_world.transform_point3(p));
        let mirrored = to_world.matrix3.determinant() < 0.0;
        let edges = [corners[1] - corners[0], corners[2] - corners[0]];
        let cross = edges[0].cross(edges[1]);
        let normal = cross.normalize_or_zero() * if mirrored != flipped { -1.0 } else { 1.0 };
        Self { corner: corners[0], edges, normal, area: 0.5 * cross.length(), corner_error }
    }

    /// Where `emitter`, which has this geometry, shines to.
    pub(super) fn bounds<G>(&self, emitter: &Emitter<G>) -> LightBounds {
        let corners = [self.corner, self.corner + self.edges[0], self.corner + self.edges[1]];
        let bounds = Bounds {
            min: corners[0].min(corners[1]).min(corners[2]),
            max: corners[0].max(corners[1]).max(corners[2]),
        };
        LightBounds::surface(bounds, self.normal, 0.0, emitter.power(self.area), emitter.two_sided)
    }

    /// The point at `u`, and barycentric coordinates of the second and third corner.
    #[inline]
    pub(super) fn point(&self, u: Vec2) -> (Vec3, Vec2) {
        let b = warp::triangle(u);
        (self.corner + b.x * self.edges[0] + b.y * self.edges[1], b)
    }

    /// A point seen from `from`, and barycentric coordinates of the second and third corner.
    #[inline]
    pub(crate) fn sample(&self, from: Vec3, u: Vec2) -> Option<(AreaSample, Vec2)> {
        let (position, b) = self.point(u);
        let to_light = position - from;
        let distance2 = to_light.length_squared();
        let direction = to_light / distance2.sqrt();
        let cosine = -direction.dot(self.normal);
        let pdf = distance2 / (cosine.abs() * self.area);
        // Also turns away not-a-number: a point on the light itself.
        if !(cosine != 0.0 && pdf.is_finite()) {
            return None;
        }
        let corners = [self.corner, self.corner + self.edges[0], self.corner + self.edges[1]];
        let error = self.corner_error + point_error(corners, b.x, b.y);
        let target = Target { position, error, normal: self.normal };
        Some((AreaSample { target, direction, pdf, front: cosine > 0.0 }, b))
    }

    /// Density per steradian with which [`Self::sample`] chooses the point at `distance` along `direction`.
    #[inline]
    pub(crate) fn pdf(&self, direction: Vec3, distance: f32) -> f32 {
        let cosine = direction.dot(self.normal).abs();
        let pdf = distance * distance / (cosine * self.area);
        if cosine > 0.0 && pdf.is_finite() { pdf } else { 0.0 }
    }
}
