//! How the error of a scene falls with samples, before its picture has enough of them to say so itself: from fresh samples of
//! a few pixels, which decide nothing and are only for the guess at the end.
//!
//! Halves of a picture with a handful of samples per pixel are no guide: what is displayed is clipped, bends near black, and
//! rare bright paths were not met yet. So some pixels are drawn with as many samples as a picture may end with.
//! With m the mean of n of these samples, v and w the means of others, and g what a display shows,
//! `(g(m) - g(v)) (g(m) - g(w))` has the expectation of the squared error of n samples, as in [`crate::noise`].
//!
//! Error differs from pixel to pixel more than anything else: many pixels say more than many samples of each. How it goes on
//! beyond a few samples, however, is the scene's own (low-discrepancy points fill gaps, rare paths are met). So half of the
//! samples go to many *shallow* pixels, and half to a few *deep* ones among them, with as many samples as the finished picture
//! will have there; what deep ones say of the fall goes for all (as in Giles 2008, *Multilevel Monte Carlo Path Simulation*,
//! but as a ratio).

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

/// Samples of each of the four replicates of a pixel: of shallow ones, and of deep ones the least that tells of the samples
/// they are to have. Errors are found of 2, 4, ... samples up to twice as many.
const DEPTHS: [usize; 3] = [16, 64, 256];

/// What a pixel is to have is told by this share of it: half an octave is soon guessed.
const ENOUGH: f64 = 0.7;

/// Logarithm of the noise of a sample over what it was at half the samples, before a scene has shown it, and its variance: it
/// grows where rare bright paths were hardly met, and falls where low-discrepancy points fill gaps.
const GROWTH: (f64, f64) = (-0.07, 0.02);

/// Variance by which that changes from one doubling of the samples to the next.
const GROWTH_DRIFT: f64 = 0.004;

/// What is left of growth at the next doubling.
const FADING: f64 = 0.7;

/// Doublings that are looked at: the samples of a pixel are a 32 bit number.
const MOST_DOUBLINGS: usize = 31;

/// Replicates that neither pictures nor measurements of their noise use.
const REPLICATES: [u8; 4] = [252, 253, 254, 255];

/// Longest time that it keeps its caller.
const SLICE: Duration = Duration::from_millis(100);

/// A positive number, as far as it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Known {
    pub(crate) value: f64,
    /// Variance of its logarithm.
    pub(crate) variance: f64,
}

/// Pixels drawn so far.
#[derive(Default)]
pub(crate) struct Scout {
    picks: Vec<Pick>,
    curves: Vec<Curve>,
    /// Samples of shallow and of deep pixels.
    samples: [usize; 2],
    /// How long that took.
    took: Duration,
    /// Samples that pixels are to have in the end, as far as that was foreseen.
    wanted: Vec<f64>,
    growth: Growth,
    is_over: bool,
}

/// What was found of a pixel.
struct Curve {
    /// How many pixels it stands for, relative to the mean.
    weight: f64,
    /// Which of [`DEPTHS`] it was drawn to.
    level: usize,
    /// Mean squared error of 2, 4, 8, ... samples, times that number. An estimate of it, which may be below 0.
    noises: Vec<f64>,
}

impl Curve {
    /// Mean squared error of `samples` samples, and the doublings that it was not drawn to.
    fn square(&self, samples: f64, growth: &Growth) -> (f64, f64) {
        let place = samples.max(2.0).log2() - 1.0;
        let (last, before, share) = (self.noises.len() - 1, place as usize, place.fract());
        let (noise, beyond) = match self.noises.get(before + 1) {
            Some(next) => ((1.0 - share) * self.noises[before] + share * next, 0.0),
            None => {
                (self.noises[last] * (growth.at(place) - growth.at(last as f64)).exp(), place - last as f64)
            }
        };
        (growth.unfilled(samples) * noise / samples, beyond)
    }
}

/// How the noise of a sample grows with their number, by all pixels.
#[derive(Default)]
struct Growth {
    /// Logarithm of what it grows by from 2 samples to 4, 8, ...
    until: Vec<f64>,
    /// Variance of that of a doubling that no pixel was drawn to.
    beyond: f64,
}

impl Growth {
    /// By what pixels show, as far as it is more than chance: from doubling to doubling, since one is much like the next (a
    /// Kalman filter).
    fn of(curves: &[Curve]) -> Self {
        let (mut mean, mut variance) = GROWTH;
        let mut growth = Self { until: vec![0.0], beyond: variance };
        for doubling in 0..MOST_DOUBLINGS {
            // Rare paths are met sooner or later, but gaps are filled for ever.
            mean = if mean > 0.0 { FADING * mean } else { mean };
            if let Some(shown) = shown_growth(curves, doubling) {
                variance += GROWTH_DRIFT;
                let gain = variance / (variance + shown.variance);
                mean += gain * (shown.value.ln() - mean);
                variance *= 1.0 - gain;
                growth.beyond = variance + GROWTH_DRIFT;
            }
            growth.until.push(growth.until[doubling] + mean);
        }
        growth
    }

    /// Its logarithm up to `place`, in doublings from 2 samples.
    fn at(&self, place: f64) -> f64 {
        let (before, share) = ((place as usize).min(MOST_DOUBLINGS - 1), place.fract());
        (1.0 - share) * self.until[before] + share * self.until[before + 1]
    }

    /// What the noise of a sample is multiplied by where their number is no power of two: low-discrepancy points fill gaps at
    /// these. What comes after a whole block is as noisy as a smaller block, as the binary digits say.
    fn unfilled(&self, samples: f64) -> f64 {
        let half = ((samples / 2.0) as u32).max(1);
        let now = self.at(f64::from(half).log2());
        let digits = (0..MOST_DOUBLINGS).filter(|digit| half >> digit & 1 == 1);
        let noise = |digit: usize| f64::from(1u32 << digit) * (self.until[digit] - now).max(0.0).exp();
        digits.map(noise).sum::<f64>() / f64::from(half)
    }
}

/// By how much the noise of a sample grew at one doubling, in pixels that were drawn so far; `None` where chance is all.
fn shown_growth(curves: &[Curve], doubling: usize) -> Option<Known> {
    let pairs = || {
        let pair = |curve: &Curve| {
            let after = *curve.noises.get(doubling + 1)?;
            Some((curve.weight * curve.noises[doubling], curve.weight * after))
        };
        curves.iter().filter_map(pair)
    };
    let (early, late) = pairs().fold((0.0, 0.0), |sum, pair| (sum.0 + pair.0, sum.1 + pair.1));
    let ratio = late / early;
    let off: f64 = pairs().map(|(early, late)| (late - ratio * early).powi(2)).sum();
    let is_known = early > 0.0 && late > 0.0 && pairs().count() >= LEAST_PICKS;
    is_known.then(|| Known { value: ratio, variance: off / late.powi(2) })
}

/// Squared errors of all pixels, each as much as it counts.
struct Squares {
    values: Vec<f64>,
    mean: f64,
    /// Variance of the mean relative to it, by chance and by how little is known of the fall.
    variance: [f64; 2],
}

impl Squares {
    fn covariance(&self, other: &Self) -> f64 {
        let n = self.values.len() as f64;
        let product = |(a, b): (&f64, &f64)| (a - self.mean) * (b - other.mean);
        let sum: f64 = self.values.iter().zip(&other.values).map(product).sum();
        sum / (n * (n - 1.0) * self.mean * other.mean)
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
        (self.samples[0] + self.samples[1]) as f64
    }

    /// Seconds that it took.
    pub(crate) fn seconds(&self) -> f64 {
        self.took.as_secs_f64()
    }

    /// Samples that pixels, in their order, are to have in the end.
    pub(crate) fn want(&mut self, samples: impl Fn(usize) -> f64) {
        self.wanted = (0..self.curves.len()).map(samples).collect();
    }

    /// Draws pixels for a moment, so that there will be about `most` samples in the end.
    pub(crate) fn advance<T: Tracer>(&mut self, tracer: &T, window: Window, most: f64) {
        let (began, before) = (Instant::now(), self.samples());
        while !self.is_over && self.samples() < most && began.elapsed() < SLICE {
            let Some((number, level)) = self.next() else { break };
            let pick = &self.picks[place(number)];
            // Where the tracer panics the render will find out, or has its luck: a guess is not worth it.
            let drawn = catch_unwind(AssertUnwindSafe(|| draw(tracer, window, pick, level)));
            self.is_over = drawn.is_err();
            self.samples[usize::from(level > 0)] += REPLICATES.len() * DEPTHS[level];
            match (self.curves.get_mut(number), drawn) {
                (Some(curve), Ok(deeper)) => *curve = deeper,
                (None, Ok(curve)) => self.curves.push(curve),
                (_, Err(_)) => {}
            }
        }
        self.took += began.elapsed();
        if self.samples() > before {
            self.growth = Growth::of(&self.curves);
        }
    }

    /// The pixel to draw next, and its level: a deep one while there are no more samples of these.
    fn next(&self) -> Option<(usize, usize)> {
        let new = self.curves.len();
        let shallow = (new < self.picks.len()).then_some((new, 0));
        let [spent, spent_deep] = self.samples;
        if spent_deep > spent && shallow.is_some() {
            return shallow;
        }
        let deeper = |(number, &wanted): (usize, &f64)| {
            let level = DEPTHS.iter().position(|&depth| 2.0 * depth as f64 >= ENOUGH * wanted);
            let level = level.unwrap_or(DEPTHS.len() - 1);
            (level > self.curves[number].level).then_some((number, level))
        };
        self.wanted.iter().enumerate().find_map(deeper).or(shallow)
    }

    /// The pixels, in the order in which they are drawn.
    pub(crate) fn pixels(&self) -> impl Iterator<Item = usize> {
        (0..self.picks.len()).map(|number| self.picks[place(number)].pixel)
    }

    /// Mean squared error of a picture whose scouted pixels, in their order, have so many samples; `None` where chance is all.
    pub(crate) fn square(&self, samples: impl Fn(usize) -> f64) -> Option<Known> {
        let squares = self.squares(samples)?;
        let variance = squares.variance.iter().sum();
        (squares.mean > 0.0).then_some(Known { value: squares.mean, variance })
    }

    /// The same where it was `measured` when they had other numbers of samples, `from`: the same few pixels make both large,
    /// so that what was measured takes off most of their chance (the regression estimator of sampling theory).
    pub(crate) fn square_given(
        &self,
        measured: Known,
        from: impl Fn(usize) -> f64,
        samples: impl Fn(usize) -> f64,
    ) -> Option<Known> {
        let (then, now) = (self.squares(samples)?, self.squares(from)?);
        if then.mean <= 0.0 || now.mean <= 0.0 {
            return None;
        }
        let [chance, fall] = then.variance;
        let (shared, known) = (then.covariance(&now), now.variance[0] + measured.variance);
        let share = (shared / known).clamp(0.0, 1.0);
        let value = then.mean * (measured.value / now.mean).powf(share);
        let chance = chance + share * (share * known - 2.0 * shared);
        Some(Known { value, variance: chance.max(0.0) + fall })
    }

    /// `None` where too few pixels were drawn.
    fn squares(&self, samples: impl Fn(usize) -> f64) -> Option<Squares> {
        if self.curves.len() < LEAST_PICKS {
            return None;
        }
        let mut beyond = 0.0;
        let square = |(number, curve): (usize, &Curve)| {
            let (square, doublings) = curve.square(samples(number), &self.growth);
            beyond += curve.weight * square * doublings;
            curve.weight * square
        };
        let values: Vec<f64> = self.curves.iter().enumerate().map(square).collect();
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let chance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0) / n;
        let fall = (beyond / n / mean).powi(2) * self.growth.beyond;
        Some(Squares { values, mean, variance: [chance / mean.powi(2), fall] })
    }
}

/// Which pick is drawn as number `number`: any beginning of this order is spread over all picks.
fn place(number: usize) -> usize {
    (number * 2533) % MOST_PICKS
}

/// Draws a pixel and finds how its error falls.
fn draw<T: Tracer>(tracer: &T, window: Window, pick: &Pick, level: usize) -> Curve {
    let depth = DEPTHS[level];
    let (x, y) =
        (window.x0 + pick.pixel as u32 % window.width(), window.y0 + pick.pixel as u32 / window.width());
    let [a, b, c, d] = REPLICATES.map(|replicate| {
        // A pixel that is picked again goes on where the last pick may have ended.
        let (first, count) = (pick.repeat * DEPTHS[DEPTHS.len() - 1] as u32, depth as u32);
        let mut sums = Sums::default();
        tracer.render_tile(&[PixelWork { x, y, pixel: 0, replicate, first, count }], &mut sums);
        sums.0.resize(depth + 1, sums.0.last().copied().unwrap_or_default());
        sums.0
    });
    let noise = |size: usize| {
        let square = square([&a, &b], [&c, &d], size) + square([&c, &d], [&a, &b], size);
        0.5 * size as f64 * square
    };
    let sizes = std::iter::successors(Some(2), |size| Some(2 * size)).take_while(|&size| size <= 2 * depth);
    Curve { weight: pick.weight, level, noises: sizes.map(noise).collect() }
}

/// Mean squared error of `size` samples, half of them of each of two replicates, by all blocks of them there are; against two
/// others.
fn square(own: [&[[f64; 3]]; 2], others: [&[[f64; 3]]; 2], size: usize) -> f64 {
    let (half, depth) = (size / 2, own[0].len() - 1);
    let shown = |value: f64| displayed(value as f32);
    let others = others.map(|sums| sums[depth].map(|sum| shown(sum / depth as f64)));
    let blocks = (0..depth / half).map(|block| {
        let channels = (0..3).map(|c| {
            let inside = |sums: &[[f64; 3]]| sums[(block + 1) * half][c] - sums[block * half][c];
            let mean = shown((inside(own[0]) + inside(own[1])) / size as f64);
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

#[cfg(test)]
mod tests {
    use quietus_trace::tile::TileCounts;

    use super::*;

    /// Pixels in a row, each with independent noise of its own around a grey where the display's curve is nearly straight.
    struct Row;

    const WIDTH: u32 = 4096;
    const GREY: f64 = 0.25;

    /// Standard deviation of a sample.
    fn deviation(x: u32) -> f64 {
        0.01 + 0.03 * f64::from(x % 4)
    }

    /// Mean squared error as displayed of so many samples of every pixel: the slope of the square root at a quarter is 1.
    fn truth(samples: f64) -> f64 {
        (0..WIDTH).map(|x| deviation(x).powi(2) / samples).sum::<f64>() / f64::from(WIDTH)
    }

    impl Tracer for Row {
        fn render_tile(&self, work: &[PixelWork], sink: &mut impl SampleSink) -> TileCounts {
            for run in work {
                for index in run.first..run.first + run.count {
                    let number = u64::from(run.x) << 40 | u64::from(run.replicate) << 32 | u64::from(index);
                    let noise = 12f64.sqrt() * (uniform(number) - 0.5) * deviation(run.x);
                    let radiance = glam::Vec3::splat((GREY + noise) as f32);
                    sink.add(run, index, &Sample { radiance, ..Sample::default() });
                }
            }
            TileCounts::default()
        }
    }

    fn scouted(want: f64, most: f64) -> Scout {
        let grey = [GREY as f32; 3];
        let halves: Vec<_> = (0..WIDTH).map(|x| [grey, grey.map(|g| g + deviation(x) as f32)]).collect();
        let (means, counts) = (vec![grey; WIDTH as usize], vec![4; WIDTH as usize]);
        let picture = Finished {
            width: WIDTH as usize,
            halves: &halves,
            means: &means,
            counts: &counts,
            weights: None,
            aovs: None,
        };
        let window = Window { x0: 0, y0: 0, x1: WIDTH, y1: 1 };
        let mut scout = Scout::default();
        scout.choose(&picture);
        for most in (1..=20).map(|twentieth| 0.05 * f64::from(twentieth) * most) {
            scout.advance(&Row, window, most);
            scout.want(|_| want);
        }
        scout
    }

    #[test]
    fn scouted_pixels_know_the_error_of_pictures_with_other_numbers_of_samples() {
        let scout = scouted(400.0, 2e6);
        assert!(scout.samples[1] > 100_000, "no deep pixels: {:?}", scout.samples);
        for samples in [4.0, 20.0, 64.0, 400.0] {
            let known = scout.square(|_| samples).unwrap();
            let off = (known.value / truth(samples)).ln();
            // Twice in a million.
            assert!(off.abs() < 4.75 * known.variance.sqrt(), "{samples}: {off} {known:?}");
            assert!(known.variance < 0.04, "{samples}: {known:?}");
        }
    }

    #[test]
    fn what_was_measured_takes_off_chance() {
        let scout = scouted(20.0, 250_000.0);
        let alone = scout.square(|_| 40.0).unwrap();
        let measured = Known { value: truth(20.0), variance: 1e-6 };
        let given = scout.square_given(measured, |_| 20.0, |_| 40.0).unwrap();
        assert!(given.variance < alone.variance, "{given:?} {alone:?}");
        // A measurement that knows nothing changes nothing.
        let rough = Known { value: 3.0 * truth(20.0), variance: 1e6 };
        let same = scout.square_given(rough, |_| 20.0, |_| 40.0).unwrap();
        assert!((same.value / alone.value - 1.0).abs() < 1e-3 && same.variance <= alone.variance);
    }

    fn curve(noises: &[f64]) -> Curve {
        Curve { weight: 1.0, level: 0, noises: noises.to_vec() }
    }

    #[test]
    fn deep_pixels_tell_how_the_noise_of_all_goes_on() {
        let mut curves: Vec<_> = (0..100).map(|_| curve(&[1.0, 1.0, 1.0, 1.0, 2.0])).collect();
        curves.extend((0..100).map(|_| curve(&[1.0, 1.0, 1.0, 1.0, 2.0, 4.0, 4.0])));
        let growth = Growth::of(&curves);
        let noise = |samples: f64| samples * curves[0].square(samples, &growth).0;
        assert!((noise(32.0) - 2.0).abs() < 1e-9 && (noise(64.0) / 4.0 - 1.0).abs() < 0.01);
        assert!((noise(128.0) / 4.0 - 1.0).abs() < 0.01);
        // The deep ones know; the others lack two doublings.
        assert_eq!(curves[150].square(128.0, &growth).1, 0.0);
        assert!((curves[0].square(128.0, &growth).1 - 2.0).abs() < 1e-9);
    }

    #[test]
    fn what_comes_after_a_whole_block_is_as_noisy_as_a_smaller_one() {
        // Noise of a sample halves with every doubling: the error falls as the square of the samples.
        let curves: Vec<_> = (0..100).map(|_| curve(&[1.0, 0.5, 0.25, 0.125, 0.0625])).collect();
        let growth = Growth::of(&curves);
        let square = |samples: f64| curves[0].square(samples, &growth).0;
        assert!((square(16.0) * 16.0 / 0.125 - 1.0).abs() < 1e-6);
        // Eight and one of each replicate: little better than eight.
        assert!(square(18.0) > 0.9 * square(16.0), "{} {}", square(18.0), square(16.0));
    }
}
