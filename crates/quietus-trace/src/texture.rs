//! Look-up of image textures.

use std::sync::LazyLock;

use glam::{IVec2, Vec2, Vec3, Vec4};

use crate::desc::{
    ColorParam, Image, ImageTexture, Mapping, ScalarParam, TexelFilter, Texels, Texture, TextureId, Wrap,
};

/// What texture look-ups need to know of a surface point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// The mesh's two sets of texture coordinates; 0 where it has none.
    pub uv: [Vec2; 2],
    /// Linear vertex colour with alpha; 1 where the mesh has none.
    pub color: Vec4,
    /// Where it is in the world.
    pub position: Vec3,
    /// How much of the surface around it the look-up stands for.
    pub footprint: Footprint,
}

impl Default for SurfacePoint {
    fn default() -> Self {
        Self { uv: [Vec2::ZERO; 2], color: Vec4::ONE, position: Vec3::ZERO, footprint: Footprint::POINT }
    }
}

/// The ellipse on the surface that a look-up stands for, given by two half axes. Where it is not known it is a
/// point, which costs noise and never gives a wrong mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// Its half axes in the world, in the tangent plane.
    pub axes: [Vec3; 2],
    /// What the sets of texture coordinates change by along each of them: `uv[set][axis]`.
    pub uv: [[Vec2; 2]; 2],
}

impl Footprint {
    /// Nothing but the point itself.
    pub const POINT: Self = Self { axes: [Vec3::ZERO; 2], uv: [[Vec2::ZERO; 2]; 2] };
}

/// The sRGB curve (IEC 61966-2-1) for all 8-bit values.
static SRGB_TO_LINEAR: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|code| srgb_to_linear(code as f32 / 255.0)));

/// The sRGB curve, from an encoded value in 0..1 to a linear one.
pub fn srgb_to_linear(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

impl Texture {
    /// Linear RGBA at `point`.
    ///
    /// # Panics
    /// If the texture's set of coordinates is above 1 or its image has fewer texels than it claims.
    #[inline(always)]
    pub fn lookup(&self, point: &SurfacePoint) -> Vec4 {
        match self {
            Self::Image(texture) => texture.lookup(point),
            Self::Constant(value) => *value,
            // Refused when the scene is compiled.
            Self::Checkerboard { .. } | Self::Scale { .. } | Self::Mix { .. } => Vec4::ONE,
        }
    }
}

impl ImageTexture {
    /// Linear RGBA at `point`.
    #[inline(always)]
    fn lookup(&self, point: &SurfacePoint) -> Vec4 {
        // Other mappings are refused when the scene is compiled.
        let Mapping::Uv { set, transform } = self.mapping else { return Vec4::ONE };
        self.lookup_uv(transform.transform_point2(point.uv[usize::from(set)]))
    }

    /// Linear RGBA at the texture coordinates `uv`. Coordinates that are not finite read as 0.
    #[inline(always)]
    pub fn lookup_uv(&self, uv: Vec2) -> Vec4 {
        let uv = if uv.is_finite() { uv } else { Vec2::ZERO };
        // Tiles are taken off before scaling, so that coordinates far out keep their digits and fit an i32.
        let uv = Vec2::new(self.wrap[0].reduce(uv.x), self.wrap[1].reduce(uv.y));
        let size = IVec2::new(self.image.width as i32, self.image.height as i32);
        let place = uv * size.as_vec2();
        match self.filter {
            TexelFilter::Nearest => self.texel(place.floor().as_ivec2(), size),
            TexelFilter::Linear => {
                let corner = (place - 0.5).floor();
                let f = place - 0.5 - corner;
                let c = corner.as_ivec2();
                let top = self.texel(c, size).lerp(self.texel(c + IVec2::X, size), f.x);
                let bottom = self.texel(c + IVec2::Y, size).lerp(self.texel(c + IVec2::ONE, size), f.x);
                top.lerp(bottom, f.y)
            }
        }
    }

    /// The texel at `place`, wrapped.
    #[inline]
    fn texel(&self, place: IVec2, size: IVec2) -> Vec4 {
        let x = self.wrap[0].texel(place.x, size.x);
        let y = self.wrap[1].texel(place.y, size.y);
        self.image.texel(x, y)
    }
}

impl Image {
    /// Linear RGBA of the texel in column `x`, row `y`.
    ///
    /// # Panics
    /// If there is no such texel.
    #[inline]
    pub fn texel(&self, x: u32, y: u32) -> Vec4 {
        let i = y as usize * self.width as usize + x as usize;
        match &self.texels {
            Texels::Srgb8(t) => {
                let [r, g, b, a] = t[i];
                let linear = |code: u8| SRGB_TO_LINEAR[usize::from(code)];
                Vec4::new(linear(r), linear(g), linear(b), f32::from(a) / 255.0)
            }
            Texels::Linear8(t) => Vec4::from_array(t[i].map(f32::from)) / 255.0,
            Texels::Float(t) => Vec4::from_array(t[i]),
        }
    }
}

impl Wrap {
    /// A coordinate in 0..1 (0..2 where mirrored) that looks the same.
    #[inline]
    fn reduce(self, t: f32) -> f32 {
        match self {
            Self::Repeat => t - t.floor(),
            Self::Mirror => t - 2.0 * (0.5 * t).floor(),
            Self::Clamp | Self::Black => t.clamp(0.0, 1.0),
        }
    }

    /// The column or row that stands for `i`, which may lie outside of `0..size`.
    #[inline]
    fn texel(self, i: i32, size: i32) -> u32 {
        let inside = match self {
            Self::Repeat => i.rem_euclid(size),
            Self::Clamp | Self::Black => i.clamp(0, size - 1),
            Self::Mirror => {
                let i = i.rem_euclid(2 * size);
                i.min(2 * size - 1 - i)
            }
        };
        inside as u32
    }
}

impl ColorParam {
    /// Its value at `point`.
    #[inline]
    pub fn at(&self, point: &SurfacePoint, textures: &[Texture]) -> Vec3 {
        match self.texture {
            None => self.factor,
            Some(TextureId(id)) => self.factor * textures[id as usize].lookup(point).truncate(),
        }
    }
}

impl ScalarParam {
    /// Its value at `point`.
    #[inline]
    pub fn at(&self, point: &SurfacePoint, textures: &[Texture]) -> f32 {
        match self.texture {
            None => self.factor,
            Some((TextureId(id), channel)) => {
                self.factor * textures[id as usize].lookup(point)[usize::from(channel)]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::Affine2;

    use super::*;

    /// 2x2 texels whose red channel is 0, 1, 2, 3 in reading order.
    fn numbers(wrap: Wrap, filter: TexelFilter) -> ImageTexture {
        let texels = Texels::Float((0..4).map(|i| [i as f32, 0.0, 0.0, 1.0]).collect());
        let image = Arc::new(Image { name: "numbers".into(), width: 2, height: 2, texels });
        let mapping = Mapping::Uv { set: 0, transform: Affine2::IDENTITY };
        ImageTexture { image, wrap: [wrap; 2], filter, mapping, invert: false }
    }

    fn red(texture: &ImageTexture, u: f32, v: f32) -> f32 {
        texture.lookup_uv(Vec2::new(u, v)).x
    }

    #[test]
    fn the_origin_is_the_top_left_corner() {
        let t = numbers(Wrap::Repeat, TexelFilter::Nearest);
        assert_eq!(
            [red(&t, 0.1, 0.1), red(&t, 0.9, 0.1), red(&t, 0.1, 0.9), red(&t, 0.9, 0.9)],
            [0.0, 1.0, 2.0, 3.0]
        );
    }

    #[test]
    fn bilinear_passes_through_texel_centres_and_mixes_between() {
        let t = numbers(Wrap::Clamp, TexelFilter::Linear);
        assert_eq!([red(&t, 0.25, 0.25), red(&t, 0.75, 0.25), red(&t, 0.25, 0.75)], [0.0, 1.0, 2.0]);
        assert_eq!([red(&t, 0.5, 0.25), red(&t, 0.25, 0.5), red(&t, 0.5, 0.5)], [0.5, 1.0, 1.5]);
    }

    #[test]
    fn wraps_do_what_they_say() {
        for (wrap, expected) in [
            // Texel columns at u = -0.75, -0.25, 0.25, 0.75, 1.25, 1.75, 2.25.
            (Wrap::Repeat, [0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0]),
            (Wrap::Mirror, [1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0]),
            (Wrap::Clamp, [0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]),
        ] {
            for filter in [TexelFilter::Nearest, TexelFilter::Linear] {
                let t = numbers(wrap, filter);
                let found = [-0.75, -0.25, 0.25, 0.75, 1.25, 1.75, 2.25].map(|u| red(&t, u, 0.25));
                assert_eq!(found, expected, "{wrap:?} {filter:?}");
            }
        }
        // Across the seam: the mean of both ends, or the end itself.
        let at_seam = |wrap| red(&numbers(wrap, TexelFilter::Linear), 1.0, 0.25);
        assert_eq!([at_seam(Wrap::Repeat), at_seam(Wrap::Mirror), at_seam(Wrap::Clamp)], [0.5, 1.0, 1.0]);
    }

    #[test]
    fn coordinates_out_of_this_world_are_answered() {
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for filter in [TexelFilter::Nearest, TexelFilter::Linear] {
                let t = numbers(wrap, filter);
                for u in
                    [f32::NAN, f32::INFINITY, -f32::INFINITY, 1e30, -1e30, f32::MAX, -1e-30, 16_777_215.0]
                {
                    assert!((0.0..=3.0).contains(&red(&t, u, -u)), "{wrap:?} {filter:?} {u}");
                }
            }
        }
    }

    #[test]
    fn the_transform_and_the_uv_set_apply() {
        let mut t = numbers(Wrap::Repeat, TexelFilter::Nearest);
        t.mapping = Mapping::Uv { set: 1, transform: Affine2::from_translation(Vec2::new(0.5, 0.0)) };
        let point = SurfacePoint { uv: [Vec2::splat(9.9), Vec2::splat(0.25)], ..SurfacePoint::default() };
        assert_eq!(t.lookup(&point).x, 1.0);
    }

    #[test]
    fn eight_bits_decode_by_their_curves() {
        let image = |texels| Image { name: "grey".into(), width: 1, height: 1, texels };
        let srgb = image(Texels::Srgb8(vec![[0, 255, 188, 51]])).texel(0, 0);
        // 188 is the code of middle grey: ((188 / 255 + 0.055) / 1.055)^2.4.
        assert_eq!([srgb.x, srgb.y, srgb.w], [0.0, 1.0, 0.2]);
        assert!((srgb.z - 0.502_886_5).abs() < 1e-6, "{}", srgb.z);
        let linear = image(Texels::Linear8(vec![[0, 255, 51, 102]])).texel(0, 0);
        assert_eq!(linear, Vec4::new(0.0, 1.0, 0.2, 0.4));
    }
}
