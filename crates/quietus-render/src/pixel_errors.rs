//! From the film's replicates to the library's pixel errors.

use quietus::{DammertzMetric, ErrorMetric, PixelError, ReplicateMean};
use quietus_film::{Replicate, TILE_PIXELS};

/// Most replicates a film here is made with.
pub(crate) const REPLICATES: usize = 2;

/// The error of one pixel from its replicates, in a metric.
pub fn pixel_error(metric: &dyn ErrorMetric, replicates: &[Replicate]) -> PixelError {
    let mut channels = [[0.0; 4]; REPLICATES];
    for (mean, replicate) in channels.iter_mut().zip(replicates) {
        *mean = replicate.mean().unwrap_or_default();
    }
    let means: [ReplicateMean<'_>; REPLICATES] =
        std::array::from_fn(|r| ReplicateMean { count: replicates[r].count, channels: &channels[r] });
    metric.pixel_error(&means)
}

/// The errors of a tile's 64 pixels, in a metric.
pub(crate) fn tile_errors(metric: &dyn ErrorMetric, replicates: &[Replicate]) -> [PixelError; TILE_PIXELS] {
    std::array::from_fn(|pixel| pixel_error(metric, &replicates[pixel * REPLICATES..][..REPLICATES]))
}

/// The remaining error of a pixel as it is shown: Dammertz's, or its cap where there is no estimate.
pub fn shown_error(replicates: &[Replicate]) -> f32 {
    pixel_error(&DammertzMetric, replicates)
        .to_f32()
        .unwrap_or_else(|| PixelError::MAX.to_f32().unwrap_or(f32::MAX))
}
