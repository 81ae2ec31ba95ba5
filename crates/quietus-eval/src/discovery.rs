//! Features that are found late: light that few samples catch, and when a run has found it.

use quietus::Settings;

use crate::measure::luminance;
use crate::{Bank, EvalError, Picture, Reference, replay::replay_watched};

/// Share of the visible pixels that make up the feature: those whose light is rarest.
const SHARE: f64 = 0.02;

/// Light that more than one sample in this many catches is not late.
const RARE: f64 = 4.0;

/// Pixels darker than this share of the picture's mean are not missed.
const VISIBLE: f64 = 0.1;

/// The pixels of a picture that are lit by rare paths.
///
/// Light that arrives only with probability p, then as bright as it is, has `mean^2 / (mean^2 + variance) = p` over
/// single samples. The feature is the fiftieth of the visible pixels where p is least, as far as it is below 1/4.
#[derive(Clone, Debug)]
pub struct Feature {
    /// Number and luminance of each of its pixels.
    pixels: Vec<(usize, f64)>,
}

impl Feature {
    /// The late feature of a reference, where there is one.
    pub fn of(reference: &Reference) -> Option<Self> {
        let luminances: Vec<f64> = reference.mean.rgb.iter().copied().map(luminance).collect();
        let mean = luminances.iter().sum::<f64>() / luminances.len() as f64;
        let chance = |i: usize| {
            let square = luminances[i] * luminances[i];
            // Channels of rare light rise together: the standard deviation of luminance is that of its parts.
            let deviation = luminance(reference.sample_variance[i].map(f32::sqrt));
            square / (square + deviation * deviation)
        };
        let visible = (0..luminances.len()).filter(|&i| luminances[i] > VISIBLE * mean);
        let mut rarest: Vec<(f64, usize)> = visible.map(|i| (chance(i), i)).collect();
        rarest.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        rarest.truncate((SHARE * rarest.len() as f64).ceil() as usize);
        let late = rarest.into_iter().filter(|&(chance, _)| chance < 1.0 / RARE);
        let pixels: Vec<_> = late.map(|(_, i)| (i, luminances[i])).collect();
        (!pixels.is_empty()).then_some(Self { pixels })
    }

    /// Share of the picture's pixels.
    pub fn share(&self, picture: &Picture) -> f64 {
        self.pixels.len() as f64 / picture.rgb.len() as f64
    }

    /// Whether at least half of its pixels are at least half as bright as they should be. Medians, so that a few
    /// very bright samples do not count as having found it.
    pub fn is_found(&self, value: impl Fn(usize) -> [f32; 3]) -> bool {
        let found = self.pixels.iter().filter(|&&(i, right)| luminance(value(i)) >= 0.5 * right).count();
        2 * found >= self.pixels.len()
    }
}

/// Mean samples per pixel of the whole picture that a run has spent when the feature is found; none where it ends
/// before. As of the ends of passes.
///
/// # Errors
/// As [`crate::replay()`].
pub fn discovery(
    bank: &Bank,
    settings: &Settings,
    run: u64,
    feature: &Feature,
) -> Result<Option<f64>, EvalError> {
    let mut found = None;
    let replayed = replay_watched(bank, settings, settings.policy.metric(), run, |film| {
        if found.is_none() && feature.is_found(|pixel| film.mean(pixel)) {
            found = Some(film.samples() as f64 / bank.spec().look.pixels() as f64);
        }
    })?;
    let at_end = feature.is_found(|pixel| replayed.picture.rgb[pixel]).then(|| replayed.samples_per_pixel());
    Ok(found.or(at_end))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::tests::flat;

    #[test]
    fn rare_light_is_late_and_found_by_half_of_its_pixels() {
        let mut reference = flat(50, 10, 0.75, 0.0);
        assert!(Feature::of(&reference).is_none(), "variance 1 at 0.75: a third of all samples");
        // Twelve pixels of mean 0.5 that one sample in 100 or 101 lights: variance 0.25 * 99 or 100. One as rare, but
        // dark. A fiftieth of 499 pixels is 10.
        reference.mean.rgb[..12].fill([0.5; 3]);
        reference.sample_variance[..10].fill([0.25 * 100.0; 3]);
        reference.sample_variance[10..13].fill([0.25 * 99.0; 3]);
        reference.mean.rgb[12] = [0.01; 3];
        let feature = Feature::of(&reference).unwrap();
        assert_eq!(feature.share(&reference.mean), 0.02);
        assert!(!feature.is_found(|i| if i < 4 { [9.0; 3] } else { [0.2; 3] }));
        assert!(feature.is_found(|i| if i < 5 { [0.3; 3] } else { [0.0; 3] }));
    }
}
