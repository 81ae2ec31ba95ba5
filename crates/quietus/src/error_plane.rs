//! The plane of pixel errors that the library owns.
//!
//! The thread that has just sampled a tile submits the tile's 64 errors; rebuilding a region's tree reads them
//! here and never touches the renderer's film.

use crate::{
    PixelRect,
    error_metric::PixelError,
    sync::{AtomicU32, Ordering},
    tile::{TILE_PIXELS, TILE_SIZE, TileGrid},
};

/// One error per pixel of a grid, stored tile by tile so that a visit writes four cache lines.
///
/// Loads and stores are relaxed: who may read what when is the protocol's business (PROTOCOL.md), which orders
/// them by its visit counters. A racy read, possible in free-running mode only, sees an older error, never a
/// torn one.
#[derive(Debug)]
pub struct ErrorPlane {
    grid: TileGrid,
    errors: Box<[AtomicU32]>,
}

impl ErrorPlane {
    /// A plane of zero errors.
    pub fn new(grid: TileGrid) -> Self {
        let errors = (0..grid.tiles() as usize * TILE_PIXELS)
            .map(|_| AtomicU32::new(PixelError::ZERO.to_bits()))
            .collect();
        Self { grid, errors }
    }

    /// The grid of pixels.
    pub fn grid(&self) -> &TileGrid {
        &self.grid
    }

    /// Replaces the errors of a tile; those outside the grid must be zero.
    pub fn store_tile(&self, tile: u32, errors: &[PixelError; TILE_PIXELS]) {
        for (slot, error) in self.tile(tile).iter().zip(errors) {
            slot.store(error.to_bits(), Ordering::Relaxed);
        }
    }

    /// The errors of a tile, row by row.
    pub fn load_tile(&self, tile: u32) -> [PixelError; TILE_PIXELS] {
        let slots = self.tile(tile);
        std::array::from_fn(|i| PixelError::from_bits(slots[i].load(Ordering::Relaxed)))
    }

    /// Makes a tile's errors those it has in another plane of the same grid.
    pub fn copy_tile(&self, tile: u32, from: &Self) {
        for (to, from) in self.tile(tile).iter().zip(from.tile(tile)) {
            to.store(from.load(Ordering::Relaxed), Ordering::Relaxed);
        }
    }

    fn tile(&self, tile: u32) -> &[AtomicU32] {
        &self.errors[tile as usize * TILE_PIXELS..][..TILE_PIXELS]
    }

    /// Row `y` from `x0` to `x1`, in spans of at most a tile's width from left to right: the first column of
    /// the span, and the errors.
    pub(crate) fn row(&self, y: u32, x0: u32, x1: u32) -> impl Iterator<Item = (u32, &[AtomicU32])> {
        (x0 / TILE_SIZE..x1.div_ceil(TILE_SIZE)).map(move |column| {
            let left = column * TILE_SIZE;
            let (from, to) = (x0.max(left), x1.min(left + TILE_SIZE));
            let row =
                &self.tile(self.grid.index(column, y / TILE_SIZE))[(y % TILE_SIZE * TILE_SIZE) as usize..];
            (from, &row[(from - left) as usize..(to - left) as usize])
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
}

/// The error in a slot, in steps; a rejected pixel counts 0.
pub(crate) fn steps(slot: &AtomicU32) -> u32 {
    PixelError::from_bits(slot.load(Ordering::Relaxed)).steps() as u32
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
