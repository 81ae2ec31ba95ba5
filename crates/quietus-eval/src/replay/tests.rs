//! Replays against direct sums, and against live renders.

use std::{num::NonZeroUsize, sync::atomic::AtomicBool};

use glam::Vec3;
use quietus_film::Window;
use quietus_render::{Control, Machinery, PathTracer, RenderSettings, Sampling, Tracer, render, shown_error};
use quietus_trace::tile::{PixelWork, Sample, SampleSink, TileCounts};

use quietus::Policy;

use super::*;
use crate::{BankSpec, Look, Subject, bank::record_in_memory};

fn bank() -> Bank {
    let look = Look { filter: "box".into(), ..Look::new(36, 20) };
    let spec = BankSpec { scene: "embedded".into(), look, streams: 6, samples: 32, seed: 0 };
    record_in_memory(&Subject::embedded().unwrap(), &spec).unwrap()
}

fn settings(policy: Policy, max_samples: u32) -> Settings {
    Settings { policy, max_samples, target_error: 0.01, ..Settings::new(36, 20) }
}

#[test]
fn uniform_is_the_direct_mean_of_the_samples_it_says() {
    let bank = bank();
    for run in [0, 1, 2, 3, 11] {
        let replayed = replay(&bank, &settings(Policy::Uniform, 24), run).unwrap();
        assert_eq!((replayed.samples, replayed.rejected), (36 * 20 * 24, 0));
        assert!(replayed.counts.iter().all(|&n| n == 24));
        let deal = Deal::new(6, 2, 720, run);
        for pixel in [0, 17, 719] {
            let mut sum = [0.0; 3];
            for replicate in 0..2 {
                for &bytes in &bank.stream(pixel, deal.stream(pixel, replicate))[..12] {
                    let value = packed::unpack(u64::from_le_bytes(bytes));
                    (0..3).for_each(|c| sum[c] += f64::from(value[c]));
                }
            }
            let [r, g, b] = sum.map(|s| (s / 24.0) as f32);
            for (found, expected) in replayed.picture.rgb[pixel].iter().zip([r, g, b]) {
                // Sums in another order: a few roundings of f64, then one of f32.
                assert!((found - expected).abs() <= expected * f32::EPSILON, "{found} {expected}");
            }
        }
    }
}

#[test]
fn every_policy_ends_and_equal_runs_are_equal() {
    let bank = bank();
    for policy in
        [Policy::Uniform, Policy::Tile, Policy::Dammertz, Policy::Pixel, Policy::Talk, Policy::Quietus]
    {
        let one = replay(&bank, &settings(policy, 64), 1).unwrap();
        let again = replay(&bank, &settings(policy, 64), 1).unwrap();
        assert!(one.picture == again.picture && one.counts == again.counts, "{policy:?}");
        assert!(one.counts.iter().all(|n| (16..=64).contains(n)), "{policy:?}");
        assert!(one.rays > one.samples as f64);
        let free = Settings { mode: quietus::Mode::FreeRunning, ..settings(policy, 64) };
        replay(&bank, &free, 0).unwrap();
    }
}

#[test]
fn what_does_not_fit_the_bank_is_refused() {
    let bank = bank();
    let message = |settings: &Settings| replay(&bank, settings, 0).unwrap_err().to_string();
    assert!(message(&settings(Policy::Uniform, 65)).contains("2 replicates of 32 samples hold 64"));
    let other = Settings { width: 40, ..settings(Policy::Uniform, 8) };
    assert!(message(&other).contains("the bank holds 36x20 pixels"));
    let many = Settings { replicates: 7, ..settings(Policy::Uniform, 8) };
    assert!(message(&many).contains("the bank has 6 streams"));
}

/// The path tracer with samples rounded as banks round them.
struct Rounding<'a>(PathTracer<'a>);

struct RoundingSink<'a, S>(&'a mut S);

impl<S: SampleSink> SampleSink for RoundingSink<'_, S> {
    fn add(&mut self, work: &PixelWork, index: u32, sample: &Sample) {
        let [r, g, b, alpha] = packed::unpack(packed::pack(sample.radiance, sample.alpha).unwrap());
        self.0.add(work, index, &Sample { radiance: Vec3::new(r, g, b), alpha, ..*sample });
    }
}

impl Tracer for Rounding<'_> {
    fn render_tile(&self, work: &[PixelWork], sink: &mut impl SampleSink) -> TileCounts {
        self.0.render_tile(work, &mut RoundingSink(sink))
    }
}

/// What makes replays worth anything: run k of a bank is the live render with the bank's seed plus k, sample
/// by sample and decision by decision. Same counts, same picture, bit for bit.
#[test]
fn a_replay_is_the_live_render() {
    let (bank, subject) = (bank(), Subject::embedded().unwrap());
    for (sampling, policy) in [(Sampling::Quietus, Policy::Quietus), (Sampling::Pixel, Policy::Pixel)] {
        let settings = settings(policy, 64);
        let replayed = replay(&bank, &settings, 2).unwrap();
        let view = subject.view(&bank.spec().look, 2).unwrap();
        let tracer = Rounding(PathTracer { scene: &subject.scene, view: &view });
        let live = RenderSettings {
            frame: [36, 20],
            window: Window { x0: 0, y0: 0, x1: 36, y1: 20 },
            sampling,
            target_error: settings.target_error,
            min_samples: settings.min_samples,
            max_samples: settings.max_samples,
            time_limit: None,
            threads: NonZeroUsize::new(2).unwrap(),
            machinery: Machinery::default(),
        };
        let mut control = Control { cancel: &AtomicBool::new(false), progress: &mut |_| () };
        let picture = render(&tracer, &live, &mut control).unwrap().film.picture(shown_error);
        assert_eq!(picture.samples, replayed.counts, "{policy:?}");
        let colors: Vec<[f32; 3]> = picture.beauty.iter().map(|c| [c[0], c[1], c[2]]).collect();
        assert_eq!(colors, replayed.picture.rgb, "{policy:?}");
        assert!(replayed.counts.iter().any(|&n| n < 64), "{policy:?} stops somewhere");
    }
}
