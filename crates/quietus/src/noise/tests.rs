//! The measurement on pictures whose truth is known.

use super::*;

/// SplitMix (Steele, Lea and Flood 2014), in 0..1.
fn random(seed: u64) -> impl Fn(u64) -> f64 {
    move |index| {
        let mut z = (seed << 32 ^ index).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// A picture of 32x32 pixels of 0.25 whose right half has noise: values of `sigma` times a sum of uniform numbers.
fn value(random: &impl Fn(u64) -> f64, pixel: usize, stream: u64, sigma: f32) -> [f32; 3] {
    let scale = if pixel % 32 < 16 { 0.0 } else { sigma };
    let normal = (0..12).map(|i| random((pixel as u64 * 64 + stream) * 12 + i)).sum::<f64>() - 6.0;
    [0.25 + scale * normal as f32; 3]
}

/// A replicate that is too short to be cut in two.
fn whole(mean: [f32; 3]) -> FreshMean {
    FreshMean { whole: mean, halves: [mean; 2] }
}

#[test]
fn halves_take_off_the_bend_of_the_display() {
    // Paths that one in four samples meets: means of 8 samples are displayed darker than the truth.
    let random = random(3);
    let (mut plain, mut corrected) = (0.0, 0.0);
    for replicate in 0..4096 {
        let hits = |half: u64| (0..4).filter(|i| random(8 * replicate + 4 * half + i) < 0.25).count() as f32;
        let halves = [0, 1].map(|half| [hits(half) / 4.0; 3]);
        let fresh = FreshMean { whole: [0.5 * (halves[0][0] + halves[1][0]); 3], halves };
        plain += displayed(fresh.whole[0]) / 4096.0;
        corrected += fresh.displayed(0) / 4096.0;
    }
    // From binomial distributions of 8 and of 4, where the truth is 0.5: 0.4604 and 2 * 0.4604 - 0.4046, to five standard
    // errors of no more than 0.004.
    assert!((plain - 0.4604).abs() < 0.02, "{plain}");
    assert!((corrected - 0.5162).abs() < 0.02, "{corrected}");
}

#[test]
fn what_was_not_seen_widens_the_upper_end_alone() {
    let mut values = vec![1.0; 1000];
    let noise = estimate_squares(&values);
    // None is larger than any other.
    assert_eq!(noise.high, 1.0);
    // Pareto of index 2: by as much as the largest again, on average.
    values = (1..=1000).map(|rank| (f64::from(rank) / 1000.0).powf(-0.5)).collect();
    let excess = unseen(&values) * 1000.0 / values[0];
    assert!((excess - 1.0).abs() < 0.2, "{excess}");
    let noise = estimate_squares(&values);
    assert!(noise.high / noise.reached > noise.reached / noise.low, "{noise:?}");
    assert_eq!(unseen(&[0.0; 100]), 0.0);
}

#[test]
fn a_mean_that_is_hardly_known_has_an_end() {
    // Of what is as often below 0 as above: ends go on from where they were, as the mean comes near 0.
    let high = |offset: f64| {
        let values: Vec<f64> = (0..100).map(|i| offset + f64::from(i % 2) - 0.5).collect();
        estimate_squares(&values).high
    };
    let highs: Vec<f64> = (0..200).map(|step| high(0.2 * 0.9_f64.powi(step))).collect();
    assert!(
        highs.windows(2).all(|pair| pair[1] < pair[0] * (1.0 + 1e-9) && pair[1] > 0.9 * pair[0]),
        "{highs:?}"
    );
}

/// Of 200 pictures the intervals cover the truth in 180 to 199: of a binomial distribution of 95 % no more than
/// 3e-4 lies beyond either end.
#[test]
fn intervals_cover_the_true_error() {
    let (mut covered, mut ratio) = (0, 0.0);
    for seed in 0..200 {
        let random = random(seed);
        // Halves that agree too well, as where sampling stops when they do: only picks suffer.
        let halves: Vec<_> =
            (0..1024).map(|p| [value(&random, p, 0, 0.004), value(&random, p, 1, 0.004)]).collect();
        let means: Vec<_> = (0..1024).map(|p| value(&random, p, 2, 0.01)).collect();
        let picture = Finished {
            width: 32,
            halves: &halves,
            means: &means,
            counts: &[64; 1024],
            weights: None,
            aovs: None,
        };
        let picks = pick(&picture, Effort { share: 0.2501, picks: 0, most_share: 0.0 }, &random);
        // As many samples each as the pixel has, and a little for rounding.
        assert_eq!(picks.len(), 256);
        let fresh: Vec<_> = picks
            .iter()
            .map(|p| [0, 1].map(|i| whole(value(&random, p.pixel, 4 + 2 * u64::from(p.repeat) + i, 0.014))))
            .collect();
        let noise = estimate(&means, &picks, &fresh);
        let truth: f64 = means.iter().map(|m| (displayed(m[0]) - 0.5).powi(2)).sum::<f64>() / 1024.0;
        covered += u32::from((noise.low..noise.high).contains(&truth.sqrt()));
        ratio += noise.reached / truth.sqrt() / 200.0;
    }
    assert!((180..200).contains(&covered), "{covered}");
    assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
}

#[test]
fn picks_go_where_halves_differ_and_everywhere() {
    let random = random(9);
    let halves: Vec<_> =
        (0..1024).map(|p| [value(&random, p, 0, 0.01), value(&random, p, 1, 0.01)]).collect();
    let means: Vec<_> = halves.iter().map(|h| h[0]).collect();
    let picture = Finished {
        width: 32,
        halves: &halves,
        means: &means,
        counts: &[10; 1024],
        weights: None,
        aovs: None,
    };
    let picks = pick(&picture, Effort { share: 0.0, picks: 400, most_share: 1.0 }, &random);
    let left = picks.iter().filter(|p| p.pixel % 32 < 14).count();
    assert_eq!(picks.len(), 400);
    // A quarter of all picks is spread over all columns, 14 of 32 of them are left: 44, and a few more or less.
    assert!((30..60).contains(&left), "{left}");
    assert!(picks.iter().all(|p| p.weight <= 1.0 / (1.0 - GUIDED) + 1e-9 && p.samples == 5));
    assert!(picks.windows(2).all(|p| p[0].pixel < p[1].pixel || p[1].repeat == p[0].repeat + 1));
}

#[test]
fn a_picture_without_noise_has_none() {
    let (halves, means) = (vec![[[0.5; 3]; 2]; 64], vec![[0.5; 3]; 64]);
    let picture =
        Finished { width: 8, halves: &halves, means: &means, counts: &[16; 64], weights: None, aovs: None };
    let picks = pick(&picture, Effort::REPORT, random(1));
    let noise = estimate(&means, &picks, &vec![[whole([0.5; 3]); 2]; picks.len()]);
    assert_eq!(noise, Noise { reached: 0.0, low: 0.0, high: 0.0 });
}
