//! Policy `unbiased`: a pixel's count does not depend on its own values, and its mean is unbiased.
//!
//! The first is the premise of the proof in `docs/method-unbiased.md`, and exact. The second is what follows; it is
//! tested at a significance of 1e-6 for two tests, 5e-7 each by Sidak's correction: |t| stays below 5.03 for as many
//! runs as there are here.

use proptest::prelude::*;
use quietus::{
    AdaptiveSampling, Mode, PixelError, Policy, Regions, ReplicateMean, Settings, SettingsError, TILE_PIXELS,
    TileGrid,
};

/// A scene: the value of sample `index` of a replicate of pixel (x, y).
type Scene<'a> = &'a dyn Fn(u32, u32, u8, u32) -> f32;

/// What a toy render led to, row by row.
struct Toy {
    counts: Vec<u32>,
    means: Vec<f64>,
}

fn render(settings: &Settings, scene: Scene<'_>) -> Toy {
    let sampling = AdaptiveSampling::new(settings.clone()).unwrap();
    let (width, pixels) = (settings.width as usize, (settings.width * settings.height) as usize);
    // Sum and accepted samples of the two replicates.
    let mut film = vec![[(0.0_f64, 0_u32); 2]; pixels];
    let mut worker = sampling.worker();
    while let Some(visit) = worker.next_visit() {
        let mut errors = [PixelError::REJECTED; TILE_PIXELS];
        for work in visit.pixels() {
            let pixel = &mut film[work.y as usize * width + work.x as usize];
            for index in work.samples {
                let value = scene(work.x, work.y, work.replicate, index);
                if value.is_finite() {
                    let (sum, count) = &mut pixel[usize::from(work.replicate)];
                    (*sum, *count) = (*sum + f64::from(value), *count + 1);
                }
            }
            errors[usize::from(work.pixel)] = pixel_error(settings.policy, pixel);
        }
        visit.finish(&errors);
    }
    assert!(sampling.is_finished());
    let grid = *sampling.grid();
    let count = |i: usize| {
        let (x, y) = (i as u32 % settings.width, i as u32 / settings.width);
        sampling.counts().pixel(grid.tile_at(x, y), (y % 8 * 8 + x % 8) as u8)
    };
    let mean = |halves: &[(f64, u32); 2]| (halves[0].0 + halves[1].0) / f64::from(halves[0].1 + halves[1].1);
    Toy { counts: (0..pixels).map(count).collect(), means: film.iter().map(mean).collect() }
}

fn pixel_error(policy: Policy, halves: &[(f64, u32); 2]) -> PixelError {
    let channels = halves.map(|(sum, count)| [(sum / f64::from(count.max(1))) as f32; 3]);
    let means = [0, 1].map(|r| ReplicateMean { count: halves[r].1, channels: &channels[r] });
    policy.metric().pixel_error(&means)
}

/// Uniform in (0, 1) from the coordinates of a sample: SplitMix (Steele, Lea and Flood 2014) over their words.
fn uniform(seed: u64, x: u32, y: u32, replicate: u8, index: u32) -> f64 {
    let words = [seed, u64::from(x) << 32 | u64::from(y), u64::from(replicate) << 32 | u64::from(index)];
    let hash = words.iter().fold(0_u64, |hash, word| {
        let mut z = (hash ^ word).wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    });
    ((hash >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
}

/// Skewed noise of mean 1 that grows to the right: sixteenth powers, as bright rare paths have it, mixed with 1.
fn skewed(seed: u64, width: u32) -> impl Fn(u32, u32, u8, u32) -> f32 {
    move |x, y, replicate, index| {
        let share = f64::from(x + 1) / f64::from(width);
        let rare = 17.0 * uniform(seed, x, y, replicate, index).powi(16);
        ((1.0 - share) + share * rare) as f32
    }
}

fn settings(policy: Policy, width: u32, height: u32) -> Settings {
    Settings { policy, target_error: 0.1, max_samples: 200, ..Settings::new(width, height) }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Whatever values a pixel has, also rejected ones, its count is the same: the premise of the proof.
    #[test]
    fn the_count_of_a_pixel_ignores_its_own_values(
        w in 2u32..40, h in 2u32..40, place: prop::sample::Index, seed: u64, lag in 1u32..3,
        exponent in -2.0f64..0.0, value in prop::sample::select(vec![0.0f32, 1e-3, 1.0, 1e6, f32::NAN]),
    ) {
        let settings = Settings {
            target_error: 10f64.powf(exponent),
            mode: Mode::Deterministic { lag },
            ..settings(Policy::Unbiased, w, h)
        };
        let pixel = place.index((w * h) as usize);
        let own = (pixel as u32 % w, pixel as u32 / w);
        let scene = skewed(seed, w);
        let plain = render(&settings, &scene);
        let changed = render(&settings, &|x, y, r, i| {
            // Halves differ, so that the pixel's own error is as large as its value.
            if (x, y) == own { value * f32::from(u8::from((r == 0) == (i % 3 == 0))) } else { scene(x, y, r, i) }
        });
        prop_assert_eq!(plain.counts[pixel], changed.counts[pixel]);
    }
}

/// The test above is able to fail: neighbours do look, of both colours, and under another policy the pixel itself does.
#[test]
fn neighbours_look() {
    let looks = |policy: Policy| {
        let settings = settings(policy, 24, 24);
        let scene = skewed(1, 24);
        let plain = render(&settings, &scene);
        let changed = render(&settings, &|x, y, r, i| {
            if (x, y) == (5, 5) { 1e3 * f32::from(r) } else { scene(x, y, r, i) }
        });
        let differ =
            |x: u32, y: u32| plain.counts[(y * 24 + x) as usize] != changed.counts[(y * 24 + x) as usize];
        let beside = differ(5, 6) || differ(6, 5) || differ(4, 5) || differ(5, 4);
        let across = differ(6, 6) || differ(6, 4) || differ(4, 6) || differ(4, 4);
        (differ(5, 5), beside, across)
    };
    assert_eq!(looks(Policy::Unbiased), (false, true, true));
    assert!(looks(Policy::Quietus).0);
}

/// Student's t of the mean bias of a policy over runs with different seeds.
fn t_of_bias(policy: Policy, target_error: f64) -> f64 {
    let settings = Settings { target_error, ..settings(policy, 24, 16) };
    let runs: Vec<f64> = (0..400)
        .map(|seed| {
            let toy = render(&settings, &skewed(seed, 24));
            toy.means.iter().map(|mean| mean - 1.0).sum::<f64>() / toy.means.len() as f64
        })
        .collect();
    let n = runs.len() as f64;
    let mean = runs.iter().sum::<f64>() / n;
    let variance = runs.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    mean / (variance / n).sqrt()
}

#[test]
fn means_of_skewed_noise_are_unbiased() {
    let t = t_of_bias(Policy::Unbiased, 0.05);
    assert!(t.abs() < 5.03, "{t}");
}

/// What is tested can be seen: the same runs, stopped by their own values, are darker than the truth.
#[test]
fn stopping_by_own_values_is_not() {
    let t = t_of_bias(Policy::Pixel, 0.03);
    assert!(t < -5.03, "{t}");
}

/// Counts are in proportion to the noise: with noise proportional to x + 1 in columns far wider than the widest
/// window, counts rise from left to right, and a wholly quiet region stops at its least count.
#[test]
fn counts_follow_the_noise() {
    let settings = Settings { target_error: 0.05, max_samples: 4096, ..settings(Policy::Unbiased, 96, 32) };
    let toy = render(&settings, &skewed(7, 96));
    let column = |x0: u32, x1: u32| {
        let counts =
            (0..32 * 96).filter(|i| (x0..x1).contains(&(i % 96))).map(|i| f64::from(toy.counts[i as usize]));
        counts.sum::<f64>() / f64::from((x1 - x0) * 32)
    };
    let thirds = [column(0, 32), column(32, 64), column(64, 96)];
    assert!(thirds[0] < thirds[1] && thirds[1] < thirds[2], "{thirds:?}");
    let quiet = render(&settings, &|_, _, _, _| 0.25);
    let least = settings.pass_counts().after(settings.pass_counts().min_passes() + 1);
    assert!(quiet.counts.iter().all(|&count| count == least), "{least}: {:?}", quiet.counts);
}

/// A region without other pixels knows nothing: it draws the maximum.
#[test]
fn a_lone_pixel_gets_the_maximum() {
    let toy = render(&settings(Policy::Unbiased, 1, 1), &|_, _, _, _| 0.5);
    assert_eq!(toy.counts, [200]);
    assert_eq!(Regions::new(TileGrid::new(1, 1), 2).len(), 1);
}

#[test]
fn free_running_is_refused() {
    let settings = Settings { mode: Mode::FreeRunning, ..settings(Policy::Unbiased, 8, 8) };
    let refused = AdaptiveSampling::new(settings).err();
    assert_eq!(refused, Some(SettingsError::NoOrder(Policy::Unbiased)));
}
