//! What a render has behind it, and what is kept of it.

use std::time::Duration;

use quietus::AdaptiveSampling;
use quietus_film::Film;
use serde::{Deserialize, Serialize};

use crate::checkpoint::RenderState;
use crate::process;
use crate::recording::Round as PastRound;
use crate::run::Counters;
use crate::statistics::Totals;
use crate::steering::{Aim, Learnt};

/// What a render has behind it.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Past {
    pub(super) wall: Duration,
    pub(super) cpu: Duration,
    pub(super) samples: u64,
    pub(super) rays: u64,
    pub(super) rounds: PastRounds,
}

impl Past {
    /// Whether a render can have that behind it, with room for more.
    pub(super) fn check(&self) -> Result<(), quietus::Misfit> {
        let is_possible = [self.samples, self.rays].iter().all(|&count| count < 1 << 60)
            && [self.wall, self.cpu].iter().all(|time| time.as_secs() < 1 << 40)
            && self.rounds.measurements < u32::MAX / 2
            && self.rounds.totals.is_possible();
        is_possible.then_some(()).ok_or(quietus::Misfit("it has counted too much"))
    }
}

/// The rounds that are over.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct PastRounds {
    pub(super) totals: Totals,
    /// Measurements of the noise so far.
    pub(super) measurements: u32,
    pub(super) history: Vec<PastRound>,
}

/// Where a round began. What is decided after its end follows from this and from what it has drawn.
pub(super) struct Begun {
    pub(super) aim: Aim,
    pub(super) learnt: Learnt,
    pub(super) before: PastRounds,
}

/// What is kept of a render, besides what its rounds have taught.
#[derive(Clone, Copy)]
pub(super) struct Kept<'a> {
    pub(super) film: &'a Film,
    pub(super) counters: &'a [Counters],
    pub(super) cpu_start: Option<Duration>,
    pub(super) max_samples: u32,
}

impl Kept<'_> {
    /// Copies everything out while nobody draws. `None` where that never comes about.
    pub(super) fn state(
        &self,
        begun: &Begun,
        sampling: &AdaptiveSampling,
        wall: Duration,
    ) -> Option<RenderState> {
        let paused = sampling.pause()?;
        Some(RenderState {
            aim: begun.aim,
            learnt: begun.learnt.clone(),
            max_samples: self.max_samples,
            past: self.past(wall, begun.before.clone()),
            sampling: paused.state(),
            film: self.film.state(),
        })
    }

    /// What is behind it by now, with these rounds.
    pub(super) fn past(&self, wall: Duration, rounds: PastRounds) -> Past {
        let [samples, rays] = Counters::sum(self.counters);
        let cpu = self.cpu_start.zip(process::cpu_time()).map(|(before, after)| after.saturating_sub(before));
        Past { wall, cpu: cpu.unwrap_or_default(), samples, rays, rounds }
    }
}
