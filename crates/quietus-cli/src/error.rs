//! Everything that ends the program early, and the one table of exit codes.

use std::fmt;
use std::process::ExitCode;

use quietus_film::{LayoutError, OutputError};
use quietus_render::RenderError;
use quietus_scene::SceneError;

/// Kinds of endings, each with its exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    /// All is well.
    Success,
    /// Pictures that differ more than was allowed.
    Different,
    /// Flags that make no sense, alone or together.
    Usage,
    /// A scene or another input that cannot be read or drawn.
    Input,
    /// An output that cannot be written.
    Output,
    /// A fault of the program.
    Internal,
    /// Stopped by a signal.
    Interrupted,
}

impl Ending {
    /// What the program tells its caller.
    pub(crate) fn code(self) -> u8 {
        match self {
            Self::Success => 0,
            Self::Different => 1,
            Self::Usage => 2,
            Self::Input => 3,
            Self::Output => 4,
            Self::Internal => 70,
            Self::Interrupted => 130,
        }
    }
}

impl From<Ending> for ExitCode {
    fn from(ending: Ending) -> Self {
        Self::from(ending.code())
    }
}

/// The table as `--help` shows it.
pub(crate) const EXIT_CODES: &str = "\
Exit codes:
    0  done
    1  pictures that differ more than was allowed
    2  flags that make no sense, alone or together
    3  a scene or another input that cannot be read or drawn
    4  an output that cannot be written
   70  a fault of the program
  130  stopped by Ctrl-C, SIGTERM or SIGHUP (what was done by then is written)";

/// An ending with its message.
#[derive(Debug)]
pub(crate) struct Failure {
    /// Its kind.
    pub ending: Ending,
    /// One clear message.
    pub message: String,
}

impl Failure {
    /// Flags that make no sense.
    pub(crate) fn usage(message: impl Into<String>) -> Self {
        Self { ending: Ending::Usage, message: message.into() }
    }

    /// Input that cannot be used.
    pub(crate) fn input(message: impl Into<String>) -> Self {
        Self { ending: Ending::Input, message: message.into() }
    }

    /// A fault of the program.
    pub(crate) fn internal(message: impl Into<String>) -> Self {
        Self { ending: Ending::Internal, message: message.into() }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl From<OutputError> for Failure {
    fn from(error: OutputError) -> Self {
        let ending = match error {
            OutputError::Extension(_) => Ending::Usage,
            OutputError::Read { .. } => Ending::Input,
            OutputError::NotAFile(_) | OutputError::Write { .. } | OutputError::Format { .. } => {
                Ending::Output
            }
        };
        Self { ending, message: error.to_string() }
    }
}

impl From<SceneError> for Failure {
    fn from(error: SceneError) -> Self {
        Self::input(error.to_string())
    }
}

impl From<LayoutError> for Failure {
    fn from(error: LayoutError) -> Self {
        Self::usage(error.to_string())
    }
}

impl From<RenderError> for Failure {
    fn from(error: RenderError) -> Self {
        match error {
            RenderError::Layout(error) => error.into(),
            RenderError::Settings(error) => Self::usage(error.to_string()),
            other => Self::internal(other.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_in_the_help_lists_every_code() {
        let endings = [
            Ending::Success,
            Ending::Different,
            Ending::Usage,
            Ending::Input,
            Ending::Output,
            Ending::Internal,
            Ending::Interrupted,
        ];
        let listed: Vec<u8> = EXIT_CODES
            .lines()
            .skip(1)
            .map(|line| line.split_whitespace().next().and_then(|code| code.parse().ok()).unwrap())
            .collect();
        assert_eq!(listed, endings.map(Ending::code));
    }
}
