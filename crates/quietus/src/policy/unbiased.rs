//! Sampling that leaves every pixel's mean unbiased: a pixel's number of samples never depends on its own values.
//!
//! Every pixel first takes a pilot, as many samples as the settings say. How many samples it gets in all is decided by the
//! pilots of other pixels. Samples of different pixels are independent, so given its count a pixel's samples, its own
//! pilot among them, are what they would have been with that count fixed in advance: the plain mean has the right
//! expectation. `docs/method-unbiased.md` has the proof, what would break it, and what was tried.
//!
//! Noise is estimated by the window of pilots around a pixel, mixed with the region's mean, both without the pixel itself.
//! Size of the window and weight of the mean are chosen by pilots, too: pixels are coloured like a checkerboard, and the
//! choice for black ones is what would have dealt samples best among the white ones, each judged by the white window around
//! it without itself (leave-one-out cross-validation), and that by more than chance; and the other way round.

use std::sync::Arc;

use super::{ActivePixels, HomeMasks, RuleMemory, RuleSettings, StoppingRule};
use crate::{
    ErrorPlane, PassCounts, PixelError, PixelRect, Regions, TILE_PIXELS, TILE_SIZE,
    error_metric::NOMINAL_SAMPLES, protocol::Misfit,
};

/// Radii of the windows to choose from, in pixels: from the nearest neighbours to more than three tiles.
const RADII: [u32; 7] = [1, 2, 3, 4, 6, 9, 13];

/// Weights of the window against the region's mean to choose from, beside the even spread.
const WEIGHTS: [f64; 4] = [0.25, 0.5, 0.75, 1.0];

/// The even spread, taken where nothing is better for certain.
const EVEN: Choice = (RADII[0], 0.0);

/// Standard errors by which a choice must be better than the even spread. On heavy tails the best of many choices is
/// often best by chance.
const DOUBT: f64 = 2.0;

/// Counts decided by pilots of other pixels.
pub struct UnbiasedRule {
    region: u32,
    scale: f64,
    counts: PassCounts,
    /// Samples each pixel of the home tiles should have, row by row; empty before the pilot is over.
    wanted: Vec<f64>,
    /// The pass that will consult the next tree, and the samples of a pixel that all passes before it draw.
    next: (u64, u32),
    masks: HomeMasks,
}

impl UnbiasedRule {
    /// The pixels of a region before their pilot is over.
    pub fn new(settings: &RuleSettings, region: u32) -> Self {
        let counts = settings.counts;
        // Tree k is consulted in pass k + lag; the first is made of pass `min_passes - 1`.
        let consulted = counts.min_passes() - 1 + u64::from(counts.lag);
        Self {
            region,
            scale: samples_per_error(settings),
            wanted: Vec::new(),
            next: (consulted, counts.after(consulted)),
            masks: HomeMasks::full(&settings.regions, region),
            counts,
        }
    }

    /// Decides how many samples each pixel of the home tiles should have.
    fn decide(&mut self, errors: &ErrorPlane) {
        let home = self.masks.home;
        let range = [f64::from(self.next.1), f64::from(self.counts.max_samples)];
        let pilots = Pilots::new(errors, &self.masks.regions, self.region);
        // Black pixels take the choice of white ones, and the other way round.
        let choices = [1, 0].map(|color| pilots.of_color(color).choose(self.scale, range));
        let pixels = (home.y0..home.y1).flat_map(|y| (home.x0..home.x1).map(move |x| (x, y)));
        let noise = |(x, y): (u32, u32)| pilots.noise_around(x, y, choices[((x + y) % 2) as usize]);
        self.wanted = pixels.map(|pixel| self.scale * noise(pixel)).collect();
    }
}

/// Samples that a pilot error of 1 asks for.
///
/// What one more sample of a pixel of n is worth is `e sqrt(n_0 / n) sqrt(64 / n)` where its pilot of n_0 samples had
/// the error e. Counts make it the same in all pixels, so that no sample is worth more elsewhere, and as large as
/// makes the region error of one tile the target: `worth sqrt(64 / N_img) = target`.
fn samples_per_error(settings: &RuleSettings) -> f64 {
    let pilot = settings.counts.after(settings.counts.min_passes());
    let worth = settings.target_error * (settings.frame_area / TILE_PIXELS as f64).sqrt();
    (NOMINAL_SAMPLES * f64::from(pilot)).sqrt() / worth
}

impl ActivePixels for UnbiasedRule {
    fn active(&self, tile: u32) -> u64 {
        self.masks.active(tile)
    }
}

impl StoppingRule for UnbiasedRule {
    /// The first call ends the pilot; later ones look at no error any more, only at what was decided.
    fn update(&mut self, errors: &ErrorPlane) {
        if self.wanted.is_empty() {
            self.decide(errors);
        }
        let (pass, count) = self.next;
        let grown = self.counts.grown(count, pass);
        // Counts end on pass boundaries, on the one that is nearer by ratio. Who wants more than the maximum stays
        // active there: it did not get what it needs.
        let enough = (f64::from(count) * f64::from(grown)).sqrt();
        let home = self.masks.home;
        self.masks.clear();
        for (y, row) in (home.y0..).zip(self.wanted.chunks(home.width() as usize)) {
            for (x, &wanted) in (home.x0..).zip(row) {
                if wanted > enough {
                    self.masks.add_pixel(x, y);
                }
            }
        }
        self.next = (pass + 1, grown);
    }

    fn memory(&self) -> RuleMemory {
        RuleMemory::Decided { wanted: self.wanted.clone(), pass: self.next.0, count: self.next.1 }
    }

    fn restore(&mut self, masks: &[u64], memory: &RuleMemory, _: &ErrorPlane) -> Result<(), Misfit> {
        let RuleMemory::Decided { wanted, pass, count } = memory else {
            return Err(Misfit("it is of another policy"));
        };
        let fits = wanted.len() as u64 == self.masks.home.area() && *pass < u64::from(u32::MAX);
        Misfit::unless(fits, "what was decided for its pixels is of another picture")?;
        self.wanted.clone_from(wanted);
        self.next = (*pass, *count);
        self.masks.masks = masks.to_vec();
        Ok(())
    }

    fn check(&self) -> Arc<dyn ActivePixels> {
        Arc::new(self.masks.clone())
    }

    fn is_complete(&self) -> bool {
        !self.wanted.is_empty() && self.masks.is_empty()
    }
}

/// A window's radius and its weight against the region's mean.
type Choice = (u32, f64);

/// Pilots in a region's error area: their errors, and sums over windows of them.
struct Pilots {
    rect: PixelRect,
    /// Error of each pixel, row by row; rejected where there is no pilot.
    errors: Vec<PixelError>,
    /// Summed-area table of the errors' steps and their number, with a row and a column of zeros in front.
    sums: Vec<(u64, u64)>,
}

impl Pilots {
    fn new(plane: &ErrorPlane, regions: &Regions, region: u32) -> Self {
        let rect = regions.error_rect(region);
        let width = rect.width() as usize;
        let mut errors = vec![PixelError::REJECTED; rect.area() as usize];
        for tile in regions.error_tiles(region) {
            let part = regions.grid().tile_rect(tile);
            let loaded = plane.load_tile(tile);
            for y in part.y0..part.y1 {
                for x in part.x0..part.x1 {
                    let place = (y - rect.y0) as usize * width + (x - rect.x0) as usize;
                    errors[place] = loaded[((y - part.y0) * TILE_SIZE + x - part.x0) as usize];
                }
            }
        }
        Self { rect, sums: summed_area(&errors, width), errors }
    }

    /// Those of the pixels of one colour of the checkerboard.
    fn of_color(&self, color: u32) -> Self {
        let mut errors = self.errors.clone();
        for (place, error) in errors.iter_mut().enumerate() {
            let (x, y) = self.pixel(place);
            if (x + y) % 2 != color {
                *error = PixelError::REJECTED;
            }
        }
        Self { rect: self.rect, sums: summed_area(&errors, self.rect.width() as usize), errors }
    }

    /// The pixel at a place in the rows.
    fn pixel(&self, place: usize) -> (u32, u32) {
        let width = self.rect.width() as usize;
        (self.rect.x0 + (place % width) as u32, self.rect.y0 + (place / width) as u32)
    }

    /// Sum of the steps and number of the pilots at most `radius` away from (x, y) on either axis.
    fn window(&self, x: u32, y: u32, radius: u32) -> (u64, u64) {
        let PixelRect { x0, y0, x1, y1 } = self.rect;
        let columns = [x.saturating_sub(radius).max(x0) - x0, (x + radius + 1).min(x1) - x0];
        let rows = [y.saturating_sub(radius).max(y0) - y0, (y + radius + 1).min(y1) - y0];
        let stride = self.rect.width() as usize + 1;
        let at = |column: u32, row: u32| self.sums[row as usize * stride + column as usize];
        let [a, b, c, d] = [
            at(columns[0], rows[0]),
            at(columns[1], rows[0]),
            at(columns[0], rows[1]),
            at(columns[1], rows[1]),
        ];
        (d.0 + a.0 - b.0 - c.0, d.1 + a.1 - b.1 - c.1)
    }

    /// Mean error; none where there is no pilot.
    fn mean(&self) -> Option<f64> {
        self.sums.last().and_then(|&sum| mean(sum))
    }

    /// Noise around the pixel at (x, y), whose own pilot is not looked at. Without any other nothing is known, and noise may
    /// be endless.
    fn noise_around(&self, x: u32, y: u32, (radius, weight): Choice) -> f64 {
        let place = (y - self.rect.y0) as usize * self.rect.width() as usize + (x - self.rect.x0) as usize;
        let own = self.errors[place];
        // Sums are exact: what is left does not depend on the pixel, not even by rounding.
        let others =
            |(steps, count): (u64, u64)| mean((steps - own.steps(), count - u64::from(!own.is_rejected())));
        let Some(all) = self.sums.last().and_then(|&sum| others(sum)) else { return f64::INFINITY };
        let near = others(self.window(x, y, radius)).unwrap_or(all);
        weight * near + (1.0 - weight) * all
    }

    /// The choice that would have dealt samples best among the pilots themselves, as far as that is certain. `range` has
    /// the least and the largest count.
    fn choose(&self, scale: f64, range: [f64; 2]) -> Choice {
        let Some(all) = self.mean() else { return EVEN };
        let mut best = (0.0, EVEN);
        for radius in RADII {
            let pilots = self.without_themselves(radius, all);
            for weight in WEIGHTS {
                let count =
                    |near: f64| (scale * (weight * near + (1.0 - weight) * all)).clamp(range[0], range[1]);
                let cost = cost(&pilots, count);
                if cost < best.0 {
                    best = (cost, (radius, weight));
                }
            }
        }
        best.1
    }

    /// The error of each pilot, and the mean of the window around it without itself; `all` where there is no other.
    fn without_themselves(&self, radius: u32, all: f64) -> Vec<(f64, f64)> {
        let pilots = self.errors.iter().enumerate().filter(|(_, error)| !error.is_rejected());
        let values = pilots.map(|(place, error)| {
            let (x, y) = self.pixel(place);
            let (sum, count) = self.window(x, y, radius);
            (error.steps() as f64 / STEPS, mean((sum - error.steps(), count - 1)).unwrap_or(all))
        });
        values.collect()
    }
}

/// What it costs to deal by `count` instead of evenly, among pilots of known errors, each with the noise around it.
///
/// A pixel of error e that gets n samples contributes `e^2 / n` to the squared error. So `sum(n) sum(e^2 / n)` is the
/// error at an equal number of samples, and the cost is its logarithm less that of an even spread, plus [`DOUBT`] times
/// the standard error of this difference, which is a sum over pilots to first order. Below 0 where the gain is certain.
fn cost(pilots: &[(f64, f64)], count: impl Fn(f64) -> f64) -> f64 {
    let sum = |term: &dyn Fn(f64, f64) -> f64| -> f64 {
        pilots.iter().map(|&(error, near)| term(error * error, count(near))).sum()
    };
    let (even, even_squares) = (pilots.len() as f64, sum(&|square, _| square));
    let (samples, squares) = (sum(&|_, n| n), sum(&|square, n| square / n));
    let share = |square: f64, n: f64| {
        n / samples - 1.0 / even + square * ((n * squares).recip() - even_squares.recip())
    };
    let variance = sum(&|square, n| share(square, n).powi(2));
    (samples * squares / (even * even_squares)).ln() + DOUBT * variance.sqrt()
}

/// Steps of an error of 1.
const STEPS: f64 = (1_u32 << PixelError::FRACTION_BITS) as f64;

fn mean((steps, count): (u64, u64)) -> Option<f64> {
    (count > 0).then(|| steps as f64 / STEPS / count as f64)
}

/// Prefix sums of the errors that are there, and their number.
fn summed_area(errors: &[PixelError], width: usize) -> Vec<(u64, u64)> {
    let stride = width + 1;
    let mut sums = vec![(0, 0); stride * (errors.len() / width + 1)];
    for (row, errors) in errors.chunks(width).enumerate() {
        let mut run = (0, 0);
        for (column, error) in errors.iter().enumerate() {
            run.0 += error.steps();
            run.1 += u64::from(!error.is_rejected());
            let above = sums[row * stride + column + 1];
            sums[(row + 1) * stride + column + 1] = (above.0 + run.0, above.1 + run.1);
        }
    }
    sums
}
