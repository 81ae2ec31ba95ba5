//! How many samples each replicate of each pixel has (the talk, section 3.2).
//!
//! These counts alone drive the sample index: an interrupted pixel goes on where it stopped, without gaps or
//! repeats, whatever pass it is.

use std::ops::Range;

use crate::{
    pass_schedule::replicate_share,
    protocol::Misfit,
    sync::{AtomicU32, Ordering},
    tile::TILE_PIXELS,
};

/// Next sample index of every replicate of every pixel, tile by tile.
///
/// Only the thread that has the tile writes, so relaxed ordering is enough: one visit of a tile happens before
/// the next through the tile's turn (PROTOCOL.md). Others may read at any time and see a recent count.
#[derive(Debug)]
pub struct SampleCounts {
    next: Box<[AtomicU32]>,
    replicates: u32,
}

impl SampleCounts {
    /// No samples yet, for `tiles` tiles of 64 pixels with `replicates` replicates each.
    pub fn new(tiles: u32, replicates: u32) -> Self {
        let words = tiles as usize * replicates as usize * TILE_PIXELS;
        Self { next: (0..words).map(|_| AtomicU32::new(0)).collect(), replicates }
    }

    /// Replicates per pixel.
    pub fn replicates(&self) -> u32 {
        self.replicates
    }

    /// Samples that one replicate of pixel `pixel` (0..64) of `tile` has, which is its next sample index.
    pub fn replicate(&self, tile: u32, pixel: u8, replicate: u32) -> u32 {
        self.next[self.word(tile, pixel, replicate)].load(Ordering::Relaxed)
    }

    /// Samples that pixel `pixel` (0..64) of `tile` has over all replicates.
    pub fn pixel(&self, tile: u32, pixel: u8) -> u32 {
        (0..self.replicates).map(|r| self.replicate(tile, pixel, r)).sum()
    }

    /// Samples of all pixels.
    pub fn total(&self) -> u64 {
        self.next.iter().map(|n| u64::from(n.load(Ordering::Relaxed))).sum()
    }

    /// All numbers: tile by tile, replicate by replicate, pixel by pixel.
    pub(crate) fn to_vec(&self) -> Vec<u32> {
        self.next.iter().map(|next| next.load(Ordering::Relaxed)).collect()
    }

    /// Sets all numbers, as [`Self::to_vec`] gave them.
    pub(crate) fn restore(&self, counts: &[u32]) -> Result<(), Misfit> {
        Misfit::unless(counts.len() == self.next.len(), "it has another number of sample counts")?;
        for tile in counts.chunks_exact(self.replicates as usize * TILE_PIXELS) {
            let total = |pixel| tile[pixel..].iter().step_by(TILE_PIXELS).map(|&n| u64::from(n)).sum::<u64>();
            let possible = (0..TILE_PIXELS).all(|pixel| total(pixel) <= u64::from(u32::MAX));
            Misfit::unless(possible, "a pixel has too many samples")?;
        }
        self.next.iter().zip(counts).for_each(|(next, &count)| next.store(count, Ordering::Relaxed));
        Ok(())
    }

    /// Sample indices of one replicate when the pixel goes on until all its replicates together hold `total`.
    ///
    /// Replicates stay equal where `total` is a multiple of their number; otherwise the first ones get one more.
    pub(crate) fn run(&self, tile: u32, pixel: u8, replicate: u32, total: u32) -> Range<u32> {
        let first = self.replicate(tile, pixel, replicate);
        first..replicate_share(total, self.replicates, replicate).max(first)
    }

    /// Records that the pixel's replicates together hold `total` samples.
    pub(crate) fn advance(&self, tile: u32, pixel: u8, total: u32) {
        for replicate in 0..self.replicates {
            let next = self.run(tile, pixel, replicate, total).end;
            self.next[self.word(tile, pixel, replicate)].store(next, Ordering::Relaxed);
        }
    }

    fn word(&self, tile: u32, pixel: u8, replicate: u32) -> usize {
        (tile as usize * self.replicates as usize + replicate as usize) * TILE_PIXELS + usize::from(pixel)
    }
}

#[cfg(all(test, not(any(loom, shuttle))))]
mod tests {
    use super::*;

    #[test]
    fn the_largest_maximum_is_shared_without_overflow() {
        let counts = SampleCounts::new(1, 2);
        counts.advance(0, 0, u32::MAX);
        assert_eq!([0, 1].map(|r| counts.replicate(0, 0, r)), [1 << 31, (1 << 31) - 1]);
        assert_eq!(counts.pixel(0, 0), u32::MAX);
    }

    #[test]
    fn runs_join_without_gaps_and_stay_balanced() {
        for replicates in [1, 2, 3] {
            let counts = SampleCounts::new(2, replicates);
            let mut next = vec![0; replicates as usize];
            for total in [1, 2, 6, 7, 16, 16, 31] {
                for r in 0..replicates {
                    let run = counts.run(1, 63, r, total);
                    assert_eq!(run.start, next[r as usize]);
                    next[r as usize] = run.end;
                }
                counts.advance(1, 63, total);
                assert_eq!(counts.pixel(1, 63), total);
                assert!(next.iter().max().unwrap() - next.iter().min().unwrap() <= 1);
            }
            assert_eq!(counts.total(), 31);
        }
    }
}
