//! The file: a header of text that is checked, samples, and what each pixel costs.
//!
//! | bytes | what |
//! |---|---|
//! | 4096 | `quietus-bank 1`, newline, [`BankSpec`] as one line of JSON, newline, spaces |
//! | 8 each | samples, little-endian: pixel by pixel in rows from the top, stream by stream, index by index |
//! | 4 each | mean rays of a sample of each pixel, `f32`, little-endian |

use std::fs::File;
use std::io::{self, Write};
use std::path::Path;

use memmap2::Mmap;

use super::BankSpec;
use crate::EvalError;

/// Format and version.
const MAGIC: &str = "quietus-bank 1\n";
/// Bytes before the first sample.
const HEADER_BYTES: usize = 4096;

/// A recorded bank, mapped into memory: only what is replayed is read from the disk.
#[derive(Debug)]
pub struct Bank {
    spec: BankSpec,
    bytes: Bytes,
    rays: Vec<f32>,
}

#[derive(Debug)]
enum Bytes {
    Mapped(Mmap),
    Owned(Vec<u8>),
}

impl Bytes {
    fn get(&self) -> &[u8] {
        match self {
            Self::Mapped(map) => map,
            Self::Owned(bytes) => bytes,
        }
    }
}

impl Bank {
    /// Opens the bank at `path`.
    ///
    /// # Errors
    /// Where the file cannot be read, is not a bank, or is shorter or longer than its header says.
    pub fn open(path: &Path) -> Result<Self, EvalError> {
        let file = File::open(path).map_err(EvalError::io(path))?;
        // SAFETY: banks are written under another name and renamed when they are complete; nothing of ours
        // changes or cuts one afterwards. Who does that by hand gets wrong figures or a fault, as with any
        // mapped file.
        let map = unsafe { Mmap::map(&file) }.map_err(EvalError::io(path))?;
        Self::new(Bytes::Mapped(map)).map_err(|message| EvalError::format(path, message))
    }

    /// A bank from the content of its file.
    ///
    /// # Errors
    /// As [`Self::open`], with `name` in place of the path.
    pub fn from_bytes(name: &str, bytes: Vec<u8>) -> Result<Self, EvalError> {
        Self::new(Bytes::Owned(bytes)).map_err(|message| EvalError::format(Path::new(name), message))
    }

    fn new(bytes: Bytes) -> Result<Self, String> {
        let content = bytes.get();
        let spec = read_header(content)?;
        let samples = spec.sample_bytes();
        let expected = HEADER_BYTES as u64 + samples + 4 * spec.look.pixels() as u64;
        if content.len() as u64 != expected {
            return Err(format!(
                "the bank is {} bytes long; its header ({}x{} pixels, {} streams of {} samples) asks for {expected}",
                content.len(),
                spec.look.width,
                spec.look.height,
                spec.streams,
                spec.samples
            ));
        }
        let rays = &content[HEADER_BYTES + samples as usize..];
        let rays = rays.as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b)).collect();
        Ok(Self { spec, bytes, rays })
    }

    /// What it holds.
    pub fn spec(&self) -> &BankSpec {
        &self.spec
    }

    /// Mean rays that a sample of each pixel took.
    pub fn rays(&self) -> &[f32] {
        &self.rays
    }

    /// The packed samples of a stream of the pixel with number `pixel` (row by row).
    #[inline]
    pub(crate) fn stream(&self, pixel: usize, stream: u32) -> &[[u8; 8]] {
        let length = self.spec.samples as usize;
        let first = (pixel * self.spec.streams as usize + stream as usize) * length;
        let bytes = &self.bytes.get()[HEADER_BYTES + 8 * first..][..8 * length];
        bytes.as_chunks::<8>().0
    }
}

/// Writes the header of `spec`.
pub(super) fn write_header(spec: &BankSpec, out: &mut impl Write) -> io::Result<()> {
    let mut header = format!("{MAGIC}{}\n", serde_json::to_string(spec)?).into_bytes();
    if header.len() > HEADER_BYTES {
        return Err(io::Error::other("the scene's name is too long for a bank"));
    }
    header.resize(HEADER_BYTES, b' ');
    out.write_all(&header)
}

fn read_header(bytes: &[u8]) -> Result<BankSpec, String> {
    if !bytes.starts_with(MAGIC.as_bytes()) {
        return Err(format!("not a bank: expected it to start with \"{}\"", MAGIC.trim_end()));
    }
    let Some(header) = bytes.get(MAGIC.len()..HEADER_BYTES) else {
        return Err(format!("the bank ends within its header, after {} bytes", bytes.len()));
    };
    let text = std::str::from_utf8(header).map_err(|e| format!("the bank's header is not text: {e}"))?;
    let spec: BankSpec =
        serde_json::from_str(text.trim_end()).map_err(|e| format!("the bank's header is malformed: {e}"))?;
    spec.validate().map_err(|e| format!("the bank's header makes no sense: {e}"))?;
    Ok(spec)
}
