//! Pictures: PNG, JPEG and WebP, from files, data URIs and buffer views.

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

use ::image::ImageFormat;
use quietus_trace::desc::Image;

use super::document::Document;
use crate::error::{ErrorKind, SceneError};
use crate::image::{Format, MAX_SCENE_BYTES, bytes_of};

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
        self.bytes += bytes_of(&image);
        if self.bytes > MAX_SCENE_BYTES {
            let message = format!("the scene's pictures take over {MAX_SCENE_BYTES} bytes");
            return Err(document.error(ErrorKind::Unsupported, &format!("images[{index}]"), message));
        }
        self.images.insert((index, encoding), Arc::clone(&image));
        Ok(image)
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
    let format = Format::of(&file, &bytes);
    let Some(format @ Format::Known(ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::WebP)) = format
    else {
        let found = format.map_or("of an unknown kind".to_owned(), Format::name);
        let message = format!("the picture is {found}, expected PNG, JPEG or WebP");
        return Err(SceneError::new(ErrorKind::Unsupported, &file, at, message));
    };
    let encoding = match encoding {
        Encoding::Srgb => crate::image::Encoding::Srgb,
        Encoding::Linear => crate::image::Encoding::Linear,
    };
    let name = if source.name.is_empty() { own } else { source.name.clone() };
    crate::image::decode(&file, &at, bytes, format, encoding, name)
}
