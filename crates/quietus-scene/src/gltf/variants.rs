//! KHR_materials_variants: other materials for some of the meshes, under a name.

use std::path::Path;

use super::schema::Root;
use crate::error::{ErrorKind, SceneError};

const PLACE: &str = "extensions.KHR_materials_variants.variants";

/// The names of all variants; what has none is called by its place.
pub(super) fn names(root: &Root) -> Vec<String> {
    let variants = root.extensions.variants.variants.iter().enumerate();
    let name =
        |(i, name): (usize, &String)| if name.is_empty() { format!("{PLACE}[{i}]") } else { name.clone() };
    variants.map(|(i, variant)| name((i, &variant.name))).collect()
}

/// Gives each primitive the material that it has in the variant called `name`; those that the variant does not mention
/// keep their own.
pub(super) fn choose(root: &mut Root, name: &str, file: &Path) -> Result<(), SceneError> {
    let names = names(root);
    let Some(index) = names.iter().position(|known| known == name) else {
        let message = match names.is_empty() {
            true => format!("there is no variant \"{name}\": the file has none"),
            false => format!("there is no variant \"{name}\", expected {}", listed(&names)),
        };
        return Err(SceneError::new(ErrorKind::Invalid, file, PLACE, message));
    };
    for primitive in root.meshes.iter_mut().flat_map(|mesh| &mut mesh.primitives) {
        let mut mappings = primitive.extensions.variants.mappings.iter();
        if let Some(mapping) = mappings.find(|mapping| mapping.variants.contains(&index)) {
            primitive.material = Some(mapping.material);
        }
    }
    Ok(())
}

/// The names for a message.
pub(super) fn listed(names: &[String]) -> String {
    names.iter().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", ")
}
