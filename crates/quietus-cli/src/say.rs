//! Words to the user. A reader that went away, as `head` does, is no reason to fail.

use std::fmt::Display;
use std::io::Write;

/// A result, on stdout.
pub(crate) fn result(text: impl Display) {
    let _ = writeln!(std::io::stdout(), "{text}");
}

/// Everything else, on stderr.
pub(crate) fn aside(text: impl Display) {
    let _ = writeln!(std::io::stderr(), "{text}");
}
