//! What is done with hostile bytes. Every reader gives something or an error with words; none panics, hangs or takes
//! more memory than its limits say. The ordinary tests replay the corpora through the same functions.

use std::path::Path;

use quietus_scene::{Loaded, SceneError, SceneFile};
use quietus_trace::desc::SceneDesc;
use quietus_trace::filter::Filter;
use quietus_trace::scene::Scene;
use quietus_trace::view::View;

/// What reads bytes.
pub type Reader = fn(&[u8]);

/// Each reader with the name of its target and of its corpus.
pub const READERS: [(&str, Reader); 8] = [
    ("gltf", gltf),
    ("pbrt", pbrt),
    ("ply", ply),
    ("image", image),
    ("tga", tga),
    ("environment", environment),
    ("nanovdb", nanovdb),
    ("measured", measured),
];

/// Larger scenes are read but not built: the fuzzer is to try many small ones.
const MAX_BUILT: u64 = 1 << 14;

/// A path in a folder that does not exist, so that only the bytes themselves are read.
fn path(name: &str) -> &Path {
    Path::new(match name {
        "gltf" => "no/such/folder/fuzz.gltf",
        "pbrt" => "no/such/folder/fuzz.pbrt",
        "tga" => "no/such/folder/fuzz.tga",
        _ => "no/such/folder/fuzz",
    })
}

/// Any bytes as a glTF file: its rest pose and a moment of each of its first animations.
pub fn gltf(bytes: &[u8]) {
    let Some(file) = accept(SceneFile::open_bytes(path("gltf"), bytes)) else { return };
    build(file.still());
    for animation in 0..file.animations().len().min(2) {
        build(file.animated(animation, [0.25, 0.375]));
    }
}

/// Any bytes as a pbrt-v4 file.
pub fn pbrt(bytes: &[u8]) {
    build(quietus_scene::load_bytes(path("pbrt"), bytes));
}

/// Any bytes as a PLY file.
pub fn ply(bytes: &[u8]) {
    accept(quietus_scene::read_ply_bytes(path("ply"), bytes));
}

/// Any bytes as a picture of a kind that its first bytes tell.
pub fn image(bytes: &[u8]) {
    accept(quietus_scene::read_image_bytes(path("image"), bytes));
}

/// Any bytes as a TGA picture, which nothing but its name tells.
pub fn tga(bytes: &[u8]) {
    accept(quietus_scene::read_image_bytes(path("tga"), bytes));
}

/// Any bytes as an environment map.
pub fn environment(bytes: &[u8]) {
    accept(quietus_scene::load_environment_bytes(path("environment"), bytes));
}

/// Any bytes as a file of NanoVDB.
pub fn nanovdb(bytes: &[u8]) {
    accept(quietus_scene::read_nanovdb_bytes(path("nanovdb"), bytes));
}

/// Any bytes as a measured material.
pub fn measured(bytes: &[u8]) {
    accept(quietus_scene::read_measured_bytes(path("measured"), bytes));
}

/// Errors say what is wrong.
fn accept<T>(result: Result<T, SceneError>) -> Option<T> {
    result.inspect_err(|error| assert!(!error.message().is_empty())).ok()
}

/// A scene that was read is drawn, or refused by the tracer with words.
fn build(loaded: Result<Loaded, SceneError>) {
    let Some(Loaded { scene, .. }) = accept(loaded) else { return };
    let summary = quietus_scene::summary(&scene);
    if summary.instanced_triangles > MAX_BUILT || summary.instances > MAX_BUILT {
        return;
    }
    if let Err(error) = Scene::build(&scene) {
        assert!(!error.to_string().is_empty());
    }
    look(&scene);
}

fn look(scene: &SceneDesc) {
    let camera = scene.cameras.first().expect("every scene that is read has a camera");
    if let Err(error) = View::new(camera, [16, 9], Filter::BOX, 4, 0) {
        assert!(!error.to_string().is_empty());
    }
}
