//! Renders that can be interrupted at any moment and go on later: their state, in a file.
//!
//! `docs/checkpoint.md` says what is promised, and what the file looks like.

pub(crate) mod file;
mod identity;
mod keeper;
mod state;

use std::io::{BufReader, Cursor, Read, Seek};
use std::path::Path;

use quietus_film::Layout;

pub use file::{Header, ReadError, sealed};
use file::{Kind, Opened};
pub use identity::{FileMark, Identity};
pub use keeper::{CheckpointCost, Keeper};
pub use state::RenderState;

/// A checkpoint that is whole, read as far as what it is of.
pub struct Checkpoint<R = BufReader<std::fs::File>>(Opened<R>);

impl Checkpoint {
    /// Opens the checkpoint at `path`.
    ///
    /// # Errors
    /// Where it cannot be read, is something else, cut off or damaged.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        file::open(path, Kind::Checkpoint).map(Self)
    }
}

impl<'a> Checkpoint<Cursor<&'a [u8]>> {
    /// As [`Checkpoint::open`] for a file that is in memory.
    ///
    /// # Errors
    /// As there.
    pub fn from_bytes(bytes: &'a [u8]) -> Result<Self, ReadError> {
        Opened::new(Cursor::new(bytes), Kind::Checkpoint).map(Self)
    }
}

impl<R: Read + Seek> Checkpoint<R> {
    /// What it is the state of, and what wrote it.
    pub fn header(&self) -> &Header {
        &self.0.header
    }

    /// Reads the state, of a picture of `layout`.
    ///
    /// # Errors
    /// Where it makes no sense, or is of another picture.
    pub fn state(self, layout: &Layout) -> Result<RenderState, ReadError> {
        self.0.body(most_bytes(layout))
    }
}

/// The program's version, for what says that it is made by another one.
pub const PROGRAM: &str = env!("CARGO_PKG_VERSION");

/// More than any state of a picture takes: some hundred bytes a pixel, and a record of each rebuild of each region.
fn most_bytes(layout: &Layout) -> u64 {
    let [across, down] = layout.tiles();
    (1 << 28) + u64::from(across) * u64::from(down) * (1 << 16)
}
