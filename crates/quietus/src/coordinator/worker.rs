//! A renderer thread's handle: from one visit to the next.

use super::{AdaptiveSampling, FinishRule, Visit, statistics::Tally};
use crate::protocol::{Outcome, Skips, Turn};

/// One thread's handle on the sampling. Between visits it holds nothing: it can be dropped at any time.
#[derive(Debug)]
pub struct Worker<'a> {
    pub(super) sampling: &'a AdaptiveSampling,
    pub(super) tally: Tally,
    /// All it ever slept.
    pub(super) slept_nanoseconds: u64,
}

impl<'a> Worker<'a> {
    pub(super) fn new(sampling: &'a AdaptiveSampling) -> Self {
        Self { sampling, tally: Tally::default(), slept_nanoseconds: 0 }
    }

    /// The next tile to draw. Sleeps while nothing is eligible; `None` once the picture is finished or the
    /// sampling was stopped. Tiles with nothing to draw are passed over without coming up here.
    pub fn next_visit(&mut self) -> Option<Visit<'_, 'a>> {
        let sampling = self.sampling;
        loop {
            // What is to be skipped is skipped many tiles at a time, what may be drawn is taken tile by tile.
            while let Some(skips) = sampling.protocol.next_skips(|turn| sampling.pixels_to_draw(turn) == 0) {
                self.tally.skips += skips.tiles.len() as u64;
                sampling.skip(skips);
            }
            let slept_before = self.tally.idle_nanoseconds;
            let turn = sampling.protocol.next_turn(&mut self.tally.idle_nanoseconds);
            self.slept_nanoseconds += self.tally.idle_nanoseconds - slept_before;
            let Some(turn) = turn else {
                sampling.counters.add(&mut self.tally);
                return None;
            };
            let mask = sampling.mask_to_draw(turn);
            if mask != 0 {
                self.tally.visits += 1;
                sampling.counters.add(&mut self.tally);
                return Some(Visit::new(self, turn, mask));
            }
            self.tally.skips += 1;
            sampling.skip(Skips { tiles: &[turn.tile], pass: turn.pass });
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
    /// The pixels that are active and below the maximum of samples as a turn begins.
    pub(super) fn pixels_to_draw(&self, Turn { tile, pass }: Turn) -> u64 {
        match self.check(tile, pass) {
            0 => 0,
            mask => self.due(tile, pass, self.below_maximum(tile, mask)),
        }
    }

    /// The pixels that a turn will draw; in free-running mode also announces that it will.
    pub(super) fn mask_to_draw(&self, turn: Turn) -> u64 {
        let mask = self.pixels_to_draw(turn);
        let FinishRule::AtRest(rest) = &self.finish else { return mask };
        if mask == 0 {
            return 0;
        }
        rest.begin_drawing();
        // Looked at again: the end may have been decided between the first look and the announcement.
        let mask = self.pixels_to_draw(turn);
        if mask == 0 {
            rest.end_drawing();
        }
        mask
    }

    /// Turns that draw nothing: their errors go over to this pass's plane.
    pub(super) fn skip(&self, skips: Skips<'_>) {
        // Where the previous visit drew nothing either, this pass's plane, which is also that of two passes
        // ago, holds the same errors already.
        if self.planes.len() > 1 {
            let (to, from) = (self.plane(skips.pass), self.plane(skips.pass.wrapping_sub(1)));
            (skips.tiles.iter().filter(|&&tile| !self.protocol.was_quiet(tile)))
                .for_each(|&tile| to.copy_tile(tile, from));
        }
        self.protocol.finish_skips(skips, |update| self.update(update));
    }
}
