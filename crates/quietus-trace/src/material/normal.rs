//! Shading frames: normal maps, bump maps, and the direction of anisotropy.

use glam::{Vec2, Vec3, Vec4Swizzles};

use super::{MaterialTable, SurfacePoint};
use crate::{
    desc::{self, Anisotropy, MaterialId, ScalarParam, Surface, TextureId},
    frame::Frame,
    texture::Footprint,
};

/// Smallest steps that heights are compared over, relative to the coordinates: these are rounded to 6e-8, which is half
/// a percent of such a step in texture coordinates, and two of one in space.
const LEAST_UV_STEP: f32 = 1.0 / 65_536.0;
const LEAST_STEP: f32 = 1.0 / 262_144.0;

/// By how much to lengthen a step along the surface so that its rounding does not show.
fn resolvable(axis: Vec3, uv: [Vec2; 2], point: &SurfacePoint) -> f32 {
    let lengthen = |step: f32, least: f32| if step > 0.0 { least / step } else { 0.0 };
    let of_set =
        |set: usize| lengthen(uv[set].length(), LEAST_UV_STEP * point.uv[set].abs().max_element().max(1.0));
    let of_place = lengthen(axis.length(), LEAST_STEP * point.position.abs().max_element());
    of_place.max(of_set(0)).max(of_set(1)).max(1.0)
}

/// `frame` with another normal; it keeps its handedness.
fn tilted(frame: &Frame, normal: Vec3) -> Frame {
    let tilted = Frame::from_normal_tangent(normal, frame.tangent);
    let handedness = frame.tangent.cross(frame.bitangent).dot(frame.normal).signum();
    Frame { bitangent: tilted.bitangent * handedness, ..tilted }
}

impl MaterialTable {
    /// The shading frame with normal and bump map applied: `frame` is the orthonormal frame of the interpolated normal
    /// and the mesh's tangent. It is left-handed where that is (under a mirror), as tangent space is then. Its x axis is
    /// the direction in which the surface is rougher, where glTF turns that.
    pub fn shading_frame(&self, id: MaterialId, point: &SurfacePoint, frame: &Frame) -> Frame {
        let material = self.material(id);
        let mapped = material
            .normal_map
            .map_or(*frame, |map| tilted(frame, frame.to_world(self.tangent_normal(map, point)).normalize()));
        let mapped = material
            .bump
            .map_or(mapped, |height| tilted(&mapped, self.bumped_normal(&height, point, mapped.normal)));
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
        let Some(texture) = texture else { return (strength, rotation) };
        let texel = self.textures.lookup(texture, point);
        let direction = (2.0 * texel.xy() - 1.0).normalize_or(Vec2::X);
        (strength * texel.z.clamp(0.0, 1.0), rotation.rotate(direction))
    }

    /// `normal`, tilted against the slope of a height above the surface: Blinn 1978, "Simulation of Wrinkled Surfaces",
    /// but for how the surface itself bends within the height. The slope is the mean one over the point's footprint.
    fn bumped_normal(&self, height: &ScalarParam, point: &SurfacePoint, normal: Vec3) -> Vec3 {
        let Footprint { axes, uv } = point.footprint;
        let here = height.at(point, &self.textures);
        let mut slope = Vec3::ZERO;
        for (i, axis) in axes.into_iter().enumerate() {
            let uv = [uv[0][i], uv[1][i]];
            let scale = resolvable(axis, uv, point);
            let moved = SurfacePoint {
                uv: [0, 1].map(|set: usize| point.uv[set] + scale * uv[set]),
                position: point.position + scale * axis,
                ..*point
            };
            let rise = height.at(&moved, &self.textures) - here;
            let run = scale * axis.length_squared();
            // The axes are at right angles: each gives its own part of the slope.
            slope += axis * if run > 0.0 { rise / run } else { 0.0 };
        }
        (normal - (slope - normal * normal.dot(slope))).try_normalize().unwrap_or(normal)
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
