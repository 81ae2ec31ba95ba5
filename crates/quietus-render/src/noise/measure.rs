//! Draws the picked pixels again.

use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicBool, Ordering};

use quietus_film::{Film, Window};
use quietus_trace::tile::{PixelWork, Sample, SampleSink};

use super::{Finished, LEAST_PICKS, Noise, Pick, SHARE, estimate, pick};
use crate::pixel_errors::REPLICATES;
use crate::run::Rendered;
use crate::tracer::Tracer;

/// Largest value that the film accepts.
const MAX_MAGNITUDE: f32 = 1e28;

/// Measures the noise of what was rendered, by drawing about 2 % of its samples again with other random numbers. The
/// result does not depend on the number of threads. `None` where `cancel` is set, or nothing was drawn.
pub fn measure_noise<T: Tracer>(
    tracer: &T,
    rendered: &Rendered,
    threads: NonZeroUsize,
    cancel: &AtomicBool,
) -> Option<Noise> {
    let window = rendered.film.layout().window();
    let picture = Copied::of(&rendered.film, window);
    let samples: u64 = picture.counts.iter().map(|&count| u64::from(count)).sum();
    if samples == 0 {
        return None;
    }
    let finished = Finished {
        width: window.width() as usize,
        halves: &picture.halves,
        means: &picture.means,
        counts: &picture.counts,
    };
    let picks = pick(&finished, SHARE * samples as f64, LEAST_PICKS, uniform);
    let mut fresh = vec![[[0.0; 3]; 2]; picks.len()];
    let share = picks.len().div_ceil(threads.get());
    std::thread::scope(|scope| {
        for (picks, fresh) in picks.chunks(share).zip(fresh.chunks_mut(share)) {
            scope.spawn(move || {
                for (pick, fresh) in picks.iter().zip(fresh) {
                    // Relaxed: the flag guards no data.
                    if cancel.load(Ordering::Relaxed) {
                        return;
                    }
                    *fresh = draw_again(tracer, window, pick);
                }
            });
        }
    });
    let done = !cancel.load(Ordering::Relaxed);
    done.then(|| estimate(&picture.means, &picks, &fresh))
}

/// A number in 0..1 for every index: SplitMix (Steele, Lea and Flood 2014). Which pixels are drawn again need not
/// depend on the seed: what they are drawn with does.
fn uniform(index: u64) -> f64 {
    let mut z = index.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// What the film holds, row by row over its window.
struct Copied {
    halves: Vec<[[f32; 3]; 2]>,
    means: Vec<[f32; 3]>,
    counts: Vec<u32>,
}

impl Copied {
    fn of(film: &Film, window: Window) -> Self {
        let pixels = window.pixels();
        let mut copied = Self {
            halves: vec![[[0.0; 3]; 2]; pixels],
            means: vec![[0.0; 3]; pixels],
            counts: vec![0; pixels],
        };
        let [across, down] = film.layout().tiles();
        for index in 0..across as usize * down as usize {
            let tile = film.tile(index);
            for y in tile.window.y0..tile.window.y1 {
                for x in tile.window.x0..tile.window.x1 {
                    let replicates = tile.replicates(x - tile.window.x0, y - tile.window.y0);
                    let place = ((y - window.y0) * window.width() + x - window.x0) as usize;
                    copied.counts[place] = replicates.iter().map(|r| r.count).sum();
                    let rgb = |r: usize| replicates[r].mean().map_or([0.0; 3], |m| [m[0], m[1], m[2]]);
                    copied.halves[place] = [rgb(0), rgb(1)];
                    copied.means[place] = [0, 1, 2].map(|c| {
                        let sum: f64 = replicates.iter().map(|r| f64::from(r.sum[c])).sum();
                        (sum / f64::from(copied.counts[place].max(1))) as f32
                    });
                }
            }
        }
        copied
    }
}

/// Means of two replicates that the film has no samples of.
fn draw_again<T: Tracer>(tracer: &T, window: Window, pick: &Pick) -> [[f32; 3]; 2] {
    let (x, y) = (pick.pixel as u32 % window.width(), pick.pixel as u32 / window.width());
    // There are 256 replicates in all; only in the tiniest pictures is a pixel picked 127 times.
    let pair = 1 + pick.repeat % 126;
    [0, 1].map(|half| {
        let replicate = (REPLICATES as u32 * pair + half) as u8;
        let work = PixelWork {
            x: window.x0 + x,
            y: window.y0 + y,
            pixel: 0,
            replicate,
            first: 0,
            count: pick.samples,
        };
        let mut mean = Mean::default();
        tracer.render_tile(&[work], &mut mean);
        mean.sum.map(|sum| (sum / mean.count.max(1.0)) as f32)
    })
}

/// Sum of the samples that a film would accept.
#[derive(Default)]
struct Mean {
    sum: [f64; 3],
    count: f64,
}

impl SampleSink for Mean {
    fn add(&mut self, _: &PixelWork, _: u32, sample: &Sample) {
        let values = sample.radiance.to_array();
        // Written so that NaN fails too.
        if values.iter().all(|value| value.abs() <= MAX_MAGNITUDE) {
            self.sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += f64::from(value));
            self.count += 1.0;
        }
    }
}
