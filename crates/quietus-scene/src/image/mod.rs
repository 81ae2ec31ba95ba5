//! Pictures for textures and environments: PNG, JPEG, TGA, BMP, WebP, QOI, Radiance HDR, OpenEXR, PFM and KTX2, told
//! apart by content.
//!
//! A hostile file may not take more memory than is stated here: [`MAX_TEXELS`], [`MAX_DECODER_BYTES`] and, for all
//! pictures of a scene, [`MAX_SCENE_BYTES`].

mod batch;
mod exr_file;
mod ktx2;
mod pfm;

use std::io::Cursor;
use std::path::Path;

use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};
use quietus_trace::desc::{Image, Texels};
use quietus_trace::texture::srgb_to_linear;

pub(crate) use batch::{Budget, ImageId, Images};

use crate::error::{ErrorKind, SceneError};
use crate::limit;

/// Largest picture, in texels: 16384 x 8192, or 2 GiB of floats.
const MAX_TEXELS: u64 = limit(1 << 27);
/// Most memory a decoder may take for one picture, in bytes.
const MAX_DECODER_BYTES: u64 = limit(1 << 31);
/// Most memory the pictures of one scene may take, in bytes.
const MAX_SCENE_BYTES: u64 = limit(1 << 34);

/// How numbers in a picture of 8 or 16 bits become linear ones. Pictures of floats are linear already.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Encoding {
    /// Colours with the sRGB curve; alpha is linear.
    Srgb,
    /// Plain numbers.
    Linear,
    /// The same where a negative number is a mistake, and not what a filter left behind.
    NotNegative,
    /// Colours that are the linear value to the power of `1 / exponent`; alpha is linear.
    Gamma(f32),
}

impl Encoding {
    /// Colour and alpha from encoded ones in 0..1.
    fn decode(self, value: f32, channel: usize) -> f32 {
        match self {
            _ if channel == 3 => value,
            Self::Linear | Self::NotNegative => value,
            Self::Srgb => srgb_to_linear(value),
            Self::Gamma(exponent) => value.powf(exponent),
        }
    }

    /// Equal where pictures decode to equal texels.
    fn key(self) -> (u8, u32) {
        match self {
            Self::Srgb => (0, 0),
            Self::Linear => (1, 0),
            Self::Gamma(exponent) => (2, exponent.to_bits()),
            Self::NotNegative => (3, 0),
        }
    }
}

/// What a file holds, by its first bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    /// One of the formats of the `image` crate.
    Known(ImageFormat),
    /// OpenEXR.
    OpenExr,
    /// Portable float map.
    Pfm,
    /// KTX 2.0, of Basis Universal or plain.
    Ktx2,
}

impl Format {
    /// The format of `bytes`; TGA, which has no mark of its own, by the extension of `file`.
    pub(crate) fn of(file: &Path, bytes: &[u8]) -> Option<Self> {
        if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
            return Some(Self::OpenExr);
        }
        if bytes.starts_with(b"PF\n") || bytes.starts_with(b"Pf\n") {
            return Some(Self::Pfm);
        }
        if bytes.starts_with(&ktx2::MAGIC) {
            return Some(Self::Ktx2);
        }
        if bytes.starts_with(b"#?") {
            return Some(Self::Known(ImageFormat::Hdr));
        }
        if let Ok(format) = image::guess_format(bytes) {
            return Some(Self::Known(format));
        }
        let tga = file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("tga"));
        tga.then_some(Self::Known(ImageFormat::Tga))
    }

    /// What people call it.
    pub(crate) fn name(self) -> String {
        match self {
            Self::Known(format) => format!("{format:?}"),
            Self::OpenExr => "OpenEXR".to_owned(),
            Self::Pfm => "PFM".to_owned(),
            Self::Ktx2 => "KTX2".to_owned(),
        }
    }
}

/// What is read, for messages.
const FORMATS: &str = "PNG, JPEG, TGA, BMP, WebP, QOI, Radiance HDR, OpenEXR, PFM or KTX2";

/// Reads the picture in the file at `path`.
///
/// # Errors
/// As [`decode`]; where the file is missing or cannot be read.
pub(crate) fn read(path: &Path, encoding: Encoding) -> Result<Image, SceneError> {
    read_bytes(path, &crate::file::read(path)?, encoding)
}

/// As [`read`], with the file's content already in memory.
pub(crate) fn read_bytes(path: &Path, bytes: &[u8], encoding: Encoding) -> Result<Image, SceneError> {
    let Some(format) = Format::of(path, bytes) else {
        let message = format!("the picture is of an unknown kind, expected {FORMATS}");
        return Err(SceneError::new(ErrorKind::Unsupported, path, "", message));
    };
    decode(path, "", bytes.into(), format, encoding, path.display().to_string())
}

/// Decodes a picture; errors blame `place` in `file`. Negative floats become 0.
///
/// # Errors
/// Where the picture is malformed, of a format that is not read, larger than the limits of this module, or holds
/// numbers that are not finite, or negative where that is a mistake.
pub(crate) fn decode(
    file: &Path,
    place: &str,
    bytes: std::borrow::Cow<'_, [u8]>,
    format: Format,
    encoding: Encoding,
    name: String,
) -> Result<Image, SceneError> {
    let ([width, height], texels) = match format {
        Format::OpenExr => {
            let (size, texels) = exr_file::decode(file, place, bytes.into_owned())?;
            (size, Texels::Float(checked(file, place, size[0], texels, encoding)?))
        }
        Format::Pfm => {
            let (size, texels) =
                pfm::decode(&bytes).map_err(|(kind, message)| SceneError::new(kind, file, place, message))?;
            (size, Texels::Float(checked(file, place, size[0], texels, encoding)?))
        }
        Format::Ktx2 => {
            let fault = |(kind, message)| SceneError::new(kind, file, place, message);
            let picture = ktx2::decode(&bytes).map_err(fault)?;
            ([picture.width(), picture.height()], known_texels(file, place, picture, encoding)?)
        }
        Format::Known(format) => {
            let picture = decode_known(file, place, &bytes, format)?;
            let size = [picture.width(), picture.height()];
            (size, known_texels(file, place, picture, encoding)?)
        }
    };
    Ok(Image { name, width, height, texels })
}

/// Decodes one of the formats of the `image` crate.
fn decode_known(
    file: &Path,
    place: &str,
    bytes: &[u8],
    format: ImageFormat,
) -> Result<DynamicImage, SceneError> {
    let fail = |kind, message: String| SceneError::new(kind, file, place, message);
    let decoding = |error: ImageError| match error {
        ImageError::Limits(_) => {
            fail(ErrorKind::Unsupported, format!("the picture is larger than this program reads: {error}"))
        }
        ImageError::Unsupported(_) => {
            fail(ErrorKind::Unsupported, format!("the picture is not read: {error}"))
        }
        _ => fail(ErrorKind::Syntax, format!("is not a whole {format:?} picture: {error}")),
    };
    let mut limits = Limits::default();
    limits.max_alloc = Some(MAX_DECODER_BYTES);
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(decoding)?;
    let (width, height) = decoder.dimensions();
    check_size(u64::from(width), u64::from(height)).map_err(|(kind, message)| fail(kind, message))?;
    DynamicImage::from_decoder(decoder).map_err(decoding)
}

/// Refuses pictures without texels and such with more than [`MAX_TEXELS`].
fn check_size(width: u64, height: u64) -> Result<(), (ErrorKind, String)> {
    if width == 0 || height == 0 {
        return Err((ErrorKind::Invalid, format!("the picture is {width} x {height}, expected texels")));
    }
    if width.saturating_mul(height) > MAX_TEXELS {
        let message = format!("the picture is {width} x {height}, expected at most {MAX_TEXELS} texels");
        return Err((ErrorKind::Unsupported, message));
    }
    Ok(())
}

/// Keeps 8 bits where the tracer has a curve for them; everything else becomes floats.
fn known_texels(
    file: &Path,
    place: &str,
    picture: DynamicImage,
    encoding: Encoding,
) -> Result<Texels, SceneError> {
    use DynamicImage::{ImageLuma8, ImageLumaA8, ImageRgb8, ImageRgb32F, ImageRgba8, ImageRgba32F};
    let width = picture.width();
    Ok(match picture {
        ImageRgb32F(_) | ImageRgba32F(_) => {
            let texels = picture.into_rgba32f().pixels().map(|pixel| pixel.0).collect();
            Texels::Float(checked(file, place, width, texels, encoding)?)
        }
        ImageLuma8(_) | ImageLumaA8(_) | ImageRgb8(_) | ImageRgba8(_) => {
            let texels = picture.into_rgba8();
            match encoding {
                Encoding::Srgb => Texels::Srgb8(texels.pixels().map(|pixel| pixel.0).collect()),
                Encoding::Linear | Encoding::NotNegative => {
                    Texels::Linear8(texels.pixels().map(|pixel| pixel.0).collect())
                }
                Encoding::Gamma(_) => {
                    let table: [f32; 256] =
                        std::array::from_fn(|code| encoding.decode(code as f32 / 255.0, 0));
                    let texel = |[r, g, b, a]: [u8; 4]| {
                        let [r, g, b] = [r, g, b].map(|code| table[usize::from(code)]);
                        [r, g, b, f32::from(a) / 255.0]
                    };
                    Texels::Float(texels.pixels().map(|pixel| texel(pixel.0)).collect())
                }
            }
        }
        _ => {
            let decode = |value: u16, channel| encoding.decode(f32::from(value) / 65535.0, channel);
            let picture = picture.into_rgba16();
            let texel = |pixel: [u16; 4]| std::array::from_fn(|i| decode(pixel[i], i));
            Texels::Float(picture.pixels().map(|pixel| texel(pixel.0)).collect())
        }
    })
}

/// Refuses values that are not finite and lifts negative ones, which filters leave behind, to 0, or refuses them too.
fn checked(
    file: &Path,
    place: &str,
    width: u32,
    mut texels: Vec<[f32; 4]>,
    encoding: Encoding,
) -> Result<Vec<[f32; 4]>, SceneError> {
    let may_not_be_negative = encoding == Encoding::NotNegative;
    let is_sound = |value: &f32| value.is_finite() && !(may_not_be_negative && *value < 0.0);
    let expected =
        if may_not_be_negative { "finite numbers that are not negative" } else { "finite numbers" };
    for (i, texel) in texels.iter_mut().enumerate() {
        if !texel.iter().all(is_sound) {
            let at = format!("column {}, row {}", i % width as usize, i / width as usize);
            let at = if place.is_empty() { at } else { format!("{place}, {at}") };
            let [r, g, b, _] = texel;
            let message = format!("the texel is ({r}, {g}, {b}), expected {expected}");
            return Err(SceneError::new(ErrorKind::Invalid, file, at, message));
        }
        *texel = texel.map(|value| value.max(0.0));
    }
    Ok(texels)
}

/// Bytes that the texels take in memory.
fn bytes_of(image: &Image) -> u64 {
    let texel = match image.texels {
        Texels::Srgb8(_) | Texels::Linear8(_) => 4,
        Texels::Float(_) => 16,
    };
    u64::from(image.width) * u64::from(image.height) * texel
}

#[cfg(test)]
mod tests;
