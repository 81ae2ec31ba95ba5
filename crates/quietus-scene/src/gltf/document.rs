//! An opened glTF file: its JSON, its buffers, the warnings so far, and the words to complain with.

use std::borrow::Cow;
use std::cell::{Cell, OnceCell, RefCell};
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

use super::changes::Originals;
use super::choice::{self, Choice};
use super::container;
use super::extensions;
use super::glossiness;
use super::meshopt::{self, Filter, Mode};
use super::pointer;
use super::schema::{BufferView, Meshopt, Root};
use super::variants;
use crate::error::{ErrorKind, SceneError, Warnings};
use crate::file;
use crate::limit;

/// Most memory that vertices and indices of one scene may take when decoded: a small file can refer to the same
/// bytes many times.
pub(super) const MAX_GEOMETRY_BYTES: u64 = limit(1 << 34);

/// Most memory that the buffers of one scene may take: a small file can name the same large one many times.
const MAX_BUFFER_BYTES: u64 = limit(1 << 34);

/// Ending of the names of the extension that compresses buffer views, which is both EXT and KHR.
const MESHOPT: &str = "_meshopt_compression";

/// A glTF file and what belongs to it.
pub(super) struct Document<'a> {
    file: &'a Path,
    pub root: Root,
    buffers: Vec<Cow<'a, [u8]>>,
    /// Bytes of the views that are compressed, by view, once they were asked for.
    decompressed: Vec<OnceCell<Vec<u8>>>,
    warnings: RefCell<Warnings>,
    geometry_bytes: Cell<u64>,
    /// Where animations change materials, lights or cameras: these as the file has them.
    pub originals: Option<Originals>,
}

impl<'a> Document<'a> {
    /// Takes apart the glTF file `bytes`, read from `file`, and fetches its buffers; it shows what `choice` says.
    pub(super) fn open(file: &'a Path, bytes: &'a [u8], choice: Choice<'_>) -> Result<Self, SceneError> {
        let parts = container::split(file, bytes)?;
        let mut root = container::parse(file, parts.json)?;
        root.materials.iter_mut().for_each(glossiness::rewrite);
        root.animations.iter_mut().flat_map(|animation| &mut animation.channels).for_each(pointer::rewrite);
        choice.apply(&mut root, file)?;
        let mut channels = root.animations.iter().flat_map(|animation| &animation.channels);
        let originals = channels.any(|channel| channel.target.extensions.pointer.is_some());
        let originals = originals.then(|| Originals::new(parts.json));
        let mut document = Self { originals, ..Self::of_parts(file, root) };
        document.decompressed.resize_with(document.root.buffer_views.len(), OnceCell::new);
        document.check_version()?;
        extensions::check(&document)?;
        document.tell_choice(choice);
        let mut total = 0;
        for index in 0..document.root.buffers.len() {
            let data = document.buffer(index, parts.bin)?;
            total += data.len() as u64;
            if total > MAX_BUFFER_BYTES {
                let message = format!("the scene's buffers take over {MAX_BUFFER_BYTES} bytes");
                return Err(document.error(ErrorKind::Unsupported, &format!("buffers[{index}]"), message));
            }
            document.buffers.push(data);
        }
        Ok(document)
    }

    /// The parts of `file` that `root` has, without any buffer.
    pub(super) fn of_parts(file: &'a Path, root: Root) -> Self {
        Self {
            file,
            root,
            buffers: Vec::new(),
            decompressed: Vec::new(),
            warnings: RefCell::default(),
            geometry_bytes: Cell::new(0),
            originals: None,
        }
    }

    pub(super) fn error(&self, kind: ErrorKind, place: &str, message: impl Into<String>) -> SceneError {
        SceneError::new(kind, self.file, place, message)
    }

    pub(super) fn invalid(&self, place: &str, message: impl Into<String>) -> SceneError {
        self.error(ErrorKind::Invalid, place, message)
    }

    /// Says `message` about `place`, once.
    pub(super) fn warn(&self, place: &str, message: impl Into<String>) {
        self.warnings.borrow_mut().say(place, message);
    }

    /// The file itself, for messages.
    pub(super) fn file(&self) -> &Path {
        self.file
    }

    /// Bytes of decoded geometry counted so far.
    pub(super) fn geometry_bytes(&self) -> u64 {
        self.geometry_bytes.get()
    }

    pub(super) fn into_warnings(self) -> Warnings {
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
        let Some(source) = &view.extensions.meshopt else {
            return Ok((self.bytes(&own, view.buffer, view.byte_offset, view.byte_length)?, view));
        };
        let kept = &self.decompressed[index];
        let bytes = match kept.get() {
            Some(bytes) => bytes,
            None => {
                let names = self.root.extensions_used.iter().find(|name| name.ends_with(MESHOPT));
                let name = names.map_or("EXT_meshopt_compression", String::as_str);
                let bytes = self.decompress(view, source, &format!("{own}.extensions.{name}"))?;
                kept.get_or_init(|| bytes)
            }
        };
        Ok((bytes, view))
    }

    /// The `length` bytes from `offset` on of `buffer`, as `place` says.
    fn bytes(&self, place: &str, buffer: usize, offset: u64, length: u64) -> Result<&[u8], SceneError> {
        let bytes = self.get(&self.buffers, buffer, "buffers", &format!("{place}.buffer"))?;
        let end = offset.checked_add(length).filter(|&end| end <= bytes.len() as u64);
        let Some(end) = end else {
            let has = bytes.len();
            let message =
                format!("{length} bytes from byte {offset} on, but buffers[{buffer}] has {has} bytes");
            return Err(self.invalid(place, message));
        };
        Ok(&bytes[offset as usize..end as usize])
    }

    /// Decompresses `view` from `source`, its extension at `place`.
    fn decompress(&self, view: &BufferView, source: &Meshopt, place: &str) -> Result<Vec<u8>, SceneError> {
        let invalid = |name: &str, message: String| Err(self.invalid(&format!("{place}.{name}"), message));
        let stride = source.byte_stride;
        let (mode, strides): (_, fn(u64) -> bool) = match source.mode.as_str() {
            "ATTRIBUTES" => (Mode::Attributes, |stride| stride % 4 == 0 && (4..=256).contains(&stride)),
            "TRIANGLES" => (Mode::Triangles, |stride| stride == 2 || stride == 4),
            "INDICES" => (Mode::Indices, |stride| stride == 2 || stride == 4),
            other => {
                return invalid("mode", format!("is \"{other}\", expected ATTRIBUTES, TRIANGLES or INDICES"));
            }
        };
        let (filter, filtered): (_, fn(u64) -> bool) = match source.filter.as_deref() {
            None | Some("NONE") => (Filter::None, |_| true),
            Some("OCTAHEDRAL") => (Filter::Octahedral, |stride| stride == 4 || stride == 8),
            Some("QUATERNION") => (Filter::Quaternion, |stride| stride == 8),
            Some("COLOR") => (Filter::Color, |stride| stride == 4 || stride == 8),
            Some("EXPONENTIAL") => (Filter::Exponential, |_| true),
            Some(other) => return invalid("filter", format!("is \"{other}\", which is not known")),
        };
        if !strides(stride) || !filtered(stride) || view.byte_stride.is_some_and(|other| other != stride) {
            return invalid("byteStride", format!("is {stride}, which does not suit mode, filter and view"));
        }
        if source.count.checked_mul(stride) != Some(view.byte_length) {
            let message = format!("is {}, but the view has {} bytes", source.count, view.byte_length);
            return invalid("count", message);
        }
        self.claim_geometry(place, view.byte_length)?;
        let data = self.bytes(place, source.buffer, source.byte_offset, source.byte_length)?;
        meshopt::decode(mode, filter, data, source.count as usize, stride as usize)
            .map_err(|message| self.invalid(place, format!("the compressed data {message}")))
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
        let required = |name: &String| name.ends_with(MESHOPT);
        let placeholder = buffer.extensions.meshopt.fallback
            || buffer.uri.is_none() && index > 0 && self.root.extensions_required.iter().any(required);
        if placeholder {
            // It stands for what the compressed views hold.
            return Ok(Cow::Borrowed(&[]));
        }
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

    /// Says which scenes and variants there are, where none was asked for.
    fn tell_choice(&self, choice: Choice<'_>) {
        let scenes = choice::scene_names(&self.root);
        if choice.scene.is_none() && scenes.len() > 1 {
            let chosen = self.root.scene.unwrap_or(0);
            let listed = variants::listed(&scenes);
            self.warn("scenes", format!("the file has the scenes {listed}: only scenes[{chosen}] is drawn"));
        }
        let names = variants::names(&self.root);
        if choice.variant.is_none() && !names.is_empty() {
            let listed = variants::listed(&names);
            let message = format!("the file has the variants {listed}: it is drawn as it is without any");
            self.warn("extensions.KHR_materials_variants", message);
        }
    }
}
