//! How things move while the shutter is open.
//!
//! A transform at each end of the shutter's time becomes a rigid and a stretching part by polar decomposition
//! (Shoemake and Duff 1992, "Matrix Animation and Polar Decomposition"): the rotation follows the shortest arc at
//! constant speed (Shoemake 1985, "Animating Rotation with Quaternion Curves"), translation and stretch change
//! linearly.

use glam::{Affine3A, DMat3, DQuat, DVec3, Mat3A, Quat, Vec3, Vec3A};

use crate::bvh::Bounds;

/// A transform that changes with time.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    /// Rotation at time 0.
    rotation: Quat,
    /// Of the further rotation, of unit length.
    axis: Vec3,
    /// Of the further rotation until time 1, in 0..=pi.
    angle: f32,
    /// Scale and shear at time 0, and what is added until time 1; negative where the transform mirrors.
    stretch: [Mat3A; 2],
    /// Translation at time 0, and what is added until time 1.
    translation: [Vec3A; 2],
}

/// Less of a turn, in radians, counts as none: below what an f32 rotation resolves.
const NO_TURN: f64 = 1e-8;

impl Motion {
    /// The motion from `start` at time 0 to `end` at time 1; none unless both can be inverted and either both or
    /// neither mirror: anything in between would pass through flatness.
    pub fn new(start: &Affine3A, end: &Affine3A) -> Option<Self> {
        let (rotation, stretch) = polar(&start.matrix3)?;
        let (end_rotation, end_stretch) = polar(&end.matrix3)?;
        if (start.matrix3.determinant() < 0.0) != (end.matrix3.determinant() < 0.0) {
            return None;
        }
        let turn = end_rotation * rotation.conjugate();
        // Quaternions of opposite sign are the same rotation; of the two ways, the one of at most half a turn.
        let turn = if turn.w < 0.0 { -turn } else { turn };
        let sine = DVec3::new(turn.x, turn.y, turn.z).length();
        let angle = 2.0 * sine.atan2(turn.w);
        let axis = DVec3::new(turn.x, turn.y, turn.z).try_normalize().unwrap_or(DVec3::Z);
        let finite = start.is_finite() && end.is_finite();
        finite.then_some(Self {
            rotation: rotation.as_quat(),
            axis: axis.as_vec3(),
            angle: if angle < NO_TURN { 0.0 } else { angle as f32 },
            stretch: [single(&stretch), single(&(end_stretch - stretch))],
            translation: [start.translation, end.translation - start.translation],
        })
    }

    /// The transform at `time`, in 0..=1.
    pub fn at(&self, time: f32) -> Affine3A {
        let rotation = if self.angle == 0.0 {
            self.rotation
        } else {
            Quat::from_axis_angle(self.axis, self.angle * time) * self.rotation
        };
        let stretch = self.stretch[0] + self.stretch[1] * time;
        Affine3A {
            matrix3: Mat3A::from_quat(rotation) * stretch,
            translation: self.translation[0] + self.translation[1] * time,
        }
    }

    /// Bounds of everything that `bounds` sweeps over from time 0 to 1.
    ///
    /// The time is cut into pieces. Over a piece of length h a point strays from the straight line between its two
    /// places by at most `h^2 / 8` times its greatest acceleration. A point `q` that is stretched at the speed `q'`
    /// while it turns by `angle` per unit of time is accelerated by at most `angle^2 |q| + 2 angle |q'|`.
    pub fn bounds(&self, bounds: &Bounds) -> Bounds {
        if bounds.is_empty() {
            return *bounds;
        }
        let corners = [0, 1, 2, 3, 4, 5, 6, 7].map(|i| {
            let pick = |axis: usize| if i >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] };
            Vec3A::new(pick(0), pick(1), pick(2))
        });
        let reach = |m: Mat3A| corners.iter().map(|&c| (m * c).length()).fold(0.0, f32::max);
        let radius = reach(self.stretch[0]).max(reach(self.stretch[0] + self.stretch[1]));
        let acceleration = self.angle * (self.angle * radius + 2.0 * reach(self.stretch[1]));
        // A piece for each 10 degrees or so strays by half a percent of the radius.
        let pieces = 1 + (6.0 * self.angle) as u32;
        let step = 1.0 / pieces as f32;
        // Rounded up by far more than f32 arithmetic is off.
        let stray = 1.001 * 0.125 * step * step * acceleration;
        let swept = (0..=pieces)
            .map(|i| bounds.transformed(&self.at((i as f32 * step).min(1.0))))
            .fold(Bounds::EMPTY, Bounds::union);
        Bounds { min: swept.min - stray, max: swept.max + stray }
    }
}

/// An f64 matrix in f32.
fn single(m: &DMat3) -> Mat3A {
    Mat3A::from_cols(m.x_axis.as_vec3().into(), m.y_axis.as_vec3().into(), m.z_axis.as_vec3().into())
}

/// Rotation and symmetric stretch whose product is `m`; the stretch is negative definite where `m` mirrors. None
/// where `m` cannot be inverted.
///
/// Newton's iteration of Higham 1986, "Computing the Polar Decomposition - with Applications", scaled as there
/// (equation 3.8, by determinants) so that it converges from anywhere in a handful of steps.
fn polar(m: &Mat3A) -> Option<(DQuat, DMat3)> {
    /// More than enough: the scaled iteration needs about ten even for condition numbers of 1e16.
    const STEPS: u32 = 40;
    let m = DMat3::from_cols(m.x_axis.as_dvec3(), m.y_axis.as_dvec3(), m.z_axis.as_dvec3());
    let sign = if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    let mut orthogonal = m * sign;
    for _ in 0..STEPS {
        let determinant = orthogonal.determinant();
        if !(determinant > 0.0 && determinant.is_finite()) {
            return None;
        }
        let scaled = orthogonal * determinant.cbrt().recip();
        let next = (scaled + scaled.inverse().transpose()) * 0.5;
        let change = (next - orthogonal).to_cols_array().into_iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        orthogonal = next;
        if change < 1e-15 {
            break;
        }
    }
    let stretch = orthogonal.transpose() * m;
    let symmetric = (stretch + stretch.transpose()) * 0.5;
    (orthogonal.is_finite() && symmetric.is_finite())
        .then(|| (DQuat::from_mat3(&orthogonal).normalize(), symmetric))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Rng;

    fn turned(rng: &mut Rng, scale: Vec3) -> Affine3A {
        let rotation = Quat::from_axis_angle(rng.next_direction(), 6.0 * rng.next_1d());
        Affine3A::from_scale_rotation_translation(scale, rotation, 3.0 * rng.next_direction())
    }

    /// Of any matrix, sheared and mirrored ones among them.
    fn some_transform(rng: &mut Rng) -> Affine3A {
        let shear = turned(rng, Vec3::new(0.5, 1.5, 2.0));
        turned(rng, Vec3::new(1.0, 3.0, 0.7)) * shear
    }

    #[test]
    fn motions_start_and_end_where_they_are_told() {
        let mut rng = Rng::new(1);
        for i in 0..500 {
            let mirror = if i % 2 == 0 { Vec3::ONE } else { Vec3::new(1.0, -1.0, 1.0) };
            let [start, end] = [0; 2].map(|_| some_transform(&mut rng) * Affine3A::from_scale(mirror));
            let motion = Motion::new(&start, &end).expect("invertible");
            // Entries are below 10, through a dozen f32 products.
            assert!(motion.at(0.0).abs_diff_eq(start, 2e-5), "{start:?} {:?}", motion.at(0.0));
            assert!(motion.at(1.0).abs_diff_eq(end, 2e-5), "{end:?} {:?}", motion.at(1.0));
        }
    }

    /// Half a motion of scale, rotation and translation is half of each.
    #[test]
    fn rotations_follow_the_arc() {
        let mut rng = Rng::new(2);
        for _ in 0..200 {
            let axis = rng.next_direction();
            let angle = 3.1 * rng.next_1d();
            let scales = [0; 2].map(|_| Vec3::new(rng.next_1d(), rng.next_1d(), rng.next_1d()) + 0.1);
            let first = Quat::from_axis_angle(rng.next_direction(), 1.0);
            let place = |t: f32| {
                let rotation = Quat::from_axis_angle(axis, angle * t) * first;
                let scale = scales[0].lerp(scales[1], t);
                Affine3A::from_scale_rotation_translation(scale, rotation, Vec3::new(t, 2.0 * t, 1.0))
            };
            let motion = Motion::new(&place(0.0), &place(1.0)).expect("invertible");
            for t in [0.0, 0.25, 0.5, 0.9, 1.0] {
                assert!(motion.at(t).abs_diff_eq(place(t), 1e-5), "{angle} {t}");
            }
        }
    }

    #[test]
    fn bounds_hold_everything_on_the_way() {
        let mut rng = Rng::new(3);
        for _ in 0..300 {
            let [start, end] = [0; 2].map(|_| some_transform(&mut rng));
            let motion = Motion::new(&start, &end).expect("invertible");
            let corner = 4.0 * rng.next_direction();
            let bounds = Bounds { min: corner, max: corner + rng.next_direction().abs() };
            let swept = motion.bounds(&bounds);
            for i in 0..=1000 {
                let transform = motion.at(i as f32 / 1000.0);
                for b in 0..8 {
                    let pick =
                        |axis: usize| if b >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] };
                    let p = transform.transform_point3(Vec3::new(pick(0), pick(1), pick(2)));
                    assert!(p.cmpge(swept.min).all() && p.cmple(swept.max).all(), "{p} {swept:?}");
                }
            }
        }
    }

    #[test]
    fn impossible_motions_are_refused() {
        let mirrored = Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
        let flat = Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0));
        let broken = Affine3A::from_translation(Vec3::NAN);
        let sound = Affine3A::IDENTITY;
        assert!(Motion::new(&mirrored, &mirrored).is_some());
        for (start, end) in
            [(mirrored, sound), (sound, flat), (flat, sound), (broken, sound), (sound, broken)]
        {
            assert!(Motion::new(&start, &end).is_none());
        }
    }
}
