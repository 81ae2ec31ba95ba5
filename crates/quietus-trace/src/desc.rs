//! The scene as a reader hands it over: plain data in linear Rec.709, metres and radians, y up by habit only.
//!
//! Nothing here is built for speed. [`SceneDesc`] names textures, materials and objects by index into its own
//! vectors; whoever compiles it into a renderable scene checks the indices and reports the ones out of range.

use std::sync::Arc;

use glam::{Affine2, Affine3A, Mat3, Vec2, Vec3, Vec4};

/// A whole scene.
#[derive(Clone, Debug, Default)]
pub struct SceneDesc {
    /// Surface textures, see [`TextureId`].
    pub textures: Vec<Texture>,
    /// Materials, see [`MaterialId`].
    pub materials: Vec<Material>,
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
}

/// Index into [`SceneDesc::textures`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TextureId(pub u32);

/// Index into [`SceneDesc::materials`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MaterialId(pub u32);

/// Index into [`SceneDesc::objects`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ObjectId(pub u32);

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

/// An image with its way of being looked up. (0, 0) is the top left corner of the image, as in glTF.
#[derive(Clone, Debug)]
pub struct Texture {
    /// The picture.
    pub image: Arc<Image>,
    /// Wrapping in u and v.
    pub wrap: [Wrap; 2],
    /// Filtering.
    pub filter: TexelFilter,
    /// Applied to the surface's coordinates before the look-up.
    pub transform: Affine2,
    /// Which of the mesh's sets of texture coordinates: 0 or 1.
    pub uv_set: u8,
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

/// What a surface is made of.
#[derive(Clone, Debug)]
pub struct Material {
    /// For messages and `quietus info`.
    pub name: String,
    /// How it scatters.
    pub surface: Surface,
    /// Emitted radiance; (0, 0, 0) for none.
    pub emission: ColorParam,
    /// Whether the back side emits too.
    pub emission_two_sided: bool,
    /// Tangent-space normal map: texture, and scale of its x and y.
    pub normal_map: Option<(TextureId, f32)>,
    /// Coverage.
    pub alpha: Alpha,
}

/// Coverage of a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Alpha {
    /// Everywhere 1.
    #[default]
    Opaque,
    /// 1 where the value is at least the cutoff, else 0.
    Mask {
        /// The value.
        value: ScalarParam,
        /// The threshold.
        cutoff: f32,
    },
    /// The value is the probability of being hit.
    Blend {
        /// The value.
        value: ScalarParam,
    },
}

/// How a surface scatters.
#[derive(Clone, Debug)]
pub enum Surface {
    /// Lambert, on both sides.
    Diffuse {
        /// Albedo.
        reflectance: ColorParam,
    },
    /// GGX conductor with complex index of refraction `eta + i k` per colour channel.
    Conductor {
        /// Real part.
        eta: Vec3,
        /// Imaginary part.
        k: Vec3,
        /// Perceptual roughness in 0..1, `alpha = roughness^2`; 0 is a perfect mirror.
        roughness: ScalarParam,
    },
    /// GGX dielectric that refracts; the geometric normal points out of the medium with the given index.
    Dielectric {
        /// Index of refraction inside over outside.
        ior: f32,
        /// Perceptual roughness in 0..1, `alpha = roughness^2`; 0 is perfectly smooth.
        roughness: ScalarParam,
        /// Multiplies what is transmitted.
        tint: ColorParam,
    },
    /// The metallic-roughness model of glTF 2.0 with its extensions.
    MetalRough(Box<MetalRough>),
}

/// The metallic-roughness model of glTF 2.0 (specification, appendix B) and KHR extensions, field by field.
#[derive(Clone, Debug)]
pub struct MetalRough {
    /// Base colour (vertex colours are multiplied in by the renderer).
    pub base_color: ColorParam,
    /// 0 dielectric .. 1 metal.
    pub metallic: ScalarParam,
    /// Perceptual roughness, `alpha = roughness^2`.
    pub roughness: ScalarParam,
    /// KHR_materials_ior; 1.5 by default.
    pub ior: f32,
    /// KHR_materials_specular: strength (texture channel A).
    pub specular: ScalarParam,
    /// KHR_materials_specular: colour of F0.
    pub specular_color: ColorParam,
    /// KHR_materials_transmission: share of light that passes a thin wall (texture channel R).
    pub transmission: ScalarParam,
    /// KHR_materials_clearcoat: strength (channel R).
    pub clearcoat: ScalarParam,
    /// KHR_materials_clearcoat: perceptual roughness (channel G).
    pub clearcoat_roughness: ScalarParam,
    /// KHR_materials_clearcoat: normal map of the coat, texture and scale.
    pub clearcoat_normal: Option<(TextureId, f32)>,
    /// KHR_materials_unlit: shown as its base colour, neither lit nor lighting.
    pub unlit: bool,
}

impl Default for MetalRough {
    /// glTF's own defaults.
    fn default() -> Self {
        Self {
            base_color: ColorParam::constant(Vec3::ONE),
            metallic: ScalarParam::constant(1.0),
            roughness: ScalarParam::constant(1.0),
            ior: 1.5,
            specular: ScalarParam::constant(1.0),
            specular_color: ColorParam::constant(Vec3::ONE),
            transmission: ScalarParam::constant(0.0),
            clearcoat: ScalarParam::constant(0.0),
            clearcoat_roughness: ScalarParam::constant(0.0),
            clearcoat_normal: None,
            unlit: false,
        }
    }
}

/// Shapes that move together.
#[derive(Clone, Debug, Default)]
pub struct Object {
    /// For messages and `quietus info`.
    pub name: String,
    /// Its parts.
    pub shapes: Vec<Shape>,
}

/// One part of an object.
#[derive(Clone, Debug)]
pub struct Shape {
    /// Its form.
    pub geometry: Geometry,
    /// Its material.
    pub material: MaterialId,
}

/// The form of a shape, in object space.
#[derive(Clone, Debug)]
pub enum Geometry {
    /// Triangles.
    Mesh(Arc<Mesh>),
    /// A sphere, its normal pointing outwards.
    Sphere {
        /// Its centre.
        center: Vec3,
        /// Its radius, above 0.
        radius: f32,
    },
}

/// Indexed triangles. Vectors of vertex data are either empty or as long as `positions`.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Vertices.
    pub positions: Vec<Vec3>,
    /// Three vertices each; counter-clockwise seen from the front (the side the geometric normal points to).
    pub triangles: Vec<[u32; 3]>,
    /// Shading normals, of unit length.
    pub normals: Vec<Vec3>,
    /// Tangents, w is the sign of the bitangent; computed from `uvs[0]` when needed and absent.
    pub tangents: Vec<Vec4>,
    /// Two sets of texture coordinates.
    pub uvs: [Vec<Vec2>; 2],
    /// Linear vertex colours with alpha.
    pub colors: Vec<Vec4>,
}

/// An object placed in the world. Mirroring transforms keep the surface's front its front.
#[derive(Clone, Copy, Debug)]
pub struct Instance {
    /// What.
    pub object: ObjectId,
    /// Where; invertible.
    pub to_world: Affine3A,
}

/// A light without a surface.
#[derive(Clone, Debug)]
pub enum Light {
    /// Shines to all sides.
    Point {
        /// Where it stands.
        position: Vec3,
        /// Radiant intensity, per steradian.
        intensity: Vec3,
    },
    /// A cone of light, smooth between the inner and the outer angle as in KHR_lights_punctual.
    Spot {
        /// Where it stands.
        position: Vec3,
        /// Where it looks, of unit length.
        direction: Vec3,
        /// Radiant intensity inside the inner cone.
        intensity: Vec3,
        /// Half angle of the full cone.
        inner_angle: f32,
        /// Half angle at which it has fallen to 0.
        outer_angle: f32,
    },
    /// Parallel light.
    Directional {
        /// Where it shines to, of unit length.
        direction: Vec3,
        /// Irradiance on a surface facing it.
        irradiance: Vec3,
    },
}

/// Light from infinitely far away, all around.
#[derive(Clone, Debug)]
pub struct Environment {
    /// Lat-long map (row 0 looks up, +y; the middle column looks along -z, columns run towards +x);
    /// a constant where absent.
    pub image: Option<Arc<Image>>,
    /// Multiplies the map, or is the constant radiance.
    pub scale: Vec3,
    /// Rotation from the map's space to the world.
    pub to_world: Mat3,
}

/// A perspective camera with a thin lens.
#[derive(Clone, Debug)]
pub struct Camera {
    /// What `--camera` calls it.
    pub name: String,
    /// From camera space (looks along -z, +y up, +x right) to the world; orthonormal with translation.
    pub to_world: Affine3A,
    /// Vertical angle of view of the whole frame.
    pub fov_y: f32,
    /// Width over height it was made for; a hint for the default picture size.
    pub aspect: Option<f32>,
    /// Radius of the lens; 0 is a pinhole.
    pub lens_radius: f32,
    /// Distance along the optical axis at which things are sharp.
    pub focus_distance: f32,
}
