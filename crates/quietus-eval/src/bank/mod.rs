//! The bank: every sample of a small picture, recorded once, so that any policy can be replayed on it in
//! seconds.
//!
//! Each pixel has a number of *streams*. A stream is what one replicate of that pixel would draw in a live
//! render: stream `2 k + r` holds the samples of replicate `r` of the render with seed `seed + k`, in index
//! order, each rounded to 14 significant bits. Streams are independent of each other,
//! between pixels too; the samples within one are not, they are a low-discrepancy sequence, and are never
//! torn apart.

mod format;
mod record;

use std::path::Path;

pub use format::Bank;
pub(crate) use record::fingerprint;
pub use record::{record, record_in_memory};
use serde::{Deserialize, Serialize};

use crate::{EvalError, Look, Subject};

/// Replicates of a live render: two streams are made with each seed.
const REPLICATES: u32 = 2;

/// What a bank holds.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BankSpec {
    /// Name of the scene.
    pub scene: String,
    /// How it is looked at.
    pub look: Look,
    /// Streams of each pixel: even, at most 65,534.
    pub streams: u32,
    /// Samples in a stream.
    pub samples: u32,
    /// Seed of the first render.
    pub seed: u64,
}

impl BankSpec {
    /// Bytes of all samples.
    pub fn sample_bytes(&self) -> u64 {
        self.look.pixels() as u64 * u64::from(self.streams) * u64::from(self.samples) * 8
    }

    fn validate(&self) -> Result<(), EvalError> {
        let Self { streams, samples, look, .. } = self;
        let refuse = |message: String| Err(EvalError::Request(message));
        if look.width == 0 || look.height == 0 || look.width > 4096 || look.height > 4096 {
            return refuse(format!(
                "a bank of {}x{} pixels: sides go from 1 to 4096",
                look.width, look.height
            ));
        }
        if *streams == 0 || streams % REPLICATES != 0 || *streams > 65_534 {
            return refuse(format!("a bank of {streams} streams: expected an even number from 2 to 65534"));
        }
        if *samples == 0 || *samples > 1 << 20 {
            return refuse(format!("a bank of {samples} samples a stream: expected 1 to {}", 1 << 20));
        }
        Ok(())
    }
}

/// Opens the bank of `spec` at `path`, or records it there where there is none, or where it does not hold
/// what `spec` asks for or what the tracer draws today: some of its samples are drawn again to find that out.
/// `progress` is told the share that is recorded, 0..=1.
///
/// # Errors
/// Where the scene cannot be drawn, or the file cannot be written or read.
pub fn open_or_record(
    subject: &Subject,
    spec: &BankSpec,
    path: &Path,
    progress: impl FnMut(f64),
) -> Result<Bank, EvalError> {
    if let Ok(bank) = Bank::open(path)
        && bank.spec() == spec
        && record::is_current(subject, &bank)?
    {
        return Ok(bank);
    }
    record(subject, spec, path, progress)?;
    Bank::open(path)
}
