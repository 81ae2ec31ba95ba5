//! Spheres that shine: directions uniform over the solid angle they fill.

use std::f32::consts::TAU;

use glam::{Affine3A, Vec2, Vec3, Vec3A};

use super::bounds::LightBounds;
use super::{AreaSample, Emitter, Target};
use crate::bvh::Bounds;
use crate::frame::Frame;
use crate::geometry::{sphere::point_error, transform_error};
use crate::warp;

/// An emissive sphere under an affine transform, which may make it an ellipsoid.
///
/// Directions are drawn in object space, where it is a sphere, and mapped to the world. An invertible linear map M
/// takes the solid angle `dw` around the unit direction d to `|det M| / |M d|^3 dw`, which is `dw` where M only
/// rotates and scales.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SphereLight {
    center: Vec3,
    radius: f32,
    to_world: Affine3A,
    to_object: Affine3A,
    /// `|det M|` of `to_world`.
    determinant: f32,
    /// Whether front and back are exchanged.
    flipped: bool,
}

impl SphereLight {
    /// The sphere around `center` in object space; `to_world` is invertible.
    pub(crate) fn new(center: Vec3, radius: f32, to_world: Affine3A, flipped: bool) -> Self {
        let determinant = to_world.matrix3.determinant().abs();
        Self { center, radius, to_world, to_object: to_world.inverse(), determinant, flipped }
    }

    /// In square metres; approximate (1 %) where the transform makes it an ellipsoid.
    fn area(&self) -> f32 {
        // Knud Thomsen's formula wants half axes; the lengths of the columns stand for them.
        let axes = [self.to_world.matrix3.x_axis, self.to_world.matrix3.y_axis, self.to_world.matrix3.z_axis];
        let [a, b, c] = axes.map(|axis| (self.radius * axis.length()).powf(1.6075));
        2.0 * TAU * ((a * b + b * c + c * a) / 3.0).powf(1.0 / 1.6075)
    }

    /// Where `emitter`, which has this geometry, shines to.
    pub(super) fn bounds<G>(&self, emitter: &Emitter<G>) -> LightBounds {
        let m = self.to_world.matrix3;
        let rows = m.transpose();
        let half = self.radius * Vec3::new(rows.x_axis.length(), rows.y_axis.length(), rows.z_axis.length());
        let center = self.to_world.transform_point3(self.center);
        let bounds = Bounds { min: center - half, max: center + half };
        // Its inner side, if it shines, is seen from within alone.
        LightBounds::omnidirectional(bounds, emitter.power(self.area()))
    }

    /// `1 - cos` of the half angle under which `from`, in object space, sees the sphere: 2, everything, inside.
    #[inline]
    fn one_minus_cos(&self, from: Vec3) -> f32 {
        let sin2 = self.radius * self.radius / (self.center - from).length_squared();
        if sin2 < INSIDE { sin2 / (1.0 + (1.0 - sin2).sqrt()) } else { 2.0 }
    }

    /// The point at `u`, evenly spread unless the transform stretches it.
    pub(super) fn point(&self, u: Vec2) -> Vec3 {
        self.to_world.transform_point3(self.center + self.radius * warp::uniform_sphere(u))
    }

    /// A point seen from `from`.
    #[inline]
    pub(crate) fn sample(&self, from: Vec3, u: Vec2) -> Option<AreaSample> {
        let from = self.to_object.transform_point3(from);
        let to_center = self.center - from;
        let center_distance = to_center.length();
        let one_minus_cos = self.one_minus_cos(from);
        let frame =
            Frame::from_normal(if center_distance > 0.0 { to_center / center_distance } else { Vec3::Z });
        let local = warp::uniform_cone(u, one_minus_cos);
        let object_direction = frame.to_world(local);
        let reach = self.radius * self.radius - center_distance * center_distance * (1.0 - local.z * local.z);
        let half_chord = reach.max(0.0).sqrt();
        let along = center_distance * local.z;
        let outside = center_distance > self.radius;
        let distance = if outside { along - half_chord } else { along + half_chord };
        if distance <= 0.0 {
            return None;
        }
        let outward = (from + distance * object_direction - self.center).normalize();
        let object_position = self.center + self.radius * outward;
        let mapped = self.to_world.transform_vector3(object_direction);
        let stretch = mapped.length();
        let pdf = stretch * stretch * stretch / (self.determinant * TAU * one_minus_cos);
        let error = transform_error(
            &self.to_world,
            object_position,
            point_error(object_position, self.center, self.radius),
        );
        let normal = (self.to_object.matrix3.transpose() * Vec3A::from(outward)).normalize().into();
        let position = self.to_world.transform_point3(object_position);
        let target = Target { position, error, normal };
        Some(AreaSample { target, direction: mapped / stretch, pdf, front: outside != self.flipped })
    }

    /// Density per steradian with which [`Self::sample`] chooses `direction`, one that hits the sphere.
    #[inline]
    pub(crate) fn pdf(&self, from: Vec3, direction: Vec3) -> f32 {
        let one_minus_cos = self.one_minus_cos(self.to_object.transform_point3(from));
        let shrink = self.to_object.transform_vector3(direction).length();
        1.0 / (shrink * shrink * shrink * self.determinant * TAU * one_minus_cos)
    }
}

/// Squared sine of the half angle above which a point counts as inside: so near to the surface the cone's
/// boundary is no longer known in f32, and the whole sphere of directions is the safe choice.
const INSIDE: f32 = 1.0 - 1e-5;
