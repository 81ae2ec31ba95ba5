//! `quietus convert`: from an EXR file to a picture for the eye, or to another EXR file.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use quietus_denoise::{DenoiseError, Denoiser, Noisy};
use quietus_film::{
    ExrPlanes, OutputFormat, ToneCurve, check_writable, read_exr_planes, write_exr_planes, write_rgb_png,
};

use super::heat::{HeatMap, Scale};
use crate::args::values::{parse_factor, parse_stops};
use crate::error::{EXIT_CODES, Ending, Failure};
use crate::say;

/// What to try first.
const EXAMPLES: &str = "\
Examples:
  quietus convert picture.exr picture.png
  quietus convert picture.exr picture.png --stops 1.5 --tone agx
  quietus convert picture.exr clean.exr --denoise
  quietus convert picture.exr normals.png --layer normal
  quietus convert picture.exr samples.png --layer samples   # in colours with a legend";

/// Flags of `quietus convert`.
#[derive(Args, Clone, Debug)]
#[command(after_help = format!("{EXAMPLES}\n\n{EXIT_CODES}"))]
pub(crate) struct ConvertArgs {
    /// An OpenEXR picture, of Quietus or of any other program.
    pub input: PathBuf,

    /// Where it goes: .png or .exr.
    pub output: PathBuf,

    /// What to show. In an EXR file, this alone is kept; without it, everything.
    #[arg(long, value_enum, value_name = "LAYER")]
    pub layer: Option<LayerArg>,

    /// What light is multiplied by.
    #[arg(long, value_name = "F", value_parser = parse_factor)]
    pub exposure: Option<f32>,

    /// The same in stops: each doubles or halves the light.
    #[arg(long, value_name = "N", conflicts_with = "exposure", value_parser = parse_stops)]
    pub stops: Option<f32>,

    /// How light becomes the codes of a PNG file. [default: srgb]
    #[arg(long, value_enum, value_name = "CURVE")]
    pub tone: Option<ToneArg>,

    /// Remove what noise is left, with Intel Open Image Denoise, if it is installed; albedo and normals help.
    #[arg(long)]
    pub denoise: bool,

    /// The library that --denoise uses. Default: where the system keeps libraries.
    #[arg(long, value_name = "FILE")]
    pub oidn: Option<PathBuf>,
}

/// For those who do not have the denoiser.
const WHERE_TO_GET_IT: &str = "\
It is free: from https://www.openimagedenoise.org, from the package manager of many systems (libopenimagedenoise,
openimagedenoise), or by `pip install pyoidn`. Where the system does not find it, name its file with --oidn.";

/// `--layer`.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LayerArg {
    /// The picture itself.
    Beauty,
    /// Colours of surfaces, without light.
    Albedo,
    /// Normals in world space; in a PNG file -1 to 1 becomes black to white.
    Normal,
    /// Distance along the viewing axis.
    Depth,
    /// Share of the pixel that is covered.
    Alpha,
    /// Samples of each pixel.
    Samples,
    /// Error that remains.
    Error,
}

/// `--tone`.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ToneArg {
    /// Codes in proportion to light: for data.
    Linear,
    /// The curve of displays; what is brighter than white is clipped.
    Srgb,
    /// AgX: highlights roll off and lose their colour instead of being clipped.
    Agx,
}

impl LayerArg {
    /// Its channels in an EXR file: three, or one.
    fn channels(self) -> &'static [&'static str] {
        match self {
            Self::Beauty => &["R", "G", "B"],
            Self::Albedo => &["albedo.R", "albedo.G", "albedo.B"],
            Self::Normal => &["normal.X", "normal.Y", "normal.Z"],
            Self::Depth => &["depth.Z"],
            Self::Alpha => &["A"],
            Self::Samples => &["samples"],
            Self::Error => &["error"],
        }
    }

    /// Whether exposure and tone curves mean something for it.
    fn is_light(self) -> bool {
        matches!(self, Self::Beauty | Self::Albedo)
    }
}

/// Runs the command.
///
/// # Errors
/// Flags that make no sense together, pictures that cannot be read or written, or no denoiser.
pub(crate) fn run(args: &ConvertArgs) -> Result<Ending, Failure> {
    let format = OutputFormat::of(&args.output)?;
    check(args, format)?;
    check_writable(&args.output)?;
    let mut planes = read_exr_planes(&args.input).map_err(|error| Failure::input(error.to_string()))?;
    if args.denoise {
        denoise(&mut planes, args)?;
    }
    let factor = args.exposure.unwrap_or(1.0) * args.stops.map_or(1.0, f32::exp2);
    let layer = args.layer.unwrap_or(LayerArg::Beauty);
    if layer.is_light() {
        expose(&mut planes, layer, factor);
    }
    match format {
        OutputFormat::Png => {
            let (size, pixels) = shown(&planes, layer, args)?;
            write_rgb_png(&args.output, size, &pixels)?;
        }
        OutputFormat::Exr => write_exr_planes(&args.output, &kept(planes, args)?)?,
    }
    say::outcome(format_args!("wrote {}", args.output.display()));
    Ok(Ending::Success)
}

fn check(args: &ConvertArgs, format: OutputFormat) -> Result<(), Failure> {
    let layer = args.layer.unwrap_or(LayerArg::Beauty);
    if format == OutputFormat::Exr && args.tone.is_some() {
        return Err(Failure::usage("--tone is for PNG files: an EXR file holds light as it is"));
    }
    if !layer.is_light() && (args.exposure.is_some() || args.stops.is_some() || args.tone.is_some()) {
        let flags = "--exposure, --stops and --tone";
        return Err(Failure::usage(format!("{flags} are for light: beauty or albedo")));
    }
    if args.denoise && layer != LayerArg::Beauty {
        return Err(Failure::usage("--denoise is for the picture itself: --layer beauty"));
    }
    Ok(())
}

fn lacking(path: &Path, channel: &str) -> Failure {
    Failure::input(format!("{}: lacks the channel `{channel}`", path.display()))
}

fn expose(planes: &mut ExrPlanes, layer: LayerArg, factor: f32) {
    let light = planes.channels.iter_mut().filter(|(name, _)| layer.channels().contains(&name.as_str()));
    light.flat_map(|(_, values)| values).for_each(|value| *value *= factor);
}

/// The pixels of a PNG file.
fn shown(
    planes: &ExrPlanes,
    layer: LayerArg,
    args: &ConvertArgs,
) -> Result<([u32; 2], Vec<[u8; 3]>), Failure> {
    let find = |name: &&str| planes.channel(name).ok_or_else(|| lacking(&args.input, name));
    if let [name] = layer.channels() {
        return Ok(map(planes.size, find(name)?, layer));
    }
    let channels = layer.channels().iter().map(find).collect::<Result<Vec<_>, _>>()?;
    let curve = match args.tone {
        Some(ToneArg::Linear) => ToneCurve::Linear,
        Some(ToneArg::Agx) => ToneCurve::AgX,
        Some(ToneArg::Srgb) | None => ToneCurve::Srgb,
    };
    let pixels = (0..channels[0].len()).map(|i| [channels[0][i], channels[1][i], channels[2][i]]);
    let encoded = pixels.map(|pixel| match layer {
        LayerArg::Normal => ToneCurve::Linear.encode(pixel.map(|value| 0.5 * value + 0.5)),
        _ => curve.encode(pixel),
    });
    Ok((planes.size, encoded.collect()))
}

/// A single channel in colours.
fn map(size: [u32; 2], values: &[f32], layer: LayerArg) -> ([u32; 2], Vec<[u8; 3]>) {
    let finite = values.iter().filter(|value| value.is_finite()).map(|&value| f64::from(value));
    let most = finite.fold(0.0, f64::max);
    let linear = Scale::Linear(0.0, if most > 0.0 { most } else { 1.0 });
    let (title, scale) = match layer {
        LayerArg::Samples => ("samples per pixel", Scale::logarithmic(values)),
        LayerArg::Depth => ("depth in units of the scene", linear),
        LayerArg::Alpha => ("alpha", Scale::Linear(0.0, 1.0)),
        _ => ("remaining error", linear),
    };
    HeatMap { size, values, title, scale }.draw()
}

/// What goes into an EXR file: everything, or the layer as `R`, `G`, `B`.
fn kept(planes: ExrPlanes, args: &ConvertArgs) -> Result<ExrPlanes, Failure> {
    let Some(layer) = args.layer else { return Ok(planes) };
    let names = layer.channels();
    // A single channel is the same in all three.
    let channels = ["R", "G", "B"].iter().enumerate().map(|(i, name)| {
        let from = names[i.min(names.len() - 1)];
        let values = planes.channel(from).ok_or_else(|| lacking(&args.input, from))?;
        Ok(((*name).to_owned(), values.to_vec()))
    });
    let channels = channels.collect::<Result<Vec<_>, Failure>>()?;
    Ok(ExrPlanes { channels, ..planes })
}

/// Replaces red, green and blue.
fn denoise(planes: &mut ExrPlanes, args: &ConvertArgs) -> Result<(), Failure> {
    let failed = |error: DenoiseError| match &error {
        DenoiseError::Unusable(reason) => Failure::input(format!("{}: {reason}", args.input.display())),
        DenoiseError::Absent(_) => Failure::input(format!("{error}\n{WHERE_TO_GET_IT}")),
        other => Failure::input(other.to_string()),
    };
    let denoiser = Denoiser::load(args.oidn.as_deref()).map_err(failed)?;
    let color = planes.rgb().ok_or_else(|| lacking(&args.input, "R"))?;
    let albedo = planes.triple(["albedo.R", "albedo.G", "albedo.B"]);
    let normal = planes.triple(["normal.X", "normal.Y", "normal.Z"]);
    if albedo.is_none() {
        say::aside(format_args!("{}: no albedo, which would help the denoiser", args.input.display()));
    }
    let [width, height] = planes.size.map(|side| side as usize);
    let noisy = Noisy { width, height, color: &color, albedo: albedo.as_deref(), normal: normal.as_deref() };
    let clean = denoiser.denoise(&noisy).map_err(failed)?;
    tracing::info!("denoised by Open Image Denoise {}", denoiser.version().map_err(failed)?);
    for (name, values) in &mut planes.channels {
        if let Some(c) = ["R", "G", "B"].iter().position(|channel| channel == name) {
            values.iter_mut().zip(&clean).for_each(|(value, clean)| *value = clean[c]);
        }
    }
    planes.metadata.push(("denoised".to_owned(), "Open Image Denoise".to_owned()));
    Ok(())
}
