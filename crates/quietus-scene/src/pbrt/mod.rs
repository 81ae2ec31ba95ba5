//! The reader of pbrt-v4's scenes, as described at <https://pbrt.org/fileformat-v4>.
//!
//! `lexer` and `params` take the text apart, `parser` follows its directives and keeps the graphics state, and what
//! they say ends up in a `draft`. Then files are loaded side by side (`meshes`, `images`) and `assemble` puts the scene
//! together, with the help of one module for each kind of thing: `material`, `texture`, `light`, `medium`, `camera`,
//! `film`.
//!
//! What pbrt does not know is an error, with its place and the nearest name it knows. What pbrt knows and this renderer
//! does not draw is said once, and something sensible stands in.
//!
//! Limits: files of 4 GiB (unpacked), 64 included files inside each other and 65,536 in all, 65,536 nested blocks.

mod aperture;
mod arguments;
mod assemble;
mod camera;
mod curve;
mod defining;
mod displacement;
mod draft;
mod fault;
mod film;
mod grid;
mod images;
mod lens;
mod lexer;
mod light;
mod mapping;
mod material;
mod medium;
mod meshes;
mod params;
mod parser;
mod placing;
mod predecessor;
mod shape;
mod spectrum;
mod subdivision;
mod subsurface;
mod surrounding;
mod texture;
mod transform;

use std::path::Path;

use crate::Loaded;
use crate::error::SceneError;
use crate::file;
use fault::Context;
use parser::Parser;

/// Reads the scene at `path`, gzipped or not.
pub(crate) fn load(path: &Path) -> Result<Loaded, SceneError> {
    load_bytes(path, &file::read_unpacked(path)?)
}

/// Reads a scene whose text is `bytes`; `path` is for messages and to find the files beside it.
pub(crate) fn load_bytes(path: &Path, bytes: &[u8]) -> Result<Loaded, SceneError> {
    let context = Context::new(path);
    let mut parser = Parser::new(&context);
    let read = parser.scene(bytes);
    let Parser { draft, images, .. } = parser;
    match read.and_then(|()| assemble::scene(draft, images, &context)) {
        Ok(scene) => Ok(Loaded { scene, warnings: context.into_warnings() }),
        Err(fault) => Err(context.error(fault)),
    }
}

pub(crate) use spectrum::channels_of_wavelengths;

/// Whether `path` has the name of a scene of pbrt: `.pbrt` or `.pbrt.gz` at its end.
pub(crate) fn is_named_like(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    name.ends_with(".pbrt") || name.ends_with(".pbrt.gz")
}
