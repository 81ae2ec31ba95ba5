//! A gate around the visits of tiles: who closes it waits until nobody is inside, and looks at everything at rest.

use crate::{
    parking::ParkingLot,
    sync::{AtomicU32, AtomicU64, CacheLine, Ordering, fence},
};

/// Counts who is inside. Passing an open gate is an addition and a subtraction on a word of its own.
#[derive(Debug)]
pub(crate) struct Gate {
    inside: CacheLine<AtomicU64>,
    /// How many keep it closed.
    closed: CacheLine<AtomicU32>,
    outside: ParkingLot,
    closers: ParkingLot,
}

impl Gate {
    /// An open gate with nobody inside.
    pub(crate) fn new() -> Self {
        Self {
            inside: CacheLine(AtomicU64::new(0)),
            closed: CacheLine(AtomicU32::new(0)),
            outside: ParkingLot::new(1),
            closers: ParkingLot::new(1),
        }
    }

    /// Goes inside, unless the gate is closed. Who is inside must [`leave`](Self::leave).
    pub(crate) fn try_enter(&self) -> bool {
        self.inside.fetch_add(1, Ordering::Relaxed);
        // Sequentially consistent, with the fence in `close`: either the closer counts this one in, or this one
        // sees the gate closed. (Store buffering, as in the parking lot.)
        fence(Ordering::SeqCst);
        // Acquire: who comes in after a closer has opened comes after everything that closer read.
        let open = self.closed.load(Ordering::Acquire) == 0;
        if !open {
            self.leave();
        }
        open
    }

    /// Goes inside as soon as the gate is open. Returns the nanoseconds slept.
    pub(crate) fn enter(&self) -> u64 {
        let mut slept = 0;
        while !self.try_enter() {
            slept += self.outside.park_until(0, || self.closed.load(Ordering::Acquire) == 0);
        }
        slept
    }

    /// Goes inside whether the gate is open or not: a mistake, for tests that must catch it.
    #[cfg(any(test, loom, shuttle))]
    pub(crate) fn barge_in(&self) {
        self.inside.fetch_add(1, Ordering::Relaxed);
    }

    /// Goes outside.
    pub(crate) fn leave(&self) {
        // Release: a closer that counts this one out sees what it did inside.
        if self.inside.fetch_sub(1, Ordering::Release) == 1 {
            // With the fence in `close`: either the closer sees nobody inside, or this one sees it waiting.
            fence(Ordering::SeqCst);
            if self.closed.load(Ordering::Relaxed) > 0 {
                self.closers.unpark(0);
            }
        }
    }

    /// Closes the gate and waits until nobody is inside, or `give_up`. Must be [opened](Self::open) again.
    pub(crate) fn close(&self, give_up: impl Fn() -> bool) {
        self.closed.fetch_add(1, Ordering::Relaxed);
        // See `try_enter`.
        fence(Ordering::SeqCst);
        // Acquire: pairs with the release in `leave`; read-modify-writes keep the release sequences intact.
        self.closers.park_until(0, || self.inside.load(Ordering::Acquire) == 0 || give_up());
    }

    /// Opens the gate, if nobody else keeps it closed.
    pub(crate) fn open(&self) {
        // Release: pairs with the acquire in `try_enter`.
        self.closed.fetch_sub(1, Ordering::Release);
        self.outside.unpark(0);
    }

    /// Lets closers look whether to give up.
    pub(crate) fn wake_closers(&self) {
        self.closers.unpark(0);
    }
}
