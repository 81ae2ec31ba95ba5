//! What the tests of the reader share: small documents written in place, and the real scenes beside the repository.
#![allow(dead_code, reason = "each test program uses its own share")]

use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::Vec3;
use quietus_scene::{Loaded, SceneError, SceneFile};
use quietus_trace::desc::{Camera, FrameAxis, Projection};
use serde_json::{Value, json};

/// Little-endian bytes of floats.
pub(crate) fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// A data URI of `bytes`.
pub(crate) fn data_uri(bytes: &[u8]) -> String {
    format!("data:application/octet-stream;base64,{}", STANDARD.encode(bytes))
}

/// One triangle in the plane z = 0, counter-clockwise seen from +z, on one node in one scene.
pub(crate) fn triangle() -> Value {
    let bytes = floats(&[0., 0., 0., 1., 0., 0., 0., 1., 0.]);
    json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": data_uri(&bytes)}]
    })
}

/// Adds a buffer of `bytes` with one view and one accessor `fields` over it; gives the accessor's index.
pub(crate) fn add_accessor(document: &mut Value, bytes: &[u8], fields: Value) -> usize {
    let push = |document: &mut Value, name: &str, item: Value| {
        let array = document[name].as_array_mut().expect("the triangle has this array");
        array.push(item);
        array.len() - 1
    };
    let buffer = push(document, "buffers", json!({"byteLength": bytes.len(), "uri": data_uri(bytes)}));
    let view = push(document, "bufferViews", json!({"buffer": buffer, "byteLength": bytes.len()}));
    let mut accessor = fields;
    accessor["bufferView"] = json!(view);
    push(document, "accessors", accessor)
}

/// Reads `document` as if it were a file called `test.gltf`.
pub(crate) fn read(document: &Value) -> Result<Loaded, SceneError> {
    quietus_scene::load_bytes(Path::new("test.gltf"), document.to_string().as_bytes())
}

/// Reads `document`, which must be without fault.
pub(crate) fn read_ok(document: &Value) -> Loaded {
    read(document).unwrap_or_else(|error| panic!("{error}"))
}

/// Opens `document`, which must be without fault, to look at its animations.
pub(crate) fn scene_file(document: &Value) -> SceneFile {
    let file = SceneFile::open_bytes(Path::new("test.gltf"), document.to_string().as_bytes());
    file.unwrap_or_else(|error| panic!("{error}"))
}

/// How far from the middle of the picture of `camera` the outermost of `points` is seen: 1 is the picture's edge.
pub(crate) fn outermost(camera: &Camera, points: impl Iterator<Item = Vec3>) -> f32 {
    let Projection::Perspective { fov, axis: FrameAxis::Vertical } = camera.projection else {
        panic!("glTF has no {:?}", camera.projection)
    };
    let (slope, aspect) = ((0.5 * fov).tan(), camera.aspect.expect("a shape"));
    let seen = points.map(|point| {
        let seen = camera.to_world.inverse().transform_point3(point);
        assert!(seen.z < 0.0, "{seen} is behind the camera");
        (seen.x.abs() / aspect).max(seen.y.abs()) / (slope * -seen.z)
    });
    seen.fold(0.0, f32::max)
}

/// Path of a file among the big scenes beside the repository. Where they are absent the caller skips its test; on
/// a build server that is a failure.
pub(crate) fn shared(path: &str) -> Option<PathBuf> {
    let full = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scenes").join(path);
    if full.exists() {
        return Some(full);
    }
    assert!(std::env::var_os("CI").is_none_or(|ci| ci != "true"), "{} is not there", full.display());
    eprintln!("SKIPPED: {} is not there", full.display());
    None
}
