//! Honest measurement of sampling policies.
//!
//! Samples of a small picture are recorded once into a [`bank`]; any policy is then replayed on them in
//! seconds, so that policies are compared on identical samples. The library under test runs as it is: only
//! the tracing is replaced by looking samples up. What comes out is [`measure`]d against an independent
//! [`Reference`].
//!
//! ```
//! use quietus_eval::{BankSpec, Look, Method, Subject, bank::record_in_memory, replay};
//!
//! let subject = Subject::embedded()?;
//! let look = Look::new(16, 16);
//! let spec = BankSpec { scene: subject.name.clone(), look, streams: 4, samples: 32, seed: 0 };
//! let bank = record_in_memory(&subject, &spec)?;
//! let settings = quietus::Settings { max_samples: 64, target_error: 0.02, ..quietus::Settings::new(16, 16) };
//! let run = replay(&bank, &Method::Quietus.apply(&settings), 0)?;
//! assert!((16.0..=64.0).contains(&run.samples_per_pixel()));
//! # Ok::<(), quietus_eval::EvalError>(())
//! ```

pub mod bank;
pub mod compare;
pub mod discovery;
pub mod equivalence;
mod error;
mod files;
pub mod goals;
pub mod limit;
pub mod live;
pub mod measure;
mod method;
mod noise_check;
mod packed;
mod picture;
pub mod reference;
pub mod replay;
pub mod report;
mod runs;
pub mod statistics;
mod study;
mod subject;
pub mod sweep;

pub use bank::{Bank, BankSpec};
pub use error::EvalError;
pub use files::cache_directory;
pub use method::Method;
pub use picture::Picture;
pub use reference::{Reference, ReferenceSpec};
pub use replay::{Replay, replay};
pub use study::{Study, StudySpec};
pub use subject::{FILTERS, Look, Subject};
