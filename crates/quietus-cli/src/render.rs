//! `quietus render`: from the scene to the pictures.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use quietus_film::{Layout, Metadata, Window};
use quietus_render::{
    Control, Fault, Goal, PathTracer, RenderError, RenderSettings, Rendered, StoppedBy, Watched, go_on,
    noise::measure_noise, render_keeping,
};
use quietus_trace::desc::{Camera, SceneDesc};
use quietus_trace::scene::Scene;
use quietus_trace::view::{View, ViewError};

use crate::args::RenderArgs;
use crate::closing::{ending, summary, warn_of_rejected};
use crate::error::{Ending, Failure};
use crate::interrupt;
use crate::outputs::Outputs;
use crate::plan::{Decided, Look, Plan};
use crate::progress::{Measure, ProgressArg};
use crate::report::{Settings, name};
use crate::say;
use crate::source::{Source, scene_name};
use crate::viewing::{Viewing, goes_by_noise};
use crate::watching::{Onlookers, Subject};
use crate::weight;

/// Everything a picture needs, loaded and checked.
pub(crate) struct Ready {
    pub(crate) scene: Scene,
    pub(crate) camera: Camera,
    /// Before anybody moved it.
    pub(crate) scene_camera: Camera,
    view: View,
    pub(crate) settings: RenderSettings,
    look: Look,
    report: Settings,
    load_seconds: f64,
    /// Of its random numbers.
    seed: u64,
    /// Whether another view was asked for meanwhile than the scene and the command line say.
    is_changed: bool,
}

impl Ready {
    /// What decides the picture, besides the content of files.
    fn identity(&self) -> Metadata {
        let Window { x0, y0, x1, y1 } = self.settings.window;
        let mut settings = self.report.metadata();
        settings.retain(|(name, _)| name != "crop" && name != "noise");
        settings.push(("crop".to_owned(), format!("{x0},{y0},{x1},{y1}")));
        if let Goal::Noise(noise) = self.settings.goal {
            settings.push(("noise".to_owned(), (100.0 * noise).to_string()));
        }
        settings.push(("pose of the camera".to_owned(), format!("{:?}", self.camera)));
        settings
    }

    /// What `camera` sees in a picture of another size, everything else as it is.
    pub(crate) fn view_of(
        &self,
        args: &RenderArgs,
        camera: &Camera,
        frame: [u32; 2],
    ) -> Result<View, ViewError> {
        view(args, camera, frame, &self.look, self.seed)
    }

    /// Takes another camera, and says whether it makes sense.
    pub(crate) fn look_through(&mut self, args: &RenderArgs, camera: Camera) -> bool {
        let Ok(view) = self.view_of(args, &camera, self.settings.frame) else { return false };
        (self.view, self.camera, self.is_changed) = (view, camera, true);
        self.steered();
        true
    }

    /// Goes for this noise, as a share of white, and says whether that is possible.
    pub(crate) fn ask_for_noise(&mut self, noise: f64) -> bool {
        let can_steer = goes_by_noise(self.settings.sampling);
        if can_steer {
            self.settings.goal = Goal::Noise(noise);
            self.steered();
        }
        can_steer
    }

    /// What files say of the settings is to be true.
    fn steered(&mut self) {
        let is_moved = self.camera.to_world != self.scene_camera.to_world;
        self.report.steer(&self.settings, is_moved.then_some(&self.camera.to_world));
    }

    /// Draws another part of the frame, and says whether it has one.
    pub(crate) fn crop(&mut self, window: Window) -> bool {
        let is_sound = Layout::new(self.settings.frame, window, 2).is_ok();
        if is_sound {
            (self.settings.window, self.is_changed) = (window, true);
            self.steered();
        }
        is_sound
    }
}

/// Runs `quietus render`, or with `stays` `quietus view`, which goes on when the picture is done.
///
/// # Errors
/// Anything that keeps a picture from being drawn and written.
pub(crate) fn run(args: &RenderArgs, stays: bool) -> Result<Ending, Failure> {
    if args.watching.progress == ProgressArg::Json {
        say::speak_json();
    }
    let plan = Plan::new(args)?;
    args.keeping.check(&plan)?;
    let start = Instant::now();
    let mut source = tracing::info_span!("open").in_scope(|| Source::open(args, plan.timeline.as_ref()))?;
    let cancel = interrupt::watch()?;
    let mut viewing = Viewing::start(args, stays)?;
    let Some(timeline) = &plan.timeline else {
        let mut ready = prepare(args, &plan, &mut source, None, start)?;
        return picture(args, &plan, &mut ready, None, &cancel, viewing.as_mut());
    };
    let mut start = Some(start);
    for frame in timeline.frames() {
        let start = start.take().unwrap_or_else(Instant::now);
        let mut ready = prepare(args, &plan, &mut source, Some(frame), start)?;
        let ending = picture(args, &plan, &mut ready, Some(frame), &cancel, viewing.as_mut())?;
        if ending == Ending::Interrupted {
            return Ok(Ending::Interrupted);
        }
    }
    Ok(Ending::Success)
}

/// Draws one picture and writes it.
fn picture(
    args: &RenderArgs,
    plan: &Plan,
    ready: &mut Ready,
    frame: Option<u32>,
    cancel: &AtomicBool,
    viewing: Option<&mut Viewing>,
) -> Result<Ending, Failure> {
    if let Some(viewing) = viewing {
        return viewing.picture(args, plan, ready, frame, cancel);
    }
    let rendered = draw(args, plan, ready, frame, Audience { cancel, viewing: None }, None)?;
    keep(args, plan, ready, frame, &rendered)
}

/// Writes what was drawn, and says so.
///
/// # Errors
/// When it cannot be written.
pub(crate) fn keep(
    args: &RenderArgs,
    plan: &Plan,
    ready: &Ready,
    frame: Option<u32>,
    rendered: &Rendered,
) -> Result<Ending, Failure> {
    warn_of_rejected(&rendered.film.rejected(), args.seed);
    let writing = tracing::info_span!("write").entered();
    let written = outputs(args, plan, ready, frame).write(rendered);
    drop(writing);
    say::outcome(summary(plan, frame, rendered, &written.pictures));
    say::event("end", &ending(frame, rendered, &written.pictures));
    written.check()?;
    Ok(match rendered.stopped_by {
        StoppedBy::Cancelled => Ending::Interrupted,
        StoppedBy::Done | StoppedBy::TimeLimit => Ending::Success,
    })
}

/// Makes the scene of `frame` ready, whose loading began at `start`.
fn prepare(
    args: &RenderArgs,
    plan: &Plan,
    source: &mut Source,
    frame: Option<u32>,
    start: Instant,
) -> Result<Ready, Failure> {
    let moment = plan.timeline.as_ref().zip(frame);
    let parse = tracing::info_span!("parse").entered();
    let desc = source.scene(moment.map(|(timeline, frame)| timeline.shutter(frame)))?;
    let camera = pick_camera(&desc, args.camera.as_deref())?;
    let decided = plan.decide(args, camera, &desc.picture)?;
    let animation = source.animation_name().unwrap_or_default();
    let report = Settings::new(args, &decided, &camera.name)
        .with_moment(moment.map(|(timeline, frame)| (timeline, frame, animation)));
    let Decided { mut settings, look, followed } = decided;
    settings.weights = args.weight.as_deref().map(|path| weight::read(path, settings.frame)).transpose()?;
    if !followed.is_empty() {
        let texts: Vec<_> = followed.into_iter().map(|wish| wish.text).collect();
        say::aside(format_args!("{} asks for: {}", scene_name(args), texts.join("; ")));
    }
    let unusable = |error: String| Failure::input(format!("{}: {error}", scene_name(args)));
    drop(parse);
    let seconds = start.elapsed().as_secs_f64();
    tracing::info!("read {} in {seconds:.2} s", scene_name(args));
    let build = tracing::info_span!("build").entered();
    let seed = moment.map_or(args.seed, |(timeline, frame)| timeline.seed_of(args.seed, frame));
    let view =
        view(args, camera, settings.frame, &look, seed).map_err(|error| unusable(error.to_string()))?;
    let scene = Scene::build(&desc).map_err(|error| unusable(error.to_string()))?;
    drop(build);
    let load_seconds = start.elapsed().as_secs_f64();
    tracing::info!("built it in {:.2} s", load_seconds - seconds);
    let camera = camera.clone();
    let scene_camera = camera.clone();
    let is_changed = false;
    Ok(Ready { scene, camera, scene_camera, view, settings, look, report, load_seconds, seed, is_changed })
}

fn view(
    args: &RenderArgs,
    camera: &Camera,
    frame: [u32; 2],
    look: &Look,
    seed: u64,
) -> Result<View, ViewError> {
    View::new(camera, frame, look.filter, look.max_depth, seed)?
        .with_exposure(look.exposure, look.max_component)?
        .with_indirect_limit(args.clamp_indirect.unwrap_or(f32::INFINITY))
}

fn pick_camera<'a>(scene: &'a SceneDesc, name: Option<&str>) -> Result<&'a Camera, Failure> {
    let found = match name {
        None => scene.cameras.first(),
        Some(name) => scene.cameras.iter().find(|camera| camera.name == name),
    };
    found.ok_or_else(|| {
        let names: Vec<_> = scene.cameras.iter().map(|camera| format!("`{}`", camera.name)).collect();
        let name = name.unwrap_or_default();
        Failure::usage(format!("no camera is called `{name}`; the scene has {}", names.join(", ")))
    })
}

/// Who looks on, and may end a render.
pub(crate) struct Audience<'a> {
    /// Set by Ctrl-C.
    pub(crate) cancel: &'a AtomicBool,
    /// Browsers.
    pub(crate) viewing: Option<&'a mut Viewing>,
}

/// Draws, going on from `before` where there is something, and shows how far it is.
///
/// # Errors
/// What [`render`] says.
pub(crate) fn draw(
    args: &RenderArgs,
    plan: &Plan,
    ready: &Ready,
    frame: Option<u32>,
    Audience { cancel, mut viewing }: Audience<'_>,
    before: Option<Rendered>,
) -> Result<Rendered, Failure> {
    let tracer = PathTracer { scene: &ready.scene, view: &ready.view };
    let settings = &ready.settings;
    let subject = Subject {
        name: format!("{}{}", scene_name(args), frame.map_or_else(String::new, |f| format!(", frame {f}"))),
        measure: measure(settings),
        outputs: outputs(args, plan, ready, frame).pictures,
        metadata: ready.report.metadata(),
    };
    let named = |path: &PathBuf| plan.name(path, frame);
    let is_first = before.is_none() && !ready.is_changed;
    let mut keeping = args.keeping.keeping(named, ready.identity(), &settings.layout()?, is_first)?;
    let mut onlookers = Onlookers::new(&args.watching, subject);
    let (stop, live) = viewing.as_ref().map(|viewing| viewing.handles()).unzip();
    let mut watch = |watched: &Watched<'_>| {
        onlookers.look(watched);
        if let Some(viewing) = &mut viewing {
            viewing.watch(watched, cancel);
        }
    };
    let (stop, live) = (stop.as_deref().unwrap_or(cancel), live.flatten());
    let control = &mut Control { cancel: stop, watch: &mut watch, live: live.as_deref() };
    let rendering = tracing::info_span!("render").entered();
    let outcome = match before {
        Some(before) => go_on(&tracer, settings, before, control, keeping.keeper.as_mut()),
        None => render_keeping(&tracer, settings, control, &mut keeping),
    };
    drop(rendering);
    onlookers.leave(outcome.as_ref().ok().map(|rendered| &rendered.film));
    let mut rendered = outcome.map_err(|error| match error {
        RenderError::Panicked(fault) => {
            Failure::internal(fault_message(args, settings, ready.look.max_depth, frame, &fault))
        }
        other => other.into(),
    })?;
    // Whose time is up, or who is interrupted, wants the picture now.
    if rendered.stopped_by == StoppedBy::Done
        && rendered.noise.is_none()
        && let Some(noise) = measure_noise(&tracer, &rendered, settings.threads, stop)
    {
        rendered.statistics.set_noise(noise);
    }
    args.keeping.write_recording(named, ready.identity(), &rendered.recording)?;
    Ok(rendered)
}

/// What comes closest to the share of the work done.
fn measure(settings: &RenderSettings) -> Measure {
    match (settings.goal, settings.time_limit) {
        (Goal::Noise(_), _) => Measure::Noise,
        (Goal::TargetError(_), _) => Measure::Converged,
        (Goal::Limits, Some(limit)) if settings.max_samples == u32::MAX => Measure::Time(limit),
        (Goal::Limits, _) => {
            Measure::Samples(settings.window.pixels() as f64 * f64::from(settings.max_samples))
        }
    }
}

/// Names the sample that panicked, and the command that draws its pixel alone up to that sample. Replicates take
/// turns, so sample i of any of R replicates is drawn once the pixel has R (i + 1) samples.
fn fault_message(
    args: &RenderArgs,
    settings: &RenderSettings,
    max_depth: u32,
    frame: Option<u32>,
    fault: &Fault,
) -> String {
    let Fault { x, y, replicate, index, message } = fault;
    let mut command = vec!["quietus render".to_owned()];
    if args.fixed_seed {
        command.push("--fixed-seed".to_owned());
    }
    let mut flag = |name: &str, value: String| command.push(format!("{name}{}", quoted(&value)));
    if let Some(scene) = &args.scene {
        flag("", scene.display().to_string());
    }
    if let Some(camera) = &args.camera {
        flag("--camera ", camera.clone());
    }
    if let Some(scene) = &args.scene_in_file {
        flag("--scene ", scene.clone());
    }
    if let Some(variant) = &args.variant {
        flag("--variant ", variant.clone());
    }
    if let Some(env) = &args.env {
        flag("--env ", env.display().to_string());
    }
    if let Some(frame) = frame {
        flag("--frame ", frame.to_string());
        args.fps.iter().for_each(|fps| flag("--fps ", fps.to_string()));
        args.shutter.iter().for_each(|shutter| flag("--shutter ", shutter.to_string()));
        args.animation.iter().for_each(|animation| flag("--animation ", animation.clone()));
    }
    flag("--size ", format!("{}x{}", settings.frame[0], settings.frame[1]));
    flag("--crop ", format!("{x},{y},{},{}", x + 1, y + 1));
    flag("--spp ", (2 * (u64::from(*index) + 1)).to_string());
    flag("--max-depth ", max_depth.to_string());
    if let Some(filter) = args.filter {
        flag("--filter ", name(filter));
    }
    if let Some(exposure) = args.exposure() {
        flag("--exposure ", exposure.to_string());
    }
    if let Some(limit) = args.max_component {
        flag("--max-component ", limit.to_string());
    }
    if let Some(limit) = args.clamp_indirect {
        flag("--clamp-indirect ", limit.to_string());
    }
    flag("--seed ", args.seed.to_string());
    flag("--threads ", "1".to_owned());
    flag("-o ", "replay.exr".to_owned());
    format!(
        "the tracer panicked at pixel ({x}, {y}), replicate {replicate}, sample {index}, seed {}: {message}\n\
         this draws the pixel alone: {}",
        args.seed,
        command.join(" ")
    )
}

/// For a POSIX shell.
fn quoted(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./,+:@%".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        return text.to_owned();
    }
    format!("'{}'", text.replace('\'', r"'\''"))
}

/// The files that are asked for.
fn outputs<'a>(args: &RenderArgs, plan: &Plan, ready: &'a Ready, frame: Option<u32>) -> Outputs<'a> {
    let named = |path: &PathBuf| plan.name(path, frame);
    Outputs {
        pictures: plan.outputs.iter().map(|(path, format)| (named(path), *format)).collect(),
        tree: args.tree.as_ref().map(named),
        stats: args.stats.as_ref().map(named),
        settings: &ready.report,
        load_seconds: ready.load_seconds,
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use quietus_trace::desc::PictureDefaults;

    use super::*;
    use crate::args::{Cli, Command};

    fn parse(words: &[&str]) -> RenderArgs {
        match Cli::try_parse_from(words).unwrap().command {
            Some(Command::Render(args)) => *args,
            other => panic!("not a render: {other:?}"),
        }
    }

    #[test]
    fn a_panic_comes_with_the_command_that_draws_its_pixel_alone() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("a.png");
        let args = parse(&[
            "quietus",
            "render",
            "my scene.glb",
            "--seed",
            "42",
            "--max-depth",
            "5",
            "--filter",
            "box",
            "-o",
            out.to_str().unwrap(),
        ]);
        let camera = quietus_scene::embedded().cameras.remove(0);
        let picture = PictureDefaults::default();
        let decided = Plan::new(&args).unwrap().decide(&args, &camera, &picture).unwrap();
        let fault = Fault { x: 7, y: 9, replicate: 1, index: 20, message: "oh".to_owned() };
        let message = fault_message(&args, &decided.settings, decided.look.max_depth, None, &fault);
        let expected = "the tracer panicked at pixel (7, 9), replicate 1, sample 20, seed 42: oh\n\
                        this draws the pixel alone: quietus render 'my scene.glb' --size 640x360 --crop 7,9,8,10 \
                        --spp 42 --max-depth 5 --filter box --seed 42 --threads 1 -o replay.exr";
        assert_eq!(message, expected);
        let command = message.rsplit(": ").next().unwrap().replace("'my scene.glb'", "scene.glb");
        let replay = parse(&command.split(' ').collect::<Vec<_>>());
        assert_eq!(replay.crop, Some(Window { x0: 7, y0: 9, x1: 8, y1: 10 }));
        assert_eq!((replay.spp, replay.seed, replay.filter), (Some(42), 42, args.filter));
    }

    #[test]
    fn the_command_printed_draws_the_sample_that_panicked() {
        let args = parse(&["quietus", "render", "--size", "24x16", "--seed", "3", "--camera", "main"]);
        let (plan, fault) =
            (Plan::new(&args).unwrap(), Fault { x: 7, y: 9, replicate: 1, index: 20, message: "oh".into() });
        let prepared = |args: &RenderArgs, plan: &Plan| {
            let mut source = Source::open(args, None).unwrap();
            prepare(args, plan, &mut source, None, Instant::now()).unwrap()
        };
        let ready = prepared(&args, &plan);
        let message = fault_message(&args, &ready.settings, ready.look.max_depth, None, &fault);
        let replay = parse(&message.rsplit(": ").next().unwrap().split(' ').collect::<Vec<_>>());
        let ready = prepared(&replay, &Plan::new(&replay).unwrap());
        let plan = Plan::new(&replay).unwrap();
        let cancel = AtomicBool::new(false);
        let audience = Audience { cancel: &cancel, viewing: None };
        let rendered = draw(&replay, &plan, &ready, None, audience, None).unwrap();
        // Two replicates of 21 samples each: the last one is number 20.
        assert_eq!((rendered.film.sample_counts(), rendered.statistics.samples), (vec![42], 42));
        assert_eq!(ready.settings.window, Window { x0: 7, y0: 9, x1: 8, y1: 10 });
    }

    #[test]
    fn names_are_quoted_for_the_shell_where_needed() {
        assert_eq!(quoted("a/b-1.glb"), "a/b-1.glb");
        assert_eq!(quoted("it's"), r"'it'\''s'");
        assert_eq!(quoted(""), "''");
    }
}
