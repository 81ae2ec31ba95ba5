//! `--weight`: a painted map of where error matters more.

use std::path::Path;
use std::sync::Arc;

use quietus_render::Weights;

use crate::error::Failure;

/// Reads the map for a picture whose full frame has `frame` pixels.
///
/// # Errors
/// Where it cannot be read, is of another size, or its numbers make no sense as weights.
pub(crate) fn read(path: &Path, frame: [u32; 2]) -> Result<Arc<Weights>, Failure> {
    let (size, values) = quietus_scene::read_map(path)?;
    if size != frame {
        return Err(Failure::input(format!(
            "{}: is {}x{}: expected a weight for each pixel of the full frame, {}x{}, also where --crop draws a part of it",
            path.display(),
            size[0],
            size[1],
            frame[0],
            frame[1]
        )));
    }
    let weights = Weights::new(frame, values);
    weights.map(Arc::new).map_err(|error| Failure::input(format!("{}: {error}", path.display())))
}
