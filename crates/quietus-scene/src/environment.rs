//! Environment maps: lat-long pictures in Radiance `.hdr` or OpenEXR `.exr` files.

use std::path::Path;
use std::sync::Arc;

use glam::{Mat3, Vec3};
use image::ImageFormat;
use quietus_trace::desc::{Environment, EnvironmentLayout};

use crate::error::{ErrorKind, SceneError};
use crate::image::{Encoding, Format, decode};

/// Reads a lat-long environment map: Radiance `.hdr` or OpenEXR `.exr`, told apart by content.
///
/// Values are radiance in linear Rec.709; row 0 looks up and the middle column along -z. Negative values,
/// which filters leave behind, become 0.
///
/// # Errors
/// Where the file is missing, cannot be read, is neither format, is malformed, is larger than 2^27 texels or
/// holds values that are not finite.
pub fn load_environment(path: &Path) -> Result<Environment, SceneError> {
    load_environment_bytes(path, &crate::file::read(path)?)
}

/// As [`load_environment`], with the file's content already in memory: `path` is for messages.
///
/// # Errors
/// As [`load_environment`].
pub fn load_environment_bytes(path: &Path, bytes: &[u8]) -> Result<Environment, SceneError> {
    let format = Format::of(path, bytes);
    let Some(format @ (Format::OpenExr | Format::Known(ImageFormat::Hdr))) = format else {
        let message =
            "expected a Radiance picture (starting with \"#?\") or OpenEXR (starting with 76 2f 31 01)";
        return Err(SceneError::new(ErrorKind::Syntax, path, "byte 0", message));
    };
    let image = decode(path, "", bytes.into(), format, Encoding::Linear, path.display().to_string())?;
    Ok(Environment {
        image: Some(Arc::new(image)),
        layout: EnvironmentLayout::LatLong,
        scale: Vec3::ONE,
        to_world: Mat3::IDENTITY,
        portal: None,
    })
}
