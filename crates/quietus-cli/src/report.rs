//! What a render says of itself: the `--stats` file, and the metadata of EXR files.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

use clap::ValueEnum;
use glam::Affine3A;
use quietus::{Checks, Rebuild};
use quietus_film::{Metadata, OutputError, write_atomically};
use quietus_render::noise::Aov;
use quietus_render::{Goal, RenderSettings, Rendered, Sampling, Statistics, StoppedBy};
use serde::Serialize;
use serde_json::Value;

use crate::args::RenderArgs;
use crate::plan::Decided;
use crate::timeline::Timeline;
use crate::wishes::{filter_name, filter_parameters};

/// All settings of a render, defaults filled in.
#[derive(Serialize, Clone, Debug)]
pub(crate) struct Settings {
    scene: String,
    scene_in_file: Option<String>,
    variant: Option<String>,
    camera: String,
    camera_to_world: Option<[f32; 12]>,
    environment: Option<String>,
    animation: Option<String>,
    frame: Option<u32>,
    fps: Option<f64>,
    shutter: Option<f64>,
    frame_seed: Option<u64>,
    width: u32,
    height: u32,
    crop: [u32; 4],
    sampling: &'static str,
    noise: Option<f64>,
    weight: Option<String>,
    aov_noise: Option<String>,
    target_error: Option<f64>,
    min_samples: Option<u32>,
    max_samples: Option<u32>,
    time_limit_seconds: Option<f64>,
    max_depth: u32,
    filter: &'static str,
    filter_radius: [f32; 2],
    filter_parameters: BTreeMap<&'static str, f32>,
    exposure: [f32; 3],
    max_component: Option<f32>,
    clamp_indirect: Option<f32>,
    from_scene: Vec<&'static str>,
    seed: u64,
    threads: usize,
    lag: Option<u32>,
    regions: u32,
    checks: &'static str,
    rebuild: &'static str,
}

impl Settings {
    /// Gathers what was decided.
    pub(crate) fn new(args: &RenderArgs, decided: &Decided, camera: &str) -> Self {
        let Decided { settings, look, followed } = decided;
        let adaptive = settings.sampling != Sampling::Uniform;
        let window = settings.window;
        let path = |path: &Path| path.display().to_string();
        Self {
            scene: args.scene.as_deref().map_or_else(|| "built-in".to_owned(), path),
            scene_in_file: args.scene_in_file.clone(),
            variant: args.variant.clone(),
            camera: camera.to_owned(),
            camera_to_world: None,
            environment: args.env.as_deref().map(path),
            animation: None,
            frame: None,
            fps: None,
            shutter: None,
            frame_seed: None,
            width: settings.frame[0],
            height: settings.frame[1],
            crop: [window.x0, window.y0, window.x1, window.y1],
            sampling: sampling_name(settings.sampling),
            noise: noise(settings.goal),
            weight: args.weight.as_deref().map(path),
            aov_noise: aov_noise(settings),
            target_error: target_error(settings.goal),
            min_samples: adaptive.then_some(settings.min_samples),
            max_samples: (settings.max_samples < u32::MAX).then_some(settings.max_samples),
            time_limit_seconds: settings.time_limit.map(|limit| limit.as_secs_f64()),
            max_depth: look.max_depth,
            filter: filter_name(look.filter.shape),
            filter_radius: look.filter.radius.to_array(),
            filter_parameters: filter_parameters(look.filter.shape).into_iter().collect(),
            exposure: look.exposure.to_array(),
            max_component: (look.max_component < f32::INFINITY).then_some(look.max_component),
            clamp_indirect: args.clamp_indirect.filter(|limit| limit.is_finite()),
            from_scene: followed.iter().map(|wish| wish.name).collect(),
            seed: args.seed,
            threads: settings.threads.get(),
            lag: (settings.sampling != Sampling::FreeRunning).then_some(args.lag),
            regions: settings.machinery.regions_per_axis,
            checks: match settings.machinery.checks {
                Checks::StripedLocks => "locks",
                Checks::Published => "published",
            },
            rebuild: match settings.machinery.rebuild {
                Rebuild::Resummed => "resummed",
                Rebuild::SummedArea => "summed-area",
            },
        }
    }

    /// The same for a frame of the animation that is named.
    pub(crate) fn with_moment(self, moment: Option<(&Timeline, u32, &str)>) -> Self {
        let Some((timeline, frame, animation)) = moment else { return self };
        let (fps, shutter) = (Some(timeline.fps), Some(timeline.shutter));
        let animation = Some(animation.to_owned());
        let frame_seed = Some(timeline.seed_of(self.seed, frame));
        Self { animation, frame: Some(frame), fps, shutter, frame_seed, ..self }
    }

    /// The same after somebody who watched it asked for another part, another noise or, with `camera_to_world`, another
    /// place of the camera.
    pub(crate) fn steer(&mut self, settings: &RenderSettings, camera_to_world: Option<&Affine3A>) {
        let window = settings.window;
        self.crop = [window.x0, window.y0, window.x1, window.y1];
        (self.noise, self.target_error) = (noise(settings.goal), target_error(settings.goal));
        self.time_limit_seconds = settings.time_limit.map(|limit| limit.as_secs_f64());
        self.camera_to_world = camera_to_world.map(Affine3A::to_cols_array);
    }

    /// Name and value of every setting that is set, and the version.
    pub(crate) fn metadata(&self) -> Metadata {
        let mut metadata = vec![("version".to_owned(), VERSION.to_owned())];
        if let Ok(Value::Object(settings)) = serde_json::to_value(self) {
            let set = settings.into_iter().filter(|(_, value)| !value.is_null());
            metadata.extend(set.map(|(name, value)| match value {
                Value::String(text) => (name, text),
                other => (name, other.to_string()),
            }));
        }
        metadata
    }
}

/// Names and percents.
fn aov_noise(settings: &RenderSettings) -> Option<String> {
    let asked = Aov::ALL.into_iter().zip(settings.aov_noise);
    let asked = asked.filter_map(|(aov, noise)| Some(format!("{}={}", aov.name(), 100.0 * noise?)));
    let asked = asked.collect::<Vec<_>>().join(",");
    (!asked.is_empty()).then_some(asked)
}

const VERSION: &str = env!("CARGO_PKG_VERSION");

fn noise(goal: Goal) -> Option<f64> {
    match goal {
        Goal::Noise(noise) => Some(100.0 * noise),
        Goal::TargetError(_) | Goal::Limits => None,
    }
}

fn target_error(goal: Goal) -> Option<f64> {
    match goal {
        Goal::TargetError(error) => Some(error),
        Goal::Noise(_) | Goal::Limits => None,
    }
}

pub(crate) fn sampling_name(sampling: Sampling) -> &'static str {
    match sampling {
        Sampling::Quietus => "quietus",
        Sampling::Unbiased => "unbiased",
        Sampling::Talk => "talk",
        Sampling::FreeRunning => "free-running",
        Sampling::Tile => "tile",
        Sampling::Dammertz => "dammertz",
        Sampling::Pixel => "pixel",
        Sampling::Uniform => "uniform",
    }
}

/// What the command line calls a value.
pub(crate) fn name(value: impl ValueEnum) -> String {
    value.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}

/// What became of a render, beside its settings in EXR files.
pub(crate) fn result_metadata(rendered: &Rendered) -> Metadata {
    let Statistics { noise_asked, noise_reached, noise_low, noise_high, .. } = rendered.statistics;
    let noise = [
        ("noise_asked", noise_asked),
        ("noise_reached", noise_reached),
        ("noise_low", noise_low),
        ("noise_high", noise_high),
    ];
    let noise = noise.into_iter().filter_map(|(name, value)| Some((name.to_owned(), value?.to_string())));
    let ending = ("stopped_by".to_owned(), stopped_by(rendered.stopped_by).to_owned());
    let aovs = rendered.statistics.aov_noise.iter().flat_map(|aov| {
        let values = [
            ("asked", aov.asked),
            ("reached", Some(aov.reached)),
            ("low", Some(aov.low)),
            ("high", Some(aov.high)),
        ];
        values
            .into_iter()
            .filter_map(|(what, value)| Some((format!("{}_noise_{what}", aov.name), value?.to_string())))
    });
    std::iter::once(ending).chain(noise).chain(aovs).collect()
}

/// What files call the end of a render.
pub(crate) fn stopped_by(ending: StoppedBy) -> &'static str {
    match ending {
        StoppedBy::Done => "done",
        StoppedBy::TimeLimit => "time",
        StoppedBy::Cancelled => "interrupt",
    }
}

/// The object in a `--stats` file; `docs/stats.md` explains every key.
#[derive(Serialize)]
struct StatsFile<'a> {
    version: &'static str,
    seed: u64,
    stopped_by: &'static str,
    load_seconds: f64,
    #[serde(flatten)]
    statistics: &'a Statistics,
    settings: &'a Settings,
}

/// Writes the `--stats` file.
///
/// # Errors
/// When it cannot be written.
pub(crate) fn write_stats(
    path: &Path,
    settings: &Settings,
    load_seconds: f64,
    rendered: &Rendered,
) -> Result<(), OutputError> {
    let stopped_by = stopped_by(rendered.stopped_by);
    let statistics = &rendered.statistics;
    let seed = settings.seed;
    let stats = StatsFile { version: VERSION, seed, stopped_by, load_seconds, statistics, settings };
    write_atomically(path, |writer| {
        let failed = |source| OutputError::Write { path: path.to_owned(), source };
        serde_json::to_writer_pretty(&mut *writer, &stats).map_err(|error| failed(error.into()))?;
        writer.write_all(b"\n").map_err(failed)
    })
}
