//! Whether the noise that a render reports is the noise it has.

use quietus_render::noise::{Effort, Finished, FreshMean, Noise, estimate, pick};

use crate::{
    Bank, Replay, packed,
    runs::{Random, independent_runs},
};

/// The report that a render would make of a replay of run `run`, from streams that the run does not use; none where
/// the bank has no others, or the run none of its own.
///
/// A pixel that is picked more often than the bank has pairs of streams left sees samples twice.
pub(crate) fn reported_noise(bank: &Bank, replay: &Replay, run: u64) -> Option<Noise> {
    let streams = bank.spec().streams;
    let pairs = independent_runs(streams, 2);
    let own = u32::try_from(run).ok().filter(|run| *run < pairs && pairs > 1)?;
    let finished = Finished {
        width: replay.picture.width as usize,
        halves: &replay.halves,
        means: &replay.picture.rgb,
        counts: &replay.counts,
        weights: None,
        aovs: None,
    };
    let picks = pick(&finished, Effort::REPORT, |index| {
        Random::new(run ^ 0x6e6f_6973, index).next() as f64 / 2.0_f64.powi(64)
    });
    let fresh: Vec<[FreshMean; 2]> = picks
        .iter()
        .map(|pick| {
            let pair = (own + 1 + pick.repeat % (pairs - 1)) % pairs;
            [0, 1].map(|half| fresh_mean(&bank.stream(pick.pixel, 2 * pair + half)[..pick.samples as usize]))
        })
        .collect();
    Some(estimate(&replay.picture.rgb, &picks, &fresh))
}

/// Means of all samples and of their halves.
fn fresh_mean(words: &[[u8; 8]]) -> FreshMean {
    let (whole, (first, second)) = (mean(words), words.split_at(words.len() / 2));
    let halves = if first.is_empty() { [whole; 2] } else { [mean(first), mean(second)] };
    FreshMean { whole, halves }
}

/// Mean of the samples that are not rejected.
fn mean(words: &[[u8; 8]]) -> [f32; 3] {
    let words = words.iter().map(|&bytes| u64::from_le_bytes(bytes)).filter(|&word| word != packed::REJECTED);
    let (mut sum, mut count) = ([0.0_f64; 3], 0.0_f64);
    for word in words {
        let value = packed::unpack(word);
        (0..3).for_each(|c| sum[c] += f64::from(value[c]));
        count += 1.0;
    }
    sum.map(|sum| (sum / count.max(1.0)) as f32)
}
