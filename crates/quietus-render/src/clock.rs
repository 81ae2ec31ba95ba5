//! The time that a render has, and what is left of it.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use crate::crew;
use crate::live::Live;
use crate::run::{Control, StoppedBy};

/// The time there is.
#[derive(Clone, Copy)]
pub(crate) struct Clock<'a> {
    pub(crate) start: Instant,
    pub(crate) limit: Option<Duration>,
    pub(crate) live: Option<&'a Live>,
}

impl Clock<'_> {
    /// Time since the render began, without pauses.
    pub(crate) fn elapsed(&self) -> Duration {
        self.start.elapsed().saturating_sub(self.live.map_or(Duration::ZERO, Live::paused_for))
    }

    /// Time that is left, where there is a limit.
    pub(crate) fn left(&self) -> Option<Duration> {
        self.limit.map(|limit| limit.saturating_sub(self.elapsed()))
    }

    pub(crate) fn is_late(&self) -> bool {
        self.limit.is_some_and(|limit| self.elapsed() >= limit)
    }

    /// Why to stop now, if so.
    pub(crate) fn stops(&self, control: &Control<'_>) -> Option<StoppedBy> {
        // Relaxed: the flag guards no data.
        if control.cancel.load(Ordering::Relaxed) {
            return Some(StoppedBy::Cancelled);
        }
        self.is_late().then_some(StoppedBy::TimeLimit)
    }

    /// Time until somebody should look again.
    pub(crate) fn interval(&self) -> crew::Interval {
        self.left()
            .filter(|left| !left.is_zero())
            .map_or(crew::WATCH_INTERVAL, |left| left.min(crew::WATCH_INTERVAL))
    }
}
