//! The coordinator with real threads and a synthetic renderer whose pixel errors are a hash of pixel and count:
//! the same bits for any number of threads and any timing, also where delays are injected, and other bits where
//! the protocol is broken on purpose.

use std::{thread, time::Duration};

use super::*;
use crate::{Policy, Rebuild};

/// What a run leaves behind: counts, errors and masks of every tile.
#[derive(Debug, PartialEq, Eq)]
struct Remains(Vec<(Vec<u32>, [PixelError; TILE_PIXELS], u64)>);

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

/// Draws until the end with `threads` threads; `delay` is called in the middle of each visit.
fn draw(sampling: &AdaptiveSampling, threads: usize, delay: impl Fn(&Visit<'_, '_>) + Sync) {
    thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                let mut worker = sampling.worker();
                while let Some(visit) = worker.next_visit() {
                    let mut errors = [PixelError::REJECTED; TILE_PIXELS];
                    let mut ends = [0; TILE_PIXELS];
                    for work in visit.pixels() {
                        ends[usize::from(work.pixel)] += work.samples.end;
                        let count = ends[usize::from(work.pixel)];
                        errors[usize::from(work.pixel)] = synthetic_error(work.x, work.y, count);
                    }
                    delay(&visit);
                    visit.finish(&errors);
                }
            });
        }
    });
}

fn remains(sampling: &AdaptiveSampling) -> Remains {
    let counts = |tile| (0..64).map(|p| sampling.counts().pixel(tile, p)).collect();
    let tile = |tile| (counts(tile), sampling.errors(tile), sampling.active_mask(tile));
    Remains((0..sampling.grid().tiles()).map(tile).collect())
}

fn settings(width: u32, height: u32) -> Settings {
    Settings { target_error: 0.01, max_samples: 400, ..Settings::new(width, height) }
}

fn run(
    settings: &Settings,
    threads: usize,
    delay: impl Fn(&Visit<'_, '_>) + Sync,
) -> (AdaptiveSampling, Remains) {
    let sampling = AdaptiveSampling::new(settings.clone()).unwrap();
    draw(&sampling, threads, delay);
    assert!(sampling.is_finished());
    let remains = remains(&sampling);
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
