//! How far the finished picture is from the truth: from samples that decided nothing and are not in it.
//!
//! A few pixels are drawn again after the render, by two fresh replicates each. With m the finished pixel, v and w the
//! means of the two, and g what a display shows, `(g(m) - g(v)) (g(m) - g(w))` has the expectation `(g(m) - E g(v))^2`:
//! the squared error of that very pixel, whatever led to its value. No stopping is to be corrected for, and the noise
//! of v and w adds no bias. What is left is that g is no straight line: E g(v) is not quite g of the truth.
//! `docs/noise.md` has what that amounts to on recorded samples, and what was compared.
//!
//! Pixels are picked with known probabilities, mostly where the two halves of the film differ, so that few are enough
//! (Hansen and Hurwitz 1943, *On the Theory of Sampling from Finite Populations*).
//!
//! `examples/measure_noise.rs` is what a renderer has to do for it.

use crate::policy::CREDIBLE_SAMPLES;

/// Share of the picks that go by the difference of halves; the rest is spread evenly, so that no pixel counts more
/// than the inverse of the rest, however wrong the halves are.
const GUIDED: f64 = 0.75;

/// Differences of halves are pooled over squares of this many pixels to either side.
const POOL: usize = 2;

/// How many samples are drawn again to measure the noise of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Share of the picture's samples.
    pub share: f64,
    /// Picks that there should be at least: small pictures need a larger share for a useful interval,
    pub picks: usize,
    /// up to this one.
    pub most_share: f64,
}

impl Effort {
    /// For the report on a finished picture.
    pub const REPORT: Self = Self { share: 0.02, picks: 1024, most_share: 0.15 };

    /// On the way, to see how far it still is.
    pub const STEP: Self = Self { share: 0.02, picks: 1024, most_share: 0.1 };

    /// For a picture that will have `times` as many samples: larger by the root of that.
    #[doc(hidden)]
    pub fn for_way_of(self, times: f64) -> Self {
        let scale = times.clamp(1.0, MOST_TIMES).sqrt();
        let picks = (scale * self.picks as f64) as usize;
        Self { share: scale * self.share, picks, most_share: scale * self.most_share }
    }

    /// Share of the samples of a picture of `pixels` pixels that it takes, about.
    #[doc(hidden)]
    pub fn expected_share(self, pixels: f64) -> f64 {
        // Picks go where samples are: one costs half as many again as the mean pixel.
        self.share.max((1.5 * self.picks as f64 / pixels).min(self.most_share))
    }

    /// Picks where each costs `cost` samples, of a picture of `samples` samples.
    fn picks(self, samples: f64, cost: f64) -> usize {
        let affordable = |share: f64| (share * samples / cost) as usize;
        affordable(self.share).max(self.picks.min(affordable(self.most_share))).max(LEAST_PICKS)
    }
}

/// Most that the way ahead counts.
const MOST_TIMES: f64 = 16.0;

/// Picks below which the interval means nothing, whatever they cost.
#[doc(hidden)]
pub const LEAST_PICKS: usize = 64;

/// 97.5 % quantile of the normal distribution.
const NORMAL_QUANTILE: f64 = 1.959_963_985;

/// Standard deviations that a measurement is off once in 16,000 times, to either side.
const CLEAR: f64 = 4.0;

/// Root mean square error over all pixels and channels in display space, `sqrt(clamp(linear, 0, 1))`, as a share of
/// white.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Noise {
    /// The estimate.
    pub reached: f64,
    /// Lower end of its 95 % confidence interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Noise {
    /// Standard deviation of the logarithm of the estimate.
    #[doc(hidden)]
    pub fn log_deviation(&self) -> f64 {
        (self.reached / self.low).ln() / NORMAL_QUANTILE
    }

    /// Whether it is so far from `noise` that another measurement would not be on the other side of it.
    #[doc(hidden)]
    pub fn is_clear_of(&self, noise: f64) -> bool {
        (self.reached / noise).ln().abs() > CLEAR * self.log_deviation()
    }
}

/// A value as it is displayed, with a gamma of 2.
pub fn displayed(value: f32) -> f64 {
    f64::from(value).clamp(0.0, 1.0).sqrt()
}

/// A finished picture, row by row.
pub struct Finished<'a> {
    /// Its width in pixels.
    pub width: usize,
    /// The two halves of each pixel.
    pub halves: &'a [[[f32; 3]; 2]],
    /// The mean of all samples of each pixel.
    pub means: &'a [[f32; 3]],
    /// Samples of each pixel.
    pub counts: &'a [u32],
    /// What the error of each pixel is multiplied by; 1 where there are none.
    pub weights: Option<&'a [f32]>,
    /// Squared errors of alpha, albedo and normal as sums over what was asked for, where that was.
    pub aovs: Option<&'a [f64]>,
}

impl<'a> Finished<'a> {
    /// A picture `width` pixels wide, without weights; the rest row by row, as long as one another.
    pub fn new(width: usize, halves: &'a [[[f32; 3]; 2]], means: &'a [[f32; 3]], counts: &'a [u32]) -> Self {
        Self { width, halves, means, counts, weights: None, aovs: None }
    }
}

impl Finished<'_> {
    /// What the squared error of a pixel is multiplied by.
    fn squared_weight(&self, pixel: usize) -> f64 {
        self.weights.map_or(1.0, |weights| f64::from(weights[pixel]).powi(2))
    }
}

/// A pixel to draw again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pick {
    /// Which pixel.
    pub pixel: usize,
    /// How many times it was picked before: every time has to have samples of its own.
    pub repeat: u32,
    /// Samples for each of the two replicates.
    pub samples: u32,
    /// Over how many pixels it stands for, relative to the mean, and how much they weigh: its squared error counts this much.
    pub weight: f64,
}

/// Picks pixels of a finished picture. `random` numbers (in 0..1, by index) decide; equal arguments give equal picks.
///
/// # Panics
/// Where the picture is empty, or its parts differ in length.
pub fn pick(picture: &Finished<'_>, effort: Effort, random: impl Fn(u64) -> f64) -> Vec<Pick> {
    let chances = chances(picture);
    // As many samples as the pixel has, over both replicates.
    let samples = |pixel: usize| picture.counts[pixel].div_ceil(2).max(1);
    let cost: f64 = chances.iter().enumerate().map(|(p, chance)| chance * 2.0 * f64::from(samples(p))).sum();
    let drawn: f64 = picture.counts.iter().map(|&count| f64::from(count)).sum();
    pick_among(picture, &chances, effort.picks(drawn, cost), samples, random)
}

/// The chances by which pixels are picked: mostly where halves differ. They sum to 1.
///
/// # Panics
/// Where the picture is empty, or its parts differ in length.
fn chances(picture: &Finished<'_>) -> Vec<f64> {
    let pixels = picture.means.len();
    assert!(pixels > 0 && picture.halves.len() == pixels && picture.counts.len() == pixels, "a picture");
    let differences = pooled_differences(picture);
    let even = 1.0 / pixels as f64;
    let guided = |guide: &[f64], share: f64| -> Vec<f64> {
        let total: f64 = guide.iter().sum();
        let scale = if total > 0.0 { share / total } else { 0.0 };
        let rest = if total > 0.0 { 0.0 } else { share * even };
        guide.iter().map(|value| scale * value + rest).collect()
    };
    let mut chances = match edges(picture) {
        None => guided(&differences, GUIDED),
        Some(edges) => {
            let edges = guided(&edges, 0.5 * GUIDED);
            guided(&differences, 0.5 * GUIDED).into_iter().zip(edges).map(|(a, b)| a + b).collect()
        }
    };
    chances.iter_mut().for_each(|chance| *chance += (1.0 - GUIDED) * even);
    chances
}

/// As [`pick`], as many as `picks`, each with as many samples as `samples` says of its pixel.
#[doc(hidden)]
pub fn pick_by(
    picture: &Finished<'_>,
    picks: usize,
    samples: impl Fn(usize) -> u32,
    random: impl Fn(u64) -> f64,
) -> Vec<Pick> {
    pick_among(picture, &chances(picture), picks, samples, random)
}

/// Picks of pixels by their chances: one in each of as many equal parts of the cumulated chances, which is spread over the
/// picture more evenly than picks that know nothing of each other.
fn pick_among(
    picture: &Finished<'_>,
    chances: &[f64],
    picks: usize,
    samples: impl Fn(usize) -> u32,
    random: impl Fn(u64) -> f64,
) -> Vec<Pick> {
    let (pixels, even) = (chances.len(), 1.0 / chances.len() as f64);
    let (mut pixel, mut below, mut repeat) = (0, 0.0, 0);
    let pick = |index: usize| {
        let place = (index as f64 + random(index as u64)) / picks as f64;
        let before = pixel;
        while pixel + 1 < pixels && below + chances[pixel] <= place {
            below += chances[pixel];
            pixel += 1;
        }
        repeat = if index > 0 && pixel == before { repeat + 1 } else { 0 };
        let weight = picture.squared_weight(pixel) * even / chances[pixel];
        Pick { pixel, repeat, samples: samples(pixel), weight }
    };
    (0..picks).map(pick).collect()
}

/// Squared displayed differences of halves, summed over channels, each with its weight.
fn squared_differences(picture: &Finished<'_>) -> Vec<f64> {
    let square = |(pixel, [a, b]): (usize, &[[f32; 3]; 2])| -> f64 {
        let square: f64 = a.iter().zip(b).map(|(&a, &b)| (displayed(a) - displayed(b)).powi(2)).sum();
        picture.squared_weight(pixel) * square
    };
    picture.halves.iter().enumerate().map(square).collect()
}

/// Squared displayed differences of halves, means over the pixels around, summed over channels.
#[doc(hidden)]
pub fn pooled_differences(picture: &Finished<'_>) -> Vec<f64> {
    pooled_over(picture.width, &squared_differences(picture))
}

/// Means over the pixels around.
fn pooled_over(width: usize, squares: &[f64]) -> Vec<f64> {
    let height = squares.len() / width;
    let around = |place: usize, end: usize| place.saturating_sub(POOL)..(place + POOL + 1).min(end);
    let pooled = |x: usize, y: usize| {
        let rows = around(y, height).map(|row| squares[row * width..][around(x, width)].iter().sum::<f64>());
        let count = around(y, height).len() * around(x, width).len();
        rows.sum::<f64>() / count as f64
    };
    (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| pooled(x, y)).collect()
}

/// The noise of a sample of each pixel, relative to its brightness as quotas go by it, pooled over the pixels around and, as far
/// as these hold too few samples to be believed, over the picture.
#[doc(hidden)]
pub fn pooled_noises(picture: &Finished<'_>) -> Vec<f64> {
    let noise = |(pixel, [a, b]): (usize, &[[f32; 3]; 2])| -> f64 {
        let channels = (0..3).map(|c| {
            let (a, b) = (f64::from(a[c]), f64::from(b[c]));
            (0.5 * (a - b)).powi(2) / (0.5 * (a + b).abs() + 0.01)
        });
        picture.squared_weight(pixel) * f64::from(picture.counts[pixel]) * channels.sum::<f64>()
    };
    let noises: Vec<f64> = picture.halves.iter().enumerate().map(noise).collect();
    let mean = noises.iter().sum::<f64>() / noises.len() as f64;
    let pooled = |(pixel, own): (usize, f64)| {
        let held = ((2 * POOL + 1).pow(2) * picture.counts[pixel] as usize) as f64;
        let credibility = held / (held + CREDIBLE_SAMPLES * mean).max(f64::MIN_POSITIVE);
        credibility * own + (1.0 - credibility) * mean
    };
    pooled_over(picture.width, &noises).into_iter().enumerate().map(pooled).collect()
}

/// What a fresh replicate of a pixel found, red, green and blue.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FreshMean {
    /// The mean of all of its samples.
    pub whole: [f32; 3],
    /// The means of its first and second half; both that of all where there are too few to be cut in two.
    pub halves: [[f32; 3]; 2],
}

impl FreshMean {
    /// Of `samples` samples, 1 at least, which `draw` returns by their index.
    pub fn of(samples: u32, mut draw: impl FnMut(u32) -> [f32; 3]) -> Self {
        let mut sums = [[0.0; 3]; 2];
        let cut = samples / 2;
        for index in 0..samples {
            let sum: &mut [f64; 3] = &mut sums[usize::from(index >= cut)];
            sum.iter_mut().zip(draw(index)).for_each(|(sum, value)| *sum += f64::from(value));
        }
        let mean = |sum: [f64; 3], count: u32| sum.map(|sum| (sum / f64::from(count.max(1))) as f32);
        let [first, second] = sums;
        let whole = mean([0, 1, 2].map(|c| first[c] + second[c]), samples);
        let halves = if cut > 0 { [mean(first, cut), mean(second, samples - cut)] } else { [whole; 2] };
        Self { whole, halves }
    }

    /// A channel as it is displayed, without most of what the bend of the display's curve takes off means of few samples: a
    /// jackknife of two groups (Quenouille 1956, *Notes on Bias in Estimation*).
    #[doc(hidden)]
    pub fn displayed(&self, channel: usize) -> f64 {
        let [a, b] = self.halves.map(|half| displayed(half[channel]));
        2.0 * displayed(self.whole[channel]) - 0.5 * (a + b)
    }
}

/// The noise of a picture of pixel means `means` from `picks` and what their two fresh replicates found.
pub fn estimate(means: &[[f32; 3]], picks: &[Pick], fresh: &[[FreshMean; 2]]) -> Noise {
    let squared = |pick: &Pick, [v, w]: &[FreshMean; 2]| -> f64 {
        let m = means[pick.pixel].map(displayed);
        let channels = (0..3).map(|c| (m[c] - v.displayed(c)) * (m[c] - w.displayed(c)));
        pick.weight * channels.sum::<f64>() / 3.0
    };
    estimate_squares(&picks.iter().zip(fresh).map(|(pick, fresh)| squared(pick, fresh)).collect::<Vec<_>>())
}

/// The root of a mean of squares from estimates of them.
///
/// The interval is normal for the logarithm, which is skewed less than the mean square itself. Where the mean is hardly known its
/// upper end goes on in a straight line from there, since a mean that came out near 0 by chance has a logarithm that means
/// nothing. It is raised by what larger values than any that were met may hold.
#[doc(hidden)]
pub fn estimate_squares(values: &[f64]) -> Noise {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0) / n;
    let (deviation, unseen) = (variance.sqrt(), unseen(values));
    if mean <= 0.0 {
        // By chance, where there is hardly any noise.
        let high = (mean + NORMAL_QUANTILE * deviation + unseen).max(0.0).sqrt();
        return Noise { reached: 0.0, low: 0.0, high };
    }
    let (reached, way) = (mean.sqrt(), NORMAL_QUANTILE * deviation / mean);
    let factor = if way <= 1.0 { way.exp() } else { way * std::f64::consts::E };
    Noise { reached, low: reached / (0.5 * way).exp(), high: (mean * factor + unseen).sqrt() }
}

/// Share of the values whose size tells how much larger there may be.
const TAIL: f64 = 0.05;

/// Inverse of a Pareto index: tails heavier than that have hardly a mean.
const HEAVIEST_TAIL: f64 = 0.8;

/// What values that were not met may add to a mean: a share of 1/n is expected to lie beyond the largest of n (Good 1953, *The
/// Population Frequencies of Species*). That one stands for them; what they exceed it by on average, the largest values say,
/// taken for the end of a Pareto distribution (Hill 1975, *A Simple General Approach to Inference About the Tail of a
/// Distribution*).
fn unseen(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(|a, b| b.total_cmp(a));
    let tail = ((TAIL * sorted.len() as f64) as usize).max(10);
    let Some(&least) = sorted.get(tail).filter(|&&least| least > 0.0) else { return 0.0 };
    let logarithms: f64 = sorted[..tail].iter().map(|value| (value / least).ln()).sum();
    let heaviness = (logarithms / tail as f64).min(HEAVIEST_TAIL);
    sorted[0] * heaviness / (1.0 - heaviness) / sorted.len() as f64
}

/// Share of the mean that is added everywhere: no pixel is taken to be without noise.
const FLOOR: f64 = 0.05;

/// The squared errors of alpha, albedo and normals, sums over what was asked of them, with weights. `None` where nothing was.
#[doc(hidden)]
pub fn edges(picture: &Finished<'_>) -> Option<Vec<f64>> {
    let squares = picture.aovs?;
    let floor = FLOOR * squares.iter().sum::<f64>() / squares.len() as f64 + f64::MIN_POSITIVE;
    let weighted = |(place, square): (usize, &f64)| picture.squared_weight(place) * (square + floor);
    Some(squares.iter().enumerate().map(weighted).collect())
}

/// A number in 0..1 for every index: SplitMix (Steele, Lea and Flood 2014). Which pixels are drawn again need not
/// depend on the seed: what they are drawn with does.
#[doc(hidden)]
pub fn uniform(index: u64) -> f64 {
    let mut z = index.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

#[cfg(test)]
mod tests;
