//! Whether renders of pictures as people draw them foresee when they will be done, on the clock: a table of docs/noise.md.

use std::process::Command;

use anyhow::{Context, Result, bail};
use serde_json::Value;

use crate::run::{Quietus, shared_scenes};

/// Scene, size of the picture, noise: renders that take some ten seconds to a minute and a half of four cores.
const PICTURES: [(&str, &str, &str); 12] = [
    ("embedded", "640x360", "2%"),
    ("cornell-box/gltf/CornellBox.glb", "480x400", "1.5%"),
    ("cornell-box/cornell-box.pbrt", "512x512", "0.6%"),
    ("cornell-box/cornell-box-specular.pbrt", "320x320", "2.5%"),
    ("cornell-box/cornell-box-volume.pbrt", "160x160", "3.5%"),
    ("veach-mis/veach-mis.pbrt", "640x480", "0.6%"),
    ("bmw-m6/bmw-m6-local.pbrt", "480x270", "1%"),
    ("chopper-titan/chopper-titan-v4-local.pbrt", "480x270", "0.8%"),
    ("flight-helmet/FlightHelmet.gltf", "640x640", "0.25%"),
    ("animated-fox/Fox.glb", "640x480", "0.2%"),
    ("generated/grass.pbrt", "320x180", "0.7%"),
    ("generated/motion-blur.pbrt", "480x360", "0.25%"),
];

/// Shares of a render's time at which it is asked for the rest of it.
const MOMENTS: [f64; 4] = [0.1, 0.25, 0.5, 0.75];

/// What a render foresaw at a moment.
#[derive(Clone, Copy)]
struct Foreseen {
    /// All of its time, over that it took.
    ratio: f64,
    /// Whether its range held what came.
    held: bool,
}

/// Prints what renders foresaw of their time over what they took: `runs` renders of each scene, with seeds from 1 on.
pub(super) fn end(quietus: &Quietus, only: Option<&str>, runs: u32) -> Result<()> {
    println!("| scene | size | asked | reached / asked | seconds | spp | after 10 % | 25 % | 50 % | 75 % |");
    println!("|---|---|---|---|---|---|---|---|---|---|");
    let mut all = Vec::new();
    for (scene, size, noise) in PICTURES {
        if only.is_some_and(|only| !scene.contains(only)) {
            continue;
        }
        let renders = (1..=runs).map(|seed| render(quietus, scene, size, noise, seed));
        let renders = renders.collect::<Result<Vec<_>>>()?;
        let mean = |of: fn(&Render) -> f64| renders.iter().map(of).sum::<f64>() / renders.len() as f64;
        let (seconds, spp) = (mean(|render| render.seconds), mean(|render| render.spp));
        let reached: Vec<_> = renders.iter().map(|render| format!("{:.2}", render.reached)).collect();
        let (reached, cells) = (reached.join(", "), cells(&renders));
        println!("| {scene} | {size} | {noise} | {reached} | {seconds:.0} | {spp:.0} | {cells} |");
        all.extend(renders);
    }
    println!("| all | | | | | | {} |", cells(&all));
    Ok(())
}

struct Render {
    /// The noise reported, over that asked for.
    reached: f64,
    seconds: f64,
    spp: f64,
    foreseen: [Option<Foreseen>; MOMENTS.len()],
}

fn render(quietus: &Quietus, scene: &str, size: &str, noise: &str, seed: u32) -> Result<Render> {
    let mut command = Command::new(quietus.program());
    command.arg("render");
    if scene != "embedded" {
        command.arg(shared_scenes()?.join(scene));
    }
    command.args(["--size", size, "--noise", noise, "--seed", &seed.to_string(), "--progress", "json", "-o"]);
    let output = command.arg(quietus.scratch.path().join("end.exr")).output()?;
    if !output.status.success() {
        bail!("{scene}: {}", String::from_utf8_lossy(&output.stderr));
    }
    let text =
        String::from_utf8_lossy(&output.stderr).into_owned() + &String::from_utf8_lossy(&output.stdout);
    let events: Vec<Value> = text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
    let end = events.iter().find(|event| event["event"] == "end").context("the render told no end")?;
    let seconds = end["wall_seconds"].as_f64().context("the end has no wall_seconds")?;
    let foreseen = MOMENTS.map(|moment| {
        let is_before =
            |event: &&Value| event["elapsed_seconds"].as_f64().is_some_and(|at| at <= moment * seconds);
        foreseen(events.iter().rfind(is_before)?, seconds)
    });
    let number = |key: &str| end[key].as_f64().with_context(|| format!("the end has no {key}"));
    let asked = noise.trim_end_matches('%').parse::<f64>()?;
    Ok(Render { reached: number("noise_reached")? / asked, seconds, spp: number("spp_mean")?, foreseen })
}

/// What an event says of a render that took `seconds`.
fn foreseen(event: &Value, seconds: f64) -> Option<Foreseen> {
    let elapsed = event["elapsed_seconds"].as_f64()?;
    let ratio = |key: &str| Some((elapsed + event[key].as_f64()?) / seconds);
    let held = ratio("remaining_low_seconds")? <= 1.0 && ratio("remaining_high_seconds")? >= 1.0;
    Some(Foreseen { ratio: ratio("remaining_seconds")?, held })
}

/// For each moment: the median, how many of all were within a fifth, and how many ranges held what came.
fn cells(renders: &[Render]) -> String {
    let cell = |moment: usize| {
        let mut said: Vec<Foreseen> = renders.iter().filter_map(|render| render.foreseen[moment]).collect();
        said.sort_by(|a, b| a.ratio.total_cmp(&b.ratio));
        let near = said.iter().filter(|foreseen| (0.8..=1.2).contains(&foreseen.ratio)).count();
        let held = said.iter().filter(|foreseen| foreseen.held).count();
        said.get(said.len() / 2).map_or("-".to_owned(), |median| {
            format!("{:.2}, {near} of {}, {held} of {} held", median.ratio, renders.len(), said.len())
        })
    };
    (0..MOMENTS.len()).map(cell).collect::<Vec<_>>().join(" | ")
}
