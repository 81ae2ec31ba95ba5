//! Threads that work, while the one that started them watches.

use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

use crate::run::{RenderError, lock};

/// Time until the watcher looks again.
pub(crate) type Interval = Duration;

/// How often a watcher looks. Often enough for a smooth progress bar and a prompt Ctrl-C, too seldom to cost.
pub(crate) const WATCH_INTERVAL: Interval = Duration::from_millis(50);

/// Runs `work` on `threads` threads, numbered from 0, until all have returned. This thread calls `watch` meanwhile,
/// after [`WATCH_INTERVAL`] and then at the intervals that it returns. Where a thread cannot be started, `stop` has to
/// make those return that were.
pub(crate) fn run(
    threads: usize,
    work: impl Fn(usize) + Sync,
    stop: impl Fn(),
    mut watch: impl FnMut() -> Interval,
) -> Result<(), RenderError> {
    let crew = Crew { running: Mutex::new(0), ended: Condvar::new() };
    std::thread::scope(|scope| {
        for number in 0..threads {
            *lock(&crew.running) += 1;
            let (crew, work) = (&crew, &work);
            let life = move || {
                let _ended = Ended(crew);
                work(number);
            };
            let builder = std::thread::Builder::new().name(format!("render-{number}"));
            if let Err(source) = builder.spawn_scoped(scope, life) {
                *lock(&crew.running) -= 1;
                stop();
                return Err(RenderError::Thread { number, source });
            }
        }
        crew.wait(&mut watch);
        Ok(())
    })
}

struct Crew {
    /// Threads still running, and the bell they ring when they end.
    running: Mutex<usize>,
    ended: Condvar,
}

impl Crew {
    fn wait(&self, watch: &mut impl FnMut() -> Interval) {
        let mut interval = WATCH_INTERVAL;
        let mut running = lock(&self.running);
        while *running > 0 {
            let (guard, wait) =
                self.ended.wait_timeout(running, interval).unwrap_or_else(PoisonError::into_inner);
            running = guard;
            if *running > 0 && wait.timed_out() {
                drop(running);
                interval = watch();
                running = lock(&self.running);
            }
        }
    }
}

/// Counts a thread out when it ends, however it ends.
struct Ended<'a>(&'a Crew);

impl Drop for Ended<'_> {
    fn drop(&mut self) {
        *lock(&self.0.running) -= 1;
        self.0.ended.notify_one();
    }
}
