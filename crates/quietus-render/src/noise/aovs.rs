//! Noise of what goes with a picture: alpha, albedo and normals.
//!
//! It is measured as that of the picture, by the same fresh samples. No display comes between, so that
//! `(m - v) (m - w)` has exactly the squared error as its expectation. Values are taken as they are: 1 is 100 %.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::{Noise, Pick, estimate_squares};

/// Something besides radiance that is known of each pixel, and may be asked to be clean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Aov {
    /// The share of the pixel that surfaces cover.
    Alpha,
    /// Albedo, red, green and blue.
    Albedo,
    /// The shading normal in world space: means over samples, shorter than 1 where they differ.
    Normal,
}

/// Alpha, albedo and normal in a row.
pub type AovValues = [f32; 7];

/// The noise of each [`Aov`], or what was asked for, in the order of [`Aov::ALL`].
pub type OfAovs<T> = [Option<T>; 3];

impl Aov {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Alpha, Self::Albedo, Self::Normal];

    /// What it is called.
    pub fn name(self) -> &'static str {
        match self {
            Self::Alpha => "alpha",
            Self::Albedo => "albedo",
            Self::Normal => "normal",
        }
    }

    /// Where it is among all values.
    fn channels(self) -> Range<usize> {
        match self {
            Self::Alpha => 0..1,
            Self::Albedo => 1..4,
            Self::Normal => 4..7,
        }
    }

    /// Its root mean square error over all pixels and channels.
    pub(crate) fn noise(self, means: &[AovValues], picks: &[Pick], fresh: &[[AovValues; 2]]) -> Noise {
        let channels = self.channels();
        let squared = |(pick, [v, w]): (&Pick, &[AovValues; 2])| -> f64 {
            let m = means[pick.pixel];
            let products =
                channels.clone().map(|c| f64::from(m[c] - v[c]) * f64::from(m[c] - w[c])).sum::<f64>();
            pick.weight * products / channels.len() as f64
        };
        estimate_squares(&picks.iter().zip(fresh).map(squared).collect::<Vec<_>>())
    }
}
