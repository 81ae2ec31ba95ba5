//! What more samples will bring: counts and noise if all quotas were larger by a factor.

use quietus::{AdaptiveSampling, PassCounts};
use serde::{Deserialize, Serialize};

use crate::dealt::Steps;
use crate::noise::{Finished, edges, pooled_differences};

/// Pixels that a forecast looks at, about: spread evenly, they stand for all.
pub(crate) const PIXELS: usize = 1 << 16;

/// Largest factor that is looked at: beyond, every pixel is at its maximum. Below its inverse, none gets any more.
pub(crate) const LARGEST_FACTOR: f64 = 1e12;

/// Factors are found to this precision.
const FACTOR_STEP: f64 = 1.002;

/// Logarithm of a fall below which the exponent is not learnt from it.
const LEAST_FALL: f64 = 0.3;

/// A pixel of the film.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Pixel {
    /// Its squared error by the difference of halves.
    square: f64,
    /// The squared error of its alpha, albedo and normal, over what was asked of them.
    edge: f64,
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
    /// Mean squared error of alpha, albedo and normal, over that there is.
    pub(crate) edges: f64,
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

    /// What the mean squared error of alpha, albedo and normal should have been multiplied by until `later`, by independent
    /// samples; `None` where there are too few more to tell.
    pub(crate) fn edges_to(&self, later: &Forecast) -> Option<f64> {
        let pairs = || self.0.iter().zip(&later.pixels);
        let left = |(before, after): (&Pixel, &Pixel)| {
            before.edge * f64::from(before.count) / f64::from(after.count.max(1))
        };
        let ratio = pairs().map(left).sum::<f64>() / pairs().map(|(before, _)| before.edge).sum::<f64>();
        (-ratio.ln() > LEAST_FALL).then_some(ratio)
    }
}

/// A picture and its quotas, as of the end of a round.
#[derive(Clone)]
pub(crate) struct Forecast {
    pixels: Vec<Pixel>,
    /// Mean squared error by the difference of halves, in display space. Sampling that stops where halves agree makes
    /// it too small.
    pub(crate) square: f64,
    /// Mean squared error of alpha, albedo and normal over those asked for, added up, if samples were independent.
    pub(crate) edges: f64,
    /// How pixels come to larger quotas.
    steps: Steps,
    /// What comes beyond what quotas say now, as a share of what they add.
    creep: f64,
    /// The squared error falls as samples to the power of minus this.
    fall: f64,
}

impl Forecast {
    /// Of a picture as it was sampled, to the limits of `counts`; the squared error falls as that of independent samples.
    pub(crate) fn new(picture: &Finished<'_>, sampling: &AdaptiveSampling, counts: PassCounts) -> Self {
        let squares = pooled_differences(picture);
        // Squares are sums over three channels, and the mean of two halves is off by half their difference.
        let square = squares.iter().sum::<f64>() / squares.len() as f64 / 12.0;
        let edges = edges(picture);
        let edges_now = edges.as_ref().map_or(0.0, |edges| edges.iter().sum::<f64>() / edges.len() as f64);
        let stride = squares.len().div_ceil(PIXELS).max(1);
        let mut pixels = Vec::with_capacity(squares.len().div_ceil(stride));
        for_each_pixel(sampling, |place, count, quota| {
            // Neighbouring rows start at different places.
            if (place + place / picture.width).is_multiple_of(stride) {
                let edge = edges.as_ref().map_or(1.0, |edges| edges[place]);
                pixels.push(Pixel { square: squares[place], edge, count, quota });
            }
        });
        let steps = Steps::of(sampling.settings().policy, counts);
        Self { pixels, square, edges: edges_now, steps, creep: 0.0, fall: 1.0 }
    }

    /// The same by passes that draw other `counts`, and where samples come to more than quotas say.
    pub(crate) fn by(&self, counts: PassCounts, creep: f64) -> Self {
        Self { steps: self.steps.by(counts), creep, ..self.clone() }
    }

    /// The same where the squared error falls as samples to the power of minus `fall`.
    pub(crate) fn with_fall(self, fall: f64) -> Self {
        Self { fall, ..self }
    }

    /// What later forecasts want to know of it.
    pub(crate) fn past(&self) -> Past {
        Past(self.pixels.clone())
    }

    /// With quotas larger by `factor`.
    pub(crate) fn at(&self, factor: f64) -> Ahead {
        let (mut samples, mut square, mut samples_now, mut square_now) = (0.0, 0.0, 0.0, 0.0);
        let (mut edges, mut edges_now) = (0.0, 0.0);
        for pixel in &self.pixels {
            let (now, then) = (f64::from(pixel.count), self.count(pixel, factor));
            samples += then;
            samples_now += now;
            let falls = then > now;
            square += pixel.square * if falls { (now.max(1.0) / then).powf(self.fall) } else { 1.0 };
            square_now += pixel.square;
            edges += pixel.edge * now.max(1.0) / then.max(1.0);
            edges_now += pixel.edge;
        }
        let square = if square_now > 0.0 { square / square_now } else { 1.0 };
        let edges = if edges_now > 0.0 { edges / edges_now } else { 1.0 };
        Ahead { factor, samples: samples / f64::max(samples_now, 1.0), square, edges }
    }

    /// The least factor at which `is_enough`, which must stay so for all larger ones; `None` where it never is.
    pub(crate) fn least(&self, is_enough: impl Fn(&Ahead) -> bool) -> Option<Ahead> {
        least_factor(FACTOR_STEP, |factor| is_enough(&self.at(factor))).map(|factor| self.at(factor))
    }

    /// The best that the maximum of samples allows.
    pub(crate) fn limit(&self) -> Ahead {
        self.at(LARGEST_FACTOR)
    }

    /// What a pixel will have.
    fn count(&self, pixel: &Pixel, factor: f64) -> f64 {
        let (now, then) = (pixel.count, self.steps.count(pixel.count, factor * pixel.quota));
        let then = f64::from(now) + (1.0 + self.creep) * f64::from(then - now);
        then.min(self.steps.most().max(now).into())
    }
}

/// As the last round towards a noise draws: in fine steps, trees one pass behind, so that counts end where they should.
pub(crate) fn towards_a_noise(counts: PassCounts) -> PassCounts {
    PassCounts { lag: 1, fine_steps: true, ..counts }
}

/// Rounded up to whole samples of both replicates.
pub(crate) fn even(samples: f64) -> u32 {
    // Saturates.
    ((samples / 2.0).ceil() as u32).saturating_mul(2)
}

/// The least factor of quotas, up to one of `step`, at which there `is_enough`, which must stay so for all larger ones;
/// `None` where there never is.
pub(crate) fn least_factor(step: f64, is_enough: impl Fn(f64) -> bool) -> Option<f64> {
    let (mut below, mut above) = (1.0 / LARGEST_FACTOR, LARGEST_FACTOR);
    if is_enough(below) {
        return Some(below);
    }
    if !is_enough(above) {
        return None;
    }
    while above / below > step {
        let middle = (below * above).sqrt();
        if is_enough(middle) {
            above = middle;
        } else {
            below = middle;
        }
    }
    Some(above)
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
