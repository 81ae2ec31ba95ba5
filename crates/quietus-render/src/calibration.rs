//! How far halves of the film misjudge the error, learnt from measurements.

use serde::{Deserialize, Serialize};

use crate::noise::Noise;

/// Variance of the drift of the ratio from one round to the next.
const DRIFT: f64 = 0.02;

/// How far halves of the film misjudge the squared error: too small where sampling stopped because they agreed.
///
/// Every measurement says so with a known precision; what is believed is the mean of all, newer ones counting more, since
/// the ratio may drift from round to round (a Kalman filter for one number, in logarithms).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Calibration {
    /// Logarithm of the true mean square over that by halves.
    pub(crate) ratio: f64,
    /// Its variance.
    pub(crate) variance: f64,
}

impl Default for Calibration {
    fn default() -> Self {
        Self { ratio: 0.0, variance: 0.25 }
    }
}

impl Calibration {
    /// Takes in a measurement of a picture whose halves differ by `square`.
    pub(crate) fn take(&mut self, noise: Noise, square: f64) {
        self.variance += DRIFT;
        if noise.reached > 0.0 && square > 0.0 {
            let ratio = (noise.reached.powi(2) / square).ln();
            let variance = (2.0 * noise.log_deviation()).powi(2);
            let gain = self.variance / (self.variance + variance);
            self.ratio += gain * (ratio - self.ratio);
            self.variance *= 1.0 - gain;
        }
    }

    /// The true mean square where halves differ by `square`.
    pub(crate) fn square(&self, square: f64) -> f64 {
        square * self.ratio.exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(reached: f64, width: f64) -> Noise {
        Noise { reached, low: reached / width, high: reached * width }
    }

    #[test]
    fn measurements_are_believed_as_far_as_they_are_precise() {
        let mut calibration = Calibration::default();
        // Halves say 1 %, a precise measurement says 2 %: four times the square.
        calibration.take(noise(0.02, 1.02), 1e-4);
        assert!((calibration.square(1e-4) / 4e-4 - 1.0).abs() < 0.05);
        // A rough one that contradicts it moves it a little.
        let before = calibration.square(1e-4);
        calibration.take(noise(0.01, 2.0), 1e-4);
        let after = calibration.square(1e-4);
        assert!(after < before && after > 0.7 * before, "{before} {after}");
        // One of nothing says nothing.
        calibration.take(noise(0.0, 1.0), 1e-4);
        assert_eq!(calibration.square(1e-4), after);
    }
}
