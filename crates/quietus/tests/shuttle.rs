//! Random schedules of whole runs, larger than loom can exhaust, with every primitive under the scheduler:
//!
//! ```sh
//! RUSTFLAGS="--cfg shuttle" cargo test -p quietus --release --test shuttle
//! ```
//!
//! Where a schedule fails, shuttle prints it for replay. Its memory is sequentially consistent: weak memory is
//! loom's part.
#![cfg(shuttle)]

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    sync::Arc,
};

use quietus::{
    AdaptiveSampling, Checks, Mode, PassSchedule, PixelError, Rebuild, Settings, TILE_PIXELS, Visit,
    protocol::Fault,
};
use shuttle::{check_pct, check_random, thread};

fn settings(mode: Mode, checks: Checks) -> Settings {
    Settings {
        mode,
        checks,
        stripes: 8,
        rebuild: Rebuild::Resummed,
        min_samples: 1,
        max_samples: 30,
        target_error: 0.03,
        schedule: PassSchedule::new(2, 2, 4),
        ..Settings::new(30, 12)
    }
}

/// Errors that fall with the samples, rough in space.
fn errors(visit: &Visit<'_, '_>) -> [PixelError; TILE_PIXELS] {
    let mut errors = [PixelError::ZERO; TILE_PIXELS];
    for work in visit.pixels() {
        let rough = (work.x * 7 + work.y * 13 + work.samples.end * 5) % 17;
        errors[usize::from(work.pixel)] = PixelError::from_f32(0.01 * rough as f32 / work.samples.end as f32);
    }
    errors
}

/// Counts and masks that `threads` threads leave behind.
fn run(settings: Settings, fault: Option<Fault>, threads: usize) -> Vec<(u64, u64)> {
    let sampling = Arc::new(AdaptiveSampling::new(settings).unwrap().with_fault(fault));
    let draw = |sampling: &AdaptiveSampling| {
        let mut worker = sampling.worker();
        while let Some(visit) = worker.next_visit() {
            let errors = errors(&visit);
            visit.finish(&errors);
        }
    };
    let spawn = |_| {
        let sampling = Arc::clone(&sampling);
        thread::spawn(move || draw(&sampling))
    };
    let others: Vec<_> = (1..threads).map(spawn).collect();
    draw(&sampling);
    others.into_iter().for_each(|thread| thread.join().unwrap());
    assert!(sampling.is_finished());
    (0..sampling.grid().tiles())
        .map(|tile| {
            let samples = (0..64).map(|p| u64::from(sampling.counts().pixel(tile, p))).sum();
            (samples, sampling.active_mask(tile))
        })
        .collect()
}

fn same_for_any_threads(settings: &Settings, fault: Option<Fault>) {
    assert_eq!(
        run(settings.clone(), fault, 4),
        run(settings.clone(), None, 1),
        "the picture depends on timing"
    );
}

const SCHEDULES: usize = 60;

#[test]
fn results_do_not_depend_on_the_schedule() {
    for lag in [1, 2] {
        let of = move |checks| settings(Mode::Deterministic { lag }, checks);
        check_random(move || same_for_any_threads(&of(Checks::Published), None), SCHEDULES);
        check_pct(move || same_for_any_threads(&of(Checks::StripedLocks), None), SCHEDULES, 4);
    }
}

#[test]
fn free_running_always_ends() {
    for checks in [Checks::Published, Checks::StripedLocks] {
        check_random(move || drop(run(settings(Mode::FreeRunning, checks), None, 4)), SCHEDULES);
    }
}

#[test]
fn mistakes_are_caught() {
    for (fault, lag) in [(Fault::ForgetOverlap, 2), (Fault::ForgetOwnVisit, 2), (Fault::PublishEarly, 1)] {
        // A row of four tiles in two regions, where tile 1 comes round soon after tile 3 of the other region.
        let settings = Settings {
            width: 32,
            height: 8,
            schedule: PassSchedule::new(2, 2, 2),
            ..settings(Mode::Deterministic { lag }, Checks::Published)
        };
        let model = move || same_for_any_threads(&settings, Some(fault));
        let caught = catch_unwind(AssertUnwindSafe(|| check_pct(model, 40 * SCHEDULES, 4)));
        assert!(caught.is_err(), "{fault:?} was not caught");
    }
}
