//! Shading frames: normal maps, and the direction of anisotropy.

use glam::{Vec2, Vec3};

use super::{MaterialTable, SurfacePoint};
use crate::{
    desc::{self, Anisotropy, MaterialId, Surface, TextureId},
    frame::Frame,
};

impl MaterialTable {
    /// The shading frame with the normal map applied: `frame` is the orthonormal frame of the interpolated normal
    /// and the mesh's tangent. It is left-handed where that is (under a mirror), as tangent space is then. Its x axis is
    /// the direction in which the surface is rougher, where glTF turns that.
    pub fn shading_frame(&self, id: MaterialId, point: &SurfacePoint, frame: &Frame) -> Frame {
        let material = self.material(id);
        let mapped = material.normal_map.map_or(*frame, |map| {
            let normal = frame.to_world(self.tangent_normal(map, point)).normalize();
            let mapped = Frame::from_normal_tangent(normal, frame.tangent);
            let handedness = frame.tangent.cross(frame.bitangent).dot(frame.normal).signum();
            Frame { bitangent: mapped.bitangent * handedness, ..mapped }
        });
        match &material.surface {
            Surface::MetalRough(m) if m.anisotropy.strength != 0.0 => {
                let (_, direction) = self.anisotropy(m, point);
                let tangent = direction.x * mapped.tangent + direction.y * mapped.bitangent;
                let bitangent = direction.x * mapped.bitangent - direction.y * mapped.tangent;
                Frame { tangent, bitangent, ..mapped }
            }
            _ => mapped,
        }
    }

    /// Strength and direction of glTF's anisotropy: the direction in which the lobe is wider, of unit length in tangent
    /// space.
    #[inline]
    pub(super) fn anisotropy(&self, m: &desc::MetalRough, point: &SurfacePoint) -> (f32, Vec2) {
        let Anisotropy { strength, rotation, texture } = m.anisotropy;
        if strength == 0.0 {
            return (0.0, Vec2::X);
        }
        let rotation = Vec2::from_angle(rotation);
        let Some(TextureId(texture)) = texture else { return (strength, rotation) };
        let texel = self.textures[texture as usize].lookup(point);
        let direction = (2.0 * texel.truncate().truncate() - 1.0).normalize_or(Vec2::X);
        (strength * texel.z.clamp(0.0, 1.0), rotation.rotate(direction))
    }

    /// The normal that a map (texture and scale) gives, of unit length, in tangent space.
    fn tangent_normal(&self, (texture, scale): (TextureId, f32), point: &SurfacePoint) -> Vec3 {
        let texel = self.textures.lookup(texture, point).truncate();
        let n = (2.0 * texel - 1.0) * Vec3::new(scale, scale, 1.0);
        // A normal below the surface says nothing that could be drawn: it is laid flat as far as it must.
        n.with_z(n.z.max(1e-3)).normalize_or(Vec3::Z)
    }

    /// The coat's normal in the frame that [`shading_frame`](Self::shading_frame) gives the base. Without a map
    /// of its own the coat lies smoothly over the base's bumps (KHR_materials_clearcoat).
    pub(super) fn clearcoat_normal(
        &self,
        material: &desc::Material,
        m: &desc::MetalRough,
        point: &SurfacePoint,
    ) -> Vec3 {
        if m.clearcoat.factor == 0.0 || (m.clearcoat_normal.is_none() && material.normal_map.is_none()) {
            return Vec3::Z;
        }
        let coat = m.clearcoat_normal.map_or(Vec3::Z, |map| self.tangent_normal(map, point));
        let base = material.normal_map.map_or(Vec3::Z, |map| self.tangent_normal(map, point));
        let coat = Frame::from_normal_tangent(base, Vec3::X).to_local(coat);
        let (_, direction) = self.anisotropy(m, point);
        // Into the frame that is turned to that direction.
        (direction * Vec2::new(1.0, -1.0)).rotate(coat.truncate()).extend(coat.z)
    }
}
