//! An opened glTF file: its JSON, its buffers, the warnings so far, and the words to complain with.

use std::borrow::Cow;
use std::cell::{Cell, RefCell};
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

use super::container;
use super::schema::{BufferView, Root};
use crate::error::{ErrorKind, SceneError, Warning};
use crate::file;

/// Most memory that vertices and indices of one scene may take when decoded: a small file can refer to the same
/// bytes many times.
pub(super) const MAX_GEOMETRY_BYTES: u64 = 1 << 34;

/// A glTF file and what belongs to it.
pub(super) struct Document<'a> {
    file: &'a Path,
    pub root: Root,
    buffers: Vec<Cow<'a, [u8]>>,
    warnings: RefCell<Vec<Warning>>,
    geometry_bytes: Cell<u64>,
}

impl<'a> Document<'a> {
    /// Takes apart the glTF file `bytes`, read from `file`, and fetches its buffers.
    pub(super) fn open(file: &'a Path, bytes: &'a [u8]) -> Result<Self, SceneError> {
        let parts = container::split(file, bytes)?;
        let root = container::parse(file, parts.json)?;
        let mut document = Self {
            file,
            root,
            buffers: Vec::new(),
            warnings: RefCell::default(),
            geometry_bytes: Cell::new(0),
        };
        document.check_version()?;
        document.check_extensions()?;
        for index in 0..document.root.buffers.len() {
            let data = document.buffer(index, parts.bin)?;
            document.buffers.push(data);
        }
        Ok(document)
    }

    pub(super) fn error(&self, kind: ErrorKind, place: &str, message: impl Into<String>) -> SceneError {
        SceneError::new(kind, self.file, place, message)
    }

    pub(super) fn invalid(&self, place: &str, message: impl Into<String>) -> SceneError {
        self.error(ErrorKind::Invalid, place, message)
    }

    /// Says `message` about `place`, once.
    pub(super) fn warn(&self, place: &str, message: impl Into<String>) {
        let warning = Warning { place: place.to_owned(), message: message.into() };
        let mut warnings = self.warnings.borrow_mut();
        if !warnings.contains(&warning) {
            warnings.push(warning);
        }
    }

    /// The file itself, for messages.
    pub(super) fn file(&self) -> &Path {
        self.file
    }

    /// Bytes of decoded geometry counted so far.
    pub(super) fn geometry_bytes(&self) -> u64 {
        self.geometry_bytes.get()
    }

    pub(super) fn into_warnings(self) -> Vec<Warning> {
        self.warnings.into_inner()
    }

    /// `items[index]`, or an error at `place` that names the array by `name`.
    pub(super) fn get<'b, T>(
        &self,
        items: &'b [T],
        index: usize,
        name: &str,
        place: &str,
    ) -> Result<&'b T, SceneError> {
        items.get(index).ok_or_else(|| match items.len() {
            0 => self.invalid(place, format!("refers to {name}[{index}], but the file has no {name}")),
            count => {
                self.invalid(place, format!("refers to {name}[{index}], expected an index below {count}"))
            }
        })
    }

    /// Counts `bytes` of decoded geometry against the limit.
    pub(super) fn claim_geometry(&self, place: &str, bytes: u64) -> Result<(), SceneError> {
        let total = self.geometry_bytes.get().saturating_add(bytes);
        if total > MAX_GEOMETRY_BYTES {
            let message = format!("the scene's vertices and indices take over {MAX_GEOMETRY_BYTES} bytes");
            return Err(self.error(ErrorKind::Unsupported, place, message));
        }
        self.geometry_bytes.set(total);
        Ok(())
    }

    /// The bytes of a buffer view, and the view itself.
    pub(super) fn view(&self, index: usize, place: &str) -> Result<(&[u8], &BufferView), SceneError> {
        let view = self.get(&self.root.buffer_views, index, "bufferViews", place)?;
        let own = format!("bufferViews[{index}]");
        let buffer = self.get(&self.buffers, view.buffer, "buffers", &format!("{own}.buffer"))?;
        let end = view.byte_offset.checked_add(view.byte_length).filter(|&end| end <= buffer.len() as u64);
        let Some(end) = end else {
            let message = format!(
                "{} bytes from byte {} on, but buffers[{}] has {} bytes",
                view.byte_length,
                view.byte_offset,
                view.buffer,
                buffer.len()
            );
            return Err(self.invalid(&own, message));
        };
        Ok((&buffer[view.byte_offset as usize..end as usize], view))
    }

    /// Fetches what `uri` at `place` refers to: a data URI's own bytes or a file beside the scene. Gives the bytes
    /// and the file to blame for them.
    pub(super) fn fetch(&self, uri: &str, place: &str) -> Result<(Vec<u8>, PathBuf), SceneError> {
        if let Some(data) = uri.strip_prefix("data:") {
            return Ok((self.data_uri(data, place)?, self.file.to_path_buf()));
        }
        let scheme = uri.split_once(':').map(|(scheme, _)| scheme);
        if let Some(scheme) = scheme.filter(|s| s.len() > 1 && s.bytes().all(|b| b.is_ascii_alphanumeric())) {
            let message = format!("the URI's scheme is \"{scheme}:\", expected a relative file or \"data:\"");
            return Err(self.error(ErrorKind::Unsupported, place, message));
        }
        let name = percent_encoding::percent_decode_str(uri).decode_utf8();
        let name = name.map_err(|_| self.invalid(place, "the URI's escapes are not UTF-8"))?;
        if name.is_empty() || name.contains('\0') {
            return Err(self.invalid(place, "the URI is empty or holds a zero byte, expected a file name"));
        }
        let path = self.file.parent().unwrap_or(Path::new("")).join(&*name);
        let bytes = file::read(&path).map_err(|error| error.or_at(&format!("{place} of the scene")))?;
        Ok((bytes, path))
    }

    fn data_uri(&self, data: &str, place: &str) -> Result<Vec<u8>, SceneError> {
        let Some((kind, payload)) = data.split_once(',') else {
            return Err(self.invalid(place, "the data URI has no comma, expected \"data:TYPE;base64,...\""));
        };
        if !kind.ends_with(";base64") {
            return Ok(percent_encoding::percent_decode_str(payload).collect());
        }
        let config = GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
        let engine = GeneralPurpose::new(&STANDARD, config);
        let bytes = engine.decode(payload);
        bytes.map_err(|error| self.invalid(place, format!("the data URI is not base64: {error}")))
    }

    fn buffer(&self, index: usize, bin: Option<&'a [u8]>) -> Result<Cow<'a, [u8]>, SceneError> {
        let buffer = &self.root.buffers[index];
        let place = format!("buffers[{index}]");
        let data = match (&buffer.uri, bin) {
            (Some(uri), _) => Cow::Owned(self.fetch(uri, &format!("{place}.uri"))?.0),
            (None, Some(bin)) if index == 0 => Cow::Borrowed(bin),
            (None, _) => {
                let message = "has neither a uri nor a binary chunk in this file to hold its bytes";
                return Err(self.invalid(&place, message));
            }
        };
        if (data.len() as u64) < buffer.byte_length {
            let (said, has) = (buffer.byte_length, data.len());
            let message = format!("says {said} bytes, but its data has {has}: is it truncated?");
            return Err(self.invalid(&format!("{place}.byteLength"), message));
        }
        // The binary chunk is padded to a multiple of four; what follows the stated length is nobody's.
        let length = buffer.byte_length as usize;
        Ok(match data {
            Cow::Borrowed(slice) => Cow::Borrowed(&slice[..length]),
            Cow::Owned(mut vec) => {
                vec.truncate(length);
                Cow::Owned(vec)
            }
        })
    }

    fn check_version(&self) -> Result<(), SceneError> {
        let asset = &self.root.asset;
        let needed = asset.min_version.as_ref().unwrap_or(&asset.version);
        let place = if asset.min_version.is_some() { "asset.minVersion" } else { "asset.version" };
        match needed.split_once('.').map(|(major, minor)| (major, minor.parse::<u32>())) {
            Some(("2", Ok(0))) => Ok(()),
            Some(("2", Ok(_))) if asset.min_version.is_none() => Ok(()),
            Some((_, Ok(_))) => {
                let message = format!("glTF version \"{needed}\", expected \"2.0\"");
                Err(self.error(ErrorKind::Unsupported, place, message))
            }
            _ => Err(self.invalid(place, format!("is \"{needed}\", expected \"2.0\""))),
        }
    }

    fn check_extensions(&self) -> Result<(), SceneError> {
        let foreign = |name: &&String| !SUPPORTED_EXTENSIONS.contains(&name.as_str());
        let required: Vec<_> =
            self.root.extensions_required.iter().filter(foreign).map(String::as_str).collect();
        if !required.is_empty() {
            let message = format!(
                "the file requires {}; supported are {}",
                required.join(", "),
                SUPPORTED_EXTENSIONS.join(", ")
            );
            return Err(self.error(ErrorKind::Unsupported, "extensionsRequired", message));
        }
        for name in self.root.extensions_used.iter().filter(foreign) {
            self.warn("extensionsUsed", format!("{name} is not supported; the file is drawn without it"));
        }
        Ok(())
    }
}

/// What a file may require.
const SUPPORTED_EXTENSIONS: [&str; 9] = [
    "KHR_lights_punctual",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];
