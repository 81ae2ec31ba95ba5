//! The file around a state: a header that people can read, the state compressed, and a hash of everything.
//!
//! ```text
//! 8 bytes   "quietus" and the kind of file, one letter
//! 4 bytes   version of the format, little-endian like all numbers here
//! 4 bytes   length of the header
//! header    JSON: what the state belongs to
//! body      the state in postcard's encoding, in one LZ4 frame
//! 8 bytes   "quiet-ok": absent where the file was cut off
//! 16 bytes  XXH3, 128 bits, of all bytes before "quiet-ok"
//! ```

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::Path;

use lz4_flex::frame::{FrameDecoder, FrameEncoder};
use quietus_film::{OutputError, write_atomically};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use xxhash_rust::xxh3::Xxh3;

use super::Identity;

/// Version of the format. One program reads one version.
const FORMAT: u32 = 7;

/// What files begin with, before the letter of their kind.
const MAGIC: &[u8; 7] = b"quietus";

/// What stands before the hash.
const END: &[u8; 8] = b"quiet-ok";

/// Bytes from the end mark on.
const TRAILER: u64 = END.len() as u64 + size_of::<u128>() as u64;

/// Longest header: a scene of ten thousand files has a megabyte.
const MOST_HEADER: u32 = 1 << 26;

/// What a file is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Kind {
    /// A state to go on from.
    Checkpoint = b'c',
    /// A record to draw again from.
    Recording = b'r',
}

/// What can be told without the state.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Version of the program that wrote it.
    pub program: String,
    /// The code path its samples were drawn with.
    machine: String,
    /// The picture it is of.
    pub identity: Identity,
}

impl Header {
    /// As written by this program, on this machine.
    pub(crate) fn new(identity: Identity) -> Self {
        Self { program: super::PROGRAM.to_owned(), machine: machine(), identity }
    }

    /// Whether its samples were drawn by the same machine code as this processor gets; others round a few of them
    /// otherwise. Wide instructions do not matter, the system's sines and cosines do.
    pub fn is_of_this_machine(&self) -> bool {
        self.machine == machine()
    }
}

fn machine() -> String {
    format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS)
}

fn unread(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::NotFound => "no such file".to_owned(),
        _ => format!("cannot read: {error}"),
    }
}

/// Why a file was not read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// It cannot be read at all.
    #[error("{}", unread(.0))]
    Io(#[from] io::Error),
    /// It is something else.
    #[error("is no {expected} of quietus{}", .found.map_or_else(String::new, |found| format!(", but a {found}")))]
    Foreign {
        /// What it should be.
        expected: &'static str,
        /// What it is, if that is known.
        found: Option<&'static str>,
    },
    /// Written in another version of the format.
    #[error("has version {0} of its format, and this program reads version {FORMAT}")]
    Format(u32),
    /// Its end is missing.
    #[error("is cut off: its end is missing")]
    Truncated,
    /// Its bytes are not those that were written.
    #[error("is damaged: its content does not agree with its hash")]
    Corrupt,
    /// It is whole, but what it says makes no sense: not written by this program.
    #[error("is whole, but makes no sense: {0}")]
    Nonsense(String),
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Self::Checkpoint => "checkpoint",
            Self::Recording => "recording",
        }
    }

    fn of(letter: u8) -> Option<Self> {
        [Self::Checkpoint, Self::Recording].into_iter().find(|&kind| kind as u8 == letter)
    }
}

/// Writes by way of a temporary file that replaces an older one when it is whole and on the disk.
pub(crate) fn write(
    path: &Path,
    kind: Kind,
    header: &Header,
    body: &impl Serialize,
) -> Result<(), OutputError> {
    write_atomically(path, |file| {
        let failed = |source| OutputError::Write { path: path.to_owned(), source };
        encode(file, kind, header, body).map_err(failed)
    })
}

fn encode(file: impl Write, kind: Kind, header: &Header, body: &impl Serialize) -> io::Result<()> {
    let mut hashed = Hashed { inner: file, hash: Xxh3::new(), failure: None };
    let header = serde_json::to_vec(header)?;
    hashed.write_all(MAGIC)?;
    hashed.write_all(&[kind as u8])?;
    hashed.write_all(&FORMAT.to_le_bytes())?;
    hashed.write_all(&(header.len() as u32).to_le_bytes())?;
    hashed.write_all(&header)?;
    let compressed = BufWriter::new(FrameEncoder::new(&mut hashed));
    let compressed = postcard::to_io(body, compressed).map_err(io::Error::other)?;
    let frame = compressed.into_inner().map_err(io::IntoInnerError::into_error)?;
    frame.finish().map_err(io::Error::other)?;
    if let Some(failure) = hashed.failure {
        return Err(failure);
    }
    let hash = hashed.hash.digest128();
    let mut file = hashed.inner;
    file.write_all(END)?;
    file.write_all(&hash.to_le_bytes())
}

/// Hashes what it passes on. Keeps a failure to itself until all is over: the encoder of LZ4 panics where it is written to
/// after one, as buffers do when they are dropped.
struct Hashed<W> {
    inner: W,
    hash: Xxh3,
    failure: Option<io::Error>,
}

impl<W: Write> Write for Hashed<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.failure.is_none() {
            self.failure = self.inner.write_all(bytes).err();
            self.hash.update(bytes);
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        if self.failure.is_none() {
            self.failure = self.inner.flush().err();
        }
        Ok(())
    }
}

/// A file whose bytes are those that were written, read as far as its header.
pub(crate) struct Opened<R> {
    pub(crate) header: Header,
    reader: R,
}

/// Opens the file at `path`.
pub(crate) fn open(path: &Path, kind: Kind) -> Result<Opened<BufReader<File>>, ReadError> {
    // A pipe could be waited for for ever.
    if !std::fs::metadata(path)?.is_file() {
        return Err(ReadError::Foreign { expected: kind.name(), found: None });
    }
    Opened::new(BufReader::with_capacity(1 << 18, File::open(path)?), kind)
}

impl<R: Read + Seek> Opened<R> {
    /// Checks all of `reader` and reads the header.
    pub(crate) fn new(mut reader: R, kind: Kind) -> Result<Self, ReadError> {
        let length = reader.seek(SeekFrom::End(0))?;
        reader.rewind()?;
        check_kind(&mut reader, kind)?;
        check_hash(&mut reader, length)?;
        reader.seek(SeekFrom::Start(MAGIC.len() as u64 + 1 + size_of_val(&FORMAT) as u64))?;
        let header_length = read_u32(&mut reader)?;
        if header_length > MOST_HEADER {
            return Err(ReadError::Nonsense(format!("a header of {header_length} bytes")));
        }
        let mut header = Vec::new();
        reader.by_ref().take(header_length.into()).read_to_end(&mut header)?;
        let header =
            serde_json::from_slice(&header).map_err(|error| ReadError::Nonsense(error.to_string()))?;
        Ok(Self { header, reader })
    }

    /// Reads the state, of at most `most` bytes.
    pub(crate) fn body<T: DeserializeOwned>(self, most: u64) -> Result<T, ReadError> {
        let reader = BufReader::with_capacity(1 << 16, FrameDecoder::new(self.reader).take(most));
        // For what is read by reference: nothing in a state is.
        let mut scratch = [0; 64];
        let (state, _) = postcard::from_io((reader, &mut scratch[..]))
            .map_err(|error| ReadError::Nonsense(error.to_string()))?;
        Ok(state)
    }
}

fn check_kind(reader: &mut impl Read, expected: Kind) -> Result<(), ReadError> {
    let mut start = [0; MAGIC.len() + 1];
    let is_ours = reader.read_exact(&mut start).is_ok() && start.starts_with(MAGIC);
    let found = is_ours.then(|| Kind::of(start[MAGIC.len()])).flatten();
    if found != Some(expected) {
        return Err(ReadError::Foreign { expected: expected.name(), found: found.map(Kind::name) });
    }
    match read_u32(reader)? {
        FORMAT => Ok(()),
        other => Err(ReadError::Format(other)),
    }
}

fn check_hash(reader: &mut (impl Read + Seek), length: u64) -> Result<(), ReadError> {
    let hashed = length.checked_sub(TRAILER).ok_or(ReadError::Truncated)?;
    reader.rewind()?;
    let mut hash = Xxh3::new();
    let mut block = vec![0; 1 << 16];
    let mut body = reader.by_ref().take(hashed);
    loop {
        match body.read(&mut block)? {
            0 => break,
            read => hash.update(&block[..read]),
        }
    }
    let mut trailer = [0; TRAILER as usize];
    reader.read_exact(&mut trailer)?;
    let (end, stored) = trailer.split_at(END.len());
    if end != END {
        return Err(ReadError::Truncated);
    }
    if stored != hash.digest128().to_le_bytes() {
        return Err(ReadError::Corrupt);
    }
    Ok(())
}

fn read_u32(reader: &mut impl Read) -> Result<u32, ReadError> {
    let mut bytes = [0; 4];
    match reader.read_exact(&mut bytes) {
        Ok(()) => Ok(u32::from_le_bytes(bytes)),
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Err(ReadError::Truncated),
        Err(error) => Err(error.into()),
    }
}

/// Whatever `bytes` are, with an end that says that they are whole: what a fuzzer, who cannot guess hashes, gives to a
/// reader.
pub fn sealed(bytes: &[u8]) -> Vec<u8> {
    let hash = xxhash_rust::xxh3::xxh3_128(bytes);
    [bytes, END, &hash.to_le_bytes()].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A disk that is full after so many bytes.
    struct Full(usize);

    impl Write for Full {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            if self.0 == 0 {
                return Err(io::ErrorKind::StorageFull.into());
            }
            let written = bytes.len().min(self.0);
            self.0 -= written;
            Ok(written)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_disk_that_fills_is_an_error_wherever_it_happens() {
        // Does not compress, and fills several blocks.
        let body: Vec<u64> = (0..30_000u64).map(|i| i.wrapping_mul(0x9e37_79b9_7f4a_7c15)).collect();
        let header = Header::new(Identity::default());
        let mut whole = Vec::new();
        encode(&mut whole, Kind::Checkpoint, &header, &body).unwrap();
        assert!(whole.len() > 200_000);
        for room in (0..whole.len()).step_by(4999).chain([whole.len() - 1]) {
            let error = encode(Full(room), Kind::Checkpoint, &header, &body).unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::StorageFull, "room for {room} bytes");
        }
        encode(Full(whole.len()), Kind::Checkpoint, &header, &body).unwrap();
    }
}
