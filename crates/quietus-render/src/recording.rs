//! What it takes to draw a picture again that depended on time: what each round aimed at, and where it was cut off.

use std::path::Path;

use quietus_film::{Layout, OutputError};
use serde::{Deserialize, Serialize};

use crate::checkpoint::file::{self, Header, Kind, Opened};
use crate::checkpoint::{Identity, ReadError};
use crate::noise::Noise;
use crate::run::Bound;
use crate::steering::Aim;

/// The rounds of a render. In every way of sampling but free-running, another render with equal settings draws the same
/// from it, bit for bit, with any number of threads and at any speed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Recording {
    pub(crate) rounds: Vec<Round>,
    /// What was reported of the noise.
    pub(crate) noise: Option<Noise>,
    pub(crate) bound: Option<Bound>,
}

/// A round that is over.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Round {
    pub(crate) aim: Aim,
    /// Samples no pixel exceeded.
    pub(crate) max_samples: u32,
    /// How often each tile was visited, where the round was cut off; none where it came to its own end.
    pub(crate) cut: Option<Vec<u64>>,
}

impl Recording {
    /// Writes it to `path`, as that of what `identity` says; whole, or not at all.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub fn write(&self, path: &Path, identity: Identity) -> Result<(), OutputError> {
        file::write(path, Kind::Recording, &Header::new(identity), self)
    }
}

/// A recording that is whole, read as far as what it is of.
pub struct RecordingFile(Opened<std::io::BufReader<std::fs::File>>);

impl RecordingFile {
    /// Opens the recording at `path`.
    ///
    /// # Errors
    /// Where it cannot be read, is something else, cut off or damaged.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        file::open(path, Kind::Recording).map(Self)
    }

    /// What it is the recording of, and what wrote it.
    pub fn header(&self) -> &Header {
        &self.0.header
    }

    /// Reads the recording of a picture of `layout`.
    ///
    /// # Errors
    /// Where it makes no sense.
    pub fn recording(self, layout: &Layout) -> Result<Recording, ReadError> {
        let [across, down] = layout.tiles();
        // Sixteen bytes for each tile in each of a thousand rounds.
        self.0.body((1 << 20) + u64::from(across) * u64::from(down) * (1 << 14))
    }
}
