//! Wait-free checks: each rebuild published as one mask of active pixels per tile in an atomic word, with a
//! generation, instead of a tree behind locks. A check is one or two loads. No `unsafe`.

use crate::sync::{AtomicU64, CacheLine, Ordering};

/// How many trees of a region have been published; tree k makes it k + 1.
#[derive(Debug)]
pub struct Generation(CacheLine<AtomicU64>);

impl Default for Generation {
    fn default() -> Self {
        Self::new()
    }
}

impl Generation {
    /// No tree published yet.
    pub fn new() -> Self {
        Self(CacheLine(AtomicU64::new(0)))
    }

    /// Number of published trees.
    pub fn published(&self) -> u64 {
        // Acquire: whoever sees tree k announced sees its masks, the re-armed counter and, through the
        // publisher, every visit the tree was built from.
        self.0.load(Ordering::Acquire)
    }

    /// Announces tree `k`. Only the holder of the region's lock may call it, after everything that belongs to
    /// the tree is in place.
    pub fn publish(&self, k: u64) {
        // Release: pairs with the acquire above.
        self.0.store(k + 1, Ordering::Release);
    }
}

/// Masks of the last few trees of every region, a word per tile and tree.
///
/// Trees whose numbers agree modulo the number of slots share their words. PROTOCOL.md proves that with as many
/// slots as the lag, no reader of tree k can meet masks of tree k + slots.
#[derive(Debug)]
pub struct PublishedMasks {
    masks: Box<[AtomicU64]>,
    slots: u64,
}

impl PublishedMasks {
    /// Masks of `tiles` tiles with `slots` trees each, nothing active.
    pub fn new(tiles: u32, slots: u32) -> Self {
        assert!(slots > 0, "masks need at least one slot");
        let words = tiles as usize * slots as usize;
        Self { masks: (0..words).map(|_| AtomicU64::new(0)).collect(), slots: slots.into() }
    }

    /// The mask of `tile` in tree `k`, which the caller knows to be published and not overwritten.
    pub fn load(&self, tile: u32, k: u64) -> u64 {
        // Relaxed: the acquire of the generation has ordered it. Free-running readers skip that load; a mask is
        // a word that stands for itself, and either tree's will do.
        self.masks[self.word(tile, k)].load(Ordering::Relaxed)
    }

    /// Sets the mask of `tile` in tree `k`, before the tree is announced by [`Generation::publish`].
    pub fn store(&self, tile: u32, k: u64, mask: u64) {
        // Relaxed: the release of the generation orders it.
        self.masks[self.word(tile, k)].store(mask, Ordering::Relaxed);
    }

    /// Slots of one tile are neighbours: a check and the next pass's check share a cache line.
    fn word(&self, tile: u32, k: u64) -> usize {
        tile as usize * self.slots as usize + (k % self.slots) as usize
    }
}
