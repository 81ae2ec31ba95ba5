//! Orthonormal frames around a surface normal.

use glam::Vec3;

/// A right-handed orthonormal frame whose z axis is a (shading) normal; BSDFs speak its coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// The x axis.
    pub tangent: Vec3,
    /// The y axis.
    pub bitangent: Vec3,
    /// The z axis.
    pub normal: Vec3,
}

impl Frame {
    /// Any frame around `normal`, of unit length: Duff et al., "Building an Orthonormal Basis, Revisited"
    /// (JCGT 6(1), 2017), which loses no digits near either pole.
    #[inline]
    pub fn from_normal(normal: Vec3) -> Self {
        let sign = 1f32.copysign(normal.z);
        let a = -1.0 / (sign + normal.z);
        let b = normal.x * normal.y * a;
        Self {
            tangent: Vec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x),
            bitangent: Vec3::new(b, sign + normal.y * normal.y * a, -normal.y),
            normal,
        }
    }

    /// The frame around `normal`, of unit length, whose x axis lies as near to `tangent` as it can; any frame
    /// where `tangent` is zero or parallel to the normal.
    #[inline]
    pub fn from_normal_tangent(normal: Vec3, tangent: Vec3) -> Self {
        let across = tangent - normal * normal.dot(tangent);
        // A tangent that all but vanishes keeps no direction worth having.
        if across.length_squared() <= 1e-10 * tangent.length_squared() {
            return Self::from_normal(normal);
        }
        // Once more: a tangent near the normal leaves a remainder of rounding along it.
        let across = across.normalize();
        let tangent = (across - normal * normal.dot(across)).normalize();
        Self { tangent, bitangent: normal.cross(tangent), normal }
    }

    /// Coordinates of the world vector `v` in this frame.
    #[inline]
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        Vec3::new(v.dot(self.tangent), v.dot(self.bitangent), v.dot(self.normal))
    }

    /// The world vector with coordinates `v` in this frame.
    #[inline]
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        v.x * self.tangent + v.y * self.bitangent + v.z * self.normal
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Rng;

    fn assert_orthonormal(f: &Frame) {
        let lengths = [f.tangent, f.bitangent, f.normal].map(|v| (v.length() - 1.0).abs());
        let dots = [f.tangent.dot(f.bitangent), f.bitangent.dot(f.normal), f.normal.dot(f.tangent)];
        assert!(lengths.into_iter().chain(dots).all(|e| e.abs() < 1e-6), "{f:?}");
        assert!((f.tangent.cross(f.bitangent) - f.normal).length() < 1e-6, "left-handed: {f:?}");
    }

    #[test]
    fn frames_are_orthonormal_and_invert() {
        let mut rng = Rng::new(1);
        let poles = [Vec3::Z, -Vec3::Z, Vec3::new(1e-4, 0.0, -1.0).normalize(), Vec3::X, -Vec3::Y];
        for normal in poles.into_iter().chain((0..1000).map(|_| rng.next_direction())) {
            let v = Vec3::new(0.3, -2.0, 0.7);
            for tangent in [Vec3::ZERO, normal, -3.0 * normal, Vec3::new(5.0, 0.1, -2.0)] {
                let frame = Frame::from_normal_tangent(normal, tangent);
                assert_orthonormal(&frame);
                assert!((frame.to_world(frame.to_local(v)) - v).length() < 1e-5);
            }
        }
    }
}
