//! Morton order: tiles along a curve that stays local, so that primary rays find their caches warm and quadrants
//! of the image complete one after the other (the talk, section 4.1).

use crate::tile::TileGrid;

/// Every tile of the grid once, along the Morton curve.
pub fn morton_order(grid: &TileGrid) -> Vec<u32> {
    let mut tiles: Vec<u32> = (0..grid.tiles()).collect();
    tiles.sort_by_key(|&tile| {
        let (column, row) = grid.coordinates(tile);
        interleave(column) | interleave(row) << 1
    });
    tiles
}

/// Spreads the bits of `v` to the even places.
fn interleave(v: u32) -> u64 {
    let mut v = u64::from(v);
    v = (v | v << 16) & 0x0000_ffff_0000_ffff;
    v = (v | v << 8) & 0x00ff_00ff_00ff_00ff;
    v = (v | v << 4) & 0x0f0f_0f0f_0f0f_0f0f;
    v = (v | v << 2) & 0x3333_3333_3333_3333;
    (v | v << 1) & 0x5555_5555_5555_5555
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_sixteen_tiles_follow_the_curve() {
        let order = morton_order(&TileGrid::new(32, 32));
        let expected: Vec<u32> = vec![0, 1, 4, 5, 2, 3, 6, 7, 8, 9, 12, 13, 10, 11, 14, 15];
        assert_eq!(order, expected);
    }

    #[test]
    fn awkward_sizes_are_permutations() {
        for (w, h) in [(1, 1), (7, 3), (8, 8), (9, 17), (4096, 1), (1921, 1081)] {
            let grid = TileGrid::new(w, h);
            let mut order = morton_order(&grid);
            order.sort_unstable();
            assert!(order.into_iter().eq(0..grid.tiles()), "{w}x{h}");
        }
    }
}
