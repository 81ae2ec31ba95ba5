//! How the error falls that was measured, and what will be left of it with the most samples that pixels may have.
//!
//! Halves of the film are no guide to that: where rare bright paths were met in one half only they misjudge an error whose fall
//! is slow for the same reason, and pixels that are at their maximum already are the ones they misjudge most. The picks of a
//! measurement know better. Their fresh replicates have half as many samples as the picture has, and halves of these a
//! quarter; with x one of them, g what a display shows, m the pixel and w the other replicate, `(g(x) - g(m)) (g(x) - g(w))` has
//! the expectation of the squared error of x, as in [`super`]. So errors of three numbers of samples are known, from the
//! same picks, whose chance cancels in their ratios.

use super::{FreshMean, Noise, Pick, displayed};

/// The squared error falls as samples to the power of minus this, before a scene has shown how, and in the long run; and the
/// deviation of that from scene to scene. `docs/noise.md` has what it is from.
const USUAL: (f64, f64) = (0.85, 0.3);

/// What is left, at twice the samples, of how far a fall is from the usual one: paths that were too rare to be met are met.
const LASTING: f64 = 0.7;

/// Samples of a replicate below which its halves tell nothing.
const LEAST_SAMPLES: u32 = 4;

/// The squared errors of what was picked, and how they fall.
#[derive(Clone, Debug)]
pub(crate) struct Falling {
    /// Estimates of the squared error, whose mean is that of the picture, and samples.
    picks: Vec<[f64; 2]>,
    /// The power of samples, and its variance.
    fall: f64,
    variance: f64,
}

/// A noise that is foretold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Foretold {
    /// As a share of white.
    pub(crate) noise: f64,
    /// Standard deviation of its logarithm.
    pub(crate) deviation: f64,
}

impl Falling {
    /// Of a picture of `means` and `counts`, from picks and what their fresh replicates found.
    pub(crate) fn of(means: &[[f32; 3]], counts: &[u32], picks: &[Pick], fresh: &[[FreshMean; 2]]) -> Self {
        let squares = |(pick, fresh)| squares(means, pick, fresh);
        let all: Vec<[f64; 2]> = picks.iter().zip(fresh).map(squares).collect();
        let is_cut = picks.iter().all(|pick| pick.samples >= LEAST_SAMPLES);
        let (fall, variance) = fall(if is_cut { &all } else { &[] });
        let of = |(&[square, _], pick): (&[f64; 2], &Pick)| [square, f64::from(counts[pick.pixel].max(1))];
        Self { picks: all.iter().zip(picks).map(of).collect(), fall, variance }
    }

    /// The noise where every pixel has `count` samples, or those it has if these are more. `measured` is what it is now.
    /// `None` where there is too little of it to tell.
    pub(crate) fn at(&self, count: u32, measured: Noise) -> Option<Foretold> {
        let (usual, _) = USUAL;
        let (mut square, mut way) = (0.0, 0.0);
        for &[now, samples] in &self.picks {
            let doublings = (f64::from(count) / samples).log2().max(0.0);
            let lasting = (1.0 - LASTING.powf(doublings)) / (1.0 - LASTING);
            square += now * (-(usual * doublings + (self.fall - usual) * lasting)).exp2();
            way += lasting;
        }
        let picks = self.picks.len() as f64;
        let of_fall = 0.5 * std::f64::consts::LN_2 * self.variance.sqrt() * way / picks;
        (square > 0.0 && measured.reached > 0.0).then(|| Foretold {
            noise: (square / picks).sqrt(),
            deviation: measured.log_deviation().hypot(of_fall),
        })
    }
}

/// Estimates of the squared error of the pixel, and of a quarter of its samples.
fn squares(means: &[[f32; 3]], pick: &Pick, fresh: &[FreshMean; 2]) -> [f64; 2] {
    let (mut own, mut of_quarter) = (0.0, 0.0);
    for channel in 0..3 {
        let pixel = displayed(means[pick.pixel][channel]);
        let [first, second] = fresh.map(|fresh| fresh.displayed(channel));
        own += (pixel - first) * (pixel - second);
        for (replicate, other) in [(&fresh[0], second), (&fresh[1], first)] {
            let quarters = replicate.halves.map(|half| displayed(half[channel]));
            of_quarter += quarters.map(|x| (x - pixel) * (x - other)).iter().sum::<f64>() / 4.0;
        }
    }
    [own, of_quarter].map(|square| pick.weight * square / 3.0)
}

/// The power of samples by which the error falls over four times as many, and its variance: what `all` say of it, and what is usual.
fn fall(all: &[[f64; 2]]) -> (f64, f64) {
    let (usual, deviation) = USUAL;
    let n = all.len() as f64;
    let [own, quarter] = [0, 1].map(|which| all.iter().map(|squares| squares[which]).sum::<f64>() / n);
    if !(own > 0.0 && quarter > 0.0) {
        return (usual, deviation.powi(2));
    }
    let fall = 0.5 * (quarter / own).log2();
    // Of a ratio of means, by their influence on it.
    let influence = |squares: &[f64; 2]| (squares[1] / quarter - squares[0] / own).powi(2);
    let relative = all.iter().map(influence).sum::<f64>() / n / (n - 1.0).max(1.0);
    let variance = relative / (2.0 * std::f64::consts::LN_2).powi(2);
    let precisions = [variance.max(1e-6).recip(), deviation.powi(-2)];
    let precision = precisions[0] + precisions[1];
    ((fall * precisions[0] + usual * precisions[1]) / precision, precision.recip())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(reached: f64) -> Noise {
        Noise { reached, low: reached / 1.05, high: reached * 1.05 }
    }

    fn falling(squares: &[[f64; 2]], count: f64) -> Falling {
        let (fall, variance) = fall(squares);
        Falling { picks: squares.iter().map(|square| [square[0], count]).collect(), fall, variance }
    }

    #[test]
    fn errors_fall_on_as_they_have_fallen() {
        // As independent samples, as nothing at all, and as what nobody knows.
        let independent = falling(&vec![[1.0, 4.0]; 1000], 16.0);
        let stuck = falling(&vec![[1.0, 1.0]; 1000], 16.0);
        let unknown = falling(&[[1.0, -1.0]], 16.0);
        let at = |falling: &Falling| falling.at(32, measured(1.0)).map(|foretold| foretold.noise.powi(2));
        assert!((at(&independent).unwrap() - 0.5).abs() < 1e-3, "{:?}", at(&independent));
        assert!((at(&stuck).unwrap() - 1.0).abs() < 1e-3, "{:?}", at(&stuck));
        assert!((at(&unknown).unwrap() - (-USUAL.0).exp2()).abs() < 1e-9);
        // What falls slowly goes on to fall faster, and what is far is less certain.
        let far = |count| stuck.at(count, measured(1.0)).unwrap();
        assert!(far(1024).noise < far(64).noise && far(64).noise < 1.0);
        let far = |count| unknown.at(count, measured(1.0)).unwrap().deviation;
        assert!(far(1024) > far(64) && far(64) > far(16));
    }

    #[test]
    fn pixels_at_their_maximum_keep_their_error() {
        let mut picks = falling(&vec![[1.0, 4.0]; 1000], 16.0);
        picks.picks.iter_mut().take(500).for_each(|pick| pick[1] = 64.0);
        let square = picks.at(64, measured(1.0)).unwrap().noise.powi(2);
        assert!((square - (0.5 + 0.5 / 4.0)).abs() < 0.02, "{square}");
        assert!(picks.at(64, measured(0.0)).is_none());
    }

    #[test]
    fn three_numbers_of_samples_are_told_apart() {
        let constant = |value: f32| [value; 3];
        // Where nothing bends: the pixel is off by 0.1, a quarter by 0.2, to either side.
        let half = |whole: f32, halves: [f32; 2]| FreshMean {
            whole: constant(whole.powi(2)),
            halves: halves.map(|half| constant(half.powi(2))),
        };
        let pick = Pick { pixel: 0, repeat: 0, samples: 8, weight: 1.0 };
        let truth = half(0.5, [0.3, 0.7]);
        let found = squares(&[constant(0.36)], &pick, &[truth, truth]);
        assert!((found[0] - 0.01).abs() < 1e-6 && (found[1] - 0.04).abs() < 1e-6, "{found:?}");
    }
}
