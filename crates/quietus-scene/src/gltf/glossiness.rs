//! Materials of specular colour and glossiness (KHR_materials_pbrSpecularGlossiness), as the materials that
//! KHR_materials_ior and KHR_materials_specular make of them: an index of refraction of 0, which reflects everything,
//! times the specular colour.

use serde::Deserialize;

use super::schema::{Ior, Material, MetallicRoughness, Specular, TextureInfo};

/// The extension's JSON.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct SpecularGlossiness {
    diffuse_factor: [f32; 4],
    diffuse_texture: Option<TextureInfo>,
    specular_factor: [f32; 3],
    glossiness_factor: f32,
    specular_glossiness_texture: Option<TextureInfo>,
}

impl Default for SpecularGlossiness {
    fn default() -> Self {
        Self {
            diffuse_factor: [1.0; 4],
            diffuse_texture: None,
            specular_factor: [1.0; 3],
            glossiness_factor: 1.0,
            specular_glossiness_texture: None,
        }
    }
}

/// Rewrites `material` if it has the extension, which counts more than metalness and roughness beside it.
pub(super) fn rewrite(material: &mut Material) {
    let extensions = &mut material.extensions;
    let Some(source) = extensions.specular_glossiness.take() else { return };
    material.pbr_metallic_roughness = MetallicRoughness {
        base_color_factor: source.diffuse_factor,
        base_color_texture: source.diffuse_texture,
        metallic_factor: 0.0,
        roughness_factor: 1.0 - source.glossiness_factor,
        metallic_roughness_texture: None,
    };
    extensions.ior = Ior { ior: 0.0 };
    extensions.specular = Specular {
        specular_color_factor: source.specular_factor,
        specular_color_texture: source.specular_glossiness_texture.clone(),
        ..Specular::default()
    };
    extensions.glossiness_texture = source.specular_glossiness_texture;
}
