//! Errors of pixels and their means, with the reference's own variance subtracted.

use serde::{Deserialize, Serialize};

use super::display;
use crate::{Picture, Reference};

/// A mean squared error over pixels and channels, by what the squares are weighted with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// `(x - r)^2`.
    Mse,
    /// `(x - r)^2 / (r^2 + 0.01)`.
    RelMse,
    /// `(x - r)^2 / (r + 0.01)`: in display space, times 4, but for clipping.
    Weighted,
    /// `(sqrt(clamp x) - sqrt(clamp r))^2`: squared error in display space, white = 1.
    Display,
}

impl Measure {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Mse, Self::RelMse, Self::Weighted, Self::Display];

    /// Its name in tables and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mse => "mse",
            Self::RelMse => "rel_mse",
            Self::Weighted => "weighted",
            Self::Display => "display",
        }
    }

    /// What the squared error of a channel of reference value `r` counts, to first order.
    pub fn weight(self, r: f32) -> f64 {
        let r = f64::from(r);
        match self {
            Self::Mse => 1.0,
            Self::RelMse => 1.0 / (r * r + 0.01),
            Self::Weighted => 1.0 / (r.max(0.0) + 0.01),
            // The square of d sqrt(r) / dr. Below a thousandth of white the curve is too steep for first
            // order.
            Self::Display => {
                if r < 1.0 {
                    0.25 / r.max(1e-3)
                } else {
                    0.0
                }
            }
        }
    }

    /// The squared error of a channel, with the reference's variance subtracted.
    fn squared_error(self, x: f32, r: f32, variance: f32) -> f64 {
        let plain = match self {
            Self::Display => (display(x) - display(r)).powi(2),
            _ => self.weight(r) * (f64::from(x) - f64::from(r)).powi(2),
        };
        plain - self.weight(r) * f64::from(variance)
    }
}

/// What is wrong with one picture. Squares of differences to the reference, less its variance, can come out
/// negative by chance: roots are for means over runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// Means of [`Measure::ALL`], in that order.
    pub means: [f64; 4],
    /// Mean display error squared of the worst 8x8 tile.
    pub worst_tile: f64,
    /// 99.9th percentile over pixels of the display error (the root of the mean square over channels).
    pub p999: f64,
}

impl Errors {
    /// The mean of a measure.
    pub fn mean(&self, measure: Measure) -> f64 {
        self.means[measure as usize]
    }
}

/// Compares a picture with its reference.
///
/// # Panics
/// Where the two differ in size.
pub fn errors(picture: &Picture, reference: &Reference) -> Errors {
    let size = [reference.mean.width, reference.mean.height];
    assert_eq!([picture.width, picture.height], size, "picture and reference differ in size");
    let channels = 3.0 * picture.rgb.len() as f64;
    let means = Measure::ALL.map(|measure| {
        (0..picture.rgb.len()).map(|i| pixel_error(measure, picture, reference, i)).sum::<f64>() / channels
    });
    let mut display: Vec<f64> =
        (0..picture.rgb.len()).map(|i| pixel_error(Measure::Display, picture, reference, i) / 3.0).collect();
    let worst_tile = tile_means(&display, picture.width).into_iter().fold(f64::MIN, f64::max);
    display.sort_unstable_by(f64::total_cmp);
    let p999 = display[((display.len() - 1) as f64 * 0.999).round() as usize].max(0.0).sqrt();
    Errors { means, worst_tile, p999 }
}

/// Sum over the channels of a pixel.
fn pixel_error(measure: Measure, picture: &Picture, reference: &Reference, i: usize) -> f64 {
    let (x, r, v) = (picture.rgb[i], reference.mean.rgb[i], reference.variance[i]);
    (0..3).map(|c| measure.squared_error(x[c], r[c], v[c])).sum()
}

/// Means over 8x8 tiles, cut at the right and lower edges; row by row.
pub(crate) fn tile_means(values: &[f64], width: u32) -> Vec<f64> {
    let width = width as usize;
    let columns = width.div_ceil(8);
    let rows = (values.len() / width).div_ceil(8);
    let mut sums = vec![(0.0, 0.0); columns * rows];
    for (i, value) in values.iter().enumerate() {
        let tile = &mut sums[(i / width / 8) * columns + (i % width) / 8];
        *tile = (tile.0 + value, tile.1 + 1.0);
    }
    sums.into_iter().map(|(sum, count)| sum / count).collect()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::{Look, reference::ReferenceSpec};

    /// A reference whose pixels are `value`, with the given variance of their mean.
    pub(crate) fn flat(width: u32, height: u32, value: f32, variance: f32) -> Reference {
        let look = Look::new(width, height);
        let mut mean = Picture::black(width, height);
        mean.rgb.fill([value; 3]);
        let pixels = mean.rgb.len();
        Reference {
            spec: ReferenceSpec { scene: "flat".into(), look, streams: 2, samples: 1, seed: 0 },
            fingerprint: 0,
            mean,
            variance: vec![[variance; 3]; pixels],
            sample_variance: vec![[1.0; 3]; pixels],
        }
    }

    #[test]
    fn known_differences_give_known_errors() {
        let reference = flat(16, 8, 0.25, 0.0);
        let mut picture = reference.mean.clone();
        picture.rgb[3] = [0.36; 3]; // display: 0.6 against 0.5
        picture.rgb[4] = [4.0; 3]; // display: clipped to 1
        let found = errors(&picture, &reference);
        let squares = [0.11_f64.powi(2), 3.75_f64.powi(2)];
        let mse = (squares[0] + squares[1]) / 128.0;
        let close = |a: f64, b: f64| assert!((a - b).abs() <= 1e-6 * b, "{a} {b}");
        close(found.mean(Measure::Mse), mse);
        close(found.mean(Measure::RelMse), mse / (0.0625 + 0.01));
        close(found.mean(Measure::Weighted), mse / 0.26);
        close(found.mean(Measure::Display), (0.01 + 0.25) / 128.0);
        close(found.worst_tile, (0.01 + 0.25) / 64.0);
        close(found.p999, 0.5);
    }

    #[test]
    fn the_variance_of_the_reference_is_subtracted() {
        let reference = flat(8, 8, 0.25, 1e-4);
        let found = errors(&reference.mean, &reference);
        assert!((found.mean(Measure::Mse) + 1e-4).abs() < 1e-10);
        assert!((found.mean(Measure::Display) + 1e-4).abs() < 1e-10, "0.25 / r = 1");
    }

    #[test]
    fn tiles_are_cut_at_the_edges() {
        let values: Vec<f64> = (0..9 * 2).map(|i| if i % 9 == 8 { 4.0 } else { 1.0 }).collect();
        assert_eq!(tile_means(&values, 9), [1.0, 4.0]);
    }
}
