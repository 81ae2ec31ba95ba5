//! Where the error of a picture matters more, and where less.

use std::fmt;

use quietus::{PixelError, TILE_PIXELS};
use quietus_film::{TILE, Window};

/// What the error of each pixel of a frame is multiplied by: 0 where it does not matter, 1 where it counts as without weights,
/// more where it matters more. Samples are dealt by errors so weighted, and the noise of the picture is theirs.
pub struct Weights {
    frame: [u32; 2],
    /// Row by row.
    values: Vec<f32>,
}

/// Weights that make no sense.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum WeightsError {
    /// Not one for each pixel.
    #[error("expected one weight for each pixel of {}x{}, not {weights}", .frame[0], .frame[1])]
    Size {
        /// Width and height of the frame.
        frame: [u32; 2],
        /// How many there are.
        weights: usize,
    },
    /// One that is negative or not finite.
    #[error("expected weights from 0 to {LARGEST}, not {value} at ({x}, {y})")]
    Value {
        /// Column.
        x: u32,
        /// Row.
        y: u32,
        /// The weight.
        value: f32,
    },
    /// Nothing matters.
    #[error("every weight is 0: expected a pixel that matters")]
    Nothing,
}

/// Larger weights are refused: errors are kept in fixed point.
const LARGEST: f32 = 1000.0;

impl Weights {
    /// Weights of a frame, row by row.
    ///
    /// # Errors
    /// Where there is not one for each pixel, one is negative, not finite or above 1000, or all are 0.
    pub fn new(frame: [u32; 2], values: Vec<f32>) -> Result<Self, WeightsError> {
        if values.len() as u64 != u64::from(frame[0]) * u64::from(frame[1]) {
            return Err(WeightsError::Size { frame, weights: values.len() });
        }
        // Written so that NaN fails too.
        if let Some(place) = values.iter().position(|value| !(0.0..=LARGEST).contains(value)) {
            let (x, y) = (place as u32 % frame[0], place as u32 / frame[0]);
            return Err(WeightsError::Value { x, y, value: values[place] });
        }
        if values.iter().all(|&value| value == 0.0) {
            return Err(WeightsError::Nothing);
        }
        Ok(Self { frame, values })
    }

    /// Width and height of the frame.
    pub fn frame(&self) -> [u32; 2] {
        self.frame
    }

    /// The weight of a pixel of the frame.
    ///
    /// # Panics
    /// Outside of the frame.
    pub fn at(&self, x: u32, y: u32) -> f32 {
        assert!(x < self.frame[0], "a column of the frame");
        self.values[y as usize * self.frame[0] as usize + x as usize]
    }

    /// Those of a window, row by row.
    pub(crate) fn of_window(&self, window: Window) -> Vec<f32> {
        let row = |y: u32| (window.x0..window.x1).map(move |x| self.at(x, y));
        (window.y0..window.y1).flat_map(row).collect()
    }

    /// Weighs the squared errors of a tile whose first pixel is (`x`, `y`) of the frame.
    pub(crate) fn weigh(&self, [x, y]: [u32; 2], errors: &mut [PixelError; TILE_PIXELS]) {
        for (place, error) in errors.iter_mut().enumerate() {
            let (x, y) = (x + place as u32 % TILE, y + place as u32 / TILE);
            let weight = if x < self.frame[0] && y < self.frame[1] { self.at(x, y) } else { 1.0 };
            if let Some(square) = error.to_f32().filter(|_| weight != 1.0) {
                *error = PixelError::from_f32(square * weight * weight);
            }
        }
    }
}

impl fmt::Debug for Weights {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Weights").field("frame", &self.frame).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_that_make_no_sense_are_refused() {
        let error = |values: Vec<f32>| Weights::new([2, 2], values).unwrap_err().to_string();
        assert_eq!(error(vec![1.0; 3]), "expected one weight for each pixel of 2x2, not 3");
        assert_eq!(error(vec![0.0; 4]), "every weight is 0: expected a pixel that matters");
        for bad in [-1.0, f32::NAN, f32::INFINITY, 1001.0] {
            let expected = format!("expected weights from 0 to 1000, not {bad} at (1, 1)");
            assert_eq!(error(vec![1.0, 0.0, 2.0, bad]), expected);
        }
    }

    #[test]
    fn squared_errors_are_multiplied_by_squares() {
        let weights = Weights::new([10, 3], (0..30).map(|i| i as f32 % 10.0).collect()).unwrap();
        assert_eq!(weights.of_window(Window { x0: 3, y0: 1, x1: 5, y1: 3 }), [3.0, 4.0, 3.0, 4.0]);
        let mut errors = [PixelError::from_f32(0.5); TILE_PIXELS];
        errors[9] = PixelError::REJECTED;
        weights.weigh([0, 0], &mut errors);
        assert_eq!([0, 1, 2, 3].map(|x| errors[x].to_f32().unwrap()), [0.0, 0.5, 2.0, 4.5]);
        assert_eq!(errors[9], PixelError::REJECTED);
        // Below the frame.
        assert_eq!(errors[26], PixelError::from_f32(0.5));
    }
}
