//! Samples for alpha, albedo and normals: what their noise adds to the errors that samples are dealt by.
//!
//! The mean squared error of the picture may be `p^2`, that of an AOV `a^2`. Where one sample has the variances `v_p` and
//! `v_a`, the fewest samples that reach both are in proportion to the root of a sum of `v_p` and `v_a` with some factors
//! (Lagrange); here these are `1 / p^2` and `1 / a^2`, so that each counts by how far it may be from its goal. The sum is at
//! most twice what either may be, which bounds what better factors could save.

use quietus::{PixelError, TILE_PIXELS};
use quietus_film::{Aovs, Replicate};
use serde::{Deserialize, Serialize};

use crate::noise::OfAovs;
use crate::pixel_errors::REPLICATES;
use crate::settings::{Goal, RenderSettings, Sampling};

/// The error by which samples are dealt, over the mean square of a sample's error in display space: it is a sum over three
/// channels, and the root that displays take has a slope of `1 / (2 sqrt(mean))`.
const ERROR_OF_SQUARE: f64 = 12.0;

/// What was asked of alpha, albedo and normals.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct AovDemand {
    /// For each of them one over the square of the noise asked for, or 0.
    factors: [f64; 3],
    /// What errors of a sample are multiplied by to count as errors of the picture; 0 where samples are not dealt.
    scale: f64,
}

impl AovDemand {
    /// `None` where nothing was asked.
    pub(crate) fn of(settings: &RenderSettings) -> Option<Self> {
        let asked: OfAovs<f64> = settings.aov_noise;
        let Goal::Noise(noise) = settings.goal else { return None };
        let dealt = settings.sampling != Sampling::Uniform;
        let scale = if dealt { ERROR_OF_SQUARE * noise * noise } else { 0.0 };
        let factors = asked.map(|asked| asked.map_or(0.0, |asked| 1.0 / (asked * asked)));
        asked.iter().any(Option::is_some).then_some(Self { factors, scale })
    }

    /// The squared error of one sample of a pixel, over those asked for, summed over what was asked.
    pub(crate) fn square(&self, replicates: &[Replicate], aovs: &Aovs) -> f64 {
        let count: u32 = replicates.iter().map(|replicate| replicate.count).sum();
        let alpha = replicates.iter().map(|replicate| f64::from(replicate.sum[3])).sum();
        let variances = aovs.variances(alpha, count);
        variances.iter().zip(self.factors).map(|(variance, factor)| variance * factor).sum()
    }

    /// Adds the demand of each pixel of a tile to its error, which is that of one sample.
    pub(crate) fn add(
        &self,
        replicates: &[Replicate],
        aovs: &[Aovs; TILE_PIXELS],
        errors: &mut [PixelError; TILE_PIXELS],
    ) {
        let pixels = replicates.chunks_exact(REPLICATES).zip(aovs);
        for (error, (replicates, aovs)) in errors.iter_mut().zip(pixels) {
            if let Some(own) = error.to_f32() {
                let more = self.scale * self.square(replicates, aovs);
                *error = PixelError::from_f32((f64::from(own) + more) as f32);
            }
        }
    }
}
