//! A sampling that goes on from a state draws what would have been drawn, wherever it was interrupted.

use super::*;
use crate::RuleMemory;

/// What one sampling left, and another went on from.
struct Interrupted {
    state: SamplingState,
    before: Vec<(u64, u32, u64)>,
}

/// Draws until the given number of visits has begun, and stops there with the visits at hand finished.
fn interrupt(settings: &Settings, state: Option<&SamplingState>, threads: usize, visits: u32) -> Interrupted {
    let sampling = match state {
        Some(state) => AdaptiveSampling::restored(settings.clone(), state).unwrap(),
        None => AdaptiveSampling::new(settings.clone()).unwrap(),
    };
    let begun = AtomicU32::new(0);
    let before = draw(&sampling, threads, |visit| {
        sleepy(visits.into())(visit);
        if begun.fetch_add(1, SeqCst) == visits {
            sampling.stop();
        }
    });
    Interrupted { state: sampling.pause().unwrap().state(), before }
}

/// Interrupts a sampling again and again, each leg with another number of threads, and returns what all of them drew.
fn in_legs(settings: &Settings, leg: u32) -> (AdaptiveSampling, Remains, usize) {
    let (mut visits, mut state, mut legs) = (Vec::new(), None, 0);
    loop {
        let threads = [1, 4, 2, 7][legs % 4];
        let interrupted = interrupt(settings, state.as_ref(), threads, leg);
        visits.extend(interrupted.before);
        legs += 1;
        let sampling = AdaptiveSampling::restored(settings.clone(), &interrupted.state).unwrap();
        let same = sampling.pause().unwrap().state();
        assert!(same == interrupted.state, "a state comes out as it went in");
        if sampling.is_finished() {
            visits.sort_unstable();
            let remains = remains(&sampling, visits);
            return (sampling, remains, legs);
        }
        state = Some(interrupted.state);
    }
}

const POLICIES: [Policy; 7] = [
    Policy::Quietus,
    Policy::Unbiased,
    Policy::Talk,
    Policy::Tile,
    Policy::Dammertz,
    Policy::Pixel,
    Policy::Uniform,
];

#[test]
fn interrupted_anywhere_it_draws_the_same() {
    for policy in POLICIES {
        for (lag, checks) in [(1, Checks::Published), (2, Checks::StripedLocks), (2, Checks::Published)] {
            let mode = Mode::Deterministic { lag };
            let settings = Settings { policy, mode, checks, max_samples: 150, ..settings(70, 44) };
            let (whole, expected) = run(&settings, 1, |_| ());
            for leg in [19, 230] {
                let (sampling, remains, legs) = in_legs(&settings, leg);
                assert!(legs > 1 && remains == expected, "{policy:?}, lag {lag}, {checks:?}, {legs} legs");
                let trees = |sampling: &AdaptiveSampling| format!("{:?}", sampling.region_trees());
                assert!(trees(&sampling) == trees(&whole), "trees of {policy:?}, lag {lag}, {legs} legs");
            }
        }
    }
}

#[test]
fn a_state_taken_in_passing_disturbs_nothing_and_leads_to_the_same_end() {
    for lag in [1, 2] {
        let settings = Settings { mode: Mode::Deterministic { lag }, ..settings(100, 60) };
        let (_, expected) = run(&settings, 1, |_| ());
        let sampling = AdaptiveSampling::new(settings.clone()).unwrap();
        let in_flight = AtomicU32::new(0);
        let (visits, states) = thread::scope(|scope| {
            let watcher = scope.spawn(|| {
                let mut states = Vec::new();
                while sampling.outcome().is_none() {
                    if let Some(paused) = sampling.pause() {
                        assert_eq!(in_flight.load(SeqCst), 0, "a visit was under way in a pause");
                        states.push(paused.state());
                    }
                    thread::sleep(Duration::from_millis(1));
                }
                states
            });
            let visits = draw(&sampling, 4, |visit| {
                in_flight.fetch_add(1, SeqCst);
                sleepy(lag.into())(visit);
                in_flight.fetch_sub(1, SeqCst);
            });
            (visits, watcher.join().unwrap())
        });
        assert!(remains(&sampling, visits) == expected);
        assert!(states.len() > 3, "it was looked at while it ran");
        for state in states.iter().step_by(states.len() / 4) {
            let resumed = AdaptiveSampling::restored(settings.clone(), state).unwrap();
            draw(&resumed, 3, |_| ());
            assert!(remains(&resumed, Vec::new()).tiles == expected.tiles, "lag {lag}");
        }
    }
}

#[test]
fn what_went_on_to_another_target_is_interrupted_like_any_other() {
    for visits in [4, 400] {
        let coarse = AdaptiveSampling::new(settings(70, 44)).unwrap();
        let begun = AtomicU32::new(0);
        draw(&coarse, 1, |_| {
            if begun.fetch_add(1, SeqCst) == visits {
                coarse.stop();
            }
        });
        let fine = Settings { target_error: 0.002, ..settings(70, 44) };
        let start = Start::of(&coarse);
        let whole = AdaptiveSampling::resumed(fine.clone(), &start).unwrap();
        draw(&whole, 1, |_| ());
        let part = AdaptiveSampling::resumed(fine.clone(), &start).unwrap();
        let left = AtomicU32::new(0);
        draw(&part, 3, |_| {
            if left.fetch_add(1, SeqCst) == 100 {
                part.stop();
            }
        });
        assert!(!part.is_finished(), "100 visits are too many");
        let rest = AdaptiveSampling::restored(fine, &part.pause().unwrap().state()).unwrap();
        draw(&rest, 2, |_| ());
        assert!(remains(&rest, Vec::new()) == remains(&whole, Vec::new()), "after {visits} visits");
    }
}

#[test]
fn a_stopped_sampling_is_drawn_again_from_its_visits() {
    for lag in [1, 2] {
        let settings = Settings { mode: Mode::Deterministic { lag }, ..settings(70, 44) };
        for most in [0, 3, 100, 300] {
            let begun = AtomicU32::new(0);
            let stopped = AdaptiveSampling::new(settings.clone()).unwrap();
            let drawn = draw(&stopped, 4, |visit| {
                sleepy(most.into())(visit);
                if begun.fetch_add(1, SeqCst) == most {
                    stopped.stop();
                }
            });
            assert_eq!(stopped.outcome(), Some(Outcome::Stopped), "{most} visits are too many");
            for threads in [1, 5] {
                let again = AdaptiveSampling::new(settings.clone()).unwrap();
                let again = again.stop_after(&stopped.finished_visits()).unwrap();
                let visits = draw(&again, threads, |_| ());
                assert_eq!(again.outcome(), None);
                let same = remains(&again, visits) == remains(&stopped, drawn.clone());
                assert!(same, "lag {lag}, {most} visits, {threads} threads");
            }
        }
    }
}

#[test]
fn a_free_running_sampling_goes_on_to_its_end() {
    let settings = Settings { mode: Mode::FreeRunning, ..settings(70, 44) };
    let state = interrupt(&settings, None, 4, 150).state;
    let resumed = AdaptiveSampling::restored(settings, &state).unwrap();
    let before = resumed.counts().total();
    draw(&resumed, 3, |_| ());
    assert!(resumed.is_finished() && resumed.counts().total() > before && before > 0);
}

#[test]
fn an_abandoned_sampling_has_no_state() {
    let sampling = AdaptiveSampling::new(settings(40, 40)).unwrap();
    drop(sampling.worker().next_visit());
    assert!(sampling.pause().is_none());
    assert!(sampling.worker().next_visit().is_none(), "the pause is over");
}

#[test]
fn states_that_cannot_be_are_refused() {
    for policy in [Policy::Quietus, Policy::Unbiased, Policy::Dammertz] {
        let settings = Settings { policy, ..settings(40, 24) };
        let state = interrupt(&settings, None, 2, 90).state;
        let refused = |change: &dyn Fn(&mut SamplingState)| {
            let mut state = state.clone();
            change(&mut state);
            let error = AdaptiveSampling::restored(settings.clone(), &state).err();
            error.map(|error| error.to_string()).unwrap_or_default()
        };
        assert_eq!(refused(&|_| ()), "");
        assert!(refused(&|s| s.standing.visits[3] += 9).contains("ahead of the trees"));
        assert!(refused(&|s| s.standing.visits[3] = 1 << 50).contains("too many visits"));
        assert!(refused(&|s| s.standing.drew.clear()).contains("number of tiles or regions"));
        assert!(refused(&|s| s.counts.truncate(64)).contains("sample counts"));
        assert!(refused(&|s| s.counts.fill(u32::MAX)).contains("too many samples"));
        assert!(refused(&|s| s.samples.push(1)).contains("errors"));
        assert!(refused(&|s| s.masks.truncate(1)).contains("masks"));
        assert!(refused(&|s| s.quiet_passes = 9999).contains("do not agree"));
        assert!(refused(&|s| s.open_passes.extend([true; 8])).contains("do not agree"));
        assert!(refused(&|s| s.regions.truncate(3)).contains("regions"));
        let elsewhere = RuleMemory::Blocks(vec![PixelRect::new(0, 0, 999, 1)]);
        assert!(
            refused(&|s| s.regions[0].memory = elsewhere.clone()).contains("it is of another policy")
                || policy == Policy::Dammertz
                    && refused(&|s| s.regions[0].memory = elsewhere.clone()).contains("leaves its region")
        );
    }
    let edge = Settings { ..settings(9, 9) };
    let mut state = interrupt(&edge, None, 1, 3).state;
    state.masks[1] = u64::MAX;
    let error = AdaptiveSampling::restored(edge, &state).err().unwrap();
    assert!(error.to_string().contains("outside the picture"));
}
