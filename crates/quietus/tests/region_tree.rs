//! Properties of the rebuilt tree: cover, the complete/split/active rule, fast against plain, re-opening.

use proptest::prelude::*;
use quietus::{
    ErrorPlane, PixelError, PixelRect, RegionTree, TILE_PIXELS, TileGrid,
    policy::{Policy, Rebuild, RuleSettings},
    region_error,
    region_tree::{MAX_COMPLETE_SIDE, MIN_SIDE, SPLIT_FACTOR, Split, TreeSettings},
    summed_area::{ErrorSums, Resummed, SummedArea},
};

const AWKWARD_SIZES: [(u32, u32); 6] = [(1, 1), (7, 3), (8, 8), (9, 17), (4096, 1), (1921, 1081)];

/// A hash that stands for noise (SplitMix64's finaliser).
fn hash(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d049bb133111eb);
    z ^ (z >> 31)
}

fn plane(grid: TileGrid, error: impl Fn(u32, u32) -> f32) -> ErrorPlane {
    let plane = ErrorPlane::new(grid);
    for tile in 0..grid.tiles() {
        let rect = grid.tile_rect(tile);
        let errors: [PixelError; TILE_PIXELS] = std::array::from_fn(|i| {
            let (x, y) = (rect.x0 + i as u32 % 8, rect.y0 + i as u32 / 8);
            if rect.contains(x, y) { PixelError::from_f32(error(x, y)) } else { PixelError::ZERO }
        });
        plane.store_tile(tile, &errors);
        // Policy `quietus` asks for them.
        plane.store_samples(
            tile,
            &std::array::from_fn(|i| 4 + hash(u64::from(tile) << 8 | i as u64) as u32 % 64),
        );
    }
    plane
}

/// Noise with zero plateaus, rejected pixels and a few very large errors.
fn noisy(seed: u64) -> impl Fn(u32, u32) -> f32 {
    move |x, y| match hash(seed ^ u64::from(x) << 32 ^ u64::from(y)) {
        h if hash(seed ^ u64::from(x / 20) << 40 ^ u64::from(y / 20)).is_multiple_of(4) || h % 7 == 0 => 0.0,
        h if h % 1013 == 0 => f32::NAN,
        h if h % 509 == 0 => 1e6,
        h => (h >> 40) as f32 / (1 << 24) as f32,
    }
}

fn settings(grid: &TileGrid, target_error: f64) -> TreeSettings {
    TreeSettings { target_error, frame_area: grid.rect().area() as f64, split: Split::Continuous }
}

fn trees(plane: &ErrorPlane, rect: PixelRect, settings: &TreeSettings) -> (RegionTree, RegionTree) {
    let (mut plain, mut fast) = (Resummed::default(), SummedArea::default());
    plain.load(plane, rect);
    fast.load(plane, rect);
    let (mut a, mut b) = (RegionTree::default(), RegionTree::default());
    a.rebuild(&plain, settings);
    b.rebuild(&fast, settings);
    (a, b)
}

/// Every leaf is what the rule says, children partition their parents, and the leaves cover every pixel.
fn check_tree(tree: &RegionTree, sums: &impl ErrorSums, settings: &TreeSettings) {
    let eps = settings.target_error;
    let mut covered = 0.0;
    for node in tree.nodes() {
        let error =
            region_error(sums.sum(&node.area.rounded_outward()), node.area.pixels(), settings.frame_area);
        assert_eq!(node.error, error);
        let side = node.area.longer_side();
        let complete = error < eps && side < MAX_COMPLETE_SIDE;
        let splits = !complete && error < SPLIT_FACTOR * eps && side > 2.0 * MIN_SIDE;
        assert_eq!(node.children.is_some(), splits);
        match node.children {
            None => {
                assert_eq!(node.complete, complete);
                covered += node.area.pixels();
            }
            Some(first) => {
                let [a, b] = [first, first + 1].map(|i| tree.nodes()[i as usize]);
                assert_eq!(node.complete, a.complete && b.complete);
                let axis = node.area.longer_axis();
                let cut = a.area.bounds(axis).1;
                assert_eq!(node.area.split(axis, cut), (a.area, b.area));
                for child in [a, b] {
                    let (start, end) = child.area.bounds(axis);
                    // The clamp is exact up to the rounding of the subtraction.
                    assert!(end - start >= MIN_SIDE - 1e-9, "{start}..{end}");
                }
            }
        }
    }
    let total = sums.bounds().area() as f64;
    assert!((covered - total).abs() <= 1e-9 * total, "leaves cover {covered} of {total} pixels");
}

#[test]
fn awkward_sizes_are_covered_and_follow_the_rule() {
    for (w, h) in AWKWARD_SIZES {
        let grid = TileGrid::new(w, h);
        let plane = plane(grid, noisy(1));
        for target in [1e-4, 1e-2, 1.0, 1e4] {
            let settings = settings(&grid, target);
            let (plain, fast) = trees(&plane, grid.rect(), &settings);
            assert_eq!(plain, fast, "{w}x{h} at {target}");
            let mut sums = SummedArea::default();
            sums.load(&plane, grid.rect());
            check_tree(&fast, &sums, &settings);
        }
    }
}

#[test]
fn quiet_picture_completes_and_a_loud_one_stays_one_active_leaf() {
    let grid = TileGrid::new(100, 60);
    let (tree, _) = trees(&plane(grid, |_, _| 0.0), grid.rect(), &settings(&grid, 1e-6));
    assert!(tree.is_complete());
    assert!(tree.leaves().all(|leaf| leaf.area.longer_side() < MAX_COMPLETE_SIDE));
    assert!((0..grid.tiles()).all(|tile| tree.active(&grid.tile_rect(tile)) == 0));

    let (tree, _) = trees(&plane(grid, |_, _| 1.0), grid.rect(), &settings(&grid, 1e-6));
    assert_eq!(tree.nodes().len(), 1);
    assert!((0..grid.tiles()).all(|tile| tree.active(&grid.tile_rect(tile)) == grid.full_mask(tile)));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// The fast rebuild equals the plain one bit for bit: sums, half-way points, trees, masks.
    #[test]
    fn fast_rebuild_equals_the_plain_one(
        w in 1u32..150, h in 1u32..150, seed: u64, exponent in -5.0f64..1.0, per_axis in 1u32..4,
    ) {
        let grid = TileGrid::new(w, h);
        let plane = plane(grid, noisy(seed));
        let regions = quietus::Regions::new(grid, per_axis);
        for policy in [Policy::Talk, Policy::Quietus] {
            let rule_settings = |rebuild| RuleSettings {
                regions: regions.clone(),
                target_error: 10f64.powf(exponent),
                frame_area: grid.rect().area() as f64,
                rebuild,
                counts: quietus::Settings::new(w, h).pass_counts(),
            };
            for region in 0..regions.len() {
                let mut plain = policy.rule(&rule_settings(Rebuild::Resummed), region);
                let mut fast = policy.rule(&rule_settings(Rebuild::SummedArea), region);
                for rule in [&mut plain, &mut fast] {
                    prop_assert!(regions.home_tiles(region).all(|t| rule.active(t) == grid.full_mask(t)));
                    rule.update(&plane);
                }
                prop_assert_eq!(plain.tree(), fast.tree());
                prop_assert_eq!(plain.is_complete(), fast.is_complete());
                for tile in regions.home_tiles(region) {
                    prop_assert_eq!(plain.active(tile), fast.active(tile));
                    prop_assert_eq!(plain.active(tile) & !grid.full_mask(tile), 0);
                }
            }
        }
    }

    /// A pixel is active exactly where an incomplete leaf's outward-rounded bounds cover it.
    #[test]
    fn masks_are_the_pixels_of_incomplete_leaves(w in 1u32..60, h in 1u32..60, seed: u64) {
        let grid = TileGrid::new(w, h);
        let plane = plane(grid, noisy(seed));
        let (tree, _) = trees(&plane, grid.rect(), &settings(&grid, 0.02));
        for y in 0..h {
            for x in 0..w {
                let expected =
                    tree.leaves().any(|leaf| !leaf.complete && leaf.area.rounded_outward().contains(x, y));
                let active = tree.active(&grid.tile_rect(grid.tile_at(x, y))) >> (8 * (y % 8) + x % 8) & 1 == 1;
                prop_assert_eq!(active, expected, "pixel {},{}", x, y);
            }
        }
    }
}

/// Pixels that were inactive, whose errors did not change, and that are active after the feature was found.
fn reopened(before: &ErrorPlane, after: &ErrorPlane, feature: &PixelRect, settings: &TreeSettings) -> usize {
    let grid = *before.grid();
    let (first, _) = trees(before, grid.rect(), settings);
    let (second, _) = trees(after, grid.rect(), settings);
    let active = |tree: &RegionTree, x, y| {
        tree.active(&grid.tile_rect(grid.tile_at(x, y))) >> (8 * (y % 8) + x % 8) & 1 == 1
    };
    (0..grid.height())
        .flat_map(|y| (0..grid.width()).map(move |x| (x, y)))
        .filter(|&(x, y)| !feature.contains(x, y) && !active(&first, x, y) && active(&second, x, y))
        .count()
}

/// The point of the talk: a feature found late pulls the split lines towards itself and re-opens its finished
/// neighbours. The feature is faint, as it is when its first path has just been found: lines in floating point
/// move for it in each of 40 pictures, lines on whole pixels in none.
#[test]
fn late_feature_reopens_finished_neighbours_with_splits_in_floating_point_only() {
    let grid = TileGrid::new(64, 64);
    let feature = PixelRect::new(41, 22, 43, 24);
    for seed in 0..40u64 {
        let background = |x: u32, y: u32| 0.0002 * (hash(seed << 32 | u64::from(x * 64 + y)) % 100) as f32;
        let with_feature =
            |x: u32, y: u32| background(x, y) + if feature.contains(x, y) { 0.03 } else { 0.0 };
        let (before, after) = (plane(grid, background), plane(grid, with_feature));
        let continuous = settings(&grid, 0.001);
        let integer = TreeSettings { split: Split::Integer, ..continuous };
        assert!(reopened(&before, &after, &feature, &continuous) > 0, "picture {seed}");
        assert_eq!(reopened(&before, &after, &feature, &integer), 0, "picture {seed}");
    }
}
