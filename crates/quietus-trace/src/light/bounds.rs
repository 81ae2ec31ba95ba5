//! What is known of a group of lights: where they are, where they shine to, how strong they are.
//!
//! Bounds after Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting",
//! sections 4.1 and 4.2; how cones are united and used after Pharr, Jakob and Humphreys 2023, "Physically Based
//! Rendering", 4th edition, sections 3.8.4 and 12.6.3.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Quat, Vec3};

use crate::bvh::Bounds;

/// A point, at a time, that wants to be lit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Receiver {
    pub(crate) position: Vec3,
    /// In 0..=1 of the shutter's time.
    pub(crate) time: f32,
    /// Shading normal, on the side the path came from; 0 inside a medium, which has none.
    normal: Vec3,
    /// What the cosine is multiplied by on the other side: 1, which changes nothing, where light from there is
    /// lost, and -1 where it may pass through.
    back: f32,
}

impl Receiver {
    /// A point of a surface; `transmits` says whether light from behind the surface can matter.
    #[inline(always)]
    pub(crate) fn surface(position: Vec3, time: f32, normal: Vec3, transmits: bool) -> Self {
        Self { position, time, normal, back: if transmits { -1.0 } else { 1.0 } }
    }

    /// A point between surfaces, for which light counts wherever it comes from.
    #[inline(always)]
    pub(crate) fn medium(position: Vec3, time: f32) -> Self {
        Self { position, time, normal: Vec3::ZERO, back: 1.0 }
    }

    /// The normal, and what the cosine is multiplied by on the other side; none inside a medium.
    #[inline(always)]
    pub(super) fn facing(&self) -> Option<(Vec3, f32)> {
        (self.normal != Vec3::ZERO).then_some((self.normal, self.back))
    }
}

/// Bounds of one light, or of several.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightBounds {
    pub(super) bounds: Bounds,
    /// Axis of the cone of directions that light is sent around, of unit length.
    pub(super) axis: Vec3,
    /// Half angle of the cone of the lights' own axes (surface normals).
    pub(super) theta_o: f32,
    /// Angle around their axes beyond which the lights send nothing.
    pub(super) theta_e: f32,
    /// Luminance of the power sent out.
    pub(super) power: f32,
    /// Whether light goes to the opposite directions too.
    pub(super) two_sided: bool,
}

impl LightBounds {
    /// Of a light that shines to all sides.
    pub(super) fn omnidirectional(bounds: Bounds, power: f32) -> Self {
        Self { bounds, axis: Vec3::Z, theta_o: PI, theta_e: FRAC_PI_2, power, two_sided: false }
    }

    /// Of a surface whose normals lie within `theta_o` of `axis` and that shines as Lambert has it.
    pub(super) fn surface(bounds: Bounds, axis: Vec3, theta_o: f32, power: f32, two_sided: bool) -> Self {
        if axis == Vec3::ZERO {
            return Self::omnidirectional(bounds, power);
        }
        Self { bounds, axis, theta_o, theta_e: FRAC_PI_2, power, two_sided }
    }

    /// Of the lights of both.
    pub(super) fn union(&self, other: &Self) -> Self {
        let bounds =
            Bounds { min: self.bounds.min.min(other.bounds.min), max: self.bounds.max.max(other.bounds.max) };
        let turned = self.two_sided && other.two_sided && self.axis.dot(other.axis) < 0.0;
        let other_axis = if turned { -other.axis } else { other.axis };
        let (axis, theta_o) = unite_cones((self.axis, self.theta_o), (other_axis, other.theta_o));
        Self {
            bounds,
            axis,
            theta_o,
            theta_e: self.theta_e.max(other.theta_e),
            power: self.power + other.power,
            two_sided: self.two_sided || other.two_sided,
        }
    }

    /// Of one light in two places at different times.
    pub(crate) fn snapshot(&self, other: &Self) -> Self {
        Self { power: self.power.max(other.power), ..self.union(other) }
    }

    /// Radiant intensity if the power were spread over the cone with the cosine by which it is bounded.
    pub(super) fn intensity(&self) -> f32 {
        self.power / self.cone_measure()
    }

    /// Half the diagonal, squared.
    pub(super) fn radius2(&self) -> f32 {
        0.25 * (self.bounds.max - self.bounds.min).length_squared()
    }

    pub(super) fn center(&self) -> Vec3 {
        0.5 * (self.bounds.min + self.bounds.max)
    }

    /// How much is lost by not looking closer: power over the cone times the size, the cost of Conty Estevez and
    /// Kulla (equation 1) with the square of the diagonal for the surface, which is 0 for points alone.
    pub(super) fn cost(&self) -> f32 {
        self.power * self.cone_measure() * self.radius2()
    }

    /// Integral over all directions of the cosine of the angle beyond the cone: their section 4.2.
    fn cone_measure(&self) -> f32 {
        let (o, w) = (self.theta_o, (self.theta_o + self.theta_e).min(PI));
        let full = 2.0 * PI * (1.0 - o.cos());
        let soft = FRAC_PI_2 * (2.0 * w * o.sin() - (o - 2.0 * w).cos() - 2.0 * o * o.sin() + o.cos());
        let sides = if self.two_sided { 2.0 } else { 1.0 };
        (sides * (full + soft)).clamp(1e-6, 4.0 * PI)
    }
}

/// The smallest cone around two (axis and half angle each).
fn unite_cones(a: (Vec3, f32), b: (Vec3, f32)) -> (Vec3, f32) {
    let apart = a.0.angle_between(b.0);
    if (apart + b.1).min(PI) <= a.1 {
        return a;
    }
    if (apart + a.1).min(PI) <= b.1 {
        return b;
    }
    let theta = 0.5 * (a.1 + apart + b.1);
    let pivot = a.0.cross(b.0).normalize_or_zero();
    if theta >= PI || pivot == Vec3::ZERO {
        return (Vec3::Z, PI);
    }
    ((Quat::from_axis_angle(pivot, theta - a.1) * a.0).normalize(), theta)
}
