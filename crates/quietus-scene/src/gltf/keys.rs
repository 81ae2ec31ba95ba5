//! Keyframes, and what is between them (specification, appendix C).
//!
//! Every interpolation is a weighted sum of a few stored elements; only the weights differ.

use glam::{Quat, Vec4};

/// How values between keys are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Interpolation {
    /// The value of the key before.
    Step,
    /// Straight lines.
    Linear,
    /// Great arcs between unit quaternions.
    Spherical,
    /// Cubic Hermite splines: each key has an incoming tangent, a value and an outgoing tangent.
    Cubic,
}

impl Interpolation {
    /// Elements stored per key.
    pub(super) fn elements(self) -> usize {
        if self == Self::Cubic { 3 } else { 1 }
    }
}

/// A value that changes with time.
#[derive(Clone, Debug)]
pub(super) struct Keys {
    times: Vec<f32>,
    values: Vec<f32>,
    width: usize,
    interpolation: Interpolation,
}

impl Keys {
    /// Keys at `times`, which are finite, do not decrease, and are at least one, with elements of `width` numbers one after
    /// the other in `values`: per key, and as many as the interpolation wants.
    pub(super) fn new(times: Vec<f32>, values: Vec<f32>, width: usize, interpolation: Interpolation) -> Self {
        debug_assert_eq!(values.len(), times.len() * interpolation.elements() * width);
        Self { times, values, width, interpolation }
    }

    /// Time of the last key, in seconds.
    pub(super) fn end(&self) -> f32 {
        *self.times.last().unwrap_or(&0.0)
    }

    /// The value at `time`, in seconds; before the first key its value, behind the last one that one's.
    pub(super) fn at(&self, time: f32) -> Vec<f32> {
        let mut sum = vec![0.0; self.width];
        for (element, weight) in self.terms(time) {
            // A tangent at a key itself has no weight, and may be anything.
            if weight != 0.0 {
                sum.iter_mut().zip(element).for_each(|(sum, value)| *sum += weight * value);
            }
        }
        sum
    }

    /// As [`Self::at`] for three numbers.
    pub(super) fn vector(&self, time: f32) -> [f32; 3] {
        let value = self.at(time);
        std::array::from_fn(|i| value[i])
    }

    /// As [`Self::at`] for a quaternion, brought to unit length; the key before where splines meet at 0.
    pub(super) fn rotation(&self, time: f32) -> Quat {
        let value = Vec4::from_slice(&self.at(time));
        let unit = value.try_normalize().unwrap_or_else(|| {
            let key = self.times.partition_point(|&key| key <= time).saturating_sub(1);
            Vec4::from_slice(self.value(key)).normalize_or(Vec4::W)
        });
        Quat::from_vec4(unit)
    }

    /// Elements and the weights of their sum.
    fn terms(&self, time: f32) -> [(&[f32], f32); 4] {
        let after = self.times.partition_point(|&key| key <= time);
        let none = (&[][..], 0.0);
        if after == 0 || after == self.times.len() {
            return [(self.value(after.saturating_sub(1)), 1.0), none, none, none];
        }
        let (a, b) = (after - 1, after);
        let step = self.times[b] - self.times[a];
        let t = (time - self.times[a]) / step;
        let (start, end) = (self.value(a), self.value(b));
        match self.interpolation {
            Interpolation::Step => [(start, 1.0), none, none, none],
            Interpolation::Linear => [(start, 1.0 - t), (end, t), none, none],
            Interpolation::Spherical => {
                let [w0, w1] = slerp_weights(start, end, t);
                [(start, w0), (end, w1), none, none]
            }
            Interpolation::Cubic => {
                let (t2, t3) = (t * t, t * t * t);
                let (leaving, arriving) = (self.element(3 * a + 2), self.element(3 * b));
                [
                    (start, 2.0 * t3 - 3.0 * t2 + 1.0),
                    (leaving, step * (t3 - 2.0 * t2 + t)),
                    (end, -2.0 * t3 + 3.0 * t2),
                    (arriving, step * (t3 - t2)),
                ]
            }
        }
    }

    /// The value of key `key`.
    fn value(&self, key: usize) -> &[f32] {
        match self.interpolation {
            Interpolation::Cubic => self.element(3 * key + 1),
            _ => self.element(key),
        }
    }

    fn element(&self, index: usize) -> &[f32] {
        &self.values[index * self.width..(index + 1) * self.width]
    }
}

/// Weights of two unit quaternions on the shorter arc between them (Shoemake 1985); those of a straight line where
/// they are so close that the arc is one to within rounding.
fn slerp_weights(a: &[f32], b: &[f32], t: f32) -> [f32; 2] {
    let dot: f32 = a.iter().zip(b).map(|(a, b)| a * b).sum();
    let (cosine, sign) = (dot.abs().min(1.0), if dot < 0.0 { -1.0 } else { 1.0 });
    let angle = cosine.acos();
    let sine = angle.sin();
    if sine < 1e-4 {
        return [1.0 - t, sign * t];
    }
    [((1.0 - t) * angle).sin() / sine, sign * (t * angle).sin() / sine]
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;

    use super::*;

    fn keys(interpolation: Interpolation, width: usize, values: &[f32]) -> Keys {
        let count = values.len() / width / interpolation.elements();
        Keys::new((0..count).map(|i| 1.0 + i as f32).collect(), values.to_vec(), width, interpolation)
    }

    #[test]
    fn steps_and_lines() {
        let values = [1.0, 10.0, 3.0, 30.0];
        let step = keys(Interpolation::Step, 2, &values);
        let line = keys(Interpolation::Linear, 2, &values);
        for (time, stepped, straight) in [
            (0.0, [1.0, 10.0], [1.0, 10.0]),
            (1.0, [1.0, 10.0], [1.0, 10.0]),
            (1.25, [1.0, 10.0], [1.5, 15.0]),
            (2.0, [3.0, 30.0], [3.0, 30.0]),
            (9.0, [3.0, 30.0], [3.0, 30.0]),
        ] {
            assert_eq!((step.at(time), line.at(time)), (stepped.to_vec(), straight.to_vec()), "at {time}");
        }
    }

    #[test]
    fn keys_at_the_same_time_jump() {
        for interpolation in [Interpolation::Step, Interpolation::Linear] {
            let keys = Keys::new(vec![0.0, 1.0, 1.0, 2.0], vec![4.0, 4.0, 7.0, 7.0], 1, interpolation);
            assert_eq!([0.5, 1.0, 1.5].map(|time| keys.at(time)[0]), [4.0, 7.0, 7.0]);
        }
    }

    #[test]
    fn splines_have_their_values_and_tangents() {
        // In-tangent, value, out-tangent of two keys a second apart. The cubic through 2 and 3 with slopes 4 and -1
        // is 2 + 4 t - 4 t^2 + t^3.
        let spline = keys(Interpolation::Cubic, 1, &[f32::MAX, 2.0, 4.0, -1.0, 3.0, f32::MAX]);
        for t in [0.0, 0.25, 0.5, 0.75, 1.0_f32] {
            let expected = 2.0 + 4.0 * t - 4.0 * t * t + t * t * t;
            assert!((spline.at(1.0 + t)[0] - expected).abs() < 1e-6, "at {t}");
        }
        assert_eq!((spline.at(0.0), spline.at(5.0)), (vec![2.0], vec![3.0]));
        // Tangents are per second: over two seconds the same slopes bend twice as much.
        let slow = Keys::new(vec![0.0, 2.0], vec![0.0, 0.0, 1.0, -1.0, 0.0, 0.0], 1, Interpolation::Cubic);
        assert_eq!(slow.at(1.0), [0.5]);
    }

    #[test]
    fn splines_of_rotations_are_unit_and_survive_zero() {
        let spline = keys(
            Interpolation::Cubic,
            4,
            &[[0.0; 4], [1., 0., 0., 0.], [0.0; 4], [0.0; 4], [-1., 0., 0., 0.], [0.0; 4]].concat(),
        );
        assert_eq!(spline.rotation(1.5).to_array(), [1., 0., 0., 0.], "halfway the sum is 0");
        assert!(spline.rotation(1.3).is_normalized());
    }

    proptest! {
        /// glam's own slerp is the witness.
        #[test]
        fn rotations_follow_the_shorter_arc(
            a in prop::array::uniform3(-1.0_f32..1.0), b in prop::array::uniform3(-1.0_f32..1.0),
            angles in prop::array::uniform2(-6.0_f32..6.0), t in 0.0_f32..1.0,
        ) {
            let axis = |v: [f32; 3]| Vec3::from_array(v).normalize_or(Vec3::X);
            let (a, b) = (Quat::from_axis_angle(axis(a), angles[0]), Quat::from_axis_angle(axis(b), angles[1]));
            let keys = keys(Interpolation::Spherical, 4, &[a.to_array(), b.to_array()].concat());
            let (ours, theirs) = (keys.rotation(1.0 + t), a.slerp(b, t));
            // Near opposite ends (a half turn apart) the shorter arc is a matter of rounding.
            prop_assume!(a.dot(b).abs() > 1e-3);
            prop_assert!(ours.dot(theirs).abs() > 1.0 - 1e-5, "{ours} {theirs}");
        }

        /// Whatever the interpolation, a key's own time gives its own value.
        #[test]
        fn keys_are_met(values in prop::collection::vec(-9.0_f32..9.0, 12), key in 0_usize..4) {
            for interpolation in [Interpolation::Step, Interpolation::Linear, Interpolation::Cubic] {
                let keys = keys(interpolation, 1, &values);
                let key = key % keys.times.len();
                prop_assert_eq!(keys.at(keys.times[key]), keys.value(key));
            }
        }
    }
}
