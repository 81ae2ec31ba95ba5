//! `cargo xtask measure`: the figures of docs/measurements.md, printed as Markdown tables.

mod artefacts;
mod bits;
mod figure1;
mod noise;
mod protocol;
mod results;
mod view;

use anyhow::Result;
use clap::Subcommand;

use crate::run::Quietus;

#[derive(Subcommand)]
pub(crate) enum Measure {
    /// Rebuild times in live renders, the talk's way and ours, at film and 4K resolution
    Rebuild,
    /// Waiting for locks, and idling at lag 1 and lag 2
    Locks,
    /// The same bits for any number of threads
    Bits,
    /// Samples per second over threads
    Scaling,
    /// Figure 1 of the talk: `tile` beside `quietus` at the same number of samples
    Figure1,
    /// What the live view costs a render: docs/view.md
    View,
    /// Whether renders get the noise and the time they are asked for: docs/noise.md
    Noise {
        /// Only scenes whose path contains this
        #[arg(long)]
        only: Option<String>,
        /// Renders for each noise
        #[arg(long, default_value_t = 20)]
        runs: u32,
    },
    /// What every policy gains and loses on every scene, by replay: docs/results.md
    Results {
        /// Only scenes whose path contains this
        #[arg(long)]
        only: Option<String>,
    },
}

pub(crate) fn measure(what: &Measure) -> Result<()> {
    let quietus = Quietus::build()?;
    match what {
        Measure::Rebuild => protocol::rebuild(&quietus),
        Measure::Locks => protocol::locks(&quietus),
        Measure::Bits => bits::bits(&quietus),
        Measure::Scaling => protocol::scaling(&quietus),
        Measure::Figure1 => figure1::figure1(&quietus),
        Measure::View => view::view(&quietus),
        Measure::Noise { only, runs } => noise::noise(&quietus, only.as_deref(), *runs),
        Measure::Results { only } => results::results(&quietus, only.as_deref()),
    }
}
