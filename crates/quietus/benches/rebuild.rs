//! Time to rebuild one quadrant's tree on one thread, the talk's way and ours, at film and 4K resolution, with
//! error fields as they are early, in the middle of, and late in a render.
//!
//! Node counts are printed before the timings: `cargo bench -p quietus --bench rebuild`.

use cpu_time::ThreadTime;
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use quietus::{
    ErrorPlane, PixelError, Regions, TileGrid,
    policy::{Policy, Rebuild, RuleSettings, StoppingRule},
};

/// Noise like a path tracer's: smooth brightness, an edge-like band of high error, a hash for the spread.
fn error(x: u32, y: u32, scale: f32) -> PixelError {
    let mut z = u64::from(x) << 32 | u64::from(y);
    z = (z ^ (z >> 30)).wrapping_add(0x9e3779b97f4a7c15).wrapping_mul(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d049bb133111eb);
    let noise = ((z >> 40) as f32 + 0.5) / (1 << 24) as f32;
    let (u, v) = (x as f32 / 700.0, y as f32 / 500.0);
    let band = (-40.0 * (u.sin() - v).powi(2)).exp();
    let caustic = (-((u - 1.2).powi(2) + (v - 1.0).powi(2)) * 60.0).exp();
    PixelError::from_f32(scale * (0.15 + band + 6.0 * caustic) * -noise.ln())
}

fn rule(width: u32, height: u32, scale: f32, rebuild: Rebuild) -> (Box<dyn StoppingRule>, ErrorPlane) {
    let grid = TileGrid::new(width, height);
    let plane = ErrorPlane::new(grid);
    for tile in 0..grid.tiles() {
        let rect = grid.tile_rect(tile);
        plane.store_tile(
            tile,
            &std::array::from_fn(|i| error(rect.x0 + i as u32 % 8, rect.y0 + i as u32 / 8, scale)),
        );
    }
    let settings = RuleSettings {
        regions: Regions::new(grid, 2),
        target_error: 2e-4,
        frame_area: f64::from(width) * f64::from(height),
        rebuild,
        counts: quietus::Settings::new(width, height).pass_counts(),
    };
    (Policy::Quietus.rule(&settings, 0), plane)
}

/// Stages of a render, and the scale of its errors in each.
const STAGES: [(&str, f32); 5] =
    [("early", 1.0), ("worst", 0.25), ("mid", 0.15), ("late", 0.04), ("done", 0.000_2)];

/// The share of the quadrant's pixels that are active.
fn active_share(rule: &dyn StoppingRule, width: u32, height: u32) -> f64 {
    let regions = Regions::new(TileGrid::new(width, height), 2);
    let active: u32 = regions.home_tiles(0).map(|tile| rule.active(tile).count_ones()).sum();
    f64::from(active) / regions.home_rect(0).area() as f64
}

fn rebuild(criterion: &mut Criterion) {
    for (width, height) in [(2048, 858), (3840, 2160)] {
        let mut group = criterion.benchmark_group(format!("rebuild {width}x{height}"));
        group.sample_size(10);
        // As errors fall: too noisy to split at all; a third of the pixels active; a few percent; none. The most
        // nodes are those just after the first: `worst`.
        for (stage, scale) in STAGES {
            for (name, way) in [("resummed", Rebuild::Resummed), ("summed-area", Rebuild::SummedArea)] {
                let (mut rule, plane) = rule(width, height, scale, way);
                rule.update(&plane);
                let nodes = rule.tree().map_or(0, |tree| tree.nodes().len());
                let share = 100.0 * active_share(&*rule, width, height);
                eprintln!("{width}x{height} {stage} {name}: {nodes} nodes, {share:.1} % of pixels active");
                group.bench_function(BenchmarkId::new(name, stage), |b| {
                    b.iter_custom(|iterations| {
                        // Time of this thread, not of the clock on the wall: other work on the machine counts less.
                        let start = ThreadTime::now();
                        (0..iterations).for_each(|_| rule.update(&plane));
                        start.elapsed()
                    })
                });
            }
        }
    }
}

criterion_group!(benches, rebuild);
criterion_main!(benches);
