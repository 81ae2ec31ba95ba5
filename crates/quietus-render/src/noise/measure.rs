//! Draws the picked pixels again.

use std::num::NonZeroUsize;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Instant;

use quietus_film::{Film, Window};
use quietus_trace::tile::{PixelWork, Sample, SampleSink};

use super::{
    Aov, AovValues, Effort, Falling, Finished, FreshMean, LEAST_PICKS, Noise, OfAovs, Pick, estimate, pick,
    uniform,
};
use crate::aov_demand::AovDemand;
use crate::crew;
use crate::live::Live;
use crate::pixel_errors::REPLICATES;
use crate::run::{Counters, RenderError, Rendered, lock};
use crate::tracer::Tracer;
use crate::weights::Weights;

/// Largest value that the film accepts.
pub(crate) const MAX_MAGNITUDE: f32 = 1e28;

/// Measures the noise of what was rendered, by drawing about 2 % of its samples again with other random numbers. The
/// result does not depend on the number of threads. `None` where `cancel` is set, or nothing was drawn.
pub fn measure_noise<T: Tracer>(
    tracer: &T,
    rendered: &Rendered,
    threads: NonZeroUsize,
    cancel: &AtomicBool,
) -> Option<Noise> {
    let counters: Vec<_> = (0..threads.get()).map(|_| Counters::default()).collect();
    let picture = Copied::of(&rendered.film, rendered.weights.as_deref(), None);
    let window = rendered.film.layout().window();
    let measuring =
        Measuring { tracer, window, live: None, counters: &counters, number: 0, effort: Effort::REPORT };
    // Relaxed: the flag guards no data.
    let is_cancelled = || cancel.load(Ordering::Relaxed);
    let measured = measuring.run(&picture, is_cancelled, |_| false, || crew::WATCH_INTERVAL).ok().flatten();
    measured.map(|measured| measured.noise)
}

/// The noise of a picture, and of what goes with it where that was wanted.
#[derive(Clone, Debug)]
pub(crate) struct Measured {
    pub(crate) noise: Noise,
    pub(crate) falling: Falling,
    pub(crate) aovs: OfAovs<Noise>,
}

/// How the noise of a picture is measured.
pub(crate) struct Measuring<'a, T> {
    pub(crate) tracer: &'a T,
    pub(crate) window: Window,
    pub(crate) live: Option<&'a Live>,
    /// One for each thread.
    pub(crate) counters: &'a [Counters],
    /// Which measurement of this picture it is, from 0: each has random numbers of its own.
    pub(crate) number: u32,
    pub(crate) effort: Effort,
}

impl<T: Tracer> Measuring<'_, T> {
    /// Measures the noise of a picture, with fewer picks where so many that were begun are enough. `None` where it is cancelled,
    /// nothing was drawn, or too little. `watch` is called meanwhile, again and again, at intervals that it returns.
    pub(crate) fn run(
        &self,
        picture: &Copied,
        is_cancelled: impl Fn() -> bool + Sync,
        is_enough: impl Fn(usize) -> bool + Sync,
        watch: impl FnMut() -> crew::Interval,
    ) -> Result<Option<Measured>, RenderError> {
        if picture.counts.iter().all(|&count| count == 0) {
            return Ok(None);
        }
        let salt = u64::from(self.number) << 32;
        let picks = pick(&picture.finished(), self.effort, |index| uniform(salt + index));
        let (next, fresh) = (AtomicUsize::new(0), Mutex::new(vec![None; picks.len()]));
        let stride = golden_stride(picks.len());
        let is_given_up = AtomicBool::new(false);
        let work = |number: usize| {
            let mut drawn = Vec::new();
            // Relaxed: numbers and flags that guard no data.
            while !is_cancelled() && !is_given_up.load(Ordering::Relaxed) {
                if let Some(live) = self.live {
                    live.pass_gate(&is_cancelled);
                }
                let begun = next.fetch_add(1, Ordering::Relaxed);
                if begun >= picks.len() || is_enough(begun) {
                    break;
                }
                // However many are drawn in the end: they are spread over the picture.
                let index = begun * stride % picks.len();
                drawn.push((index, self.draw_again(&picks[index], &self.counters[number])));
            }
            let mut fresh = lock(&fresh);
            drawn.into_iter().for_each(|(index, values)| fresh[index] = Some(values));
        };
        crew::run(self.counters.len(), work, || is_given_up.store(true, Ordering::Relaxed), watch)?;
        let fresh = lock(&fresh);
        let drawn = picks.iter().zip(fresh.iter()).filter_map(|(pick, fresh)| Some((*pick, (*fresh)?)));
        let (picks, fresh): (Vec<_>, Vec<_>) = drawn.unzip();
        let is_known = !is_cancelled() && picks.len() >= LEAST_PICKS;
        Ok(is_known.then(|| picture.measured(&picks, &fresh)))
    }

    /// Means of two replicates that the film has no samples of.
    fn draw_again(&self, pick: &Pick, counters: &Counters) -> [Fresh; 2] {
        let width = self.window.width();
        let (x, y) = (self.window.x0 + pick.pixel as u32 % width, self.window.y0 + pick.pixel as u32 / width);
        // There are 256 replicates in all; the scout has the last four. Measurements of one picture share some only
        // where they pick a pixel this often, as in the tiniest ones.
        let pair = 1 + (REPEATS * self.number + pick.repeat) % 125;
        [0, 1].map(|half| {
            let replicate = (REPLICATES as u32 * pair + half) as u8;
            let work = PixelWork { x, y, pixel: 0, replicate, first: 0, count: pick.samples };
            let mut mean = Mean::default();
            let began = Instant::now();
            let traced = self.tracer.render_tile(&[work], &mut mean);
            counters.add(pick.samples.into(), traced, began.elapsed());
            mean.fresh()
        })
    }
}

/// A stride by which one comes to all of `count` places, and spreads over them evenly from the first few on: about the golden
/// ratio of it.
fn golden_stride(count: usize) -> usize {
    let gcd = |mut a: usize, mut b: usize| {
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    let about = (0.618_034 * count as f64) as usize;
    (about.max(1)..count).find(|&stride| gcd(stride, count) == 1).unwrap_or(1)
}

/// Picks of one pixel in a measurement that are sure not to share samples with the next measurement.
const REPEATS: u32 = 13;

/// What the film holds, row by row over its window.
pub(crate) struct Copied {
    width: usize,
    halves: Vec<[[f32; 3]; 2]>,
    means: Vec<[f32; 3]>,
    counts: Vec<u32>,
    weights: Option<Vec<f32>>,
    aovs: Option<Vec<AovValues>>,
    /// Their squared errors, as sums over what was asked for.
    aov_squares: Option<Vec<f64>>,
}

impl Copied {
    /// The picture as it is displayed, and its halves.
    pub(crate) fn finished(&self) -> Finished<'_> {
        let Self { width, halves, means, counts, weights, aov_squares, .. } = self;
        Finished {
            width: *width,
            halves,
            means,
            counts,
            weights: weights.as_deref(),
            aovs: aov_squares.as_deref(),
        }
    }

    /// Its noise from pixels that were drawn again.
    fn measured(&self, picks: &[Pick], fresh: &[[Fresh; 2]]) -> Measured {
        let colors: Vec<_> = fresh.iter().map(|fresh| fresh.map(|fresh| fresh.color)).collect();
        let aovs = self.aovs.as_ref().map(|means| {
            let fresh: Vec<_> = fresh.iter().map(|fresh| fresh.map(|fresh| fresh.aovs)).collect();
            Aov::ALL.map(|aov| Some(aov.noise(means, picks, &fresh)))
        });
        Measured {
            noise: estimate(&self.means, picks, &colors),
            falling: Falling::of(&self.means, &self.counts, picks, &colors),
            aovs: aovs.unwrap_or_default(),
        }
    }

    pub(crate) fn of(film: &Film, weights: Option<&Weights>, demand: Option<AovDemand>) -> Self {
        let window = film.layout().window();
        let pixels = window.pixels();
        let mut copied = Self {
            width: window.width() as usize,
            halves: vec![[[0.0; 3]; 2]; pixels],
            means: vec![[0.0; 3]; pixels],
            counts: vec![0; pixels],
            weights: weights.map(|weights| weights.of_window(window)),
            aovs: demand.map(|_| vec![[0.0; 7]; pixels]),
            aov_squares: demand.map(|_| vec![0.0; pixels]),
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
                    let count = copied.counts[place];
                    let mean = |c: usize| {
                        let sum: f64 = replicates.iter().map(|r| f64::from(r.sum[c])).sum();
                        (sum / f64::from(count.max(1))) as f32
                    };
                    copied.means[place] = [0, 1, 2].map(mean);
                    if let (Some(aovs), Some(squares), Some(demand)) =
                        (&mut copied.aovs, &mut copied.aov_squares, &demand)
                    {
                        let others = tile.aovs(x - tile.window.x0, y - tile.window.y0);
                        let ([r, g, b], [nx, ny, nz]) = (others.albedo(count), others.normal(count));
                        aovs[place] = [mean(3), r, g, b, nx, ny, nz];
                        squares[place] = demand.square(replicates, others) / f64::from(count.max(1));
                    }
                }
            }
        }
        copied
    }
}

/// Means of a replicate that the film does not have.
#[derive(Clone, Copy, Debug, Default)]
struct Fresh {
    color: FreshMean,
    aovs: AovValues,
}

/// Sum of the samples that a film would accept.
#[derive(Default)]
struct Mean {
    /// Radiance, alpha, albedo, normal.
    sum: [f64; 10],
    count: f64,
    /// Radiance of the first and second half of the samples, and how many these are.
    halves: [[f64; 4]; 2],
}

impl Mean {
    fn fresh(&self) -> Fresh {
        let [r, g, b, aovs @ ..] = self.sum.map(|sum| (sum / self.count.max(1.0)) as f32);
        let whole = [r, g, b];
        let is_cut = self.halves.iter().all(|half| half[3] > 0.0);
        let mean = |[r, g, b, count]: [f64; 4]| [r, g, b].map(|sum| (sum / count) as f32);
        let halves = if is_cut { self.halves.map(mean) } else { [whole; 2] };
        Fresh { color: FreshMean { whole, halves }, aovs }
    }
}

impl SampleSink for Mean {
    fn add(&mut self, work: &PixelWork, index: u32, sample: &Sample) {
        let (c, a, n) = (sample.radiance, sample.albedo, sample.normal);
        let values = [c.x, c.y, c.z, sample.alpha, a.x, a.y, a.z, n.x, n.y, n.z];
        // Written so that NaN fails too.
        if values.iter().all(|value| value.abs() <= MAX_MAGNITUDE) {
            self.sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += f64::from(value));
            self.count += 1.0;
            let half = &mut self.halves[usize::from(index - work.first >= work.count / 2)];
            let [r, g, b, count] = half;
            for (sum, value) in [(r, c.x), (g, c.y), (b, c.z), (count, 1.0)] {
                *sum += f64::from(value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use quietus_trace::tile::TileCounts;

    use super::*;
    use crate::noise::displayed;

    /// Grey, brighter to the right, with as much noise everywhere.
    struct Slope;

    impl Tracer for Slope {
        fn render_tile(&self, work: &[PixelWork], sink: &mut impl SampleSink) -> TileCounts {
            for run in work {
                for index in run.first..run.first + run.count {
                    let seed =
                        u64::from(run.x) << 40 | u64::from(run.y) << 24 | u64::from(run.replicate) << 16;
                    let value =
                        0.25 + 0.01 * run.x as f32 + 0.1 * (uniform(seed + u64::from(index)) as f32 - 0.5);
                    sink.add(run, index, &Sample { radiance: [value; 3].into(), ..Sample::default() });
                }
            }
            TileCounts::default()
        }
    }

    #[test]
    fn strides_lead_everywhere() {
        for count in 1..200 {
            let mut places: Vec<_> = (0..count).map(|begun| begun * golden_stride(count) % count).collect();
            // Of the first few none is far from all others.
            if count >= 100 {
                let mut first = places[..16].to_vec();
                first.sort_unstable();
                assert!(first.windows(2).all(|pair| pair[1] - pair[0] < count / 5), "{count}: {first:?}");
            }
            places.sort_unstable();
            assert!(places.into_iter().eq(0..count), "{count}");
        }
    }

    /// Time that is up leaves picks that stand for the picture, not for its top.
    #[test]
    fn a_measurement_that_ends_early_is_of_the_whole_picture() {
        let (window, pixels) = (Window { x0: 0, y0: 0, x1: 32, y1: 32 }, 32 * 32);
        // The lower half is off by 0.1, the upper half right.
        let truth = |pixel: usize| 0.25 + 0.01 * (pixel % 32) as f32;
        let shown = |pixel: usize| {
            let off = if pixel < pixels / 2 { 0.0 } else { 0.1 };
            ((displayed(truth(pixel)) + off) as f32).powi(2)
        };
        let picture = Copied {
            width: 32,
            halves: (0..pixels).map(|pixel| [[shown(pixel); 3]; 2]).collect(),
            means: (0..pixels).map(|pixel| [shown(pixel); 3]).collect(),
            counts: vec![64; pixels],
            weights: None,
            aovs: None,
            aov_squares: None,
        };
        let counters = [Counters::default(), Counters::default()];
        let effort = Effort { share: 1.0, picks: 0, most_share: 0.0 };
        let measuring =
            Measuring { tracer: &Slope, window, live: None, counters: &counters, number: 0, effort };
        let run = |enough: usize| {
            let is_enough = |begun| begun >= enough;
            measuring.run(&picture, || false, is_enough, || crew::WATCH_INTERVAL).unwrap()
        };
        let expected = 0.1 * 0.5_f64.sqrt();
        for enough in [100, usize::MAX] {
            let noise = run(enough).unwrap().noise;
            assert!((noise.reached / expected - 1.0).abs() < 0.05, "{enough}: {noise:?}");
        }
        assert!(run(LEAST_PICKS - 1).is_none());
    }
}
