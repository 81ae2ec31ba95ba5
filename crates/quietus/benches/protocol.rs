//! What the protocol costs where nothing is drawn, and what the locks cost:
//!
//! ```sh
//! cargo bench -p quietus --bench protocol
//! ```
//!
//! A 2048x858 frame whose tiles all converge at once but one, which goes on for ever: nearly every visit is a
//! skip. Printed: nanoseconds of processor time, of all threads together, per skip, for one thread and several.
//! (Not of the clock on the wall: other work on the machine counts less.)

use std::{
    hint::black_box,
    sync::{
        Mutex, RwLock,
        atomic::{AtomicU64, Ordering},
    },
    thread,
    time::Instant,
};

use cpu_time::ProcessTime;
use quietus::{AdaptiveSampling, Checks, Mode, PassSchedule, PixelError, Settings, TILE_PIXELS};

/// Passes of skips to time.
const PASSES: u64 = 60;

fn main() {
    if std::env::args().any(|argument| argument == "--test") {
        return;
    }
    println!("nanoseconds of processor time per skip, 2048x858");
    println!("{:<24}{:<14}{:>10}{:>10}{:>10}", "mode", "checks", "1 thread", "2 threads", "4 threads");
    let lag = |lag| Mode::Deterministic { lag };
    for (name, mode) in [("lag 2", lag(2)), ("lag 1", lag(1)), ("free-running", Mode::FreeRunning)] {
        for checks in [Checks::Published, Checks::StripedLocks] {
            let times = [1, 2, 4].map(|threads| nanoseconds_per_skip(mode, checks, threads));
            let [one, two, four] = times;
            println!("{name:<24}{:<14}{one:>10.1}{two:>10.1}{four:>10.1}", format!("{checks:?}"));
        }
    }
    println!("\nnanoseconds per uncontended access");
    let rw = RwLock::new(1u64);
    println!("{:<24}{:>10.1}", "std RwLock, read", time(|| *rw.read().unwrap()));
    println!("{:<24}{:>10.1}", "std RwLock, try_read", time(|| *rw.try_read().unwrap()));
    let mutex = Mutex::new(1u64);
    println!("{:<24}{:>10.1}", "std Mutex", time(|| *mutex.lock().unwrap()));
    let word = AtomicU64::new(1);
    println!("{:<24}{:>10.1}", "atomic load, acquire", time(|| word.load(Ordering::Acquire)));
}

fn nanoseconds_per_skip(mode: Mode, checks: Checks, threads: u32) -> f64 {
    let settings = Settings {
        mode,
        checks,
        min_samples: 1,
        max_samples: u32::MAX,
        schedule: PassSchedule::new(2, 2, 0),
        ..Settings::new(2048, 858)
    };
    let sampling = AdaptiveSampling::new(settings).expect("the settings are sound");
    let start = Mutex::new(None);
    thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                let mut worker = sampling.worker();
                while let Some(visit) = worker.next_visit() {
                    // Noisy enough to go on, not so noisy that the tree would leave its surroundings unsplit.
                    let error = if visit.tile() == 5000 { 40.0 } else { 0.0 };
                    let pass = visit.pass();
                    if visit.tile() == 5000 && pass == 4 {
                        *start.lock().unwrap() = Some(ProcessTime::now());
                    } else if pass == 4 + PASSES {
                        sampling.stop();
                    }
                    visit.finish(&[PixelError::from_f32(error); TILE_PIXELS]);
                }
            });
        }
    });
    let start = start.lock().unwrap().expect("the fourth pass was reached");
    let skips = PASSES * u64::from(sampling.grid().tiles() - 1);
    start.elapsed().as_nanos() as f64 / skips as f64
}

/// Nanoseconds of one call, over a million.
fn time<T>(call: impl Fn() -> T) -> f64 {
    let start = Instant::now();
    for _ in 0..1_000_000 {
        black_box(call());
    }
    start.elapsed().as_nanos() as f64 / 1e6
}
