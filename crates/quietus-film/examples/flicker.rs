//! How much frames flicker: a still picture, drawn again and again with other seeds, or a moving one, against references of
//! its frames, so that what really changes does not count:
//!
//! ```sh
//! cargo run --release -p quietus-film --example flicker -- 1.exr 2.exr 3.exr
//! cargo run --release -p quietus-film --example flicker -- 1.exr 2.exr 3.exr --truth r1.exr r2.exr r3.exr
//! ```
//!
//! Prints, in percent of white as displayed (with a gamma of 2): the noise that the differences between frames amount to,
//! over all pixels and channels, and how far the means of blocks of 8x8 pixels jump from frame to frame: the eye sees a block
//! that jumps, where single pixels only seethe.

use std::path::Path;
use std::process::ExitCode;

use quietus_film::{Picture, read_exr};

/// Side of a block.
const BLOCK: usize = 8;

fn main() -> ExitCode {
    let (mut frames, mut truth, mut is_truth) = (Vec::new(), Vec::new(), false);
    for path in std::env::args().skip(1) {
        if path == "--truth" {
            is_truth = true;
            continue;
        }
        match read_exr(Path::new(&path)) {
            Ok((picture, _)) if is_truth => truth.push(picture),
            Ok((picture, _)) => frames.push(picture),
            Err(error) => {
                eprintln!("error: {error}");
                return ExitCode::FAILURE;
            }
        }
    }
    let window = frames.first().map(|frame| frame.window);
    let same_size = frames.iter().chain(&truth).all(|picture| Some(picture.window) == window);
    if frames.len() < 2 || !same_size || !(truth.is_empty() || truth.len() == frames.len()) {
        eprintln!("error: expected at least two EXR pictures of one size, and as many references or none");
        return ExitCode::FAILURE;
    }
    let (mut square, mut count, mut jumps) = (0.0, 0, Vec::new());
    for i in 1..frames.len() {
        let mut difference = difference(&frames[i - 1], &frames[i]);
        if !truth.is_empty() {
            let moved = self::difference(&truth[i - 1], &truth[i]);
            for (found, true_one) in difference.iter_mut().flatten().zip(moved.iter().flatten()) {
                *found -= true_one;
            }
        }
        square += difference.iter().flatten().map(|d| d * d).sum::<f64>();
        count += 3 * difference.len();
        jumps.extend(blocks(&difference, frames[i].window.width() as usize));
    }
    jumps.sort_by(f64::total_cmp);
    let at = |share: f64| 100.0 * jumps[((jumps.len() - 1) as f64 * share) as usize];
    // The difference of two independent frames has twice the variance of one.
    println!("noise           {:.3} % of white", 100.0 * (square / count as f64 / 2.0).sqrt());
    println!(
        "jumps of blocks {:.3} % median, {:.3} % at 99.9 %, {:.3} % at most",
        at(0.5),
        at(0.999),
        at(1.0)
    );
    ExitCode::SUCCESS
}

/// How far each pixel goes from one picture to the next.
fn difference(from: &Picture, to: &Picture) -> Vec<[f64; 3]> {
    let displayed = |value: f32| f64::from(value).clamp(0.0, 1.0).sqrt();
    let pixel = |(a, b): (&[f32; 4], &[f32; 4])| [0, 1, 2].map(|i| displayed(b[i]) - displayed(a[i]));
    from.beauty.iter().zip(&to.beauty).map(pixel).collect()
}

/// How far the mean of each whole block goes: the largest of its channels.
fn blocks(difference: &[[f64; 3]], width: usize) -> Vec<f64> {
    let height = difference.len() / width;
    let mut jumps = Vec::new();
    for top in (0..height / BLOCK * BLOCK).step_by(BLOCK) {
        for left in (0..width / BLOCK * BLOCK).step_by(BLOCK) {
            let places = || (0..BLOCK * BLOCK).map(|i| (top + i / BLOCK) * width + left + i % BLOCK);
            let mean = |c: usize| places().map(|p| difference[p][c]).sum::<f64>() / (BLOCK * BLOCK) as f64;
            jumps.push((0..3).map(|c| mean(c).abs()).fold(0.0, f64::max));
        }
    }
    jumps
}
