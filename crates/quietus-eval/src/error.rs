//! What can go wrong while measuring.

use std::path::{Path, PathBuf};

use quietus::SettingsError;
use quietus_scene::SceneError;
use quietus_trace::{scene::SceneBuildError, view::ViewError};

/// Why something could not be measured.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EvalError {
    /// The operating system refused.
    #[error("{}: {source}", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file that is not what it should be.
    #[error("{}: {message}", .path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// What was found and what was expected.
        message: String,
    },
    /// A scene file that cannot be read.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A scene that cannot be drawn.
    #[error("{scene}: {source}")]
    Build {
        /// The scene.
        scene: String,
        /// What is wrong with it.
        source: SceneBuildError,
    },
    /// A camera that cannot be used.
    #[error("{scene}: {source}")]
    Camera {
        /// The scene.
        scene: String,
        /// What is wrong with it.
        source: ViewError,
    },
    /// Settings that the library refuses.
    #[error("sampling settings: {0}")]
    Settings(#[from] SettingsError),
    /// A request that does not fit together.
    #[error("{0}")]
    Request(String),
    /// A picture without light.
    #[error("{scene}: the picture is black: there is nothing to measure")]
    Dark {
        /// The scene.
        scene: String,
    },
    /// The tracer broke its promise.
    #[error(
        "{scene}: sample {index} of replicate {replicate} of pixel ({x}, {y}) with seed {seed} is negative: {value:?}"
    )]
    NegativeSample {
        /// The scene.
        scene: String,
        /// Seed of the view.
        seed: u64,
        /// Column.
        x: u32,
        /// Row.
        y: u32,
        /// Replicate.
        replicate: u8,
        /// Sample index.
        index: u32,
        /// Its radiance.
        value: [f32; 3],
    },
}

impl EvalError {
    pub(crate) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { path, source }
    }

    pub(crate) fn format(path: &Path, message: impl Into<String>) -> Self {
        Self::Format { path: path.to_owned(), message: message.into() }
    }
}
