//! Files into memory, up to a limit.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use flate2::read::MultiGzDecoder;

use crate::error::{ErrorKind, SceneError};

/// Largest file that is read, in bytes: what the four-byte length of a binary glTF can say.
const MAX_FILE_BYTES: u64 = 1 << 32;

/// Reads the file at `path`.
///
/// # Errors
/// Where it is missing, cannot be read, is larger than [`MAX_FILE_BYTES`], or is no file but a device or a pipe, for
/// which a reader could wait for ever.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, SceneError> {
    let io = |error: std::io::Error| SceneError::io(path, &error);
    if !std::fs::metadata(path).map_err(io)?.is_file() {
        let message = "is not a regular file";
        return Err(SceneError::new(ErrorKind::Unreadable, path, "", message));
    }
    let file = File::open(path).map_err(io)?;
    let mut bytes = Vec::new();
    file.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes).map_err(io)?;
    if bytes.len() as u64 > MAX_FILE_BYTES {
        let message = format!("the file is larger than {MAX_FILE_BYTES} bytes");
        return Err(SceneError::new(ErrorKind::Unsupported, path, "", message));
    }
    crate::fingerprint::note(path, &bytes);
    Ok(bytes)
}

/// Reads the file at `path`, unpacked where its content is gzipped.
///
/// # Errors
/// As [`read`]; where the gzipped content is damaged or unpacks to more than [`MAX_FILE_BYTES`].
pub(crate) fn read_unpacked(path: &Path) -> Result<Vec<u8>, SceneError> {
    let packed = read(path)?;
    if packed.starts_with(&[0x1f, 0x8b]) { unpack(path, &packed) } else { Ok(packed) }
}

/// Unpacks gzipped bytes.
fn unpack(path: &Path, packed: &[u8]) -> Result<Vec<u8>, SceneError> {
    let mut bytes = Vec::with_capacity(2 * packed.len());
    let unpacked = MultiGzDecoder::new(packed).take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes);
    unpacked.map_err(|error| {
        SceneError::new(ErrorKind::Syntax, path, "", format!("is not a whole gzip file: {error}"))
    })?;
    if bytes.len() as u64 > MAX_FILE_BYTES {
        let message = format!("the file unpacks to more than {MAX_FILE_BYTES} bytes");
        return Err(SceneError::new(ErrorKind::Unsupported, path, "", message));
    }
    Ok(bytes)
}
