//! The plane of pixel errors that the library owns, each with the number of samples it was estimated from.
//!
//! The thread that has just sampled a tile submits the tile's 64 errors; rebuilding a region's tree reads them
//! here and never touches the renderer's film. Nor does it look at the sample counts that drive the sampling:
//! those may be of a later pass already.

use std::ops::Range;

use crate::{
    PixelRect,
    error_metric::PixelError,
    sync::{AtomicU32, Ordering},
    tile::{TILE_PIXELS, TILE_SIZE, TileGrid},
};

/// One error and one number of samples per pixel of a grid, stored tile by tile so that a visit writes eight cache
/// lines.
///
/// Loads and stores are relaxed: who may read what when is the protocol's business (PROTOCOL.md), which orders
/// them by its visit counters. A racy read, possible in free-running mode only, sees an older error or number,
/// never a torn one.
#[derive(Debug)]
pub struct ErrorPlane {
    grid: TileGrid,
    errors: Box<[AtomicU32]>,
    samples: Box<[AtomicU32]>,
}

impl ErrorPlane {
    /// A plane of zero errors from no samples.
    pub fn new(grid: TileGrid) -> Self {
        let pixels = grid.tiles() as usize * TILE_PIXELS;
        let zeros = || (0..pixels).map(|_| AtomicU32::new(PixelError::ZERO.to_bits())).collect();
        Self { grid, errors: zeros(), samples: zeros() }
    }

    /// The grid of pixels.
    pub fn grid(&self) -> &TileGrid {
        &self.grid
    }

    /// Replaces the errors of a tile; those outside the grid must be zero.
    pub fn store_tile(&self, tile: u32, errors: &[PixelError; TILE_PIXELS]) {
        for (slot, error) in self.errors[of_tile(tile)].iter().zip(errors) {
            slot.store(error.to_bits(), Ordering::Relaxed);
        }
    }

    /// Replaces the numbers of samples that a tile's errors are estimated from, over all replicates.
    pub fn store_samples(&self, tile: u32, samples: &[u32; TILE_PIXELS]) {
        for (slot, &samples) in self.samples[of_tile(tile)].iter().zip(samples) {
            slot.store(samples, Ordering::Relaxed);
        }
    }

    /// The errors of a tile, row by row.
    pub fn load_tile(&self, tile: u32) -> [PixelError; TILE_PIXELS] {
        let slots = &self.errors[of_tile(tile)];
        std::array::from_fn(|i| PixelError::from_bits(slots[i].load(Ordering::Relaxed)))
    }

    /// The numbers of samples that a tile's errors are estimated from, row by row.
    pub fn load_samples(&self, tile: u32) -> [u32; TILE_PIXELS] {
        let slots = &self.samples[of_tile(tile)];
        std::array::from_fn(|i| slots[i].load(Ordering::Relaxed))
    }

    /// Makes a tile's errors, and the numbers of their samples, those it has in another plane of the same grid.
    pub fn copy_tile(&self, tile: u32, from: &Self) {
        let tile = of_tile(tile);
        let errors = self.errors[tile.clone()].iter().zip(&from.errors[tile.clone()]);
        let samples = self.samples[tile.clone()].iter().zip(&from.samples[tile]);
        for (to, from) in errors.chain(samples) {
            to.store(from.load(Ordering::Relaxed), Ordering::Relaxed);
        }
    }

    /// Row `y` from `x0` to `x1`, in spans of at most a tile's width from left to right: the first column of
    /// the span, and the errors.
    pub(crate) fn row(&self, y: u32, x0: u32, x1: u32) -> impl Iterator<Item = (u32, &[AtomicU32])> {
        self.spans(y, x0, x1).map(|(x, span)| (x, &self.errors[span]))
    }

    /// As [`Self::row`], with the numbers of samples in place of errors.
    pub(crate) fn samples_row(&self, y: u32, x0: u32, x1: u32) -> impl Iterator<Item = (u32, &[AtomicU32])> {
        self.spans(y, x0, x1).map(|(x, span)| (x, &self.samples[span]))
    }

    /// The spans of a row: first column, and where its pixels are kept.
    fn spans(&self, y: u32, x0: u32, x1: u32) -> impl Iterator<Item = (u32, Range<usize>)> + use<> {
        let (grid, rows_above) = (self.grid, (y % TILE_SIZE * TILE_SIZE) as usize);
        (x0 / TILE_SIZE..x1.div_ceil(TILE_SIZE)).map(move |column| {
            let left = column * TILE_SIZE;
            let (from, to) = (x0.max(left), x1.min(left + TILE_SIZE));
            let row = of_tile(grid.index(column, y / TILE_SIZE)).start + rows_above;
            (from, row + (from - left) as usize..row + (to - left) as usize)
        })
    }

    /// The errors of `rect` in steps, row by row, into `out`; rejected pixels count 0.
    pub fn copy_rect(&self, rect: &PixelRect, out: &mut Vec<u32>) {
        out.clear();
        out.reserve(rect.area() as usize);
        for y in rect.y0..rect.y1 {
            for (_, span) in self.row(y, rect.x0, rect.x1) {
                out.extend(span.iter().map(steps));
            }
        }
    }

    /// The numbers of samples in `rect`, row by row, into `out`.
    pub fn copy_samples(&self, rect: &PixelRect, out: &mut Vec<u32>) {
        out.clear();
        out.reserve(rect.area() as usize);
        for y in rect.y0..rect.y1 {
            for (_, span) in self.samples_row(y, rect.x0, rect.x1) {
                out.extend(span.iter().map(samples));
            }
        }
    }
}

/// Where the pixels of a tile are kept.
fn of_tile(tile: u32) -> Range<usize> {
    tile as usize * TILE_PIXELS..(tile as usize + 1) * TILE_PIXELS
}

/// The error in a slot, in steps; a rejected pixel counts 0.
pub(crate) fn steps(slot: &AtomicU32) -> u32 {
    PixelError::from_bits(slot.load(Ordering::Relaxed)).steps() as u32
}

/// The number in a slot.
pub(crate) fn samples(slot: &AtomicU32) -> u32 {
    slot.load(Ordering::Relaxed)
}

#[cfg(all(test, not(any(loom, shuttle))))]
mod tests {
    use super::*;

    #[test]
    fn rows_come_out_as_tiles_went_in() {
        let grid = TileGrid::new(19, 11);
        let plane = ErrorPlane::new(grid);
        let step = |x: u32, y: u32| PixelError::from_bits(y * 100 + x);
        for tile in 0..grid.tiles() {
            let rect = grid.tile_rect(tile);
            plane.store_tile(
                tile,
                &std::array::from_fn(|i| step(rect.x0 + i as u32 % 8, rect.y0 + i as u32 / 8)),
            );
        }
        let rect = PixelRect::new(3, 2, 18, 11);
        let mut rows = Vec::new();
        plane.copy_rect(&rect, &mut rows);
        let expected: Vec<u32> = (2..11).flat_map(|y| (3..18).map(move |x| y * 100 + x)).collect();
        assert_eq!(rows, expected);
    }
}
