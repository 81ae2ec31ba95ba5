//! What watches a render: flags of `quietus render` that change nothing about the picture.

use clap::Args;

use crate::progress::ProgressArg;

/// Flags on watching.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Watching")]
pub(crate) struct WatchingArgs {
    /// How progress is shown.
    #[arg(long, value_enum, default_value_t, value_name = "HOW")]
    pub progress: ProgressArg,
}
