//! One entry to everything a developer of Quietus does: `cargo xtask test`, `lint`, `bench`, `build`, `fuzz`, `measure`,
//! `gallery`.

mod bench;
mod browser;
mod fuzz;
mod gallery;
mod lint;
mod measure;
mod profile_guided;
mod run;
mod test;

use clap::{Parser, Subcommand};

#[derive(Parser)]
#[command(name = "cargo xtask", about = "Developer tasks of Quietus")]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Everything that must pass: formatting, lints, unit, integration, statistical and concurrency tests
    Test,
    /// Formatting, clippy with warnings as errors, and the house rules
    Lint,
    /// Licences and advisories of dependencies, with cargo-deny (installed on demand)
    Deny,
    /// `peers`: whole pictures against Mitsuba 3; `kernel`: rays against Embree 3; else criterion's benches
    Bench {
        /// Passed on, for example `peers --turns 5 --profile-guided`, or to `cargo bench`: `-p quietus --bench rebuild`
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<String>,
    },
    /// The program, optimised for what it does with a dozen scenes: the fastest there is
    Build,
    /// Hostile files for every reader, with libFuzzer on a stable toolchain (see docs/fuzzing.md)
    Fuzz(fuzz::Fuzz),
    /// Measurements behind the figures in docs/measurements.md
    #[command(subcommand)]
    Measure(measure::Measure),
    /// The pictures of docs/gallery; without a word more the three large ones
    Gallery {
        /// Others
        #[command(subcommand)]
        what: Option<gallery::Gallery>,
    },
}

fn main() -> anyhow::Result<()> {
    match Arguments::parse().task {
        Task::Test => test::test(),
        Task::Lint => lint::lint(),
        Task::Deny => lint::deny(),
        Task::Bench { arguments } => bench::bench(&arguments),
        Task::Build => profile_guided::program(),
        Task::Fuzz(what) => fuzz::fuzz(&what),
        Task::Measure(what) => measure::measure(&what),
        Task::Gallery { what } => gallery::gallery(what),
    }
}
