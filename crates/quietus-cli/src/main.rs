//! The `quietus` program: arguments, messages and exit codes. All work is done by the libraries.

mod after;
mod args;
mod error;
mod eval;
mod interrupt;
mod logging;
mod outputs;
mod plan;
mod progress;
mod render;
mod report;
mod say;
mod source;
mod timeline;
mod viewing;
mod watching;
mod wishes;

use std::process::ExitCode;

use clap::Parser;

use crate::args::{Cli, Command};
use crate::error::{Ending, Failure};

fn main() -> ExitCode {
    let cli = Cli::parse();
    logging::start(cli.verbose);
    if cli.quiet {
        say::be_quiet();
    }
    // The hook has told what and where; what is left is the exit code.
    let outcome = std::panic::catch_unwind(|| run(cli));
    let outcome =
        outcome.unwrap_or_else(|_| Err(Failure::internal("the program panicked; please report it")));
    match outcome {
        Ok(ending) => ending.into(),
        Err(failure) => {
            say::error(&failure, failure.ending.code());
            failure.ending.into()
        }
    }
}

fn run(cli: Cli) -> Result<Ending, Failure> {
    match cli.command {
        Some(Command::Render(args)) => render::run(&args, false),
        Some(Command::View(args)) => render::run(&args, true),
        Some(Command::Info { file }) => {
            say::result(after::info::describe(&file)?);
            Ok(Ending::Success)
        }
        Some(Command::Eval(args)) => eval::run(&args),
        Some(Command::Compare(args)) => after::compare::run(&args),
        Some(Command::Inspect(args)) => after::inspect::run(&args),
        Some(Command::Convert(args)) => after::convert::run(&args),
        None => render::run(&built_in(), false),
    }
}

/// `quietus` alone: `quietus render` without any flags.
fn built_in() -> args::RenderArgs {
    match Cli::parse_from(["quietus", "render"]).command {
        Some(Command::Render(args)) => *args,
        _ => unreachable!("`render` parses as `render`"),
    }
}
