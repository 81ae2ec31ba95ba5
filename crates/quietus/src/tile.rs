//! Tiles: 8x8 pixels, each sampled by one thread at a time (the talk, section 2).

use crate::PixelRect;

/// Side of a tile in pixels, so that one `u64` holds a bit per pixel.
pub const TILE_SIZE: u32 = 8;

/// Pixels in a whole tile.
pub const TILE_PIXELS: usize = 64;

/// The tiles that cover a grid of pixels. Tiles on the right and bottom edges may hang over.
///
/// A tile's index counts row by row. Within a tile, pixel (x, y) has bit `8 y + x` of a mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TileGrid {
    width: u32,
    height: u32,
}

impl TileGrid {
    /// The grid over `width` x `height` pixels, both at least 1.
    ///
    /// # Panics
    /// Where a side is 0, or the number of tiles exceeds `u32`.
    pub fn new(width: u32, height: u32) -> Self {
        assert!(width > 0 && height > 0, "a tile grid needs at least one pixel, got {width}x{height}");
        let grid = Self { width, height };
        assert!(
            u64::from(grid.columns()) * u64::from(grid.rows()) <= u64::from(u32::MAX),
            "too many tiles: {width}x{height} pixels"
        );
        grid
    }

    /// Width in pixels.
    pub const fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels.
    pub const fn height(&self) -> u32 {
        self.height
    }

    /// Tiles in a row.
    pub const fn columns(&self) -> u32 {
        self.width.div_ceil(TILE_SIZE)
    }

    /// Rows of tiles.
    pub const fn rows(&self) -> u32 {
        self.height.div_ceil(TILE_SIZE)
    }

    /// Number of tiles.
    pub const fn tiles(&self) -> u32 {
        self.columns() * self.rows()
    }

    /// All pixels.
    pub const fn rect(&self) -> PixelRect {
        PixelRect::new(0, 0, self.width, self.height)
    }

    /// Column and row of a tile.
    pub const fn coordinates(&self, tile: u32) -> (u32, u32) {
        (tile % self.columns(), tile / self.columns())
    }

    /// Index of the tile in a column and row.
    pub const fn index(&self, column: u32, row: u32) -> u32 {
        row * self.columns() + column
    }

    /// The pixels of a tile, cut at the right and bottom edges of the grid.
    pub fn tile_rect(&self, tile: u32) -> PixelRect {
        let (column, row) = self.coordinates(tile);
        let (x0, y0) = (column * TILE_SIZE, row * TILE_SIZE);
        PixelRect::new(x0, y0, (x0 + TILE_SIZE).min(self.width), (y0 + TILE_SIZE).min(self.height))
    }

    /// Mask of the tile's pixels that lie in the grid.
    pub fn full_mask(&self, tile: u32) -> u64 {
        crate::active_mask::rect_in_tile(&self.tile_rect(tile), &self.tile_rect(tile))
    }

    /// The tile that holds a pixel.
    pub const fn tile_at(&self, x: u32, y: u32) -> u32 {
        self.index(x / TILE_SIZE, y / TILE_SIZE)
    }
}
