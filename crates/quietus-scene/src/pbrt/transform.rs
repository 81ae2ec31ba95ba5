//! Transforms that move: one for the start and one for the end of motion.

use glam::{Affine3A, DAffine3, DMat3, DQuat, DVec3};

/// Where something is when motion starts and when it ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Moving(pub [DAffine3; 2]);

impl Moving {
    /// At the origin, still.
    pub(super) const IDENTITY: Self = Self([DAffine3::IDENTITY; 2]);

    /// The same at both times.
    pub(super) const fn still(transform: DAffine3) -> Self {
        Self([transform; 2])
    }

    /// Whether both times are the same.
    pub(super) fn is_still(&self) -> bool {
        self.0[0] == self.0[1]
    }

    /// `other` first, then this.
    pub(super) fn after(self, other: Self) -> Self {
        Self([self.0[0] * other.0[0], self.0[1] * other.0[1]])
    }

    /// The way back.
    pub(super) fn inverse(self) -> Self {
        Self(self.0.map(|transform| transform.inverse()))
    }

    /// The part of the motion between `from` and `to`, 0 being its start and 1 its end. Before and after, things
    /// stand still.
    pub(super) fn between(self, from: f64, to: f64) -> Self {
        if self.is_still() {
            return self;
        }
        let ends = self.0.map(Parts::of);
        Self([from, to].map(|time| match time.clamp(0.0, 1.0) {
            0.0 => self.0[0],
            1.0 => self.0[1],
            time => ends[0].mix(&ends[1], time).joined(),
        }))
    }
}

/// Translation, rotation and what is left, as in pbrt-v4: a polar decomposition (Shoemake and Duff 1992, "Matrix
/// animation and polar decomposition").
#[derive(Clone, Copy, Debug)]
pub(super) struct Parts {
    translation: DVec3,
    pub rotation: DQuat,
    /// Stretches and mirrors, before the rotation.
    pub scale: DMat3,
}

impl Parts {
    /// Takes `transform` apart.
    pub(super) fn of(transform: DAffine3) -> Self {
        let matrix = transform.matrix3;
        let mut rotation = matrix;
        for _ in 0..100 {
            let next = 0.5 * (rotation + rotation.transpose().inverse());
            let change = (next - rotation).to_cols_array().iter().fold(0.0, |most: f64, c| most.max(c.abs()));
            rotation = next;
            if !change.is_finite() || change < 1e-12 {
                break;
            }
        }
        // A mirror is no rotation; it belongs to the scale.
        if rotation.determinant() < 0.0 {
            rotation = -rotation;
        }
        let quaternion = DQuat::from_mat3(&rotation).normalize();
        Self {
            translation: transform.translation,
            rotation: quaternion,
            scale: DMat3::from_quat(quaternion).transpose() * matrix,
        }
    }

    fn mix(&self, other: &Self, t: f64) -> Self {
        Self {
            translation: self.translation.lerp(other.translation, t),
            rotation: self.rotation.slerp(other.rotation, t),
            scale: self.scale * (1.0 - t) + other.scale * t,
        }
    }

    fn joined(&self) -> DAffine3 {
        DAffine3::from_mat3_translation(DMat3::from_quat(self.rotation) * self.scale, self.translation)
    }
}

/// The factor by which `transform` scales all lengths, if there is one: it may turn and mirror besides.
pub(super) fn uniform_scale(transform: &DAffine3) -> Option<f64> {
    /// What is left of exactness after transforms in text with seven digits.
    const TOLERANCE: f64 = 1e-5;
    let matrix = transform.matrix3;
    let scale = matrix.determinant().abs().cbrt();
    let off = matrix.transpose() * matrix - DMat3::from_diagonal(DVec3::splat(scale * scale));
    let off = off.to_cols_array().iter().fold(0.0, |most: f64, entry| most.max(entry.abs()));
    (scale > 0.0 && off <= TOLERANCE * scale * scale).then_some(scale)
}

/// Whether `transform` mirrors.
pub(super) fn mirrors(transform: &DAffine3) -> bool {
    transform.matrix3.determinant() < 0.0
}

/// In single precision.
pub(super) fn single(transform: DAffine3) -> Affine3A {
    let [x, y, z] = [transform.matrix3.x_axis, transform.matrix3.y_axis, transform.matrix3.z_axis];
    Affine3A::from_cols(x.as_vec3a(), y.as_vec3a(), z.as_vec3a(), transform.translation.as_vec3a())
}

/// From the world to the left-handed space of an eye that looks along +z; `None` where that is undefined.
pub(super) fn look_at(eye: DVec3, target: DVec3, up: DVec3) -> Option<DAffine3> {
    let forward = (target - eye).try_normalize()?;
    let right = up.try_normalize()?.cross(forward).try_normalize()?;
    let axes = DMat3::from_cols(right, forward.cross(right), forward);
    Some(DAffine3::from_mat3_translation(axes, eye).inverse())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: DAffine3, b: DAffine3) -> bool {
        a.abs_diff_eq(b, 1e-9)
    }

    #[test]
    fn looking_is_left_handed() {
        let view = look_at(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y).expect("defined");
        assert!((view.transform_point3(DVec3::ZERO) - DVec3::new(0.0, 0.0, 5.0)).length() < 1e-12);
        // With the eye on +z and y up, the world's +x is on the left.
        assert!(view.transform_vector3(DVec3::X).x < 0.0);
        assert!(look_at(DVec3::ZERO, DVec3::ZERO, DVec3::Y).is_none());
        assert!(look_at(DVec3::ZERO, DVec3::Y, DVec3::Y).is_none());
    }

    #[test]
    fn half_of_a_turn_is_half_the_angle() {
        let turn = |angle: f64| DAffine3::from_axis_angle(DVec3::Y, angle);
        let scale = |s: f64| DAffine3::from_scale(DVec3::splat(s));
        let moving = Moving([turn(0.2) * scale(2.0), turn(1.2) * scale(4.0)]);
        let Moving([start, middle]) = moving.between(0.0, 0.5);
        assert!(close(start, moving.0[0]));
        assert!(close(middle, turn(0.7) * scale(3.0)));
        assert!(close(moving.between(-3.0, 7.0).0[1], moving.0[1]));
    }

    #[test]
    fn mirrors_survive_being_taken_apart() {
        let mirror = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 2.0)) * DAffine3::from_rotation_x(0.3);
        assert!(close(Parts::of(mirror).joined(), mirror));
        assert!(mirrors(&mirror));
    }

    #[test]
    fn uniform_scales_are_recognised() {
        let similar = DAffine3::from_axis_angle(DVec3::ONE.normalize(), 1.0)
            * DAffine3::from_scale(DVec3::new(-3.0, 3.0, 3.0));
        assert!(uniform_scale(&similar).is_some_and(|scale| (scale - 3.0).abs() < 1e-9));
        assert_eq!(uniform_scale(&DAffine3::from_scale(DVec3::new(1.0, 1.0, 1.1))), None);
        assert_eq!(uniform_scale(&DAffine3::from_scale(DVec3::ZERO)), None);
    }
}
