//! What tests of the program from outside share: running it, and what it says.
#![allow(dead_code, reason = "each test program uses its own share")]

use std::path::Path;
use std::process::{Command, Output};

/// The program in `dir`, with arguments that have no spaces in them. Whoever tests may have settings of their own: they
/// are out of reach.
pub(crate) fn command(dir: &Path, arguments: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_quietus"));
    command.env("XDG_CONFIG_HOME", env!("CARGO_TARGET_TMPDIR"));
    command.current_dir(dir).args(arguments.split_whitespace());
    command
}

/// Runs it to its end.
pub(crate) fn quietus(dir: &Path, arguments: &str) -> Output {
    command(dir, arguments).output().expect("the program starts")
}

/// What it said of itself.
pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// What it said.
pub(crate) fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Wants success.
pub(crate) fn succeeded(arguments: &str, output: Output) -> Output {
    assert!(output.status.success(), "{arguments}: {}", stderr(&output));
    output
}

/// Wants exit code `code` and an error, and no panic; returns the message.
pub(crate) fn refusal(arguments: &str, output: &Output, code: i32) -> String {
    let message = stderr(output);
    assert_eq!(output.status.code(), Some(code), "{arguments}: {message}");
    assert!(message.starts_with("error: ") && !message.contains("panicked"), "{arguments}: {message}");
    message
}
