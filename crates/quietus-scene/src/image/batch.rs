//! All pictures of a scene: each file read once, all at the same time.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use quietus_trace::desc::Image;
use rayon::prelude::*;

use super::{Encoding, MAX_SCENE_BYTES, bytes_of, read};
use crate::error::{ErrorKind, SceneError};

/// Stands for a picture that has been asked for: its place in what [`Images::load`] returns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ImageId(pub usize);

/// Pictures to be read, see [`Self::load`].
#[derive(Debug, Default)]
pub(crate) struct Images {
    requests: Vec<Request>,
    known: HashMap<(PathBuf, (u8, u32)), ImageId>,
}

#[derive(Debug)]
struct Request {
    path: PathBuf,
    encoding: Encoding,
    place: String,
}

impl Images {
    /// Asks for the picture in the file at `path`, once however often it is asked for. `place` is where the scene
    /// names it, for messages.
    pub(crate) fn request(&mut self, path: PathBuf, encoding: Encoding, place: &str) -> ImageId {
        let Self { requests, known } = self;
        *known.entry((path.clone(), encoding.key())).or_insert_with(|| {
            requests.push(Request { path, encoding, place: place.to_owned() });
            ImageId(requests.len() - 1)
        })
    }

    /// Reads all of them, on the threads of rayon's pool; [`ImageId`]s index the result.
    ///
    /// # Errors
    /// The first picture, in the order they were asked for, that cannot be read (see [`read`]); more than
    /// [`MAX_SCENE_BYTES`] of texels.
    pub(crate) fn load(self) -> Result<Vec<Arc<Image>>, SceneError> {
        let budget = Budget::default();
        let load = |request: Request| {
            let image = read(&request.path, request.encoding)
                .map_err(|error| error.or_at(&format!("named by {}", request.place)))?;
            budget
                .take(&image)
                .map_err(|(kind, message)| SceneError::new(kind, &request.path, request.place, message))?;
            Ok(Arc::new(image))
        };
        let loaded: Vec<_> = self.requests.into_par_iter().map(load).collect();
        loaded.into_iter().collect()
    }
}

/// What the pictures of a scene have taken of [`MAX_SCENE_BYTES`].
#[derive(Debug, Default)]
pub(crate) struct Budget(AtomicU64);

impl Budget {
    /// Counts a picture in.
    ///
    /// # Errors
    /// Where it is one too many.
    pub(crate) fn take(&self, image: &Image) -> Result<(), (ErrorKind, String)> {
        let bytes = bytes_of(image);
        // Relaxed: a sum alone, which publishes nothing.
        if self.0.fetch_add(bytes, Ordering::Relaxed) + bytes <= MAX_SCENE_BYTES {
            return Ok(());
        }
        Err((ErrorKind::Unsupported, format!("the scene's pictures take over {MAX_SCENE_BYTES} bytes")))
    }
}
