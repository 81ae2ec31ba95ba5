//! A renderer thread's handle: from one visit to the next.

use super::{AdaptiveSampling, FinishRule, Visit, statistics::Tally};
use crate::protocol::{Outcome, Turn};

/// One thread's handle on the sampling. Between visits it holds nothing: it can be dropped at any time.
pub struct Worker<'a> {
    pub(super) sampling: &'a AdaptiveSampling,
    pub(super) tally: Tally,
}

impl<'a> Worker<'a> {
    pub(super) fn new(sampling: &'a AdaptiveSampling) -> Self {
        Self { sampling, tally: Tally::default() }
    }

    /// The next tile to draw. Sleeps while nothing is eligible; `None` once the picture is finished or the
    /// sampling was stopped. Tiles with nothing to draw are passed over without coming up here.
    pub fn next_visit(&mut self) -> Option<Visit<'_, 'a>> {
        loop {
            let Some(turn) = self.sampling.protocol.next_turn(&mut self.tally.idle_nanoseconds) else {
                self.sampling.counters.add(&mut self.tally);
                return None;
            };
            let mask = self.sampling.mask_to_draw(turn);
            if mask != 0 {
                self.tally.visits += 1;
                self.sampling.counters.add(&mut self.tally);
                return Some(Visit::new(self, turn, mask));
            }
            self.tally.skips += 1;
            self.sampling.skip(turn);
        }
    }
}

impl Drop for Worker<'_> {
    fn drop(&mut self) {
        self.sampling.counters.add(&mut self.tally);
        if std::thread::panicking() {
            // Wherever it happened, a turn may have been lost, and others may wait for it.
            self.sampling.protocol.end(Outcome::Abandoned);
        }
    }
}

impl AdaptiveSampling {
    /// The pixels that a turn will draw; in free-running mode also announces that it will.
    fn mask_to_draw(&self, Turn { tile, pass, .. }: Turn) -> u64 {
        let look = || match self.check(tile, pass) {
            0 => 0,
            mask => self.below_maximum(tile, mask),
        };
        let mask = look();
        let FinishRule::AtRest(rest) = &self.finish else { return mask };
        if mask == 0 {
            return 0;
        }
        rest.begin_drawing();
        // Looked at again: the end may have been decided between the first look and the announcement.
        let mask = look();
        if mask == 0 {
            rest.end_drawing();
        }
        mask
    }

    /// A turn that draws nothing: its errors go over to this pass's plane.
    fn skip(&self, turn: Turn) {
        // Where the previous visit drew nothing either, this pass's plane, which is also that of two passes
        // ago, holds the same errors already.
        if self.planes.len() > 1 && !turn.was_quiet {
            self.plane(turn.pass).copy_tile(turn.tile, self.plane(turn.pass.wrapping_sub(1)));
        }
        self.protocol.finish(turn, false, |update| self.update(update));
    }
}
