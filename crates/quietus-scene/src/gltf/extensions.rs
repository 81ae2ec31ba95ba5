//! Which extensions a file may use and require.

use super::document::Document;
use crate::error::{ErrorKind, SceneError};

/// Refuses a file that requires what is not known, and says what is left out of one that can do without.
pub(super) fn check(document: &Document<'_>) -> Result<(), SceneError> {
    let root = &document.root;
    let known = |name: &str| DRAWN.contains(&name) || WITHOUT_EFFECT.contains(&name);
    let foreign = |name: &&String| !known(name);
    let required: Vec<_> = root.extensions_required.iter().filter(foreign).map(String::as_str).collect();
    if !required.is_empty() {
        let drawn = DRAWN.join(", ");
        let message = format!("the file requires {}; supported are {drawn}", required.join(", "));
        return Err(document.error(ErrorKind::Unsupported, "extensionsRequired", message));
    }
    for name in root.extensions_used.iter().filter(foreign) {
        document.warn("extensionsUsed", format!("{name} is not supported; the file is drawn without it"));
    }
    Ok(())
}

/// What is drawn, or, where that says so itself, partly.
const DRAWN: [&str; 26] = [
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_materials_volume_scatter",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_texture_basisu",
    "KHR_texture_transform",
];

/// What tells of a file or of what can be done with it, and changes nothing that a picture shows: notes, features and
/// their metadata, sound, bodies for physics, what can be pointed at and picked, coarser levels of detail and repacked or
/// recompressed pictures beside those of the core, and edges that a viewer might draw over a mesh.
const WITHOUT_EFFECT: [&str; 24] = [
    "AGI_articulations",
    "AGI_stk_metadata",
    "CESIUM_primitive_outline",
    "EXT_instance_features",
    "EXT_mesh_features",
    "EXT_mesh_manifold",
    "EXT_structural_metadata",
    "GODOT_single_root",
    "KHR_audio_emitter",
    "KHR_collision_shapes",
    "KHR_implicit_shapes",
    "KHR_interactivity",
    "KHR_node_hoverability",
    "KHR_node_selectability",
    "KHR_physics_rigid_bodies",
    "KHR_rigid_bodies",
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "MSFT_lod",
    "MSFT_packing_normalRoughnessMetallic",
    "MSFT_packing_occlusionRoughnessMetallic",
    "MSFT_texture_dds",
    "OMI_physics_body",
    "OMI_physics_shape",
];
