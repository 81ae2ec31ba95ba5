//! Where the film lies: full frame, crop window, tiles.

/// Side of a tile in pixels.
pub const TILE: u32 = 8;
/// Pixels of a whole tile.
pub const TILE_PIXELS: usize = (TILE * TILE) as usize;

/// Longest side of a frame. Pixel coordinates up to here are exact in every format we write.
const MAX_SIDE: u32 = 65_536;
/// Most pixels of a window: a 16K frame (15,360 x 8,640) still fits.
const MAX_PIXELS: u64 = 1 << 27;

/// A rectangle of pixels in the full frame: `x0 <= x < x1`, `y0 <= y < y1`, row 0 at the top.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// First column.
    pub x0: u32,
    /// First row.
    pub y0: u32,
    /// Column after the last.
    pub x1: u32,
    /// Row after the last.
    pub y1: u32,
}

impl Window {
    /// Columns.
    pub fn width(&self) -> u32 {
        self.x1 - self.x0
    }

    /// Rows.
    pub fn height(&self) -> u32 {
        self.y1 - self.y0
    }

    /// Columns times rows.
    pub fn pixels(&self) -> usize {
        self.width() as usize * self.height() as usize
    }
}

/// A frame or window that no film can have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LayoutError {
    /// A side of the frame is 0 or beyond reason.
    #[error("a frame of {width}x{height} pixels is out of range: sides go from 1 to {MAX_SIDE}")]
    Frame {
        /// Asked for.
        width: u32,
        /// Asked for.
        height: u32,
    },
    /// The window is empty or leaves the frame.
    #[error(
        "the window {},{},{},{} is not inside the frame of {width}x{height} pixels: expected x0,y0,x1,y1 with \
         0 <= x0 < x1 <= {width} and 0 <= y0 < y1 <= {height}", .window.x0, .window.y0, .window.x1, .window.y1
    )]
    Window {
        /// Asked for.
        window: Window,
        /// Of the frame.
        width: u32,
        /// Of the frame.
        height: u32,
    },
    /// The window has too many pixels.
    #[error("a picture of {pixels} pixels is too large: at most {MAX_PIXELS} are possible")]
    TooManyPixels {
        /// Asked for.
        pixels: u64,
    },
    /// The number of replicates is 0 or cannot be numbered by the tracer.
    #[error("{0} replicates per pixel are out of range: expected 1 to 255")]
    Replicates(usize),
}

/// A checked frame with its window and number of replicates. Tiles are counted from the window's corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    frame: [u32; 2],
    window: Window,
    replicates: u8,
}

impl Layout {
    /// A film for `window` of a frame of `frame` pixels with `replicates` independent estimates per pixel.
    ///
    /// # Errors
    /// When a side is 0 or above 65,536, the window is empty, leaves the frame or holds more than 2^27 pixels, or
    /// `replicates` is not in 1..=255.
    pub fn new(frame: [u32; 2], window: Window, replicates: usize) -> Result<Self, LayoutError> {
        let [width, height] = frame;
        if !(1..=MAX_SIDE).contains(&width) || !(1..=MAX_SIDE).contains(&height) {
            return Err(LayoutError::Frame { width, height });
        }
        let inside =
            window.x0 < window.x1 && window.x1 <= width && window.y0 < window.y1 && window.y1 <= height;
        if !inside {
            return Err(LayoutError::Window { window, width, height });
        }
        let pixels = u64::from(window.width()) * u64::from(window.height());
        if pixels > MAX_PIXELS {
            return Err(LayoutError::TooManyPixels { pixels });
        }
        match u8::try_from(replicates) {
            Ok(count) if count > 0 => Ok(Self { frame, window, replicates: count }),
            _ => Err(LayoutError::Replicates(replicates)),
        }
    }

    /// The full frame with two replicates.
    ///
    /// # Errors
    /// As [`Layout::new`].
    pub fn full(width: u32, height: u32) -> Result<Self, LayoutError> {
        Self::new([width, height], Window { x0: 0, y0: 0, x1: width, y1: height }, 2)
    }

    /// Width and height of the full frame.
    pub fn frame(&self) -> [u32; 2] {
        self.frame
    }

    /// The part of the frame the film covers.
    pub fn window(&self) -> Window {
        self.window
    }

    /// Replicates per pixel.
    pub fn replicates(&self) -> usize {
        usize::from(self.replicates)
    }

    /// Tiles in x and y.
    pub fn tiles(&self) -> [u32; 2] {
        [self.window.width().div_ceil(TILE), self.window.height().div_ceil(TILE)]
    }

    /// Number of the tile at tile coordinates (`tx`, `ty`), row by row.
    ///
    /// # Panics
    /// When there is no such tile.
    pub fn tile_index(&self, tx: u32, ty: u32) -> usize {
        let [across, down] = self.tiles();
        assert!(tx < across && ty < down, "tile ({tx}, {ty}) is outside of {across}x{down} tiles");
        ty as usize * across as usize + tx as usize
    }

    /// The pixels of tile `index` in full-frame coordinates; less than 8x8 at the right and lower edges.
    pub fn tile_window(&self, index: usize) -> Window {
        let across = self.tiles()[0] as usize;
        let x0 = self.window.x0 + (index % across) as u32 * TILE;
        let y0 = self.window.y0 + (index / across) as u32 * TILE;
        Window { x0, y0, x1: (x0 + TILE).min(self.window.x1), y1: (y0 + TILE).min(self.window.y1) }
    }

    /// Bytes a film of this layout takes.
    pub fn film_bytes(&self) -> u64 {
        let [across, down] = self.tiles();
        u64::from(across) * u64::from(down) * crate::film::tile_bytes(self.replicates()) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn window(x0: u32, y0: u32, x1: u32, y1: u32) -> Window {
        Window { x0, y0, x1, y1 }
    }

    #[test]
    fn rejects_what_no_film_can_be() {
        assert!(matches!(Layout::full(0, 4), Err(LayoutError::Frame { .. })));
        assert!(matches!(Layout::full(4, 65_537), Err(LayoutError::Frame { .. })));
        assert!(matches!(Layout::full(65_536, 65_536), Err(LayoutError::TooManyPixels { .. })));
        for bad in [window(3, 0, 3, 4), window(0, 2, 4, 1), window(0, 0, 11, 4), window(0, 0, 10, 9)] {
            assert!(matches!(Layout::new([10, 8], bad, 2), Err(LayoutError::Window { .. })), "{bad:?}");
        }
        assert_eq!(Layout::new([10, 8], window(0, 0, 1, 1), 256), Err(LayoutError::Replicates(256)));
    }

    #[test]
    fn tiles_cover_every_pixel_of_the_window_once() {
        for (w, h) in [(1, 1), (7, 3), (8, 8), (9, 17), (4096, 1), (33, 41)] {
            let layout = Layout::new([w + 5, h + 3], window(5, 3, w + 5, h + 3), 2).unwrap();
            let [across, down] = layout.tiles();
            let mut seen = vec![0; (w * h) as usize];
            for index in 0..(across * down) as usize {
                let tile = layout.tile_window(index);
                for y in tile.y0..tile.y1 {
                    for x in tile.x0..tile.x1 {
                        seen[((y - 3) * w + x - 5) as usize] += 1;
                    }
                }
            }
            assert!(seen.iter().all(|&count| count == 1), "{w}x{h}");
        }
    }
}
