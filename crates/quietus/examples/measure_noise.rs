//! Measures the noise of a picture of uniform random numbers.
//!
//! ```sh
//! cargo run --release -p quietus --example measure_noise
//! ```

use quietus::noise::{Effort, Finished, FreshMean, Noise, displayed, estimate, pick};

/// Samples are around a grey of 50 %.
fn trace(pixel: usize, stream: u32, index: u32) -> [f32; 3] {
    let seed = (pixel as u64) << 40 ^ u64::from(stream) << 32 ^ u64::from(index);
    [random(seed) as f32; 3]
}

/// A number in 0..1 for every index.
fn random(index: u64) -> f64 {
    let hash = index.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let hash = (hash ^ hash >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    ((hash ^ hash >> 27).wrapping_mul(0x94d0_49bb_1331_11eb) >> 11) as f64 / (1_u64 << 53) as f64
}

/// The noise as it is measured, and as it is in truth, which no renderer knows but a toy.
fn measured() -> (Noise, f64) {
    // A film of 64x48 pixels, row by row, with 32 samples in each of the two halves of each pixel.
    let mean = |pixel, stream| FreshMean::of(32, |index| trace(pixel, stream, index)).whole;
    let halves: Vec<_> = (0..64 * 48).map(|pixel| [mean(pixel, 0), mean(pixel, 1)]).collect();
    let means: Vec<_> = halves.iter().map(|[a, b]| [0, 1, 2].map(|c| 0.5 * (a[c] + b[c]))).collect();
    let counts = vec![64; 64 * 48];
    // Which pixels to draw again; `random` is a number in 0..1 for every index.
    let picks = pick(&Finished::new(64, &halves, &means, &counts), Effort::REPORT, random);
    // Random numbers that neither the film nor another pick of the same pixel has used.
    let again = |pixel, stream, samples| FreshMean::of(samples, |index| trace(pixel, stream, index));
    let fresh: Vec<_> =
        picks.iter().map(|p| [0, 1].map(|i| again(p.pixel, 2 + 2 * p.repeat + i, p.samples))).collect();
    let squares = means.iter().map(|mean| (displayed(mean[0]) - displayed(0.5)).powi(2));
    (estimate(&means, &picks, &fresh), (squares.sum::<f64>() / means.len() as f64).sqrt())
}

fn main() {
    let (Noise { reached, low, high }, truth) = measured();
    let [reached, low, high, truth] = [reached, low, high, truth].map(|share| 100.0 * share);
    println!("noise {reached:.2} % of white (95 % interval {low:.2}-{high:.2}), in truth {truth:.2} %");
}

/// Fixed random numbers: the same on every machine.
#[test]
fn the_interval_holds_the_true_error() {
    let (noise, truth) = measured();
    assert!((noise.low..=noise.high).contains(&truth), "{noise:?}, in truth {truth}");
}
