//! What more samples will bring: counts and noise if all quotas were larger by a factor.

use quietus::{AdaptiveSampling, PassCounts, Policy};
use serde::{Deserialize, Serialize};

use crate::noise::{Finished, pooled_differences, squared_differences};

/// Pixels that a forecast looks at, about: spread evenly, they stand for all.
const PIXELS: usize = 1 << 16;

/// Largest factor that is looked at: beyond, every pixel is at its maximum. Below its inverse, none gets any more.
const LARGEST_FACTOR: f64 = 1e12;

/// Factors are found to this precision.
const FACTOR_STEP: f64 = 1.002;

/// And those of guesses to this one.
const GUESS_STEP: f64 = 1.03;

/// Logarithm of a fall below which the exponent is not learnt from it.
const LEAST_FALL: f64 = 0.3;

/// A pixel of the film.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Pixel {
    /// Its squared error by the difference of halves.
    square: f64,
    /// Its samples.
    count: u32,
    /// The samples it is to have as things are.
    quota: f64,
}

/// Where the picture would be with other quotas, relative to where it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ahead {
    /// What all quotas are multiplied by.
    pub(crate) factor: f64,
    /// Samples, over those there are.
    pub(crate) samples: f64,
    /// Mean squared error, over that there is.
    pub(crate) square: f64,
}

/// The pixels of a forecast that was made earlier.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Past(Vec<Pixel>);

impl Past {
    /// How fast the squared error has fallen until `later`, as the power of samples; `None` where there are too few more to
    /// tell.
    pub(crate) fn fall_to(&self, later: &Forecast) -> Option<f64> {
        let square = |of: fn(&Pixel, &Pixel) -> f64| -> f64 {
            self.0.iter().zip(&later.pixels).map(|(before, after)| of(before, after)).sum()
        };
        let before = square(|before, _| before.square);
        let expected =
            square(|before, after| before.square * f64::from(before.count) / f64::from(after.count));
        let fell = (before / square(|_, after| after.square)).ln();
        let expected = (before / expected).ln();
        (expected > LEAST_FALL && fell.is_finite()).then(|| fell / expected)
    }
}

/// A picture and its quotas, as of the end of a round.
#[derive(Clone)]
pub(crate) struct Forecast {
    pixels: Vec<Pixel>,
    /// Mean squared error by the difference of halves, in display space. Sampling that stops where halves agree makes
    /// it too small.
    pub(crate) square: f64,
    /// The counts that a pixel comes by, with the policy `quietus`; none with uniform sampling.
    steps: Vec<u32>,
    counts: PassCounts,
    /// The squared error falls as samples to the power of minus this.
    fall: f64,
}

impl Forecast {
    /// Of a picture as it was sampled, to the limits of `counts`; the squared error falls as that of independent samples.
    pub(crate) fn new(picture: &Finished<'_>, sampling: &AdaptiveSampling, counts: PassCounts) -> Self {
        let squares = pooled_differences(picture);
        // Squares are sums over three channels, and the mean of two halves is off by half their difference.
        let square = squares.iter().sum::<f64>() / squares.len() as f64 / 12.0;
        let stride = squares.len().div_ceil(PIXELS).max(1);
        let mut pixels = Vec::with_capacity(squares.len().div_ceil(stride));
        for_each_pixel(sampling, |place, count, quota| {
            // Neighbouring rows start at different places.
            if (place + place / picture.width).is_multiple_of(stride) {
                pixels.push(Pixel { square: squares[place], count, quota });
            }
        });
        let is_dealt = sampling.settings().policy == Policy::Quietus;
        let steps = if is_dealt { steps(&counts) } else { Vec::new() };
        Self { pixels, square, steps, counts, fall: 1.0 }
    }

    /// The same where the squared error falls as samples to the power of minus `fall`.
    pub(crate) fn with_fall(self, fall: f64) -> Self {
        Self { fall, ..self }
    }

    /// What later forecasts want to know of it.
    pub(crate) fn past(&self) -> Past {
        Past(self.pixels.clone())
    }

    /// The samples that a picture will take to the noise `asked` for, guessed from what it looks like while every pixel has
    /// about the same few samples, at least `least`: dealt in proportion to noise, or to all alike.
    pub(crate) fn guess(picture: &Finished<'_>, asked: f64, least: f64, is_dealt: bool) -> f64 {
        let pixels = picture.counts.len() as f64;
        let goal = asked.powi(2) * pixels;
        // Noise of a sample: the pixel's own, and pooled to deal by.
        let noises: Vec<[f64; 2]> = squared_differences(picture)
            .iter()
            .zip(pooled_differences(picture))
            .zip(picture.counts)
            .map(|((own, pooled), &count)| [own, &pooled].map(|square| square / 12.0 * f64::from(count)))
            .collect();
        if !is_dealt {
            return (noises.iter().map(|[own, _]| own).sum::<f64>() / goal).max(least) * pixels;
        }
        let roots: Vec<f64> = noises.iter().map(|[_, pooled]| pooled.sqrt()).collect();
        let left = |scale: f64| -> f64 {
            noises.iter().zip(&roots).map(|([own, _], root)| own / (scale * root).max(least)).sum()
        };
        let (mut below, mut above) = (1.0, LARGEST_FACTOR);
        while above / below > GUESS_STEP {
            let middle = f64::sqrt(below * above);
            match left(middle) > goal {
                true => below = middle,
                false => above = middle,
            }
        }
        roots.iter().map(|root| (above * root).max(least)).sum()
    }

    /// With quotas larger by `factor`.
    pub(crate) fn at(&self, factor: f64) -> Ahead {
        let (mut samples, mut square, mut samples_now, mut square_now) = (0.0, 0.0, 0.0, 0.0);
        for pixel in &self.pixels {
            let (now, then) = (f64::from(pixel.count), f64::from(self.count(pixel, factor)));
            samples += then;
            samples_now += now;
            square += pixel.square * (now.max(1.0) / then.max(1.0)).powf(self.fall);
            square_now += pixel.square;
        }
        let square = if square_now > 0.0 { square / square_now } else { 1.0 };
        Ahead { factor, samples: samples / f64::max(samples_now, 1.0), square }
    }

    /// The least factor at which `is_enough`, which must stay so for all larger ones; `None` where it never is.
    pub(crate) fn least(&self, is_enough: impl Fn(&Ahead) -> bool) -> Option<Ahead> {
        let (mut below, mut above) = (self.at(1.0 / LARGEST_FACTOR), self.limit());
        if is_enough(&below) {
            return Some(below);
        }
        if !is_enough(&above) {
            return None;
        }
        while above.factor / below.factor > FACTOR_STEP {
            let middle = self.at((below.factor * above.factor).sqrt());
            if is_enough(&middle) {
                above = middle;
            } else {
                below = middle;
            }
        }
        Some(above)
    }

    /// The best that the maximum of samples allows.
    pub(crate) fn limit(&self) -> Ahead {
        self.at(LARGEST_FACTOR)
    }

    /// What a pixel will have.
    fn count(&self, pixel: &Pixel, factor: f64) -> u32 {
        count_at(&self.steps, &self.counts, pixel.count, factor * pixel.quota)
    }
}

/// What a pixel of `count` samples will have that is to have `quota`, and comes by the counts `steps`; any count where there
/// are none.
fn count_at(steps: &[u32], counts: &PassCounts, count: u32, quota: f64) -> u32 {
    if f64::from(count) >= quota {
        return count;
    }
    let Some(&last) = steps.last() else {
        return even(quota).clamp(count, counts.max_samples.max(count));
    };
    // Trees that lag behind draw a pixel again that has its quota, and at least as often as they lag.
    let lag = counts.lag as usize;
    let now = steps.partition_point(|&step| step < count);
    let enough = steps.partition_point(|&step| f64::from(step) < quota);
    let then = (enough + lag - 1).max(now + lag);
    steps.get(then).copied().unwrap_or(last).max(count)
}

/// Rounded up to whole samples of both replicates.
pub(crate) fn even(samples: f64) -> u32 {
    // Saturates.
    ((samples / 2.0).ceil() as u32).saturating_mul(2)
}

/// The counts that a pixel comes by.
fn steps(counts: &PassCounts) -> Vec<u32> {
    let next = |&count: &u32| (count < counts.max_samples).then(|| counts.next(count));
    std::iter::successors(Some(0), next).collect()
}

/// The samples that all pixels will have if quotas are multiplied by `factor`; `None` where there are none yet.
pub(crate) fn samples_at(sampling: &AdaptiveSampling, factor: f64) -> Option<f64> {
    (0..sampling.grid().tiles()).find_map(|tile| sampling.quotas(tile))?;
    let counts = sampling.settings().pass_counts();
    let steps = steps(&counts);
    let mut sum = 0.0;
    for_each_pixel(sampling, |_, count, quota| {
        sum += f64::from(count_at(&steps, &counts, count, factor * quota));
    });
    Some(sum)
}

/// Calls `look` with place (row by row), samples and quota of each pixel.
fn for_each_pixel(sampling: &AdaptiveSampling, mut look: impl FnMut(usize, u32, f64)) {
    let grid = sampling.grid();
    for tile in 0..grid.tiles() {
        let rect = grid.tile_rect(tile);
        let quotas = sampling.quotas(tile);
        for pixel in quietus::active_mask::pixels(grid.full_mask(tile)) {
            let (x, y) = (rect.x0 + u32::from(pixel) % 8, rect.y0 + u32::from(pixel) / 8);
            let count = sampling.counts().pixel(tile, pixel);
            let quota = quotas.map_or(f64::from(count), |quotas| quotas[usize::from(pixel)].into());
            look(y as usize * grid.width() as usize + x as usize, count, quota);
        }
    }
}
