//! `quietus render`: from the scene to the pictures.

use std::io::Write;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use quietus_film::{OutputError, OutputFormat, RejectedSamples, write_atomically, write_exr, write_png};
use quietus_render::{
    Control, Fault, PathTracer, RenderError, RenderSettings, Rendered, Sampling, StoppedBy, render,
    shown_error,
};
use quietus_scene::Loaded;
use quietus_trace::desc::{Camera, SceneDesc};
use quietus_trace::scene::Scene;
use quietus_trace::view::View;

use crate::args::RenderArgs;
use crate::error::{Ending, Failure};
use crate::interrupt;
use crate::plan::{Plan, filter};
use crate::progress_bar::{Bar, Measure};
use crate::report::{Settings, name, write_stats};
use crate::say;

/// Everything a render needs, loaded and checked.
struct Ready {
    scene: Scene,
    view: View,
    settings: RenderSettings,
    report: Settings,
    load_seconds: f64,
}

/// Runs `quietus render`.
///
/// # Errors
/// Anything that keeps a picture from being drawn and written.
pub(crate) fn run(args: &RenderArgs) -> Result<Ending, Failure> {
    let plan = Plan::new(args)?;
    let ready = prepare(args, &plan)?;
    let cancel = interrupt::watch()?;
    let rendered = draw(args, &ready, &cancel)?;
    warn_of_rejected(&rendered.film.rejected(), args.seed);
    write(args, &plan, &ready, &rendered)?;
    say::result(summary(&plan, &rendered));
    Ok(match rendered.stopped_by {
        StoppedBy::Cancelled => Ending::Interrupted,
        StoppedBy::Done | StoppedBy::TimeLimit => Ending::Success,
    })
}

fn prepare(args: &RenderArgs, plan: &Plan) -> Result<Ready, Failure> {
    let start = Instant::now();
    let desc = load(args)?;
    let camera = pick_camera(&desc, args.camera.as_deref())?;
    let settings = plan.settings(args, camera)?;
    let view = View::new(camera, settings.frame, filter(args.filter), args.max_depth, args.seed)
        .map_err(|error| Failure::input(format!("{}: {error}", scene_name(args))))?;
    let report = Settings::new(args, &settings, &camera.name);
    let scene =
        Scene::build(&desc).map_err(|error| Failure::input(format!("{}: {error}", scene_name(args))))?;
    Ok(Ready { scene, view, settings, report, load_seconds: start.elapsed().as_secs_f64() })
}

fn scene_name(args: &RenderArgs) -> String {
    args.scene.as_ref().map_or_else(|| "built-in scene".to_owned(), |path| path.display().to_string())
}

fn load(args: &RenderArgs) -> Result<SceneDesc, Failure> {
    let mut loaded = match &args.scene {
        None => Loaded { scene: quietus_scene::embedded(), warnings: Vec::new() },
        Some(path) => quietus_scene::load(path)?,
    };
    if let Some(path) = &args.env {
        loaded.surround(quietus_scene::load_environment(path)?);
    }
    for warning in &loaded.warnings {
        say::aside(format_args!("warning: {}: {warning}", scene_name(args)));
    }
    Ok(loaded.scene)
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

fn draw(args: &RenderArgs, ready: &Ready, cancel: &AtomicBool) -> Result<Rendered, Failure> {
    let tracer = PathTracer { scene: &ready.scene, view: &ready.view };
    let settings = &ready.settings;
    let bar = Bar::new(measure(settings));
    let mut progress = |progress: &_| bar.update(progress);
    let outcome = render(&tracer, settings, &mut Control { cancel, progress: &mut progress });
    bar.clear();
    outcome.map_err(|error| match error {
        RenderError::Panicked(fault) => Failure::internal(fault_message(args, settings, &fault)),
        other => other.into(),
    })
}

/// What comes closest to the share of the work done.
fn measure(settings: &RenderSettings) -> Measure {
    match (settings.sampling, settings.time_limit) {
        (Sampling::Uniform, Some(limit)) if settings.max_samples == u32::MAX => Measure::Time(limit),
        (Sampling::Uniform, _) => {
            Measure::Samples(settings.window.pixels() as f64 * f64::from(settings.max_samples))
        }
        _ => Measure::Converged,
    }
}

/// Names the sample that panicked, and the command that draws its pixel alone up to that sample. Replicates take
/// turns, so sample i of any of R replicates is drawn once the pixel has R (i + 1) samples.
fn fault_message(args: &RenderArgs, settings: &RenderSettings, fault: &Fault) -> String {
    let Fault { x, y, replicate, index, message } = fault;
    let mut command = vec!["quietus render".to_owned()];
    let mut flag = |name: &str, value: String| command.push(format!("{name}{}", quoted(&value)));
    if let Some(scene) = &args.scene {
        flag("", scene.display().to_string());
    }
    if let Some(camera) = &args.camera {
        flag("--camera ", camera.clone());
    }
    if let Some(env) = &args.env {
        flag("--env ", env.display().to_string());
    }
    flag("--size ", format!("{}x{}", settings.frame[0], settings.frame[1]));
    flag("--crop ", format!("{x},{y},{},{}", x + 1, y + 1));
    flag("--spp ", (2 * (u64::from(*index) + 1)).to_string());
    flag("--max-depth ", args.max_depth.to_string());
    flag("--filter ", name(args.filter));
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

fn warn_of_rejected(rejected: &RejectedSamples, seed: u64) {
    if rejected.count() == 0 {
        return;
    }
    say::aside(format_args!(
        "warning: {} samples were not finite and left out; the first ones:",
        rejected.count()
    ));
    for sample in rejected.first() {
        let (x, y, replicate, index) = (sample.x, sample.y, sample.replicate, sample.index);
        say::aside(format_args!("  pixel ({x}, {y}), replicate {replicate}, sample {index}, seed {seed}"));
    }
}

fn write(args: &RenderArgs, plan: &Plan, ready: &Ready, rendered: &Rendered) -> Result<(), Failure> {
    let picture = rendered.film.picture(shown_error);
    let metadata = ready.report.metadata();
    for (path, format) in &plan.outputs {
        match format {
            OutputFormat::Exr => write_exr(path, &picture, &metadata)?,
            OutputFormat::Png => write_png(path, &picture)?,
        }
    }
    if let Some(path) = &args.tree {
        let svg = rendered.sampling.tree_svg();
        write_atomically(path, |writer| {
            let failed = |source| OutputError::Write { path: path.clone(), source };
            writer.write_all(svg.as_bytes()).map_err(failed)
        })?;
    }
    if let Some(path) = &args.stats {
        write_stats(path, &ready.report, ready.load_seconds, rendered)?;
    }
    Ok(())
}

/// The last words: how far it came, and where the pictures are.
fn summary(plan: &Plan, rendered: &Rendered) -> String {
    let statistics = &rendered.statistics;
    let ending = match rendered.stopped_by {
        StoppedBy::Done => "done",
        StoppedBy::TimeLimit => "time is up",
        StoppedBy::Cancelled => "interrupted",
    };
    let converged = match plan.sampling {
        Sampling::Uniform => String::new(),
        _ => format!("{:.1} % converged, ", 100.0 * statistics.converged_fraction),
    };
    let mut text = format!(
        "{ending}: {converged}{:.1} samples per pixel (at most {}), {:.1} s, {:.2} M samples/s",
        statistics.per_pixel.spp_mean,
        statistics.per_pixel.spp_max,
        statistics.wall_seconds,
        statistics.samples as f64 / statistics.wall_seconds.max(1e-9) / 1e6,
    );
    for (path, _) in &plan.outputs {
        let shown = std::fs::canonicalize(path).unwrap_or_else(|_| path.clone());
        text.push_str(&format!("\nwrote {}", shown.display()));
    }
    text
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use quietus_film::Window;

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
        let settings = Plan::new(&args).unwrap().settings(&args, &camera).unwrap();
        let fault = Fault { x: 7, y: 9, replicate: 1, index: 20, message: "oh".to_owned() };
        let message = fault_message(&args, &settings, &fault);
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
        let ready = prepare(&args, &plan).unwrap();
        let message = fault_message(&args, &ready.settings, &fault);
        let replay = parse(&message.rsplit(": ").next().unwrap().split(' ').collect::<Vec<_>>());
        let ready = prepare(&replay, &Plan::new(&replay).unwrap()).unwrap();
        let rendered = draw(&replay, &ready, &AtomicBool::new(false)).unwrap();
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
