//! Words to the user. A reader that went away, as `head` does, is no reason to fail.
//!
//! While a render shows its progress, words go through that display: nothing else writes to its terminal, and
//! nobody who has something to say waits for a slow one.

use std::fmt::Display;
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde::Serialize;

/// Kinds of words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// What went on: lines of a log.
    Log,
    /// What the user should know.
    Note,
    /// What went wrong although the work goes on.
    Warning,
}

/// Where words go while progress is shown.
pub(crate) trait Screen: Send + Sync {
    /// Takes `text`, to be shown as soon as may be. Does not wait.
    fn take(&self, kind: Kind, text: String);
}

static SCREEN: Mutex<Option<Arc<dyn Screen>>> = Mutex::new(None);
static QUIET: AtomicBool = AtomicBool::new(false);
static JSON: AtomicBool = AtomicBool::new(false);

fn screen() -> MutexGuard<'static, Option<Arc<dyn Screen>>> {
    // A pointer is whole at any time.
    SCREEN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// From here on, only warnings, errors and what was asked for are said.
pub(crate) fn be_quiet() {
    // Relaxed: the flag guards no data, here and below.
    QUIET.store(true, Ordering::Relaxed);
}

/// From here on, what is said is said in JSON, one object per line on stdout.
pub(crate) fn speak_json() {
    JSON.store(true, Ordering::Relaxed);
}

fn speaks_json() -> bool {
    JSON.load(Ordering::Relaxed)
}

/// Whether only warnings, errors and what was asked for are said.
pub(crate) fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// Words go to a screen until this is dropped.
pub(crate) struct Through(());

impl Drop for Through {
    fn drop(&mut self) {
        screen().take();
    }
}

/// Sends words to `to` from here on.
pub(crate) fn through(to: Arc<dyn Screen>) -> Through {
    *screen() = Some(to);
    Through(())
}

/// What was asked for, on stdout.
pub(crate) fn result(text: impl Display) {
    let _ = writeln!(std::io::stdout(), "{text}");
}

/// What a command did, on stdout, unless it should be quiet or speaks JSON.
pub(crate) fn outcome(text: impl Display) {
    if !is_quiet() && !speaks_json() {
        result(text);
    }
}

/// Where the live view is: on stdout, in whatever way the program speaks.
pub(crate) fn address(address: &str) {
    #[derive(Serialize)]
    struct Body<'a> {
        address: &'a str,
    }
    match speaks_json() {
        true => event("view", &Body { address }),
        false => result(format_args!("look at it in a browser: {address}")),
    }
}

/// What is good to know, on stderr, unless the program should be quiet.
pub(crate) fn aside(text: impl Display) {
    if !is_quiet() || speaks_json() {
        say(Kind::Note, text.to_string());
    }
}

/// What went wrong although the work goes on, on stderr.
pub(crate) fn warning(text: impl Display) {
    say(Kind::Warning, text.to_string());
}

/// A line of the log, on stderr.
pub(crate) fn log(line: impl Display) {
    say(Kind::Log, line.to_string());
}

/// Why the program ends, on stderr.
pub(crate) fn error(text: impl Display, code: u8) {
    #[derive(Serialize)]
    struct Body {
        exit_code: u8,
        message: String,
    }
    let message = text.to_string();
    let _ = writeln!(std::io::stderr(), "error: {message}");
    event("error", &Body { exit_code: code, message });
}

/// Where the program speaks JSON, a line `{"event": name, ...body}` on stdout; `docs/terminal.md` lists them.
pub(crate) fn event(name: &'static str, body: &impl Serialize) {
    #[derive(Serialize)]
    struct Event<'a, T> {
        event: &'static str,
        #[serde(flatten)]
        body: &'a T,
    }
    if speaks_json()
        && let Ok(line) = serde_json::to_string(&Event { event: name, body })
    {
        result(line);
    }
}

fn say(kind: Kind, text: String) {
    match &*screen() {
        Some(screen) => screen.take(kind, text),
        None => directly(kind, &text),
    }
}

/// Says it at once, past any screen: for the screens themselves.
pub(crate) fn directly(kind: Kind, text: &str) {
    #[derive(Serialize)]
    struct Message<'a> {
        message: &'a str,
    }
    match kind {
        Kind::Note if speaks_json() => event("note", &Message { message: text }),
        Kind::Warning if speaks_json() => event("warning", &Message { message: text }),
        _ => {
            let _ = writeln!(std::io::stderr(), "{}", worded(kind, text));
        }
    }
}

/// The text as people read it.
pub(crate) fn worded(kind: Kind, text: &str) -> String {
    match kind {
        Kind::Warning => format!("warning: {text}"),
        Kind::Log | Kind::Note => text.to_owned(),
    }
}
