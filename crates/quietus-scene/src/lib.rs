//! Scene readers of Quietus: glTF 2.0 and pbrt-v4 files, environment maps, and the scene built into the program.
//!
//! Everything read is checked before it is used: a file that is truncated, contradicts itself or asks for absurd
//! amounts of memory gives a [`SceneError`] that names file, place and what was expected, never a panic. What a
//! reader has to leave out or make up is said in [`Warning`]s.

mod embedded;
mod environment;
mod error;
mod file;
mod fingerprint;
mod framing;
mod gltf;
mod image;
mod measured;
mod nanovdb;
mod pbrt;
mod ply;
mod scene_file;
mod summary;
mod tensor;

use std::path::Path;

use quietus_trace::desc::{Environment, SceneDesc};

pub use embedded::embedded;
pub use environment::{load_environment, load_environment_bytes};
pub use error::{ErrorKind, SceneError, Warning};
pub use fingerprint::{Fingerprint, files_read};
pub use gltf::Choice;
pub use nanovdb::NanoGrid;
pub use scene_file::{Animation, SceneFile};
pub use summary::{Summary, summary};

/// A limit on what a file may make its reader hold; under the fuzzer a smaller one, so that it finds ways around it
/// before it has filled the machine's memory.
const fn limit(bytes: u64) -> u64 {
    if cfg!(fuzzing) { bytes >> 8 } else { bytes }
}

/// A scene as read from a file.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The scene; every index in it is in range, and it has at least one camera.
    pub scene: SceneDesc,
    /// What was left out, replaced or added, in the order of the file.
    pub warnings: Vec<Warning>,
}

impl Loaded {
    /// Puts `environment` around the scene instead of its own surroundings. Where those were a plain sky made up
    /// for want of lights, the warning that said so goes with it.
    pub fn surround(&mut self, environment: Environment) {
        self.scene.environment = Some(environment);
        self.warnings.retain(|warning| warning.message != gltf::PLAIN_SKY);
    }

    /// Takes the scene's surroundings away: what is not lit by lamps of its own is dark. The warning of a sky that was made up
    /// for want of lights goes with it.
    pub fn uncover(&mut self) {
        self.scene.environment = None;
        self.warnings.retain(|warning| warning.message != gltf::PLAIN_SKY);
    }

    /// Where the reader made up a sky for want of lights, makes it the same on all sides, with the same mean.
    pub fn even_out_sky(&mut self) {
        if self.warnings.iter().any(|warning| warning.message == gltf::PLAIN_SKY) {
            self.scene.environment = Some(even_sky());
        }
    }
}

/// A sky that is the same on all sides, with the mean of the one that scenes without lights get.
pub fn even_sky() -> Environment {
    gltf::sky::even()
}

/// Reads the scene at `path` and everything it refers to: pbrt-v4 where the name ends in `.pbrt` or `.pbrt.gz`, else
/// glTF 2.0 (`.gltf` or `.glb`, told apart by content) in the pose in which it is stored: [`SceneFile`] gives moments
/// of its animations.
///
/// A glTF scene without camera gets one that frames it, and one with neither lights nor emitters brighter than white gets a plain
/// sky, brighter above than below; both are said in the warnings.
///
/// # Errors
/// Where a file is missing, cannot be read, is malformed or contradictory, or requires what is not supported.
pub fn load(path: &Path) -> Result<Loaded, SceneError> {
    SceneFile::open(path)?.still()
}

/// As [`load`], with the file's content already in memory: `path` tells the format, is for messages, and to find the
/// files beside it.
///
/// # Errors
/// As [`load`].
pub fn load_bytes(path: &Path, bytes: &[u8]) -> Result<Loaded, SceneError> {
    SceneFile::open_bytes(path, bytes)?.still()
}

/// Decodes a picture of any format that scenes may use (PNG, JPEG, TGA, BMP, WebP, QOI, Radiance HDR, OpenEXR, PFM or KTX2)
/// as colours with the sRGB curve, where it does not hold floats; `path` is for messages, and its extension tells TGA,
/// which has no mark of its own.
///
/// # Errors
/// Where the picture is malformed, of another format, or larger than 2^27 texels.
pub fn read_image_bytes(path: &Path, bytes: &[u8]) -> Result<quietus_trace::desc::Image, SceneError> {
    image::read_bytes(path, bytes, image::Encoding::Srgb)
}

/// Reads a picture of numbers, of the formats of [`read_image_bytes`]: width and height, and row by row the mean of red, green
/// and blue. Pictures of 8 and 16 bits run from 0 to 1 without a curve.
///
/// # Errors
/// Where the file is missing, cannot be read, is malformed, of another format, larger than 2^27 texels, or holds numbers that
/// are negative or not finite.
pub fn read_map(path: &Path) -> Result<([u32; 2], Vec<f32>), SceneError> {
    use quietus_trace::desc::Texels;
    let image = image::read(path, image::Encoding::NotNegative)?;
    let mean = |rgb: [f32; 3]| rgb.iter().sum::<f32>() / 3.0;
    let values = match &image.texels {
        Texels::Srgb8(texels) | Texels::Linear8(texels) => {
            texels.iter().map(|&[r, g, b, _]| mean([r, g, b].map(f32::from)) / 255.0).collect()
        }
        Texels::Float(texels) => texels.iter().map(|&[r, g, b, _]| mean([r, g, b])).collect(),
    };
    Ok(([image.width, image.height], values))
}

/// Reads all grids of a NanoVDB file whose content is `bytes`; `path` is for messages.
///
/// # Errors
/// Where the file is malformed, packed with BLOSC, of another version than 32, or holds other values than 32-bit floats.
pub fn read_nanovdb_bytes(path: &Path, bytes: &[u8]) -> Result<Vec<NanoGrid>, SceneError> {
    nanovdb::read_all(path, bytes)
}

/// Reads the measured material in a tensor file (`.bsdf`) whose content is `bytes`; `path` is for messages.
///
/// # Errors
/// Where the file is malformed, or measures a part of all azimuths only.
pub fn read_measured_bytes(path: &Path, bytes: &[u8]) -> Result<quietus_trace::desc::Measured, SceneError> {
    measured::read(path, bytes, pbrt::channels_of_wavelengths)
}

/// Reads the mesh in a PLY file whose content is `bytes`, unpacked; `path` is for messages.
///
/// # Errors
/// Where the file is malformed or holds no mesh.
pub fn read_ply_bytes(path: &Path, bytes: &[u8]) -> Result<quietus_trace::desc::Mesh, SceneError> {
    ply::parse(path, bytes)
}
