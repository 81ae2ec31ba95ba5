//! Places in scene files, what is wrong there, and what is merely worth saying.

use std::cell::RefCell;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

use super::predecessor;
use crate::error::{ErrorKind, SceneError, Warning};

/// Where a token starts: the file's number, and line and column, both from 1. Columns count bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub file: u32,
    pub line: u32,
    pub column: u32,
}

/// Why reading stopped. Turned into a [`SceneError`] by [`Context::error`], which knows the files' names.
#[derive(Debug)]
pub(super) struct Fault(Box<Reason>);

#[derive(Debug)]
enum Reason {
    /// Something in a scene file.
    At(ErrorKind, Place, String),
    /// Something in another file, or about a whole file.
    Other(SceneError),
}

/// What reading gives.
pub(super) type Result<T> = std::result::Result<T, Fault>;

impl Fault {
    /// Text that does not follow the grammar.
    pub(super) fn syntax(place: Place, message: impl Into<String>) -> Self {
        Self(Box::new(Reason::At(ErrorKind::Syntax, place, message.into())))
    }

    /// Well-formed text that makes no sense.
    pub(super) fn invalid(place: Place, message: impl Into<String>) -> Self {
        Self(Box::new(Reason::At(ErrorKind::Invalid, place, message.into())))
    }

    /// Something beyond a limit.
    pub(super) fn unsupported(place: Place, message: impl Into<String>) -> Self {
        Self(Box::new(Reason::At(ErrorKind::Unsupported, place, message.into())))
    }
}

impl From<SceneError> for Fault {
    fn from(error: SceneError) -> Self {
        Self(Box::new(Reason::Other(error)))
    }
}

/// What all parts of the reader share: the files read so far, and the warnings.
#[derive(Debug)]
pub(super) struct Context {
    /// The scene's folder, in which all names of files are looked up.
    folder: PathBuf,
    /// The files that places refer to; the scene itself is the first.
    files: RefCell<Vec<PathBuf>>,
    warnings: RefCell<Vec<Warning>>,
    said: RefCell<HashSet<String>>,
}

impl Context {
    /// For the scene at `path`.
    pub(super) fn new(path: &Path) -> Self {
        Self {
            folder: path.parent().unwrap_or(Path::new("")).to_path_buf(),
            files: RefCell::new(vec![path.to_path_buf()]),
            warnings: RefCell::default(),
            said: RefCell::default(),
        }
    }

    /// Where a file that the scene calls `name` lies: beside the scene, even if an included file names it.
    pub(super) fn resolve(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Numbers a file for places in it.
    pub(super) fn add_file(&self, path: &Path) -> u32 {
        let mut files = self.files.borrow_mut();
        files.push(path.to_path_buf());
        files.len() as u32 - 1
    }

    /// The place as words: `line:column`, with the file before it where that is not the scene itself.
    pub(super) fn words(&self, place: Place) -> String {
        let Place { file, line, column } = place;
        match file {
            0 => format!("{line}:{column}"),
            _ => format!("{}:{line}:{column}", self.files.borrow()[file as usize].display()),
        }
    }

    /// The place as words, always with its file.
    pub(super) fn full_words(&self, place: Place) -> String {
        let Place { file, line, column } = place;
        format!("{}:{line}:{column}", self.files.borrow()[file as usize].display())
    }

    /// Says `message` once for the whole scene, at the first place that gives reason to.
    pub(super) fn warn(&self, place: Place, message: impl Into<String>) {
        let message = message.into();
        if self.said.borrow_mut().insert(message.clone()) {
            self.warnings.borrow_mut().push(Warning { place: self.words(place), message });
        }
    }

    /// Says `message` about the whole scene, once.
    pub(super) fn warn_all(&self, message: impl Into<String>) {
        let message = message.into();
        if self.said.borrow_mut().insert(message.clone()) {
            self.warnings.borrow_mut().push(Warning { place: String::new(), message });
        }
    }

    /// The warnings, in the order in which they were found.
    pub(super) fn into_warnings(self) -> Vec<Warning> {
        self.warnings.into_inner()
    }

    /// An error of a file that the scene names at `place`.
    pub(super) fn blame(&self, place: Place, error: SceneError) -> Fault {
        error.or_at(&format!("named by {}", self.full_words(place))).into()
    }

    /// The public form of `fault`.
    pub(super) fn error(&self, fault: Fault) -> SceneError {
        match *fault.0 {
            Reason::Other(error) => error,
            Reason::At(kind, Place { file, line, column }, message) => {
                let files = self.files.borrow();
                SceneError::new(kind, &files[file as usize], format!("{line}:{column}"), message)
            }
        }
    }
}

/// The one of `known` that `name` may have been meant to be.
fn nearest<'a>(name: &str, known: &[&'a str]) -> Option<&'a str> {
    let lower = name.to_lowercase();
    let distance = |candidate: &str| strsim::osa_distance(&lower, &candidate.to_lowercase());
    let best = known.iter().map(|candidate| (distance(candidate), *candidate)).min()?;
    // A third of the letters may be wrong: more, and it is another word.
    (best.0 <= (name.chars().count() / 3).max(1)).then_some(best.1)
}

/// "unknown `what` `name`", with the nearest of `known`, or all of them where there are few.
/// Things of pbrt-v3 are called so.
pub(super) fn unknown(what: &str, name: &str, known: &[&str]) -> String {
    if let Some(successor) = predecessor::successor(what, name) {
        let what = what.trim_end_matches(':');
        return format!("unknown {what} \"{name}\": it belongs to pbrt-v3, in pbrt-v4 it is {successor}");
    }
    match nearest(name, known) {
        Some(candidate) => format!("unknown {what} \"{name}\", did you mean \"{candidate}\"?"),
        None if known.is_empty() => format!("unknown {what} \"{name}\", expected none"),
        None if known.len() <= 24 => {
            format!("unknown {what} \"{name}\", expected one of {}", known.join(", "))
        }
        None => format!("unknown {what} \"{name}\""),
    }
}
