//! The JSON of materials and of their references to textures, with the KHR extensions of both.

use serde::Deserialize;

use super::super::glossiness::SpecularGlossiness;

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(in super::super) struct Material {
    pub name: String,
    pub pbr_metallic_roughness: MetallicRoughness,
    pub normal_texture: Option<TextureInfo>,
    pub emissive_texture: Option<TextureInfo>,
    pub emissive_factor: [f32; 3],
    pub alpha_mode: Option<String>,
    pub alpha_cutoff: Option<f32>,
    pub double_sided: bool,
    pub extensions: MaterialExtensions,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(in super::super) struct MetallicRoughness {
    pub base_color_factor: [f32; 4],
    pub base_color_texture: Option<TextureInfo>,
    pub metallic_factor: f32,
    pub roughness_factor: f32,
    pub metallic_roughness_texture: Option<TextureInfo>,
}

impl Default for MetallicRoughness {
    fn default() -> Self {
        Self {
            base_color_factor: [1.0; 4],
            base_color_texture: None,
            metallic_factor: 1.0,
            roughness_factor: 1.0,
            metallic_roughness_texture: None,
        }
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(in super::super) struct MaterialExtensions {
    #[serde(rename = "KHR_materials_emissive_strength")]
    pub emissive_strength: EmissiveStrength,
    #[serde(rename = "KHR_materials_transmission")]
    pub transmission: Transmission,
    #[serde(rename = "KHR_materials_ior")]
    pub ior: Ior,
    #[serde(rename = "KHR_materials_specular")]
    pub specular: Specular,
    #[serde(rename = "KHR_materials_clearcoat")]
    pub clearcoat: Clearcoat,
    #[serde(rename = "KHR_materials_anisotropy")]
    pub anisotropy: Anisotropy,
    #[serde(rename = "KHR_materials_sheen")]
    pub sheen: Sheen,
    #[serde(rename = "KHR_materials_volume")]
    pub volume: Volume,
    #[serde(rename = "KHR_materials_volume_scatter")]
    pub volume_scatter: VolumeScatter,
    #[serde(rename = "KHR_materials_diffuse_transmission")]
    pub diffuse_transmission: DiffuseTransmission,
    #[serde(rename = "KHR_materials_dispersion")]
    pub dispersion: Dispersion,
    #[serde(rename = "KHR_materials_iridescence")]
    pub iridescence: Iridescence,
    #[serde(rename = "KHR_materials_unlit")]
    pub unlit: Option<serde::de::IgnoredAny>,
    #[serde(rename = "KHR_materials_pbrSpecularGlossiness")]
    pub specular_glossiness: Option<SpecularGlossiness>,
    /// Its alpha is glossiness: what is left of the extension above once it has been rewritten.
    #[serde(skip)]
    pub glossiness_texture: Option<TextureInfo>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(in super::super) struct Anisotropy {
    pub anisotropy_strength: f32,
    pub anisotropy_rotation: f32,
    pub anisotropy_texture: Option<TextureInfo>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(in super::super) struct Sheen {
    pub sheen_color_factor: [f32; 3],
    pub sheen_color_texture: Option<TextureInfo>,
    pub sheen_roughness_factor: f32,
    pub sheen_roughness_texture: Option<TextureInfo>,
}

/// The thickness texture is for renderers that do not trace the far side of a thing.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(in super::super) struct Volume {
    pub thickness_factor: f32,
    pub attenuation_distance: Option<f32>,
    pub attenuation_color: [f32; 3],
}

impl Default for Volume {
    fn default() -> Self {
        Self { thickness_factor: 0.0, attenuation_distance: None, attenuation_color: [1.0; 3] }
    }
}

/// A draft, whose colour files call by both names.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(in super::super) struct VolumeScatter {
    #[serde(alias = "multiscatterColorFactor")]
    pub multiscatter_color: [f32; 3],
    pub scatter_anisotropy: f32,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(in super::super) struct DiffuseTransmission {
    pub diffuse_transmission_factor: f32,
    pub diffuse_transmission_texture: Option<TextureInfo>,
    pub diffuse_transmission_color_factor: [f32; 3],
    pub diffuse_transmission_color_texture: Option<TextureInfo>,
}

impl Default for DiffuseTransmission {
    fn default() -> Self {
        Self {
            diffuse_transmission_factor: 0.0,
            diffuse_transmission_texture: None,
            diffuse_transmission_color_factor: [1.0; 3],
            diffuse_transmission_color_texture: None,
        }
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(in super::super) struct Dispersion {
    pub dispersion: f32,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(in super::super) struct Iridescence {
    pub iridescence_factor: f32,
    pub iridescence_texture: Option<TextureInfo>,
    pub iridescence_ior: f32,
    pub iridescence_thickness_minimum: f32,
    pub iridescence_thickness_maximum: f32,
    pub iridescence_thickness_texture: Option<TextureInfo>,
}

impl Default for Iridescence {
    fn default() -> Self {
        Self {
            iridescence_factor: 0.0,
            iridescence_texture: None,
            iridescence_ior: 1.3,
            iridescence_thickness_minimum: 100.0,
            iridescence_thickness_maximum: 400.0,
            iridescence_thickness_texture: None,
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(in super::super) struct EmissiveStrength {
    pub emissive_strength: f32,
}

impl Default for EmissiveStrength {
    fn default() -> Self {
        Self { emissive_strength: 1.0 }
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(in super::super) struct Transmission {
    pub transmission_factor: f32,
    pub transmission_texture: Option<TextureInfo>,
}

#[derive(Debug, Deserialize)]
#[serde(default)]
pub(in super::super) struct Ior {
    pub ior: f32,
}

impl Default for Ior {
    fn default() -> Self {
        Self { ior: 1.5 }
    }
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(in super::super) struct Specular {
    pub specular_factor: f32,
    pub specular_texture: Option<TextureInfo>,
    pub specular_color_factor: [f32; 3],
    pub specular_color_texture: Option<TextureInfo>,
}

impl Default for Specular {
    fn default() -> Self {
        Self {
            specular_factor: 1.0,
            specular_texture: None,
            specular_color_factor: [1.0; 3],
            specular_color_texture: None,
        }
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(in super::super) struct Clearcoat {
    pub clearcoat_factor: f32,
    pub clearcoat_texture: Option<TextureInfo>,
    pub clearcoat_roughness_factor: f32,
    pub clearcoat_roughness_texture: Option<TextureInfo>,
    pub clearcoat_normal_texture: Option<TextureInfo>,
}

/// A reference to a texture; `scale` is there for normal maps only.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(in super::super) struct TextureInfo {
    pub index: usize,
    #[serde(default)]
    pub tex_coord: usize,
    pub scale: Option<f32>,
    #[serde(default)]
    pub extensions: TextureInfoExtensions,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub(in super::super) struct TextureInfoExtensions {
    #[serde(rename = "KHR_texture_transform")]
    pub transform: Option<TextureTransform>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(in super::super) struct TextureTransform {
    pub offset: [f32; 2],
    pub rotation: f32,
    pub scale: [f32; 2],
    pub tex_coord: Option<usize>,
}

impl Default for TextureTransform {
    fn default() -> Self {
        Self { offset: [0.0; 2], rotation: 0.0, scale: [1.0; 2], tex_coord: None }
    }
}
