//! Measures Quietus against Mitsuba 3: the same scenes, path length, filter and threads, in turns.
//!
//! `cargo run --release -- --python PYTHON` in this directory, where PYTHON has `mitsuba` installed; `cargo xtask bench
//! peers` sets that up. Every measurement is a process of its own, so that memory and load times are each one's own.
//!
//! Error is compared without a reference: two pictures with independent seeds differ by twice the variance of one.

// The kernel's benches use parts of it that this does not.
#[allow(dead_code)]
#[path = "../../../crates/quietus-trace/benches/common/mod.rs"]
mod common;
mod export;
mod materials;
mod ours;
mod report;
mod scenes;

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};
use clap::{Args, Parser, Subcommand};
use export::Look;
use report::{Measured, Row};

#[derive(Parser)]
#[command(about = "Measures Quietus against Mitsuba 3 on the same scenes")]
struct Arguments {
    #[command(subcommand)]
    task: Option<Task>,
    #[command(flatten)]
    compare: Compare,
}

#[derive(Subcommand)]
enum Task {
    /// Draws one scene with Quietus and prints what it took as JSON: how a measurement starts itself
    #[command(hide = true)]
    Ours(ours::Job),
}

#[derive(Args)]
struct Compare {
    /// Scenes: `embedded`, `lump` (1.3 million triangles), or files
    #[arg(long, value_delimiter = ',', default_value = "embedded,lump")]
    scenes: Vec<String>,
    /// Width and height of the pictures
    #[arg(long, default_value_t = 512)]
    size: u32,
    /// Samples per pixel
    #[arg(long, default_value_t = 64)]
    samples: u32,
    /// Path segments from the camera
    #[arg(long, default_value_t = 8)]
    max_depth: u32,
    /// Threads of each
    #[arg(long, default_value_t = 4)]
    threads: usize,
    /// Turns; medians are printed
    #[arg(long, default_value_t = 3)]
    turns: usize,
    /// Mitsuba's variants
    #[arg(long, value_delimiter = ',', default_value = "llvm_ad_rgb,scalar_rgb")]
    variants: Vec<String>,
    /// A Python with Mitsuba
    #[arg(long, default_value = "python3")]
    python: PathBuf,
    /// Where exported scenes and pictures go; kept
    #[arg(long)]
    folder: Option<PathBuf>,
}

/// Independent seeds of the two pictures whose difference is the error.
const SEEDS: [u32; 2] = [1, 2];

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    match arguments.task {
        Some(Task::Ours(job)) => ours::draw(&job),
        None => compare(&arguments.compare),
    }
}

fn compare(arguments: &Compare) -> Result<()> {
    let base = arguments.folder.clone().unwrap_or_else(|| std::env::temp_dir().join("quietus-peers"));
    for name in &arguments.scenes {
        let folder = base.join(Path::new(name).file_stem().context("a scene has no name")?);
        std::fs::create_dir_all(&folder)?;
        let scene = scenes::load(name)?;
        let look = Look { size: [arguments.size; 2], max_depth: arguments.max_depth };
        let notes = export::export(&scene, look, &folder)?;
        drop(scene);
        let mut rows = vec![Row::new("quietus")];
        rows.extend(arguments.variants.iter().map(|variant| Row::new(variant)));
        for turn in 0..arguments.turns {
            eprintln!("{name}: turn {} of {}", turn + 1, arguments.turns);
            rows[0].add(quietus(arguments, name, &folder)?);
            for (row, variant) in rows[1..].iter_mut().zip(&arguments.variants) {
                row.add(mitsuba(arguments, variant, &folder)?);
            }
        }
        report::print(name, arguments.size, arguments.samples, &rows);
        for note in notes {
            println!("  in Mitsuba {note}");
        }
    }
    Ok(())
}

fn quietus(arguments: &Compare, scene: &str, folder: &Path) -> Result<Measured> {
    let mut command = Command::new(std::env::current_exe()?);
    command.arg("ours").arg(scene).arg("--folder").arg(folder);
    command.args(["--size", &arguments.size.to_string(), "--samples", &arguments.samples.to_string()]);
    command.args([
        "--max-depth",
        &arguments.max_depth.to_string(),
        "--threads",
        &arguments.threads.to_string(),
    ]);
    measure(command, folder, "quietus")
}

fn mitsuba(arguments: &Compare, variant: &str, folder: &Path) -> Result<Measured> {
    let mut command = Command::new(&arguments.python);
    command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("mitsuba_peer.py")).arg(variant).arg(folder);
    command.args(["--samples", &arguments.samples.to_string(), "--threads", &arguments.threads.to_string()]);
    command.arg("--seeds").args(SEEDS.map(|seed| seed.to_string()));
    measure(command, folder, variant)
}

/// Runs a measurement; its last line is JSON, its pictures are `PREFIX-SEED.raw` in `folder`.
fn measure(mut command: Command, folder: &Path, prefix: &str) -> Result<Measured> {
    let output = command.output().with_context(|| format!("cannot start {command:?}"))?;
    if !output.status.success() {
        bail!("failed: {command:?}\n{}", String::from_utf8_lossy(&output.stderr));
    }
    let text = String::from_utf8_lossy(&output.stdout);
    let line = text.lines().last().with_context(|| format!("nothing printed by {command:?}"))?;
    // A terminal's control codes may come before it.
    let line = line.find('{').map_or(line, |start| &line[start..]);
    let mut measured: Measured = serde_json::from_str(line).with_context(|| format!("printed: {line}"))?;
    let pictures: Vec<Vec<f32>> = SEEDS
        .iter()
        .map(|seed| read_raw(&folder.join(format!("{prefix}-{seed}.raw"))))
        .collect::<Result<_>>()?;
    measured.compare(&pictures[0], &pictures[1]);
    Ok(measured)
}

fn read_raw(path: &Path) -> Result<Vec<f32>> {
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    Ok(bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
}
