//! The reader of glTF 2.0: `container` and `schema` take a file apart, `choice` picks a scene and a variant of it, `document` holds
//! it together with its buffers, `accessor` reads numbers, and `material`, `texture`, `image`, `mesh`, `skin`, `hierarchy`, `animation` and `graph`
//! turn them into a `stage`: all that the file holds, from which the scene at any moment is made by `deform` and `changes`.
//! Points and lines get an extent by `strokes`.
//!
//! Units: glTF's lengths are metres; its photometric units are taken one to one as radiometric ones, so that 1 nit
//! of `emissiveStrength` is a radiance of 1, 1 candela an intensity of 1 per steradian and 1 lux an irradiance of
//! 1, and lights keep their proportions.
//!
//! Left out with a warning: the range of lights, extensions that are not known. Left out without one, because paths make them
//! obsolete: occlusion textures; because they only steer rasterisers: minification filters, clip planes, back-face culling.

mod accessor;
mod animation;
mod changes;
mod choice;
mod container;
mod deform;
mod document;
mod draco;
mod extensions;
mod glossiness;
mod graph;
mod hierarchy;
mod image;
mod keys;
mod material;
mod mesh;
mod meshopt;
mod pointer;
mod schema;
mod skin;
pub(crate) mod sky;
mod stage;
mod strokes;
mod texture;
mod variants;

use std::path::Path;

use quietus_trace::desc::{Camera, SceneDesc, Shape};

use crate::error::SceneError;
use crate::framing::{self, Framing};
use crate::{Loaded, file};
pub use choice::Choice;
use document::Document;
pub(crate) use stage::{Moment, Stage};

/// What is said of that sky.
pub(crate) const PLAIN_SKY: &str =
    "the scene has neither lights nor emitters brighter than white: a plain sky is added to light it";

/// Moments of an animation, evenly spread, that a camera made up for it looks at: eight per second of a clip of four
/// seconds, and between two of a fast one little can happen that the margin does not cover.
const FRAMED_MOMENTS: u16 = 32;

/// Reads what `choice` says of the glTF file at `path`.
pub(crate) fn open(path: &Path, choice: Choice<'_>) -> Result<Stage, SceneError> {
    graph::read(Document::open(path, &file::read(path)?, choice)?)
}

/// Reads a glTF file whose content is `bytes`; `path` is for messages and to find the files beside it.
pub(crate) fn open_bytes(path: &Path, bytes: &[u8]) -> Result<Stage, SceneError> {
    graph::read(Document::open(path, bytes, Choice::default())?)
}

/// The scene at `moment`, with what the file lacks: light, and the camera that `frame` makes.
pub(crate) fn shoot(
    stage: &Stage,
    moment: Moment,
    frame: impl FnOnce() -> Result<Camera, SceneError>,
) -> Result<Loaded, SceneError> {
    let (mut scene, mut warnings) = stage.scene(moment)?;
    if scene.cameras.is_empty() {
        if scene.instances.is_empty() {
            warnings.say("scenes", "there is nothing to draw: no triangles are placed in the scene");
        }
        warnings.say("cameras", match framing::leaves_out(&scene) {
            false => "the scene has no camera: one that frames it is added",
            true => {
                "the scene has no camera: one is added that frames it, but for backdrops that dwarf the rest and for specks far off"
            }
        });
        scene.cameras.push(frame()?);
    }
    if scene.lights.is_empty() && !has_lamps(&scene) {
        warnings.say("", PLAIN_SKY);
        scene.environment = Some(sky::soft());
    }
    Ok(Loaded { scene, warnings: warnings.into_list() })
}

/// Whether something in the scene is brighter than white, and so there to light the rest. What glows less, the lights of
/// instruments and the panels of screens (`emissiveFactor` ends at 1), is there to be seen.
fn has_lamps(scene: &SceneDesc) -> bool {
    let placed =
        scene.instances.iter().flat_map(|instance| &scene.objects[instance.object.0 as usize].shapes);
    let brightest = |shape: &Shape| scene.materials[shape.material.0 as usize].emission.factor.max_element();
    placed.into_iter().any(|shape| brightest(shape) > 1.0)
}

/// A camera that shows all that happens in the animation `clip`, or the rest pose, in a picture of width over height
/// `shape`; without one the shape suits what is shown.
pub(crate) fn frame(stage: &Stage, clip: Option<usize>, shape: Option<f32>) -> Result<Camera, SceneError> {
    let moments: Vec<_> = match clip {
        None => vec![Moment::Rest],
        Some(clip) => {
            let step = stage.clips[clip].seconds / f32::from(FRAMED_MOMENTS - 1);
            let at = |i: u16| Moment::Clip { clip, shutter: [f32::from(i) * step; 2] };
            (0..FRAMED_MOMENTS).map(at).collect()
        }
    };
    let (first, _) = stage.scene(moments[0])?;
    let mut framing = Framing::new(&first, shape);
    for &moment in &moments[1..] {
        framing.include(&stage.scene(moment)?.0);
    }
    Ok(framing.camera())
}
