//! Replays against direct sums. Against live renders: see [`crate::live`].

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
