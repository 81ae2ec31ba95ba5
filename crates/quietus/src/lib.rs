//! A dynamically-updating hierarchical stopping condition for Monte Carlo renderers, after Jeffery 2019 ("the
//! talk"): adaptive sampling that stops where the picture is done, and goes back where new light is found.
//!
//! The library decides which pixels go on. Threads, rays, colours and the film stay the renderer's: each of its
//! threads asks for tile visits, draws the samples a visit names, and hands back the errors of its 64 pixels.
//!
//! # A tour
//!
//! Say what is to be sampled. Everything has a default but the size:
//!
//! ```
//! use quietus::{AdaptiveSampling, Settings};
//!
//! let settings = Settings { target_error: 0.01, max_samples: 256, ..Settings::new(64, 48) };
//! let sampling = AdaptiveSampling::new(settings)?;
//! # Ok::<(), quietus::SettingsError>(())
//! ```
//!
//! The renderer's own threads share it by reference. Sample values should be a function of pixel, replicate and
//! sample index alone: then the picture, too, is the same bits for any number of threads.
//!
//! ```
//! # use quietus::{AdaptiveSampling, Settings};
//! use quietus::{PixelError, TILE_PIXELS};
//! # let settings = Settings { target_error: 0.01, max_samples: 256, ..Settings::new(64, 48) };
//! # let sampling = AdaptiveSampling::new(settings)?;
//! # struct Film;
//! # impl Film {
//! #     fn add(&self, _pixel: u8, _replicate: u8, _value: f32) {}
//! #     fn error(&self, pixel: usize) -> PixelError { PixelError::from_f32(1e-3 * pixel as f32) }
//! # }
//! # fn trace(x: u32, y: u32, replicate: u8, index: u32) -> f32 { (x + y + u32::from(replicate) + index) as f32 }
//! # fn film(_tile: u32) -> Film { Film }
//! std::thread::scope(|scope| {
//!     for _ in 0..2 {
//!         scope.spawn(|| {
//!             let mut worker = sampling.worker();
//!             // Sleeps while nothing is eligible; `None` when the picture is finished or stopped.
//!             while let Some(visit) = worker.next_visit() {
//!                 // Until `finish`, nobody else has this tile.
//!                 let film = film(visit.tile());
//!                 for work in visit.pixels() {
//!                     for index in work.samples {
//!                         film.add(work.pixel, work.replicate, trace(work.x, work.y, work.replicate, index));
//!                     }
//!                 }
//!                 let errors: [PixelError; TILE_PIXELS] = std::array::from_fn(|pixel| film.error(pixel));
//!                 visit.finish(&errors);
//!             }
//!         });
//!     }
//! });
//! assert!(sampling.is_finished());
//! assert_eq!(sampling.converged_fraction(), 1.0);
//! # Ok::<(), quietus::SettingsError>(())
//! ```
//!
//! A pixel's error compares its replicates: estimates from independent samples. [`DammertzMetric`] is the
//! published metric; [`ErrorMetric`] is the place for another one, or for other channels:
//!
//! ```
//! use quietus::{DammertzMetric, ErrorMetric, ReplicateMean};
//!
//! let halves = [[0.5, 0.4, 0.3], [0.5, 0.4, 0.5]];
//! let replicates = halves.each_ref().map(|rgb| ReplicateMean { count: 8, channels: rgb });
//! let error = DammertzMetric.pixel_error(&replicates);
//! // |I - A| is 0.1 in blue, and the mean has I_r + I_g + I_b = 1.3.
//! assert!((error.to_f32().unwrap() - 0.1 / 1.3f32.sqrt()).abs() < 1e-5);
//! ```
//!
//! While it runs, any thread may [`stop`](AdaptiveSampling::stop) it, or look at its
//! [`converged_fraction`](AdaptiveSampling::converged_fraction); [`counts`](AdaptiveSampling::counts) are the
//! exact samples per pixel, [`statistics`](AdaptiveSampling::statistics) what everything cost, and
//! [`tree_svg`](AdaptiveSampling::tree_svg) draws the trees.
//!
//! # What else there is
//!
//! - [`Policy`] has the talk's tree and the baselines it is measured against; [`Mode`], [`Checks`] and [`Rebuild`]
//!   select the talk's own way of threading, checking and rebuilding in place of the default ones.
//! - `examples/toy_renderer.rs` is a whole renderer in a page.
//! - `PROTOCOL.md` has the threads' protocol, its invariants and their proofs.
//!
//! Where the picture must not depend on threads ([`Mode::Deterministic`], the default) it depends on nothing but
//! settings and sample values. No `unsafe`, no dependencies.
#![forbid(unsafe_code)]

pub mod active_mask;
mod coordinator;
pub mod error_metric;
mod error_plane;
mod gate;
pub mod inspect;
pub mod morton;
mod parking;
mod pass_schedule;
mod pixel_rect;
pub mod policy;
pub mod protocol;
pub mod published_masks;
mod quadrants;
mod region_error;
pub mod region_tree;
mod sample_counts;
mod spread;
pub mod striped_locks;
pub mod summed_area;
mod sync;
mod tile;
pub mod visit_counter;

pub use coordinator::{
    AdaptiveSampling, Checks, MAX_FRAME_PIXELS, Paused, PixelWork, RebuildRecord, RegionState, SamplingState,
    Settings, SettingsError, Start, StateError, Statistics, Visit, Worker,
};
pub use error_metric::{DammertzMetric, ErrorMetric, PixelError, ReplicateMean, SampleNoise};
pub use error_plane::ErrorPlane;
pub use pass_schedule::{Approach, PassCounts, PassSchedule, replicate_share};
pub use pixel_rect::{Area, Axis, PixelRect};
pub use policy::{Policy, Rebuild, RuleMemory};
pub use protocol::{Misfit, Mode, Outcome, Standing};
pub use quadrants::Regions;
pub use region_error::region_error;
pub use region_tree::RegionTree;
pub use sample_counts::SampleCounts;
pub use tile::{TILE_PIXELS, TILE_SIZE, TileGrid};
