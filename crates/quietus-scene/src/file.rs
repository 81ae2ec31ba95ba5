//! Files into memory, up to a limit.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::error::{ErrorKind, SceneError};

/// Largest file that is read, in bytes: what the four-byte length of a binary glTF can say.
const MAX_FILE_BYTES: u64 = 1 << 32;

/// Reads the file at `path`.
///
/// # Errors
/// Where it is missing, cannot be read, or is larger than [`MAX_FILE_BYTES`].
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, SceneError> {
    let io = |error: std::io::Error| SceneError::io(path, &error);
    let file = File::open(path).map_err(io)?;
    let mut bytes = Vec::new();
    file.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes).map_err(io)?;
    if bytes.len() as u64 > MAX_FILE_BYTES {
        let message = format!("the file is larger than {MAX_FILE_BYTES} bytes");
        return Err(SceneError::new(ErrorKind::Unsupported, path, "", message));
    }
    Ok(bytes)
}
