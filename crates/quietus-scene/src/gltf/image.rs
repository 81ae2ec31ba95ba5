//! Pictures: PNG and JPEG, of 8 or 16 bits, from files, data URIs and buffer views.

use std::borrow::Cow;
use std::collections::HashMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};
use quietus_trace::desc::{Image, Texels};

use super::document::Document;
use crate::error::{ErrorKind, SceneError};

/// Largest picture, in texels: 16384 x 8192.
const MAX_TEXELS: u64 = 1 << 27;
/// Most memory a decoder may take for one picture, in bytes.
const MAX_DECODER_BYTES: u64 = 1 << 31;
/// Most memory the pictures of one scene may take.
const MAX_IMAGE_BYTES: u64 = 1 << 34;

/// Whether a picture holds colours or plain numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Encoding {
    /// Colours with the sRGB curve.
    Srgb,
    /// Plain numbers.
    Linear,
}

/// The pictures decoded so far, each once per encoding.
#[derive(Default)]
pub(super) struct ImageCache {
    images: HashMap<(usize, Encoding), Arc<Image>>,
    bytes: u64,
}

impl ImageCache {
    /// Image `index`, referred to from `place`.
    pub(super) fn get(
        &mut self,
        document: &Document<'_>,
        index: usize,
        encoding: Encoding,
        place: &str,
    ) -> Result<Arc<Image>, SceneError> {
        if let Some(image) = self.images.get(&(index, encoding)) {
            return Ok(Arc::clone(image));
        }
        let image = Arc::new(decode(document, index, encoding, place)?);
        self.bytes += u64::from(image.width) * u64::from(image.height) * texel_size(&image.texels);
        if self.bytes > MAX_IMAGE_BYTES {
            let message = format!("the scene's pictures take over {MAX_IMAGE_BYTES} bytes");
            return Err(document.error(ErrorKind::Unsupported, &format!("images[{index}]"), message));
        }
        self.images.insert((index, encoding), Arc::clone(&image));
        Ok(image)
    }
}

fn texel_size(texels: &Texels) -> u64 {
    match texels {
        Texels::Srgb8(_) | Texels::Linear8(_) => 4,
        Texels::Float(_) => 16,
    }
}

fn decode(
    document: &Document<'_>,
    index: usize,
    encoding: Encoding,
    place: &str,
) -> Result<Image, SceneError> {
    let source = document.get(&document.root.images, index, "images", place)?;
    let own = format!("images[{index}]");
    let scene = || document.invalid(&own, "").file().to_path_buf();
    let (bytes, file, at): (Cow<'_, [u8]>, PathBuf, String) = match (&source.uri, source.buffer_view) {
        (Some(uri), None) => {
            let (bytes, file) = document.fetch(uri, &format!("{own}.uri"))?;
            let at = if uri.starts_with("data:") { format!("{own}.uri") } else { String::new() };
            (bytes.into(), file, at)
        }
        (None, Some(view)) => {
            let at = format!("{own}.bufferView");
            (document.view(view, &at)?.0.into(), scene(), at)
        }
        _ => return Err(document.invalid(&own, "expected either a uri or a bufferView, and not both")),
    };
    let picture = decode_bytes(&file, &at, &bytes)?;
    let name = if source.name.is_empty() { own } else { source.name.clone() };
    let (width, height) = (picture.width(), picture.height());
    Ok(Image { name, width, height, texels: texels(picture, encoding) })
}

/// Decodes a PNG or JPEG; errors blame `place` in `file`.
fn decode_bytes(file: &Path, place: &str, bytes: &[u8]) -> Result<DynamicImage, SceneError> {
    let fail = |kind, message: String| SceneError::new(kind, file, place, message);
    let format = image::guess_format(bytes).ok();
    let Some(format @ (ImageFormat::Png | ImageFormat::Jpeg)) = format else {
        let found = format.map_or("of an unknown kind".to_owned(), |format| format!("{format:?}"));
        return Err(fail(ErrorKind::Unsupported, format!("the picture is {found}, expected PNG or JPEG")));
    };
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
    if width == 0 || height == 0 {
        return Err(fail(ErrorKind::Invalid, format!("the picture is {width} x {height}, expected texels")));
    }
    if u64::from(width) * u64::from(height) > MAX_TEXELS {
        let message = format!("the picture is {width} x {height}, expected at most {MAX_TEXELS} texels");
        return Err(fail(ErrorKind::Unsupported, message));
    }
    DynamicImage::from_decoder(decoder).map_err(decoding)
}

fn texels(picture: DynamicImage, encoding: Encoding) -> Texels {
    use DynamicImage::{ImageLuma8, ImageLumaA8, ImageRgb8, ImageRgba8};
    let eight_bits = matches!(picture, ImageLuma8(_) | ImageLumaA8(_) | ImageRgb8(_) | ImageRgba8(_));
    if eight_bits {
        let texels = picture.into_rgba8().pixels().map(|pixel| pixel.0).collect();
        return match encoding {
            Encoding::Srgb => Texels::Srgb8(texels),
            Encoding::Linear => Texels::Linear8(texels),
        };
    }
    let decode = |value: u16, channel: usize| {
        let value = f32::from(value) / 65535.0;
        if encoding == Encoding::Srgb && channel < 3 { srgb_to_linear(value) } else { value }
    };
    let picture = picture.into_rgba16();
    let texels = picture.pixels().map(|pixel| std::array::from_fn(|i| decode(pixel.0[i], i))).collect();
    Texels::Float(texels)
}

/// The sRGB curve (IEC 61966-2-1), both ends in 0..1.
fn srgb_to_linear(value: f32) -> f32 {
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}
