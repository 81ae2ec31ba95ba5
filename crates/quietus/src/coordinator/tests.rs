//! The coordinator with real threads and a synthetic renderer whose pixel errors are a hash of pixel and count:
//! the same bits for any number of threads and any timing, also where delays are injected, and other bits where
//! the protocol is broken on purpose.

use std::{
    sync::{
        Mutex,
        atomic::{AtomicBool, AtomicU32, Ordering::SeqCst},
    },
    thread,
    time::{Duration, Instant},
};

mod state;

use super::*;
use crate::{Approach, PassSchedule, PixelRect, Policy, Rebuild, protocol::Fault};

/// What a run leaves behind: counts, errors and masks of every tile, and what was drawn in which pass.
#[derive(Debug, PartialEq, Eq)]
struct Remains {
    tiles: Vec<(Vec<u32>, [PixelError; TILE_PIXELS], u64)>,
    visits: Vec<(u64, u32, u64)>,
}

fn mix(values: impl IntoIterator<Item = u64>) -> u64 {
    values.into_iter().fold(0x9e37_79b9_7f4a_7c15, |h, v| {
        let h = (h ^ v).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        h ^ h >> 29
    })
}

/// An error that falls with the samples as one over their square root, rough in space and in the count.
fn synthetic_error(x: u32, y: u32, count: u32) -> PixelError {
    let rough = (mix([x.into(), y.into(), count.into()]) >> 40) as f32 / (1 << 24) as f32;
    // A steep hill of noise, so that trees differ much from place to place.
    let hill = 1.0 + 30.0 / (1.0 + 0.02 * ((x as f32 - 21.0).powi(2) + (y as f32 - 17.0).powi(2)));
    PixelError::from_f32(0.2 * hill * rough / (count.max(1) as f32).sqrt())
}

/// Draws until the end with `threads` threads; `during` is called in the middle of each visit. Returns each
/// visit's pass, tile and mask, sorted: what was drawn when.
fn draw(
    sampling: &AdaptiveSampling,
    threads: usize,
    during: impl Fn(&Visit<'_, '_>) + Sync,
) -> Vec<(u64, u32, u64)> {
    let log = Mutex::new(Vec::new());
    thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                let mut worker = sampling.worker();
                while let Some(visit) = worker.next_visit() {
                    log.lock().unwrap().push((visit.pass(), visit.tile(), visit.mask()));
                    let errors = synthetic_errors(&visit);
                    during(&visit);
                    visit.finish(&errors);
                }
            });
        }
    });
    let mut log = log.into_inner().unwrap();
    log.sort_unstable();
    log
}

fn synthetic_errors(visit: &Visit<'_, '_>) -> [PixelError; TILE_PIXELS] {
    let mut errors = [PixelError::REJECTED; TILE_PIXELS];
    let mut counts = [0; TILE_PIXELS];
    for work in visit.pixels() {
        let pixel = usize::from(work.pixel);
        counts[pixel] += work.samples.end;
        errors[pixel] = synthetic_error(work.x, work.y, counts[pixel]);
    }
    errors
}

fn remains(sampling: &AdaptiveSampling, visits: Vec<(u64, u32, u64)>) -> Remains {
    let counts = |tile| (0..64).map(|p| sampling.counts().pixel(tile, p)).collect();
    let tile = |tile| (counts(tile), sampling.errors(tile), sampling.active_mask(tile));
    Remains { tiles: (0..sampling.grid().tiles()).map(tile).collect(), visits }
}

fn settings(width: u32, height: u32) -> Settings {
    Settings { target_error: 0.004, max_samples: 400, ..Settings::new(width, height) }
}

fn run(
    settings: &Settings,
    threads: usize,
    during: impl Fn(&Visit<'_, '_>) + Sync,
) -> (AdaptiveSampling, Remains) {
    let sampling = AdaptiveSampling::new(settings.clone()).unwrap();
    let visits = draw(&sampling, threads, during);
    assert!(sampling.is_finished());
    let remains = remains(&sampling, visits);
    (sampling, remains)
}

/// Sleeps in one visit out of a few, chosen by a hash so that each seed delays others.
fn sleepy(seed: u64) -> impl Fn(&Visit<'_, '_>) + Sync {
    move |visit| match mix([seed, visit.tile().into(), visit.pass()]) % 8 {
        0 => thread::sleep(Duration::from_micros(200)),
        1 | 2 => thread::yield_now(),
        _ => {}
    }
}

#[test]
fn same_bits_for_any_number_of_threads() {
    for lag in [1, 2] {
        let settings = Settings { mode: Mode::Deterministic { lag }, ..settings(100, 60) };
        let (sampling, alone) = run(&settings, 1, |_| ());
        assert!(sampling.statistics().skips > 0 && sampling.statistics().rebuilds.len() > 8);
        for threads in [2, 3, 4, 7, 16] {
            let (_, together) = run(&settings, threads, sleepy(threads as u64));
            assert!(together == alone, "{threads} threads, lag {lag}");
        }
    }
}

#[test]
fn same_bits_where_threads_outnumber_tiles() {
    for (width, height) in [(1, 1), (8, 8), (9, 17), (32, 32), (25, 7)] {
        for lag in [1, 2] {
            let settings = Settings { mode: Mode::Deterministic { lag }, ..settings(width, height) };
            let (_, alone) = run(&settings, 1, |_| ());
            for seed in 0..3 {
                let (_, together) = run(&settings, 16, sleepy(seed));
                assert!(together == alone, "{width}x{height}, lag {lag}, seed {seed}");
            }
        }
    }
}

#[test]
fn same_bits_for_every_way_to_check_and_rebuild() {
    let (_, expected) = run(&settings(70, 50), 1, |_| ());
    for checks in [Checks::StripedLocks, Checks::Published] {
        for rebuild in [Rebuild::Resummed, Rebuild::SummedArea] {
            let settings = Settings { checks, rebuild, stripes: 8, ..settings(70, 50) };
            let (_, found) = run(&settings, 4, sleepy(1));
            assert!(found == expected, "{checks:?}, {rebuild:?}");
        }
    }
}

#[test]
fn same_bits_for_every_policy() {
    for policy in [Policy::Uniform, Policy::Tile, Policy::Dammertz, Policy::Pixel, Policy::Talk] {
        let settings = Settings { policy, max_samples: 100, ..settings(60, 44) };
        let (_, alone) = run(&settings, 1, |_| ());
        let (_, together) = run(&settings, 4, sleepy(5));
        assert!(together == alone, "{policy:?}");
    }
}

/// A row of four tiles in two regions, whose errors overlap: region 0 also holds tile 2, region 1 also tile 1.
/// Trees decide from the first pass on, by errors in steps: whoever reads a wrong one is found out.
fn two_regions() -> Settings {
    let (policy, schedule) = (Policy::Talk, PassSchedule::new(2, 2, 2));
    Settings { min_samples: 1, target_error: 0.01, policy, schedule, ..settings(32, 8) }
}

/// How often a mistake is given the chance to show: on a machine with much else to do, threads may come too late to
/// fall into it.
const ATTEMPTS: u32 = 30;

/// Waits for `condition`, or long enough that it would have come true if the protocol let it.
fn wait_for(condition: impl Fn() -> bool) {
    let start = Instant::now();
    while !condition() && start.elapsed() < Duration::from_millis(150) {
        thread::sleep(Duration::from_micros(50));
    }
}

/// The worst timing for overlaps: tile 3 takes so long in its first visit that tile 1, at home in the other
/// region, could come to write the same plane again.
fn with_a_slow_corner(fault: Option<Fault>) -> Remains {
    let sampling = AdaptiveSampling::new(two_regions()).unwrap().with_fault(fault);
    let visits = draw(&sampling, 8, |visit| {
        if (visit.tile(), visit.pass()) == (3, 0) {
            wait_for(|| sampling.protocol.finished_visits(1) > 2);
        }
    });
    remains(&sampling, visits)
}

#[test]
fn overlap_tiles_wait_for_the_neighbours_tree() {
    let (_, alone) = run(&two_regions(), 1, |_| ());
    assert!(with_a_slow_corner(None) == alone);
    // Broken on purpose: without the condition for overlaps, tile 1 overwrites the errors that region 1 has not
    // read yet.
    let caught = (0..ATTEMPTS).any(|_| with_a_slow_corner(Some(Fault::ForgetOverlap)) != alone);
    assert!(caught, "the mistake was not caught");
}

/// Whether a tile was ever drawn by two threads at once, where tile 3 takes its time.
fn is_drawn_twice_at_once(fault: Option<Fault>) -> bool {
    let sampling = AdaptiveSampling::new(two_regions()).unwrap().with_fault(fault);
    let in_flight: [AtomicU32; 4] = Default::default();
    let twice = AtomicBool::new(false);
    draw(&sampling, 8, |visit| {
        let flights = &in_flight[visit.tile() as usize];
        if flights.fetch_add(1, SeqCst) > 0 {
            twice.store(true, SeqCst);
            // Enough was seen, and with this mistake the rest may never end.
            sampling.stop();
        }
        if (visit.tile(), visit.pass()) == (3, 0) {
            wait_for(|| twice.load(SeqCst));
        }
        flights.fetch_sub(1, SeqCst);
    });
    twice.into_inner()
}

#[test]
fn a_tile_is_drawn_by_one_thread_at_a_time() {
    assert!(!is_drawn_twice_at_once(None));
    // Broken on purpose: the next visit does not wait for the one before.
    assert!(is_drawn_twice_at_once(Some(Fault::ForgetOwnVisit)), "the mistake was not caught");
}

#[test]
fn a_tree_announced_before_it_is_made_is_caught() {
    let settings = Settings { mode: Mode::Deterministic { lag: 1 }, ..two_regions() };
    let (_, alone) = run(&settings, 1, |_| ());
    let caught = (0..ATTEMPTS).any(|_| {
        let broken = AdaptiveSampling::new(settings.clone()).unwrap().with_fault(Some(Fault::PublishEarly));
        let visits = draw(&broken, 8, |_| ());
        remains(&broken, visits) != alone
    });
    assert!(caught, "the mistake was not caught");
}

/// Cover and conservation: each pass visits each tile exactly once, and each region is counted out by exactly its
/// tiles: after whole passes its counter stands where it began, and as many trees are made as there were passes.
#[test]
fn tiles_are_covered_and_conserved_at_awkward_sizes() {
    for (width, height) in [(1, 1), (7, 3), (8, 8), (9, 17), (4096, 1), (1921, 1081)] {
        for regions_per_axis in [1, 2, 3] {
            let passes = 3;
            let settings = Settings {
                regions_per_axis,
                policy: Policy::Uniform,
                min_samples: 1,
                max_samples: passes,
                schedule: PassSchedule::new(1, 1, 0),
                replicates: 1,
                ..Settings::new(width, height)
            };
            let sampling = AdaptiveSampling::new(settings).unwrap();
            let tiles = sampling.grid().tiles();
            let mut covered = 0;
            for region in 0..sampling.regions.len() {
                let error_tiles = sampling.regions.error_tiles(region).count() as i64;
                assert_eq!(sampling.protocol.remaining_visits(region), error_tiles, "{width}x{height}");
            }
            let mut worker = sampling.worker();
            for ticket in 0..passes * tiles {
                let visit = worker.next_visit().unwrap();
                assert_eq!(visit.pass(), u64::from(ticket / tiles), "{width}x{height}");
                assert_eq!(visit.mask(), sampling.grid().full_mask(visit.tile()));
                covered += u64::from(visit.mask().count_ones());
                visit.finish(&[PixelError::ZERO; TILE_PIXELS]);
            }
            // Every tile, `passes` times: none twice in a pass, or another would be short of one.
            assert!((0..tiles).all(|tile| sampling.protocol.finished_visits(tile) == u64::from(passes)));
            assert_eq!(covered, u64::from(passes) * u64::from(width) * u64::from(height));
            for region in 0..sampling.regions.len() {
                let error_tiles = sampling.regions.error_tiles(region).count() as i64;
                assert_eq!(sampling.protocol.remaining_visits(region), error_tiles, "{width}x{height}");
                assert_eq!(sampling.protocol.published(region), u64::from(passes), "{width}x{height}");
            }
            // Now every visit is a skip, many at a time.
            assert!(worker.next_visit().is_none());
            drop(worker);
            assert!(sampling.is_finished());
            let quiet = (sampling.protocol.published(0) - u64::from(passes)) * u64::from(tiles);
            assert!(sampling.statistics().skips >= quiet && quiet > 0, "{width}x{height}");
        }
    }
}

#[test]
fn free_running_ends_with_nothing_left_to_draw() {
    for checks in [Checks::StripedLocks, Checks::Published] {
        for (threads, width, height) in [(1, 100, 60), (4, 100, 60), (16, 25, 30), (16, 8, 8)] {
            let mode = Mode::FreeRunning;
            let settings = Settings { mode, checks, stripes: 8, ..settings(width, height) };
            let (sampling, Remains { tiles, .. }) = run(&settings, threads, sleepy(9));
            let left = tiles.iter().flat_map(|(counts, _, mask)| {
                counts.iter().enumerate().filter(move |(p, c)| mask >> p & 1 == 1 && **c < 400)
            });
            assert_eq!(left.count(), 0, "{checks:?}, {threads} threads");
            // Finished means: the trees are those of the errors that are there.
            for region in 0..sampling.regions.len() {
                let masks: Vec<u64> =
                    sampling.regions.home_tiles(region).map(|t| sampling.active_mask(t)).collect();
                let again = fresh_masks(&sampling, region);
                assert!(masks == again, "{checks:?}, {threads} threads, region {region}");
            }
        }
    }
}

/// The masks of a tree made now.
fn fresh_masks(sampling: &AdaptiveSampling, region: u32) -> Vec<u64> {
    let settings = RuleSettings {
        regions: sampling.regions.clone(),
        target_error: sampling.settings.target_error,
        frame_area: f64::from(sampling.settings.width) * f64::from(sampling.settings.height),
        rebuild: sampling.settings.rebuild,
        counts: sampling.settings.pass_counts(),
    };
    let mut rule = sampling.settings.policy.rule(&settings, region);
    rule.update(&sampling.planes[0]);
    sampling.regions.home_tiles(region).map(|tile| rule.active(tile)).collect()
}

#[test]
fn sample_indices_have_no_gaps_and_limits_hold() {
    let window = PixelRect::new(5, 3, 42, 29);
    let settings = Settings { crop: Some(window), max_samples: 75, ..settings(50, 40) };
    let sampling = AdaptiveSampling::new(settings).unwrap();
    let next = Mutex::new(std::collections::HashMap::new());
    let visits = draw(&sampling, 4, |visit| {
        let mut next = next.lock().unwrap();
        for work in visit.pixels() {
            assert!(window.contains(work.x, work.y), "{work:?} leaves the crop");
            let expected = next.insert((work.x, work.y, work.replicate), work.samples.end).unwrap_or(0);
            assert_eq!(work.samples.start, expected, "{work:?}");
        }
    });
    assert!(!visits.is_empty());
    let next = next.into_inner().unwrap();
    let total: u64 = next.values().map(|&end| u64::from(end)).sum();
    assert_eq!(total, sampling.counts().total());
    let pixels: Vec<u32> = (window.y0..window.y1)
        .flat_map(|y| (window.x0..window.x1).map(move |x| (x, y)))
        .map(|(x, y)| next[&(x, y, 0)] + next[&(x, y, 1)])
        .collect();
    assert!(pixels.iter().all(|count| (16..=75).contains(count)));
    assert!(
        pixels.contains(&75) && pixels.iter().any(|&count| count < 75),
        "the limits were put to the test"
    );
}

#[test]
fn uniform_sampling_reaches_exactly_the_maximum() {
    for (max_samples, replicates) in [(1, 1), (1, 2), (17, 2), (20, 3)] {
        let settings =
            Settings { policy: Policy::Uniform, min_samples: 1, max_samples, replicates, ..settings(20, 12) };
        let (sampling, _) = run(&settings, 3, |_| ());
        assert_eq!(sampling.counts().total(), 20 * 12 * u64::from(max_samples));
    }
}

#[test]
fn a_stop_ends_every_worker() {
    for mode in [Mode::default(), Mode::FreeRunning] {
        let settings = Settings { mode, policy: Policy::Uniform, max_samples: u32::MAX, ..settings(40, 40) };
        let sampling = AdaptiveSampling::new(settings).unwrap();
        let visits = AtomicU32::new(0);
        draw(&sampling, 5, |_| {
            if visits.fetch_add(1, SeqCst) == 200 {
                sampling.stop();
            }
        });
        assert_eq!(sampling.outcome(), Some(Outcome::Stopped));
        assert!(!sampling.is_finished());
    }
}

#[test]
fn an_unfinished_visit_ends_the_sampling() {
    // Dropped by hand.
    let sampling = AdaptiveSampling::new(settings(40, 40)).unwrap();
    drop(sampling.worker().next_visit());
    assert_eq!(sampling.outcome(), Some(Outcome::Abandoned));
    assert!(sampling.worker().next_visit().is_none());
    // By a panic of one of the renderer's threads, while others wait for that tile.
    let sampling = AdaptiveSampling::new(settings(8, 8)).unwrap();
    thread::scope(|scope| {
        let panicking = scope.spawn(|| {
            let mut worker = sampling.worker();
            let _visit = worker.next_visit().unwrap();
            thread::sleep(Duration::from_millis(5));
            std::panic::resume_unwind(Box::new("the renderer's bug"));
        });
        thread::sleep(Duration::from_millis(1));
        (0..3).for_each(|_| {
            scope.spawn(|| while sampling.worker().next_visit().is_some() {});
        });
        assert!(panicking.join().is_err());
    });
    assert_eq!(sampling.outcome(), Some(Outcome::Abandoned));
}

#[test]
fn a_worker_between_visits_may_go() {
    let sampling = AdaptiveSampling::new(settings(60, 40)).unwrap();
    let (_, alone) = run(&settings(60, 40), 1, |_| ());
    let mut visits = Vec::new();
    for _ in 0..50 {
        let mut worker = sampling.worker();
        let visit = worker.next_visit().unwrap();
        visits.push((visit.pass(), visit.tile(), visit.mask()));
        let errors = synthetic_errors(&visit);
        visit.finish(&errors);
    }
    visits.extend(draw(&sampling, 2, |_| ()));
    visits.sort_unstable();
    assert!(remains(&sampling, visits) == alone);
}

#[test]
fn bad_settings_are_refused_with_a_reason() {
    let refused = |change: fn(&mut Settings)| {
        let mut settings = settings(64, 48);
        change(&mut settings);
        AdaptiveSampling::new(settings).err().map(|error| error.to_string()).unwrap_or_default()
    };
    assert!(refused(|_| ()).is_empty());
    assert!(refused(|s| s.width = 0).contains("0x48"));
    assert!(refused(|s| s.crop = Some(PixelRect::new(0, 0, 65, 4))).contains("0,0,65,4"));
    assert!(refused(|s| s.crop = Some(PixelRect::new(4, 4, 4, 8))).contains("must hold a pixel"));
    assert!(refused(|s| s.frame_area = Some(f64::NAN)).contains("frame area"));
    assert!(refused(|s| s.regions_per_axis = 0).contains("regions"));
    assert!(refused(|s| s.target_error = 0.0).contains("target error"));
    assert!(refused(|s| s.max_samples = 8).contains("not less than the minimum, 16"));
    assert!(refused(|s| s.replicates = 256).contains("256"));
    assert!(refused(|s| s.replicates = 1).contains("at least 2"));
    assert!(refused(|s| s.stripes = 12).contains("power of two"));
    assert!(refused(|s| s.mode = Mode::Deterministic { lag: 3 }).contains("1 or 2 passes, not 3"));
}

/// The total of counts, and what is left when `sampling`, which has ended, goes on under `settings`.
fn go_on(sampling: &AdaptiveSampling, settings: &Settings, threads: usize) -> (AdaptiveSampling, Remains) {
    let resumed = AdaptiveSampling::resumed(settings.clone(), &Start::of(sampling)).unwrap();
    assert_eq!(resumed.counts().total(), sampling.counts().total(), "nothing is lost");
    let visits = draw(&resumed, threads, sleepy(2));
    assert!(resumed.is_finished());
    let remains = remains(&resumed, visits);
    (resumed, remains)
}

#[test]
fn a_finished_sampling_asked_for_the_same_draws_nothing() {
    for (policy, checks) in [
        (Policy::Quietus, Checks::Published),
        (Policy::Quietus, Checks::StripedLocks),
        (Policy::Talk, Checks::Published),
        (Policy::Uniform, Checks::Published),
    ] {
        let settings = Settings { policy, checks, ..settings(60, 44) };
        let (sampling, Remains { tiles, .. }) = run(&settings, 2, |_| ());
        let (resumed, again) = go_on(&sampling, &settings, 2);
        assert!(again == Remains { tiles, visits: Vec::new() }, "{policy:?}, {checks:?}");
        assert_eq!(resumed.converged_fraction(), sampling.converged_fraction());
    }
}

#[test]
fn a_lower_target_goes_on_where_more_is_wanted_whatever_the_threads() {
    for mode in [Mode::Deterministic { lag: 1 }, Mode::Deterministic { lag: 2 }, Mode::FreeRunning] {
        let coarse = Settings { mode, target_error: 0.016, max_samples: 2000, ..settings(60, 44) };
        let (sampling, before) = run(&coarse, 1, |_| ());
        let fine = Settings { target_error: 0.008, ..coarse.clone() };
        let (resumed, after) = go_on(&sampling, &fine, 1);
        let counts = |r: &Remains| r.tiles.iter().flat_map(|t| t.0.clone()).collect::<Vec<_>>();
        let pairs: Vec<_> = counts(&before).into_iter().zip(counts(&after)).collect();
        assert!(pairs.iter().all(|(before, after)| before <= after));
        assert!(resumed.counts().total() > sampling.counts().total());
        if mode != Mode::FreeRunning {
            assert!(go_on(&sampling, &fine, 4).1 == after, "{mode:?}");
        }
    }
}

#[test]
fn a_sampling_stopped_at_any_moment_goes_on_to_its_limits() {
    for mode in [Mode::default(), Mode::FreeRunning] {
        let settings = Settings { mode, min_samples: 30, max_samples: 60, ..settings(60, 44) };
        for visits in [0, 1, 7, 60, 200] {
            let sampling = AdaptiveSampling::new(settings.clone()).unwrap();
            let left = AtomicU32::new(visits);
            draw(&sampling, 3, |_| {
                if left.fetch_sub(1, SeqCst) <= 1 {
                    sampling.stop();
                }
            });
            let (_, Remains { tiles, .. }) = go_on(&sampling, &settings, 3);
            let inside = |tile: usize| active_pixels(sampling.grid().full_mask(tile as u32));
            let counts: Vec<u32> = (0..tiles.len())
                .flat_map(|t| inside(t).map(move |p| (t, p)))
                .map(|(t, p)| tiles[t].0[p])
                .collect();
            assert!(counts.iter().all(|count| (30..=60).contains(count)), "{mode:?}, {visits} visits");
        }
    }
}

fn active_pixels(mask: u64) -> impl Iterator<Item = usize> {
    pixels(mask).map(usize::from)
}

#[test]
fn a_start_that_does_not_fit_is_refused_with_a_reason() {
    let start = Start::of(&AdaptiveSampling::new(settings(64, 48)).unwrap());
    let refused = |settings| AdaptiveSampling::resumed(settings, &start).err().unwrap().to_string();
    assert!(
        refused(settings(64, 49))
            .contains("3584 numbers of samples and as many errors, not from 3072 and 3072")
    );
    let unbiased = Settings { policy: Policy::Unbiased, ..settings(64, 48) };
    assert!(refused(unbiased).contains("Unbiased decides but once"));
}

/// Counts of all pixels of the window.
fn all_counts(sampling: &AdaptiveSampling) -> Vec<u32> {
    let tile = |tile| pixels(sampling.grid().full_mask(tile)).map(move |p| sampling.counts().pixel(tile, p));
    (0..sampling.grid().tiles()).flat_map(tile).collect()
}

#[test]
fn spread_samples_are_even_wherever_they_are_stopped() {
    for policy in [Policy::Quietus, Policy::Uniform] {
        let settings = Settings { policy, approach: Approach::Spread, max_samples: 100, ..settings(61, 44) };
        let settings =
            if policy == Policy::Uniform { Settings { min_samples: 100, ..settings } } else { settings };
        let (_, alone) = run(&settings, 1, |_| ());
        let (_, together) = run(&settings, 4, sleepy(7));
        assert!(together == alone, "{policy:?}");
        // Stopped in the middle of a pass; then on from there, to be stopped again.
        let mut start: Option<Start> = None;
        for threads in [1, 1, 1, 3] {
            let sampling = match &start {
                None => AdaptiveSampling::new(settings.clone()),
                Some(start) => AdaptiveSampling::resumed(settings.clone(), start),
            };
            let (sampling, visits) = (sampling.unwrap(), AtomicU32::new(0));
            draw(&sampling, threads, |_| {
                if visits.fetch_add(1, SeqCst) == 300 {
                    sampling.stop();
                }
            });
            let counts = all_counts(&sampling);
            let (least, most) = (counts.iter().min().unwrap(), counts.iter().max().unwrap());
            // Where there are others, a tile may be two passes behind them: a step more.
            let step = 2 * (most / 16).max(1);
            assert!(
                most - least <= if threads == 1 { step } else { 2 * step },
                "{policy:?}: {least} to {most}"
            );
            let mean = |of: &[u32]| f64::from(of.iter().sum::<u32>()) / of.len() as f64;
            let (first, last) = counts.split_at(counts.len() / 4);
            // One pixel in four has another step of two; tiles at the rim may have a few more or less.
            assert!(
                (mean(first) - mean(last)).abs() < 0.55,
                "{policy:?}: {} and {}",
                mean(first),
                mean(last)
            );
            start = Some(Start::of(&sampling));
        }
    }
}

#[test]
fn the_smallest_pictures_come_to_their_minimum_in_turns() {
    for (width, height) in [(1, 1), (3, 2), (9, 1)] {
        let settings = Settings { approach: Approach::Spread, ..settings(width, height) };
        let (sampling, _) = run(&settings, 2, |_| ());
        assert!(all_counts(&sampling).iter().all(|&count| count >= 16), "{width}x{height}");
    }
}
