//! Environment maps: lat-long pictures in Radiance `.hdr` or OpenEXR `.exr` files.

use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;

use exr::prelude::{ReadChannels, ReadLayers};
use glam::{Mat3, Vec3};
use image::ImageDecoder;
use quietus_trace::desc::{Environment, EnvironmentLayout, Image, Texels};

use crate::error::{ErrorKind, SceneError};

/// Largest environment map that is read, in texels: 16384 x 8192, 2 GiB in memory.
const MAX_TEXELS: u64 = 1 << 27;

/// Reads a lat-long environment map: Radiance `.hdr` or OpenEXR `.exr`, told apart by content.
///
/// Values are radiance in linear Rec.709; row 0 looks up and the middle column along -z. Negative values,
/// which filters leave behind, become 0.
///
/// # Errors
/// Where the file is missing, cannot be read, is neither format, is malformed, is larger than 2^27 texels or
/// holds values that are not finite.
pub fn load_environment(path: &Path) -> Result<Environment, SceneError> {
    let bytes = std::fs::read(path).map_err(|error| SceneError::io(path, &error))?;
    let (width, height, texels) = if bytes.starts_with(b"#?") {
        read_radiance(path, &bytes)?
    } else if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
        read_exr(path, bytes)?
    } else {
        let message =
            "expected a Radiance picture (starting with \"#?\") or OpenEXR (starting with 76 2f 31 01)";
        return Err(SceneError::new(ErrorKind::Syntax, path, "byte 0", message));
    };
    let image = Image {
        name: path.display().to_string(),
        width,
        height,
        texels: Texels::Float(checked(path, width, texels)?),
    };
    Ok(Environment {
        image: Some(Arc::new(image)),
        layout: EnvironmentLayout::LatLong,
        scale: Vec3::ONE,
        to_world: Mat3::IDENTITY,
    })
}

type Pixels = (u32, u32, Vec<[f32; 4]>);

fn check_size(path: &Path, width: u64, height: u64) -> Result<(), SceneError> {
    if width == 0 || height == 0 {
        let message = format!("the picture is {width} x {height}, expected at least 1 x 1");
        return Err(SceneError::new(ErrorKind::Invalid, path, "header", message));
    }
    if width.saturating_mul(height) > MAX_TEXELS {
        let message = format!("the picture is {width} x {height}, expected at most {MAX_TEXELS} texels");
        return Err(SceneError::new(ErrorKind::Unsupported, path, "header", message));
    }
    Ok(())
}

fn read_radiance(path: &Path, bytes: &[u8]) -> Result<Pixels, SceneError> {
    let syntax = |error: image::ImageError| {
        SceneError::new(ErrorKind::Syntax, path, "", format!("is not a whole Radiance picture: {error}"))
    };
    let decoder = image::codecs::hdr::HdrDecoder::new(Cursor::new(bytes)).map_err(syntax)?;
    let (width, height) = decoder.dimensions();
    check_size(path, u64::from(width), u64::from(height))?;
    let image = image::DynamicImage::from_decoder(decoder).map_err(syntax)?;
    let texels = image.into_rgb32f().pixels().map(|p| [p[0], p[1], p[2], 1.0]).collect();
    Ok((width, height, texels))
}

fn read_exr(path: &Path, bytes: Vec<u8>) -> Result<Pixels, SceneError> {
    let syntax = |error: exr::error::Error| {
        let kind = match error {
            exr::error::Error::NotSupported(_) => ErrorKind::Unsupported,
            _ => ErrorKind::Syntax,
        };
        SceneError::new(kind, path, "", format!("is not a whole OpenEXR picture with R, G and B: {error}"))
    };
    let meta = exr::meta::MetaData::read_from_buffered(Cursor::new(&bytes), true).map_err(syntax)?;
    for header in &meta.headers {
        check_size(path, header.layer_size.x() as u64, header.layer_size.y() as u64)?;
    }
    let picture = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| (size.x(), vec![[0.0, 0.0, 0.0, 1.0]; size.x() * size.y()]),
            |(width, texels): &mut (usize, Vec<[f32; 4]>), at, (r, g, b): (f32, f32, f32)| {
                texels[at.y() * *width + at.x()] = [r, g, b, 1.0];
            },
        )
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(syntax)?;
    let size = picture.layer_data.size;
    Ok((size.x() as u32, size.y() as u32, picture.layer_data.channel_data.pixels.1))
}

/// Refuses values that are not finite and lifts negative ones to 0.
fn checked(path: &Path, width: u32, mut texels: Vec<[f32; 4]>) -> Result<Vec<[f32; 4]>, SceneError> {
    for (i, texel) in texels.iter_mut().enumerate() {
        if texel.iter().any(|value| !value.is_finite()) {
            let place = format!("column {}, row {}", i % width as usize, i / width as usize);
            let [r, g, b, _] = texel;
            let message = format!("the texel is ({r}, {g}, {b}), expected finite numbers");
            return Err(SceneError::new(ErrorKind::Invalid, path, place, message));
        }
        *texel = texel.map(|value| value.max(0.0));
    }
    Ok(texels)
}
