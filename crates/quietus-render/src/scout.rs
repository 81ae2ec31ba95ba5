//! How the error of a scene falls with samples, before its picture has enough of them to say so itself: from fresh samples of
//! a few pixels, which decide nothing and are only for the guess at the end.
//!
//! Halves of a picture with a handful of samples per pixel are no guide: what is displayed is clipped, bends near black, and
//! rare bright paths were not met yet. So some pixels are drawn with as many samples as a picture may end with.
//! With m the mean of n of these samples, v and w the means of others, and g what a display shows,
//! `(g(m) - g(v)) (g(m) - g(w))` has the expectation of the squared error of n samples, as in [`crate::noise`].

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use quietus_film::Window;
use quietus_trace::tile::{PixelWork, Sample, SampleSink};

use crate::noise::{Finished, MAX_MAGNITUDE, Pick, displayed, pick_by, uniform};
use crate::tracer::Tracer;

/// Pixels that are drawn at most. A power of two.
const MOST_PICKS: usize = 4096;

/// Pixels before whose samples nothing is said.
const LEAST_PICKS: usize = 32;

/// Samples of each of the four replicates of a pixel. Error differs from pixel to pixel more than anything else: many pixels
/// say more than many samples of each.
const DEPTH: usize = 16;

/// Numbers of samples, of two replicates, whose error is found.
const SIZES: [u32; 5] = [2, 4, 8, 16, 32];

/// Logarithm of the noise of a sample over what it was at a quarter of the samples, before a scene has shown it, and its
/// variance: it grows where rare bright paths were hardly met, and falls where low-discrepancy points fill gaps.
const GROWTH: (f64, f64) = (-0.14, 0.04);

/// Growths that are believed, and go on for as much again.
const GROWTHS: std::ops::RangeInclusive<f64> = 0.8..=1.6;

/// Replicates that neither pictures nor measurements of their noise use.
const REPLICATES: [u8; 4] = [252, 253, 254, 255];

/// Longest time that it keeps its caller.
const SLICE: Duration = Duration::from_millis(25);

/// Pixels drawn so far.
#[derive(Default)]
pub(crate) struct Scout {
    picks: Vec<Pick>,
    curves: Vec<Curve>,
    samples: usize,
    /// What the noise of a sample is multiplied by where samples are, beyond those drawn, four times as many.
    growth: f64,
    is_over: bool,
}

/// How the error of one pixel falls.
struct Curve {
    pixel: usize,
    /// How many pixels it stands for, relative to the mean.
    weight: f64,
    /// Mean squared error of as many samples as [`SIZES`] says, times that number. An estimate of it, which may be below 0.
    noises: [f64; SIZES.len()],
}

impl Curve {
    /// Mean squared error of `samples` samples.
    fn square(&self, samples: f64, growth: f64) -> f64 {
        let last = self.noises.len() - 1;
        let place = samples.max(2.0).log2() - 1.0;
        let (first, share) = ((place as usize).min(last), place.fract());
        let noise = match self.noises.get(first + 1) {
            Some(next) => (1.0 - share) * self.noises[first] + share * next,
            None => self.noises[last] * growth.powf(0.5 * (place - last as f64)),
        };
        noise / samples
    }
}

impl Scout {
    /// Whether pixels were chosen.
    pub(crate) fn has_picks(&self) -> bool {
        !self.picks.is_empty()
    }

    /// Chooses the pixels: most of them where the halves of the picture differ.
    pub(crate) fn choose(&mut self, picture: &Finished<'_>) {
        let offset = 1 << 60;
        self.picks = pick_by(picture, MOST_PICKS, |_| 0, |index| uniform(offset + index));
    }

    /// Samples drawn so far.
    pub(crate) fn samples(&self) -> f64 {
        self.samples as f64
    }

    /// Draws pixels for a moment, so that there will be about `most` samples in the end.
    pub(crate) fn advance<T: Tracer>(&mut self, tracer: &T, window: Window, most: f64) {
        let began = Instant::now();
        while !self.is_over && self.samples() < most && began.elapsed() < SLICE {
            // Any beginning of this order is spread over all picks.
            let next = (self.curves.len() * 2533) % MOST_PICKS;
            let Some(pick) = self.picks.get(next).filter(|_| self.curves.len() < MOST_PICKS) else { break };
            // Where the tracer panics the render will find out, or has its luck: a guess is not worth it.
            let drawn = catch_unwind(AssertUnwindSafe(|| draw(tracer, window, pick)));
            self.is_over = drawn.is_err();
            self.samples += REPLICATES.len() * DEPTH;
            self.curves.extend(drawn);
        }
        self.growth = self.growth();
    }

    /// What the noise of a sample is multiplied by at four times the samples: what pixels show, as far as it is more than chance.
    fn growth(&self) -> f64 {
        let (before, after) = (SIZES.len() - 3, SIZES.len() - 1);
        let sum = |value: &dyn Fn(&Curve) -> f64| -> f64 { self.curves.iter().map(value).sum() };
        let [early, late] = [before, after].map(|size| sum(&|curve| curve.weight * curve.noises[size]));
        let ratio = late / early;
        let off =
            |curve: &Curve| (curve.weight * (curve.noises[after] - ratio * curve.noises[before])).powi(2);
        let (expected, believed) = GROWTH;
        let gain = believed / (believed + sum(&off) / late.powi(2));
        let growth = (expected + gain * (ratio.ln() - expected)).exp();
        if growth.is_finite() { growth.clamp(*GROWTHS.start(), *GROWTHS.end()) } else { expected.exp() }
    }

    /// The pixels drawn so far, row by row.
    pub(crate) fn pixels(&self) -> impl Iterator<Item = usize> {
        self.curves.iter().map(|curve| curve.pixel)
    }

    /// Whether enough was drawn to say something.
    pub(crate) fn is_enough(&self) -> bool {
        self.curves.len() >= LEAST_PICKS
    }

    /// Mean squared error of a picture whose scouted pixels, in their order, have `samples`, and its standard
    /// deviation relative to it. An estimate, which may be below 0.
    pub(crate) fn square(&self, samples: impl Fn(usize) -> f64) -> (f64, f64) {
        let n = self.curves.len() as f64;
        let values = self.squares(samples);
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0) / n;
        (mean, variance.sqrt() / mean)
    }

    /// What the mean squared error is multiplied by where scouted pixels, in their order, come from so many samples to so many,
    /// and the standard deviation of that relative to it: less than that of the error, as the pixels that make the one large
    /// make the other large.
    pub(crate) fn fall(&self, from: impl Fn(usize) -> f64, to: impl Fn(usize) -> f64) -> (f64, f64) {
        let (before, after) = (self.squares(from), self.squares(to));
        let (sum_before, sum_after) = (before.iter().sum::<f64>(), after.iter().sum::<f64>());
        let fall = sum_after / sum_before;
        let off: f64 = before.iter().zip(&after).map(|(before, after)| (after - fall * before).powi(2)).sum();
        (fall, off.sqrt() / sum_after)
    }

    /// Squared errors of scouted pixels, each as much as it counts.
    fn squares(&self, samples: impl Fn(usize) -> f64) -> Vec<f64> {
        let square =
            |(number, curve): (usize, &Curve)| curve.weight * curve.square(samples(number), self.growth);
        self.curves.iter().enumerate().map(square).collect()
    }
}

/// Draws a pixel and finds how its error falls.
fn draw<T: Tracer>(tracer: &T, window: Window, pick: &Pick) -> Curve {
    let (x, y) =
        (window.x0 + pick.pixel as u32 % window.width(), window.y0 + pick.pixel as u32 / window.width());
    let [a, b, c, d] = REPLICATES.map(|replicate| {
        // A pixel that is picked again goes on where the last pick ended.
        let (first, count) = (pick.repeat * DEPTH as u32, DEPTH as u32);
        let mut sums = Sums::default();
        tracer.render_tile(&[PixelWork { x, y, pixel: 0, replicate, first, count }], &mut sums);
        sums.0.resize(DEPTH + 1, sums.0.last().copied().unwrap_or_default());
        sums.0
    });
    let noise = |size: u32| {
        let square = square([&a, &b], [&c, &d], size) + square([&c, &d], [&a, &b], size);
        0.5 * f64::from(size) * square
    };
    Curve { pixel: pick.pixel, weight: pick.weight, noises: SIZES.map(noise) }
}

/// Mean squared error of `size` samples, half of them of each of two replicates, by all blocks of them there are; against two
/// others.
fn square(own: [&[[f64; 3]]; 2], others: [&[[f64; 3]]; 2], size: u32) -> f64 {
    let (half, depth) = (size as usize / 2, own[0].len() - 1);
    let shown = |value: f64| displayed(value as f32);
    let others = others.map(|sums| sums[depth].map(|sum| shown(sum / depth as f64)));
    let blocks = (0..depth / half).map(|block| {
        let channels = (0..3).map(|c| {
            let inside = |sums: &[[f64; 3]]| sums[(block + 1) * half][c] - sums[block * half][c];
            let mean = shown((inside(own[0]) + inside(own[1])) / f64::from(size));
            (mean - others[0][c]) * (mean - others[1][c])
        });
        channels.sum::<f64>() / 3.0
    });
    blocks.sum::<f64>() / (depth / half) as f64
}

/// Sums of the first samples, for every number of them. Rejected ones count as black, seldom as they are.
struct Sums(Vec<[f64; 3]>);

impl Default for Sums {
    fn default() -> Self {
        Self(vec![[0.0; 3]])
    }
}

impl SampleSink for Sums {
    fn add(&mut self, _: &PixelWork, _: u32, sample: &Sample) {
        let last = self.0.last().copied().unwrap_or_default();
        let values = sample.radiance.to_array();
        let is_sound = values.iter().all(|value| value.abs() <= MAX_MAGNITUDE);
        self.0.push([0, 1, 2].map(|c| last[c] + if is_sound { f64::from(values[c]) } else { 0.0 }));
    }
}
