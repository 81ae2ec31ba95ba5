//! `quietus.toml`: settings by the names they have on the command line, which wins.
//!
//! A setting of the file becomes a flag after those of the command line, unless the command line has the same flag
//! or one that excludes it. So whatever can be asked for on the command line can stand in the file, and means the same.

mod file;

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::error::{ContextKind, ContextValue};
use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Command, CommandFactory, FromArgMatches};

use self::file::Setting;
use crate::args::Cli;
use crate::error::Failure;
use crate::say;

/// Name of the file.
const NAME: &str = "quietus.toml";

/// A command line that is complete.
#[derive(Debug)]
pub(crate) struct Complete {
    /// What is asked for.
    pub cli: Cli,
    /// What the file had to do with it, in a sentence.
    pub origin: String,
    /// Whether the file added something.
    pub has_settings: bool,
}

/// What is drawn without a command: in half a minute, and clean enough to be looked at.
const FIRST_LOOK: [&str; 4] = ["--size", "480x270", "--noise", "2%"];

/// Parses `words` and what the file adds to them. Where they ask for help, or make no sense, the program ends here.
///
/// # Errors
/// A file that was named and is not there, or one with something wrong in it.
pub(crate) fn complete(words: Vec<OsString>) -> Result<Complete, Failure> {
    let mut words = with_negative_values(words);
    let mut matches = parse(&words).or_else(|error| match error.get(ContextKind::InvalidSubcommand) {
        Some(ContextValue::String(word)) if is_file_name(word) => Err(Failure::usage(format!(
            "`{word}` is no command: `quietus render {word}` draws a scene, --help has the rest"
        ))),
        _ => error.exit(),
    })?;
    if matches.subcommand().is_none() {
        // `quietus` alone is a first look at what it does: soon there rather than clean.
        words.extend(["render"].into_iter().chain(FIRST_LOOK).map(OsString::from));
        matches = parse(&words).unwrap_or_else(|error| error.exit());
    }
    let cli = |matches: &ArgMatches| Cli::from_arg_matches(matches).unwrap_or_else(|error| error.exit());
    let first = cli(&matches);
    let Some(path) = (if first.no_config { None } else { find(first.config.as_deref()) }) else {
        return Ok(Complete { cli: first, origin: format!("no {NAME} is used"), has_settings: false });
    };
    let settings = file::read(&path, &Cli::command())?;
    let (name, given) = matches.subcommand().unwrap_or_else(|| unreachable!("a command was added"));
    let command = Cli::command();
    let command = command.find_subcommand(name).unwrap_or_else(|| unreachable!("it was parsed"));
    let own = |setting: &Setting| setting.command == name;
    let own_names: Vec<_> = settings.iter().filter(|s| own(s)).map(|s| s.name.clone()).collect();
    // What is viewed is a render, with its settings unless it has its own.
    let shared = |setting: &Setting| {
        name == "view" && setting.command == "render" && !own_names.contains(&setting.name)
    };
    let used = settings.into_iter().filter(|setting| own(setting) || shared(setting));
    let used: Vec<_> = used.filter(|setting| !is_overruled(setting, command, given)).collect();
    let names: Vec<_> = used.iter().map(|setting| setting.name.as_str()).collect();
    let origin = match names.is_empty() {
        true => format!("{} has nothing to add", path.display()),
        false => format!("from {}: {}", path.display(), names.join(", ")),
    };
    let completed = parse(&with(&words, &used)).map_err(|error| blame(&path, &words, &used, &error))?;
    Ok(Complete { cli: cli(&completed), origin, has_settings: !used.is_empty() })
}

/// Joins what begins like a number below 0 to the flag before it: `--noise -1%` is a wrong noise and not an unknown flag `-1`,
/// as no flag begins with a digit.
fn with_negative_values(words: Vec<OsString>) -> Vec<OsString> {
    let is_flag = |word: &OsString| {
        let word = word.to_string_lossy();
        word.starts_with("--") && word != "--" && !word.contains('=')
    };
    let is_negative = |word: &OsString| {
        let word = word.to_string_lossy();
        word.strip_prefix('-').is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit() || c == '.'))
    };
    let end = words.iter().position(|word| word == "--").unwrap_or(words.len());
    let mut joined: Vec<OsString> = Vec::with_capacity(words.len());
    for (i, word) in words.into_iter().enumerate() {
        match joined.last_mut() {
            Some(flag) if i < end && is_flag(flag) && is_negative(&word) => {
                flag.push("=");
                flag.push(word);
            }
            _ => joined.push(word),
        }
    }
    joined
}

/// Whether who typed this meant a file rather than a command.
fn is_file_name(word: &str) -> bool {
    word.contains(['.', '/', '\\']) || Path::new(word).is_file()
}

fn parse(words: &[OsString]) -> Result<ArgMatches, clap::Error> {
    Cli::command().try_get_matches_from(words)
}

/// The file to read: the one that is named, else the first that is there.
fn find(named: Option<&Path>) -> Option<PathBuf> {
    if let Some(path) = named {
        return Some(path.to_owned());
    }
    let of_user = dirs::config_dir().map(|dir| dir.join("quietus").join(NAME));
    [Some(PathBuf::from(NAME)), of_user].into_iter().flatten().find(|path| path.is_file())
}

/// Whether the command line has this flag, or one that excludes it.
fn is_overruled(setting: &Setting, command: &Command, given: &ArgMatches) -> bool {
    let is_given = |arg: &Arg| given.value_source(arg.get_id().as_str()) == Some(ValueSource::CommandLine);
    let excludes = |one: &Arg, other: &Arg| {
        command.get_arg_conflicts_with(one).iter().any(|arg| arg.get_id() == other.get_id())
    };
    let Some(own) = command.get_arguments().find(|arg| arg.get_long() == Some(&setting.name)) else {
        return false;
    };
    command.get_arguments().any(|arg| {
        is_given(arg) && (arg.get_id() == own.get_id() || excludes(own, arg) || excludes(arg, own))
    })
}

/// The command line with flags added, in front of a `--` if there is one.
fn with<'a>(words: &[OsString], settings: impl IntoIterator<Item = &'a Setting>) -> Vec<OsString> {
    let end = words.iter().position(|word| word == "--").unwrap_or(words.len());
    let added = settings.into_iter().flat_map(|setting| setting.words.iter().map(OsString::from));
    words[..end].iter().cloned().chain(added).chain(words[end..].iter().cloned()).collect()
}

/// Which line of the file is wrong: the first that is wrong alone.
fn blame(path: &Path, words: &[OsString], settings: &[Setting], error: &clap::Error) -> Failure {
    let alone = settings.iter().find_map(|s| parse(&with(words, [s])).err().map(|error| (s, error)));
    let message = |error: &clap::Error| {
        // Without the usage that follows: nobody typed anything.
        let text = error.render().to_string();
        let text = text.strip_prefix("error: ").unwrap_or(&text);
        text.split("\n\n").next().unwrap_or(text).trim_end().to_owned()
    };
    Failure::usage(match alone {
        Some((setting, error)) => {
            let Setting { line, name, .. } = setting;
            format!("{}:{line}: `{name}`: {}", path.display(), message(&error))
        }
        None => format!("{}: {}", path.display(), message(error)),
    })
}

/// `quietus config`: which file is used, and what it says.
///
/// # Errors
/// A file that was named and is not there, or one with something wrong in it.
pub(crate) fn show(cli: &Cli) -> Result<(), Failure> {
    let Some(path) = (if cli.no_config { None } else { find(cli.config.as_deref()) }) else {
        let of_user = dirs::config_dir().map(|dir| dir.join("quietus").join(NAME).display().to_string());
        let places = [Some(NAME.to_owned()), of_user].into_iter().flatten().collect::<Vec<_>>();
        say::result(format_args!("no settings file; looked for {}", places.join(" and ")));
        return Ok(());
    };
    let settings = file::read(&path, &Cli::command())?;
    say::result(format_args!("{}", path.display()));
    for Setting { command, line, words, .. } in &settings {
        say::result(format_args!("{line:>4}  quietus {command} {}", words.join(" ")));
    }
    Ok(())
}
