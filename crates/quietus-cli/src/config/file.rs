//! Reads a settings file: TOML, a table for each command.

use std::ops::Range;
use std::path::Path;

use clap::{Arg, ArgAction, Command};
use toml_edit::{Document, Item, Table, Value};

use crate::error::Failure;

/// Settings files are short; what is longer is something else.
const MOST_BYTES: u64 = 1 << 20;
/// Names that are less alike are not suggested.
const LEAST_LIKENESS: f64 = 0.75;

/// A setting of a command, as flags.
#[derive(Debug, PartialEq)]
pub(super) struct Setting {
    /// The command.
    pub command: String,
    /// The name of the flag, without dashes.
    pub name: String,
    /// Its line in the file, from 1.
    pub line: usize,
    /// The words it is on the command line; none for a flag that is false.
    pub words: Vec<String>,
}

/// Reads the file at `path` for the commands of `program`.
///
/// # Errors
/// When it cannot be read, is no TOML, or has a name or a kind of value that no flag has.
pub(super) fn read(path: &Path, program: &Command) -> Result<Vec<Setting>, Failure> {
    let cannot =
        |error: &dyn std::fmt::Display| Failure::input(format!("{}: cannot read: {error}", path.display()));
    if !path.exists() {
        return Err(Failure::input(format!("{}: no such file", path.display())));
    }
    if !path.is_file() {
        return Err(Failure::input(format!("{}: is not a regular file", path.display())));
    }
    let size = std::fs::metadata(path).map_err(|error| cannot(&error))?.len();
    if size > MOST_BYTES {
        return Err(cannot(&format_args!("{size} bytes are too many for settings")));
    }
    let text = std::fs::read_to_string(path).map_err(|error| cannot(&error))?;
    settings(&text, program)
        .map_err(|Fault { line, reason }| Failure::usage(format!("{}:{line}: {reason}", path.display())))
}

/// What is wrong, and where.
#[derive(Debug, PartialEq)]
struct Fault {
    line: usize,
    reason: String,
}

fn settings(text: &str, program: &Command) -> Result<Vec<Setting>, Fault> {
    // Lines are counted from 1.
    let line = |span: Option<Range<usize>>| {
        let start = span.map_or(0, |span| span.start.min(text.len()));
        1 + text.as_bytes()[..start].iter().filter(|byte| **byte == b'\n').count()
    };
    let document = Document::parse(text).map_err(|error| {
        let reason = error.message().trim_end().replace('\n', ", ");
        Fault { line: line(error.span()), reason: format!("not TOML: {reason}") }
    })?;
    let mut settings = Vec::new();
    for (name, item) in document.as_table() {
        let place = |span: Option<Range<usize>>| line(span.or_else(|| key_span(document.as_table(), name)));
        let fault = |reason: String| Fault { line: place(None), reason };
        let Some(table) = item.as_table() else {
            return Err(fault(format!(
                "`{name}` stands under no command: expected a line such as [render] above it"
            )));
        };
        let Some(command) = program.find_subcommand(name) else {
            let names = program.get_subcommands().map(|command| command.get_name());
            return Err(fault(format!("no command is called `{name}`{}", nearest(name, names))));
        };
        for (key, item) in table {
            let line = line(key_span(table, key));
            let fault = |reason: String| Fault { line, reason };
            let arg = find(command, key).map_err(fault)?;
            let words = words(arg, key, item).map_err(fault)?;
            settings.push(Setting { command: name.to_owned(), name: key.to_owned(), line, words });
        }
    }
    Ok(settings)
}

fn key_span(table: &Table, key: &str) -> Option<Range<usize>> {
    table.get_key_value(key).and_then(|(key, _)| key.span())
}

/// The flag of that name.
fn find<'a>(command: &'a Command, name: &str) -> Result<&'a Arg, String> {
    let flags = || command.get_arguments().filter(|arg| arg.get_long().is_some() && !arg.is_global_set());
    let found = flags().find(|arg| arg.get_long() == Some(name));
    found.ok_or_else(|| {
        let near = nearest(name, flags().filter_map(Arg::get_long));
        let is_positional = command.get_positionals().any(|arg| arg.get_id() == name);
        let instead = if is_positional { ", which goes on the command line" } else { "" };
        format!("`quietus {}` has no setting `{name}`{instead}{near}", command.get_name())
    })
}

/// A suggestion, where one of `names` is like `name`.
fn nearest<'a>(name: &str, names: impl Iterator<Item = &'a str>) -> String {
    let likeness = names.map(|other| (strsim::jaro_winkler(name, other), other));
    match likeness.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(likeness, _)| *likeness >= LEAST_LIKENESS) {
        Some((_, other)) => format!("; is `{other}` meant?"),
        None => String::new(),
    }
}

/// The words that a value is on the command line.
fn words(arg: &Arg, name: &str, item: &Item) -> Result<Vec<String>, String> {
    let word = |value: &Value| match value {
        Value::String(text) => Ok(format!("--{name}={}", text.value())),
        Value::Integer(number) => Ok(format!("--{name}={}", number.value())),
        Value::Float(number) => Ok(format!("--{name}={}", number.value())),
        other => Err(format!("`{name}`: expected text or a number, found {}", other.type_name())),
    };
    let is_list = matches!(arg.get_action(), ArgAction::Append);
    match (arg.get_action(), item.as_value()) {
        (ArgAction::SetTrue, Some(Value::Boolean(is_set))) => {
            Ok(if *is_set.value() { vec![format!("--{name}")] } else { Vec::new() })
        }
        (ArgAction::SetTrue, _) => {
            Err(format!("`{name}`: expected true or false, found {}", item.type_name()))
        }
        (_, Some(Value::Array(values))) if is_list => values.iter().map(word).collect(),
        (_, Some(value)) => Ok(vec![word(value)?]),
        (_, None) => Err(format!("`{name}`: expected a value, found {}", item.type_name())),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::args::Cli;

    fn read(text: &str) -> Result<Vec<Setting>, String> {
        let found = settings(text, &Cli::command());
        found.map_err(|Fault { line, reason }| format!("{line}: {reason}"))
    }

    #[test]
    fn values_become_flags() {
        let text = "# comment\n[render]\nseed = 7\nunbiased = true\noutput = ['a.exr', 'b.png']\nexposure = 0.5\n\n\
                    [compare]\njson = false\n";
        let found = read(text).unwrap();
        let words: Vec<_> = found.iter().map(|s| (s.command.as_str(), s.line, s.words.join(" "))).collect();
        let expected = [
            ("render", 3, "--seed=7".to_owned()),
            ("render", 4, "--unbiased".to_owned()),
            ("render", 5, "--output=a.exr --output=b.png".to_owned()),
            ("render", 6, "--exposure=0.5".to_owned()),
            ("compare", 9, String::new()),
        ];
        assert_eq!(words, expected);
        assert_eq!(read(""), Ok(Vec::new()));
    }

    #[test]
    fn mistakes_are_told_with_their_lines() {
        let cases = [
            ("[render]\nseed = ", "2: not TOML: "),
            ("\nseed = 1", "2: `seed` stands under no command: expected a line such as [render] above it"),
            ("[rendr]\n", "1: no command is called `rendr`; is `render` meant?"),
            ("[render]\nthread = 3", "2: `quietus render` has no setting `thread`; is `threads` meant?"),
            (
                "[compare]\nfirst = 'a.exr'",
                "2: `quietus compare` has no setting `first`, which goes on the command line",
            ),
            (
                "[render]\nscene = 'a.glb'",
                "2: `quietus render` has no setting `scene`, which goes on the command line; is `scene-in-file` meant?",
            ),
            ("[render]\nconfig = 'a'", "2: `quietus render` has no setting `config`"),
            ("[render]\n\nunbiased = 'yes'", "3: `unbiased`: expected true or false, found string"),
            ("[render]\nseed = [1]", "2: `seed`: expected text or a number, found array"),
            ("[render]\nseed = true", "2: `seed`: expected text or a number, found boolean"),
            ("[render.seed]\na = 1", "1: `seed`: expected a value, found table"),
        ];
        for (text, expected) in cases {
            let message = read(text).unwrap_err();
            assert!(message.starts_with(expected), "{text:?}: {message}");
        }
    }
}
