//! The synchronisation primitives of this crate, from one place, so that the same protocol code runs on the
//! standard library, under loom (every interleaving of a small model) and under shuttle (random schedules of
//! larger ones).
//!
//! `RUSTFLAGS="--cfg loom"` or `"--cfg shuttle"` switches; nothing else in the crate names a primitive's origin.

#[cfg(loom)]
pub(crate) use loom::sync::{
    Condvar, Mutex, MutexGuard, RwLock, RwLockReadGuard, RwLockWriteGuard,
    atomic::{AtomicBool, AtomicI64, AtomicU32, AtomicU64, Ordering, fence},
};

#[cfg(all(shuttle, not(loom)))]
pub(crate) use shuttle::sync::{
    Condvar, Mutex, MutexGuard, RwLock, RwLockReadGuard, RwLockWriteGuard,
    atomic::{AtomicBool, AtomicI64, AtomicU32, AtomicU64, Ordering, fence},
};

#[cfg(not(any(loom, shuttle)))]
pub(crate) use std::sync::{
    Condvar, Mutex, MutexGuard, RwLock, RwLockReadGuard, RwLockWriteGuard,
    atomic::{AtomicBool, AtomicI64, AtomicU32, AtomicU64, Ordering, fence},
};

/// Locks, also after another holder panicked: whoever panics stops the sampling (see `Worker`), and what is read
/// afterwards is statistics.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// A value on cache lines of its own, so that writers of neighbouring values do not slow each other down.
///
/// 128 bytes: x86-64 fetches lines of 64 in pairs, and some ARM cores have lines of 128.
#[derive(Debug, Default)]
#[repr(align(128))]
pub(crate) struct CacheLine<T>(pub(crate) T);

impl<T> std::ops::Deref for CacheLine<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.0
    }
}
