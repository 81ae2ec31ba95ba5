//! Striped reader-writer locks (the talk, section 4.3): many readers of one tree hardly ever meet on a lock.
//!
//! The lock is the standard library's: its uncontended read costs as little as a mutex' lock (6 ns each; `cargo
//! bench -p quietus --bench protocol`), it lets readers of one stripe in together, and it needs no dependency.

use std::time::Instant;

use crate::sync::{AtomicU64, CacheLine, Ordering, RwLock, RwLockReadGuard, RwLockWriteGuard};

/// A value behind a power-of-two array of reader-writer locks, each on its own cache lines.
///
/// A reader at tile (x, y) takes lock `(y (p/2 + 1) + x) mod p` shared: `p/2 + 1` is odd, hence coprime with p,
/// and with p >= 8 the eight neighbours of a tile all use other locks than it does. A writer takes all locks in
/// ascending order, so that two writers cannot block each other for ever. Each lock holds its own handle on the
/// value (an `Arc`, say): safe Rust's way of saying that one value is guarded by any of them.
#[derive(Debug)]
pub struct StripedLocks<T> {
    stripes: Box<[CacheLine<Stripe<T>>]>,
}

#[derive(Debug)]
struct Stripe<T> {
    lock: RwLock<T>,
    /// Time readers have waited for this lock.
    waited_nanoseconds: AtomicU64,
}

impl<T> StripedLocks<T> {
    /// An array of `stripes` locks.
    ///
    /// # Panics
    /// Where `stripes` is not a power of two.
    pub fn new(stripes: u32, value: impl Fn() -> T) -> Self {
        assert!(stripes.is_power_of_two(), "the number of stripes must be a power of two, got {stripes}");
        let stripe = || Stripe { lock: RwLock::new(value()), waited_nanoseconds: AtomicU64::new(0) };
        Self { stripes: (0..stripes).map(|_| CacheLine(stripe())).collect() }
    }

    /// Which lock the tile in `column` and `row` uses.
    pub fn stripe(&self, column: u32, row: u32) -> usize {
        let p = self.stripes.len();
        (row as usize).wrapping_mul(p / 2 + 1).wrapping_add(column as usize) & (p - 1)
    }

    /// Shared access for the tile in `column` and `row`. Time is taken only where the lock is not free at once.
    pub fn read(&self, column: u32, row: u32) -> RwLockReadGuard<'_, T> {
        let stripe = &self.stripes[self.stripe(column, row)];
        if let Ok(guard) = stripe.lock.try_read() {
            return guard;
        }
        let start = Instant::now();
        let guard = stripe.lock.read().unwrap_or_else(std::sync::PoisonError::into_inner);
        // Relaxed: a statistic.
        stripe.waited_nanoseconds.fetch_add(nanoseconds_since(start), Ordering::Relaxed);
        guard
    }

    /// Exclusive access: every lock, in ascending order, with the time it took to get them.
    pub fn write_all(&self) -> (Vec<RwLockWriteGuard<'_, T>>, u64) {
        let start = Instant::now();
        let guards = self
            .stripes
            .iter()
            .map(|stripe| stripe.lock.write().unwrap_or_else(std::sync::PoisonError::into_inner))
            .collect();
        (guards, nanoseconds_since(start))
    }

    /// A writer's mistake, for tests that must catch it: only the first lock.
    #[cfg(any(test, loom, shuttle))]
    pub fn write_first_only(&self) -> Vec<RwLockWriteGuard<'_, T>> {
        let first = self.stripes[0].lock.write();
        vec![first.unwrap_or_else(std::sync::PoisonError::into_inner)]
    }

    /// Time that all readers together have waited for locks.
    pub fn read_wait_nanoseconds(&self) -> u64 {
        // Relaxed: a statistic.
        self.stripes.iter().map(|s| s.waited_nanoseconds.load(Ordering::Relaxed)).sum()
    }
}

/// Nanoseconds since `start`; u64 holds 580 years.
pub(crate) fn nanoseconds_since(start: Instant) -> u64 {
    start.elapsed().as_nanos() as u64
}

#[cfg(all(test, not(any(loom, shuttle))))]
mod tests {
    use super::*;

    #[test]
    fn neighbours_use_other_locks() {
        for p in [8, 16, 32, 64, 1024] {
            let locks = StripedLocks::new(p, || ());
            for (x, y) in (1..40u32).flat_map(|y| (1..40u32).map(move |x| (x, y))) {
                let neighbours = (y - 1..=y + 1)
                    .flat_map(|ny| (x - 1..=x + 1).map(move |nx| (nx, ny)))
                    .filter(|&n| n != (x, y));
                for (nx, ny) in neighbours {
                    assert_ne!(locks.stripe(x, y), locks.stripe(nx, ny), "p {p}: ({x},{y}) and ({nx},{ny})");
                }
            }
        }
    }

    #[test]
    fn four_locks_are_too_few_for_that() {
        // The check above can fail: with p = 4 the tile below and to the right uses the same lock.
        let locks = StripedLocks::new(4, || ());
        assert_eq!(locks.stripe(0, 0), locks.stripe(1, 1));
    }

    #[test]
    fn every_lock_is_used_by_a_row() {
        let locks = StripedLocks::new(16, || ());
        let mut used: Vec<_> = (0..16).map(|x| locks.stripe(x, 5)).collect();
        used.sort_unstable();
        assert_eq!(used, (0..16).collect::<Vec<_>>());
    }

    #[test]
    fn a_writer_has_every_handle() {
        let locks = StripedLocks::new(8, || 0);
        for guard in &mut locks.write_all().0 {
            **guard += 1;
        }
        assert!((0..8).all(|x| *locks.read(x, 3) == 1));
    }

    #[test]
    fn waiting_readers_are_timed() {
        // A reader that comes late does not wait, so it may take more than one try.
        let has_waited = |_| {
            let locks = StripedLocks::new(8, || ());
            let (guards, _) = locks.write_all();
            std::thread::scope(|scope| {
                scope.spawn(|| drop(locks.read(1, 2)));
                std::thread::sleep(std::time::Duration::from_millis(5));
                drop(guards);
            });
            locks.read_wait_nanoseconds() > 0
        };
        assert!((0..50).any(has_waited));
    }
}
