//! Live renders: what a method costs in CPU time, and whether it does what its replay says.
//!
//! Run k of a bank is the live render with the bank's seed plus k. Its samples are rounded as banks round them, so
//! that counts and picture must be the replay's, bit for bit. Times are CPU time of the process: of one method after
//! the other within a round, and round after round, so that a machine that slows down slows all of them.

use std::{num::NonZeroUsize, sync::atomic::AtomicBool};

use glam::Vec3;
use quietus::Settings;
use quietus_film::Window;
use quietus_render::{
    Control, Goal, Machinery, PathTracer, RenderSettings, Sampling, Tracer, render, shown_error,
};
use quietus_trace::tile::{PixelWork, Sample, SampleSink, TileCounts};
use serde::{Deserialize, Serialize};

use crate::{
    Bank, EvalError, Method, Picture, Subject, packed, replay, runs::independent_runs, sweep::Series,
};

/// What live renders of a method at a budget were found to take.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Live {
    /// Renders.
    pub renders: u32,
    /// How many of them had the counts and the picture of their replay, bit for bit.
    pub confirmed: u32,
    /// CPU seconds of each.
    pub cpu_seconds: Vec<f64>,
    /// Samples of each.
    pub samples: Vec<u64>,
}

impl Live {
    /// CPU seconds of a sample in each render, everything included.
    pub fn seconds_per_sample(&self) -> Vec<f64> {
        self.cpu_seconds.iter().zip(&self.samples).map(|(t, &n)| t / n as f64).collect()
    }
}

/// Renders every series of a sweep live, `renders` times with the seeds of the first runs; the same order as `sweep`.
///
/// # Errors
/// Where the scene cannot be drawn, the bank has fewer runs, or the system does not tell CPU time.
pub fn live(
    subject: &Subject,
    bank: &Bank,
    sweep: &[Series],
    renders: u32,
    mut tell: impl FnMut(f64),
) -> Result<Vec<Live>, EvalError> {
    let most = sweep.iter().map(|s| independent_runs(bank.spec().streams, s.settings.replicates)).min();
    if renders == 0 || most.is_some_and(|most| renders > most) {
        let most = most.unwrap_or(0);
        return Err(EvalError::Request(format!(
            "{renders} live renders were asked for: expected 1 to {most}"
        )));
    }
    let none = Live { renders, confirmed: 0, cpu_seconds: Vec::new(), samples: Vec::new() };
    let mut all = vec![none; sweep.len()];
    for run in 0..renders {
        for (i, (series, live)) in sweep.iter().zip(&mut all).enumerate() {
            let drawn = render_live(subject, bank, series.method, &series.settings, run.into())?;
            let replayed = replay(bank, &series.settings, run.into())?;
            let same = drawn.counts == replayed.counts && drawn.picture == replayed.picture;
            live.confirmed += u32::from(same);
            live.cpu_seconds.push(drawn.cpu_seconds);
            live.samples.push(drawn.samples);
            tell((f64::from(run) + (i + 1) as f64 / sweep.len() as f64) / f64::from(renders));
        }
    }
    Ok(all)
}

/// A picture that was drawn.
struct Drawn {
    picture: Picture,
    counts: Vec<u32>,
    samples: u64,
    cpu_seconds: f64,
}

/// Draws on one thread: then also the free-running mode has one outcome.
fn render_live(
    subject: &Subject,
    bank: &Bank,
    method: Method,
    settings: &Settings,
    run: u64,
) -> Result<Drawn, EvalError> {
    let look = &bank.spec().look;
    let view = subject.view(look, bank.spec().seed.wrapping_add(run))?;
    let tracer = Rounding(PathTracer { scene: &subject.scene, view: &view });
    let asked = render_settings(method, settings);
    let mut control = Control { cancel: &AtomicBool::new(false), watch: &mut |_| (), live: None };
    let rendered = render(&tracer, &asked, &mut control)
        .map_err(|e| EvalError::Request(format!("the live render of {} failed: {e}", method.name())))?;
    let picture = rendered.film.picture(shown_error);
    let rgb = picture.beauty.iter().map(|c| [c[0], c[1], c[2]]).collect();
    let no_clock = || EvalError::Request("the system does not tell the CPU time of a process".to_owned());
    Ok(Drawn {
        picture: Picture { width: look.width, height: look.height, rgb },
        counts: picture.samples,
        samples: rendered.statistics.samples,
        cpu_seconds: rendered.statistics.cpu_seconds.ok_or_else(no_clock)?,
    })
}

fn render_settings(method: Method, settings: &Settings) -> RenderSettings {
    let (width, height) = (settings.width, settings.height);
    RenderSettings {
        frame: [width, height],
        window: Window { x0: 0, y0: 0, x1: width, y1: height },
        sampling: match method {
            Method::Uniform => Sampling::Uniform,
            Method::Tile => Sampling::Tile,
            Method::Dammertz => Sampling::Dammertz,
            Method::Pixel => Sampling::Pixel,
            Method::Talk => Sampling::Talk,
            Method::FreeRunning => Sampling::FreeRunning,
            Method::Quietus => Sampling::Quietus,
            Method::Unbiased => Sampling::Unbiased,
        },
        goal: Goal::TargetError(settings.target_error),
        min_samples: settings.min_samples,
        max_samples: settings.max_samples,
        time_limit: None,
        threads: NonZeroUsize::MIN,
        machinery: Machinery {
            regions_per_axis: settings.regions_per_axis,
            checks: settings.checks,
            rebuild: settings.rebuild,
            ..Machinery::default()
        },
        weights: None,
        aov_noise: [None; 3],
    }
}

/// The path tracer with samples rounded as banks round them.
struct Rounding<'a>(PathTracer<'a>);

struct RoundingSink<'a, S>(&'a mut S);

impl<S: SampleSink> SampleSink for RoundingSink<'_, S> {
    fn add(&mut self, work: &PixelWork, index: u32, sample: &Sample) {
        let rounded = match packed::pack(sample.radiance, sample.alpha) {
            Ok(packed::REJECTED) | Err(_) => *sample,
            Ok(word) => {
                let [r, g, b, alpha] = packed::unpack(word);
                Sample { radiance: Vec3::new(r, g, b), alpha, ..*sample }
            }
        };
        self.0.add(work, index, &rounded);
    }
}

impl Tracer for Rounding<'_> {
    fn render_tile(&self, work: &[PixelWork], sink: &mut impl SampleSink) -> TileCounts {
        self.0.render_tile(work, &mut RoundingSink(sink))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BankSpec, Look, bank::record_in_memory};

    /// What makes replays worth anything: run k of a bank is the live render with the bank's seed plus k, sample
    /// by sample and decision by decision. Same counts, same picture, bit for bit.
    #[test]
    fn a_replay_is_the_live_render() {
        let subject = Subject::embedded().unwrap();
        let look = Look { filter: "box".into(), ..Look::new(36, 20) };
        let spec = BankSpec { scene: "embedded".into(), look, streams: 6, samples: 32, seed: 0 };
        let bank = record_in_memory(&subject, &spec).unwrap();
        for method in Method::ALL {
            let settings =
                method.apply(&Settings { max_samples: 64, target_error: 0.01, ..Settings::new(36, 20) });
            let replayed = replay(&bank, &settings, 2).unwrap();
            let drawn = render_live(&subject, &bank, method, &settings, 2).unwrap();
            assert_eq!(drawn.counts, replayed.counts, "{method:?}");
            assert_eq!(drawn.picture, replayed.picture, "{method:?}");
            assert_eq!(drawn.samples, replayed.samples);
            let stops = method != Method::Uniform && method != Method::Dammertz;
            assert_eq!(replayed.counts.iter().any(|&n| n < 64), stops, "{method:?}");
        }
    }
}
