//! Materials: how surfaces scatter and emit.

use std::sync::Arc;

use glam::Vec3;

use super::{ColorParam, MaterialId, ScalarParam, TextureId};

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
    /// Bump map: height above the surface, in world units.
    pub bump: Option<ScalarParam>,
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
    /// Never hit; but what it emits shines, and is found where light is sampled (pbrt-v4's lights of alpha 0).
    Unseen,
}

/// How a surface scatters.
#[derive(Clone, Debug)]
pub enum Surface {
    /// Lambert, on both sides.
    Diffuse {
        /// Albedo.
        reflectance: ColorParam,
    },
    /// GGX conductor; smooth where the roughness is 0.
    Conductor {
        /// What it is made of.
        metal: Metal,
        /// Of its surface.
        roughness: Roughness,
    },
    /// GGX dielectric that refracts; the geometric normal points out of the medium with the given index.
    Dielectric {
        /// Index of refraction inside over outside.
        ior: f32,
        /// Of its surface; smooth where it is 0.
        roughness: Roughness,
        /// Multiplies what is transmitted.
        tint: ColorParam,
    },
    /// A dielectric that disperses light, has a film on it, or keeps the light that its facets throw at each other.
    Glass(Box<Glass>),
    /// A pane: two parallel smooth interfaces so close that light leaves where it came in.
    ThinDielectric {
        /// Index of refraction.
        ior: f32,
    },
    /// A diffuse base under a dielectric coat with a medium between, as in pbrt-v4 (layered after Guo, Hasan,
    /// Zhao 2018).
    CoatedDiffuse {
        /// Albedo of the base.
        reflectance: ColorParam,
        /// The coat.
        coat: Coat,
    },
    /// A metal under a dielectric coat with a medium between, as in pbrt-v4.
    CoatedConductor {
        /// What the base is made of.
        metal: Metal,
        /// Of the base.
        roughness: Roughness,
        /// The coat.
        coat: Coat,
    },
    /// Lambert on both sides, and through: thin leaves, paper.
    DiffuseTransmission {
        /// Share reflected.
        reflectance: ColorParam,
        /// Share transmitted.
        transmittance: ColorParam,
    },
    /// Glass that light enters to wander below it in a medium of its own: skin, wax, milk, marble.
    Subsurface(Box<Subsurface>),
    /// What a device has measured, on both sides.
    Measured(Arc<Measured>),
    /// A fibre (Chiang et al. 2016), for curves.
    Hair(Box<Hair>),
    /// Each hit is the first material with probability `1 - amount`, else the second.
    Mix {
        /// The two; neither may lead back here.
        materials: [MaterialId; 2],
        /// Share of the second, in 0..1.
        amount: ScalarParam,
    },
    /// No surface at all, only the border between two media.
    Interface,
    /// The metallic-roughness model of glTF 2.0 with its extensions.
    MetalRough(Box<MetalRough>),
}

/// A GGX dielectric that refracts, with more to it; the geometric normal points out of the medium with the given index.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glass {
    /// Index of refraction inside over outside, per colour channel. Where channels differ a path goes on with one of them.
    pub ior: Vec3,
    /// Of its surface; smooth where it is 0.
    pub roughness: Roughness,
    /// Multiplies what is transmitted.
    pub tint: ColorParam,
    /// On its surface.
    pub film: ThinFilm,
    /// Whether what facets throw at each other comes out in the end, on both sides; pbrt-v4 loses it. With a film, or where
    /// its surface is rougher one way than the other, it is lost all the same.
    pub keeps_light: bool,
}

/// A surface that light enters, and what is below it, on the side that its geometric normal points away from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Subsurface {
    /// Index of refraction inside over outside.
    pub ior: f32,
    /// Of its surface; smooth where it is 0.
    pub roughness: Roughness,
    /// What is below, as it is where light enters: for all of its walk.
    pub interior: Interior,
    /// Henyey-Greenstein asymmetry, in -1..1.
    pub g: f32,
}

/// Samples over the unit square, corner to corner, bilinear in between: sheet after sheet, row after row.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheets<T> {
    /// Columns and rows, each at least 2.
    pub size: [u32; 2],
    /// The values of all sheets.
    pub values: Vec<T>,
}

/// A surface as it was measured (Dupuy and Jakob 2018, "An Adaptive Parameterization for Efficient Material Acquisition and
/// Rendering").
///
/// There is one sheet for each direction of view, whose azimuths are slower than their polar angles, and one alone of
/// `facets` and `area`. Columns of `facets`, `area` and `visible` are the square root of the polar angle over pi / 2, rows the
/// azimuth, from -pi to pi; where there are two azimuths of view at most the surface is isotropic, and azimuths of facets count
/// from that of the view.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Azimuths of view, ascending, in radians.
    pub azimuths: Vec<f32>,
    /// Polar angles of view, ascending, in radians.
    pub polar_angles: Vec<f32>,
    /// How many facets have which normal.
    pub facets: Sheets<f32>,
    /// Area of the facets, projected to a direction of view.
    pub area: Sheets<f32>,
    /// How many facets of which normal are seen from a direction of view; at least 0, and not 0 everywhere.
    pub visible: Sheets<f32>,
    /// How bright what is seen there is, over the numbers in the unit square by which `visible` draws; at least 0, and not
    /// 0 everywhere.
    pub luminance: Sheets<f32>,
    /// What is seen there: four times BSDF and cosine, times `area` over `facets`.
    pub colors: Sheets<Vec3>,
}

impl Measured {
    /// Whether it looks the same from all sides.
    pub fn is_isotropic(&self) -> bool {
        self.azimuths.len() <= 2
    }
}

/// A medium below a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Interior {
    /// By its coefficients per metre.
    Coefficients {
        /// Absorption, at least 0.
        absorption: ColorParam,
        /// Scattering, at least 0.
        scattering: ColorParam,
    },
    /// By what is seen of it.
    Reflectance {
        /// What a thick piece gives back of the light that has entered it, in 0..1.
        reflectance: ColorParam,
        /// Mean free path in metres, at least 0.
        mean_free_path: ColorParam,
    },
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
    /// KHR_materials_diffuse_transmission: share of what is scattered below the gloss that leaves on the other side
    /// (channel A).
    pub diffuse_transmission: ScalarParam,
    /// KHR_materials_diffuse_transmission: colour of that.
    pub diffuse_transmission_color: ColorParam,
    /// KHR_materials_iridescence.
    pub film: ThinFilm,
    /// KHR_materials_clearcoat: strength (channel R).
    pub clearcoat: ScalarParam,
    /// KHR_materials_clearcoat: perceptual roughness (channel G).
    pub clearcoat_roughness: ScalarParam,
    /// KHR_materials_clearcoat: normal map of the coat, texture and scale.
    pub clearcoat_normal: Option<(TextureId, f32)>,
    /// KHR_materials_anisotropy.
    pub anisotropy: Anisotropy,
    /// KHR_materials_sheen: colour; black for none.
    pub sheen_color: ColorParam,
    /// KHR_materials_sheen: perceptual roughness (channel A).
    pub sheen_roughness: ScalarParam,
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
            diffuse_transmission: ScalarParam::constant(0.0),
            diffuse_transmission_color: ColorParam::constant(Vec3::ONE),
            film: ThinFilm::NONE,
            clearcoat: ScalarParam::constant(0.0),
            clearcoat_roughness: ScalarParam::constant(0.0),
            clearcoat_normal: None,
            anisotropy: Anisotropy::default(),
            sheen_color: ColorParam::constant(Vec3::ZERO),
            sheen_roughness: ScalarParam::constant(0.0),
            unlit: false,
        }
    }
}

/// KHR_materials_anisotropy: how much wider the specular lobe is along one direction, `alpha` there being mixed with 1
/// by the square of the strength.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Anisotropy {
    /// In 0..1; 0 for none.
    pub strength: f32,
    /// From the tangent to that direction, in radians, counter-clockwise.
    pub rotation: f32,
    /// Red and green: the direction in tangent space, -1..1 as 0..1, to be rotated; blue: multiplies the strength.
    pub texture: Option<TextureId>,
}

/// A film so thin that light reflected by its two borders interferes (Belcour and Barla 2017).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThinFilm {
    /// Share of the surface it covers, in 0..1 (texture channel R).
    pub strength: ScalarParam,
    /// Index of refraction, at least 1.
    pub ior: f32,
    /// Least and greatest thickness in nanometres.
    pub thickness: [f32; 2],
    /// Between these: 0 for the least, 1 for the greatest (channel G).
    pub place: ScalarParam,
}

impl ThinFilm {
    /// No film; with the thickness and index that KHR_materials_iridescence has by default.
    pub const NONE: Self = Self {
        strength: ScalarParam::constant(0.0),
        ior: 1.3,
        thickness: [100.0, 400.0],
        place: ScalarParam::constant(1.0),
    };
}

/// What a conductor is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Metal {
    /// Complex index of refraction `eta + i k` per colour channel.
    Index {
        /// Real part, above 0.
        eta: Vec3,
        /// Imaginary part, at least 0.
        k: Vec3,
    },
    /// Reflectance at normal incidence; eta is 1 and k follows from it, `k = 2 sqrt(r) / sqrt(1 - r)`.
    Reflectance(ColorParam),
}

/// Roughness of a microfacet surface along and across the tangent (the direction in which u grows).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Roughness {
    /// Along the tangent, in 0..1.
    pub u: ScalarParam,
    /// Across the tangent, in 0..1.
    pub v: ScalarParam,
    /// How the numbers become GGX alphas.
    pub scale: RoughnessScale,
}

/// From roughness to the alpha of GGX.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RoughnessScale {
    /// `alpha = roughness^2`, glTF's perceptual roughness.
    #[default]
    Squared,
    /// `alpha = sqrt(roughness)`, pbrt's default.
    SquareRoot,
    /// `alpha = roughness`.
    Alpha,
}

impl Roughness {
    /// The same along and across, on glTF's perceptual scale.
    pub const fn perceptual(roughness: ScalarParam) -> Self {
        Self { u: roughness, v: roughness, scale: RoughnessScale::Squared }
    }

    /// Perfectly smooth.
    pub const SMOOTH: Self = Self::perceptual(ScalarParam::constant(0.0));
}

/// The upper layer of a coated material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coat {
    /// Index of refraction.
    pub ior: f32,
    /// Of its surface.
    pub roughness: Roughness,
    /// Depth of the medium between coat and base, in mean free paths of 1.
    pub thickness: ScalarParam,
    /// Single-scattering albedo of that medium; black for none.
    pub albedo: ColorParam,
    /// Its Henyey-Greenstein asymmetry, in -1..1.
    pub g: ScalarParam,
    /// How many times light that has entered may scatter or pass the medium, as pbrt-v4 counts it (there 10): longer
    /// paths between coat and base are cut off.
    pub max_depth: u32,
}

/// A hair fibre: Chiang, Bitterli, Tappan, Burley 2016, "A Practical and Controllable Hair and Fur Model".
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hair {
    /// What colours it.
    pub color: HairColor,
    /// Index of refraction; 1.55.
    pub ior: f32,
    /// Longitudinal roughness in 0..1.
    pub beta_m: ScalarParam,
    /// Azimuthal roughness in 0..1.
    pub beta_n: ScalarParam,
    /// Tilt of the scales, in radians.
    pub alpha: f32,
}

/// What colours a hair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HairColor {
    /// Absorption coefficient per fibre radius.
    Absorption(ColorParam),
    /// The colour that a thick head of it shows.
    Reflectance(ColorParam),
    /// Concentration of pigments.
    Pigments {
        /// Brown to black.
        eumelanin: ScalarParam,
        /// Red.
        pheomelanin: ScalarParam,
    },
}
