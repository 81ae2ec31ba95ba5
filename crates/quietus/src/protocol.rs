//! The order of tile visits and tree updates: tickets, turns, and the last one out (PROTOCOL.md).
//!
//! Knows neither errors nor masks nor policies: what an update does is the caller's. That makes it small enough
//! to be model-checked as it is.

mod skips;
mod standing;

pub use skips::Skips;
pub use standing::{Misfit, Standing};

use crate::{
    gate::Gate,
    parking::ParkingLot,
    published_masks::Generation,
    striped_locks::nanoseconds_since,
    sync::{AtomicBool, AtomicU32, AtomicU64, CacheLine, Mutex, MutexGuard, Ordering, lock},
    visit_counter::VisitCounter,
};

/// How visits and updates wait for each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Mode {
    /// Pass k of a tile consults tree k - `lag` of its home region. The picture depends neither on the number
    /// of threads nor on timing.
    Deterministic {
        /// 1 or 2. Lag 1 saves samples; lag 2 leaves fewer threads without work at the end.
        lag: u32,
    },
    /// The talk as published: whichever tree is there is consulted, and nobody waits for one.
    FreeRunning,
}

impl Default for Mode {
    fn default() -> Self {
        Self::Deterministic { lag: 2 }
    }
}

impl Mode {
    /// How many error planes, trees and counters are in use at a time: numbers that agree modulo this share one.
    pub fn slots(self) -> u32 {
        match self {
            Self::Deterministic { lag } => lag,
            Self::FreeRunning => 1,
        }
    }
}

/// Why no more visits are dealt.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
#[non_exhaustive]
pub enum Outcome {
    /// The picture is finished.
    Finished = 1,
    /// The renderer asked to stop.
    Stopped = 2,
    /// A visit was dropped unfinished, or a thread panicked.
    Abandoned = 3,
}

/// Mistakes to make on purpose, so that tests can show they would catch them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Re-arms the visit counter by load and store.
    RearmByStore,
    /// Waits for the tree of the home region only.
    ForgetOverlap,
    /// Does not wait for the tile's previous visit.
    ForgetOwnVisit,
    /// Announces a tree before it is built.
    PublishEarly,
    /// Does not stop at the gate that a pause has closed.
    PassClosedGate,
}

/// A tile's place in the order: its visit in one pass, when its turn has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Turn {
    /// The tile.
    pub tile: u32,
    /// The pass, from 0.
    pub pass: u64,
}

/// What the last one out is given.
#[derive(Debug)]
pub struct Update<'a, R> {
    /// The region to rebuild.
    pub region: u32,
    /// Number of the tree, from 0: in deterministic mode the pass whose errors it is made from.
    pub generation: u64,
    /// Whether a tile of the error area drew anything, in deterministic mode in this pass, in free-running mode
    /// since the last update that was told so. Where none did, the errors are as they were.
    pub drew: bool,
    /// How long the region's lock was waited for.
    pub waited_nanoseconds: u64,
    /// What the region's lock guards.
    pub state: &'a mut R,
}

/// Deals visits, keeps their order, and names the thread that rebuilds. `R` is what a region's lock guards.
#[derive(Debug)]
pub struct Protocol<R> {
    mode: Mode,
    /// Tiles in visiting order; ticket n is for the n-th, modulo their number.
    order: Box<[u32]>,
    next_ticket: CacheLine<AtomicU64>,
    tiles: Box<[Tile]>,
    /// Regions whose error area holds a tile that is not at home there, tile by tile.
    overlaps: Box<[u32]>,
    regions: Box<[Region<R>]>,
    /// 0 while running, else an [`Outcome`].
    outcome: CacheLine<AtomicU32>,
    parked: ParkingLot,
    /// Who has turns is inside.
    gate: Gate,
    /// Where to stop, if that was fixed beforehand.
    cut: Option<Cut>,
    #[cfg(any(test, loom, shuttle))]
    fault: Option<Fault>,
}

#[derive(Debug)]
struct Tile {
    /// Twice the number of finished visits, plus 1 where the last one drew nothing. Written only by the thread
    /// whose turn it is.
    visits: AtomicU64,
    home: u32,
    /// Where in `Protocol::overlaps` the other regions are whose error area holds the tile; most have none.
    overlaps: (u32, u32),
}

#[derive(Debug)]
struct Region<R> {
    counters: Box<[CacheLine<VisitCounter>]>,
    /// Whether a tile of the error area drew anything, by slot.
    drew: Box<[AtomicBool]>,
    generation: Generation,
    updates: CacheLine<Mutex<Updates<R>>>,
}

#[derive(Debug)]
struct Updates<R> {
    /// Number of the next tree.
    next: u64,
    state: R,
}

/// How many visits of each tile are dealt.
#[derive(Debug)]
struct Cut {
    visits: Box<[u64]>,
    /// The most of them.
    most: u64,
}

/// Spots to park at: a few times as many as threads that may wait at once.
const PARKING_SPOTS: usize = if cfg!(any(loom, shuttle)) { 1 } else { 64 };

impl<R> Protocol<R> {
    /// Visits in `order`, every tile once; `homes[t]` is tile t's home region and `containing[t]` the regions
    /// whose error area holds it; `states` has what each region's lock guards.
    ///
    /// # Panics
    /// Where a deterministic lag is 0, or a region holds no tile.
    pub fn new(mode: Mode, order: Vec<u32>, homes: &[u32], containing: &[Vec<u32>], states: Vec<R>) -> Self {
        let slots = mode.slots();
        assert!(slots > 0, "a deterministic lag is at least 1");
        let mut overlaps = Vec::new();
        let tile = |(&home, containing): (&u32, &Vec<u32>)| {
            let start = overlaps.len() as u32;
            overlaps.extend(containing.iter().filter(|&&region| region != home));
            Tile { visits: AtomicU64::new(0), home, overlaps: (start, overlaps.len() as u32) }
        };
        let region = |(index, state)| {
            let index = index as u32;
            let visits = containing.iter().filter(|regions| regions.contains(&index)).count() as u32;
            Region {
                counters: (0..slots).map(|_| CacheLine(VisitCounter::new(visits))).collect(),
                drew: (0..slots).map(|_| AtomicBool::new(false)).collect(),
                generation: Generation::new(),
                updates: CacheLine(Mutex::new(Updates { next: 0, state })),
            }
        };
        let tiles = homes.iter().zip(containing).map(tile).collect();
        Self {
            mode,
            order: order.into(),
            next_ticket: CacheLine(AtomicU64::new(0)),
            tiles,
            overlaps: overlaps.into(),
            regions: states.into_iter().enumerate().map(region).collect(),
            outcome: CacheLine(AtomicU32::new(0)),
            parked: ParkingLot::new(PARKING_SPOTS),
            gate: Gate::new(),
            cut: None,
            #[cfg(any(test, loom, shuttle))]
            fault: None,
        }
    }

    /// Makes a mistake on purpose.
    #[cfg(any(test, loom, shuttle))]
    pub fn with_fault(mut self, fault: Option<Fault>) -> Self {
        self.fault = fault;
        self
    }

    fn suffers(&self, fault: Fault) -> bool {
        #[cfg(any(test, loom, shuttle))]
        return self.fault == Some(fault);
        #[cfg(not(any(test, loom, shuttle)))]
        return {
            let _ = fault;
            false
        };
    }

    /// Takes the next ticket and waits for its turn, asleep. `None` once no more visits are dealt. Time slept
    /// is added to `idle_nanoseconds`.
    ///
    /// Who got a turn must [`finish`](Self::finish) it, or [`end`](Self::end) everything: others wait for it.
    pub fn next_turn(&self, idle_nanoseconds: &mut u64) -> Option<Turn> {
        let Turn { tile, pass } = self.next_ticket()?;
        *idle_nanoseconds += self.await_own_visit(tile, pass) + self.await_trees(tile, pass);
        *idle_nanoseconds += self.enter();
        if self.outcome().is_some() {
            self.gate.leave();
            return None;
        }
        Some(Turn { tile, pass })
    }

    fn enter(&self) -> u64 {
        #[cfg(any(test, loom, shuttle))]
        if self.suffers(Fault::PassClosedGate) {
            self.gate.barge_in();
            return 0;
        }
        self.gate.enter()
    }

    /// Takes the next ticket for a visit that is still to be made.
    fn next_ticket(&self) -> Option<Turn> {
        let tiles = self.order.len() as u64;
        loop {
            if self.outcome().is_some() {
                return None;
            }
            // Relaxed: a ticket carries nothing but its number. What its turn may read is ordered by the waits.
            let ticket = self.next_ticket.fetch_add(1, Ordering::Relaxed);
            let (pass, tile) = (ticket / tiles, self.order[(ticket % tiles) as usize]);
            if self.cut.as_ref().is_some_and(|cut| pass >= cut.most) {
                return None;
            }
            if !self.is_past(tile, pass) {
                return Some(Turn { tile, pass });
            }
        }
    }

    /// Whether the tile's visit in `pass` was made before a state was restored, or is not to be made.
    fn is_past(&self, tile: u32, pass: u64) -> bool {
        // Relaxed: only a restored state has visits before their tickets, and threads start after it was restored.
        self.tiles[tile as usize].visits.load(Ordering::Relaxed) >> 1 > pass
            || self.cut.as_ref().is_some_and(|cut| pass >= cut.visits[tile as usize])
    }

    /// Whether the tile's visit in `pass` may begin: conditions (a) and (b).
    fn is_due(&self, tile: u32, pass: u64) -> bool {
        self.is_after_own_visit(tile, pass)
            && self
                .awaited_tree(pass)
                .is_none_or(|tree| self.awaited_regions(tile).all(|region| self.published(region) > tree))
    }

    /// Condition (a): the tile's own visit of the previous pass is finished.
    fn is_after_own_visit(&self, tile: u32, pass: u64) -> bool {
        // Acquire: the tile's counts and errors come with its turn, from the thread that had it before.
        self.suffers(Fault::ForgetOwnVisit)
            || self.tiles[tile as usize].visits.load(Ordering::Acquire) >> 1 == pass
    }

    fn await_own_visit(&self, tile: u32, pass: u64) -> u64 {
        let ready = || self.is_after_own_visit(tile, pass) || self.outcome().is_some();
        self.parked.park_until(tile as usize, ready)
    }

    /// The tree that condition (b) asks for in `pass`.
    fn awaited_tree(&self, pass: u64) -> Option<u64> {
        match self.mode {
            Mode::Deterministic { lag } => pass.checked_sub(lag.into()),
            Mode::FreeRunning => None,
        }
    }

    /// The regions whose tree condition (b) asks for: every one whose error area contains the tile.
    fn awaited_regions(&self, tile: u32) -> impl Iterator<Item = u32> {
        let tile = &self.tiles[tile as usize];
        let forgets = self.suffers(Fault::ForgetOverlap);
        self.containing(tile).filter(move |&region| !forgets || region == tile.home)
    }

    fn await_trees(&self, tile: u32, pass: u64) -> u64 {
        let Some(tree) = self.awaited_tree(pass) else { return 0 };
        self.awaited_regions(tile)
            .map(|region| {
                let ready = || self.published(region) > tree || self.outcome().is_some();
                self.parked.park_until(region_spot(region), ready)
            })
            .sum()
    }

    /// Whether the tile's previous visit drew nothing. For who has its turn.
    pub fn was_quiet(&self, tile: u32) -> bool {
        // Relaxed: reads what this thread acquired when the turn came; nobody else writes it now.
        self.tiles[tile as usize].visits.load(Ordering::Relaxed) & 1 == 1
    }

    /// Ends a turn, whose errors are in place. `drew` says whether anything was sampled. The last one out of a
    /// region calls `update`, under the region's lock, before the new tree is announced.
    pub fn finish(&self, turn: Turn, drew: bool, mut update: impl FnMut(Update<'_, R>)) {
        let tile = &self.tiles[turn.tile as usize];
        let slot = self.slot(turn.pass);
        if drew {
            for region in self.containing(tile) {
                // Release: who sees the flag sees the errors, also where free-running visits come between the
                // last one out and its update.
                self.regions[region as usize].drew[slot].store(true, Ordering::Release);
            }
        }
        self.count_tile(turn, drew);
        self.parked.unpark(turn.tile as usize);
        for region in self.containing(tile) {
            self.count_out(region, slot, 1, &mut update);
        }
        self.gate.leave();
    }

    /// One more visit of the tile is finished: who waits for it may have the tile.
    fn count_tile(&self, turn: Turn, drew: bool) {
        // Release: pairs with the acquire in `is_after_own_visit`.
        self.tiles[turn.tile as usize]
            .visits
            .store((turn.pass + 1) << 1 | u64::from(!drew), Ordering::Release);
    }

    /// Takes finished visits off a region's counter, and rebuilds the region if they were the last.
    fn count_out(&self, region: u32, slot: usize, visits: u32, update: &mut impl FnMut(Update<'_, R>)) {
        if self.regions[region as usize].counters[slot].count_visits(visits) {
            self.last_one_out(region, update);
        }
    }

    /// Every region whose error area holds the tile, its home first.
    fn containing(&self, tile: &Tile) -> impl Iterator<Item = u32> {
        let (start, end) = tile.overlaps;
        let others = &self.overlaps[start as usize..end as usize];
        std::iter::once(tile.home).chain(others.iter().copied())
    }

    /// Rebuilds a region as often as it is due. In deterministic mode the next pass may have been counted out
    /// while this one was being rebuilt, or before this thread got the lock: trees are made in their order by
    /// whoever holds it, and who finds nothing due has been helped.
    fn last_one_out(&self, index: u32, update: &mut impl FnMut(Update<'_, R>)) {
        let region = &self.regions[index as usize];
        let start = std::time::Instant::now();
        let mut updates = lock(&region.updates);
        let mut waited_nanoseconds = nanoseconds_since(start);
        loop {
            let generation = updates.next;
            let slot = self.slot(generation);
            let counter = &region.counters[slot];
            if !counter.is_exhausted() {
                return;
            }
            // Acquire: pairs with the release in `finish`. A swap, so that no flag raised in between is lost.
            let drew = region.drew[slot].swap(false, Ordering::Acquire);
            self.rearm(counter);
            if self.suffers(Fault::PublishEarly) {
                self.announce(index, generation);
                // Real threads are given time to fall into it; a model checker needs none.
                if cfg!(not(any(loom, shuttle))) {
                    std::thread::sleep(std::time::Duration::from_millis(2));
                }
            }
            let state = &mut updates.state;
            update(Update { region: index, generation, drew, waited_nanoseconds, state });
            waited_nanoseconds = 0;
            updates.next = generation + 1;
            self.announce(index, generation);
        }
    }

    fn rearm(&self, counter: &VisitCounter) {
        #[cfg(any(test, loom, shuttle))]
        if self.suffers(Fault::RearmByStore) {
            return counter.rearm_by_load_and_store();
        }
        counter.rearm();
    }

    fn announce(&self, region: u32, generation: u64) {
        self.regions[region as usize].generation.publish(generation);
        self.parked.unpark(region_spot(region));
    }

    /// Deals no more visits and wakes everybody. The first outcome stays.
    pub fn end(&self, outcome: Outcome) {
        // Release and acquire: who learns of the end sees what led to it.
        let _ = self.outcome.compare_exchange(0, outcome as u32, Ordering::AcqRel, Ordering::Acquire);
        self.parked.unpark_all();
        self.gate.wake_closers();
    }

    /// Waits until nobody has a turn, and lets nobody have one until [`Self::go_on`]. Turns that have begun are
    /// finished first, also after an [`Outcome::Stopped`]. False where one was abandoned, and what it left behind
    /// is not whole; also then others wait for `go_on`.
    pub fn pause(&self) -> bool {
        let is_abandoned = || self.outcome() == Some(Outcome::Abandoned);
        self.gate.close(is_abandoned);
        !is_abandoned()
    }

    /// Ends a pause.
    pub fn go_on(&self) {
        self.gate.open();
    }

    /// Why no more visits are dealt; `None` while they are.
    pub fn outcome(&self) -> Option<Outcome> {
        match self.outcome.load(Ordering::Acquire) {
            0 => None,
            1 => Some(Outcome::Finished),
            2 => Some(Outcome::Stopped),
            _ => Some(Outcome::Abandoned),
        }
    }

    /// How many trees of the region have been announced.
    pub fn published(&self, region: u32) -> u64 {
        self.regions[region as usize].generation.published()
    }

    /// How many visits of the tile are finished.
    pub fn finished_visits(&self, tile: u32) -> u64 {
        self.tiles[tile as usize].visits.load(Ordering::Acquire) >> 1
    }

    /// The one region the tile is checked against.
    pub fn home(&self, tile: u32) -> u32 {
        self.tiles[tile as usize].home
    }

    /// Visits that the region still expects before its next update.
    pub fn remaining_visits(&self, region: u32) -> i64 {
        let region = &self.regions[region as usize];
        let next = lock(&region.updates).next;
        region.counters[self.slot(next)].remaining()
    }

    /// How many tickets have been dealt, some of which may never have had their turn.
    pub fn tickets(&self) -> u64 {
        self.next_ticket.load(Ordering::Relaxed)
    }

    /// Looks at what a region's lock guards.
    pub fn with_state<T>(&self, region: u32, look: impl FnOnce(&R) -> T) -> T {
        let updates: MutexGuard<'_, Updates<R>> = lock(&self.regions[region as usize].updates);
        look(&updates.state)
    }

    /// What a region's lock guards, before threads share it.
    pub fn state_mut(&mut self, region: u32) -> &mut R {
        let updates = self.regions[region as usize].updates.0.get_mut();
        &mut updates.unwrap_or_else(std::sync::PoisonError::into_inner).state
    }

    fn slot(&self, number: u64) -> usize {
        (number % u64::from(self.mode.slots())) as usize
    }
}

/// Regions park away from the first tiles.
fn region_spot(region: u32) -> usize {
    region as usize + PARKING_SPOTS / 2
}
