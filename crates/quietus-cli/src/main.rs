//! The `quietus` program: arguments, messages and exit codes. All work is done by the libraries.

mod after;
mod args;
mod closing;
mod config;
mod error;
mod eval;
mod goal;
mod interrupt;
mod keeping;
mod logging;
mod outputs;
mod plan;
mod progress;
mod render;
mod replay;
mod report;
mod say;
mod source;
mod timeline;
mod trace_file;
mod viewing;
mod watching;
mod weight;
mod wishes;

use std::process::ExitCode;

use clap::CommandFactory;

use crate::args::{Cli, Command};
use crate::config::Complete;
use crate::error::{Ending, Failure};
use crate::trace_file::TraceFile;

fn main() -> ExitCode {
    // The hook has told what and where; what is left is the exit code.
    let outcome = std::panic::catch_unwind(run);
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

fn run() -> Result<Ending, Failure> {
    let Complete { cli, origin, has_settings } = config::complete(std::env::args_os().collect())?;
    let trace = match &cli.command {
        Some(Command::Render(args) | Command::View(args)) => {
            args.watching.trace.as_deref().map(trace_file::start).transpose()?
        }
        _ => None,
    };
    let (trace, layer) = trace.unzip();
    logging::start(cli.verbose, layer);
    if cli.quiet {
        say::be_quiet();
    }
    tracing::info!("settings: {origin}");
    let outcome = dispatch(&cli).map_err(|mut failure| {
        // Who typed none of the flags should know where they come from.
        if has_settings && failure.ending == Ending::Usage {
            failure.message.push_str(&format!("\n(settings {origin})"));
        }
        failure
    });
    let traced = trace.map_or(Ok(()), TraceFile::finish);
    outcome.and_then(|ending| traced.map(|()| ending))
}

fn dispatch(cli: &Cli) -> Result<Ending, Failure> {
    match &cli.command {
        Some(Command::Render(args)) => render::run(args, false),
        Some(Command::View(args)) => render::run(args, true),
        Some(Command::Info { file }) => {
            say::result(after::info::describe(file)?);
            Ok(Ending::Success)
        }
        Some(Command::Eval(args)) => eval::run(args),
        Some(Command::Compare(args)) => after::compare::run(args),
        Some(Command::Inspect(args)) => after::inspect::run(args),
        Some(Command::Convert(args)) => after::convert::run(args),
        Some(Command::Config) => config::show(cli).map(|()| Ending::Success),
        Some(Command::Completions { shell }) => {
            let mut script = Vec::new();
            clap_complete::generate(*shell, &mut Cli::command(), "quietus", &mut script);
            say::result(String::from_utf8_lossy(&script).trim_end());
            Ok(Ending::Success)
        }
        None => unreachable!("a command is added where there is none"),
    }
}
