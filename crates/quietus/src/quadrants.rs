//! Quadrants: the image is cut into N x N regions, each with a tree of its own, so that one thread can rebuild
//! one while others go on in the rest (the talk, section 4.1).
//!
//! For the *error*, neighbouring regions overlap by one tile on every inner edge, which removes seams: each
//! tree sees what happens just beyond its border. A tile is *checked* only against the one region that is its
//! home.

use std::ops::Range;

use crate::{
    PixelRect,
    tile::{TILE_SIZE, TileGrid},
};

/// The partition of a grid of tiles into regions; the talk's quadrants for two regions an axis.
#[derive(Clone, Debug)]
pub struct Regions {
    grid: TileGrid,
    columns: Cuts,
    rows: Cuts,
}

/// Cuts of one axis into parts of whole tiles, none empty.
#[derive(Clone, Debug)]
struct Cuts {
    /// Tile at which each part starts, and the number of tiles at the end.
    starts: Vec<u32>,
}

impl Cuts {
    fn new(tiles: u32, parts: u32) -> Self {
        let parts = parts.min(tiles);
        Self {
            starts: (0..=parts)
                .map(|i| (u64::from(tiles) * u64::from(i) / u64::from(parts)) as u32)
                .collect(),
        }
    }

    fn parts(&self) -> u32 {
        self.starts.len() as u32 - 1
    }

    fn home(&self, tile: u32) -> u32 {
        self.starts.partition_point(|&start| start <= tile) as u32 - 1
    }

    fn home_range(&self, part: u32) -> Range<u32> {
        self.starts[part as usize]..self.starts[part as usize + 1]
    }

    /// With one tile beyond each inner edge.
    fn error_range(&self, part: u32) -> Range<u32> {
        let Range { start, end } = self.home_range(part);
        start.saturating_sub(1)..(end + 1).min(*self.starts.last().unwrap_or(&end))
    }

    /// The parts whose error range holds the tile: its home, and a neighbour across an edge it touches.
    fn containing(&self, tile: u32) -> Range<u32> {
        let home = self.home(tile);
        let Range { start, end } = self.home_range(home);
        let first = if tile == start { home.saturating_sub(1) } else { home };
        let last = if tile + 1 == end { (home + 1).min(self.parts() - 1) } else { home };
        first..last + 1
    }
}

impl Regions {
    /// `per_axis` x `per_axis` regions (fewer along an axis with fewer tiles than that), of nearly equal size.
    ///
    /// # Panics
    /// Where `per_axis` is 0.
    pub fn new(grid: TileGrid, per_axis: u32) -> Self {
        assert!(per_axis > 0, "at least one region an axis");
        Self { grid, columns: Cuts::new(grid.columns(), per_axis), rows: Cuts::new(grid.rows(), per_axis) }
    }

    /// The grid they partition.
    pub fn grid(&self) -> &TileGrid {
        &self.grid
    }

    /// How many there are.
    pub fn len(&self) -> u32 {
        self.columns.parts() * self.rows.parts()
    }

    /// Whether there are none; never true.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The one region that a tile is checked against.
    pub fn home(&self, tile: u32) -> u32 {
        let (column, row) = self.grid.coordinates(tile);
        self.rows.home(row) * self.columns.parts() + self.columns.home(column)
    }

    /// Every region whose error area contains the tile, its home among them: one inside, up to four at a
    /// corner, up to nine where regions are a single tile wide.
    pub fn containing(&self, tile: u32) -> impl Iterator<Item = u32> + use<> {
        let (column, row) = self.grid.coordinates(tile);
        let (columns, stride) = (self.columns.containing(column), self.columns.parts());
        self.rows.containing(row).flat_map(move |r| columns.clone().map(move |c| r * stride + c))
    }

    /// The tiles that are checked against the region.
    pub fn home_tiles(&self, region: u32) -> impl Iterator<Item = u32> + use<> {
        let (column, row) = self.place(region);
        tiles(self.grid, self.columns.home_range(column), self.rows.home_range(row))
    }

    /// The tiles whose errors count in the region: its home tiles, and those that overlap.
    pub fn error_tiles(&self, region: u32) -> impl Iterator<Item = u32> + use<> {
        let (column, row) = self.place(region);
        tiles(self.grid, self.columns.error_range(column), self.rows.error_range(row))
    }

    /// The pixels of the home tiles.
    pub fn home_rect(&self, region: u32) -> PixelRect {
        let (column, row) = self.place(region);
        self.pixels(self.columns.home_range(column), self.rows.home_range(row))
    }

    /// The pixels of the error tiles: the area of the region's tree.
    pub fn error_rect(&self, region: u32) -> PixelRect {
        let (column, row) = self.place(region);
        self.pixels(self.columns.error_range(column), self.rows.error_range(row))
    }

    fn place(&self, region: u32) -> (u32, u32) {
        (region % self.columns.parts(), region / self.columns.parts())
    }

    fn pixels(&self, columns: Range<u32>, rows: Range<u32>) -> PixelRect {
        PixelRect::new(
            columns.start * TILE_SIZE,
            rows.start * TILE_SIZE,
            (columns.end * TILE_SIZE).min(self.grid.width()),
            (rows.end * TILE_SIZE).min(self.grid.height()),
        )
    }
}

fn tiles(grid: TileGrid, columns: Range<u32>, rows: Range<u32>) -> impl Iterator<Item = u32> {
    rows.flat_map(move |row| columns.clone().map(move |column| grid.index(column, row)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn homes_partition_the_tiles_and_errors_overlap_by_one(
            w in 1u32..200, h in 1u32..200, per_axis in 1u32..6,
        ) {
            let grid = TileGrid::new(w, h);
            let regions = Regions::new(grid, per_axis);
            let mut home = vec![None; grid.tiles() as usize];
            for region in 0..regions.len() {
                for tile in regions.home_tiles(region) {
                    prop_assert_eq!(home[tile as usize].replace(region), None);
                    prop_assert_eq!(regions.home(tile), region);
                }
            }
            prop_assert!(home.iter().all(Option::is_some));
            for tile in 0..grid.tiles() {
                let (column, row) = grid.coordinates(tile);
                // From the definition: a region holds a tile's errors where one of its home tiles is at most
                // one column and one row away.
                let mut expected: Vec<u32> = (row.saturating_sub(1)..=(row + 1).min(grid.rows() - 1))
                    .flat_map(|r| (column.saturating_sub(1)..=(column + 1).min(grid.columns() - 1))
                        .map(move |c| (c, r)))
                    .map(|(c, r)| regions.home(grid.index(c, r)))
                    .collect();
                expected.sort_unstable();
                expected.dedup();
                prop_assert_eq!(regions.containing(tile).collect::<Vec<_>>(), expected);
            }
            for region in 0..regions.len() {
                let from_tiles: Vec<u32> =
                    (0..grid.tiles()).filter(|&t| regions.containing(t).any(|r| r == region)).collect();
                prop_assert_eq!(regions.error_tiles(region).collect::<Vec<_>>(), from_tiles.clone());
                prop_assert!(from_tiles.iter()
                    .all(|&t| regions.error_rect(region).contains_rect(&grid.tile_rect(t))));
                prop_assert_eq!(
                    regions.error_rect(region).area(),
                    from_tiles.iter().map(|&t| grid.tile_rect(t).area()).sum::<u64>()
                );
            }
        }
    }
}
