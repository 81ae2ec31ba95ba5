//! The command line.

pub(crate) mod values;

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Parser, Subcommand, ValueEnum};
use quietus_film::Window;
use quietus_render::noise::Aov;

use self::values::{
    parse_aov_noise, parse_error, parse_factor, parse_fps, parse_frames, parse_limit, parse_noise,
    parse_share, parse_size, parse_stops, parse_threads, parse_time, parse_window, within,
};
use crate::after::compare::CompareArgs;
use crate::after::convert::ConvertArgs;
use crate::after::inspect::InspectArgs;
use crate::error::EXIT_CODES;
use crate::eval::EvalArgs;
use crate::keeping::KeepingArgs;
use crate::viewing::ViewingArgs;
use crate::watching::WatchingArgs;

/// What to try first.
const EXAMPLES: &str = "\
Examples:
  quietus render scene.glb -o picture.exr -o picture.png
  quietus render helmet.gltf --env studio.hdr --size 1920x1080
  quietus render scene.glb --camera Hero --target-error 0.0005 --max-samples 16384
  quietus render scene.glb --size 1920x1080 --crop 800,400,1100,600 --time 90s
  quietus render scene.glb --noise 0.5% --checkpoint scene.qck --resume
  quietus render fox.glb --animation Walk --frames 0-47 -o fox.####.exr
  quietus render --sampling free-running --tree tree.svg --stats stats.json";

const INFO_EXAMPLES: &str = "\
Examples:
  quietus info scene.glb      # cameras, lights, sizes, animations
  quietus info picture.exr    # channels with their ranges, settings";

/// Where scripts go.
const COMPLETIONS: &str = "\
Examples:
  quietus completions bash > ~/.local/share/bash-completion/completions/quietus
  quietus completions zsh > ~/.zfunc/_quietus          # with ~/.zfunc in fpath
  quietus completions fish > ~/.config/fish/completions/quietus.fish
  quietus completions powershell >> $PROFILE";

/// What to try first of all.
const FIRST_EXAMPLES: &str = "\
Examples:
  quietus                                      # draws the scene that is built in
  quietus render scene.glb -o picture.exr -o picture.png
  quietus inspect picture.exr
  quietus convert picture.exr picture.png --tone agx
  quietus compare before.exr after.exr";

/// A path tracer that puts samples where the noise is.
///
/// Without a command it draws the scene built into it, small and at a noise of 2 %, and says where the pictures are.
#[derive(Parser, Debug)]
#[command(name = "quietus", version, max_term_width = 100)]
#[command(after_help = format!("{FIRST_EXAMPLES}\n\n{EXIT_CODES}"))]
pub(crate) struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Option<Command>,

    /// Say what is being done (-v), and more of it (-vv).
    #[arg(short, long, global = true, action = clap::ArgAction::Count, help_heading = "Messages")]
    pub verbose: u8,

    /// Say nothing but warnings, errors and what was asked for.
    #[arg(short, long, global = true, conflicts_with = "verbose", help_heading = "Messages")]
    pub quiet: bool,

    /// Take settings from this file, not from quietus.toml (see docs/config.md).
    #[arg(long, global = true, value_name = "FILE", help_heading = "Settings file")]
    pub config: Option<PathBuf>,

    /// Take settings from no file.
    #[arg(long, global = true, conflicts_with = "config", help_heading = "Settings file")]
    pub no_config: bool,
}

/// What to do.
#[derive(Subcommand, Debug)]
pub(crate) enum Command {
    /// Draw a scene.
    Render(Box<RenderArgs>),
    /// Draw a scene and show it in a browser, where it can be steered; goes on until Ctrl-C.
    View(Box<RenderArgs>),
    /// Say what is in a scene or an EXR file.
    #[command(after_help = format!("{INFO_EXAMPLES}\n\n{EXIT_CODES}"))]
    Info {
        /// A glTF 2.0 (.gltf, .glb) or pbrt-v4 (.pbrt) scene or an OpenEXR picture (.exr).
        file: PathBuf,
    },
    /// Measure sampling policies on recorded samples: error, gain over uniform sampling, bias, artefacts.
    Eval(Box<EvalArgs>),
    /// Say how far pictures are apart: error, FLIP, brightness, worst tiles.
    Compare(CompareArgs),
    /// Say where the samples of a picture went and what error remains.
    Inspect(InspectArgs),
    /// Turn an EXR picture into a PNG or another EXR: exposure, tone curve, layers, denoising.
    Convert(ConvertArgs),
    /// Say which settings file (quietus.toml) is used, and what it says.
    Config,
    /// Print a script that completes commands and flags in a shell.
    #[command(after_help = COMPLETIONS)]
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
}

/// Flags of `quietus render`.
#[derive(Args, Clone, Debug)]
#[command(after_help = format!("{EXAMPLES}\n\n{EXIT_CODES}"))]
pub(crate) struct RenderArgs {
    /// A glTF 2.0 (.gltf, .glb) or pbrt-v4 (.pbrt) scene; the built-in one when absent.
    pub scene: Option<PathBuf>,

    /// Write the picture here: .exr (all channels) or .png (sRGB). Repeatable.
    #[arg(short, long, value_name = "FILE", default_values = ["quietus.png", "quietus.exr"])]
    pub output: Vec<PathBuf>,

    /// Size of the full frame in pixels. Default: what the scene asks for, else the longer side 640 in the shape of
    /// the camera (16:9 where it has none).
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<[u32; 2]>,

    /// Width of the full frame in pixels, in the shape it would have by default.
    #[arg(long, value_name = "W", conflicts_with = "size", value_parser = within(1..=u32::MAX))]
    pub width: Option<u32>,

    /// Draw only this part of the frame: x0 <= x < x1, y0 <= y < y1, (0, 0) at the top left. Default: what the scene
    /// asks for, else all of it.
    #[arg(long, value_name = "x0,y0,x1,y1", value_parser = parse_window)]
    pub crop: Option<Window>,

    /// Look through this camera of the scene instead of the first; `quietus info` lists them.
    #[arg(long, value_name = "NAME")]
    pub camera: Option<String>,

    /// Of a file that has several scenes, draw this one, by its name or number from 0; `quietus info` lists them.
    #[arg(long, value_name = "NAME|N")]
    pub scene_in_file: Option<String>,

    /// Draw the file's variant of this name (KHR_materials_variants); `quietus info` lists them.
    #[arg(long, value_name = "NAME")]
    pub variant: Option<String>,

    /// Light the scene with this lat-long map (.hdr, .exr) instead of its own surroundings, or by `even`, a sky that is
    /// the same on all sides, or by `none`: its lamps alone.
    #[arg(long, value_name = "FILE|even|none")]
    pub env: Option<PathBuf>,

    /// Draw frame N of an animation: the moment N / FPS seconds after its beginning.
    #[arg(long, value_name = "N", help_heading = "Animation", conflicts_with = "frames", value_parser = within(0..=u32::MAX))]
    pub frame: Option<u32>,

    /// Draw the frames A to B, one picture each. `####` in the names of outputs becomes the frame's number; without
    /// it the number goes before the extension.
    #[arg(long, value_name = "A-B", help_heading = "Animation", value_parser = parse_frames)]
    pub frames: Option<[u32; 2]>,

    /// Frames per second. [default: 24]
    #[arg(long, value_name = "FPS", help_heading = "Animation", value_parser = parse_fps)]
    pub fps: Option<f64>,

    /// Share of a frame's time, from 0 to 1, for which the shutter is open: what moves is blurred. It opens at the
    /// frame's own time. [default: 0.5]
    #[arg(long, value_name = "SHARE", help_heading = "Animation")]
    #[arg(value_parser = parse_share)]
    pub shutter: Option<f64>,

    /// Which of the file's animations, by name or by number from 0. [default: the first]
    #[arg(long, value_name = "NAME|N", help_heading = "Animation")]
    pub animation: Option<String>,

    /// The same random numbers in every frame: noise stands still while the picture moves. Without this each frame has its
    /// own, and noise averages out in the eye (see docs/animation.md).
    #[arg(long, help_heading = "Animation")]
    pub fixed_seed: bool,

    /// How samples are spread over the picture; "the talk" is Jeffery 2019 (see README.md). Default: quietus, or uniform when
    /// --spp is given.
    #[arg(long, value_enum)]
    pub sampling: Option<SamplingArg>,

    /// No bias, by proof: the same as --sampling unbiased.
    #[arg(long, conflicts_with_all = ["sampling", "spp"])]
    pub unbiased: bool,

    /// Noise to stop at, in percent of white: the root mean square error of the finished picture as it is displayed.
    /// With --sampling quietus and uniform. [default: 1%, where nothing else says when to stop]
    #[arg(long, value_name = "P%", value_parser = parse_noise, conflicts_with_all = ["target_error", "spp"])]
    pub noise: Option<f64>,

    /// Go on until the noise of alpha, albedo or normal is as low, too: the root mean square error of their values, in percent
    /// of 1. Repeatable. With --noise.
    #[arg(long, value_name = "NAME=P%", value_parser = parse_aov_noise, conflicts_with_all = ["target_error", "spp"])]
    pub aov_noise: Vec<(Aov, f64)>,

    /// Where error matters more: a picture of the full frame's size (PNG, EXR and others) whose brightness multiplies the error
    /// of each pixel, when samples are dealt and when noise is measured. 0 does not matter, 1 (white in a PNG) is normal, more
    /// than 1 (in an EXR) matters more. With --sampling quietus and uniform.
    #[arg(long, value_name = "MAP")]
    pub weight: Option<PathBuf>,

    /// Region error to stop at instead of a noise, in the library's units: smaller is cleaner and slower.
    /// [default with samplings that cannot go by noise: 0.001; not with uniform]
    #[arg(long, value_name = "E", value_parser = parse_error)]
    pub target_error: Option<f64>,

    /// The same number of samples for every pixel (implies --sampling uniform).
    /// [default with uniform: what the scene asks for, else 64; no limit with --time]
    #[arg(long, value_name = "N", value_parser = within(1..=u32::MAX))]
    pub spp: Option<u32>,

    /// Samples every pixel gets before any may stop. [default: 16; not with uniform]
    #[arg(long, value_name = "N", value_parser = within(1..=u32::MAX))]
    pub min_samples: Option<u32>,

    /// Samples no pixel exceeds. Default: no limit with --noise and --time; with --target-error the samples per pixel that
    /// the scene asks for, else 4096. Not with uniform.
    #[arg(long, value_name = "N", value_parser = within(1..=u32::MAX))]
    pub max_samples: Option<u32>,

    /// The best picture for this time, such as 90s, 5m or "1h 30m"; a plain number means seconds. With --noise or
    /// --target-error: stop after this time if the picture is not done before.
    #[arg(long, value_name = "DURATION", value_parser = parse_time)]
    pub time: Option<Duration>,

    /// Longest path in segments from the camera: 1 shows emitters seen directly, 2 adds direct light.
    /// [default: what the scene asks for, else 16]
    #[arg(long, value_name = "N", value_parser = within(1..=MOST_DEPTH))]
    pub max_depth: Option<u32>,

    /// Pixel filter. [default: what the scene asks for, else blackman-harris]
    #[arg(long, value_enum)]
    pub filter: Option<FilterArg>,

    /// What radiance is multiplied by before it becomes the picture; see --stops. [default: what the scene asks for,
    /// else 1]
    #[arg(long, value_name = "F", value_parser = parse_factor)]
    pub exposure: Option<f32>,

    /// The same in stops: each doubles or halves the light.
    #[arg(long, value_name = "N", conflicts_with = "exposure", value_parser = parse_stops)]
    pub stops: Option<f32>,

    /// Largest component of a sample's colour; brighter samples are darkened to it, which loses energy. "inf" lets
    /// all through. [default: what the scene asks for, else inf]
    #[arg(long, value_name = "F", value_parser = parse_limit)]
    pub max_component: Option<f32>,

    /// Darken every contribution of light that was scattered twice or more (mirrors and glass included) to this value
    /// on the film: fewer bright specks, but energy is lost, caustics above all. [default: off]
    #[arg(long, value_name = "F", value_parser = parse_limit)]
    pub clamp_indirect: Option<f32>,

    /// Picks the random numbers: equal seeds give equal pictures.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = within(0..=u64::MAX))]
    pub seed: u64,

    /// Threads that render. Default: one per core. The picture does not depend on it (except with free-running).
    #[arg(long, value_name = "N", value_parser = parse_threads)]
    pub threads: Option<NonZeroUsize>,

    /// Write figures of the render here, as JSON (see docs/stats.md).
    #[arg(long, value_name = "FILE.json")]
    pub stats: Option<PathBuf>,

    /// Draw the final tree here, as SVG. Needs --sampling quietus, talk or free-running.
    #[arg(long, value_name = "FILE.svg")]
    pub tree: Option<PathBuf>,

    /// What is kept of it.
    #[command(flatten)]
    pub keeping: KeepingArgs,

    /// How it is watched.
    #[command(flatten)]
    pub watching: WatchingArgs,

    /// How it is watched from a browser.
    #[command(flatten)]
    pub viewing: ViewingArgs,

    /// Passes that the tree in use lags behind: 1 saves samples, 2 keeps threads busy at the end.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = within(1..=2_u32))]
    #[arg(help_heading = "Expert")]
    pub lag: u32,

    /// Trees along each axis of the picture. [default: 2; 1 with --sampling unbiased]
    #[arg(long, value_name = "N", value_parser = within(1..=64_u32))]
    #[arg(help_heading = "Expert")]
    pub regions: Option<u32>,

    /// How tiles look into the tree; the picture is the same. Default: locks with free-running, otherwise
    /// published.
    #[arg(long, value_enum, help_heading = "Expert")]
    pub checks: Option<ChecksArg>,

    /// How trees are rebuilt; the picture is the same. Default: resummed with free-running, otherwise summed-area.
    #[arg(long, value_enum, help_heading = "Expert")]
    pub rebuild: Option<RebuildArg>,
}

impl RenderArgs {
    /// What radiance is multiplied by, where that is said.
    pub(crate) fn exposure(&self) -> Option<f32> {
        self.exposure.or(self.stops.map(f32::exp2))
    }
}

/// Longest path that may be asked for.
pub(crate) const MOST_DEPTH: u32 = 4096;

/// `--checks`.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ChecksArg {
    /// Under striped reader-writer locks, as in the talk.
    Locks,
    /// By masks that each rebuild publishes, without locks.
    Published,
}

/// `--rebuild`.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RebuildArg {
    /// Errors are summed anew for every node, as in the talk.
    Resummed,
    /// From a summed-area table.
    SummedArea,
}

/// `--sampling`.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SamplingArg {
    /// To each pixel as many as the noise around it deserves, which a tree pools that is built anew after every pass.
    Quietus,
    /// As many samples as the noise of other pixels asks for: no pixel's own values decide, so nothing is lost on
    /// average.
    Unbiased,
    /// The tree of the talk, drawing bounding rectangles as published.
    Talk,
    /// The talk exactly as published, with its locks and rebuilds (see --checks, --rebuild): the picture depends on
    /// the timing of threads.
    FreeRunning,
    /// Each 8x8 tile stops on its own error.
    Tile,
    /// Blocks that are split and discarded (Dammertz et al. 2010).
    Dammertz,
    /// Each pixel stops on its own error.
    Pixel,
    /// The same number of samples everywhere.
    Uniform,
}

/// `--filter`.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FilterArg {
    /// Constant over the pixel.
    Box,
    /// Triangle of radius 2 pixels.
    Triangle,
    /// Gaussian of standard deviation 0.5 and radius 1.5 pixels.
    Gaussian,
    /// Blackman-Harris window of radius 1.5 pixels.
    BlackmanHarris,
    /// Mitchell-Netravali with B = C = 1/3 and radius 2 pixels: sharp, may ring and be negative beside edges.
    Mitchell,
    /// Sinc, windowed to radius 4 pixels: sharper, rings more.
    LanczosSinc,
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_command_line_is_well_formed() {
        Cli::command().debug_assert();
    }

    #[test]
    fn the_examples_are_read() {
        let examples: Vec<_> = EXAMPLES.lines().skip(1).map(str::split_whitespace).collect();
        assert!(!examples.is_empty());
        for words in examples {
            Cli::try_parse_from(words).unwrap();
        }
    }
}
