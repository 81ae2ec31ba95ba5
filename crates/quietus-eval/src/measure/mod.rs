//! Measures: how far a picture is from its reference.

mod energy;
mod errors;
mod flip;
mod stops;
mod structure;

pub use energy::{Energy, EnergyMeter};
pub(crate) use energy::{luminance, relative};
pub use errors::{Errors, Measure, errors};
pub use flip::{PIXELS_PER_DEGREE, flip, flip_map};
pub use stops::{Stops, stops};
pub use structure::{Structure, structure};

#[cfg(test)]
pub(crate) use errors::tests;

/// A value as it is displayed, with a gamma of 2 for the sake of simple formulas: `sqrt(clamp(x, 0, 1))`.
pub(crate) fn display(value: f32) -> f64 {
    f64::from(value).clamp(0.0, 1.0).sqrt()
}
