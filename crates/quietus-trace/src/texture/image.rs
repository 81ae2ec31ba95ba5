//! Look-up of images: bilinear where they are magnified, between two levels of their pyramid where they are not.

use std::sync::{Arc, LazyLock};

use glam::{IVec2, Vec2, Vec3, Vec4};

use super::SurfacePoint;
use super::pyramid::Pyramid;
use crate::desc::{EnvironmentLayout, Image, ImageTexture, Mapping, TexelFilter, Texels, Wrap};
use crate::light::fold_square;

/// The sRGB curve (IEC 61966-2-1) for all 8-bit values.
static SRGB_TO_LINEAR: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|code| srgb_to_linear(code as f32 / 255.0)));

/// The sRGB curve, from an encoded value in 0..1 to a linear one.
pub fn srgb_to_linear(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// An image texture with its pyramid.
#[derive(Clone, Debug)]
pub(super) struct FilteredImage {
    pyramid: Arc<Pyramid>,
    wrap: [Wrap; 2],
    filter: TexelFilter,
    mapping: Mapping,
    invert: bool,
    /// Whether only the image itself is looked at.
    exact: bool,
    /// Whether look-ups are neither of single texels nor on a sphere.
    usual: bool,
}

/// Footprints this many times longer than wide are filtered as far as to their width; longer ones further, so that no
/// look-up skips more than this many texels.
///
/// A footprint's length is left to the samples of the pixel, which are spread along it: filtering over the length
/// would blur across it too.
const MOST_ANISOTROPY: f32 = 16.0;

impl FilteredImage {
    /// `texture` over its `pyramid`; `exact` says that it is never to be filtered.
    pub(super) fn new(texture: &ImageTexture, pyramid: Arc<Pyramid>, exact: bool) -> Self {
        let &ImageTexture { wrap, filter, mapping, invert, .. } = texture;
        let usual = filter != TexelFilter::Nearest && wrap != [Wrap::Octahedral; 2];
        Self { pyramid, wrap, filter, mapping, invert, exact: exact || filter == TexelFilter::Nearest, usual }
    }

    /// Linear RGBA at `point`.
    #[inline]
    pub(super) fn lookup(&self, point: &SurfacePoint) -> Vec4 {
        let uv = self.mapping.coordinates(point);
        let width = if self.exact { 0.0 } else { self.footprint_width(point) };
        self.lookup_uv(uv, width)
    }

    /// Linear RGBA at the texture coordinates `uv`, filtered over `width` texels of the image. Coordinates that are
    /// not finite read as 0.
    #[inline]
    pub(super) fn lookup_uv(&self, uv: Vec2, width: f32) -> Vec4 {
        let uv = if uv.is_finite() { uv } else { Vec2::ZERO };
        // Tiles are taken off before scaling, so that coordinates far out keep their digits and fit an i32.
        let uv = Vec2::new(self.wrap[0].reduce(uv.x), self.wrap[1].reduce(uv.y));
        let value = if width <= 1.0 { self.level(0, uv) } else { self.between_levels(uv, width) };
        if self.invert { inverted(value) } else { value }
    }

    /// Mean over the image.
    pub(super) fn mean(&self) -> Vec4 {
        let image = &self.pyramid.levels[0];
        let texels = (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y)));
        let sum = texels.fold(glam::DVec4::ZERO, |sum, (x, y)| sum + image.texel(x, y).as_dvec4());
        let mean = (sum / (f64::from(image.width) * f64::from(image.height))).as_vec4();
        if self.invert { inverted(mean) } else { mean }
    }

    /// The width in texels of the footprint of `point`: the shorter axis of the ellipse that it is on the image, or
    /// as much more as [`MOST_ANISOTROPY`] asks for.
    #[inline]
    fn footprint_width(&self, point: &SurfacePoint) -> f32 {
        let image = &self.pyramid.levels[0];
        let size = Vec2::new(image.width as f32, image.height as f32);
        let [a, b] = self.mapping.footprint(point).map(|step| step * size);
        // Singular values of the matrix [a b], from its norm and determinant.
        let (norm2, determinant) = (a.length_squared() + b.length_squared(), a.perp_dot(b).abs());
        let root = (norm2 * norm2 - 4.0 * determinant * determinant).max(0.0).sqrt();
        let long = (0.5 * (norm2 + root)).sqrt();
        let short = if long > 0.0 { determinant / long } else { 0.0 };
        // Half axes: the width is twice as much.
        2.0 * short.max(long / MOST_ANISOTROPY)
    }

    /// Between the levels whose texels are as wide as `width`, above 1, rounded down and up to a power of two.
    #[inline(never)]
    fn between_levels(&self, uv: Vec2, width: f32) -> Vec4 {
        let last = self.pyramid.levels.len() - 1;
        // The exponent of a float is its logarithm, rounded down; infinite and NaN have one that is too large.
        let level = ((width.to_bits() >> 23) & 0xff) as usize - 127;
        if level >= last {
            return self.level(last, uv);
        }
        // The mantissa: 0 at this level, 1 at the next.
        let between = f32::from_bits(width.to_bits() & 0x007f_ffff | 0x3f80_0000) - 1.0;
        self.level(level, uv).lerp(self.level(level + 1, uv), between)
    }

    /// Interpolates within a level, at reduced coordinates.
    #[inline]
    fn level(&self, level: usize, uv: Vec2) -> Vec4 {
        let image = &*self.pyramid.levels[level];
        let size = IVec2::new(image.width as i32, image.height as i32);
        if !self.usual {
            return self.unusual(image, size, uv);
        }
        let place = uv * size.as_vec2();
        let corner = (place - 0.5).floor();
        let c = corner.as_ivec2();
        let square = Square {
            x: [c.x, c.x + 1].map(|x| self.wrap[0].texel(x, size.x)),
            y: [c.y, c.y + 1].map(|y| self.wrap[1].texel(y, size.y)),
            width: image.width,
            between: place - 0.5 - corner,
        };
        // Once per look-up rather than per texel: what kind of texels there are, and where their curve is.
        match &image.texels {
            Texels::Srgb8(texels) => {
                let curve = &*SRGB_TO_LINEAR;
                square.interpolate(texels, |code| decode_srgb(curve, code))
            }
            Texels::Linear8(texels) => {
                square.interpolate(texels, |t| Vec4::from_array(t.map(f32::from))) / 255.0
            }
            Texels::Float(texels) => square.interpolate(texels, Vec4::from_array),
        }
    }

    /// As [`Self::level`], for single texels and on spheres.
    #[inline(never)]
    fn unusual(&self, image: &Image, size: IVec2, uv: Vec2) -> Vec4 {
        let on_sphere = self.wrap == [Wrap::Octahedral; 2];
        let place = if on_sphere { fold_square(uv) } else { uv } * size.as_vec2();
        let texel = |x: i32, y: i32| match on_sphere {
            true => {
                let [x, y] = EnvironmentLayout::EqualArea.wrap([x, y], size.to_array());
                image.texel(x as u32, y as u32)
            }
            false => image.fetch(self.wrap[0].texel(x, size.x), self.wrap[1].texel(y, size.y)),
        };
        if self.filter == TexelFilter::Nearest {
            let place = place.floor().as_ivec2();
            return texel(place.x, place.y);
        }
        let corner = (place - 0.5).floor();
        let (IVec2 { x, y }, between) = (corner.as_ivec2(), place - 0.5 - corner);
        let row = |y: i32| texel(x, y).lerp(texel(x + 1, y), between.x);
        row(y).lerp(row(y + 1), between.y)
    }
}

/// Four texels around a place, two columns by two rows.
struct Square {
    x: [u32; 2],
    y: [u32; 2],
    /// Of the whole image.
    width: u32,
    /// Where the place lies between their centres, in 0..1.
    between: Vec2,
}

impl Square {
    /// Interpolates between decoded texels; those outside of the image are 0.
    #[inline(always)]
    fn interpolate<T: Copy>(&self, texels: &[T], decode: impl Fn(T) -> Vec4) -> Vec4 {
        let [x0, x1] = self.x;
        let row = |y: u32| {
            let start = y as usize * self.width as usize;
            let texel = |x: u32| match x == OUTSIDE || y == OUTSIDE {
                true => Vec4::ZERO,
                false => decode(texels[start + x as usize]),
            };
            texel(x0).lerp(texel(x1), self.between.x)
        };
        row(self.y[0]).lerp(row(self.y[1]), self.between.y)
    }
}

/// Linear RGBA of an 8-bit texel with the sRGB curve.
#[inline(always)]
fn decode_srgb(curve: &[f32; 256], [r, g, b, a]: [u8; 4]) -> Vec4 {
    let linear = |code: u8| curve[usize::from(code)];
    Vec4::new(linear(r), linear(g), linear(b), f32::from(a) / 255.0)
}

/// The opposite colour; nothing is darker than black.
fn inverted(value: Vec4) -> Vec4 {
    (1.0 - value.truncate()).max(Vec3::ZERO).extend(value.w)
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
            Texels::Srgb8(t) => decode_srgb(&SRGB_TO_LINEAR, t[i]),
            Texels::Linear8(t) => Vec4::from_array(t[i].map(f32::from)) / 255.0,
            Texels::Float(t) => Vec4::from_array(t[i]),
        }
    }

    /// The texel at wrapped coordinates, transparent black outside.
    #[inline]
    fn fetch(&self, x: u32, y: u32) -> Vec4 {
        if x == OUTSIDE || y == OUTSIDE { Vec4::ZERO } else { self.texel(x, y) }
    }
}

/// Stands for a column or row beyond a black border.
const OUTSIDE: u32 = u32::MAX;

impl Wrap {
    /// A coordinate in 0..=1 (0..=2 where mirrored, -1..=2 with a black border or on a sphere) that looks the same.
    #[inline]
    fn reduce(self, t: f32) -> f32 {
        match self {
            Self::Repeat => t - t.floor(),
            Self::Mirror => t - 2.0 * (0.5 * t).floor(),
            Self::Clamp => t.clamp(0.0, 1.0),
            Self::Black | Self::Octahedral => t.clamp(-1.0, 2.0),
        }
    }

    /// The column or row that stands for `i`, at most one beyond what reduced coordinates come to.
    #[inline]
    fn texel(self, i: i32, size: i32) -> u32 {
        let inside = match self {
            Self::Repeat => match i {
                i if i < 0 => i + size,
                i if i >= size => i - size,
                i => i,
            },
            // One before the first is the first, one behind the last mirror image is the first again.
            Self::Mirror if i < 0 => 0,
            Self::Mirror if i >= size => (2 * size - 1 - i).max(0),
            Self::Mirror => i,
            Self::Clamp | Self::Octahedral => i.clamp(0, size - 1),
            Self::Black if i < 0 || i >= size => return OUTSIDE,
            Self::Black => i,
        };
        inside as u32
    }
}
