//! `quietus render`: from the scene to the pictures.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use quietus_film::{Layout, Metadata, Window};
use quietus_render::{
    Control, Goal, PathTracer, RenderError, RenderSettings, Rendered, StoppedBy, Watched, go_on,
    noise::measure_noise, render_keeping,
};
use quietus_trace::desc::{Camera, SceneDesc};
use quietus_trace::scene::Scene;
use quietus_trace::view::{View, ViewError};

use crate::args::RenderArgs;
use crate::closing::{ending, summary, warn_of_rejected};
use crate::error::{Ending, Failure};
use crate::interrupt::Interrupts;
use crate::outputs::Outputs;
use crate::plan::{Decided, Look, Plan};
use crate::progress::{Measure, ProgressArg};
use crate::replay::fault_message;
use crate::report::Settings;
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
    pub(crate) look: Look,
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
    let interrupts = Interrupts::watch()?;
    let mut source = tracing::info_span!("open").in_scope(|| Source::open(args, plan.timeline.as_ref()))?;
    let mut viewing = Viewing::start(args, stays)?;
    let mut picture = |frame: Option<u32>, start: Instant| {
        let mut ready = prepare(args, &plan, &mut source, frame, start)?;
        interrupts.while_drawing(|cancel| picture(args, &plan, &mut ready, frame, cancel, viewing.as_mut()))
    };
    let Some(timeline) = &plan.timeline else { return picture(None, start) };
    let mut start = Some(start);
    for frame in timeline.frames() {
        if picture(Some(frame), start.take().unwrap_or_else(Instant::now))? == Ending::Interrupted {
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
pub(crate) fn prepare(
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
    let named = |path: &PathBuf| plan.name(path, frame);
    let is_first = before.is_none() && !ready.is_changed;
    let mut keeping = args.keeping.keeping(named, ready.identity(), &settings.layout()?, is_first)?;
    let mut onlookers = Onlookers::new(&args.watching, subject(args, plan, ready, frame));
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
    let mut rendered = outcome.map_err(|error| failure(error, args, ready, frame))?;
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

/// What watchers are told of the render before it begins.
fn subject(args: &RenderArgs, plan: &Plan, ready: &Ready, frame: Option<u32>) -> Subject {
    Subject {
        name: format!("{}{}", scene_name(args), frame.map_or_else(String::new, |f| format!(", frame {f}"))),
        measure: measure(&ready.settings),
        outputs: outputs(args, plan, ready, frame).pictures,
        metadata: ready.report.metadata(),
    }
}

/// Why a render failed; where it was the program's fault, with the command that shows it again.
fn failure(error: RenderError, args: &RenderArgs, ready: &Ready, frame: Option<u32>) -> Failure {
    match error {
        RenderError::Panicked(fault) => {
            Failure::internal(fault_message(args, &ready.settings, ready.look.max_depth, frame, &fault))
        }
        other => other.into(),
    }
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
