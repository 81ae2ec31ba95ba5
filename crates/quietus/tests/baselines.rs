//! The baselines do what their sources say, from errors that are known: `tile`, `dammertz`, `pixel`, `uniform`.

use quietus::{
    ErrorPlane, PixelError, Regions, Settings, TILE_PIXELS, TileGrid, active_mask,
    policy::{Policy, Rebuild, RuleSettings, StoppingRule},
    region_error,
};

/// One region of 4x4 tiles.
const SIDE: u32 = 32;

fn grid() -> TileGrid {
    TileGrid::new(SIDE, SIDE)
}

fn rule(policy: Policy, target_error: f64) -> Box<dyn StoppingRule> {
    let regions = Regions::new(grid(), 1);
    let frame_area = f64::from(SIDE * SIDE);
    let counts = Settings::new(SIDE, SIDE).pass_counts();
    let rebuild = Rebuild::default();
    policy.rule(&RuleSettings { regions, target_error, frame_area, rebuild, counts }, 0)
}

fn plane(error: impl Fn(u32, u32) -> f32) -> ErrorPlane {
    let plane = ErrorPlane::new(grid());
    for tile in 0..grid().tiles() {
        let rect = grid().tile_rect(tile);
        let pixel = |i: usize| error(rect.x0 + i as u32 % 8, rect.y0 + i as u32 / 8);
        plane.store_tile(tile, &std::array::from_fn(|i| PixelError::from_f32(pixel(i))));
    }
    plane
}

fn is_active(rule: &dyn StoppingRule, x: u32, y: u32) -> bool {
    rule.active(grid().tile_at(x, y)) >> (8 * (y % 8) + x % 8) & 1 == 1
}

fn active_pixels(rule: &dyn StoppingRule) -> Vec<(u32, u32)> {
    let all = (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| (x, y)));
    all.filter(|&(x, y)| is_active(rule, x, y)).collect()
}

#[test]
fn uniform_never_stops() {
    let mut rule = rule(Policy::Uniform, 1.0);
    rule.update(&plane(|_, _| 0.0));
    assert_eq!(active_pixels(&*rule).len() as u32, SIDE * SIDE);
    assert!(!rule.is_complete());
}

#[test]
fn a_tile_stops_on_its_own_error_alone() {
    // Tile t has t/100 in each pixel; its region error is r times that, r = sqrt(64/1024) = 1/4.
    let by_tile = plane(|x, y| grid().tile_at(x, y) as f32 / 100.0);
    let step = f64::from(1 << PixelError::FRACTION_BITS);
    let mut rule = rule(Policy::Tile, 0.019);
    rule.update(&by_tile);
    for tile in 0..grid().tiles() {
        let sum = (f64::from(tile) / 100.0 * step).round() as u64 * TILE_PIXELS as u64;
        let goes_on = region_error(sum, 64.0, 1024.0) >= 0.019;
        assert_eq!(goes_on, tile >= 8, "the formula by hand: tile/400 >= 0.019");
        assert_eq!(rule.active(tile), if goes_on { u64::MAX } else { 0 }, "tile {tile}");
    }
}

#[test]
fn pixels_stop_on_their_own_unless_a_neighbour_goes_on() {
    // N = 1, so that the region error of a pixel is e/32. One at a corner of four tiles, one in the picture's.
    let loud = [(7, 7), (31, 31)];
    let mut rule = rule(Policy::Pixel, 0.01);
    rule.update(&plane(|x, y| if loud.contains(&(x, y)) { 0.33 } else { 0.31 }));
    let near = |x: u32, y: u32| loud.iter().any(|&(u, v)| x.abs_diff(u) <= 1 && y.abs_diff(v) <= 1);
    let expected: Vec<_> =
        (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| (x, y))).filter(|&(x, y)| near(x, y)).collect();
    assert_eq!(expected.len(), 9 + 4);
    assert_eq!(active_pixels(&*rule), expected);
    // What stopped goes on again where its error rises.
    rule.update(&plane(|_, _| 0.33));
    assert_eq!(active_pixels(&*rule).len() as u32, SIDE * SIDE);
}

#[test]
fn dammertz_splits_at_half_the_error_and_discards() {
    // All the error in the left 8 of 32 columns, the same in each: half of it is reached after column 4.
    let left = plane(|x, _| if x < 8 { 0.4 } else { 0.0 });
    let mut rule = rule(Policy::Dammertz, 0.01);
    // The whole: 0.1, above the target and below 256 times that: split in 0..4 and 4..32, both active.
    rule.update(&left);
    assert_eq!(active_pixels(&*rule).len() as u32, SIDE * SIDE);
    // Now the error is in 0..4 alone: 4..32 is without, and goes. 0..4 is split along y, and stays.
    let far_left = plane(|x, _| if x < 4 { 0.4 } else { 0.0 });
    rule.update(&far_left);
    assert!(active_pixels(&*rule).iter().all(|&(x, _)| x < 4));
    assert_eq!(active_pixels(&*rule).len() as u32, 4 * SIDE);
    assert!(!rule.is_complete());
    // Above 256 times the target a block is not split: with a feature in it, it stays whole.
    rule.update(&plane(|_, _| 2000.0));
    rule.update(&plane(|x, y| if (x, y) == (0, 0) { 2000.0 } else { 0.0 }));
    assert!(is_active(&*rule, 3, 15), "blocks 0..4 by 0..16 was not split while its error was that large");
    rule.update(&plane(|_, _| 0.0));
    assert!(rule.is_complete());
}

/// The difference from the talk's tree: what has stopped never goes on, whatever is found.
#[test]
fn tile_and_dammertz_never_reopen_and_the_tree_does() {
    let quiet_below = plane(|_, y| if y < 9 { 0.5 } else { 0.0 });
    let loud_below = plane(|_, y| if y < 9 { 0.5 } else { 5.0 });
    for (policy, reopens) in [(Policy::Tile, false), (Policy::Dammertz, false), (Policy::Talk, true)] {
        let mut rule = rule(policy, 0.02);
        let masks = |rule: &dyn StoppingRule| (0..grid().tiles()).map(|t| rule.active(t)).collect::<Vec<_>>();
        (0..12).for_each(|_| rule.update(&quiet_below));
        let before = masks(&*rule);
        assert!(before.contains(&0), "{policy:?}: nothing has stopped");
        let mut reopened = 0;
        for _ in 0..12 {
            rule.update(&loud_below);
            let newly =
                masks(&*rule).iter().zip(&before).map(|(now, before)| now & !before).collect::<Vec<_>>();
            reopened += newly.iter().map(|&mask| active_mask::pixels(mask).count()).sum::<usize>();
        }
        assert_eq!(reopened > 0, reopens, "{policy:?}: {reopened} pixels");
    }
}
