//! Every interleaving (up to a bound on preemptions) of small models of the protocol, also of its weak memory:
//!
//! ```sh
//! RUSTFLAGS="--cfg loom" cargo test -p quietus --release --test loom
//! ```
//!
//! Each test has a twin that makes a mistake on purpose and demands that the model finds it.
#![cfg(loom)]

use std::{
    cell::Cell,
    panic::{AssertUnwindSafe, catch_unwind},
};

use loom::{
    sync::{
        Arc, Mutex,
        atomic::{AtomicU32, AtomicU64, Ordering::Relaxed},
    },
    thread,
};
use quietus::{
    Mode, Outcome,
    protocol::{Fault, Protocol, Turn, Update},
    published_masks::{Generation, PublishedMasks},
    striped_locks::StripedLocks,
    visit_counter::VisitCounter,
};

/// Checks a model with at most `preemptions` involuntary switches in one run.
fn check(preemptions: usize, model: impl Fn() + Sync + Send + 'static) {
    let mut builder = loom::model::Builder::new();
    builder.preemption_bound = Some(preemptions);
    builder.max_branches = 20_000;
    builder.check(model);
}

/// Demands that the model fails somewhere, for the reason given.
fn must_fail(preemptions: usize, reason: &str, model: impl Fn() + Sync + Send + 'static) {
    let panic =
        catch_unwind(AssertUnwindSafe(|| check(preemptions, model))).expect_err("the mistake was not caught");
    let text = (panic.downcast_ref::<String>().cloned())
        .or_else(|| panic.downcast_ref::<&str>().map(|s| s.to_string()))
        .unwrap_or_default();
    assert!(text.contains(reason), "caught, but for another reason: {text}");
}

/// Two threads visit a region of two tiles three times each, free-running: no visit may be lost.
fn counter_model(rearm: fn(&VisitCounter)) {
    let region = Arc::new((VisitCounter::new(2), Mutex::new(0i64)));
    let visits = {
        let region = Arc::clone(&region);
        move || {
            for _ in 0..3 {
                if region.0.count_visits(1) {
                    let mut rounds = region.1.lock().unwrap();
                    if region.0.is_exhausted() {
                        let before = region.0.remaining();
                        rearm(&region.0);
                        *rounds += i64::from(before <= 0);
                    }
                }
            }
        }
    };
    let other = thread::spawn(visits.clone());
    visits();
    other.join().unwrap();
    // Six visits were taken off and whole rounds of two added: what remains is even, and positive, for the last
    // one out of every round has re-armed.
    let remaining = region.0.remaining();
    assert!(remaining > 0 && remaining % 2 == 0, "{remaining} visits remain");
}

#[test]
fn no_visit_is_lost() {
    check(3, || counter_model(VisitCounter::rearm));
}

#[test]
fn rearming_by_load_and_store_is_caught() {
    must_fail(3, "visits remain", || counter_model(VisitCounter::rearm_by_load_and_store));
}

/// A writer changes two words under the locks; readers of different stripes must see both or neither.
fn locks_model(write_all: bool) {
    let locks = Arc::new(StripedLocks::new(2, || ()));
    let words = Arc::new([AtomicU32::new(0), AtomicU32::new(0)]);
    let writer = move |locks: Arc<StripedLocks<()>>, words: Arc<[AtomicU32; 2]>| {
        let guards = if write_all { locks.write_all().0 } else { locks.write_first_only() };
        for word in words.iter() {
            word.store(word.load(Relaxed) + 1, Relaxed);
        }
        drop(guards);
    };
    let reader = |locks: &StripedLocks<()>, words: &[AtomicU32; 2], column| {
        let _guard = locks.read(column, 0);
        assert_eq!(words[0].load(Relaxed), words[1].load(Relaxed), "half a change was read");
    };
    let second_writer = thread::spawn({
        let (locks, words) = (Arc::clone(&locks), Arc::clone(&words));
        move || writer(locks, words)
    });
    let second_reader = thread::spawn({
        let (locks, words) = (Arc::clone(&locks), Arc::clone(&words));
        move || reader(&locks, &words, 1)
    });
    writer(Arc::clone(&locks), Arc::clone(&words));
    reader(&locks, &words, 0);
    second_writer.join().unwrap();
    second_reader.join().unwrap();
}

#[test]
fn readers_of_any_stripe_exclude_writers() {
    check(2, || locks_model(true));
}

#[test]
fn a_writer_without_all_the_locks_is_caught() {
    must_fail(2, "half a change was read", || locks_model(false));
}

/// Masks of two tiles, announced by a generation.
fn masks_model(announce_first: bool) {
    let shared = Arc::new((PublishedMasks::new(2, 1), Generation::new()));
    let writer = thread::spawn({
        let shared = Arc::clone(&shared);
        move || {
            let (masks, generation) = &*shared;
            if announce_first {
                generation.publish(0);
            }
            (0..2).for_each(|tile| masks.store(tile, 0, 7));
            generation.publish(0);
        }
    });
    if shared.1.published() > 0 {
        assert!((0..2).all(|tile| shared.0.load(tile, 0) == 7), "masks of no tree were read");
    }
    writer.join().unwrap();
}

#[test]
fn an_announced_tree_has_its_masks() {
    check(3, || masks_model(false));
}

#[test]
fn announcing_before_the_masks_is_caught() {
    must_fail(3, "masks of no tree were read", || masks_model(true));
}

/// What the visits of the model below read and write in place of errors and trees, all relaxed: only the
/// protocol orders it.
struct World {
    protocol: Protocol<()>,
    lag: u32,
    passes: u64,
    /// A pass of which nothing is drawn.
    skipped: Option<u64>,
    /// Errors by slot and tile: the pass that wrote them, plus 1.
    planes: Vec<[AtomicU32; 2]>,
    /// Trees by slot and region: the generation, plus 1.
    trees: Vec<[AtomicU32; 2]>,
    /// Threads that have the tile now.
    in_flight: [AtomicU32; 2],
}

/// Two regions of one tile each, which overlap: both errors count in both. `passes` of them, by two threads.
fn deterministic_model(lag: u32, passes: u64, skipped: Option<u64>, fault: Option<Fault>) {
    let mode = Mode::Deterministic { lag };
    let words = || [AtomicU32::new(0), AtomicU32::new(0)];
    let protocol =
        Protocol::new(mode, vec![0, 1], &[0, 1], &[vec![0, 1], vec![0, 1]], vec![(), ()]).with_fault(fault);
    let world = Arc::new(World {
        protocol,
        lag,
        passes,
        skipped,
        planes: (0..lag).map(|_| words()).collect(),
        trees: (0..lag).map(|_| words()).collect(),
        in_flight: words(),
    });
    let other = thread::spawn({
        let world = Arc::clone(&world);
        move || world.draw()
    });
    world.draw();
    other.join().unwrap();
}

impl World {
    fn draw(&self) {
        loop {
            // What a tile consulted before its ticket was taken must hold afterwards.
            let seen = [Cell::new(0), Cell::new(0)];
            let draws_nothing = |turn: Turn| {
                seen[turn.tile as usize].set(self.tree(turn));
                Some(turn.pass) == self.skipped
            };
            // Models without skips leave this out: it would only multiply what there is to explore.
            let skips = self.skipped.and_then(|_| self.protocol.next_skips(draws_nothing));
            if let Some(skips) = skips {
                for &tile in skips.tiles {
                    self.visit(Turn { tile, pass: skips.pass }, seen[tile as usize].get());
                }
                self.protocol.finish_skips(skips, |update| self.update(update));
                continue;
            }
            let Some(turn) = self.protocol.next_turn(&mut 0) else { return };
            if turn.pass >= self.passes {
                return self.protocol.end(Outcome::Finished);
            }
            self.visit(turn, self.tree(turn));
            self.protocol.finish(turn, Some(turn.pass) != self.skipped, |update| self.update(update));
        }
    }

    fn slot(&self, number: u64) -> usize {
        (number % u64::from(self.lag)) as usize
    }

    /// The tree that a visit finds, plus 1; 0 where it consults none.
    fn tree(&self, Turn { tile, pass }: Turn) -> u64 {
        match pass.checked_sub(self.lag.into()) {
            Some(tree) => self.trees[self.slot(tree)][tile as usize].load(Relaxed).into(),
            None => 0,
        }
    }

    fn visit(&self, turn: Turn, found: u64) {
        let tile = turn.tile as usize;
        assert_eq!(self.in_flight[tile].fetch_add(1, Relaxed), 0, "a tile is in flight twice");
        let due = (turn.pass + 1).saturating_sub(self.lag.into());
        assert_eq!(found, due, "a tile consults another tree than it should");
        self.planes[self.slot(turn.pass)][tile].store(turn.pass as u32 + 1, Relaxed);
        self.in_flight[tile].fetch_sub(1, Relaxed);
    }

    fn update(&self, update: Update<'_, ()>) {
        for errors in &self.planes[self.slot(update.generation)] {
            let found = u64::from(errors.load(Relaxed));
            assert_eq!(found, update.generation + 1, "a tree is made from another pass's errors");
        }
        assert_eq!(update.drew, Some(update.generation) != self.skipped);
        let tree = update.generation as u32 + 1;
        self.trees[self.slot(update.generation)][update.region as usize].store(tree, Relaxed);
    }
}

#[test]
fn skips_taken_together_meet_what_they_should() {
    check(2, || deterministic_model(1, 2, Some(1), None));
}

#[test]
fn skips_that_forget_the_overlap_are_caught() {
    must_fail(2, "another pass's errors", || deterministic_model(1, 2, Some(1), Some(Fault::ForgetOverlap)));
}

#[test]
fn trees_and_errors_meet_as_they_should_at_lag_2() {
    check(2, || deterministic_model(2, 3, None, None));
}

#[test]
fn trees_and_errors_meet_as_they_should_at_lag_1() {
    check(2, || deterministic_model(1, 2, None, None));
}

#[test]
fn forgetting_the_overlap_is_caught() {
    must_fail(2, "another pass's errors", || deterministic_model(2, 3, None, Some(Fault::ForgetOverlap)));
}

#[test]
fn forgetting_the_own_visit_is_caught() {
    must_fail(2, "in flight twice", || deterministic_model(2, 3, None, Some(Fault::ForgetOwnVisit)));
}

#[test]
fn announcing_a_tree_before_it_is_made_is_caught() {
    must_fail(2, "another tree than it should", || {
        deterministic_model(1, 2, None, Some(Fault::PublishEarly))
    });
}

/// A pause beside a thread that draws: what it finds belongs together, and all that was drawn before is there.
fn pause_model(fault: Option<Fault>) {
    let world = Arc::new((
        Protocol::new(Mode::FreeRunning, vec![0], &[0], &[vec![0]], vec![()]).with_fault(fault),
        [AtomicU32::new(0), AtomicU32::new(0)],
    ));
    let renderer = thread::spawn({
        let world = Arc::clone(&world);
        move || {
            let (protocol, [film, errors]) = &*world;
            for visit in 1..=2 {
                let Some(turn) = protocol.next_turn(&mut 0) else { return };
                film.store(visit, Relaxed);
                errors.store(visit, Relaxed);
                protocol.finish(turn, true, |_| ());
            }
        }
    });
    let (protocol, [film, errors]) = &*world;
    assert!(protocol.pause());
    let found = [film.load(Relaxed), errors.load(Relaxed)].map(u64::from);
    assert_eq!(found, [protocol.finished_visits(0); 2], "a pause found half a visit");
    protocol.go_on();
    renderer.join().unwrap();
    assert_eq!(protocol.finished_visits(0), 2, "the renderer went on");
}

#[test]
fn a_pause_finds_whole_visits() {
    check(3, || pause_model(None));
}

#[test]
fn passing_the_closed_gate_is_caught() {
    must_fail(3, "a pause found half a visit", || pause_model(Some(Fault::PassClosedGate)));
}

/// One region of two tiles, free-running: every visit is counted, also those that come while the tree is made.
fn free_running_model(fault: Option<Fault>) {
    let seen = Arc::new(AtomicU64::new(0));
    let protocol = Arc::new(
        Protocol::new(Mode::FreeRunning, vec![0, 1], &[0, 0], &[vec![0], vec![0]], vec![()])
            .with_fault(fault),
    );
    let visits = {
        let (seen, protocol) = (Arc::clone(&seen), Arc::clone(&protocol));
        move || {
            for _ in 0..3 {
                let Some(turn) = protocol.next_turn(&mut 0) else { return };
                protocol.finish(turn, true, |_| {
                    seen.fetch_add(1, Relaxed);
                });
            }
        }
    };
    let other = thread::spawn(visits.clone());
    visits();
    other.join().unwrap();
    // Six visits of a region of two: at most three updates, and fewer only where visits came so fast that two
    // rounds were counted into one.
    let updates = seen.load(Relaxed);
    assert!((1..=3).contains(&updates), "{updates} updates");
    assert_eq!(protocol.published(0), updates);
    let remaining = protocol.remaining_visits(0);
    assert!(remaining > 0 && remaining % 2 == 0, "{remaining} visits remain");
}

#[test]
fn free_running_visits_are_all_counted() {
    check(2, || free_running_model(None));
}

#[test]
fn free_running_with_a_stored_counter_is_caught() {
    must_fail(2, "visits remain", || free_running_model(Some(Fault::RearmByStore)));
}
