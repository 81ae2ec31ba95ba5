//! Samples the film could not take: counted, the first ones remembered.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

/// How many rejected samples are remembered. A handful tells a pattern, more only hides it.
const REMEMBERED: usize = 8;

/// A sample that was not finite. Ordered by row, column, replicate, index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct RejectedSample {
    /// Row in the full frame.
    pub y: u32,
    /// Column in the full frame.
    pub x: u32,
    /// Replicate of the pixel.
    pub replicate: u8,
    /// Sample index within the replicate.
    pub index: u32,
}

/// All rejected samples of a render. The ones remembered are the first in picture order, not in time, so that the
/// report does not depend on threads.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RejectedSamples {
    count: u64,
    first: BTreeSet<RejectedSample>,
}

impl RejectedSamples {
    /// How many there were.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The first few by row, column, replicate and index.
    pub fn first(&self) -> impl Iterator<Item = &RejectedSample> {
        self.first.iter()
    }

    /// Whether there can be so many, with room for more.
    pub(crate) fn is_possible(&self) -> bool {
        self.count < 1 << 60 && self.first.len() <= REMEMBERED
    }

    pub(crate) fn push(&mut self, sample: RejectedSample) {
        self.count += 1;
        self.remember(sample);
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        self.count += other.count;
        other.first.iter().for_each(|&sample| self.remember(sample));
    }

    pub(crate) fn clear(&mut self) {
        self.count = 0;
        self.first.clear();
    }

    fn remember(&mut self, sample: RejectedSample) {
        self.first.insert(sample);
        if self.first.len() > REMEMBERED {
            self.first.pop_last();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn remembers_the_first_in_picture_order_whatever_the_order_of_arrival() {
        let sample = |n: u32| RejectedSample { y: n / 4, x: n % 4, replicate: 0, index: n };
        let mut forward = RejectedSamples::default();
        let mut backward = RejectedSamples::default();
        (0..40).for_each(|n| forward.push(sample(n)));
        let mut part = RejectedSamples::default();
        (20..40).rev().for_each(|n| part.push(sample(n)));
        (0..20).rev().for_each(|n| backward.push(sample(n)));
        backward.merge(&part);
        assert_eq!(forward, backward);
        assert_eq!(forward.count(), 40);
        assert_eq!(forward.first().map(|s| s.index).collect::<Vec<_>>(), (0..8).collect::<Vec<_>>());
    }
}
