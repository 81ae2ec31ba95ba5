//! Threads, tile loop, progress and cancellation: what joins sampling, tracing and film.
//!
//! The library `quietus` decides which pixels of which tile get more samples, the tracer draws them, the film keeps
//! them; [`render`] owns the threads that carry one to the other. Nothing here decides anything about pixels or
//! light.

mod aov_demand;
mod calibration;
pub mod checkpoint;
mod clock;
mod costs;
mod creep;
mod crew;
mod dealt;
mod fault;
mod forecast;
mod live;
pub mod noise;
mod outlook;
mod pixel_errors;
mod process;
mod progress;
mod recording;
mod rounds;
mod run;
mod scout;
mod settings;
mod statistics;
mod steering;
mod timeline;
mod tracer;
mod weights;

pub use fault::Fault;
pub use live::Live;
pub use pixel_errors::{pixel_error, shown_error};
pub use process::available_memory;
pub use progress::{NoiseProgress, Progress};
pub use recording::{Recording, RecordingFile};
pub use rounds::{Keeping, go_on, render, render_keeping};
pub use run::{Bound, Control, RenderError, Rendered, StoppedBy, Watched};
pub use settings::{Goal, Machinery, RenderSettings, Sampling};
pub use statistics::{AovStatistics, LoggedRebuild, MOST_LOGGED, SampleStatistics, Statistics};
pub use timeline::TIMELINE;
pub use tracer::{PathTracer, Tracer};
pub use weights::{Weights, WeightsError};
