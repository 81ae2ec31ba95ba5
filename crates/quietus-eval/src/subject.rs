//! What is measured: a scene with its camera, and how it is looked at.

use std::path::Path;

use glam::Vec3;
use quietus_scene::{Warning, embedded, load};
use quietus_trace::{desc, filter::Filter, scene::Scene, view::View};
use serde::{Deserialize, Serialize};

use crate::EvalError;

/// A scene ready to be drawn, seen through its first camera.
#[derive(Debug)]
pub struct Subject {
    /// Short name for tables and file names.
    pub name: String,
    /// What the reader left out, replaced or added.
    pub warnings: Vec<Warning>,
    pub(crate) scene: Scene,
    camera: desc::Camera,
    /// What its author multiplies radiance by.
    wished_exposure: Vec3,
    exposure: Vec3,
}

/// Filters by their names: those that are nowhere negative, as recorded samples are.
pub const FILTERS: [(&str, Filter); 4] = [
    ("box", Filter::BOX),
    ("triangle", Filter::TRIANGLE),
    ("gaussian", Filter::GAUSSIAN),
    ("blackman-harris", Filter::BLACKMAN_HARRIS),
];

/// How a subject is looked at. Pictures with equal looks can be compared.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Look {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Path segments from the camera.
    pub max_depth: u32,
    /// A name of [`FILTERS`].
    pub filter: String,
}

impl Look {
    /// `width` x `height` pixels with the defaults of `quietus render`: 16 segments, Blackman-Harris.
    pub fn new(width: u32, height: u32) -> Self {
        Self { width, height, max_depth: 16, filter: "blackman-harris".to_owned() }
    }

    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    fn filter(&self) -> Result<Filter, EvalError> {
        let found = FILTERS.into_iter().find(|(name, _)| *name == self.filter);
        found.map(|(_, filter)| filter).ok_or_else(|| {
            let names = FILTERS.map(|(name, _)| name).join(", ");
            EvalError::Request(format!("unknown filter \"{}\": expected one of {names}", self.filter))
        })
    }
}

impl Subject {
    /// The scene built into the program.
    ///
    /// # Errors
    /// Where the tracer refuses it.
    pub fn embedded() -> Result<Self, EvalError> {
        Self::new("embedded", &embedded(), Vec::new())
    }

    /// `embedded`, or a file; its name is then the file's stem. A glTF file without lights gets an even sky, so that figures
    /// do not change with the taste in skies.
    ///
    /// # Errors
    /// Where the file cannot be read, or the tracer refuses what is in it.
    pub fn open(source: &str) -> Result<Self, EvalError> {
        if source == "embedded" {
            return Self::embedded();
        }
        let path = Path::new(source);
        let mut loaded = load(path)?;
        loaded.even_out_sky();
        let name = path.file_stem().map_or_else(|| source.to_owned(), |s| s.to_string_lossy().into_owned());
        Self::new(&name, &loaded.scene, loaded.warnings)
    }

    /// Any scene.
    ///
    /// # Errors
    /// Where the scene has no camera, or the tracer refuses it.
    pub fn new(name: &str, scene: &desc::SceneDesc, warnings: Vec<Warning>) -> Result<Self, EvalError> {
        let no_camera = || EvalError::Request(format!("{name}: the scene has no camera"));
        let camera = scene.cameras.first().ok_or_else(no_camera)?.clone();
        let wished_exposure = scene.picture.exposure.unwrap_or(Vec3::ONE);
        let scene =
            Scene::build(scene).map_err(|source| EvalError::Build { scene: name.to_owned(), source })?;
        Ok(Self { name: name.to_owned(), warnings, scene, camera, wished_exposure, exposure: Vec3::ONE })
    }

    /// The same at the exposure that the scene asks for, as it is shown, instead of with radiance as it is.
    pub fn as_shown(self) -> Self {
        Self { exposure: self.wished_exposure, ..self }
    }

    pub(crate) fn view(&self, look: &Look, seed: u64) -> Result<View, EvalError> {
        View::new(&self.camera, [look.width, look.height], look.filter()?, look.max_depth, seed)
            .and_then(|view| view.with_exposure(self.exposure, f32::INFINITY))
            .map_err(|source| EvalError::Camera { scene: self.name.clone(), source })
    }
}
