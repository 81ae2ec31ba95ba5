//! Real scenes of pbrt-v4: what is in them, as counted in their files by hand.

mod common;

use std::path::PathBuf;

use common::shared;
use quietus_scene::{load, summary};

/// All scenes of pbrt beside the repository.
fn scenes() -> Option<Vec<PathBuf>> {
    let folder = shared("cornell-box")?.parent()?.to_owned();
    let mut found = Vec::new();
    for scene in std::fs::read_dir(folder).expect("a readable folder") {
        let Ok(files) = std::fs::read_dir(scene.expect("a readable folder").path()) else { continue };
        let paths = files.map(|file| file.expect("a readable folder").path());
        found.extend(paths.filter(|path| path.extension().is_some_and(|extension| extension == "pbrt")));
    }
    found.sort();
    Some(found)
}

#[test]
fn all_scenes_read_without_error() {
    let Some(scenes) = scenes() else { return };
    assert!(scenes.len() >= 18, "only {} scenes", scenes.len());
    for path in scenes {
        let loaded = load(&path).unwrap_or_else(|error| panic!("{error}"));
        let sum = summary(&loaded.scene);
        assert!(sum.bounds.is_some() && sum.cameras.len() == 1, "{}", path.display());
    }
}
