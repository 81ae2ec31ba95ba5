//! A measurement of Quietus, in a process of its own.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use anyhow::{Context, Result};
use clap::Args;
use quietus_render::{Control, Goal, Machinery, PathTracer, RenderSettings, Sampling, Watched, render};
use quietus_trace::filter::Filter;
use quietus_trace::scene::Scene;
use quietus_trace::view::View;
use serde_json::json;

use crate::{SEEDS, scenes};

#[derive(Args)]
pub(crate) struct Job {
    scene: String,
    #[arg(long)]
    folder: PathBuf,
    #[arg(long)]
    size: u32,
    #[arg(long)]
    samples: u32,
    #[arg(long)]
    max_depth: u32,
    #[arg(long)]
    threads: NonZeroUsize,
}

/// Loads, draws once for each seed, and prints what it took.
pub(crate) fn draw(job: &Job) -> Result<()> {
    rayon::ThreadPoolBuilder::new().num_threads(job.threads.get()).build_global()?;
    let start = Instant::now();
    let desc = scenes::load(&job.scene)?;
    let scene = Scene::build(&desc)?;
    let camera = desc.cameras.first().context("the scene has no camera")?.clone();
    drop(desc);
    let load_seconds = start.elapsed().as_secs_f64();
    let (mut wall, mut cpu, mut peak) = (vec![], vec![], None);
    for seed in SEEDS {
        let view = View::new(&camera, [job.size; 2], Filter::BOX, job.max_depth, seed.into())?;
        let tracer = PathTracer { scene: &scene, view: &view };
        let mut silent = |_: &Watched<'_>| ();
        let mut control = Control { cancel: &AtomicBool::new(false), watch: &mut silent, live: None };
        let drawn = render(&tracer, &settings(job), &mut control)?;
        wall.push(drawn.statistics.wall_seconds);
        cpu.push(drawn.statistics.cpu_seconds.context("the system does not tell CPU times")?);
        peak = drawn.statistics.peak_rss_bytes;
        let picture = drawn.film.picture(|_| 0.0);
        let bytes: Vec<u8> =
            picture.beauty.iter().flat_map(|c| [c[0], c[1], c[2]]).flat_map(f32::to_le_bytes).collect();
        std::fs::write(job.folder.join(format!("quietus-{seed}.raw")), bytes)?;
    }
    println!(
        "{}",
        json!({"load_seconds": load_seconds, "wall_seconds": wall, "cpu_seconds": cpu,
            "samples": job.samples,
            "peak_bytes": peak.context("the system does not tell memory")?})
    );
    Ok(())
}

fn settings(job: &Job) -> RenderSettings {
    let frame = [job.size; 2];
    RenderSettings {
        frame,
        window: quietus_film::Window { x0: 0, y0: 0, x1: job.size, y1: job.size },
        sampling: Sampling::Uniform,
        goal: Goal::Limits,
        min_samples: job.samples,
        max_samples: job.samples,
        time_limit: None,
        threads: job.threads,
        machinery: Machinery::default(),
        weights: None,
        aov_noise: [None; 3],
    }
}
