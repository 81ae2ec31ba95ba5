//! From flags to settings: defaults, and combinations that make no sense.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use glam::Vec3;
use quietus::{Checks, Rebuild};
use quietus_film::{Layout, OutputFormat, Window, check_writable};
use quietus_render::noise::{Aov, OfAovs};
use quietus_render::{Goal, Machinery, RenderSettings, Sampling, available_memory};
use quietus_trace::desc::{Camera, PictureDefaults};
use quietus_trace::filter::Filter;

use crate::args::{ChecksArg, FilterArg, MOST_DEPTH, RebuildArg, RenderArgs};
use crate::error::Failure;
use crate::goal::{goal, goes_by_samples, sample_limits, sampling};
use crate::timeline::Timeline;
use crate::wishes::{Wish, wishes};

/// Longer side of a picture without `--size`.
const DEFAULT_SIDE: f32 = 640.0;
/// Path segments where nobody asks for a number.
const MAX_DEPTH: u32 = 16;
/// Shape of a picture whose camera does not care.
const DEFAULT_ASPECT: f32 = 16.0 / 9.0;

/// What can be decided without the scene.
#[derive(Debug)]
pub(crate) struct Plan {
    /// How samples are spread.
    pub sampling: Sampling,
    /// When a picture is good enough.
    pub goal: Goal,
    /// Pictures to write.
    pub outputs: Vec<(PathBuf, OutputFormat)>,
    /// Threads that render.
    pub threads: NonZeroUsize,
    /// Frames to draw; `None` for one picture of the scene as it is stored.
    pub timeline: Option<Timeline>,
}

impl Plan {
    /// Checks the flags against each other and that every output can be written.
    ///
    /// # Errors
    /// The first flag that makes no sense, or the first output that cannot be written.
    pub(crate) fn new(args: &RenderArgs) -> Result<Self, Failure> {
        let sampling = sampling(args)?;
        if args.tree.is_some() && !sampling.has_tree() {
            return Err(Failure::usage("--tree needs a tree: --sampling quietus, talk or free-running"));
        }
        if args.weight.is_some() && !sampling.can_forecast() {
            return Err(Failure::usage(
                "--weight is for --sampling quietus and uniform: the others deal no samples by the error of a pixel alone",
            ));
        }
        let timeline = Timeline::new(args)?;
        let outputs = outputs(args, timeline.as_ref())?;
        let threads = match args.threads {
            Some(threads) => threads,
            None => std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN),
        };
        let goal = goal(args, sampling)?;
        if !args.aov_noise.is_empty() && !matches!(goal, Goal::Noise(_)) {
            return Err(Failure::usage(
                "--aov-noise goes with --noise: nothing else looks at the noise of a picture",
            ));
        }
        sample_limits(args, sampling, goal, None)?;
        Ok(Self { sampling, goal, outputs, threads, timeline })
    }

    /// Where an output called `path` goes for `frame`.
    pub(crate) fn name(&self, path: &Path, frame: Option<u32>) -> PathBuf {
        match (&self.timeline, frame) {
            (Some(timeline), Some(frame)) => timeline.name(path, frame),
            _ => path.to_owned(),
        }
    }

    /// The settings for a picture through `camera`, of a scene that asks for `picture`: the command line wins.
    ///
    /// # Errors
    /// When frame or crop are out of range or the film would not fit into memory.
    pub(crate) fn decide(
        &self,
        args: &RenderArgs,
        camera: &Camera,
        picture: &PictureDefaults,
    ) -> Result<Decided, Failure> {
        let frame = frame(args, camera, picture)?;
        let window = window(args, picture, frame)?;
        check_memory(&Layout::new(frame, window, 2)?)?;
        let (min_samples, max_samples) = sample_limits(args, self.sampling, self.goal, picture.samples)?;
        let settings = RenderSettings {
            frame,
            window,
            sampling: self.sampling,
            goal: self.goal,
            min_samples,
            max_samples,
            time_limit: args.time,
            threads: self.threads,
            machinery: machinery(args, self.sampling),
            weights: None,
            aov_noise: aov_noise(args),
        };
        let depth = picture.max_depth.map(|depth| depth.clamp(1, MOST_DEPTH));
        let look = Look {
            max_depth: args.max_depth.or(depth).unwrap_or(MAX_DEPTH),
            filter: args.filter.map(filter).or(picture.filter).unwrap_or_default(),
            exposure: args.exposure().map(Vec3::splat).or(picture.exposure).unwrap_or(Vec3::ONE),
            max_component: args.max_component.or(picture.max_component).unwrap_or(f32::INFINITY),
        };
        let mut followed = wishes(picture);
        followed.retain(|wish| !self.overrules(args, wish.name));
        Ok(Decided { settings, look, followed })
    }

    /// Whether the command line decides what statistics call `name`, whatever the scene asks for.
    fn overrules(&self, args: &RenderArgs, name: &str) -> bool {
        match name {
            "size" => args.size.is_some() || args.width.is_some(),
            "crop" => args.crop.is_some(),
            "max_samples" if self.goal == Goal::Limits && self.sampling == Sampling::Uniform => {
                args.spp.is_some() || args.time.is_some()
            }
            "max_samples" => args.max_samples.is_some() || !goes_by_samples(self.goal, self.sampling),
            "max_depth" => args.max_depth.is_some(),
            "filter" => args.filter.is_some(),
            "exposure" => args.exposure().is_some(),
            "max_component" => args.max_component.is_some(),
            _ => false,
        }
    }
}

/// What is drawn, and how it is looked at.
#[derive(Clone, Debug)]
pub(crate) struct Decided {
    /// For the render loop.
    pub settings: RenderSettings,
    /// For the tracer.
    pub look: Look,
    /// What the scene asked for and gets.
    pub followed: Vec<Wish>,
}

/// How a picture is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Look {
    /// Path segments.
    pub max_depth: u32,
    /// Pixel filter.
    pub filter: Filter,
    /// Multiplies radiance.
    pub exposure: Vec3,
    /// Largest component of a sample.
    pub max_component: f32,
}

/// The last that was asked for of each.
fn aov_noise(args: &RenderArgs) -> OfAovs<f64> {
    let asked = |aov: Aov| args.aov_noise.iter().rfind(|(other, _)| *other == aov).map(|(_, noise)| *noise);
    Aov::ALL.map(asked)
}

/// Width and height of the full frame.
fn frame(args: &RenderArgs, camera: &Camera, picture: &PictureDefaults) -> Result<[u32; 2], Failure> {
    let default = picture.size.unwrap_or_else(|| default_size(camera.aspect));
    match (args.size, args.width) {
        (Some(size), _) => Ok(size),
        (None, None) => Ok(default),
        (None, Some(width)) => {
            let height = f64::from(width) * f64::from(default[1]) / f64::from(default[0].max(1));
            Ok([width, (height.round() as u32).max(1)])
        }
    }
}

/// The part to draw: of the file's, all pixels from the first whose corner lies inside (pbrt-v4's rule).
fn window(args: &RenderArgs, picture: &PictureDefaults, frame: [u32; 2]) -> Result<Window, Failure> {
    if let Some(window) = args.crop {
        return Ok(window);
    }
    let Some(crop) = picture.crop else {
        return Ok(Window { x0: 0, y0: 0, x1: frame[0], y1: frame[1] });
    };
    let place = |share: f32, side: u32| (f64::from(share.clamp(0.0, 1.0)) * f64::from(side)).ceil() as u32;
    let [x0, x1] = [crop[0], crop[1]].map(|share| place(share, frame[0]));
    let [y0, y1] = [crop[2], crop[3]].map(|share| place(share, frame[1]));
    if x0 < x1 && y0 < y1 {
        return Ok(Window { x0, y0, x1, y1 });
    }
    let [a, b, c, d] = crop;
    Err(Failure::input(format!(
        "the scene asks for columns {a} to {b} and rows {c} to {d} of a frame of 1, which holds no pixel of \
         {}x{}; --crop asks for others",
        frame[0], frame[1]
    )))
}

/// The talk free-running is the talk as published, unless flags say otherwise.
fn machinery(args: &RenderArgs, sampling: Sampling) -> Machinery {
    let (checks, rebuild) = match sampling {
        Sampling::FreeRunning => (Checks::StripedLocks, Rebuild::Resummed),
        _ => (Checks::Published, Rebuild::SummedArea),
    };
    let asked_checks = args.checks.map(|checks| match checks {
        ChecksArg::Locks => Checks::StripedLocks,
        ChecksArg::Published => Checks::Published,
    });
    let asked_rebuild = args.rebuild.map(|rebuild| match rebuild {
        RebuildArg::Resummed => Rebuild::Resummed,
        RebuildArg::SummedArea => Rebuild::SummedArea,
    });
    Machinery {
        lag: args.lag,
        regions_per_axis: args.regions.unwrap_or(sampling.regions_per_axis()),
        checks: asked_checks.unwrap_or(checks),
        rebuild: asked_rebuild.unwrap_or(rebuild),
    }
}

fn outputs(args: &RenderArgs, timeline: Option<&Timeline>) -> Result<Vec<(PathBuf, OutputFormat)>, Failure> {
    let outputs = args.output.iter().map(|path| Ok((path.clone(), OutputFormat::of(path)?)));
    let outputs = outputs.collect::<Result<Vec<_>, Failure>>()?;
    let mut all: Vec<&Path> = outputs.iter().map(|(path, _)| path.as_path()).collect();
    all.extend(args.stats.as_deref());
    all.extend(args.tree.as_deref());
    all.extend(args.keeping.checkpoint.as_deref());
    all.extend(args.keeping.record.as_deref());
    let mut places = Vec::new();
    for path in all {
        // Frames differ by their numbers: what holds for the first one holds for all.
        let first = timeline.and_then(|timeline| Some(timeline.name(path, timeline.frames().next()?)));
        let path = &first.unwrap_or_else(|| path.to_owned());
        check_writable(path)?;
        let place = place(path);
        if places.contains(&place) {
            return Err(Failure::usage(format!("{}: named twice as an output", path.display())));
        }
        places.push(place);
    }
    Ok(outputs)
}

/// Where `path` leads, whether the file exists by now or not: two spellings of one file have one place.
fn place(path: &Path) -> PathBuf {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let made = || Some(folder.canonicalize().ok()?.join(path.file_name()?));
    path.canonicalize().ok().or_else(made).unwrap_or_else(|| path.to_owned())
}

fn default_size(aspect: Option<f32>) -> [u32; 2] {
    let aspect = aspect.filter(|a| a.is_finite() && *a > 0.0).unwrap_or(DEFAULT_ASPECT);
    let (width, height) = match aspect >= 1.0 {
        true => (DEFAULT_SIDE, DEFAULT_SIDE / aspect),
        false => (DEFAULT_SIDE * aspect, DEFAULT_SIDE),
    };
    [width, height].map(|side| side.round().max(1.0) as u32)
}

/// Better said now than after the system has killed the program.
fn check_memory(layout: &Layout) -> Result<(), Failure> {
    let needed = layout.film_bytes();
    match available_memory() {
        Some(available) if needed > available => {
            let mib = |bytes: u64| bytes >> 20;
            Err(Failure::usage(format!(
                "a picture of {} pixels needs {} MiB of memory, {} MiB are available; try a smaller --size or --crop",
                layout.window().pixels(),
                mib(needed),
                mib(available)
            )))
        }
        _ => Ok(()),
    }
}

/// The filter asked for.
pub(crate) fn filter(filter: FilterArg) -> Filter {
    match filter {
        FilterArg::Box => Filter::BOX,
        FilterArg::Triangle => Filter::TRIANGLE,
        FilterArg::Gaussian => Filter::GAUSSIAN,
        FilterArg::BlackmanHarris => Filter::BLACKMAN_HARRIS,
        FilterArg::Mitchell => Filter::MITCHELL,
        FilterArg::LanczosSinc => Filter::LANCZOS_SINC,
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::args::{Cli, Command};
    use crate::goal::TARGET_ERROR;

    /// A plan from flags; outputs go where nothing is in the way.
    fn plan(flags: &str) -> Result<Plan, String> {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("a.png");
        let words = ["quietus", "render", "-o", out.to_str().unwrap()].into_iter();
        let cli = Cli::try_parse_from(words.chain(flags.split_whitespace())).map_err(|e| e.to_string())?;
        match cli.command {
            Some(Command::Render(args)) => Plan::new(&args).map_err(|failure| failure.message),
            _ => unreachable!(),
        }
    }

    fn args(flags: &str) -> RenderArgs {
        let words = ["quietus", "render"].into_iter().chain(flags.split_whitespace());
        let Some(Command::Render(args)) = Cli::parse_from(words).command else { unreachable!() };
        *args
    }

    /// What is decided for a scene that asks for `picture`, seen through a camera made for twice as wide as high.
    fn decide(flags: &str, picture: &PictureDefaults) -> Result<Decided, Failure> {
        let camera = Camera::perspective("", glam::Affine3A::IDENTITY, 1.0);
        let camera = Camera { aspect: Some(2.0), ..camera };
        plan(flags).unwrap().decide(&args(flags), &camera, picture)
    }

    /// Least and most samples.
    fn limits(flags: &str, samples: Option<u32>) -> (u32, u32) {
        let picture = PictureDefaults { samples, ..PictureDefaults::default() };
        let settings = decide(flags, &picture).unwrap().settings;
        (settings.min_samples, settings.max_samples)
    }

    #[test]
    fn defaults_suit_adaptive_sampling() {
        assert_eq!(plan("").unwrap().sampling, Sampling::Quietus);
        assert_eq!(limits("--target-error 0.01", None), (16, 4096));
        assert_eq!(limits("", None), (16, u32::MAX));
    }

    #[test]
    fn the_goal_is_noise_unless_something_else_is_asked_for() {
        let goal = |flags: &str| plan(flags).unwrap().goal;
        assert_eq!(["", "--noise 1%"].map(goal), [Goal::Noise(0.01); 2]);
        assert_eq!(goal("--noise 0.5% --time 9"), Goal::Noise(0.005));
        assert_eq!(goal("--sampling uniform --noise 2"), Goal::Noise(0.02));
        assert_eq!(goal("--target-error 0.01 --time 9"), Goal::TargetError(0.01));
        for flags in ["--sampling talk", "--unbiased", "--sampling tile --time 9"] {
            assert_eq!(goal(flags), Goal::TargetError(TARGET_ERROR), "{flags}");
        }
        for flags in ["--time 9", "--spp 4", "--sampling uniform", "--sampling uniform --time 9"] {
            assert_eq!(goal(flags), Goal::Limits, "{flags}");
        }
        assert!(plan("--unbiased --noise 1%").unwrap_err().contains("would bias it"));
        assert!(plan("--sampling talk --noise 1%").unwrap_err().contains("go by --target-error"));
    }

    #[test]
    fn spp_means_uniform() {
        for flags in ["--spp 9", "--spp 9 --sampling uniform"] {
            assert_eq!(plan(flags).unwrap().sampling, Sampling::Uniform);
            assert_eq!(limits(flags, None), (9, 9));
            assert_eq!(limits(flags, Some(5)), (9, 9));
        }
        assert_eq!(limits("--sampling uniform", None).1, 64);
        assert_eq!(limits("--sampling uniform", Some(5)).1, 5);
        assert_eq!(limits("--sampling uniform --time 3", None).1, u32::MAX);
        assert_eq!(limits("--sampling uniform --time 3", Some(5)).1, u32::MAX);
    }

    #[test]
    fn unbiased_is_a_way_to_sample_and_excludes_others() {
        for flags in ["--unbiased", "--sampling unbiased", "--unbiased --target-error 0.01 --max-samples 99"]
        {
            assert_eq!(plan(flags).unwrap().sampling, Sampling::Unbiased);
        }
        assert!(plan("--unbiased --tree t.svg").unwrap_err().contains("--tree needs a tree"));
        for flags in ["--unbiased --sampling talk", "--unbiased --spp 9"] {
            assert!(plan(flags).unwrap_err().contains("cannot be used with"), "{flags}");
        }
    }

    #[test]
    fn a_limit_alone_moves_the_default_of_the_other() {
        assert_eq!(limits("--max-samples 4", None), (4, 4));
        assert_eq!(limits("--min-samples 9000 --target-error 0.01", None), (9000, 9000));
    }

    #[test]
    fn samples_of_a_scene_are_the_most_that_adaptive_sampling_takes() {
        let limits_at_target = |samples| limits("--target-error 0.01", samples);
        assert_eq!(limits_at_target(Some(1024)), (16, 1024));
        assert_eq!(limits_at_target(Some(4)), (4, 4));
        assert_eq!(limits_at_target(Some(0)), (1, 1));
        assert_eq!(limits("--max-samples 64", Some(1024)), (16, 64));
        assert_eq!(limits("--min-samples 64 --target-error 0.01", Some(4)), (64, 64));
        // Who asks for a noise or a time gets it.
        for flags in ["", "--noise 2%", "--time 9", "--sampling uniform --noise 1%"] {
            assert_eq!(limits(flags, Some(4)), (16, u32::MAX), "{flags}");
        }
    }

    #[test]
    fn a_scene_decides_what_the_command_line_leaves_open() {
        let picture = PictureDefaults {
            size: Some([400, 300]),
            crop: Some([0.5, 1.0, 0.0, 0.25]),
            exposure: Some(Vec3::new(1.0, 2.0, 3.0)),
            samples: Some(99),
            max_depth: Some(6),
            filter: Some(Filter::MITCHELL),
            max_component: Some(20.0),
        };
        let of = |flags| decide(flags, &picture).unwrap();
        let names = |decided: &Decided| decided.followed.iter().map(|wish| wish.name).collect::<Vec<_>>();
        let wished = of("--target-error 0.01");
        assert_eq!(wished.settings.frame, [400, 300]);
        assert_eq!(wished.settings.window, Window { x0: 200, y0: 0, x1: 400, y1: 75 });
        let look = Look {
            max_depth: 6,
            filter: Filter::MITCHELL,
            exposure: Vec3::new(1.0, 2.0, 3.0),
            max_component: 20.0,
        };
        assert_eq!(wished.look, look);
        let all = ["size", "crop", "max_samples", "max_depth", "filter", "exposure", "max_component"];
        assert_eq!(names(&wished), all);
        let asked =
            of("--size 10x20 --crop 1,2,3,4 --max-samples 16 --max-depth 3 --filter box --exposure 0.5 \
             --max-component inf");
        assert_eq!((asked.settings.frame, asked.settings.max_samples), ([10, 20], 16));
        assert_eq!(asked.settings.window, Window { x0: 1, y0: 2, x1: 3, y1: 4 });
        let exposure = Vec3::splat(0.5);
        let look = Look { max_depth: 3, filter: Filter::BOX, exposure, max_component: f32::INFINITY };
        assert_eq!(asked.look, look);
        assert_eq!(names(&asked), Vec::<&str>::new());
        // The crop is a share of whatever frame there is; the width alone keeps the shape.
        let wide = of("--width 40").settings;
        assert_eq!((wide.frame, wide.window), ([40, 30], Window { x0: 20, y0: 0, x1: 40, y1: 8 }));
        assert_eq!(decide("--width 40", &PictureDefaults::default()).unwrap().settings.frame, [40, 20]);
        let empty = PictureDefaults { crop: Some([0.5, 0.5, 0.0, 1.0]), ..picture };
        assert!(decide("", &empty).unwrap_err().message.contains("holds no pixel of 400x300"));
    }

    #[test]
    fn free_running_is_the_talk_as_published_unless_told_otherwise() {
        let machinery = |flags: &str| {
            let args = args(flags);
            let machinery = super::machinery(&args, sampling(&args).unwrap());
            (machinery.checks, machinery.rebuild)
        };
        let talk = (Checks::StripedLocks, Rebuild::Resummed);
        let ours = (Checks::Published, Rebuild::SummedArea);
        assert_eq!(machinery("--sampling free-running"), talk);
        for sampling in ["quietus", "talk", "tile", "dammertz", "pixel", "uniform"] {
            assert_eq!(machinery(&format!("--sampling {sampling}")), ours, "{sampling}");
        }
        let flags = "--sampling free-running --checks published --rebuild summed-area";
        assert_eq!(machinery(flags), ours);
        assert_eq!(machinery("--checks locks --rebuild resummed"), talk);
    }

    #[test]
    fn combinations_that_make_no_sense_are_refused() {
        let refused = [
            ("--spp 9 --sampling tile", "--spp is for --sampling uniform"),
            ("--spp 9 --target-error 1", "--target-error is for adaptive sampling"),
            ("--sampling uniform --max-samples 8", "--max-samples is for adaptive sampling"),
            ("--size 9x9 --width 8", "cannot be used with"),
            ("--min-samples 9 --max-samples 8", "--min-samples 9 is more than --max-samples 8"),
            ("--sampling pixel --tree t.svg", "--tree needs a tree"),
            ("-o /dev/null.d/a.png", "cannot write"),
            ("-o a.jpg", "unknown picture format"),
            ("-o same.png -o same.png", "named twice"),
            ("-o same.png -o ./same.png", "./same.png: named twice"),
            ("--stats same.png -o same.png", "named twice"),
        ];
        for (flags, expected) in refused {
            let message = plan(flags).unwrap_err();
            assert!(message.contains(expected), "{flags}: {message}");
        }
    }

    #[test]
    fn pictures_have_the_shape_the_camera_asks_for() {
        assert_eq!(default_size(None), [640, 360]);
        assert_eq!(default_size(Some(2.0)), [640, 320]);
        assert_eq!(default_size(Some(0.5)), [320, 640]);
        assert_eq!(default_size(Some(1e9)), [640, 1]);
        assert_eq!(default_size(Some(f32::NAN)), [640, 360]);
    }
}
