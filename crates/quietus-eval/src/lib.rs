//! Honest measurement of sampling policies.
//!
//! Samples of a small picture are recorded once into a [`bank`]; any policy is then replayed on them in seconds, so
//! that policies are compared on identical samples.
//! The library under test runs as it is: only the tracing is replaced by looking samples up.

pub mod bank;
mod error;
mod files;
mod packed;
mod picture;
pub mod replay;
mod runs;
mod subject;

pub use bank::{Bank, BankSpec};
pub use error::EvalError;
pub use files::cache_directory;
pub use picture::Picture;
pub use replay::{Replay, replay};
pub use subject::{Look, Subject};
