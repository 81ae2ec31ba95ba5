//! When the picture is finished: two rules, one for each mode (PROTOCOL.md).

use std::collections::VecDeque;

use crate::{
    protocol::Misfit,
    sync::{AtomicU64, CacheLine, Mutex, Ordering, fence, lock},
};

/// Deterministic mode: finished when as many consecutive passes as the lag drew nothing.
///
/// Then every error plane holds the same errors, the trees to come are the trees that are there, and no later
/// pass would draw anything.
#[derive(Debug)]
pub(super) struct PassLedger {
    regions: u32,
    lag: u32,
    passes: Mutex<Passes>,
}

#[derive(Debug, Default)]
struct Passes {
    /// Passes that every region has finished.
    complete: u64,
    /// The passes after those: regions that have finished them, and whether one drew anything.
    open: VecDeque<(u32, bool)>,
    /// How many of the last complete passes drew nothing.
    quiet: u32,
}

impl PassLedger {
    pub(super) fn new(regions: u32, lag: u32) -> Self {
        Self { regions, lag, passes: Mutex::new(Passes::default()) }
    }

    /// A region has finished `pass`, and drew something in it or not. True where that finishes the picture.
    pub(super) fn region_finished(&self, pass: u64, drew: bool) -> bool {
        let mut guard = lock(&self.passes);
        let passes = &mut *guard;
        let place = (pass - passes.complete) as usize;
        while passes.open.len() <= place {
            passes.open.push_back((0, false));
        }
        passes.open[place].0 += 1;
        passes.open[place].1 |= drew;
        while let Some(&(regions, drew)) = passes.open.front()
            && regions == self.regions
        {
            passes.open.pop_front();
            passes.complete += 1;
            passes.quiet = if drew { 0 } else { passes.quiet + 1 };
        }
        passes.quiet >= self.lag
    }

    /// How many of the last complete passes drew nothing, and of each open pass whether it has drawn so far.
    pub(super) fn state(&self) -> (u32, Vec<bool>) {
        let passes = lock(&self.passes);
        (passes.quiet, passes.open.iter().map(|&(_, drew)| drew).collect())
    }

    /// Goes on from [`Self::state`] where region r has finished `finished[r]` passes. True where that was the end.
    pub(super) fn restore(&mut self, finished: &[u64], quiet: u32, drew: &[bool]) -> Result<bool, Misfit> {
        let complete = finished.iter().copied().min().unwrap_or(0);
        let open = finished.iter().copied().max().unwrap_or(0) - complete;
        let fits = drew.len() as u64 == open && u64::from(quiet) <= complete;
        Misfit::unless(fits, "its passes do not agree with its trees")?;
        let regions = |pass| finished.iter().filter(|&&finished| finished > pass).count() as u32;
        let open = (complete..).zip(drew).map(|(pass, &drew)| (regions(pass), drew)).collect();
        *lock(&self.passes) = Passes { complete, open, quiet };
        Ok(quiet >= self.lag)
    }

    /// Passes that every region has finished.
    pub(super) fn complete(&self) -> u64 {
        lock(&self.passes).complete
    }
}

/// Free-running mode: finished when every region was rebuilt from errors that nobody has touched since, and none
/// found a pixel to draw.
///
/// The number of drawing visits begun is the version of the errors; it is at rest while as many have ended.
#[derive(Debug)]
pub(super) struct Quiescence {
    begun: CacheLine<AtomicU64>,
    ended: CacheLine<AtomicU64>,
    /// The version at which each region last found nothing to draw.
    quiet_at: Mutex<Vec<Option<u64>>>,
}

impl Quiescence {
    pub(super) fn new(regions: u32) -> Self {
        Self {
            begun: CacheLine(AtomicU64::new(0)),
            ended: CacheLine(AtomicU64::new(0)),
            quiet_at: Mutex::new(vec![None; regions as usize]),
        }
    }

    /// A visit means to draw; it must check its tile again after this, and then end, drawn or not.
    pub(super) fn begin_drawing(&self) {
        self.begun.fetch_add(1, Ordering::Relaxed);
        // Sequentially consistent, with the fence in `region_is_quiet`: either the visit's second check sees
        // the masks of that region's rebuild, or that thread sees this visit begun.
        fence(Ordering::SeqCst);
    }

    /// The visit's errors are in place.
    pub(super) fn end_drawing(&self) {
        // Release: who counts this visit as ended reads its errors.
        self.ended.fetch_add(1, Ordering::Release);
    }

    /// The version of the errors, where no visit is drawing now.
    pub(super) fn version_at_rest(&self) -> Option<u64> {
        // In this order: `ended <= begun` at any time, so where a later look at `begun` shows no more than
        // `ended` was, nobody was drawing at the moment of that look. Acquire: keeps the order, and brings the
        // errors of all that ended.
        let ended = self.ended.load(Ordering::Acquire);
        (self.begun.load(Ordering::Acquire) == ended).then_some(ended)
    }

    /// A region rebuilt from errors of `version` has nothing to draw and its masks are in place. True where
    /// that finishes the picture.
    pub(super) fn region_is_quiet(&self, region: u32, version: u64) -> bool {
        let mut quiet_at = lock(&self.quiet_at);
        quiet_at[region as usize] = Some(version);
        // See `begin_drawing`.
        fence(Ordering::SeqCst);
        let begun = self.begun.load(Ordering::Relaxed);
        quiet_at.iter().all(|&at| at == Some(begun))
    }
}

#[cfg(all(test, not(any(loom, shuttle))))]
mod tests {
    use super::*;

    #[test]
    fn passes_finish_in_order_and_quiet_ones_must_follow_each_other() {
        let ledger = PassLedger::new(2, 2);
        let finished = |pass, drew| ledger.region_finished(pass, drew);
        // Pass 1 is ahead in one region; then it is quiet, but pass 2 is not.
        for (pass, drew) in [(0, true), (1, false), (0, false), (1, false), (2, false), (2, true)] {
            assert!(!finished(pass, drew));
        }
        assert_eq!([3, 3, 4, 4].map(|pass| finished(pass, false)), [false, false, false, true]);
        assert_eq!(ledger.complete(), 5);
    }

    #[test]
    fn a_drawing_visit_keeps_the_picture_unfinished() {
        let rest = Quiescence::new(2);
        assert_eq!(rest.version_at_rest(), Some(0));
        assert!(!rest.region_is_quiet(0, 0));
        rest.begin_drawing();
        assert_eq!(rest.version_at_rest(), None);
        assert!(!rest.region_is_quiet(1, 0), "a visit has begun since");
        rest.end_drawing();
        assert_eq!(rest.version_at_rest(), Some(1));
        assert!(!rest.region_is_quiet(1, 1));
        assert!(rest.region_is_quiet(0, 1));
    }
}
