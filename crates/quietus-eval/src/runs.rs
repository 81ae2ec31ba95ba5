//! Which streams of a bank a run uses: many runs from one bank, and how independent they are.
//!
//! A bank of S streams has room for G = S / R runs of R replicates that share no sample. They are the runs of
//! *round 0*: run k uses streams `R k .. R (k + 1)` of every pixel, with R = 2 the very samples of the live
//! render with seed `seed + k`. Each later round deals the streams anew: every pixel shuffles its own S
//! streams, run `g` of the round gets the `g`-th R of them. As streams are independent of each other and
//! between pixels, every run of every round is distributed as a live render is, and runs of one round are
//! independent of each other; runs of different rounds share samples, though, and a mean over many rounds
//! converges to what this bank says, not to the truth. Standard errors are therefore taken within rounds.

/// The shuffled streams of one run.
pub(crate) struct Deal {
    replicates: usize,
    /// R in a row for each pixel; empty in round 0.
    streams: Vec<u16>,
    /// The first stream in round 0.
    first: u32,
}

/// Runs of `replicates` replicates that share no sample.
pub(crate) fn independent_runs(streams: u32, replicates: u32) -> u32 {
    streams / replicates
}

impl Deal {
    /// The streams that run `run` of a picture of `pixels` pixels uses.
    pub(crate) fn new(streams: u32, replicates: u32, pixels: usize, run: u64) -> Self {
        let group = u64::from(independent_runs(streams, replicates));
        let (round, first) = (run / group, (run % group) as u32 * replicates);
        let mut deal = Self { replicates: replicates as usize, streams: Vec::new(), first };
        if round > 0 {
            let mut order: Vec<u16> = vec![0; streams as usize];
            for pixel in 0..pixels {
                shuffle(&mut order, &mut Random::new(round, pixel as u64));
                deal.streams.extend_from_slice(&order[first as usize..][..replicates as usize]);
            }
        }
        deal
    }

    /// The stream that a replicate of a pixel uses.
    #[inline]
    pub(crate) fn stream(&self, pixel: usize, replicate: u8) -> u32 {
        match self.streams.get(pixel * self.replicates + usize::from(replicate)) {
            Some(&stream) => stream.into(),
            None => self.first + u32::from(replicate),
        }
    }
}

/// Fisher and Yates, as Durstenfeld 1964 has it.
fn shuffle(order: &mut [u16], random: &mut Random) {
    order.iter_mut().zip(0..).for_each(|(place, stream)| *place = stream);
    for i in (1..order.len()).rev() {
        order.swap(i, random.below(i as u64 + 1) as usize);
    }
}

/// SplitMix (Steele, Lea and Flood 2014): small, and good enough to shuffle and to resample.
#[derive(Clone, Debug)]
pub(crate) struct Random(u64);

impl Random {
    /// A stream of its own for each pair of keys.
    pub(crate) fn new(a: u64, b: u64) -> Self {
        let mut random = Self(a);
        Self(random.next() ^ b.wrapping_mul(0xd134_2543_de82_ef95))
    }

    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }

    /// In `0..bound`; the bias is below `bound / 2^64`.
    pub(crate) fn below(&mut self, bound: u64) -> u64 {
        ((u128::from(self.next()) * u128::from(bound)) >> 64) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_runs_of_a_round_share_no_stream() {
        for round in 0..3 {
            for pixel in [0, 5, 39] {
                let mut seen = [0; 9];
                for run in 4 * round..4 * (round + 1) {
                    let deal = Deal::new(9, 2, 40, run);
                    (0..2).for_each(|r| seen[deal.stream(pixel, r) as usize] += 1);
                }
                assert_eq!(seen.iter().sum::<i32>(), 8);
                assert!(seen.iter().all(|&n| n <= 1), "round {round}: {seen:?}");
            }
        }
    }

    /// Every ordered pair of streams is equally likely: chi-square over 12 cells, 11 degrees of freedom,
    /// whose quantile at 1 - 1e-6 is 49.3.
    #[test]
    fn shuffles_are_fair() {
        let mut cells = [[0.0_f64; 4]; 4];
        for round in 1..40 {
            let deal = Deal::new(4, 2, 500, 2 * round + 1);
            (0..500).for_each(|p| cells[deal.stream(p, 0) as usize][deal.stream(p, 1) as usize] += 1.0);
        }
        let expected = 39.0 * 500.0 / 12.0;
        let off_diagonal = (0..16).filter(|i| i % 5 != 0).map(|i| cells[i / 4][i % 4]);
        let chi_square: f64 = off_diagonal.map(|n| (n - expected).powi(2) / expected).sum();
        assert!(chi_square < 49.3, "{chi_square}");
    }
}
