//! Scene files that stay open, so that every frame of an animation is made from one reading.

use std::path::Path;
use std::sync::OnceLock;

use quietus_trace::desc::Camera;

use crate::Loaded;
use crate::error::{ErrorKind, SceneError, Warning};
use crate::gltf::{self, Choice, Moment, Stage};
use crate::pbrt;

/// A scene file that was read: pictures, materials and meshes are in memory, and the scene can be asked for as it
/// stands in the file, or at any moment of its animations.
#[derive(Debug)]
pub struct SceneFile(Content);

#[derive(Debug)]
enum Content {
    Gltf(Box<GltfFile>),
    /// pbrt's scenes hold one moment.
    Pbrt(Box<Loaded>),
}

#[derive(Debug)]
struct GltfFile {
    stage: Stage,
    animations: Vec<Animation>,
    shape: Option<f32>,
    /// Cameras made up for the rest pose, and then for each animation.
    framing: Vec<OnceLock<Camera>>,
}

/// An animation of a scene file.
#[derive(Clone, Debug, PartialEq)]
pub struct Animation {
    /// Its name; where the file gives none, its place in the file.
    pub name: String,
    /// How long it is: the time of its last key.
    pub seconds: f32,
}

/// As [`gltf::open`]; a file that is not glTF, and not called so, is said to be no scene at all.
fn open_gltf(path: &Path, choice: Choice<'_>) -> Result<Stage, SceneError> {
    let name = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    gltf::open(path, choice).map_err(|error| {
        let is_foreign = error.kind() == ErrorKind::Syntax && error.place() == "byte 0";
        if !is_foreign || ["gltf", "glb"].contains(&name.as_str()) {
            return error;
        }
        let message = "not a scene: expected glTF 2.0 (.gltf, .glb) or pbrt-v4 (.pbrt, .pbrt.gz)";
        SceneError::new(ErrorKind::Unsupported, path, "", message)
    })
}

impl SceneFile {
    /// Reads the file at `path` and everything it refers to, see [`crate::load`].
    ///
    /// # Errors
    /// As [`crate::load`].
    pub fn open(path: &Path) -> Result<Self, SceneError> {
        Ok(Self(match pbrt::is_named_like(path) {
            true => Content::Pbrt(Box::new(pbrt::load(path)?)),
            false => Content::Gltf(Box::new(GltfFile::new(open_gltf(path, Choice::default())?))),
        }))
    }

    /// As [`Self::open`], with what `choice` says of several scenes and variants of materials.
    ///
    /// # Errors
    /// As [`crate::load`]; where the file has no such scene or variant.
    pub fn open_choice(path: &Path, choice: Choice<'_>) -> Result<Self, SceneError> {
        if !pbrt::is_named_like(path) {
            return Ok(Self(Content::Gltf(Box::new(GltfFile::new(open_gltf(path, choice)?)))));
        }
        let message = match choice {
            Choice { variant: None, scene: None } => return Self::open(path),
            Choice { variant: Some(name), .. } => {
                format!("there is no variant \"{name}\": only glTF has variants of materials")
            }
            Choice { scene: Some(name), .. } => {
                format!("there is no scene \"{name}\": only glTF has several scenes in a file")
            }
        };
        Err(SceneError::new(ErrorKind::Unsupported, path, "", message))
    }

    /// As [`Self::open`], with the file's content already in memory, see [`crate::load_bytes`].
    ///
    /// # Errors
    /// As [`crate::load`].
    pub fn open_bytes(path: &Path, bytes: &[u8]) -> Result<Self, SceneError> {
        Ok(Self(match pbrt::is_named_like(path) {
            true => Content::Pbrt(Box::new(pbrt::load_bytes(path, bytes)?)),
            false => Content::Gltf(Box::new(GltfFile::new(gltf::open_bytes(path, bytes)?))),
        }))
    }

    /// Width over height of the picture that a camera made up for want of one is to fill. Without it the camera
    /// chooses, see [`Camera::aspect`].
    ///
    /// # Panics
    /// When `shape` is not a finite number above 0.
    pub fn set_picture_shape(&mut self, shape: f32) {
        assert!(shape > 0.0 && shape.is_finite(), "a picture cannot be {shape} times as wide as high");
        if let Content::Gltf(file) = &mut self.0 {
            file.shape = Some(shape);
            file.framing.iter_mut().for_each(|camera| *camera = OnceLock::new());
        }
    }

    /// The animations, in the order of the file.
    pub fn animations(&self) -> &[Animation] {
        match &self.0 {
            Content::Gltf(file) => &file.animations,
            Content::Pbrt(_) => &[],
        }
    }

    /// The names of the scenes, in the order of the file; what has none is called by its number.
    pub fn scenes(&self) -> &[String] {
        match &self.0 {
            Content::Gltf(file) => file.stage.scenes(),
            Content::Pbrt(_) => &[],
        }
    }

    /// The names of the variants of materials (KHR_materials_variants), in the order of the file.
    pub fn variants(&self) -> &[String] {
        match &self.0 {
            Content::Gltf(file) => file.stage.variants(),
            Content::Pbrt(_) => &[],
        }
    }

    /// The scene in the pose in which it is stored.
    ///
    /// # Errors
    /// Where the scene contradicts itself, or needs too much memory.
    pub fn still(&self) -> Result<Loaded, SceneError> {
        let file = match &self.0 {
            Content::Gltf(file) => file,
            Content::Pbrt(loaded) => return Ok(Loaded::clone(loaded)),
        };
        let mut loaded = gltf::shoot(&file.stage, Moment::Rest, || file.frame(None))?;
        if !file.animations.is_empty() {
            let message = "the pose stored in the file is drawn, not a moment of its animations";
            loaded.warnings.push(Warning { place: "animations".to_owned(), message: message.to_owned() });
        }
        Ok(loaded)
    }

    /// The scene while an animation runs: `shutter` says when the shutter opens and when it closes, in seconds from
    /// the animation's beginning. What moves in between does so in straight lines and shortest arcs; equal times give
    /// a scene that stands still. Outside of its keys an animation stands as at the nearest one.
    ///
    /// A camera that is made up is the same for all moments of an animation, and shows all of them.
    ///
    /// # Errors
    /// Where the scene contradicts itself at that time, or needs too much memory.
    ///
    /// # Panics
    /// When `animation` is not below the number of [`Self::animations`].
    pub fn animated(&self, animation: usize, shutter: [f32; 2]) -> Result<Loaded, SceneError> {
        let count = self.animations().len();
        let Content::Gltf(file) = &self.0 else { panic!("animation {animation} of {count}") };
        assert!(animation < count, "animation {animation} of {count}");
        let moment = Moment::Clip { clip: animation, shutter };
        gltf::shoot(&file.stage, moment, || file.frame(Some(animation)))
    }
}

impl GltfFile {
    fn new(stage: Stage) -> Self {
        let animation = |(name, seconds): (&str, f32)| Animation { name: name.to_owned(), seconds };
        let animations: Vec<_> = stage.clips().map(animation).collect();
        let framing = (0..=animations.len()).map(|_| OnceLock::new()).collect();
        Self { stage, animations, shape: None, framing }
    }

    fn frame(&self, clip: Option<usize>) -> Result<Camera, SceneError> {
        let kept = &self.framing[clip.map_or(0, |clip| clip + 1)];
        if let Some(camera) = kept.get() {
            return Ok(camera.clone());
        }
        let camera = gltf::frame(&self.stage, clip, self.shape)?;
        Ok(kept.get_or_init(|| camera).clone())
    }
}
