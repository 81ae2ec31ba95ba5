//! The render loop over stand-in tracers: what it draws, and how it ends.

use std::num::NonZeroUsize;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use glam::Vec3;
use quietus_film::{Layout, Picture, Window};
use quietus_render::{
    Control, Fault, Goal, Keeping, Machinery, RenderError, RenderSettings, Rendered, Sampling, StoppedBy,
    Tracer, Weights, render, shown_error,
};
use quietus_trace::tile::{PixelWork, Sample, SampleSink, TileCounts};

/// Samples that are a function of their numbers alone.
struct Func<F>(F);

impl<F: Fn(&PixelWork, u32) -> Sample + Sync> Tracer for Func<F> {
    fn render_tile(&self, work: &[PixelWork], sink: &mut impl SampleSink) -> TileCounts {
        let mut paths = 0;
        for run in work {
            for index in run.first..run.first + run.count {
                sink.add(run, index, &(self.0)(run, index));
                paths += 1;
            }
        }
        TileCounts { paths, rays: 3 * paths }
    }
}

/// A well-mixed number in 0..1 (splitmix64).
fn random(run: &PixelWork, index: u32) -> f32 {
    let key = [run.x, run.y, u32::from(run.replicate), index];
    let mut state = key
        .iter()
        .fold(1_u64, |state, &k| (state ^ u64::from(k)).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29));
    state = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    state = (state ^ (state >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((state ^ (state >> 31)) >> 40) as f32 / (1_u64 << 24) as f32
}

fn grey(value: f32) -> Sample {
    Sample { radiance: Vec3::splat(value), alpha: 1.0, depth: 1.0, ..Sample::default() }
}

/// Noise that is strong on the left and fades to the right.
fn noise(run: &PixelWork, index: u32) -> Sample {
    grey(0.5 + (random(run, index) - 0.5) * 2.0_f32.powf(-(run.x as f32) / 12.0))
}

fn settings(width: u32, height: u32, sampling: Sampling) -> RenderSettings {
    RenderSettings {
        frame: [width, height],
        window: Window { x0: 0, y0: 0, x1: width, y1: height },
        sampling,
        goal: Goal::TargetError(0.0015),
        min_samples: 8,
        max_samples: 200,
        time_limit: None,
        threads: NonZeroUsize::new(4).unwrap(),
        machinery: Machinery::default(),
        weights: None,
        aov_noise: [None; 3],
    }
}

fn draw(tracer: &impl Tracer, settings: &RenderSettings) -> Result<Rendered, RenderError> {
    render(tracer, settings, &mut Control { cancel: &AtomicBool::new(false), watch: &mut |_| (), live: None })
}

fn picture(settings: &RenderSettings) -> Picture {
    draw(&Func(noise), settings).unwrap().film.picture(shown_error)
}

const ADAPTIVE: [Sampling; 5] =
    [Sampling::Quietus, Sampling::Talk, Sampling::Tile, Sampling::Dammertz, Sampling::Pixel];

#[test]
fn the_picture_does_not_depend_on_the_number_of_threads() {
    for sampling in ADAPTIVE.into_iter().chain([Sampling::Uniform]) {
        for lag in [1, 2] {
            let of = |threads| {
                let threads = NonZeroUsize::new(threads).unwrap();
                let machinery = Machinery { lag, ..Machinery::default() };
                picture(&RenderSettings { threads, machinery, ..settings(75, 41, sampling) })
            };
            let one = of(1);
            for threads in [2, 3, 4, 7] {
                assert!(of(threads) == one, "{sampling:?}, lag {lag}, {threads} threads");
            }
        }
    }
}

#[test]
fn the_machinery_does_not_show_in_the_picture() {
    use quietus::{Checks, Rebuild};
    let of = |checks, rebuild| {
        let machinery = Machinery { checks, rebuild, ..Machinery::default() };
        picture(&RenderSettings { machinery, ..settings(75, 41, Sampling::Quietus) })
    };
    let fast = of(Checks::Published, Rebuild::SummedArea);
    for (checks, rebuild) in [
        (Checks::Published, Rebuild::Resummed),
        (Checks::StripedLocks, Rebuild::SummedArea),
        (Checks::StripedLocks, Rebuild::Resummed),
    ] {
        assert!(of(checks, rebuild) == fast, "{checks:?}, {rebuild:?}");
    }
}

#[test]
fn adaptive_sampling_goes_where_the_noise_is() {
    for sampling in ADAPTIVE.into_iter().chain([Sampling::FreeRunning]) {
        let rendered = draw(&Func(noise), &settings(96, 40, sampling)).unwrap();
        assert_eq!(rendered.stopped_by, StoppedBy::Done, "{sampling:?}");
        let picture = rendered.film.picture(shown_error);
        let mean = |from: u32, to: u32| {
            let counts = (0..40).flat_map(|y| (from..to).map(move |x| (x, y)));
            let sum: u32 = counts.map(|(x, y)| picture.samples[picture.index(x, y)]).sum();
            f64::from(sum) / f64::from(40 * (to - from))
        };
        let (left, right) = (mean(0, 16), mean(80, 96));
        assert!(left > 2.0 * right, "{sampling:?}: {left} on the left, {right} on the right");
        assert!(picture.samples.iter().all(|count| (8..=200).contains(count)), "{sampling:?}");
    }
}

#[test]
fn uniform_sampling_draws_exactly_what_was_asked_for() {
    for spp in [1, 2, 7, 64] {
        let rendered =
            draw(&Func(noise), &RenderSettings { max_samples: spp, ..settings(9, 17, Sampling::Uniform) })
                .unwrap();
        assert!(rendered.film.sample_counts().iter().all(|&count| count == spp), "{spp}");
        let statistics = &rendered.statistics;
        assert_eq!((statistics.samples, statistics.rays), (153 * u64::from(spp), 459 * u64::from(spp)));
        let per_pixel = statistics.per_pixel;
        assert_eq!((per_pixel.spp_p50, per_pixel.spp_p99, per_pixel.spp_max), (spp, spp, spp));
    }
}

#[test]
fn a_crop_shows_the_same_pixels_as_the_full_frame() {
    let full = settings(50, 30, Sampling::Uniform);
    let window = Window { x0: 11, y0: 3, x1: 40, y1: 30 };
    let crop = picture(&RenderSettings { window, ..full.clone() });
    let full = picture(&full);
    for y in window.y0..window.y1 {
        for x in window.x0..window.x1 {
            let (a, b) = (crop.index(x, y), full.index(x, y));
            assert_eq!(crop.beauty[a], full.beauty[b], "({x}, {y})");
            assert_eq!(crop.error[a], full.error[b], "({x}, {y})");
        }
    }
}

#[test]
fn every_sample_is_drawn_once_and_without_gaps() {
    let sum = AtomicU64::new(0);
    let tracer = Func(|run: &PixelWork, index: u32| {
        sum.fetch_add(u64::from(index), Ordering::Relaxed);
        noise(run, index)
    });
    let rendered = draw(&tracer, &settings(40, 24, Sampling::Quietus)).unwrap();
    // Replicates stay equal, so a pixel of n samples has drawn the indices 0..n/2 twice.
    let halves = rendered.film.sample_counts().into_iter().map(|count| u64::from(count / 2));
    let expected: u64 = halves.map(|half| half * (half - 1)).sum();
    assert_eq!(sum.into_inner(), expected);
}

#[test]
fn a_panic_names_its_sample_and_hangs_nobody() {
    for sampling in [Sampling::Quietus, Sampling::FreeRunning, Sampling::Uniform] {
        let tracer = Func(|run: &PixelWork, index: u32| {
            assert!((run.x, run.y, run.replicate, index) != (33, 10, 1, 5), "no such material");
            noise(run, index)
        });
        let Err(RenderError::Panicked(fault)) = draw(&tracer, &settings(64, 64, sampling)) else {
            panic!("{sampling:?}: the panic went unnoticed");
        };
        let expected = Fault { x: 33, y: 10, replicate: 1, index: 5, message: "no such material".into() };
        assert_eq!(fault, expected);
    }
}

#[test]
fn a_pixel_that_is_never_finite_is_left_out_and_reported() {
    let tracer = Func(
        |run: &PixelWork, index: u32| {
            if (run.x, run.y) == (5, 6) { grey(f32::NAN) } else { noise(run, index) }
        },
    );
    for sampling in ADAPTIVE {
        let rendered = draw(&tracer, &settings(24, 24, sampling)).unwrap();
        assert_eq!(rendered.stopped_by, StoppedBy::Done);
        let picture = rendered.film.picture(shown_error);
        let pixel = picture.index(5, 6);
        assert_eq!((picture.samples[pixel], picture.beauty[pixel]), (0, [0.0; 4]));
        assert!(picture.error.iter().all(|error| error.is_finite()));
        let rejected = rendered.film.rejected();
        assert!(rejected.count() >= 8 && rejected.count() == rendered.statistics.nonfinite_samples);
        assert!(rejected.first().all(|sample| (sample.x, sample.y) == (5, 6)));
        // It never counts as converged.
        let converged = rendered.statistics.converged_fraction * f64::from(24 * 24);
        assert!(converged.round() <= f64::from(24 * 24 - 1), "{sampling:?}: {converged} pixels");
    }
}

#[test]
fn time_limit_and_cancelling_end_an_endless_render() {
    let endless = || RenderSettings { max_samples: u32::MAX, ..settings(32, 32, Sampling::Uniform) };
    let start = Instant::now();
    let limit = Duration::from_millis(200);
    let rendered = draw(&Func(noise), &RenderSettings { time_limit: Some(limit), ..endless() }).unwrap();
    assert_eq!(rendered.stopped_by, StoppedBy::TimeLimit);
    assert!(start.elapsed() >= limit);
    assert!(rendered.film.sample_counts().iter().any(|&count| count > 0));

    let cancel = AtomicBool::new(false);
    let mut looks = 0;
    let mut watch = |watched: &quietus_render::Watched<'_>| {
        let progress = watched.progress;
        looks += 1;
        assert!(progress.converged_fraction.is_finite() && progress.samples_per_second >= 0.0);
        cancel.store(looks >= 3, Ordering::Relaxed);
    };
    let control = &mut Control { cancel: &cancel, watch: &mut watch, live: None };
    let rendered = render(&Func(noise), &endless(), control).unwrap();
    assert_eq!(rendered.stopped_by, StoppedBy::Cancelled);
}

/// Time that is up long before every pixel has its minimum leaves no edge: no part of the picture has more samples.
#[test]
fn time_that_ends_in_the_first_round_leaves_the_same_samples_everywhere() {
    let slow = Func(|run: &PixelWork, index: u32| {
        std::thread::sleep(Duration::from_micros(20));
        noise(run, index)
    });
    for sampling in [Sampling::Quietus, Sampling::Uniform] {
        let limit = Some(Duration::from_millis(400));
        let goal = Goal::Limits;
        let settings = RenderSettings {
            time_limit: limit,
            goal,
            min_samples: 64,
            max_samples: 1 << 20,
            ..settings(64, 64, sampling)
        };
        let rendered = draw(&slow, &settings).unwrap();
        assert_eq!(rendered.stopped_by, StoppedBy::TimeLimit);
        let counts = rendered.film.sample_counts();
        let (least, most) = (counts.iter().min().unwrap(), counts.iter().max().unwrap());
        assert!(*most < 64, "{sampling:?}: the machine is too fast for this test");
        // A step is an eighth of the samples there are, and at least two.
        let step = 2 * (most / 16).max(1);
        // A tile may be two passes behind the others.
        assert!(most - least <= 2 * step, "{sampling:?}: {least} to {most}");
        let quarter = |x0: usize, y0: usize| {
            let row = |y: usize| &counts[64 * (y0 + y) + x0..][..32];
            (0..32).flat_map(row).sum::<u32>() as f64 / 1024.0
        };
        let quarters = [quarter(0, 0), quarter(32, 0), quarter(0, 32), quarter(32, 32)];
        let mean = quarters.iter().sum::<f64>() / 4.0;
        // One pixel in four has a step more.
        let uneven = 0.25 * f64::from(step);
        assert!(quarters.iter().all(|q| (q - mean).abs() <= uneven), "{sampling:?}: {quarters:?}");
    }
}

#[test]
fn awkward_sizes_finish() {
    for (width, height) in [(1, 1), (7, 3), (8, 8), (9, 17), (257, 1)] {
        for sampling in ADAPTIVE.into_iter().chain([Sampling::FreeRunning]) {
            let threads = NonZeroUsize::new(16).unwrap();
            let rendered =
                draw(&Func(noise), &RenderSettings { threads, ..settings(width, height, sampling) });
            assert_eq!(rendered.unwrap().stopped_by, StoppedBy::Done, "{width}x{height} {sampling:?}");
        }
    }
}

#[test]
fn settings_out_of_range_are_errors() {
    let settings = settings(8, 8, Sampling::Quietus);
    let empty = Window { x0: 4, y0: 0, x1: 4, y1: 8 };
    assert!(matches!(
        draw(&Func(noise), &RenderSettings { window: empty, ..settings.clone() }),
        Err(RenderError::Layout(_))
    ));
    assert!(matches!(
        draw(&Func(noise), &RenderSettings { goal: Goal::TargetError(f64::NAN), ..settings }),
        Err(RenderError::Settings(_))
    ));
}

/// Root mean square error against the known truth, as displayed.
fn true_noise(rendered: &Rendered, truth: impl Fn(u32, u32) -> f32) -> f64 {
    let picture = rendered.film.picture(quietus_render::shown_error);
    let window = rendered.film.layout().window();
    let pixels = (window.y0..window.y1).flat_map(|y| (window.x0..window.x1).map(move |x| (x, y)));
    let square = pixels
        .zip(&picture.beauty)
        .map(|((x, y), rgb)| (f64::from(rgb[0]).sqrt() - f64::from(truth(x, y)).sqrt()).powi(2));
    (square.sum::<f64>() / window.pixels() as f64).sqrt()
}

#[test]
fn noise_is_reached_with_any_number_of_threads() {
    let asked = |noise, sampling, threads| {
        let goal = Goal::Noise(noise);
        let threads = NonZeroUsize::new(threads).unwrap();
        let settings = RenderSettings { goal, threads, max_samples: 1 << 20, ..settings(48, 40, sampling) };
        draw(&Func(noise_to_the_right), &settings).unwrap()
    };
    for sampling in [Sampling::Quietus, Sampling::Uniform] {
        for noise in [0.012, 0.008, 0.004] {
            let rendered = asked(noise, sampling, 2);
            let truth = true_noise(&rendered, |_, _| 0.25);
            let reached = rendered.noise.unwrap();
            // What is to come out at all scenes; here it is one run of each.
            assert!((0.85..1.15).contains(&(truth / noise)), "{sampling:?}, asked {noise}, {truth}");
            assert!(reached.low / noise < 1.15 && reached.high / noise > 0.85, "{reached:?}");
            assert_eq!((rendered.stopped_by, rendered.bound), (StoppedBy::Done, None));
            let again = asked(noise, sampling, 3);
            assert!(rendered.film.sample_counts() == again.film.sample_counts(), "{sampling:?}");
            assert_eq!(rendered.noise, again.noise, "{sampling:?}");
        }
    }
}

/// The mean square error of the pixels left and right of the middle, against a displayed 0.5, and their mean samples.
fn halves(rendered: &Rendered) -> [[f64; 2]; 2] {
    let window = rendered.film.layout().window();
    let picture = rendered.film.picture(shown_error);
    let middle = window.x0 + window.width() / 2;
    let mut sums = [[0.0; 2]; 2];
    for (place, color) in picture.beauty.iter().enumerate() {
        let side = usize::from(window.x0 + place as u32 % window.width() >= middle);
        sums[side][0] += (f64::from(color[0]).max(0.0).sqrt() - 0.5).powi(2);
        sums[side][1] += f64::from(picture.samples[place]);
    }
    sums.map(|sums| sums.map(|sum| 2.0 * sum / window.pixels() as f64))
}

#[test]
fn weights_move_samples_to_what_matters_and_are_in_the_reported_noise() {
    let (frame, window) = ([64, 48], Window { x0: 16, y0: 8, x1: 64, y1: 48 });
    let even_noise = |run: &PixelWork, index: u32| grey(0.25 * (0.5 + random(run, index)));
    let asked = 0.006;
    let drawn = |weights: Option<[f32; 2]>| {
        // In the middle of the window, which is not that of the frame.
        let value = |[left, right]: [f32; 2]| move |place: u32| if place % 64 < 40 { left } else { right };
        let map = weights.map(|weights| {
            let values = (0..64 * 48).map(value(weights)).collect();
            Arc::new(Weights::new(frame, values).unwrap())
        });
        let base = settings(64, 48, Sampling::Quietus);
        let goal = Goal::Noise(asked);
        draw(
            &Func(even_noise),
            &RenderSettings { frame, window, goal, weights: map, max_samples: 1 << 20, ..base },
        )
        .unwrap()
    };
    let plain = halves(&drawn(None));
    // Samples in proportion to weights: errors 3 times as large where weights are a third, so that weighted ones are alike.
    let rendered = drawn(Some([1.0, 3.0]));
    let weighted = halves(&rendered);
    let ratio = |errors: &[[f64; 2]; 2]| errors[0][0] / errors[1][0];
    // Squared errors of 960 pixels on either side: their ratio has a relative deviation of 2 sqrt(1 / 960), here 5 times.
    let spread = 1.0 + 5.0 * 2.0 / 960.0_f64.sqrt();
    assert!((1.0 / spread..spread).contains(&ratio(&plain)), "{plain:?}");
    let samples = weighted[1][1] / weighted[0][1];
    assert!((ratio(&weighted) / samples - 1.0).abs() < spread - 1.0, "{weighted:?}");
    assert!((2.0..4.0).contains(&samples), "{weighted:?}");
    // The noise is that of weighted errors, over all pixels.
    let truth = (0.5 * (weighted[0][0] + 9.0 * weighted[1][0])).sqrt();
    assert!((0.85..1.15).contains(&(truth / asked)), "{truth}");
    let reached = rendered.noise.unwrap();
    assert!(reached.low / truth < 1.1 && reached.high / truth > 0.9, "{reached:?}, {truth}");
    assert!(rendered.statistics.noise_is_weighted);
    // What does not matter stays at the least.
    let nothing_left = halves(&drawn(Some([0.0, 1.0])));
    assert!(nothing_left[0][1] < 30.0 && nothing_left[1][1] > 60.0, "{nothing_left:?}");
}

#[test]
fn noise_of_aovs_is_reached_too() {
    // Surfaces cover half of the pixels at the left, and their normals turn.
    let edges = |run: &PixelWork, index: u32| {
        let random = random(run, index);
        let covered = run.x < 24 && random < 0.5;
        let normal = if random < 0.25 { Vec3::X } else { Vec3::Y };
        Sample {
            alpha: f32::from(u8::from(covered)),
            normal: normal * f32::from(u8::from(covered)),
            ..grey(0.25 * (0.9 + 0.2 * random))
        }
    };
    for (aov_noise, asked) in [([Some(0.02), None, None], 0.02), ([None, Some(1.0), Some(0.015)], 0.015)] {
        let settings = RenderSettings {
            goal: Goal::Noise(0.02),
            aov_noise,
            max_samples: 1 << 20,
            ..settings(48, 40, Sampling::Quietus)
        };
        let rendered = draw(&Func(edges), &settings).unwrap();
        let picture = rendered.film.picture(shown_error);
        let is_left = |place: usize| place % 48 < 24;
        let squares = (0..48 * 40).map(|place| {
            let truth = f32::from(u8::from(is_left(place)));
            let alpha = f64::from(picture.beauty[place][3] - 0.5 * truth).powi(2);
            let normal =
                (Vec3::from(picture.normal[place]) - Vec3::new(0.25, 0.25, 0.0) * truth).length_squared();
            if aov_noise[0].is_some() { alpha } else { f64::from(normal) / 3.0 }
        });
        let truth = (squares.sum::<f64>() / (48.0 * 40.0)).sqrt();
        eprintln!(
            "DBG {truth} {asked} {:?} {:?} spp {}",
            rendered.statistics.aov_noise,
            rendered.noise,
            picture.samples.iter().map(|&s| f64::from(s)).sum::<f64>() / 1920.0
        );
        // The picture itself would have stopped long before.
        assert!(rendered.noise.unwrap().high < 0.01);
        assert!((0.85..1.15).contains(&(truth / asked)), "{truth} for {asked}");
        let reached = rendered.statistics.aov_noise.iter().filter(|aov| aov.asked == Some(100.0 * asked));
        let reached: Vec<_> = reached.collect();
        assert_eq!(reached.len(), 1);
        assert!(reached[0].low < 115.0 * truth && reached[0].high > 85.0 * truth, "{reached:?}, {truth}");
    }
    let lonely = RenderSettings { aov_noise: [Some(0.1), None, None], ..settings(8, 8, Sampling::Quietus) };
    assert!(matches!(draw(&Func(noise), &lonely), Err(RenderError::AovNoise)));
}

/// As under a lens: a sixteenth of the picture has normals that differ from sample to sample, and its colours do not. Samples
/// go there, so that the whole needs a fraction of what it would if each pixel got as many.
#[test]
fn samples_are_dealt_where_only_an_aov_is_noisy() {
    let is_blurred = |x: u32, y: u32| x < 16 && y < 16;
    let lens = |run: &PixelWork, index: u32| {
        let random = random(run, index);
        let normal = if is_blurred(run.x, run.y) && random < 0.5 { Vec3::X } else { Vec3::Y };
        // Noise of the picture, everywhere the same.
        Sample { alpha: 1.0, normal, ..grey(0.25 * (0.9 + 0.2 * random)) }
    };
    let asked = 0.005;
    let settings = RenderSettings {
        goal: Goal::Noise(0.02),
        aov_noise: [None, None, Some(asked)],
        max_samples: 1 << 20,
        ..settings(64, 64, Sampling::Quietus)
    };
    let rendered = draw(&Func(lens), &settings).unwrap();
    let picture = rendered.film.picture(shown_error);
    let places = || (0..64 * 64_usize).map(|place| (place, is_blurred(place as u32 % 64, place as u32 / 64)));
    let squares = places().map(|(place, is_blurred)| {
        let truth = if is_blurred { Vec3::new(0.5, 0.5, 0.0) } else { Vec3::Y };
        f64::from((Vec3::from(picture.normal[place]) - truth).length_squared()) / 3.0
    });
    let truth = (squares.sum::<f64>() / (64.0 * 64.0)).sqrt();
    let counts = |wanted: bool| {
        let counts =
            places().filter(|&(_, is)| is == wanted).map(|(place, _)| f64::from(picture.samples[place]));
        let counts: Vec<_> = counts.collect();
        counts.iter().sum::<f64>() / counts.len() as f64
    };
    let (blurred, sharp) = (counts(true), counts(false));
    // Two channels of variance 1/4, means over three: as many samples as the blurred ones need at least.
    let needed = 0.5 / 3.0 / 16.0 / (asked * asked);
    assert!(truth < 1.15 * asked, "{truth} for {asked}");
    // Where only the picture is noisy, that is clean long before.
    assert!(
        (blurred + 15.0 * sharp) / 16.0 < 0.5 * needed,
        "{blurred} and {sharp} where {needed} are needed"
    );
}

#[test]
fn weights_of_another_frame_or_for_other_samplings_are_refused() {
    let weights = Some(Arc::new(Weights::new([9, 8], vec![1.0; 72]).unwrap()));
    let settings = |sampling| RenderSettings { weights: weights.clone(), ..settings(8, 8, sampling) };
    let error = |sampling| draw(&Func(noise), &settings(sampling)).err().unwrap().to_string();
    assert_eq!(error(Sampling::Quietus), "expected weights for 8x8, not for 9x8");
    assert_eq!(error(Sampling::Talk), "Talk sampling takes no weights: that takes quietus or uniform");
}

/// Grey with noise that grows to the right.
fn noise_to_the_right(run: &PixelWork, index: u32) -> Sample {
    grey(0.25 * (1.0 + (random(run, index) - 0.5) * run.x as f32 / 24.0))
}

#[test]
fn limits_of_samples_that_keep_the_noise_from_what_was_asked_are_said() {
    let asked = |noise, min_samples, max_samples| {
        let goal = Goal::Noise(noise);
        let settings =
            RenderSettings { goal, min_samples, max_samples, ..settings(48, 40, Sampling::Quietus) };
        draw(&Func(noise_to_the_right), &settings).unwrap()
    };
    let rendered = asked(0.001, 16, 64);
    assert_eq!(rendered.bound, Some(quietus_render::Bound::MaxSamples));
    let noise = rendered.noise.unwrap();
    let deviation = (noise.reached / noise.low).ln() / 1.96;
    let off = (true_noise(&rendered, |_, _| 0.25) / noise.reached).ln();
    // Off by more once in 500,000 times.
    assert!(off.abs() < 4.75 * deviation && deviation < 0.2, "{off} {deviation}");
    let rendered = asked(0.2, 16, 64);
    assert_eq!(rendered.bound, Some(quietus_render::Bound::MinSamples));
    assert!(rendered.film.sample_counts().iter().all(|&count| count < 30));
}

#[test]
fn noise_is_refused_where_it_cannot_be_steered_for() {
    for (sampling, goal) in [(Sampling::Unbiased, Goal::Noise(0.01)), (Sampling::Talk, Goal::Limits)] {
        let settings = RenderSettings { goal, ..settings(8, 8, sampling) };
        assert!(matches!(draw(&Func(noise), &settings), Err(RenderError::Goal { .. })), "{sampling:?}");
    }
    let settings = RenderSettings { goal: Goal::Noise(f64::NAN), ..settings(8, 8, Sampling::Quietus) };
    assert!(matches!(draw(&Func(noise), &settings), Err(RenderError::Noise(_))));
}

#[test]
fn another_noise_can_be_asked_for_while_it_renders() {
    // The render would end at the first goal long before, or never.
    for goal in [Goal::TargetError(1e-9), Goal::Noise(0.0001)] {
        let settings = RenderSettings { goal, max_samples: 1 << 20, ..settings(48, 40, Sampling::Quietus) };
        let live = quietus_render::Live::new(&Layout::full(48, 40).unwrap());
        let mut watch = |_: &quietus_render::Watched<'_>| live.ask_noise(0.006);
        let mut control = Control { cancel: &AtomicBool::new(false), watch: &mut watch, live: Some(&live) };
        let rendered = render(&Func(noise_to_the_right), &settings, &mut control).unwrap();
        let reached = rendered.noise.unwrap();
        assert!(reached.low < 0.006 * 1.15, "{goal:?}: {reached:?}");
        assert_eq!((rendered.stopped_by, rendered.statistics.noise_asked), (StoppedBy::Done, Some(0.6)));
    }
}

/// What somebody did to a render while looking on is drawn again without them: noise asked for while it ran and when it was
/// over, an end by hand in the middle of a round, and more of it afterwards. Alpha is asked for too: what it adds to errors
/// depends on the noise asked for at the time.
#[test]
fn a_render_steered_by_hand_is_drawn_again_bit_for_bit() {
    let started = RenderSettings {
        goal: Goal::Noise(0.01),
        aov_noise: [Some(0.02), None, None],
        max_samples: 1 << 20,
        ..settings(48, 40, Sampling::Quietus)
    };
    let edge = |run: &PixelWork, index: u32| {
        let alpha = f32::from(u8::from(run.x != 20 || random(run, index) < 0.5));
        Sample { alpha, ..noise_to_the_right(run, index) }
    };
    for ends_after in [10_000, 100_000, 400_000] {
        let live = quietus_render::Live::new(&Layout::full(48, 40).unwrap());
        let cancel = AtomicBool::new(false);
        let mut watch = |watched: &quietus_render::Watched<'_>| {
            let samples = watched.progress.samples;
            if samples > ends_after / 4 {
                live.ask_noise(0.002);
            }
            cancel.store(samples > ends_after, std::sync::atomic::Ordering::Relaxed);
        };
        let slow = |run: &PixelWork, index: u32| {
            if index.is_multiple_of(8) {
                std::thread::sleep(std::time::Duration::from_micros(5));
            }
            edge(run, index)
        };
        let control = &mut Control { cancel: &cancel, watch: &mut watch, live: Some(&live) };
        let before = render(&Func(slow), &started, control).unwrap();
        let ended = before.stopped_by;
        let more = RenderSettings { goal: Goal::Noise(0.004), ..started.clone() };
        let control = &mut Control { cancel: &AtomicBool::new(false), watch: &mut |_| (), live: None };
        let rendered = quietus_render::go_on(&Func(edge), &more, before, control, None).unwrap();
        for threads in [1, 3] {
            // Nobody who draws it again has to know what was asked for.
            let threads = NonZeroUsize::new(threads).unwrap();
            let plain = RenderSettings { threads, ..settings(48, 40, Sampling::Quietus) };
            let mut keeping = Keeping { replay: Some(rendered.recording.clone()), ..Keeping::default() };
            let control = &mut Control { cancel: &AtomicBool::new(false), watch: &mut |_| (), live: None };
            let again = quietus_render::render_keeping(&Func(edge), &plain, control, &mut keeping).unwrap();
            assert!(again.film.state() == rendered.film.state(), "{ends_after} samples, {ended:?}");
        }
    }
}
