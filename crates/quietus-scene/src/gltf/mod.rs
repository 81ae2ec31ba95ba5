//! The reader of glTF 2.0: `container` and `schema` take a file apart, `document` holds it together with its
//! buffers, `accessor` reads numbers, and `material`, `image`, `mesh` and `graph` turn them into a scene.
//!
//! Units: glTF's lengths are metres; its photometric units are taken one to one as radiometric ones, so that 1 nit
//! of `emissiveStrength` is a radiance of 1, 1 candela an intensity of 1 per steradian and 1 lux an irradiance of
//! 1, and lights keep their proportions.
//!
//! Left out with a warning: animations, skins and morph targets (the rest pose is drawn), points and lines,
//! orthographic cameras, the range of lights. Left out without one, because paths make them obsolete: occlusion
//! textures; because they only steer rasterisers: minification filters, clip planes, back-face culling.

mod accessor;
mod container;
mod document;
mod graph;
mod image;
mod material;
mod mesh;
mod schema;

use std::path::Path;

use glam::{Mat3, Vec3};
use quietus_trace::desc::{Environment, EnvironmentLayout, SceneDesc};

use crate::error::SceneError;
use crate::{Loaded, file, framing, summary};
use document::Document;

/// Radiance of the sky given to scenes without any light: bluish, and with a mean luminance below 1 so that white
/// surfaces stay inside of what a picture can show.
const SKY: Vec3 = Vec3::new(0.72, 0.80, 0.92);

/// What is said of that sky.
pub(crate) const PLAIN_SKY: &str =
    "the scene has neither lights nor emitters: a plain sky is added to light it";

/// Reads the glTF file at `path`.
pub(crate) fn load(path: &Path) -> Result<Loaded, SceneError> {
    load_bytes(path, &file::read(path)?)
}

/// Reads a glTF file whose content is `bytes`; `path` is for messages and to find the files beside it.
pub(crate) fn load_bytes(path: &Path, bytes: &[u8]) -> Result<Loaded, SceneError> {
    let document = Document::open(path, bytes)?;
    let mut scene = graph::build(&document)?;
    complete(&document, &mut scene);
    Ok(Loaded { scene, warnings: document.into_warnings() })
}

/// Adds what a picture needs and the file lacks.
fn complete(document: &Document<'_>, scene: &mut SceneDesc) {
    if scene.cameras.is_empty() {
        let bounds = summary::bounds(scene);
        if bounds.is_none() {
            document.warn("scenes", "there is nothing to draw: no triangles are placed in the scene");
        }
        document.warn("cameras", "the scene has no camera: one that frames it is added");
        let camera = framing::frame(scene, bounds.unwrap_or([Vec3::NEG_ONE, Vec3::ONE]));
        scene.cameras.push(camera);
    }
    let placed =
        scene.instances.iter().flat_map(|instance| &scene.objects[instance.object.0 as usize].shapes);
    let emitters = placed.filter(|shape| summary::emits(&scene.materials[shape.material.0 as usize]));
    if scene.lights.is_empty() && emitters.count() == 0 {
        document.warn("", PLAIN_SKY);
        let (scale, to_world) = (SKY, Mat3::IDENTITY);
        scene.environment =
            Some(Environment { image: None, layout: EnvironmentLayout::LatLong, scale, to_world });
    }
}
