//! "Last one out turns off the lights" (the talk, section 4.1): the counter that names the thread which updates
//! a region's tree, without a barrier.

use crate::sync::{AtomicI64, Ordering};

/// Counts down the tile visits a region still expects before its tree is rebuilt.
///
/// Starts at the region's number of tiles, overlap included. Every visit of such a tile decrements it, also when
/// nothing was drawn; the visit that reaches zero has to rebuild.
#[derive(Debug)]
pub struct VisitCounter {
    remaining: AtomicI64,
    visits: i64,
}

impl VisitCounter {
    /// A counter that expects `visits` visits, at least 1, per rebuild.
    pub fn new(visits: u32) -> Self {
        assert!(visits > 0, "a region without tiles is never visited");
        Self { remaining: AtomicI64::new(visits.into()), visits: visits.into() }
    }

    /// Takes `visits` visits, at least 1, off at once. True where one of them reached zero: exactly once between
    /// two [`Self::rearm`]s.
    pub fn count_visits(&self, visits: u32) -> bool {
        // Release: the errors these visits wrote happen before whatever the last one out does next.
        // Acquire: if this is the last one out, it sees what every earlier visit wrote. Each decrement is a
        // read-modify-write, so all of them form one release sequence and none is skipped.
        let before = self.remaining.fetch_sub(visits.into(), Ordering::AcqRel);
        // Free-running visits may take it from above zero to below in one step.
        (1..=i64::from(visits)).contains(&before)
    }

    /// Whether the expected visits have all been made.
    pub fn is_exhausted(&self) -> bool {
        // Acquire: a thread may rebuild on behalf of the last one out, who has not come to it yet; reading the
        // zero must bring what the visits wrote, as it did to the one who made it.
        self.remaining.load(Ordering::Acquire) <= 0
    }

    /// Expects another round of visits. Only the holder of the region's lock may call it.
    ///
    /// Adds, never stores: while the lock was waited for, free-running visits have driven the counter below
    /// zero, and a store would lose those and any that come between the load and the store.
    pub fn rearm(&self) {
        // Relaxed throughout: the lock orders one holder after another, and read-modify-writes keep the release
        // sequences of the visits intact.
        let mut remaining = self.remaining.load(Ordering::Relaxed);
        while remaining <= 0 {
            remaining = self.remaining.fetch_add(self.visits, Ordering::Relaxed) + self.visits;
        }
    }

    /// The mistake that [`Self::rearm`] avoids, for tests that must catch it.
    #[cfg(any(test, loom, shuttle))]
    pub fn rearm_by_load_and_store(&self) {
        let mut remaining = self.remaining.load(Ordering::Relaxed);
        while remaining <= 0 {
            remaining += self.visits;
        }
        self.remaining.store(remaining, Ordering::Relaxed);
    }

    /// Visits still expected; negative where free-running visits came before the re-arming.
    pub fn remaining(&self) -> i64 {
        // Relaxed: for statistics and tests that have joined their threads.
        self.remaining.load(Ordering::Relaxed)
    }
}

#[cfg(all(test, not(any(loom, shuttle))))]
mod tests {
    use super::*;

    #[test]
    fn the_last_visit_alone_is_told_so() {
        let counter = VisitCounter::new(3);
        assert_eq!([(); 5].map(|()| counter.count_visits(1)), [false, false, true, false, false]);
        assert!(counter.is_exhausted());
        counter.rearm();
        assert_eq!(counter.remaining(), 1, "two early visits stay counted");
        assert!(counter.count_visits(1));
    }

    #[test]
    fn rearming_adds_until_positive() {
        let counter = VisitCounter::new(2);
        (0..7).for_each(|_| {
            counter.count_visits(1);
        });
        counter.rearm();
        assert_eq!(counter.remaining(), 1);
    }

    #[test]
    fn visits_taken_off_together_reach_zero_or_cross_it_once() {
        let counter = VisitCounter::new(5);
        assert_eq!([3, 2, 2].map(|visits| counter.count_visits(visits)), [false, true, false]);
        counter.rearm();
        assert_eq!(counter.remaining(), 3);
        assert!(counter.count_visits(4), "from above zero to below");
        assert!(!counter.count_visits(1));
    }
}
