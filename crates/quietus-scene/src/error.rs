//! What can go wrong while reading a scene, and what is merely worth saying.

use std::collections::HashSet;
use std::fmt;
use std::path::{Path, PathBuf};

/// What kind of trouble a [`SceneError`] is; programs choose their exit code by it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ErrorKind {
    /// A file that is not there.
    NotFound,
    /// A file that is there and cannot be read.
    Unreadable,
    /// Bytes that do not follow the file format's grammar, or end too early.
    Syntax,
    /// A well-formed file that contradicts itself or its specification.
    Invalid,
    /// A valid file that asks for something this reader does not do, or for more than its stated limits.
    Unsupported,
}

/// Why a scene could not be read: the file, the place in it, and what was found where something else was
/// expected.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct SceneError {
    kind: ErrorKind,
    file: PathBuf,
    place: String,
    message: String,
}

impl SceneError {
    pub(crate) fn new(
        kind: ErrorKind,
        file: &Path,
        place: impl Into<String>,
        message: impl Into<String>,
    ) -> Self {
        Self { kind, file: file.to_path_buf(), place: place.into(), message: message.into() }
    }

    /// An error of the operating system while opening or reading `file`.
    pub(crate) fn io(file: &Path, error: &std::io::Error) -> Self {
        let kind = match error.kind() {
            std::io::ErrorKind::NotFound => ErrorKind::NotFound,
            _ => ErrorKind::Unreadable,
        };
        let message = match kind {
            ErrorKind::NotFound => "no such file".to_owned(),
            _ => format!("cannot be read: {error}"),
        };
        Self::new(kind, file, "", message)
    }

    /// The same error, said to be in `place` where it has none of its own.
    pub(crate) fn or_at(mut self, place: &str) -> Self {
        if self.place.is_empty() {
            place.clone_into(&mut self.place);
        }
        self
    }

    /// What kind of trouble it is.
    pub fn kind(&self) -> ErrorKind {
        self.kind
    }

    /// The file that is to blame: the scene, or a buffer or picture it refers to.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Where in the file: a JSON path such as `meshes[0].primitives[1].attributes.POSITION`, a line and column such as
    /// `12:5`, or a byte offset; empty where the whole file is meant.
    pub fn place(&self) -> &str {
        &self.place
    }

    /// What was found and what was expected, without file and place.
    pub fn message(&self) -> &str {
        &self.message
    }
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Lines and columns follow the name at once, so that editors find the place.
        let gap = if self.place.starts_with(|c: char| c.is_ascii_digit()) { "" } else { " " };
        write!(f, "{}:{gap}", self.file.display())?;
        if !self.place.is_empty() {
            write!(f, "{}: ", self.place)?;
        }
        f.write_str(&self.message)
    }
}

/// Something a reader left out, replaced or added, which the picture may show.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Warning {
    /// Where in the scene file, as in [`SceneError::place`]; empty where the whole file is meant.
    pub place: String,
    /// What was done and why.
    pub message: String,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.place.is_empty() {
            write!(f, "{}: ", self.place)?;
        }
        f.write_str(&self.message)
    }
}

/// Warnings in the order in which they were first said, each once.
#[derive(Clone, Debug, Default)]
pub(crate) struct Warnings {
    list: Vec<Warning>,
    said: HashSet<Warning>,
}

impl Warnings {
    /// Says `message` about `place`.
    pub(crate) fn say(&mut self, place: &str, message: impl Into<String>) {
        let warning = Warning { place: place.to_owned(), message: message.into() };
        if self.said.insert(warning.clone()) {
            self.list.push(warning);
        }
    }

    /// All of them.
    pub(crate) fn into_list(self) -> Vec<Warning> {
        self.list
    }
}
