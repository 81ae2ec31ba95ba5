//! The state of a render.

use quietus::SamplingState;
use quietus_film::FilmState;
use serde::{Deserialize, Serialize};

use crate::rounds::Past;
use crate::steering::{Aim, Learnt};

/// Everything that decides what is drawn from here on, besides scene and settings.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RenderState {
    /// What the round is to reach.
    pub(crate) aim: Aim,
    /// What the rounds before it have taught.
    pub(crate) learnt: Learnt,
    /// Samples no pixel was to exceed.
    pub(crate) max_samples: u32,
    /// The rounds before it, and what was drawn so far.
    pub(crate) past: Past,
    pub(crate) sampling: SamplingState,
    pub(crate) film: FilmState,
}
