//! Pixels that take turns until all have their minimum of samples, so that a picture may be stopped at any moment.
//!
//! A pass that draws whole tiles leaves those it has reached with more samples than the others when it is stopped, and
//! the edge between them can be seen in the noise: in the first passes it is that of 2 and 6 samples. Here each pass draws
//! one pixel of every square of 2x2, in the order of an ordered dither (Bayer 1973, *An Optimum Method for Two-Level
//! Rendition of Continuous-Tone Pictures*), and a small step of it. What a stop leaves uneven is one small step of one pixel in
//! four. Squares of 4x4 would leave one in sixteen, but rays that start so far apart find less of the scene in the caches:
//! samples cost 1.2 to 1.9 times as much, with 2x2 1.05 to 1.3 times.

use crate::{
    PassCounts, TILE_PIXELS, TILE_SIZE, TileGrid, active_mask,
    pass_schedule::{Approach, SQUARE},
};

/// Turns of the pixels of a square, row by row: Bayer's matrix of order 2.
const TURNS: [[u32; 2]; 2] = [[0, 2], [3, 1]];

/// Which pixels each pass draws.
#[derive(Debug)]
pub(crate) struct Spread {
    /// The counts that a pixel comes by, from 0 to its minimum.
    steps: Box<[u32]>,
}

impl Spread {
    /// Where pixels come to their minimum that way.
    pub(crate) fn of(counts: &PassCounts) -> Option<Self> {
        (counts.approach == Approach::Spread).then(|| Self { steps: counts.steps_to_minimum().collect() })
    }

    /// Passes that bring all pixels to their minimum.
    pub(crate) fn passes(&self) -> u64 {
        u64::from(SQUARE) * (self.steps.len() as u64 - 1)
    }

    /// Whether pass `pass` may draw the pixel of a tile that has `count` samples: any once all have had their turns.
    pub(crate) fn is_due(&self, pixel: u8, count: u32, pass: u64) -> bool {
        let turns = (pass + u64::from(SQUARE) - turn(pixel)) / u64::from(SQUARE);
        pass >= self.passes() || count < self.steps[turns as usize]
    }

    /// The first pass that draws any of `samples`: of all tiles, 64 to a tile.
    pub(crate) fn first_pass(&self, grid: &TileGrid, samples: &[u32]) -> u64 {
        let next = |tile: u32, pixel: u8| {
            let count = samples[tile as usize * TILE_PIXELS + usize::from(pixel)];
            let taken = self.steps.partition_point(|&step| step <= count) as u64 - 1;
            u64::from(SQUARE) * taken + turn(pixel)
        };
        let tiles = 0..grid.tiles();
        let all = tiles
            .flat_map(|tile| active_mask::pixels(grid.full_mask(tile)).map(move |pixel| next(tile, pixel)));
        all.min().unwrap_or(0).min(self.passes())
    }
}

/// Which pass of the pixels of a square draws this one. Tiles are whole squares.
fn turn(pixel: u8) -> u64 {
    let (x, y) = (u32::from(pixel) % TILE_SIZE, u32::from(pixel) / TILE_SIZE);
    TURNS[y as usize % 2][x as usize % 2].into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Settings;

    fn spread() -> Spread {
        let settings = Settings { approach: Approach::Spread, ..Settings::new(16, 8) };
        Spread::of(&settings.pass_counts()).unwrap()
    }

    #[test]
    fn every_pass_draws_one_pixel_of_each_square_until_all_have_their_minimum() {
        let spread = spread();
        let mut counts = [0; 64];
        for pass in 0..spread.passes() {
            let due: Vec<u8> = (0..64).filter(|&p| spread.is_due(p, counts[usize::from(p)], pass)).collect();
            let squares: std::collections::HashSet<_> = due.iter().map(|p| (p % 8 / 2, p / 16)).collect();
            assert_eq!((due.len(), squares.len()), (16, 16), "pass {pass}");
            due.iter().for_each(|&p| counts[usize::from(p)] += 2);
        }
        assert_eq!(counts, [16; 64]);
        assert!((0..64).all(|p| spread.is_due(p, 16, spread.passes()) && !spread.is_due(p, 16, 31)));
    }

    #[test]
    fn goes_on_where_pixels_were_left() {
        let (spread, grid) = (spread(), TileGrid::new(16, 8));
        let mut samples = vec![6; 128];
        assert_eq!(spread.first_pass(&grid, &samples), 3 * 4);
        // A pixel whose turn is the third one is still at 4.
        samples[64 + 1] = 4;
        assert_eq!(spread.first_pass(&grid, &samples), 2 * 4 + 2);
        assert!(spread.is_due(1, 4, 2 * 4 + 2) && !spread.is_due(1, 6, 3 * 4 + 1));
        assert_eq!(spread.first_pass(&grid, &[99; 128]), spread.passes());
    }
}
