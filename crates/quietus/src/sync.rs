//! Synchronisation primitives in one place.
pub(crate) use std::sync::atomic::{AtomicU32, Ordering};
