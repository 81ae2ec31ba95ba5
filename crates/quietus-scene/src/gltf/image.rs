//! Pictures: PNG, JPEG, WebP and KTX2, from files, data URIs and buffer views.

use std::borrow::Cow;
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::path::PathBuf;
use std::sync::Arc;

use ::image::ImageFormat;
use quietus_trace::desc::{Image, Texture, TextureId};
use rayon::prelude::*;

use super::document::Document;
use crate::error::{ErrorKind, SceneError};
use crate::image::{Budget, Format};

/// Whether a picture holds colours or plain numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Encoding {
    /// Colours with the sRGB curve.
    Srgb,
    /// Plain numbers.
    Linear,
}

/// The pictures that materials ask for, each once per encoding: noted first, decoded all at the same time.
pub(super) struct Pictures<'d> {
    jobs: Vec<Job<'d>>,
    known: HashMap<(usize, Encoding), usize>,
    /// Which textures wait for which of them.
    waiting: Vec<(TextureId, usize)>,
    /// Those that were decoded before.
    decoded: HashMap<(usize, Encoding), Arc<Image>>,
}

/// A picture still to be decoded.
struct Job<'d> {
    bytes: Cow<'d, [u8]>,
    file: PathBuf,
    /// Where in the file, for messages.
    place: String,
    format: Format,
    encoding: Encoding,
    name: String,
}

impl<'d> Pictures<'d> {
    /// With those that were `decoded` before.
    pub(super) fn new(decoded: HashMap<(usize, Encoding), Arc<Image>>) -> Self {
        Self { jobs: Vec::new(), known: HashMap::new(), waiting: Vec::new(), decoded }
    }

    /// Image `index` if it was decoded before.
    pub(super) fn decoded(&self, index: usize, encoding: Encoding) -> Option<Arc<Image>> {
        self.decoded.get(&(index, encoding)).cloned()
    }

    /// Asks for image `index`, referred to from `place`, for the next texture: `texture`.
    pub(super) fn ask(
        &mut self,
        document: &'d Document<'_>,
        (index, place): (usize, &str),
        encoding: Encoding,
        texture: TextureId,
    ) -> Result<(), SceneError> {
        let job = match self.known.entry((index, encoding)) {
            Entry::Occupied(known) => *known.get(),
            Entry::Vacant(new) => {
                self.jobs.push(job(document, index, encoding, place)?);
                *new.insert(self.jobs.len() - 1)
            }
        };
        self.waiting.push((texture, job));
        Ok(())
    }

    /// Decodes them on the threads of rayon's pool and puts them in their places; gives them, too.
    pub(super) fn load(
        self,
        textures: &mut [Texture],
    ) -> Result<HashMap<(usize, Encoding), Arc<Image>>, SceneError> {
        let budget = Budget::default();
        let decoded: Vec<_> = self.jobs.into_par_iter().map(|job| job.decode(&budget)).collect();
        let images = decoded.into_iter().collect::<Result<Vec<_>, _>>()?;
        for (texture, image) in self.waiting {
            if let Texture::Image(texture) = &mut textures[texture.0 as usize] {
                texture.image = Arc::clone(&images[image]);
            }
        }
        Ok(self.known.into_iter().map(|(key, image)| (key, Arc::clone(&images[image]))).collect())
    }
}

impl Job<'_> {
    fn decode(self, budget: &Budget) -> Result<Arc<Image>, SceneError> {
        let encoding = match self.encoding {
            Encoding::Srgb => crate::image::Encoding::Srgb,
            Encoding::Linear => crate::image::Encoding::Linear,
        };
        let image =
            crate::image::decode(&self.file, &self.place, self.bytes, self.format, encoding, self.name)?;
        budget
            .take(&image)
            .map_err(|(kind, message)| SceneError::new(kind, &self.file, self.place, message))?;
        Ok(Arc::new(image))
    }
}

/// What is needed to decode image `index`, referred to from `place`.
fn job<'d>(
    document: &'d Document<'_>,
    index: usize,
    encoding: Encoding,
    place: &str,
) -> Result<Job<'d>, SceneError> {
    let source = document.get(&document.root.images, index, "images", place)?;
    let own = format!("images[{index}]");
    let scene = || document.invalid(&own, "").file().to_path_buf();
    let (bytes, file, at): (Cow<'d, [u8]>, PathBuf, String) = match (&source.uri, source.buffer_view) {
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
    let read = |format: &Format| {
        use ImageFormat::{Jpeg, Png, WebP};
        matches!(format, Format::Ktx2 | Format::Known(Png | Jpeg | WebP))
    };
    let Some(format) = format.filter(read) else {
        let found = format.map_or("of an unknown kind".to_owned(), Format::name);
        let message = format!("the picture is {found}, expected PNG, JPEG, WebP or KTX2");
        return Err(SceneError::new(ErrorKind::Unsupported, &file, at, message));
    };
    let name = if source.name.is_empty() { own } else { source.name.clone() };
    Ok(Job { bytes, file, place: at, format, encoding, name })
}
