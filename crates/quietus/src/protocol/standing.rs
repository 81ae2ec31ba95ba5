//! How far tiles and regions have come, taken out of a protocol at rest and put into a new one.

use std::fmt;

use super::{Cut, Mode, Protocol};
use crate::{
    sync::{Ordering, lock},
    visit_counter::VisitCounter,
};

/// How far every tile and region has come. Everything else of the protocol follows from it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Standing {
    /// Finished visits of each tile.
    pub visits: Vec<u64>,
    /// Whether the last of them drew nothing.
    pub quiet: Vec<bool>,
    /// Whether a tile of a region's error area drew anything, region by region, by slot of the pass.
    pub drew: Vec<bool>,
}

/// A state that no sampling with these settings can have: what is wrong with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Misfit(pub &'static str);

impl fmt::Display for Misfit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "no state of this sampling: {}", self.0)
    }
}

impl std::error::Error for Misfit {}

impl Misfit {
    /// `Ok` where a state is as it must be.
    pub(crate) fn unless(sound: bool, what: &'static str) -> Result<(), Self> {
        if sound { Ok(()) } else { Err(Self(what)) }
    }
}

/// More visits of a tile than any sampling makes: each that draws adds a sample to one of its pixels.
const MOST_VISITS: u64 = 1 << 40;

impl<R> Protocol<R> {
    /// How far it has come. While [paused](Self::pause), or after all threads are done.
    pub fn standing(&self) -> Standing {
        // Relaxed: the pause has acquired what the visits left behind.
        let words = || self.tiles.iter().map(|tile| tile.visits.load(Ordering::Relaxed));
        let drew = self.regions.iter().flat_map(|region| &region.drew);
        Standing {
            visits: words().map(|word| word >> 1).collect(),
            quiet: words().map(|word| word & 1 == 1).collect(),
            drew: drew.map(|drew| drew.load(Ordering::Relaxed)).collect(),
        }
    }

    /// Goes on where another protocol of the same tiles and regions stood; before any thread takes a ticket.
    ///
    /// # Errors
    /// Where no protocol of these tiles and regions can have stood there.
    pub fn restore(&mut self, standing: &Standing) -> Result<(), Misfit> {
        let Standing { visits, quiet, drew } = standing;
        let slots = self.mode.slots() as usize;
        let fits = visits.len() == self.tiles.len()
            && quiet.len() == visits.len()
            && drew.len() == self.regions.len() * slots;
        Misfit::unless(fits, "it has another number of tiles or regions")?;
        for (tile, (&visits, &quiet)) in self.tiles.iter_mut().zip(visits.iter().zip(quiet)) {
            tile.visits.store(visits << 1 | u64::from(quiet), Ordering::Relaxed);
        }
        for (index, visits) in self.visits_by_region(visits)?.iter().enumerate() {
            self.restore_region(index, visits, &drew[index * slots..][..slots]);
        }
        // Tickets below this one are used up; those above that are, too, are passed over.
        let tiles = self.order.len() as u64;
        let tickets = (0..).zip(&self.order).map(|(place, &tile)| visits[tile as usize] * tiles + place);
        self.next_ticket.store(tickets.min().unwrap_or(0), Ordering::Relaxed);
        Ok(())
    }

    /// The finished visits of the tiles of each region's error area, after a check that they are possible.
    fn visits_by_region(&self, visits: &[u64]) -> Result<Vec<Vec<u64>>, Misfit> {
        Misfit::unless(visits.len() == self.tiles.len(), "it has another number of tiles")?;
        let mut regions = vec![Vec::new(); self.regions.len()];
        for (tile, &visits) in self.tiles.iter().zip(visits) {
            Misfit::unless(visits < MOST_VISITS, "a tile has too many visits")?;
            self.containing(tile).for_each(|region| regions[region as usize].push(visits));
        }
        if let Mode::Deterministic { lag } = self.mode {
            let ordered = regions.iter().all(|visits| {
                let next = least(visits);
                visits.iter().all(|visits| visits - next <= lag.into())
            });
            Misfit::unless(ordered, "a tile is ahead of the trees it waits for")?;
        }
        Ok(regions)
    }

    /// A region's counters and the number of its next tree follow from the visits of its error tiles: tree k was made
    /// when each of them had finished its visit of pass k.
    fn restore_region(&mut self, index: usize, visits: &[u64], drew: &[bool]) {
        let (next, slots) = (least(visits), u64::from(self.mode.slots()));
        let region = &mut self.regions[index];
        for pass in next..next + slots {
            let slot = (pass % slots) as usize;
            let counter = VisitCounter::new(visits.len() as u32);
            counter.count_visits(visits.iter().filter(|&&visits| visits > pass).count() as u32);
            region.counters[slot].0 = counter;
            region.drew[slot].store(drew[slot], Ordering::Relaxed);
        }
        lock(&region.updates).next = next;
        if let Some(last) = next.checked_sub(1) {
            region.generation.publish(last);
        }
    }

    /// Deals no more than the first `visits[t]` visits of tile t: those that a sampling made which was stopped then.
    /// Whatever the order of its threads, what is drawn is the same. Ends without an outcome.
    ///
    /// # Errors
    /// Where no sampling of these tiles and regions can have been stopped there.
    pub fn stop_after(&mut self, visits: &[u64]) -> Result<(), Misfit> {
        self.visits_by_region(visits)?;
        self.cut = Some(Cut { most: visits.iter().copied().max().unwrap_or(0), visits: visits.into() });
        Ok(())
    }
}

/// Visits that every tile has made.
fn least(visits: &[u64]) -> u64 {
    visits.iter().copied().min().unwrap_or(0)
}
