//! glTF 2.0.

use std::path::Path;

use crate::Loaded;
use crate::error::{ErrorKind, SceneError};

pub(crate) fn load(path: &Path) -> Result<Loaded, SceneError> {
    Err(SceneError::new(ErrorKind::Unsupported, path, "", "this version cannot read glTF yet"))
}
