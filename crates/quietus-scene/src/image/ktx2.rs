//! KTX 2.0: pictures of Basis Universal (ETC1S and UASTC), which `basisu` transcodes, and plain ones of 8 bits.
//!
//! Of a picture's levels the first is read, of its layers and faces too: footprints of rays are filtered from it.

use std::panic::catch_unwind;

use basisu::{DecodeFlags, Error, TargetFormat, Transcoder};
use image::{DynamicImage, RgbaImage};

use super::{MAX_DECODER_BYTES, check_size};
use crate::error::ErrorKind;

/// What every such file begins with.
pub(super) const MAGIC: [u8; 12] = *b"\xabKTX 20\xbb\r\n\x1a\n";

/// Bytes of the header and of the first entry of the index of levels.
const HEADER: usize = 80 + 24;

type Fault = (ErrorKind, String);

/// Decodes the picture in `bytes`.
pub(super) fn decode(bytes: &[u8]) -> Result<DynamicImage, Fault> {
    let syntax = |message: &str| (ErrorKind::Syntax, format!("is not a whole KTX2 picture: {message}"));
    let header: &[u8; HEADER] = bytes.first_chunk().ok_or_else(|| syntax("its header is cut off"))?;
    let [format, _, width, height, depth] = [12, 16, 20, 24, 28].map(|at| word(header, at));
    check_size(u64::from(width), u64::from(height))?;
    if depth > 1 {
        return Err((ErrorKind::Unsupported, format!("the picture is {depth} deep, expected a flat one")));
    }
    let texels = match format {
        0 => {
            check_ranges(bytes, header).map_err(syntax)?;
            // The transcoder is young: what it does not expect of a broken file is that file's fault.
            let texels = catch_unwind(|| transcode(bytes, width, height));
            texels.map_err(|_| syntax("it holds what cannot be transcoded"))??
        }
        _ => plain(bytes, header, format, width, height)?,
    };
    let picture = RgbaImage::from_raw(width, height, texels);
    picture.map(DynamicImage::ImageRgba8).ok_or_else(|| syntax("texels are missing"))
}

/// Whether all that the header and the index of levels speak of is in the file, and nothing is said to become larger than
/// any picture: the transcoder takes that for granted.
fn check_ranges(bytes: &[u8], header: &[u8; HEADER]) -> Result<(), &'static str> {
    let is_inside =
        |start: u64, length: u64| start.checked_add(length).is_some_and(|end| end <= bytes.len() as u64);
    let narrow = [48, 56].map(|at| (word(header, at).into(), word(header, at + 4).into()));
    let wide = (long(header, 64), long(header, 72));
    if ![narrow[0], narrow[1], wide].iter().all(|&(start, length)| is_inside(start, length)) {
        return Err("its header speaks of more than there is");
    }
    let levels = word(header, 40).max(1) as usize;
    let index = bytes.get(80..).and_then(|rest| rest.get(..levels.checked_mul(24)?));
    for level in index.ok_or("its levels are cut off")?.chunks_exact(24) {
        if !is_inside(long(level, 0), long(level, 8)) || long(level, 16) > MAX_DECODER_BYTES {
            return Err("its index of levels speaks of more than there is");
        }
    }
    Ok(())
}

/// Texels of Basis Universal.
fn transcode(bytes: &[u8], width: u32, height: u32) -> Result<Vec<u8>, Fault> {
    let fault = |error: Error| match error {
        Error::InvalidData | Error::Truncated => {
            (ErrorKind::Syntax, format!("is not a whole picture of Basis Universal: {error:?}"))
        }
        error => (ErrorKind::Unsupported, format!("the picture of Basis Universal is not read: {error:?}")),
    };
    let transcoder = Transcoder::new(bytes).map_err(fault)?;
    let size = transcoder.base_dimensions();
    if size != (width, height) {
        return Err((ErrorKind::Syntax, format!("is {width} x {height} and {} x {}", size.0, size.1)));
    }
    transcoder.transcode_image(0, 0, 0, TargetFormat::Rgba32, DecodeFlags::NONE).map_err(fault)
}

/// Texels as they are, of one to four channels of 8 bits: Vulkan's formats of these, with and without the sRGB curve,
/// which what the picture is used for decides on.
fn plain(
    bytes: &[u8],
    header: &[u8; HEADER],
    format: u32,
    width: u32,
    height: u32,
) -> Result<Vec<u8>, Fault> {
    let channels = match format {
        9 | 15 => 1,
        16 | 22 => 2,
        23 | 29 => 3,
        37 | 43 => 4,
        _ => {
            let message = format!(
                "the KTX2 picture has Vulkan's format {format}, expected Basis Universal or channels of 8 bits"
            );
            return Err((ErrorKind::Unsupported, message));
        }
    };
    if word(header, 44) != 0 {
        let message = "the KTX2 picture is compressed a second time, which is read of Basis Universal alone";
        return Err((ErrorKind::Unsupported, message.to_owned()));
    }
    let [start, length] = [80, 88].map(|at| long(header, at));
    let expected = u64::from(width) * u64::from(height) * channels;
    let level = usize::try_from(start).ok().and_then(|start| bytes.get(start..)?.get(..expected as usize));
    let Some(level) = level.filter(|_| length >= expected) else {
        let message = format!("its first level has {length} bytes from byte {start} on, expected {expected}");
        return Err((ErrorKind::Syntax, format!("is not a whole KTX2 picture: {message}")));
    };
    // What is missing is 0, and alpha 1.
    let texel = |texel: &[u8]| {
        std::array::from_fn::<u8, 4, _>(|i| texel.get(i).copied().unwrap_or(if i == 3 { 255 } else { 0 }))
    };
    Ok(level.chunks_exact(channels as usize).flat_map(texel).collect())
}

/// The little-endian number at byte `at`.
fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(std::array::from_fn(|i| bytes[at + i]))
}

/// The same of eight bytes.
fn long(bytes: &[u8], at: usize) -> u64 {
    u64::from(word(bytes, at)) | u64::from(word(bytes, at + 4)) << 32
}
