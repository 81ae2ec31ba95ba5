//! Turns that draw nothing, taken and finished many at a time: most turns of a picture that is nearly finished are such.

use super::{Protocol, Turn, Update};
use crate::sync::Ordering;

/// Turns of tiles that follow each other in one pass, none of which draws anything: taken, and finished, at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Skips<'a> {
    /// The tiles, in visiting order; at least one.
    pub tiles: &'a [u32],
    /// The pass, from 0.
    pub pass: u64,
}

/// Most tickets taken at once: enough to make the shared counters' cost per skip small, few enough to leave
/// other threads something to skip.
const MAX_SKIPS: u64 = 32;

impl<R> Protocol<R> {
    /// Takes the next tickets at once, as far as their turns have come and `draws_nothing`: of one pass, and not
    /// too many. `None` where the next ticket is not such a one. Never waits.
    ///
    /// Who got them must [`finish_skips`](Self::finish_skips), or [`end`](Self::end) everything.
    pub fn next_skips(&self, draws_nothing: impl Fn(Turn) -> bool) -> Option<Skips<'_>> {
        if !self.gate.try_enter() {
            return None;
        }
        let skips = self.take_skips(draws_nothing);
        if skips.is_none() {
            self.gate.leave();
        }
        skips
    }

    fn take_skips(&self, draws_nothing: impl Fn(Turn) -> bool) -> Option<Skips<'_>> {
        let tiles = self.order.len() as u64;
        // Relaxed: see `next_turn`.
        let mut first = self.next_ticket.load(Ordering::Relaxed);
        loop {
            let (pass, place) = (first / tiles, (first % tiles) as usize);
            let end = (place + MAX_SKIPS as usize).min(self.order.len());
            let is_skip = |&tile: &u32| {
                self.is_due(tile, pass) && !self.is_past(tile, pass) && draws_nothing(Turn { tile, pass })
            };
            let count = self.order[place..end].iter().take_while(|tile| is_skip(tile)).count();
            if count == 0 || self.outcome().is_some() {
                return None;
            }
            // Relaxed: the looks at the tiles have acquired what they saw. They hold if this succeeds: tickets
            // only grow, so nobody had these visits, and what a due visit reads stays until it is counted.
            let next = first + count as u64;
            match self.next_ticket.compare_exchange(first, next, Ordering::Relaxed, Ordering::Relaxed) {
                Ok(_) => return Some(Skips { tiles: &self.order[place..place + count], pass }),
                Err(now) => first = now,
            }
        }
    }

    /// Ends turns that drew nothing and whose errors are in place. As [`Self::finish`] for each of them, but one
    /// access to a region's counter for all of its home tiles that follow each other.
    pub fn finish_skips(&self, skips: Skips<'_>, mut update: impl FnMut(Update<'_, R>)) {
        let Skips { tiles, pass } = skips;
        let slot = self.slot(pass);
        tiles.iter().for_each(|&tile| self.count_tile(Turn { tile, pass }, false));
        self.parked.unpark_each(tiles.iter().map(|&tile| tile as usize));
        for run in tiles.chunk_by(|&a, &b| self.home(a) == self.home(b)) {
            self.count_out(self.home(run[0]), slot, run.len() as u32, &mut update);
        }
        for &tile in tiles {
            for region in self.containing(&self.tiles[tile as usize]).skip(1) {
                self.count_out(region, slot, 1, &mut update);
            }
        }
        self.gate.leave();
    }
}
