//! What the protocol costs: rebuilds, locks, idling, scaling.

use anyhow::Result;
use serde_json::Value;

use crate::run::{Quietus, median, number};

/// Renders that are repeated are repeated this often; medians are quoted.
const RUNS: usize = 5;

/// Rebuild times in live renders of the embedded scene; a rebuild is the work of one thread.
pub(super) fn rebuild(quietus: &Quietus) -> Result<()> {
    println!("| size | way | stage | generation | nodes | ms |\n|---|---|---|---|---|---|");
    for size in ["2048x858", "3840x2160"] {
        for way in ["resummed", "summed-area"] {
            let stats = quietus.render(&[
                "--size",
                size,
                "--rebuild",
                way,
                "--max-depth",
                "2",
                "--min-samples",
                "4",
                "--target-error",
                "0.0015",
            ])?;
            stages(size, way, &stats);
        }
    }
    Ok(())
}

/// The slowest rebuild of the first, the middle and the last generation of trees, and the worst of all.
fn stages(size: &str, way: &str, stats: &Value) {
    let log: Vec<(u64, u64, f64)> = stats["rebuild_log"]
        .as_array()
        .into_iter()
        .flatten()
        .map(|r| {
            (
                r["generation"].as_u64().unwrap_or(0),
                r["nodes"].as_u64().unwrap_or(0),
                r["milliseconds"].as_f64().unwrap_or(f64::NAN),
            )
        })
        .filter(|r| r.1 > 0)
        .collect();
    let mut generations: Vec<u64> = log.iter().map(|r| r.0).collect();
    generations.sort_unstable();
    generations.dedup();
    let slowest = |keep: &dyn Fn(u64) -> bool| {
        log.iter().filter(|r| keep(r.0)).max_by(|a, b| a.2.total_cmp(&b.2)).copied()
    };
    let Some((&first, &last)) = generations.first().zip(generations.last()) else { return };
    let middle = generations[generations.len() / 2];
    let rows = [
        ("early", slowest(&|g| g == first)),
        ("mid", slowest(&|g| g == middle)),
        ("late", slowest(&|g| g == last)),
        ("worst", slowest(&|_| true)),
    ];
    for (stage, (generation, nodes, ms)) in rows.into_iter().filter_map(|(stage, row)| Some((stage, row?))) {
        println!("| {size} | {way} | {stage} | {generation} | {nodes} | {ms:.2} |");
    }
}

/// Share of threads x wall time spent waiting for locks and parked, embedded scene at 1280x720 on 4 threads.
pub(super) fn locks(quietus: &Quietus) -> Result<()> {
    println!("| way | waiting for locks | idle | wall seconds |\n|---|---|---|---|");
    let ways: [(&str, &[&str]); 4] = [
        ("free-running, striped locks", &["--sampling", "free-running", "--checks", "locks"]),
        ("deterministic, striped locks, lag 2", &["--checks", "locks", "--lag", "2"]),
        ("deterministic, published masks, lag 1", &["--checks", "published", "--lag", "1"]),
        ("deterministic, published masks, lag 2", &["--checks", "published", "--lag", "2"]),
    ];
    let mut results = vec![[const { Vec::new() }; 3]; ways.len()];
    for _ in 0..RUNS {
        for ((_, words), result) in ways.iter().zip(&mut results) {
            let mut all = vec![
                "--size",
                "1280x720",
                "--threads",
                "4",
                "--target-error",
                "0.0014",
                "--max-samples",
                "256",
            ];
            all.extend(*words);
            let stats = quietus.render(&all)?;
            for (key, values) in ["lock_wait_fraction", "idle_fraction", "wall_seconds"].iter().zip(result) {
                values.push(number(&stats, key)?);
            }
        }
    }
    for ((name, _), [waits, idle, wall]) in ways.iter().zip(results) {
        let (waits, idle, wall) = (100.0 * median(waits), 100.0 * median(idle), median(wall));
        println!("| {name} | {waits:.5} % | {idle:.2} % | {wall:.2} |");
    }
    Ok(())
}

/// Samples per wall second and per CPU-second over threads.
pub(super) fn scaling(quietus: &Quietus) -> Result<()> {
    println!("| threads | M samples/s | times one thread | M samples per CPU-second |\n|---|---|---|---|");
    let mut one = None;
    for threads in ["1", "2", "3", "4"] {
        let (mut wall, mut cpu) = (Vec::new(), Vec::new());
        for _ in 0..RUNS {
            let stats = quietus.render(&[
                "--size",
                "640x360",
                "--threads",
                threads,
                "--target-error",
                "0.0014",
                "--max-samples",
                "64",
            ])?;
            let samples = number(&stats, "samples")? / 1e6;
            wall.push(samples / number(&stats, "wall_seconds")?);
            cpu.push(samples / number(&stats, "cpu_seconds")?);
        }
        let (wall, cpu) = (median(wall), median(cpu));
        let times = wall / *one.get_or_insert(wall);
        println!("| {threads} | {wall:.2} | {times:.2} | {cpu:.2} |");
    }
    Ok(())
}
