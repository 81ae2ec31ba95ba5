//! Where threads sleep until what they wait for has happened, without a lost wake-up and without spinning.

use std::time::Instant;

use crate::{
    striped_locks::nanoseconds_since,
    sync::{AtomicU32, CacheLine, Condvar, Mutex, Ordering, fence, lock},
};

/// An event count: waiters say so, look again, and sleep; who changes something wakes them only if there are any.
#[derive(Debug)]
struct Spot {
    waiters: AtomicU32,
    mutex: Mutex<()>,
    changed: Condvar,
}

/// A power-of-two number of parking spots. What is waited for hashes to a spot by its number, so that a change
/// wakes few who wait for something else.
#[derive(Debug)]
pub(crate) struct ParkingLot {
    spots: Box<[CacheLine<Spot>]>,
}

impl ParkingLot {
    /// A lot with `spots` spots, a power of two.
    pub(crate) fn new(spots: usize) -> Self {
        assert!(spots.is_power_of_two());
        let spot = || Spot { waiters: AtomicU32::new(0), mutex: Mutex::new(()), changed: Condvar::new() };
        Self { spots: (0..spots).map(|_| CacheLine(spot())).collect() }
    }

    /// Sleeps at the spot of `key` until `ready`. Returns the nanoseconds slept, 0 where it was ready at once.
    pub(crate) fn park_until(&self, key: usize, mut ready: impl FnMut() -> bool) -> u64 {
        if ready() {
            return 0;
        }
        let start = Instant::now();
        let spot = self.spot(key);
        let mut guard = lock(&spot.mutex);
        // Relaxed: the fences order it.
        spot.waiters.fetch_add(1, Ordering::Relaxed);
        // Sequentially consistent, with the fence in `unpark`: either that thread sees this waiter, or this
        // waiter sees that thread's change. (Store buffering: no weaker order forbids both missing.)
        fence(Ordering::SeqCst);
        while !ready() {
            // Between `ready` and here the mutex is held, so a wake-up cannot fall between them.
            guard = spot.changed.wait(guard).unwrap_or_else(std::sync::PoisonError::into_inner);
        }
        spot.waiters.fetch_sub(1, Ordering::Relaxed);
        nanoseconds_since(start)
    }

    /// Wakes whoever may wait for `key`, after a change that was made before this call.
    pub(crate) fn unpark(&self, key: usize) {
        // See `park_until`.
        fence(Ordering::SeqCst);
        self.wake(self.spot(key));
    }

    /// As [`Self::unpark`] for each of `keys`, after changes that were all made before this call.
    pub(crate) fn unpark_each(&self, keys: impl Iterator<Item = usize>) {
        fence(Ordering::SeqCst);
        keys.for_each(|key| self.wake(self.spot(key)));
    }

    /// Wakes everybody.
    pub(crate) fn unpark_all(&self) {
        fence(Ordering::SeqCst);
        self.spots.iter().for_each(|spot| self.wake(spot));
    }

    fn wake(&self, spot: &Spot) {
        if spot.waiters.load(Ordering::Relaxed) > 0 {
            // The lock makes sure that a waiter which saw the old state is asleep by now.
            drop(lock(&spot.mutex));
            spot.changed.notify_all();
        }
    }

    fn spot(&self, key: usize) -> &Spot {
        &self.spots[key & (self.spots.len() - 1)]
    }
}
