//! OpenEXR: the first layer with R, G and B (and A), or with Y.

use std::io::Cursor;
use std::path::Path;

use exr::error::Error;
use exr::image::read::specific_channels::ReadSpecificChannel;
use exr::prelude::{ReadChannels, ReadLayers};

use super::{MAX_DECODER_BYTES, check_size};
use crate::error::{ErrorKind, SceneError};

/// Width and height, and the texels row by row from the top.
pub(super) type Floats = ([u32; 2], Vec<[f32; 4]>);

/// Decodes an OpenEXR picture; errors blame `place` in `file`.
pub(super) fn decode(file: &Path, place: &str, bytes: Vec<u8>) -> Result<Floats, SceneError> {
    let failed = |error: Error| {
        let kind = match error {
            Error::NotSupported(_) => ErrorKind::Unsupported,
            _ => ErrorKind::Syntax,
        };
        let message = format!("is not a whole OpenEXR picture with R, G and B, or Y: {error}");
        SceneError::new(kind, file, place, message)
    };
    let meta = exr::meta::MetaData::read_from_buffered(Cursor::new(&bytes), true).map_err(failed)?;
    for header in &meta.headers {
        let at = if place.is_empty() { "header" } else { place };
        check_size(header.layer_size.x() as u64, header.layer_size.y() as u64)
            .map_err(|(kind, message)| SceneError::new(kind, file, at, message))?;
        // A tile may be larger than the picture, and blocks are decoded as a whole.
        let block = header.max_block_pixel_size();
        let bytes = [block.x(), block.y(), header.channels.bytes_per_pixel]
            .into_iter()
            .fold(1_u64, |bytes, factor| bytes.saturating_mul(factor as u64));
        if bytes > MAX_DECODER_BYTES {
            let message = format!("blocks of {bytes} bytes, expected at most {MAX_DECODER_BYTES}");
            return Err(SceneError::new(ErrorKind::Unsupported, file, at, message));
        }
    }
    let has = |name: &str| {
        let mut channels = meta.headers.iter().flat_map(|header| &header.channels.list);
        channels.any(|channel| channel.name == *name)
    };
    if has("Y") && !has("R") { grey(bytes) } else { color(bytes) }.map_err(failed)
}

/// Row-major texels while a layer is read.
type Rows = (usize, Vec<[f32; 4]>);

fn color(bytes: Vec<u8>) -> Result<Floats, Error> {
    let picture = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgba_channels(
            |size, _| (size.x(), vec![[0.0; 4]; size.x() * size.y()]),
            |(width, texels): &mut Rows, at, (r, g, b, a): (f32, f32, f32, f32)| {
                texels[at.y() * *width + at.x()] = [r, g, b, a];
            },
        )
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))?;
    let size = picture.layer_data.size;
    Ok(([size.x() as u32, size.y() as u32], picture.layer_data.channel_data.pixels.1))
}

fn grey(bytes: Vec<u8>) -> Result<Floats, Error> {
    let picture = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .specific_channels()
        .required("Y")
        .collect_pixels(
            |size, _| (size.x(), vec![[0.0; 4]; size.x() * size.y()]),
            |(width, texels): &mut Rows, at: exr::math::Vec2<usize>, (y,): (f32,)| {
                texels[at.y() * *width + at.x()] = [y, y, y, 1.0];
            },
        )
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))?;
    let size = picture.layer_data.size;
    Ok(([size.x() as u32, size.y() as u32], picture.layer_data.channel_data.pixels.1))
}
