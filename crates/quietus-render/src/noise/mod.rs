//! How far the finished picture is from the truth: the library's measurement, with the tracer's samples.
//!
//! What is measured, and why that is right, is said in [`quietus::noise`]. Here picks are drawn again by the tracer, and
//! alpha, albedo and normals are measured with them.

mod aovs;
mod falling;
mod measure;

pub use aovs::{Aov, AovValues, OfAovs};
pub(crate) use falling::{Falling, Foretold};
pub use measure::measure_noise;
pub(crate) use measure::{Copied, MAX_MAGNITUDE, Measured, Measuring};
pub use quietus::noise::{Effort, Finished, FreshMean, Noise, Pick, displayed, estimate, pick};
pub(crate) use quietus::noise::{
    LEAST_PICKS, edges, estimate_squares, pick_by, pooled_differences, pooled_noises, uniform,
};
