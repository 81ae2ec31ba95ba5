//! The scene as a reader hands it over: plain data in linear Rec.709, metres and radians, y up by habit only.
//!
//! Nothing here is built for speed. [`SceneDesc`] names textures, materials, media and objects by index into its own
//! vectors; whoever compiles it into a renderable scene checks the indices and reports the ones out of range.
//! Things that move are given where they are when the shutter opens (time 0) and when it closes (time 1).

mod camera;
mod geometry;
mod light;
mod material;
mod texture;
mod volume;

pub use camera::{Aperture, Camera, FrameAxis, LensSurface, Lenses, PictureDefaults, Projection};
pub use geometry::{
    CurveKind, CurveSegment, Curves, Geometry, Instance, MediumInterface, Mesh, Object, PatchMesh, Quadric,
    Shape,
};
pub use light::{Environment, EnvironmentLayout, Light, Medium, PictureSpread, Portal, SpotFalloff};
pub use material::{
    Alpha, Anisotropy, Coat, Glass, Hair, HairColor, Interior, Material, Measured, Metal, MetalRough,
    Roughness, RoughnessScale, Sheets, Subsurface, Surface, ThinFilm,
};
pub use texture::{
    ColorParam, Image, ImageTexture, Mapping, NoisePattern, ScalarParam, TexelFilter, Texels, Texture, Wrap,
};
pub use volume::{Density, Glow, Grid, Variation};

/// A whole scene.
#[derive(Clone, Debug, Default)]
pub struct SceneDesc {
    /// Surface textures, see [`TextureId`].
    pub textures: Vec<Texture>,
    /// Materials, see [`MaterialId`].
    pub materials: Vec<Material>,
    /// Participating media, see [`MediumId`].
    pub media: Vec<Medium>,
    /// Objects: groups of shapes that instances place in the world, see [`ObjectId`].
    pub objects: Vec<Object>,
    /// Placements of objects.
    pub instances: Vec<Instance>,
    /// Lights without a surface.
    pub lights: Vec<Light>,
    /// Light from infinitely far away.
    pub environment: Option<Environment>,
    /// Cameras; the first is the default.
    pub cameras: Vec<Camera>,
    /// What the file says of its picture.
    pub picture: PictureDefaults,
}

/// Index into [`SceneDesc::textures`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TextureId(pub u32);

/// Index into [`SceneDesc::materials`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MaterialId(pub u32);

/// Index into [`SceneDesc::media`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MediumId(pub u32);

/// Index into [`SceneDesc::objects`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ObjectId(pub u32);
