//! Going on from where a sampling ended: with another target, nothing lost.

use super::{AdaptiveSampling, Settings, SettingsError};
use crate::{ErrorPlane, PassCounts, PixelError, Policy, SampleCounts, TILE_PIXELS, TileGrid};

/// What a sampling has come to, and another may start from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Start {
    /// Samples of each pixel over all replicates, tile by tile in the order of their indices, 64 to a tile; 0 outside
    /// the window.
    pub samples: Vec<u32>,
    /// The pixels' errors in the same order, in the metric of the policy that is to go on.
    pub errors: Vec<PixelError>,
}

impl Start {
    /// Where `sampling` stands. Exact once its workers are done, however it ended.
    pub fn of(sampling: &AdaptiveSampling) -> Self {
        let tiles = 0..sampling.grid().tiles();
        let samples = |tile| (0..TILE_PIXELS as u8).map(move |pixel| sampling.counts().pixel(tile, pixel));
        Self {
            samples: tiles.clone().flat_map(samples).collect(),
            errors: tiles.flat_map(|tile| sampling.errors(tile)).collect(),
        }
    }

    /// Whether it can be the start of a sampling with `settings`.
    pub(super) fn check(&self, settings: &Settings) -> Result<(), SettingsError> {
        let expected = settings.grid().tiles() as usize * TILE_PIXELS;
        let found = self.samples.len();
        if settings.policy == Policy::Unbiased {
            return Err(SettingsError::NoStart(settings.policy));
        }
        if found != expected || self.errors.len() != expected {
            return Err(SettingsError::StartSize { expected, found: [found, self.errors.len()] });
        }
        Ok(())
    }

    /// Puts the errors, and the numbers of samples they are from, into a plane.
    pub(super) fn fill(&self, plane: &ErrorPlane) {
        for (tile, (errors, samples)) in (0..).zip(self.tiles()) {
            plane.store_tile(tile, errors);
            plane.store_samples(tile, samples);
        }
    }

    /// The counts that go with it.
    pub(super) fn counts(&self, grid: &TileGrid, replicates: u32) -> SampleCounts {
        let counts = SampleCounts::new(grid.tiles(), replicates);
        for (tile, (_, samples)) in (0..).zip(self.tiles()) {
            (0..).zip(samples).for_each(|(pixel, &total)| counts.advance(tile, pixel, total));
        }
        counts
    }

    /// Whether a pixel of the window has fewer than `minimum` samples, as where its sampling was stopped early.
    pub(super) fn is_below(&self, minimum: u32, grid: &TileGrid) -> bool {
        (0..).zip(self.tiles()).any(|(tile, (_, samples))| {
            crate::active_mask::pixels(grid.full_mask(tile)).any(|p| samples[usize::from(p)] < minimum)
        })
    }

    /// The passes that would have brought a pixel drawn by all of them where the one with most samples is. They set the size
    /// of the next pass for policies whose pixels go by it.
    pub(super) fn passes(&self, counts: &PassCounts) -> u64 {
        let most = self.samples.iter().copied().max().unwrap_or(0).min(counts.max_samples);
        let (mut count, mut passes) = (0, 0);
        while count < most {
            (count, passes) = (counts.grown(count, passes), passes + 1);
        }
        passes
    }

    fn tiles(&self) -> impl Iterator<Item = (&[PixelError; TILE_PIXELS], &[u32; TILE_PIXELS])> {
        self.errors.as_chunks().0.iter().zip(self.samples.as_chunks().0)
    }
}

impl AdaptiveSampling {
    /// As [`AdaptiveSampling::new`], from where an earlier sampling of the same window ended. Trees are made of what
    /// is there before the first visit, so that only pixels that the new settings want more of are drawn; those below
    /// the minimum are brought to it. The samples go on where the earlier ones ended.
    ///
    /// # Errors
    /// Where the settings make no sense, the start is of another window, or the policy is [`Policy::Unbiased`], which
    /// decides but once.
    ///
    /// ```
    /// use quietus::{AdaptiveSampling, Settings, Start};
    /// # let coarse = AdaptiveSampling::new(Settings { target_error: 0.02, ..Settings::new(64, 48) })?;
    /// // `coarse` is finished.
    /// let fine = Settings { target_error: 0.01, ..coarse.settings().clone() };
    /// let fine = AdaptiveSampling::resumed(fine, &Start::of(&coarse))?;
    /// # assert_eq!(fine.counts().total(), 0);
    /// # Ok::<(), quietus::SettingsError>(())
    /// ```
    pub fn resumed(settings: Settings, start: &Start) -> Result<Self, SettingsError> {
        Self::build(settings, Some(start))
    }
}
