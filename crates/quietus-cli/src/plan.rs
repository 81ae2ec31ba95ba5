//! From flags to settings: defaults, and combinations that make no sense.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use quietus::{Checks, Rebuild};
use quietus_film::{Layout, OutputFormat, Window, check_writable};
use quietus_render::{Machinery, RenderSettings, Sampling, available_memory};
use quietus_trace::desc::Camera;
use quietus_trace::filter::Filter;

use crate::args::{ChecksArg, FilterArg, RebuildArg, RenderArgs, SamplingArg};
use crate::error::Failure;
use crate::timeline::Timeline;

/// Region error of a presentable picture; what is left of the noise is that of a good preview.
const TARGET_ERROR: f64 = 0.001;
/// Below this a pixel's error is too uncertain to act on (the talk, section 3.2).
const MIN_SAMPLES: u32 = 16;
/// The talk's limit: what is not done by then is not worth more of everybody else's time.
const MAX_SAMPLES: u32 = 4096;
/// Samples of `--sampling uniform` without `--spp`.
const UNIFORM_SAMPLES: u32 = 64;
/// Longer side of a picture without `--size`: the built-in scene is done in well under a minute on two cores.
const DEFAULT_SIDE: f32 = 640.0;
/// Shape of a picture whose camera does not care.
const DEFAULT_ASPECT: f32 = 16.0 / 9.0;

/// What can be decided without the scene.
#[derive(Debug)]
pub(crate) struct Plan {
    /// How samples are spread.
    pub sampling: Sampling,
    /// Region error to stop at.
    pub target_error: f64,
    /// Samples every pixel gets.
    pub min_samples: u32,
    /// Samples no pixel exceeds.
    pub max_samples: u32,
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
        let (min_samples, max_samples) = sample_limits(args, sampling)?;
        if args.tree.is_some() && !sampling.has_tree() {
            return Err(Failure::usage("--tree needs a tree: --sampling quietus, talk or free-running"));
        }
        let timeline = Timeline::new(args)?;
        let outputs = outputs(args, timeline.as_ref())?;
        let threads = match args.threads {
            Some(threads) => threads,
            None => std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN),
        };
        let target_error = args.target_error.unwrap_or(TARGET_ERROR);
        Ok(Self { sampling, target_error, min_samples, max_samples, outputs, threads, timeline })
    }

    /// Where an output called `path` goes for `frame`.
    pub(crate) fn name(&self, path: &Path, frame: Option<u32>) -> PathBuf {
        match (&self.timeline, frame) {
            (Some(timeline), Some(frame)) => timeline.name(path, frame),
            _ => path.to_owned(),
        }
    }

    /// The settings for a picture through `camera`.
    ///
    /// # Errors
    /// When frame or crop are out of range or the film would not fit into memory.
    pub(crate) fn settings(&self, args: &RenderArgs, camera: &Camera) -> Result<RenderSettings, Failure> {
        let frame = args.size.unwrap_or_else(|| default_size(camera.aspect));
        let full = Window { x0: 0, y0: 0, x1: frame[0], y1: frame[1] };
        let window = args.crop.unwrap_or(full);
        check_memory(&Layout::new(frame, window, 2)?)?;
        Ok(RenderSettings {
            frame,
            window,
            sampling: self.sampling,
            target_error: self.target_error,
            min_samples: self.min_samples,
            max_samples: self.max_samples,
            time_limit: args.time,
            threads: self.threads,
            machinery: machinery(args, self.sampling),
        })
    }
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
        regions_per_axis: args.regions,
        checks: asked_checks.unwrap_or(checks),
        rebuild: asked_rebuild.unwrap_or(rebuild),
    }
}

fn sampling(args: &RenderArgs) -> Result<Sampling, Failure> {
    let chosen = match (args.sampling, args.spp) {
        (Some(chosen), None) | (Some(chosen @ SamplingArg::Uniform), Some(_)) => chosen,
        (None, Some(_)) => SamplingArg::Uniform,
        (None, None) => SamplingArg::Quietus,
        (Some(_), Some(_)) => {
            return Err(Failure::usage(
                "--spp is for --sampling uniform; adaptive sampling goes by --target-error, --min-samples and \
                 --max-samples",
            ));
        }
    };
    if chosen == SamplingArg::Uniform {
        let flags = [
            ("--target-error", args.target_error.is_some()),
            ("--min-samples", args.min_samples.is_some()),
            ("--max-samples", args.max_samples.is_some()),
        ];
        if let Some((flag, _)) = flags.iter().find(|(_, given)| *given) {
            return Err(Failure::usage(format!(
                "{flag} is for adaptive sampling; uniform sampling goes by --spp and --time"
            )));
        }
    }
    Ok(match chosen {
        SamplingArg::Quietus => Sampling::Quietus,
        SamplingArg::Talk => Sampling::Talk,
        SamplingArg::FreeRunning => Sampling::FreeRunning,
        SamplingArg::Tile => Sampling::Tile,
        SamplingArg::Dammertz => Sampling::Dammertz,
        SamplingArg::Pixel => Sampling::Pixel,
        SamplingArg::Uniform => Sampling::Uniform,
    })
}

/// Smallest and largest number of samples per pixel.
fn sample_limits(args: &RenderArgs, sampling: Sampling) -> Result<(u32, u32), Failure> {
    if sampling == Sampling::Uniform {
        let unlimited = args.time.map(|_| u32::MAX);
        let spp = args.spp.or(unlimited).unwrap_or(UNIFORM_SAMPLES);
        return Ok((spp, spp));
    }
    // A limit given alone moves the other one's default out of its way.
    let max = args.max_samples.unwrap_or(MAX_SAMPLES.max(args.min_samples.unwrap_or(0)));
    let min = args.min_samples.unwrap_or(MIN_SAMPLES.min(max));
    if min > max {
        return Err(Failure::usage(format!("--min-samples {min} is more than --max-samples {max}")));
    }
    Ok((min, max))
}

fn outputs(args: &RenderArgs, timeline: Option<&Timeline>) -> Result<Vec<(PathBuf, OutputFormat)>, Failure> {
    let outputs = args.output.iter().map(|path| Ok((path.clone(), OutputFormat::of(path)?)));
    let outputs = outputs.collect::<Result<Vec<_>, Failure>>()?;
    let mut all: Vec<&Path> = outputs.iter().map(|(path, _)| path.as_path()).collect();
    all.extend(args.stats.as_deref());
    all.extend(args.tree.as_deref());
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

    #[test]
    fn defaults_suit_adaptive_sampling() {
        let plan = plan("").unwrap();
        assert_eq!(plan.sampling, Sampling::Quietus);
        assert_eq!((plan.min_samples, plan.max_samples), (16, 4096));
    }

    #[test]
    fn spp_means_uniform() {
        for flags in ["--spp 9", "--spp 9 --sampling uniform"] {
            let plan = plan(flags).unwrap();
            assert_eq!((plan.sampling, plan.max_samples), (Sampling::Uniform, 9));
        }
        assert_eq!(plan("--sampling uniform").unwrap().max_samples, 64);
        assert_eq!(plan("--sampling uniform --time 3").unwrap().max_samples, u32::MAX);
    }

    #[test]
    fn a_limit_alone_moves_the_default_of_the_other() {
        assert_eq!(plan("--max-samples 4").unwrap().min_samples, 4);
        assert_eq!(plan("--min-samples 9000").unwrap().max_samples, 9000);
    }

    #[test]
    fn free_running_is_the_talk_as_published_unless_told_otherwise() {
        let machinery = |flags: &str| {
            let words = ["quietus", "render"].into_iter().chain(flags.split_whitespace());
            let Some(Command::Render(args)) = Cli::parse_from(words).command else { unreachable!() };
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
