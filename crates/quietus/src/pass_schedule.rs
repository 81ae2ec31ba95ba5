//! Progressive passes whose size grows (the talk, section 4.1).

/// Passes in which an [`Approach::Spread`] draws every pixel once: the pixels of a square.
pub(crate) const SQUARE: u32 = 4;

/// How many samples a pass adds to each active pixel.
///
/// Early passes are short, so that the picture and its errors are seen soon; later ones grow, so that checks and
/// rebuilds cost ever less of the time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PassSchedule {
    first: u32,
    second: u32,
    growth: u32,
}

impl PassSchedule {
    /// Published practice: 1, then 4, 6, 8, 10, ... samples.
    pub const TALK: Self = Self { first: 1, second: 4, growth: 2 };

    /// `first` samples, then `second`, `second + growth`, `second + 2 growth`, ...; the first two are taken as 1
    /// where they are 0.
    pub const fn new(first: u32, second: u32, growth: u32) -> Self {
        Self {
            first: if first == 0 { 1 } else { first },
            second: if second == 0 { 1 } else { second },
            growth,
        }
    }

    /// Samples that pass `pass` (from 0) adds to each active pixel, over all its replicates.
    pub fn samples(&self, pass: u32) -> u32 {
        match pass {
            0 => self.first,
            _ => self.second.saturating_add(self.growth.saturating_mul(pass - 1)),
        }
    }

    /// Samples that a pass adds to each of `replicates` replicates, equal so that they stay equal halves.
    pub fn samples_per_replicate(&self, pass: u32, replicates: u32) -> u32 {
        self.samples(pass).div_ceil(replicates)
    }
}

impl Default for PassSchedule {
    fn default() -> Self {
        Self::TALK
    }
}

/// How the count of a pixel grows, over all its replicates, while every pass draws it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PassCounts {
    /// Sizes of the passes.
    pub schedule: PassSchedule,
    /// Replicates of a pixel, at least 1; each gets as many samples of a pass as the others.
    pub replicates: u32,
    /// Samples below which every pass draws every pixel.
    pub min_samples: u32,
    /// Samples at which no pass draws a pixel.
    pub max_samples: u32,
    /// How many passes the tree that is consulted lags behind.
    pub lag: u32,
    /// How pixels come to their minimum.
    pub approach: Approach,
    /// Whether counts that go by themselves grow in steps of an eighth.
    pub fine_steps: bool,
}

/// How pixels come to the minimum of samples, before anything is known of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Approach {
    /// Each pass draws all of them, as the schedule of passes says (the talk, section 4.1).
    #[default]
    Whole,
    /// Each pass draws one pixel of every square of 2x2, and few samples of it. So a picture that is stopped at any moment
    /// has about the same number of samples everywhere, where whole passes leave the tiles they have reached with up to three
    /// times as many as the others. For [`Policy::Quietus`](crate::Policy::Quietus) and
    /// [`Policy::Uniform`](crate::Policy::Uniform).
    Spread,
}

impl PassCounts {
    /// Samples that a pass adds to a pixel.
    pub fn pass(&self, pass: u64) -> u32 {
        let pass = u32::try_from(pass).unwrap_or(u32::MAX);
        let each = self.schedule.samples_per_replicate(pass, self.replicates);
        each.saturating_mul(self.replicates)
    }

    /// What a pixel of `count` samples has after a pass that draws it.
    pub fn grown(&self, count: u32, pass: u64) -> u32 {
        count.saturating_add(self.pass(pass)).min(self.max_samples)
    }

    /// What a pixel of `count` samples has after a visit that draws it, if it goes by its own count instead of by the
    /// pass: the next count that a pixel drawn by every pass would have, but at least a quarter more. A pixel opened
    /// again late goes on in small steps, and one that needs thousands of samples gets there in few passes. Fine steps, and those of an [`Approach::Spread`]
    /// below the minimum, are of an eighth, and at least a sample of each replicate.
    pub fn next(&self, count: u32) -> u32 {
        let is_spread = self.approach == Approach::Spread && count < self.min_samples;
        if is_spread || self.fine_steps {
            let more = (count / 8).div_ceil(self.replicates).max(1).saturating_mul(self.replicates);
            return count.saturating_add(more).min(self.max_samples);
        }
        let (mut next, mut pass) = (0, 0);
        while next <= count && next < self.max_samples {
            (next, pass) = (self.grown(next, pass), pass + 1);
        }
        let quarter_more =
            count.saturating_add(count / 4).div_ceil(self.replicates).saturating_mul(self.replicates);
        next.max(quarter_more).min(self.max_samples)
    }

    /// What a pixel has that each of the first `passes` passes has drawn, in whole passes.
    pub fn after(&self, passes: u64) -> u32 {
        (0..passes).fold(0, |count, pass| self.grown(count, pass))
    }

    /// What every pixel has at least after its minimum of passes.
    pub fn least(&self) -> u32 {
        match self.approach {
            Approach::Whole => self.after(self.min_passes()),
            Approach::Spread => self.steps_to_minimum().last().unwrap_or(0),
        }
    }

    /// The counts by which an [`Approach::Spread`] leads to the minimum, or beyond: from 0 on.
    pub(crate) fn steps_to_minimum(&self) -> impl Iterator<Item = u32> {
        let (counts, least) = (*self, self.min_samples.max(1).min(self.max_samples));
        std::iter::successors(Some(0), move |&count| (count < least).then(|| counts.next(count)))
    }

    /// Passes that bring every pixel to its minimum. Trees say nothing before: all pixels are drawn alike.
    pub fn min_passes(&self) -> u64 {
        if self.approach == Approach::Spread {
            return u64::from(SQUARE) * (self.steps_to_minimum().count() as u64 - 1);
        }
        let mut samples = 0u32;
        let mut passes = 0;
        while samples < self.min_samples.max(1) {
            samples = samples.saturating_add(self.pass(passes));
            passes += 1;
        }
        passes
    }
}

/// The share of `total` samples that falls to one of `replicates` replicates; shares differ by at most one.
pub fn replicate_share(total: u32, replicates: u32, replicate: u32) -> u32 {
    total / replicates + u32::from(replicate < total % replicates)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_sizes() {
        let sizes: Vec<u32> = (0..5).map(|pass| PassSchedule::TALK.samples(pass)).collect();
        assert_eq!(sizes, [1, 4, 6, 8, 10]);
        let halves: Vec<u32> = (0..5).map(|pass| PassSchedule::TALK.samples_per_replicate(pass, 2)).collect();
        assert_eq!(halves, [1, 2, 3, 4, 5]);
    }

    #[test]
    fn counts_grow_at_their_own_pace() {
        let (schedule, replicates) = (PassSchedule::TALK, 2);
        let counts = PassCounts {
            schedule,
            replicates,
            min_samples: 16,
            max_samples: 4000,
            lag: 2,
            approach: Approach::Whole,
            fine_steps: false,
        };
        // As every pass does, also from a count between.
        assert_eq!([0, 2, 6, 12, 20, 30, 42].map(|n| counts.next(n)), [2, 6, 12, 20, 30, 42, 56]);
        assert_eq!([1, 13, 19].map(|n| counts.next(n)), [2, 20, 24]);
        // From there on by a quarter, in whole samples of both replicates, up to the maximum.
        assert_eq!([110, 1000, 3600, 4000].map(|n| counts.next(n)), [138, 1250, 4000, 4000]);
        let most = PassCounts { max_samples: u32::MAX, ..counts };
        assert_eq!(most.next(u32::MAX - 5), u32::MAX);
    }

    #[test]
    fn spread_steps_are_small() {
        let whole = PassCounts {
            schedule: PassSchedule::TALK,
            replicates: 2,
            min_samples: 16,
            max_samples: 4000,
            lag: 2,
            approach: Approach::Whole,
            fine_steps: false,
        };
        let spread = PassCounts { approach: Approach::Spread, ..whole };
        assert_eq!((whole.least(), whole.min_passes()), (20, 4));
        assert_eq!((spread.least(), spread.min_passes()), (16, 8 * 4));
        assert!(spread.steps_to_minimum().eq((0..=16).step_by(2)));
        // From the minimum on as ever.
        assert_eq!([16, 20].map(|n| spread.next(n)), [20, 30]);
        let far = PassCounts { min_samples: 4000, ..spread };
        assert_eq!([16, 32, 1000, 3900].map(|n| far.next(n)), [18, 36, 1126, 4000]);
        let fine = PassCounts { fine_steps: true, ..whole };
        assert_eq!([20, 42, 1000, 3999].map(|n| fine.next(n)), [22, 48, 1126, 4000]);
        let odd = PassCounts { min_samples: 1, max_samples: 1, ..spread };
        assert_eq!((odd.least(), odd.min_passes()), (1, 4));
    }

    #[test]
    fn shares_add_up() {
        for total in 0..20 {
            for replicates in 1..5 {
                let sum: u32 = (0..replicates).map(|r| replicate_share(total, replicates, r)).sum();
                assert_eq!(sum, total);
            }
        }
    }
}
