//! Which pixels of a tile are active: the intersection of tile and tree as a 64-bit mask (the talk, section 2).
//!
//! Bit `8 y + x` stands for pixel (x, y) of the tile.

use crate::{PixelRect, tile::TILE_SIZE};

/// Mask of the pixels of `rect` that lie in the tile whose pixels are `tile` (its top left corner counts).
pub fn rect_in_tile(tile: &PixelRect, rect: &PixelRect) -> u64 {
    let part = tile.intersection(rect);
    if part.is_empty() {
        return 0;
    }
    let columns = ((1u64 << part.width()) - 1) << (part.x0 - tile.x0);
    // One bit per row in the lowest column; the product with `columns` (below 2^8) repeats it in each row.
    const ROWS: u64 = 0x0101_0101_0101_0101;
    let height = part.height();
    let rows = if height == TILE_SIZE { ROWS } else { ROWS & ((1 << (8 * height)) - 1) };
    (columns * rows) << (8 * (part.y0 - tile.y0))
}

/// The mask filled to its bounding rectangle, as published practice draws it.
pub fn fill_to_bounding_rectangle(mask: u64) -> u64 {
    if mask == 0 {
        return 0;
    }
    let first_row = mask.trailing_zeros() / 8;
    let last_row = 7 - mask.leading_zeros() / 8;
    let columns = (0..8).fold(0u64, |acc, row| acc | (mask >> (8 * row)) & 0xff);
    let (x0, x1) = (columns.trailing_zeros(), 64 - columns.leading_zeros());
    let tile = PixelRect::new(0, 0, TILE_SIZE, TILE_SIZE);
    rect_in_tile(&tile, &PixelRect::new(x0, first_row, x1, last_row + 1))
}

/// The set bits of a mask, lowest first.
pub fn pixels(mut mask: u64) -> impl Iterator<Item = u8> {
    std::iter::from_fn(move || {
        let pixel = (mask != 0).then(|| mask.trailing_zeros() as u8)?;
        mask &= mask - 1;
        Some(pixel)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn bits(test: impl Fn(u32, u32) -> bool) -> u64 {
        (0..64).filter(|b| test(b % 8, b / 8)).fold(0, |mask, b| mask | 1 << b)
    }

    proptest! {
        #[test]
        fn mask_of_a_rectangle_is_what_pixel_tests_say(
            tx in 0u32..4, ty in 0u32..4, x0 in 0u32..40, y0 in 0u32..40, w in 0u32..20, h in 0u32..20,
        ) {
            let tile = PixelRect::new(tx * 8, ty * 8, tx * 8 + 8, ty * 8 + 8);
            let rect = PixelRect::new(x0, y0, x0 + w, y0 + h);
            prop_assert_eq!(
                rect_in_tile(&tile, &rect),
                bits(|x, y| rect.contains(tx * 8 + x, ty * 8 + y))
            );
        }

        #[test]
        fn bounding_rectangle_is_the_smallest_that_holds_the_mask(mask: u64) {
            let xs: Vec<u32> = pixels(mask).map(|b| u32::from(b) % 8).collect();
            let ys: Vec<u32> = pixels(mask).map(|b| u32::from(b) / 8).collect();
            let expected = if mask == 0 { 0 } else {
                let rect = PixelRect::new(
                    *xs.iter().min().unwrap(), *ys.iter().min().unwrap(),
                    xs.iter().max().unwrap() + 1, ys.iter().max().unwrap() + 1,
                );
                bits(|x, y| rect.contains(x, y))
            };
            prop_assert_eq!(fill_to_bounding_rectangle(mask), expected);
        }
    }

    #[test]
    fn pixels_come_lowest_first() {
        assert_eq!(pixels(1 << 63 | 0b101).collect::<Vec<_>>(), [0, 2, 63]);
    }
}
