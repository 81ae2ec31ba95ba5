//! What it would bring to trace sorted rays (the talk's renderer queues and sorts its secondary rays): by octant, and by
//! octant and origin, in queues as long as a visit to a tile (64 pixels, 16 samples).
//! `cargo run --release -p quietus-trace --example queues`.

// The kernel's bench uses all of it.
#[allow(dead_code)]
#[path = "../benches/common/mod.rs"]
mod common;

use std::time::Instant;

use common::{Rays, Scene, count_hits};
use quietus_trace::bvh::{Accel, Ray};

/// Rays in a queue.
const QUEUE: usize = 1024;
const TURNS: usize = 9;

/// What rays are sorted by.
type Key = fn(&Ray) -> u64;

fn main() {
    println!("M rays/s, medians of {TURNS} turns; in brackets what sorting costs, in ns per ray");
    for scene in [Scene::atrium(), Scene::lump()] {
        let accel = scene.build();
        // Primary rays come in order anyhow.
        for Rays { kind, rays, shadow } in scene.rays(&accel, 1280, 960).into_iter().skip(1) {
            let orders: [(&str, Key); 3] =
                [("as they come", |_| 0), ("by octant", octant), ("by octant and origin", place)];
            let sorted = orders.map(|(_, key)| sorted(&rays, key));
            let queues = sorted.map(|(rays, cost)| (Rays { kind, rays, shadow }, cost));
            let rates = rates(&accel, &queues.each_ref().map(|(rays, _)| rays));
            for (((name, _), rate), (_, cost)) in orders.iter().zip(rates).zip(&queues) {
                println!("{:>8} {kind:>9} {name:>21}: {rate:6.2} ({cost:.0})", scene.name);
            }
        }
    }
}

/// Signs of the direction.
fn octant(ray: &Ray) -> u64 {
    ray.direction.to_array().iter().fold(0, |bits, x| 2 * bits + u64::from(x.is_sign_negative()))
}

/// The octant, then a Morton number of the origin in cells of a sixteenth of a unit.
fn place(ray: &Ray) -> u64 {
    let cells = ray.origin.to_array().map(|x| (16.0 * (x + 64.0)) as u64);
    (0..12).fold(octant(ray) << 36, |key, bit| {
        key | (0..3).fold(0, |bits, axis| bits | (cells[axis] >> bit & 1) << (3 * bit + axis as u64))
    })
}

/// The rays, sorted queue by queue, and what that took, in nanoseconds per ray.
fn sorted(rays: &[Ray], key: Key) -> (Vec<Ray>, f64) {
    let mut all = rays.to_vec();
    let start = Instant::now();
    for queue in all.chunks_mut(QUEUE) {
        let mut keys: Vec<(u64, u32)> = queue.iter().map(key).zip(0..).collect();
        keys.sort_unstable();
        let moved: Vec<Ray> = keys.iter().map(|&(_, i)| queue[i as usize]).collect();
        queue.copy_from_slice(&moved);
    }
    (all, 1e9 * start.elapsed().as_secs_f64() / rays.len() as f64)
}

/// Rates of each, in turns.
fn rates(accel: &Accel, rays: &[&Rays; 3]) -> [f64; 3] {
    let mut seconds = [const { Vec::new() }; 3];
    for _ in 0..TURNS {
        for (rays, seconds) in rays.iter().zip(&mut seconds) {
            let start = Instant::now();
            std::hint::black_box(count_hits(accel, rays));
            seconds.push(start.elapsed().as_secs_f64());
        }
    }
    seconds.map(|mut seconds| {
        seconds.sort_by(f64::total_cmp);
        1e-6 * rays[0].rays.len() as f64 / seconds[TURNS / 2]
    })
}
