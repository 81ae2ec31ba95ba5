//! `cargo xtask measure`: the figures of docs/measurements.md, printed as Markdown tables.

mod artefacts;
mod bits;
mod end;
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
    /// Whether renders get the noise they are asked for: docs/noise.md
    Noise {
        /// Only scenes whose path contains this
        #[arg(long)]
        only: Option<String>,
        /// Renders for each noise
        #[arg(long, default_value_t = 20)]
        runs: u32,
        /// Seconds after which no more of them are begun
        #[arg(long, default_value_t = 25)]
        seconds: u32,
    },
    /// Whether renders end when they are told to: docs/noise.md
    Time {
        /// Only scenes whose path contains this
        #[arg(long)]
        only: Option<String>,
    },
    /// Whether renders foresee their end: docs/noise.md
    Eta {
        /// Only scenes whose path contains this
        #[arg(long)]
        only: Option<String>,
        /// Renders of each
        #[arg(long, default_value_t = 4)]
        runs: u32,
    },
    /// Whether renders of larger pictures foresee when they will be done, on an idle machine: docs/noise.md
    End {
        /// Only scenes whose path contains this
        #[arg(long)]
        only: Option<String>,
        /// Renders of each
        #[arg(long, default_value_t = 2)]
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
        Measure::Noise { only, runs, seconds } => noise::noise(&quietus, only.as_deref(), *runs, *seconds),
        Measure::Time { only } => noise::time(&quietus, only.as_deref()),
        Measure::Eta { only, runs } => noise::eta(&quietus, only.as_deref(), *runs),
        Measure::End { only, runs } => end::end(&quietus, only.as_deref(), *runs),
        Measure::Results { only } => results::results(&quietus, only.as_deref()),
    }
}
