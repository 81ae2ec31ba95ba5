//! Figure 1 of the talk: box artefacts of tiles that stop on their own, and what the tree makes of them.

use std::path::Path;

use anyhow::{Context, Result};
use image::{Rgb, RgbImage};
use quietus_film::{Picture, read_exr, srgb8};

use super::artefacts::artefacts;
use crate::run::{Quietus, number, root};

const SIZE: &str = "384x384";
/// Samples per pixel at which the policies meet.
const MEAN_SAMPLES: f64 = 48.0;
const POLICIES: [&str; 6] = ["uniform", "tile", "dammertz", "pixel", "talk", "quietus"];
/// Seeds over which the numbers are averaged; the pictures show the first.
const SEEDS: [&str; 4] = ["1", "2", "3", "4"];

/// Draws the embedded scene with each policy at the same mean number of samples, prints how far each is from a
/// reference and how much its errors keep to tiles, and saves pictures and sample maps side by side.
pub(super) fn figure1(quietus: &Quietus) -> Result<()> {
    let reference = reference(quietus)?;
    let mut panels = Vec::new();
    println!("| policy | target error | spp | display RMSE | block ratio | edge ratio | worst tile |");
    println!("|---|---|---|---|---|---|---|");
    for policy in POLICIES {
        let target = if policy == "uniform" { String::new() } else { matching_target(quietus, policy)? };
        let mut sums = [0.0; 5];
        for seed in SEEDS {
            let spp = render(quietus, policy, &target, seed)?;
            let (picture, _) = read_exr(&quietus.picture())?;
            let a = artefacts(&picture, &reference);
            for (sum, value) in sums.iter_mut().zip([spp, a.mse, a.block_ratio, a.edge_ratio, a.worst_tile]) {
                *sum += value / SEEDS.len() as f64;
            }
            if seed == SEEDS[0] && ["tile", "quietus"].contains(&policy) {
                panels.push(picture);
            }
        }
        let [spp, mse, block, edge, worst] = sums;
        let rmse = 100.0 * mse.sqrt();
        println!(
            "| {policy} | {target} | {spp:.1} | {rmse:.3} % | {block:.3} | {edge:.3} | {:.2} % |",
            100.0 * worst
        );
    }
    save(&panels, &root().join("docs/gallery/figure1.png"))
}

/// Renders once and returns the mean samples per pixel.
fn render(quietus: &Quietus, policy: &str, target: &str, seed: &str) -> Result<f64> {
    let mut words = vec!["--size", SIZE, "--sampling", policy, "--seed", seed];
    let spp = format!("{MEAN_SAMPLES}");
    if policy == "uniform" {
        words.extend(["--spp", &spp]);
    } else {
        words.extend(["--target-error", target, "--max-samples", "4096"]);
    }
    let tree = root().join("docs/gallery/figure1-tree.svg").display().to_string();
    // That of `quietus` goes down to pixels everywhere.
    if policy == "talk" && seed == SEEDS[0] {
        words.extend(["--tree", &tree]);
    }
    number(&quietus.render(&words)?, "spp_mean")
}

/// The target error at which a policy spends [`MEAN_SAMPLES`], by bisection of its logarithm.
fn matching_target(quietus: &Quietus, policy: &str) -> Result<String> {
    let (mut low, mut high) = (1e-3f64, 0.1f64);
    for _ in 0..8 {
        let middle = (low * high).sqrt();
        let spp = render(quietus, policy, &format!("{middle:.3e}"), SEEDS[0])?;
        if spp > MEAN_SAMPLES { low = middle } else { high = middle }
    }
    Ok(format!("{:.3e}", (low * high).sqrt()))
}

/// A picture from many samples of another seed.
fn reference(quietus: &Quietus) -> Result<Picture> {
    quietus.render(&["--size", SIZE, "--sampling", "uniform", "--spp", "1024", "--seed", "1000"])?;
    Ok(read_exr(&quietus.picture())?.0)
}

/// Pictures in the upper row, sample counts (black 0, white the most in either) in the lower.
fn save(panels: &[Picture], path: &Path) -> Result<()> {
    let most = panels.iter().flat_map(|p| &p.samples).max().copied().context("no pictures")?.max(1);
    let [w, h] = panels[0].frame;
    let gap = 8;
    let mut sheet = RgbImage::from_pixel(panels.len() as u32 * (w + gap) - gap, 2 * h + gap, Rgb([255; 3]));
    for (i, panel) in panels.iter().enumerate() {
        let left = i as u32 * (w + gap);
        for y in 0..h {
            for x in 0..w {
                let pixel = panel.index(x, y);
                let c = panel.beauty[pixel];
                sheet.put_pixel(left + x, y, Rgb([srgb8(c[0]), srgb8(c[1]), srgb8(c[2])]));
                let share = (f64::from(panel.samples[pixel]) / f64::from(most)).sqrt();
                sheet.put_pixel(left + x, h + gap + y, Rgb([(255.0 * share) as u8; 3]));
            }
        }
    }
    sheet.save(path).with_context(|| path.display().to_string())
}
