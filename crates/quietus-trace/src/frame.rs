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
        let tangent = across.normalize();
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
