//! Whether renders get the noise, and the time, that they are asked for, and foresee their end: the tables of
//! docs/noise.md.

use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result};
use serde_json::Value;

use crate::run::{Quietus, run, shared_scenes};

/// Scene, size of the picture, longest path, samples per pixel of the reference.
const SCENES: [(&str, &str, &str, &str); 16] = [
    ("embedded", "96x64", "16", "16384"),
    ("cornell-box/gltf/CornellBox.glb", "80x64", "8", "16384"),
    ("cornell-box/cornell-box.pbrt", "80x80", "8", "16384"),
    ("cornell-box/cornell-box-specular.pbrt", "64x64", "8", "16384"),
    ("cornell-box/cornell-box-volume.pbrt", "48x48", "11", "8192"),
    ("cornell-box/volumetric-caustic.pbrt", "48x48", "11", "8192"),
    ("veach-ajar/veach-ajar-local.pbrt", "64x36", "12", "8192"),
    ("veach-mis/veach-mis.pbrt", "160x120", "6", "8192"),
    ("generated/many-lights-bokeh.pbrt", "64x36", "8", "8192"),
    ("generated/motion-blur.pbrt", "64x48", "8", "8192"),
    ("generated/grass.pbrt", "64x36", "8", "4096"),
    ("generated/hairball.pbrt", "48x48", "13", "4096"),
    ("bmw-m6/bmw-m6-local.pbrt", "84x60", "9", "8192"),
    ("flight-helmet/FlightHelmet.gltf", "128x160", "8", "4096"),
    ("animated-fox/Fox.glb", "96x72", "8", "8192"),
    ("animated-fox/MorphStressTest.gltf", "96x72", "8", "8192"),
];

/// Scene, size of the picture, longest path, noise: renders that take some ten seconds of one core.
const LONGER: [(&str, &str, &str, &str); 7] = [
    ("embedded", "256x144", "16", "3%"),
    ("cornell-box/gltf/CornellBox.glb", "200x160", "8", "2%"),
    ("cornell-box/cornell-box-specular.pbrt", "128x128", "8", "4%"),
    ("veach-mis/veach-mis.pbrt", "320x240", "6", "1.5%"),
    ("bmw-m6/bmw-m6-local.pbrt", "168x120", "9", "3%"),
    ("generated/many-lights-bokeh.pbrt", "96x54", "8", "4%"),
    ("flight-helmet/FlightHelmet.gltf", "256x320", "8", "0.7%"),
];

/// `quietus eval` of a scene.
fn eval(quietus: &Quietus, scene: &str, size: &str, depth: &str) -> Result<Command> {
    let path = if scene == "embedded" { PathBuf::from(scene) } else { shared_scenes()?.join(scene) };
    let mut command = Command::new(quietus.program());
    command.arg("eval").arg(&path).args(["--size", size, "--max-depth", depth]);
    Ok(command)
}

/// Prints a table of noise, and one of what was foreseen, for each scene: `runs` renders of each noise, of which none is
/// begun after `seconds`. What would take much longer is left out.
pub(super) fn noise(quietus: &Quietus, only: Option<&str>, runs: u32, seconds: u32) -> Result<()> {
    for (scene, size, depth, reference) in SCENES {
        if only.is_some_and(|only| !scene.contains(only)) {
            continue;
        }
        let mut command = eval(quietus, scene, size, depth)?;
        command.args(["--reference-spp", reference, "--noise", "4%,2%,1%,0.5%"]);
        run(command.args(["--runs", &runs.to_string(), "--noise-time", &format!("{seconds}s")]))?;
    }
    Ok(())
}

/// Prints how long renders of each scene took that had a time, over that time.
pub(super) fn time(quietus: &Quietus, only: Option<&str>) -> Result<()> {
    for (scene, size, depth, reference) in SCENES {
        if only.is_none_or(|only| scene.contains(only)) {
            let mut command = eval(quietus, scene, size, depth)?;
            run(command.args(["--reference-spp", reference, "--time", "2s,10s", "--runs", "3"]))?;
        }
    }
    Ok(())
}

/// Prints what renders foresaw of their end over what they came to.
pub(super) fn eta(quietus: &Quietus, only: Option<&str>, runs: u32) -> Result<()> {
    let mut rows = Vec::new();
    for (scene, size, depth, noise) in LONGER {
        if only.is_some_and(|only| !scene.contains(only)) {
            continue;
        }
        let json = quietus.scratch.path().join("eta.json");
        let mut command = eval(quietus, scene, size, depth)?;
        // Nothing is compared with the reference.
        command.args(["--reference-spp", "2", "--noise", noise, "--runs", &runs.to_string()]);
        run(command.stdout(std::process::Stdio::null()).arg("--json").arg(&json))?;
        let found: Value = serde_json::from_str(&std::fs::read_to_string(&json)?)?;
        let renders = found[0][1].as_array().context("eval wrote no renders")?;
        let medians =
            |key: &str| (0..4).map(|moment| median(renders, key, moment)).collect::<Vec<_>>().join(" | ");
        let seconds =
            renders.iter().filter_map(|run| run["seconds"].as_f64()).sum::<f64>() / renders.len() as f64;
        let (samples, times) = (medians("expected_samples"), medians("expected"));
        let knowable = knowable(renders);
        rows.push(format!(
            "| {scene} | {size} | {noise} | {seconds:.1} | {samples} | {times} | {knowable} |"
        ));
    }
    println!(
        "| scene | size | asked | seconds | samples after 10 % | 25 % | 50 % | 75 % | time after 10 % | 25 % | 50 % | 75 % | by others |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    rows.iter().for_each(|row| println!("{row}"));
    Ok(())
}

/// The median of what renders foresaw at a moment, how many of them were within a fifth, and how many within the range they gave
/// for it, where it is of samples; a dash where none said anything.
fn median(renders: &[Value], key: &str, moment: usize) -> String {
    let mut said: Vec<f64> = renders.iter().filter_map(|run| run[key][moment].as_f64()).collect();
    said.sort_by(f64::total_cmp);
    let near = said.iter().filter(|&&ratio| is_near(ratio)).count();
    let held = renders.iter().filter(|run| run["expected_held"][moment] == true).count();
    let held =
        if key == "expected_samples" { format!(", {held} of {} held", said.len()) } else { String::new() };
    said.get(said.len() / 2)
        .map_or("-".to_owned(), |median| format!("{median:.2}, {near} of {}{held}", renders.len()))
}

fn is_near(ratio: f64) -> bool {
    (0.8..=1.2).contains(&ratio)
}

/// In how many renders the samples of the others, by their median, were within a fifth of their own: what one could foresee who has
/// drawn the scene many times, but does not know what measurements will say of this picture.
fn knowable(renders: &[Value]) -> String {
    let samples: Vec<f64> = renders.iter().filter_map(|run| run["spp"].as_f64()).collect();
    let of_others = |own: usize| {
        let others = samples.iter().enumerate().filter(|(number, _)| *number != own);
        let mut others: Vec<f64> = others.map(|(_, &samples)| samples).collect();
        others.sort_by(f64::total_cmp);
        let (below, above) = (others.get((others.len().max(1) - 1) / 2)?, others.get(others.len() / 2)?);
        Some(0.5 * (below + above))
    };
    let near =
        (0..samples.len()).filter(|&own| of_others(own).is_some_and(|middle| is_near(middle / samples[own])));
    format!("{} of {}", near.count(), samples.len())
}
