//! Threads, tile loop, progress and cancellation: what joins sampling, tracing and film.
//!
//! The library `quietus` decides which pixels of which tile get more samples, the tracer draws them, the film keeps
//! them; [`render`] owns the threads that carry one to the other. Nothing here decides anything about pixels or
//! light.

mod fault;
mod live;
pub mod noise;
mod pixel_errors;
mod process;
mod progress;
mod run;
mod settings;
mod statistics;
mod tracer;

pub use fault::Fault;
pub use live::Live;
pub use pixel_errors::{pixel_error, shown_error};
pub use process::available_memory;
pub use progress::Progress;
pub use run::{Control, RenderError, Rendered, StoppedBy, Watched, render};
pub use settings::{Machinery, RenderSettings, Sampling};
pub use statistics::{LoggedRebuild, MOST_LOGGED, SampleStatistics, Statistics};
pub use tracer::{PathTracer, Tracer};
