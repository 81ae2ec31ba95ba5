//! What a round comes to beyond what quotas say at its beginning.
//!
//! At every update some quotas come out larger, by chance or by what was found, and what was drawn for them stays drawn:
//! samples *creep*. How much is the scene's own, and much the same from round to round.

use serde::{Deserialize, Serialize};

/// What comes beyond the samples that quotas add is this share of them, and that times the creep of the round before: on the way,
/// and in the last round, which has as many updates for an eighth more samples as others for a quarter.
const CREEP: [(f64, f64); 2] = [(0.0, 0.5), (0.15, 1.1)];

/// Creep of a round that nothing is known of.
const USUAL: f64 = 0.2;

/// Most that is believed.
const MOST: f64 = 1.5;

/// Rounds that add a smaller share of the samples there were tell nothing.
const LEAST_STEP: f64 = 0.01;

/// What the rounds so far have shown.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Creep {
    /// Samples there were before this round, and those it should come to as quotas said then.
    foreseen: Option<[f64; 2]>,
    /// By how much the round before went beyond that, as a share of what it should have added.
    crept: f64,
}

impl Default for Creep {
    fn default() -> Self {
        Self { foreseen: None, crept: USUAL }
    }
}

impl Creep {
    /// A round begins with `before` samples and should come to `foreseen`.
    pub(crate) fn foresee(&mut self, before: f64, foreseen: f64) {
        self.foreseen = Some([before, foreseen]);
    }

    /// It came to `samples`.
    pub(crate) fn learn(&mut self, samples: f64) {
        if let Some([before, foreseen]) = self.foreseen.take()
            && foreseen - before > LEAST_STEP * before
        {
            self.crept = ((samples - before) / (foreseen - before) - 1.0).clamp(0.0, MOST);
        }
    }

    /// What the next round will come to beyond what quotas say, as a share of what they add.
    pub(crate) fn expected(&self, is_last: bool) -> f64 {
        let (least, share) = CREEP[usize::from(is_last)];
        (least + share * self.crept).min(MOST)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_round_has_shown_is_expected_of_the_next() {
        let mut creep = Creep::default();
        let unknown = creep.expected(true);
        creep.foresee(100.0, 200.0);
        creep.learn(300.0);
        assert_eq!(creep.expected(false), 0.5);
        assert!(creep.expected(true) > 1.0 && unknown < 0.5);
        // Nothing was to be added: nothing was learnt.
        creep.foresee(300.0, 301.0);
        creep.learn(900.0);
        assert_eq!(creep.expected(false), 0.5);
        // A round that was cut short has not crept backwards.
        creep.foresee(300.0, 600.0);
        creep.learn(350.0);
        assert_eq!(creep.expected(false), 0.0);
        // One round is learnt from once.
        creep.learn(1e9);
        assert_eq!(creep.expected(false), 0.0);
    }
}
