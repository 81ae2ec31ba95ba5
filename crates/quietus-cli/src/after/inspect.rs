//! `quietus inspect`: where the samples of a finished picture went, and what error remains.

use std::fmt::Write;
use std::path::PathBuf;

use clap::Args;
use quietus::PixelError;
use quietus_film::{Metadata, OutputError, Picture, read_exr, write_rgb_png};
use serde::Serialize;

use super::heat::{HeatMap, Scale};
use super::histogram::{Sorted, bars};
use crate::error::{EXIT_CODES, Ending, Failure};
use crate::say;

/// What to try first.
const EXAMPLES: &str = "\
Examples:
  quietus inspect picture.exr
  quietus inspect picture.exr --samples samples.png --error error.png
  quietus inspect picture.exr --json | jq .samples.mean";

/// Flags of `quietus inspect`.
#[derive(Args, Clone, Debug)]
#[command(after_help = format!("{EXAMPLES}\n\n{EXIT_CODES}"))]
pub(crate) struct InspectArgs {
    /// An OpenEXR picture that `quietus render` wrote.
    pub file: PathBuf,

    /// Draw the samples of every pixel here, in colours with a legend.
    #[arg(long, value_name = "FILE.png")]
    pub samples: Option<PathBuf>,

    /// Draw the error that remains in every pixel here, in colours with a legend.
    #[arg(long, value_name = "FILE.png")]
    pub error: Option<PathBuf>,

    /// Print JSON instead of text.
    #[arg(long)]
    pub json: bool,
}

/// Runs the command.
///
/// # Errors
/// When the picture cannot be read or a map cannot be written.
pub(crate) fn run(args: &InspectArgs) -> Result<Ending, Failure> {
    let (picture, metadata) = read_exr(&args.file).map_err(|error| {
        let hint = match error {
            OutputError::Format { .. } => " (`quietus inspect` reads what `quietus render` writes)",
            _ => "",
        };
        Failure::input(format!("{error}{hint}"))
    })?;
    let found = Inspection::new(&picture, &metadata);
    if args.json {
        let json = serde_json::to_string_pretty(&found).map_err(|e| Failure::internal(e.to_string()))?;
        say::result(json);
    } else {
        say::result(found.describe());
    }
    if let Some(path) = &args.samples {
        let (size, pixels) = samples_map(&picture);
        write_rgb_png(path, size, &pixels)?;
    }
    if let Some(path) = &args.error {
        let (size, pixels) = error_map(&picture);
        write_rgb_png(path, size, &pixels)?;
    }
    Ok(Ending::Success)
}

fn size(picture: &Picture) -> [u32; 2] {
    [picture.window.width(), picture.window.height()]
}

fn samples_map(picture: &Picture) -> ([u32; 2], Vec<[u8; 3]>) {
    let values: Vec<f32> = picture.samples.iter().map(|&samples| samples as f32).collect();
    let scale = Scale::logarithmic(&values);
    HeatMap { size: size(picture), values: &values, title: "samples per pixel", scale }.draw()
}

fn error_map(picture: &Picture) -> ([u32; 2], Vec<[u8; 3]>) {
    // One bright speck should not make everything else black.
    let sorted = Sorted::new(picture.error.iter().map(|&error| f64::from(error)).filter(|e| e.is_finite()));
    let high = sorted.percentile(99.5);
    let scale = Scale::Linear(0.0, if high > 0.0 { high } else { 1.0 });
    let (long, short) = ("remaining error (up to the 99.5th percentile)", "remaining error");
    let title = if HeatMap::has_room_for(long, size(picture)) { long } else { short };
    HeatMap { size: size(picture), values: &picture.error, title, scale }.draw()
}

/// Figures of many values.
#[derive(Debug, Serialize)]
struct Spread {
    mean: f64,
    min: f64,
    p5: f64,
    p50: f64,
    p95: f64,
    p99: f64,
    max: f64,
    /// Share of the sum that the tenth of the pixels with the largest values has.
    share_of_largest_tenth: f64,
    /// Lower ends of octaves, and the shares of pixels in them.
    octaves: Vec<(f64, f64)>,
}

impl Spread {
    fn new(sorted: &Sorted) -> Self {
        let at = |percent| sorted.percentile(percent);
        Self {
            mean: sorted.mean(),
            min: at(0.0),
            p5: at(5.0),
            p50: at(50.0),
            p95: at(95.0),
            p99: at(99.0),
            max: at(100.0),
            share_of_largest_tenth: sorted.share_of_largest_tenth(),
            octaves: sorted.octaves(),
        }
    }
}

/// Everything found out about a picture.
#[derive(Debug, Serialize)]
struct Inspection {
    frame: [u32; 2],
    window: [u32; 4],
    settings: std::collections::BTreeMap<String, String>,
    samples: Spread,
    /// Of the pixels in which it is known; `None` where it is in none.
    error: Option<Spread>,
    /// Pixels whose error nothing is known of, because they lack samples in two replicates.
    pixels_of_unknown_error: usize,
}

impl Inspection {
    fn new(picture: &Picture, metadata: &Metadata) -> Self {
        let window = picture.window;
        // What `shown_error` gives where there is no estimate.
        let unknown = PixelError::MAX.to_f32().unwrap_or(f32::MAX);
        let known: Vec<_> = picture.error.iter().filter(|&&e| e < unknown).map(|&e| f64::from(e)).collect();
        Self {
            pixels_of_unknown_error: picture.error.len() - known.len(),
            frame: picture.frame,
            window: [window.x0, window.y0, window.x1, window.y1],
            settings: metadata.iter().cloned().collect(),
            samples: Spread::new(&Sorted::new(picture.samples.iter().map(|&n| f64::from(n)))),
            error: (!known.is_empty()).then(|| Spread::new(&Sorted::new(known.into_iter()))),
        }
    }

    fn setting(&self, name: &str) -> Option<&str> {
        self.settings.get(name).map(String::as_str)
    }

    /// The settings that say what was asked for, in a sentence.
    fn asked(&self) -> String {
        let parts = [
            ("", "sampling", ""),
            ("noise ", "noise", " %"),
            ("target error ", "target_error", ""),
            ("at least ", "min_samples", " samples"),
            ("at most ", "max_samples", " samples"),
            ("at most ", "time_limit_seconds", " s"),
            ("seed ", "seed", ""),
        ];
        let parts = parts
            .iter()
            .filter_map(|(before, name, after)| Some(format!("{before}{}{after}", self.setting(name)?)));
        parts.collect::<Vec<_>>().join(", ")
    }

    fn reached(&self) -> String {
        let percent = |name: &str| self.setting(name)?.parse::<f64>().ok();
        match (percent("noise_reached"), percent("noise_low"), percent("noise_high")) {
            (Some(reached), Some(low), Some(high)) => {
                format!("{reached:.2} % of white (95 % interval {low:.2}-{high:.2})")
            }
            _ => "not measured".to_owned(),
        }
    }

    fn describe(&self) -> String {
        let ([width, height], [x0, y0, x1, y1]) = (self.frame, self.window);
        let crop = match self.window == [0, 0, width, height] {
            true => String::new(),
            false => format!(", cropped to {x0},{y0},{x1},{y1}"),
        };
        let scene = self.setting("scene").unwrap_or("a scene that is not named");
        let ending = match (self.setting("unfinished"), self.setting("stopped_by")) {
            (Some(after), _) => format!("not yet: saved after {after}"),
            (None, Some("done")) => "yes".to_owned(),
            (None, Some("time")) => "no: its time was up".to_owned(),
            (None, Some("interrupt")) => "no: interrupted".to_owned(),
            (None, _) => "not said".to_owned(),
        };
        let mut text = format!(
            "picture   {width}x{height}{crop} of {scene}\n\
             asked     {}\n\
             finished  {ending}\n\
             noise     {}\n",
            self.asked(),
            self.reached(),
        );
        // Writing to a string cannot fail, here and below.
        let _ =
            write!(text, "samples   {}\n{}", spread(&self.samples, |n| format!("{n:.1}")), self.histogram());
        if let Some(error) = &self.error {
            let _ = write!(text, "error     {}", spread(error, |e| format!("{e:.5}")));
        }
        if self.pixels_of_unknown_error > 0 {
            let before = if self.error.is_some() { "\n          " } else { "error     " };
            let _ =
                write!(text, "{before}not known in {} pixels: too few samples", self.pixels_of_unknown_error);
        }
        text
    }

    fn histogram(&self) -> String {
        let name = |end: f64| match end as u64 {
            end @ 0..=1 => end.to_string(),
            end => format!("{end}-{}", 2 * end - 1),
        };
        bars(&self.samples.octaves, name)
    }
}

fn spread(spread: &Spread, number: impl Fn(f64) -> String) -> String {
    format!(
        "mean {}, median {}, 5 % below {}, 5 % above {}, from {} to {}\n          \
         the tenth of the pixels with the most has {:.0} % of the sum",
        number(spread.mean),
        number(spread.p50),
        number(spread.p5),
        number(spread.p95),
        number(spread.min),
        number(spread.max),
        100.0 * spread.share_of_largest_tenth,
    )
}

#[cfg(test)]
mod tests {
    use quietus_film::Window;

    use super::*;

    #[test]
    fn a_picture_is_described() {
        let mut picture = Picture::empty([20, 10], Window { x0: 0, y0: 0, x1: 20, y1: 10 });
        picture.samples = (0..200).map(|i| if i < 180 { 16 } else { 144 }).collect();
        picture.error[7] = 0.5;
        let pairs =
            [("scene", "a.glb"), ("sampling", "quietus"), ("stopped_by", "done"), ("noise_reached", "1.25")];
        let noise = [("noise_low", "1"), ("noise_high", "1.5")];
        let metadata =
            pairs.iter().chain(&noise).map(|(name, value)| ((*name).to_owned(), (*value).to_owned()));
        let text = Inspection::new(&picture, &metadata.collect()).describe();
        for line in [
            "picture   20x10 of a.glb",
            "finished  yes",
            "noise     1.25 % of white (95 % interval 1.00-1.50)",
            "samples   mean 28.8, median 16.0, 5 % below 16.0, 5 % above 144.0, from 16.0 to 144.0",
            "          the tenth of the pixels with the most has 50 % of the sum",
            "       128-255 ████ 10.0 %",
        ] {
            assert!(text.lines().any(|found| found == line), "{line:?} is not in:\n{text}");
        }
    }

    #[test]
    fn errors_that_nobody_knows_are_not_counted() {
        let mut picture = Picture::empty([20, 10], Window { x0: 0, y0: 0, x1: 20, y1: 10 });
        picture.error[..3].fill(4096.0);
        picture.error[3] = 0.5;
        let text = Inspection::new(&picture, &Metadata::new()).describe();
        assert!(text.contains("from 0.00000 to 0.50000"), "{text}");
        assert!(text.ends_with("not known in 3 pixels: too few samples"), "{text}");
        picture.error.fill(4096.0);
        let text = Inspection::new(&picture, &Metadata::new()).describe();
        assert!(text.ends_with("error     not known in 200 pixels: too few samples"), "{text}");
    }

    #[test]
    fn maps_are_as_large_as_the_picture_and_its_legend() {
        let picture = Picture::empty([300, 10], Window { x0: 0, y0: 0, x1: 300, y1: 10 });
        for (size, pixels) in [samples_map(&picture), error_map(&picture)] {
            assert_eq!((size, pixels.len()), ([300, 58], 300 * 58));
        }
    }
}
