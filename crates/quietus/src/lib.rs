//! A dynamically-updating hierarchical stopping condition for Monte Carlo renderers, after Jeffery 2019 ("the
//! talk"): adaptive sampling that stops where the picture is done, and goes back where new light is found.
//!
//! The library decides which pixels go on. Threads, rays, colours and the film stay the renderer's: each of its
//! threads asks for tile visits, draws the samples a visit names, and hands back the errors of its 64 pixels.
//! Renderers that draw whole passes, as those on a GPU do, use [`WholePasses`] in place of visits.
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
//! The renderer's own threads share it by reference. Each pixel has two *replicates*, estimates from samples that the
//! other does not use: the film keeps a sum and a count for each. Sample values should be a function of pixel,
//! replicate and sample index alone, so seed random numbers with these: then the picture, too, has the same bits for any
//! number of threads.
//!
//! ```
//! # use quietus::{AdaptiveSampling, Settings};
//! use quietus::{PixelError, ReplicateMean, TILE_PIXELS};
//! # let settings = Settings { target_error: 0.01, max_samples: 256, ..Settings::new(64, 48) };
//! # let sampling = AdaptiveSampling::new(settings)?;
//! # struct Film;
//! # impl Film {
//! #     fn add(&self, _pixel: u8, _replicate: u8, _rgb: [f32; 3]) {}
//! #     fn mean(&self, pixel: usize, replicate: usize) -> [f32; 3] { [0.5 + 1e-3 * (pixel * replicate) as f32; 3] }
//! #     fn count(&self, _pixel: usize, _replicate: usize) -> u32 { 8 }
//! # }
//! # fn trace(x: u32, y: u32, replicate: u8, index: u32) -> [f32; 3] { [(x + y + u32::from(replicate) + index) as f32; 3] }
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
//!                 let errors: [PixelError; TILE_PIXELS] = std::array::from_fn(|pixel| {
//!                     let means = [film.mean(pixel, 0), film.mean(pixel, 1)];
//!                     let replicate = |r: usize| ReplicateMean { count: film.count(pixel, r), channels: &means[r] };
//!                     sampling.pixel_error(&[replicate(0), replicate(1)])
//!                 });
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
//! While it runs, any thread may [`stop`](AdaptiveSampling::stop) it, or look at its
//! [`converged_fraction`](AdaptiveSampling::converged_fraction); [`counts`](AdaptiveSampling::counts) are the
//! exact samples per pixel, [`statistics`](AdaptiveSampling::statistics) what everything cost, and
//! [`tree_svg`](AdaptiveSampling::tree_svg) draws the trees. A picture that turns out too noisy
//! [goes on](AdaptiveSampling::resumed) with a smaller target; one that must outlive the process keeps a
//! [`SamplingState`].
//!
//! # Errors
//!
//! A pixel's error compares its replicates. [`AdaptiveSampling::pixel_error`] does so in the metric that the policy is
//! made for, from linear red, green and blue. Two metrics are there, and they are not interchangeable:
//!
//! - [`SampleNoise`], the variance of *one sample* as it is displayed, for the default [`Policy::Quietus`];
//! - [`DammertzMetric`], the published error of the pixel's *mean*, for all others.
//!
//! [`ErrorMetric`] is the place for a metric of one's own, or for other channels, and says what it must mean.
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
//! A film that holds the sum of all samples and that of one half has the other half by subtraction:
//!
//! ```
//! # use quietus::ReplicateMean;
//! # let (sum, count, half_sum, half_count) = ([3.2f32, 1.6, 0.8], 16, [1.5f32, 0.7, 0.4], 8);
//! let other = std::array::from_fn::<f32, 3, _>(|c| (sum[c] - half_sum[c]) / (count - half_count) as f32);
//! let half = half_sum.map(|s| s / half_count as f32);
//! let replicates = [
//!     ReplicateMean { count: half_count, channels: &half },
//!     ReplicateMean { count: count - half_count, channels: &other },
//! ];
//! ```
//!
//! # What else there is
//!
//! - [`noise`] measures how far a finished picture is from the truth, in per cent of white with an interval, from a few pixels
//!   that are drawn again.
//! - [`Policy`] has the talk's tree and the baselines it is measured against; [`Mode`], [`Checks`] and [`Rebuild`]
//!   select the talk's own way of threading, checking and rebuilding in place of the default ones.
//! - `examples/toy_renderer.rs` is a whole renderer in a page; `examples/whole_passes.rs` one that draws pass by pass.
//! - `PROTOCOL.md` has the threads' protocol, its invariants and their proofs.
//! - The feature `serde` makes [`SamplingState`] and the statistics serializable.
//!
//! Where the picture must not depend on threads ([`Mode::Deterministic`], the default) it depends on nothing but
//! settings and sample values. No `unsafe`, no dependencies.
#![forbid(unsafe_code)]

// Modules that are public but hidden hold the parts, each under the talk's name for it, for the model checkers, the
// benches and the tools that measure. They are no part of the interface: what a renderer needs is named below.
#[doc(hidden)]
pub mod active_mask;
mod coordinator;
#[doc(hidden)]
pub mod error_metric;
mod error_plane;
mod gate;
#[doc(hidden)]
pub mod inspect;
#[doc(hidden)]
pub mod morton;
pub mod noise;
mod parking;
mod pass_schedule;
mod pixel_rect;
#[doc(hidden)]
pub mod policy;
#[doc(hidden)]
pub mod protocol;
#[doc(hidden)]
pub mod published_masks;
mod quadrants;
mod region_error;
#[doc(hidden)]
pub mod region_tree;
mod sample_counts;
mod spread;
#[doc(hidden)]
pub mod striped_locks;
#[doc(hidden)]
pub mod summed_area;
mod sync;
mod tile;
#[doc(hidden)]
pub mod visit_counter;

pub use coordinator::{
    AdaptiveSampling, Checks, MAX_FRAME_PIXELS, Paused, PixelWork, RebuildRecord, SamplingState, Settings,
    SettingsError, Start, StateError, Statistics, Visit, WholePass, WholePasses, Worker,
};
pub use error_metric::{
    DammertzMetric, ErrorMetric, PixelError, ReplicateMean, SampleNoise, mean_and_standard_error,
};
pub use pass_schedule::{Approach, PassSchedule, replicate_share};
pub use pixel_rect::{Area, PixelRect};
pub use policy::{Policy, Rebuild};
pub use protocol::{Misfit, Mode, Outcome};
pub use quadrants::Regions;
pub use region_tree::RegionTree;
pub use sample_counts::SampleCounts;
pub use tile::{TILE_PIXELS, TILE_SIZE, TileGrid};

#[doc(hidden)]
pub use {
    coordinator::RegionState, error_plane::ErrorPlane, pass_schedule::PassCounts, pixel_rect::Axis,
    policy::RuleMemory, protocol::Standing, region_error::region_error,
};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
