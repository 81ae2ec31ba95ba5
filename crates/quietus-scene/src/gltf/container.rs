//! From bytes to JSON and binary chunk: `.gltf` is the JSON itself, `.glb` a container of both (specification,
//! chapter 4).

use std::path::Path;

use super::schema::Root;
use crate::error::{ErrorKind, SceneError};

const MAGIC: &[u8; 4] = b"glTF";
const JSON_CHUNK: u32 = 0x4E4F_534A;
const BIN_CHUNK: u32 = 0x004E_4942;

/// The two parts of a glTF file.
#[derive(Debug)]
pub(super) struct Parts<'a> {
    pub json: &'a [u8],
    pub bin: Option<&'a [u8]>,
}

/// Splits `bytes` into its parts, whichever of the two forms it has.
pub(super) fn split<'a>(file: &Path, bytes: &'a [u8]) -> Result<Parts<'a>, SceneError> {
    if bytes.starts_with(MAGIC) {
        return split_glb(file, bytes);
    }
    // A byte order mark is not allowed, but it is harmless and some exporters write it.
    let json = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let first = json.iter().find(|byte| !byte.is_ascii_whitespace());
    if first != Some(&b'{') {
        let message = "expected glTF: JSON starting with \"{\", or a binary file starting with \"glTF\"";
        return Err(SceneError::new(ErrorKind::Syntax, file, "byte 0", message));
    }
    Ok(Parts { json, bin: None })
}

fn split_glb<'a>(file: &Path, bytes: &'a [u8]) -> Result<Parts<'a>, SceneError> {
    let fail = |kind, at: usize, message: String| SceneError::new(kind, file, format!("byte {at}"), message);
    let word = |at: usize| {
        let four = bytes.get(at..at + 4).and_then(|slice| slice.try_into().ok()).map(u32::from_le_bytes);
        four.ok_or_else(|| {
            let message = format!("the file ends at byte {}, expected four more bytes here", bytes.len());
            fail(ErrorKind::Syntax, at, message)
        })
    };
    let version = word(4)?;
    if version != 2 {
        let message = format!("version {version} of the binary container, expected 2");
        return Err(fail(ErrorKind::Unsupported, 4, message));
    }
    let length = word(8)? as usize;
    if length > bytes.len() {
        let message =
            format!("the header says {length} bytes, but the file has {}: is it truncated?", bytes.len());
        return Err(fail(ErrorKind::Syntax, 8, message));
    }
    let (mut json, mut bin, mut at) = (None, None, 12);
    while at < length {
        let (size, kind) = (word(at)? as usize, word(at + 4)?);
        let Some(chunk) = bytes[..length].get(at + 8..).and_then(|rest| rest.get(..size)) else {
            let left = length.saturating_sub(at + 8);
            let message = format!("the chunk says {size} bytes, but only {left} are left in the file");
            return Err(fail(ErrorKind::Syntax, at, message));
        };
        match (kind, json.is_some()) {
            (JSON_CHUNK, false) => json = Some(chunk),
            (BIN_CHUNK, true) if bin.is_none() => bin = Some(chunk),
            // Chunks of other types are for extensions and must be ignored, except as the first one.
            (_, true) => {}
            (_, false) => {
                let message =
                    format!("the first chunk has type {kind:#010x}, expected JSON ({JSON_CHUNK:#x})");
                return Err(fail(ErrorKind::Syntax, at + 4, message));
            }
        }
        // Sizes are multiples of four by the specification; files that forget it pad all the same.
        at += 8 + size.next_multiple_of(4);
    }
    let json = json.ok_or_else(|| {
        fail(ErrorKind::Syntax, 12, "the file ends here, expected a chunk of JSON".to_owned())
    })?;
    Ok(Parts { json, bin })
}

/// Parses the JSON. Errors name line and column where it is not JSON, and the JSON path where it does not follow
/// glTF's schema.
pub(super) fn parse(file: &Path, json: &[u8]) -> Result<Root, SceneError> {
    let mut deserializer = serde_json::Deserializer::from_slice(json);
    let root: Root = serde_path_to_error::deserialize(&mut deserializer).map_err(|error| {
        let path = error.path().to_string();
        json_error(file, &path, error.inner())
    })?;
    deserializer.end().map_err(|error| json_error(file, ".", &error))?;
    Ok(root)
}

fn json_error(file: &Path, path: &str, error: &serde_json::Error) -> SceneError {
    if error.is_data() {
        let place = if path == "." { "" } else { path };
        return SceneError::new(ErrorKind::Invalid, file, place, error.to_string());
    }
    let place = format!("line {}, column {}", error.line(), error.column());
    let text = error.to_string();
    let text = text.rsplit_once(" at line ").map_or(text.as_str(), |(what, _)| what);
    SceneError::new(ErrorKind::Syntax, file, place, format!("is not valid JSON: {text}"))
}
