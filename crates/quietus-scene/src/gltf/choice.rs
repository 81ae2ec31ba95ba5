//! What a file offers for choice: several scenes, and variants of materials.

use std::path::Path;

use super::schema::Root;
use super::variants;
use crate::error::{ErrorKind, SceneError};

/// Which of the alternatives in a glTF file are read. By default those that the file itself shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Choice<'a> {
    /// What meshes are made of: a variant of materials by its name, see [`crate::SceneFile::variants`].
    pub variant: Option<&'a str>,
    /// The scene, by its name or by its number from 0, see [`crate::SceneFile::scenes`].
    pub scene: Option<&'a str>,
}

impl Choice<'_> {
    /// Makes `root` what was chosen of it.
    pub(super) fn apply(&self, root: &mut Root, file: &Path) -> Result<(), SceneError> {
        if let Some(name) = self.variant {
            variants::choose(root, name, file)?;
        }
        if let Some(name) = self.scene {
            root.scene = Some(scene(root, name, file)?);
        }
        Ok(())
    }
}

/// The names of all scenes; what has none is called by its number.
pub(super) fn scene_names(root: &Root) -> Vec<String> {
    let name = |(i, name): (usize, &String)| if name.is_empty() { i.to_string() } else { name.clone() };
    root.scenes.iter().enumerate().map(|(i, scene)| name((i, &scene.name))).collect()
}

/// The scene that is called `name`, or has that number.
fn scene(root: &Root, name: &str, file: &Path) -> Result<usize, SceneError> {
    let names = scene_names(root);
    let number = || name.parse().ok().filter(|&number| number < names.len());
    names.iter().position(|known| known == name).or_else(number).ok_or_else(|| {
        let message = match names.len() {
            0 => format!("there is no scene \"{name}\": the file has none"),
            count => {
                let listed = variants::listed(&names);
                format!("there is no scene \"{name}\", expected {listed}, or a number below {count}")
            }
        };
        SceneError::new(ErrorKind::Invalid, file, "scenes", message)
    })
}
