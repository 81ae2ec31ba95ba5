//! Quadrics and bilinear patches that shine: points are chosen over their parameters.

use glam::{Affine3A, Vec2, Vec3, Vec3A};

use super::bounds::LightBounds;
use super::{AreaSample, Emitter, Target};
use crate::bvh::Bounds;
use crate::desc::Quadric;
use crate::geometry::patch::point_error;
use crate::geometry::{gamma, transform_error};

/// Points per axis at which an area or a cone of normals is looked at.
const PROBES: u32 = 4;

/// A part of a sphere, disk or cylinder under an affine transform: uniform over its area in object space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct QuadricLight {
    quadric: Quadric,
    to_world: Affine3A,
    to_object: Affine3A,
    /// `|det M|` of `to_world`.
    determinant: f32,
    /// -1 where front and back are exchanged, else 1.
    side: f32,
    /// Area in object space.
    object_area: f32,
}

/// A point in object space with the normal there.
struct Point {
    position: Vec3,
    normal: Vec3,
}

impl QuadricLight {
    /// `quadric` under an invertible transform.
    pub(crate) fn new(quadric: Quadric, to_world: Affine3A, flipped: bool) -> Self {
        let object_area = match quadric {
            Quadric::Disk { radius, inner_radius, phi_max, .. } => {
                0.5 * phi_max * (radius * radius - inner_radius * inner_radius)
            }
            Quadric::PartialSphere { radius, z_min, z_max, phi_max }
            | Quadric::Cylinder { radius, z_min, z_max, phi_max } => radius * phi_max * (z_max - z_min),
        };
        Self {
            quadric,
            to_world,
            to_object: to_world.inverse(),
            determinant: to_world.matrix3.determinant().abs(),
            side: if flipped { -1.0 } else { 1.0 },
            object_area,
        }
    }

    /// The point at `u`; equal areas of the unit square are equal areas of the quadric.
    #[inline]
    fn point(&self, u: Vec2) -> Point {
        match self.quadric {
            Quadric::PartialSphere { radius, z_min, z_max, phi_max } => {
                let z = z_min + u.y * (z_max - z_min);
                let ring = (radius * radius - z * z).max(0.0).sqrt();
                let (sin, cos) = (u.x * phi_max).sin_cos();
                let position = Vec3::new(ring * cos, ring * sin, z);
                Point { position, normal: position / radius }
            }
            Quadric::Disk { height, radius, inner_radius, phi_max } => {
                let inner2 = inner_radius * inner_radius;
                let ring = (inner2 + u.y * (radius * radius - inner2)).sqrt();
                let (sin, cos) = (u.x * phi_max).sin_cos();
                Point { position: Vec3::new(ring * cos, ring * sin, height), normal: Vec3::Z }
            }
            Quadric::Cylinder { radius, z_min, z_max, phi_max } => {
                let (sin, cos) = (u.x * phi_max).sin_cos();
                let z = z_min + u.y * (z_max - z_min);
                let normal = Vec3::new(cos, sin, 0.0);
                Point { position: (radius * normal).with_z(z), normal }
            }
        }
    }

    /// The normal in the world, not of unit length: its length times `|det M|` is how much the transform stretches
    /// the area there.
    #[inline]
    fn world_normal(&self, normal: Vec3) -> Vec3 {
        Vec3::from(self.to_object.matrix3.transpose() * Vec3A::from(normal))
    }

    /// A point on it, and the density over its area in the world.
    #[inline]
    fn sample(&self, u: Vec2) -> (Target, f32) {
        let Point { position, normal } = self.point(u);
        let normal = self.world_normal(normal);
        let length = normal.length();
        let rounding = gamma(8) * (position.abs() + position.abs().max_element());
        let target = Target {
            position: self.to_world.transform_point3(position),
            error: transform_error(&self.to_world, position, rounding),
            normal: normal * (self.side / length),
        };
        (target, 1.0 / (self.object_area * self.determinant * length))
    }

    /// Density over the area in the world with which [`Self::sample`] chooses a point with this normal.
    #[inline]
    fn density(&self, normal: Vec3) -> f32 {
        let shrink = Vec3::from(self.to_world.matrix3.transpose() * Vec3A::from(normal)).length();
        shrink / (self.object_area * self.determinant)
    }

    /// In the world; exact where the transform scales evenly or the quadric is flat.
    fn area(&self) -> f32 {
        let stretch = |u| self.world_normal(self.point(u).normal).length() * self.determinant;
        self.object_area * probes().map(stretch).sum::<f32>() / (PROBES * PROBES) as f32
    }

    fn bounds(&self) -> (Bounds, Vec3, f32) {
        let (radius, low, high) = match self.quadric {
            Quadric::PartialSphere { radius, z_min, z_max, .. }
            | Quadric::Cylinder { radius, z_min, z_max, .. } => (radius, z_min, z_max),
            Quadric::Disk { radius, height, .. } => (radius, height, height),
        };
        let m = self.to_world.matrix3.transpose();
        let box_half = Vec3A::new(radius, radius, 0.5 * (high - low));
        let half = [m.x_axis, m.y_axis, m.z_axis].map(|row| row.abs().dot(box_half));
        let center = self.to_world.transform_point3(Vec3::new(0.0, 0.0, 0.5 * (low + high)));
        let bounds = Bounds { min: center - Vec3::from(half), max: center + Vec3::from(half) };
        let axis = self.side * self.world_normal(Vec3::Z).normalize_or(Vec3::Z);
        let flat = matches!(self.quadric, Quadric::Disk { .. });
        (bounds, axis, if flat { 0.0 } else { std::f32::consts::PI })
    }
}

/// A bilinear patch in the world, `p(u, v)`: uniform over its parameters, and so over its area where it is a
/// parallelogram.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PatchLight {
    /// p(0, 0), p(1, 0), p(0, 1), p(1, 1).
    corners: [Vec3; 4],
    /// -1 where `dp/du x dp/dv` points to the back, else 1.
    side: f32,
    /// Bound on how far the corners may be off, per axis.
    error: Vec3,
}

impl PatchLight {
    /// The patch with these corners in object space.
    pub(crate) fn new(corners: [Vec3; 4], to_world: &Affine3A, flipped: bool) -> Self {
        let mirrored = to_world.matrix3.determinant() < 0.0;
        let error = corners.map(|p| transform_error(to_world, p, Vec3::ZERO));
        Self {
            corners: corners.map(|p| to_world.transform_point3(p)),
            side: if mirrored == flipped { 1.0 } else { -1.0 },
            error: error[0].max(error[1]).max(error[2].max(error[3])),
        }
    }

    /// `dp/du x dp/dv`.
    #[inline]
    fn cross(&self, at: Vec2) -> Vec3 {
        let [p00, p10, p01, p11] = self.corners;
        (p10 - p00).lerp(p11 - p01, at.y).cross((p01 - p00).lerp(p11 - p10, at.x))
    }

    #[inline]
    fn sample(&self, u: Vec2) -> (Target, f32) {
        let [p00, p10, p01, p11] = self.corners;
        let position = p00.lerp(p10, u.x).lerp(p01.lerp(p11, u.x), u.y);
        let cross = self.cross(u);
        let length = cross.length();
        let error = self.error + point_error(&self.corners);
        (Target { position, error, normal: cross * (self.side / length) }, 1.0 / length)
    }

    fn area(&self) -> f32 {
        probes().map(|at| self.cross(at).length()).sum::<f32>() / (PROBES * PROBES) as f32
    }

    /// `dp/du x dp/dv` is a blend of its values at the corners, so a cone around those holds all normals.
    fn bounds(&self) -> (Bounds, Vec3, f32) {
        let [a, b, c, d] = self.corners;
        let bounds = Bounds { min: a.min(b).min(c.min(d)), max: a.max(b).max(c.max(d)) };
        let normals = [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE].map(|at| self.side * self.cross(at));
        let axis = normals.iter().map(|n| n.normalize_or_zero()).sum::<Vec3>().normalize_or_zero();
        let angle = |n: &Vec3| if *n == Vec3::ZERO { 0.0 } else { axis.angle_between(*n) };
        (bounds, axis, normals.iter().map(angle).fold(0.0, f32::max))
    }
}

/// An emissive surface that is neither triangle nor whole sphere.
#[derive(Clone, Copy, Debug)]
pub(crate) enum SurfaceLight {
    Quadric(QuadricLight),
    Patch(PatchLight),
}

impl SurfaceLight {
    /// Where `emitter`, which has this geometry, shines to.
    pub(super) fn bounds<G>(&self, emitter: &Emitter<G>) -> LightBounds {
        let ((bounds, axis, theta_o), area) = match self {
            Self::Quadric(quadric) => (quadric.bounds(), quadric.area()),
            Self::Patch(patch) => (patch.bounds(), patch.area()),
        };
        LightBounds::surface(bounds, axis, theta_o, emitter.power(area), emitter.two_sided)
    }

    /// The point at `u`.
    pub(super) fn point(&self, u: Vec2) -> Vec3 {
        match self {
            Self::Quadric(quadric) => quadric.sample(u).0.position,
            Self::Patch(patch) => patch.sample(u).0.position,
        }
    }

    /// A point seen from `from`.
    #[inline]
    pub(crate) fn sample(&self, from: Vec3, u: Vec2) -> Option<AreaSample> {
        let (target, density) = match self {
            Self::Quadric(quadric) => quadric.sample(u),
            Self::Patch(patch) => patch.sample(u),
        };
        let to_light = target.position - from;
        let distance2 = to_light.length_squared();
        let direction = to_light / distance2.sqrt();
        let cosine = -direction.dot(target.normal);
        let pdf = density * distance2 / cosine.abs();
        // Also turns away not-a-number: a point on the light itself, or where it has no extent.
        let sound = cosine != 0.0 && pdf.is_finite();
        sound.then_some(AreaSample { target, direction, pdf, front: cosine > 0.0 })
    }

    /// Density per steradian with which [`Self::sample`] chooses the point at `distance` along `direction`, where
    /// the surface has this normal and, if it is a patch, these parameters.
    #[inline]
    pub(crate) fn pdf(&self, direction: Vec3, distance: f32, normal: Vec3, at: Vec2) -> f32 {
        let density = match self {
            Self::Quadric(quadric) => quadric.density(normal),
            Self::Patch(patch) => 1.0 / patch.cross(at).length(),
        };
        let pdf = density * distance * distance / direction.dot(normal).abs();
        if pdf.is_finite() { pdf } else { 0.0 }
    }
}

/// The middles of the cells of a grid over the unit square.
fn probes() -> impl Iterator<Item = Vec2> {
    let place = |i: u32| (i as f32 + 0.5) / PROBES as f32;
    (0..PROBES * PROBES).map(move |i| Vec2::new(place(i % PROBES), place(i / PROBES)))
}
