//! Images, textures and the parameters they drive.

use std::sync::Arc;

use glam::{Affine2, Affine3A, Vec2, Vec3, Vec4};

use super::TextureId;

/// A picture in memory, row 0 at the top. Textures may share one.
#[derive(Clone, Debug)]
pub struct Image {
    /// Where it came from, for messages.
    pub name: String,
    /// Width in texels, at least 1.
    pub width: u32,
    /// Height in texels, at least 1.
    pub height: u32,
    /// `width * height` texels, row by row.
    pub texels: Texels,
}

/// Texels of an [`Image`], always four channels.
#[derive(Clone, Debug)]
pub enum Texels {
    /// 8 bits, colour with the sRGB curve, alpha linear.
    Srgb8(Vec<[u8; 4]>),
    /// 8 bits, all channels linear.
    Linear8(Vec<[u8; 4]>),
    /// Linear floats, finite and at least 0.
    Float(Vec<[f32; 4]>),
}

/// What a look-up outside of 0..1 returns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// Tiled.
    #[default]
    Repeat,
    /// Tiled, every other tile mirrored.
    Mirror,
    /// The nearest edge.
    Clamp,
    /// Black, with alpha 0.
    Black,
    /// What lies there on the sphere of which the image is the octahedral square, see
    /// [`EnvironmentLayout::EqualArea`](super::EnvironmentLayout::EqualArea). For both axes; for one alone the nearest edge.
    Octahedral,
}

/// How a look-up between texels is answered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TexelFilter {
    /// Bilinear.
    #[default]
    Linear,
    /// Nearest texel.
    Nearest,
}

/// A value that varies over a surface: four channels, of which a colour takes the first three.
///
/// Textures name others by parameters ([`ColorParam`], [`ScalarParam`]); a texture may only name textures of a
/// lower [`TextureId`], so that there are no cycles.
#[derive(Clone, Debug)]
pub enum Texture {
    /// A picture.
    Image(ImageTexture),
    /// The same everywhere.
    Constant(Vec4),
    /// Two textures in the cells of a chess board of unit cells in the mapping's space; `colors[0]` where the sum
    /// of the cell's coordinates is even.
    Checkerboard {
        /// Where the cells lie.
        mapping: Mapping,
        /// What they show.
        colors: [ColorParam; 2],
    },
    /// The product of a colour and a number.
    Scale {
        /// The colour.
        color: ColorParam,
        /// The number.
        scale: ScalarParam,
    },
    /// `(1 - amount) * colors[0] + amount * colors[1]`.
    Mix {
        /// What is mixed.
        colors: [ColorParam; 2],
        /// How much there is of the second, in 0..1.
        amount: ScalarParam,
    },
    /// Bilinear between four colours.
    Corners {
        /// Where they lie.
        mapping: Mapping,
        /// At (0, 0), (1, 0), (0, 1) and (1, 1).
        colors: [Vec3; 4],
    },
    /// Dots of radius 0.35, in about two fifths of the unit cells of the mapping.
    Dots {
        /// Where the cells lie.
        mapping: Mapping,
        /// In a dot, and between them.
        colors: [ColorParam; 2],
    },
    /// Noise; numbers fill all channels.
    Noise {
        /// From the world to texture space.
        from_world: Affine3A,
        /// What is made of it.
        pattern: NoisePattern,
    },
    /// `c * colors[0] + (1 - c) * colors[1]` for the magnitude c of the cosine between normal and direction.
    Facing {
        /// Of unit length, in the world.
        direction: Vec3,
        /// What is mixed.
        colors: [ColorParam; 2],
    },
}

/// What [`Texture::Noise`] makes of gradient noise. Octaves are each about twice as fine as the one before and have
/// `roughness` times its strength.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NoisePattern {
    /// Their sum, above and below 0.
    Brownian {
        /// How many.
        octaves: u32,
        /// Strength from one to the next.
        roughness: f32,
    },
    /// The sum of their magnitudes.
    Wrinkled {
        /// How many.
        octaves: u32,
        /// Strength from one to the next.
        roughness: f32,
    },
    /// Waves where wind blows.
    Windy,
    /// Greyish stone in layers along y.
    Marble {
        /// How many.
        octaves: u32,
        /// Strength from one to the next.
        roughness: f32,
        /// Multiplies the point first.
        scale: f32,
        /// How much layers are bent.
        variation: f32,
    },
}

/// From a point on a surface to texture coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mapping {
    /// The mesh's own coordinates, transformed.
    Uv {
        /// Which of the mesh's sets of texture coordinates: 0 or 1.
        set: u8,
        /// Applied to the surface's coordinates before the look-up.
        transform: Affine2,
    },
    /// `(dot(p, axes[0]), dot(p, axes[1])) + offset` of the point p in texture space.
    Planar {
        /// From the world to texture space.
        from_world: Affine3A,
        /// Directions of u and v.
        axes: [Vec3; 2],
        /// Added.
        offset: Vec2,
    },
    /// `(theta / pi, phi / 2 pi)` of the point's direction from the origin of texture space, whose pole is +z.
    Spherical {
        /// From the world to texture space.
        from_world: Affine3A,
    },
    /// `(phi / 2 pi, z)` of the point around the z axis of texture space.
    Cylindrical {
        /// From the world to texture space.
        from_world: Affine3A,
    },
    /// The point itself in texture space: for solid textures (checkerboards) alone.
    Solid {
        /// From the world to texture space.
        from_world: Affine3A,
    },
}

/// An image with its way of being looked up. (0, 0) is the top left corner of the image, as in glTF.
#[derive(Clone, Debug)]
pub struct ImageTexture {
    /// The picture.
    pub image: Arc<Image>,
    /// Wrapping in u and v.
    pub wrap: [Wrap; 2],
    /// Filtering.
    pub filter: TexelFilter,
    /// Where texels lie on the surface.
    pub mapping: Mapping,
    /// Whether `1 - colour` is meant; alpha stays.
    pub invert: bool,
}

/// A colour, or a factor times a texture's RGB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColorParam {
    /// Linear Rec.709, at least 0.
    pub factor: Vec3,
    /// Multiplied in where present.
    pub texture: Option<TextureId>,
}

impl ColorParam {
    /// A constant colour.
    pub const fn constant(factor: Vec3) -> Self {
        Self { factor, texture: None }
    }
}

/// A number, or a factor times one channel of a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScalarParam {
    /// The constant factor.
    pub factor: f32,
    /// Multiplied in where present: texture and channel (0 = R .. 3 = A).
    pub texture: Option<(TextureId, u8)>,
}

impl ScalarParam {
    /// A constant.
    pub const fn constant(factor: f32) -> Self {
        Self { factor, texture: None }
    }
}
