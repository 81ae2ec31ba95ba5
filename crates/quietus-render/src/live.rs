//! What a live view needs of a running render: which tiles changed, and a gate that holds the threads between visits.
//!
//! A render that nobody looks at pays one store per visit of a tile for it, and one load for the gate.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use quietus_film::Layout;

/// How long a thread sleeps at the closed gate before it looks whether there is anything left to wait for.
const GATE_INTERVAL: Duration = Duration::from_millis(50);

/// Shared between a render, through [`Control::live`](crate::Control::live), and whoever shows it.
#[derive(Debug)]
pub struct Live {
    /// One flag per tile of the film, set when samples were added to it.
    changed: Box<[AtomicBool]>,
    /// Whether the gate is closed; the lock has the same, for those who sleep.
    is_paused: AtomicBool,
    gate: Mutex<Gate>,
    opened: Condvar,
    /// The noise asked for since the render began.
    noise: Mutex<Option<f64>>,
}

#[derive(Debug, Default)]
struct Gate {
    closed_since: Option<Instant>,
    /// Of all pauses that are over.
    paused: Duration,
}

impl Live {
    /// Nothing changed yet, and the gate is open. `layout` is that of the render to come.
    pub fn new(layout: &Layout) -> Self {
        let [across, down] = layout.tiles();
        Self {
            changed: (0..across as usize * down as usize).map(|_| AtomicBool::new(false)).collect(),
            is_paused: AtomicBool::new(false),
            gate: Mutex::default(),
            opened: Condvar::new(),
            noise: Mutex::default(),
        }
    }

    /// Holds every thread after the visit it is at.
    pub fn pause(&self) {
        self.lock().closed_since.get_or_insert_with(Instant::now);
        self.is_paused.store(true, Ordering::Relaxed);
    }

    /// Lets the threads go on.
    pub fn resume(&self) {
        let mut gate = self.lock();
        let pause = gate.closed_since.take().map_or(Duration::ZERO, |since| since.elapsed());
        gate.paused += pause;
        self.is_paused.store(false, Ordering::Relaxed);
        self.opened.notify_all();
    }

    /// Whether threads are held.
    pub fn is_paused(&self) -> bool {
        // Relaxed, here and at the gate: a thread that sees the flag late draws one more tile.
        self.is_paused.load(Ordering::Relaxed)
    }

    /// How long the threads were held so far.
    pub fn paused_for(&self) -> Duration {
        let gate = self.lock();
        gate.paused + gate.closed_since.map_or(Duration::ZERO, |since| since.elapsed())
    }

    /// Asks for another noise, as a share of white: the render goes on to it from what it has, or ends where it has it. It
    /// takes the place of any other goal, where the way of sampling can be steered for noise; else, and where the number
    /// is not above 0, nothing changes.
    pub fn ask_noise(&self, share: f64) {
        if share > 0.0 && share.is_finite() {
            *self.noise.lock().unwrap_or_else(PoisonError::into_inner) = Some(share);
        }
    }

    /// The noise that was asked for last by [`Self::ask_noise`].
    pub fn asked_noise(&self) -> Option<f64> {
        *self.noise.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The tiles that changed since this was last asked, in the film's order. Each has at least the samples of the
    /// visit that set its flag when it is copied out after this.
    pub fn take_changed(&self) -> impl Iterator<Item = usize> {
        // A load first: most flags are clear, and a swap would take their cache lines from the threads that render.
        // Acquire: with `touch`, so that a copy made from now on has what was committed before.
        let take = |flag: &AtomicBool| flag.load(Ordering::Relaxed) && flag.swap(false, Ordering::Acquire);
        self.changed.iter().enumerate().filter(move |(_, flag)| take(flag)).map(|(tile, _)| tile)
    }

    /// The samples of a visit are in the film.
    pub(crate) fn touch(&self, tile: usize) {
        // Release: who sees the flag finds the samples in the film.
        self.changed[tile].store(true, Ordering::Release);
    }

    /// Returns at once while the gate is open, else when it opens or `is_over` says that there is nothing to go on
    /// with.
    pub(crate) fn pass_gate(&self, is_over: impl Fn() -> bool) {
        if !self.is_paused() {
            return;
        }
        let mut gate = self.lock();
        while gate.closed_since.is_some() && !is_over() {
            gate = match self.opened.wait_timeout(gate, GATE_INTERVAL) {
                Ok((gate, _)) => gate,
                Err(poisoned) => poisoned.into_inner().0,
            };
        }
    }

    /// What it guards is whole at any time, also after a panic.
    fn lock(&self) -> MutexGuard<'_, Gate> {
        self.gate.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_is_told_once() {
        let live = Live::new(&Layout::full(20, 9).unwrap());
        assert_eq!(live.take_changed().count(), 0);
        [4, 1, 4].iter().for_each(|&tile| live.touch(tile));
        assert_eq!(live.take_changed().collect::<Vec<_>>(), [1, 4]);
        assert_eq!(live.take_changed().count(), 0);
    }

    #[test]
    fn the_gate_holds_until_it_opens_or_all_is_over() {
        let live = Live::new(&Layout::full(8, 8).unwrap());
        live.pass_gate(|| unreachable!("it is open"));
        live.pause();
        live.pass_gate(|| true);
        let passed = AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                live.pass_gate(|| false);
                passed.store(true, Ordering::Relaxed);
            });
            std::thread::sleep(2 * GATE_INTERVAL);
            assert!(live.is_paused() && !passed.load(Ordering::Relaxed));
            live.resume();
        });
        assert!(passed.load(Ordering::Relaxed));
        let paused = live.paused_for();
        assert!(paused >= 2 * GATE_INTERVAL);
        live.resume();
        assert_eq!(live.paused_for(), paused);
    }
}
