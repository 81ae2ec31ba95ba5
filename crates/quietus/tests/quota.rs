//! Properties of the quotas that the library's own policy deals: what its tree says of each leaf, which pixels it
//! draws, and what becomes of noise that is known.

use proptest::prelude::*;
use quietus::{
    Area, ErrorPlane, PixelError, PixelRect, RegionTree, Regions, Settings, TILE_PIXELS, TileGrid,
    policy::{CREDIBLE_SAMPLES, Policy, Rebuild, RuleSettings, StoppingRule},
    region_tree::MIN_SIDE,
};

/// A hash that stands for noise (SplitMix64's finaliser).
fn hash(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d049bb133111eb);
    z ^ (z >> 31)
}

/// A plane of noise and numbers of samples, by pixel.
fn plane(grid: TileGrid, pixel: impl Fn(u32, u32) -> (f32, u32)) -> ErrorPlane {
    let plane = ErrorPlane::new(grid);
    for tile in 0..grid.tiles() {
        let rect = grid.tile_rect(tile);
        let pixels: [(PixelError, u32); TILE_PIXELS] = std::array::from_fn(|i| {
            let (x, y) = (rect.x0 + i as u32 % 8, rect.y0 + i as u32 / 8);
            let (noise, samples) = if rect.contains(x, y) { pixel(x, y) } else { (0.0, 0) };
            (PixelError::from_f32(noise), samples)
        });
        plane.store_tile(tile, &pixels.map(|p| p.0));
        plane.store_samples(tile, &pixels.map(|p| p.1));
    }
    plane
}

/// Noise with plateaus of none, rejected pixels and a few very large values, from 4 to 67 samples.
fn noisy(seed: u64) -> impl Fn(u32, u32) -> (f32, u32) {
    move |x, y| {
        let h = hash(seed ^ u64::from(x) << 32 ^ u64::from(y));
        let noise = match h {
            _ if hash(seed ^ u64::from(x / 20) << 40 ^ u64::from(y / 20)).is_multiple_of(4) => 0.0,
            h if h % 1013 == 0 => f32::NAN,
            h if h % 509 == 0 => 1e6,
            h => (h >> 40) as f32 / (1 << 24) as f32,
        };
        (noise, 4 + (h >> 20) as u32 % 64)
    }
}

fn rule(grid: TileGrid, per_axis: u32, target_error: f64, region: u32) -> Box<dyn StoppingRule> {
    let settings = RuleSettings {
        regions: Regions::new(grid, per_axis),
        target_error,
        frame_area: grid.rect().area() as f64,
        rebuild: Rebuild::default(),
        counts: Settings::new(grid.width(), grid.height()).pass_counts(),
    };
    Policy::Quietus.rule(&settings, region)
}

fn is_active(rule: &dyn StoppingRule, grid: &TileGrid, x: u32, y: u32) -> bool {
    rule.active(grid.tile_at(x, y)) >> (8 * (y % 8) + x % 8) & 1 == 1
}

/// Means of noise and of samples, and their numbers, pixel by pixel.
struct Pixels {
    values: Vec<(u64, u64)>,
    width: u32,
}

impl Pixels {
    fn new(plane: &ErrorPlane) -> Self {
        let (width, height) = (plane.grid().width(), plane.grid().height());
        let at = |x, y| {
            let (tile, pixel) = (plane.grid().tile_at(x, y), (8 * (y % 8) + x % 8) as usize);
            (plane.load_tile(tile)[pixel].steps(), u64::from(plane.load_samples(tile)[pixel]))
        };
        Self { values: (0..height).flat_map(|y| (0..width).map(move |x| at(x, y))).collect(), width }
    }

    /// Mean noise of the pixels of a node, and the samples they hold.
    fn of(&self, area: &Area) -> (f64, f64) {
        let PixelRect { x0, y0, x1, y1 } = area.rounded_outward();
        let pixels = (y0..y1).flat_map(|y| (x0..x1).map(move |x| self.values[(y * self.width + x) as usize]));
        let (count, noise, samples) = pixels.fold((0, 0, 0), |sum, p| (sum.0 + 1, sum.1 + p.0, sum.2 + p.1));
        let step = f64::from(1 << PixelError::FRACTION_BITS);
        (noise as f64 / f64::from(count) / step, samples as f64)
    }
}

/// The quota of noise V at a target error, in a frame of `pixels`: 64 samples where a region of 3x3 pixels of error
/// `sqrt(V / 64)` has the target error.
fn quota(noise: f64, target: f64, pixels: f64) -> f64 {
    8.0 * noise.sqrt() / (target * (pixels / 9.0).sqrt())
}

/// Checks the nodes below `index` by the definition of credibility, and collects the quotas of leaves.
fn check(
    tree: &RegionTree,
    index: u32,
    inherited: Option<f64>,
    credible: f64,
    pixels: &Pixels,
    leaves: &mut Vec<(Area, f64)>,
) {
    let node = &tree.nodes()[index as usize];
    let (own, held) = pixels.of(&node.area);
    let z = held / (held + credible);
    let mixed = inherited.map_or(own, |inherited| z * own + (1.0 - z) * inherited);
    assert_eq!(node.error, mixed);
    assert_eq!(node.children.is_some(), node.area.longer_side() > 2.0 * MIN_SIDE);
    let Some(first) = node.children else { return leaves.push((node.area, mixed)) };
    for child in [first, first + 1] {
        check(tree, child, Some(mixed), credible, pixels, leaves);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Nodes are mixed as the definition says, and active are the pixels that hold less than the quotas of the leaves
    /// over them, by the part that each covers: computed here the plain way. Where the two differ by less than the
    /// rounding of a few sums in single precision, either is right.
    #[test]
    fn pixels_below_their_quota_are_active(w in 1u32..60, h in 1u32..60, seed: u64, exponent in -3.0f64..0.0) {
        let (grid, target) = (TileGrid::new(w, h), 10f64.powf(exponent));
        let plane = plane(grid, noisy(seed));
        let mut rule = rule(grid, 1, target, 0);
        rule.update(&plane);
        let mut leaves = Vec::new();
        let (pixels, tree) = (Pixels::new(&plane), rule.tree().unwrap());
        let credible = CREDIBLE_SAMPLES * pixels.of(&tree.nodes()[0].area).0;
        check(tree, 0, None, credible, &pixels, &mut leaves);
        let part = |start: f64, end: f64, pixel: u32| {
            (end.min(f64::from(pixel) + 1.0) - start.max(f64::from(pixel))).max(0.0)
        };
        let mut all_done = true;
        for y in 0..h {
            for x in 0..w {
                let covered = |area: &Area| part(area.x0, area.x1, x) * part(area.y0, area.y1, y);
                let due = |(area, noise): &(Area, f64)| covered(area) * quota(*noise, target, f64::from(w * h));
                let due: f64 = leaves.iter().map(due).sum();
                let samples = plane.load_samples(grid.tile_at(x, y))[(8 * (y % 8) + x % 8) as usize];
                let below = is_active(&*rule, &grid, x, y);
                if (due / f64::from(samples) - 1.0).abs() > 1e-5 {
                    prop_assert_eq!(below, f64::from(samples) < due, "pixel {},{}", x, y);
                }
                all_done &= !below;
            }
        }
        prop_assert_eq!(rule.is_complete(), all_done);
    }

    /// What a finished picture rests on: from the same errors and samples come the same pixels.
    #[test]
    fn unchanged_errors_change_nothing(w in 1u32..60, h in 1u32..60, seed: u64, exponent in -3.0f64..0.0) {
        let grid = TileGrid::new(w, h);
        let (first, plane) = (plane(grid, noisy(!seed)), plane(grid, noisy(seed)));
        let mut rule = rule(grid, 1, 10f64.powf(exponent), 0);
        let masks = |rule: &dyn StoppingRule| (0..grid.tiles()).map(|t| rule.active(t)).collect::<Vec<_>>();
        rule.update(&first);
        rule.update(&plane);
        let before = masks(&*rule);
        rule.update(&plane);
        prop_assert_eq!(masks(&*rule), before);
    }
}

/// Deals passes of 4 samples until nothing is active, for noise that is known exactly; counts, row by row.
fn deal(grid: TileGrid, target: f64, noise: impl Fn(u32, u32) -> f32) -> Vec<u32> {
    let mut counts = vec![12; grid.rect().area() as usize];
    let mut rule = rule(grid, 1, target, 0);
    loop {
        let at = |x: u32, y: u32| (y * grid.width() + x) as usize;
        rule.update(&plane(grid, |x, y| (noise(x, y), counts[at(x, y)])));
        if rule.is_complete() {
            return counts;
        }
        for y in 0..grid.height() {
            for x in 0..grid.width() {
                counts[at(x, y)] += 4 * u32::from(is_active(&*rule, &grid, x, y));
            }
        }
    }
}

/// Nine times the noise gets three times the samples. Between the two, leaves and what they inherit are mixed; away
/// from there counts are the first multiples of a pass that are not below 100 and 300, the quotas by hand, or the
/// next, where a trace of the other side's noise has come down.
#[test]
fn counts_are_in_proportion_to_the_root_of_the_noise() {
    let counts = deal(TileGrid::new(64, 64), 0.00375, |x, _| if x < 32 { 1.0 } else { 9.0 });
    for (i, count) in counts.into_iter().enumerate() {
        match i % 64 {
            0..16 => assert!((100..=104).contains(&count), "{i}: {count}"),
            56..64 => assert!((300..=304).contains(&count), "{i}: {count}"),
            _ => assert!((100..=304).contains(&count), "{i}: {count}"),
        }
    }
}

/// Where nothing was found in a few samples, what was found around counts; and in a large dark area the samples of
/// all its pixels together are believed.
#[test]
fn few_black_samples_are_not_believed_and_many_are() {
    // One dark pixel, and one dark half, in noise whose quota is 100.
    let grid = TileGrid::new(64, 64);
    let spot = deal(grid, 0.00375, |x, y| if (x, y) == (41, 22) { 0.0 } else { 1.0 });
    assert!(spot[22 * 64 + 41] > 64, "{}", spot[22 * 64 + 41]);
    let half = deal(grid, 0.00375, |x, _| if x < 32 { 0.0 } else { 1.0 });
    assert!((0..64).all(|y| half[y * 64] <= 16), "{:?}", half[0]);
    assert!((0..64).all(|y| (100..=104).contains(&half[y * 64 + 63])));
}

/// The point of the talk: a feature found late opens finished neighbours again.
#[test]
fn a_late_feature_reopens_finished_neighbours() {
    let grid = TileGrid::new(64, 64);
    for seed in 0..40u64 {
        let background = |x: u32, y: u32| (hash(seed << 32 | u64::from(x * 64 + y)) % 100) as f32 / 100.0;
        let finished = deal(grid, 0.00375, background);
        let feature = PixelRect::new(41, 22, 43, 24);
        let found = plane(grid, |x, y| {
            let noise = background(x, y) + if feature.contains(x, y) { 40.0 } else { 0.0 };
            (noise, finished[(y * 64 + x) as usize])
        });
        let mut rule = rule(grid, 1, 0.00375, 0);
        rule.update(&found);
        let all = (0..64).flat_map(|y| (0..64).map(move |x| (x, y)));
        let reopened =
            all.filter(|&(x, y)| !feature.contains(x, y) && is_active(&*rule, &grid, x, y)).count();
        assert!(reopened >= 12, "picture {seed}: {reopened} neighbours");
    }
}
