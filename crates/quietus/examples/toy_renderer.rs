//! A renderer in a page: it "traces" a formula, keeps its own film and threads, and lets Quietus say where to
//! sample.
//!
//! ```sh
//! cargo run --release -p quietus --example toy_renderer > toy.pgm
//! ```

use std::{io::Write, sync::Mutex, thread};

use quietus::{AdaptiveSampling, PixelError, ReplicateMean, Settings, TILE_PIXELS, Visit};

/// One sample of a picture that is noisy only around a ring. Values depend on pixel, replicate and index alone.
fn trace(x: u32, y: u32, replicate: u8, index: u32) -> f32 {
    let seed = [x, y, replicate.into(), index].iter().fold(0u64, |h, &v| {
        let h = (h ^ u64::from(v)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        h ^ h >> 32
    });
    let random = (seed >> 40) as f32 / (1 << 24) as f32;
    let radius = ((x as f32 - 160.0).powi(2) + (y as f32 - 100.0).powi(2)).sqrt();
    let noise = (-((radius - 60.0) / 10.0).powi(2)).exp();
    0.2 + noise * 2.0 * random
}

/// The film of one tile: the sum and count of each replicate of each pixel.
type FilmTile = [[(f32, u32); 2]; TILE_PIXELS];

/// Draws what a visit asks for, and says how far off each pixel still is.
fn draw(
    sampling: &AdaptiveSampling,
    visit: &Visit<'_, '_>,
    film: &mut FilmTile,
) -> [PixelError; TILE_PIXELS] {
    for work in visit.pixels() {
        let (sum, count) = &mut film[usize::from(work.pixel)][usize::from(work.replicate)];
        for index in work.samples {
            *sum += trace(work.x, work.y, work.replicate, index);
            *count += 1;
        }
    }
    film.map(|pixel| {
        let means = pixel.map(|(sum, count)| [sum / count as f32; 3]);
        let replicate = |r: usize| ReplicateMean { count: pixel[r].1, channels: &means[r] };
        sampling.pixel_error(&[replicate(0), replicate(1)])
    })
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (width, height) = (320, 200);
    let settings = Settings { target_error: 0.001, max_samples: 1024, ..Settings::new(width, height) };
    let sampling = AdaptiveSampling::new(settings)?;
    let tiles = sampling.grid().tiles();
    // A lock per tile, which is always free: a tile is visited by one thread at a time.
    let film: Vec<_> = (0..tiles).map(|_| Mutex::new([[(0.0, 0); 2]; TILE_PIXELS])).collect();
    thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                let mut worker = sampling.worker();
                while let Some(visit) = worker.next_visit() {
                    let errors = draw(&sampling, &visit, &mut film[visit.tile() as usize].lock().unwrap());
                    visit.finish(&errors);
                }
            });
        }
    });
    let mean = sampling.counts().total() as f64 / f64::from(width * height);
    eprintln!("{mean:.1} samples per pixel in {} passes", sampling.statistics().passes);
    let pixel = |x, y| {
        let tile = film[sampling.grid().tile_at(x, y) as usize].lock().unwrap();
        let [(a, m), (b, n)] = tile[(y % 8 * 8 + x % 8) as usize];
        (255.0 * ((a + b) / (m + n) as f32 / 2.2).sqrt().min(1.0)) as u8
    };
    let bytes: Vec<u8> =
        (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| pixel(x, y)).collect();
    let mut out = std::io::stdout().lock();
    writeln!(out, "P5 {width} {height} 255")?;
    Ok(out.write_all(&bytes)?)
}
