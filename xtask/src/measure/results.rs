//! What every policy gains and loses on every scene: the tables of docs/results.md.

use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result};
use serde_json::Value;

use crate::run::{Quietus, run, shared_scenes};

/// Scene, size of the picture, longest path.
pub(super) const SCENES: [(&str, &str, &str); 9] = [
    ("embedded", "96x64", "16"),
    ("cornell-box/gltf/CornellBox.glb", "80x64", "8"),
    ("cornell-box/cornell-box-specular.pbrt", "64x64", "8"),
    ("veach-ajar/veach-ajar-local.pbrt", "96x54", "12"),
    ("veach-mis/veach-mis.pbrt", "88x66", "6"),
    ("generated/many-lights-bokeh.pbrt", "96x54", "8"),
    ("bmw-m6/bmw-m6-local.pbrt", "84x60", "9"),
    ("cornell-box/volumetric-caustic.pbrt", "64x64", "11"),
    ("flight-helmet/FlightHelmet.gltf", "64x80", "8"),
];
const BUDGETS: [f64; 4] = [32.0, 64.0, 128.0, 256.0];
/// The error measure of the tables, see docs/eval.md.
const MEASURE: &str = "weighted";

/// Replays all policies on all scenes; prints a table for each scene and one for all.
pub(super) fn results(quietus: &Quietus, only: Option<&str>) -> Result<()> {
    let mut overview = Vec::new();
    for (scene, size, depth) in SCENES {
        if only.is_some_and(|only| !scene.contains(only)) {
            continue;
        }
        let path = if scene == "embedded" { PathBuf::from(scene) } else { shared_scenes()?.join(scene) };
        let json = quietus.scratch.path().join("eval.json");
        let budgets = BUDGETS.map(|budget| budget.to_string()).join(",");
        let mut command = Command::new(quietus.program());
        command.arg("eval").arg(&path).args(["--size", size, "--max-depth", depth, "--streams", "16"]);
        command.args(["--samples", "256", "--reference-spp", "8192", "--budgets", &budgets]);
        run(command.arg("--json").arg(&json))?;
        let found: Value = serde_json::from_str(&std::fs::read_to_string(&json)?)?;
        let comparison = found.get(0).context("eval wrote no comparison")?;
        println!("\n### {scene}, {size}\n");
        print_scene(comparison)?;
        overview.push((scene, comparison.clone()));
    }
    println!("\n### Gain at 64 samples per pixel, all scenes\n");
    print_overview(&overview)
}

fn print_scene(comparison: &Value) -> Result<()> {
    let curve = find(&comparison["uniform"])?;
    println!(
        "Error of uniform sampling falls as n^-{:.2}; limit of gains {}.\n",
        curve["exponent"].as_f64().context("no exponent")?,
        curve["limit"].as_f64().map_or("not defined".into(), |limit| format!("{limit:.2}")),
    );
    println!(
        "| policy | spp | gain | share of the limit | energy | darkest fifth | worst tile | block, step, edge |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for point in points(comparison) {
        let error = find(&point["errors"])?;
        let share = &error["share_of_limit"];
        println!(
            "| {} | {:.1} | {} | {} | {} | {} | {} | {} |",
            name(point),
            point["spp"].as_f64().context("no spp")?,
            estimate(&error["gain"], 1.0, 2)?,
            if share.is_null() { "-".into() } else { format!("{:.2}", middle(share)?) },
            bias(&point["bias"]["picture"])?,
            bias(&point["bias"]["darkest_fifth"])?,
            bias(&point["bias"]["worst_tile"])?,
            (0..3)
                .map(|i| Ok(format!("{:.2}", middle(&point["structure"][i])?)))
                .collect::<Result<Vec<_>>>()?
                .join(", "),
        );
    }
    Ok(())
}

fn print_overview(scenes: &[(&str, Value)]) -> Result<()> {
    let methods: Vec<String> = scenes.first().map_or(vec![], |(_, comparison)| {
        let mut names: Vec<String> = points(comparison).map(name).collect();
        names.dedup();
        names
    });
    println!("| scene | limit | {} |", methods.join(" | "));
    println!("|---|---|{}", "---|".repeat(methods.len()));
    for (scene, comparison) in scenes {
        let limit = find(&comparison["uniform"])?["limit"].as_f64();
        let cells: Vec<String> =
            methods.iter().map(|method| cell(comparison, method)).collect::<Result<_>>()?;
        println!("| {scene} | {} | {} |", limit.map_or("-".into(), |l| format!("{l:.2}")), cells.join(" | "));
    }
    Ok(())
}

/// Gain and energy of a method at 64 samples.
fn cell(comparison: &Value, method: &str) -> Result<String> {
    let found =
        points(comparison).find(|point| name(point) == method && point["budget"].as_f64() == Some(64.0));
    let Some(point) = found else { return Ok("-".into()) };
    let gain = middle(&find(&point["errors"])?["gain"])?;
    Ok(format!("{gain:.2} ({:+.2} %)", 100.0 * middle(&point["bias"]["picture"])?))
}

fn points(comparison: &Value) -> impl Iterator<Item = &Value> {
    comparison["points"].as_array().into_iter().flatten().filter(|point| name(point) != "uniform")
}

fn name(point: &Value) -> String {
    point["method"].as_str().unwrap_or_default().to_lowercase()
}

/// The entry of the tables' measure.
fn find(list: &Value) -> Result<&Value> {
    let entries = list.as_array().context("expected a list")?;
    let is_it = |entry: &&Value| entry["measure"].as_str().is_some_and(|m| m.eq_ignore_ascii_case(MEASURE));
    entries.iter().find(is_it).with_context(|| format!("no measure {MEASURE}"))
}

fn middle(estimate: &Value) -> Result<f64> {
    estimate["value"].as_f64().with_context(|| format!("no estimate: {estimate}"))
}

fn estimate(value: &Value, scale: f64, digits: usize) -> Result<String> {
    let [low, high] = ["low", "high"].map(|key| value[key].as_f64().unwrap_or(f64::NAN) * scale);
    Ok(format!("{:.digits$} [{low:.digits$}, {high:.digits$}]", middle(value)? * scale))
}

/// In percent, with half of the interval.
fn bias(value: &Value) -> Result<String> {
    let half =
        50.0 * (value["high"].as_f64().unwrap_or(f64::NAN) - value["low"].as_f64().unwrap_or(f64::NAN));
    Ok(format!("{:+.2} ± {half:.2} %", 100.0 * middle(value)?))
}
