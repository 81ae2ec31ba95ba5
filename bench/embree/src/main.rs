//! Measures the ray kernel against Embree 3: the same rays, one thread, in turns, medians.
//!
//! `cargo run --release [RUNS]` in this directory; needs `libembree3.so.3` (Debian: `libembree3-3`).

// The criterion bench uses parts of it that this does not.
#[allow(dead_code)]
#[path = "../../../crates/quietus-trace/benches/common/mod.rs"]
mod common;
mod embree;

use std::hint::black_box;
use std::time::Instant;

use common::{Rays, Scene, count_hits};
use embree::Embree;
use quietus_trace::bvh::Accel;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let runs = std::env::args().nth(1).map_or(Ok(9), |n| n.parse())?;
    for scene in [Scene::atrium(), Scene::lump()] {
        println!("\n{}: {} triangles", scene.name, scene.mesh.triangles.len());
        builds(&scene, 1, runs.min(5))?;
        builds(&scene, 4, runs.min(5))?;
        kernels(&scene, runs)?;
    }
    Ok(())
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn builds(scene: &Scene, threads: usize, runs: usize) -> Result<(), Box<dyn std::error::Error>> {
    let device = Embree::new(threads)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
    let mut wall = [const { Vec::new() }; 2];
    let mut cpu = [const { Vec::new() }; 2];
    let mut bytes = [0.0; 2];
    for _ in 0..runs {
        let started = cpu_seconds(libc::CLOCK_PROCESS_CPUTIME_ID);
        let built = device.scene(&scene.mesh, true);
        cpu[1].push(cpu_seconds(libc::CLOCK_PROCESS_CPUTIME_ID) - started);
        wall[1].push(built.build_seconds);
        bytes[1] = built.bytes as f64;
        let started = cpu_seconds(libc::CLOCK_PROCESS_CPUTIME_ID);
        let start = Instant::now();
        let accel: Accel = pool.install(|| scene.build());
        wall[0].push(start.elapsed().as_secs_f64());
        cpu[0].push(cpu_seconds(libc::CLOCK_PROCESS_CPUTIME_ID) - started);
        bytes[0] = accel.bytes() as f64;
    }
    for (clock, times) in [("wall", wall), ("cpu", cpu)] {
        let [ours, theirs] = times.map(median).map(|seconds| 1e3 * seconds);
        let ratio = ours / theirs;
        println!(
            "build, {threads} threads, {clock}: {ours:.0} ms, Embree robust {theirs:.0} ms, ratio {ratio:.2}"
        );
    }
    println!("memory: {:.0} MB, Embree robust {:.0} MB", 1e-6 * bytes[0], 1e-6 * bytes[1]);
    Ok(())
}

/// CPU seconds of this thread or process.
fn cpu_seconds(clock: libc::clockid_t) -> f64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: the pointer is to a timespec, the clock exists on Linux.
    unsafe { libc::clock_gettime(clock, &mut time) };
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

fn timed(f: impl FnOnce() -> usize) -> (f64, usize) {
    let start = cpu_seconds(libc::CLOCK_THREAD_CPUTIME_ID);
    let count = black_box(f());
    (cpu_seconds(libc::CLOCK_THREAD_CPUTIME_ID) - start, count)
}

fn kernels(scene: &Scene, runs: usize) -> Result<(), Box<dyn std::error::Error>> {
    let device = Embree::new(4)?;
    let robust = device.scene(&scene.mesh, true);
    let fast = device.scene(&scene.mesh, false);
    let accel = scene.build();
    println!("M rays per CPU second:  ours  Embree robust (ratio)  Embree fast (ratio)  hits of each");
    for Rays { kind, rays, shadow } in scene.rays(&accel, 640, 480) {
        let rays = Rays { kind, rays, shadow };
        let mut times = [const { Vec::new() }; 3];
        let mut hits = [0; 3];
        for _ in 0..runs {
            let results = [
                timed(|| count_hits(&accel, &rays)),
                timed(|| robust.count_hits(&rays.rays, shadow)),
                timed(|| fast.count_hits(&rays.rays, shadow)),
            ];
            for (i, (seconds, count)) in results.into_iter().enumerate() {
                times[i].push(seconds);
                hits[i] = count;
            }
        }
        let [ours, robust, fast] = times.map(|t| 1e-6 * rays.rays.len() as f64 / median(t));
        println!(
            "{kind:>10}: {ours:6.2} {robust:6.2} ({:.2}) {fast:6.2} ({:.2})  of {}: {hits:?}",
            ours / robust,
            ours / fast,
            rays.rays.len()
        );
    }
    Ok(())
}
