//! `quietus compare`: how far pictures are apart.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use quietus_eval::Picture;
use quietus_eval::measure::flip_map;
use quietus_film::{read_exr_planes, write_rgb_png};
use serde::Serialize;

use super::heat::{HeatMap, Scale};
use crate::args::values::within;
use crate::error::{EXIT_CODES, Ending, Failure};
use crate::say;

/// What to try first.
const EXAMPLES: &str = "\
Examples:
  quietus compare before.exr after.exr
  quietus compare ours.exr theirs.exr --reference truth.exr
  quietus compare golden.exr new.exr --max-flip 0.02 --difference flip.png   # in a script";

/// Flags of `quietus compare`.
#[derive(Args, Clone, Debug)]
#[command(after_help = format!("{EXAMPLES}\n\n{EXIT_CODES}"))]
pub(crate) struct CompareArgs {
    /// An OpenEXR picture.
    pub first: PathBuf,

    /// Another one of the same size.
    pub second: PathBuf,

    /// Compare both with this picture instead of with each other.
    #[arg(long, value_name = "FILE.exr")]
    pub reference: Option<PathBuf>,

    /// Draw FLIP of every pixel here, in colours with a legend: of the second picture against the first, or against the reference.
    #[arg(long, value_name = "FILE.png")]
    pub difference: Option<PathBuf>,

    /// Fail (exit code 1) where mean FLIP exceeds this.
    #[arg(long, value_name = "F", value_parser = parse_flip)]
    pub max_flip: Option<f64>,

    /// How many of the worst 8x8 tiles to list.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = within(0..=usize::MAX))]
    pub tiles: usize,

    /// Print JSON instead of text.
    #[arg(long)]
    pub json: bool,
}

fn parse_flip(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(flip) if (0.0..=1.0).contains(&flip) => Ok(flip),
        _ => Err("expected a number from 0 to 1, such as 0.02".to_owned()),
    }
}

/// Runs the command.
///
/// # Errors
/// When a picture cannot be read, sizes differ, or the difference cannot be written.
pub(crate) fn run(args: &CompareArgs) -> Result<Ending, Failure> {
    let read = |path: &PathBuf| picture(path).map(|picture| (path.display().to_string(), picture));
    let [first, second] = [read(&args.first)?, read(&args.second)?];
    let (truth, tested) = match &args.reference {
        Some(path) => (read(path)?, vec![first, second]),
        None => (first, vec![second]),
    };
    let comparisons: Vec<Comparison> =
        tested.iter().map(|tested| Comparison::new(tested, &truth, args.tiles)).collect::<Result<_, _>>()?;
    if args.json {
        let json =
            serde_json::to_string_pretty(&comparisons).map_err(|e| Failure::internal(e.to_string()))?;
        say::result(json);
    } else {
        comparisons.iter().for_each(|comparison| say::result(comparison.describe()));
    }
    let last = &comparisons[comparisons.len() - 1];
    if let Some(path) = &args.difference {
        let values: Vec<f32> = last.flip_map.iter().map(|&flip| flip as f32).collect();
        let map = HeatMap { size: last.size, values: &values, title: "FLIP", scale: Scale::Linear(0.0, 1.0) };
        let (size, pixels) = map.draw();
        write_rgb_png(path, size, &pixels)?;
    }
    let worst = comparisons.iter().map(|comparison| comparison.flip).fold(0.0, f64::max);
    Ok(match args.max_flip {
        Some(most) if worst > most => {
            say::aside(format_args!("mean FLIP is {worst:.4}, more than the {most} allowed"));
            Ending::Different
        }
        _ => Ending::Success,
    })
}

fn picture(path: &Path) -> Result<Picture, Failure> {
    let planes = read_exr_planes(path).map_err(|error| Failure::input(error.to_string()))?;
    let rgb = planes.rgb().ok_or_else(|| Failure::internal("a layer without colours was chosen"))?;
    let [width, height] = planes.size;
    if let Some(at) = rgb.iter().position(|pixel| pixel.iter().any(|value| !value.is_finite())) {
        let (x, y) = (at % width as usize, at / width as usize);
        return Err(Failure::input(format!("{}: the pixel ({x}, {y}) is not finite", path.display())));
    }
    Ok(Picture { width, height, rgb })
}

/// One picture against another that is taken for the truth.
#[derive(Debug, Serialize)]
struct Comparison {
    picture: String,
    reference: String,
    size: [u32; 2],
    /// Root mean square of the differences, linear.
    rmse: f64,
    /// Mean of the squared differences over the squared reference plus 0.01.
    rel_mse: f64,
    /// Root mean square in display space, in percent of white.
    display_percent: f64,
    /// Mean FLIP.
    flip: f64,
    /// The FLIP that 1 % of the pixels exceed.
    flip_p99: f64,
    /// How much brighter the picture is, in percent.
    brightness_percent: f64,
    worst_tiles: Vec<Tile>,
    #[serde(skip)]
    flip_map: Vec<f64>,
}

/// An 8x8 tile.
#[derive(Debug, Serialize)]
struct Tile {
    x: u32,
    y: u32,
    /// Root mean square in display space, in percent of white.
    display_percent: f64,
}

impl Comparison {
    fn new(tested: &(String, Picture), truth: &(String, Picture), tiles: usize) -> Result<Self, Failure> {
        let ((picture, a), (reference, b)) = (tested, truth);
        if (a.width, a.height) != (b.width, b.height) {
            return Err(Failure::input(format!(
                "{picture} has {}x{} pixels, {reference} {}x{}: only pictures of one size can be compared",
                a.width, a.height, b.width, b.height
            )));
        }
        let pairs = || a.rgb.as_flattened().iter().zip(b.rgb.as_flattened());
        let pairs = || pairs().map(|(&a, &b)| (f64::from(a), f64::from(b)));
        let mean =
            |value: &dyn Fn((f64, f64)) -> f64| pairs().map(value).sum::<f64>() / pairs().count() as f64;
        let squares = display_squares(a, b);
        let map = flip_map(a, b);
        let mut sorted = map.clone();
        sorted.sort_by(f64::total_cmp);
        let (sum_a, sum_b) = (mean(&|(a, _)| a), mean(&|(_, b)| b));
        Ok(Self {
            picture: picture.clone(),
            reference: reference.clone(),
            size: [a.width, a.height],
            rmse: mean(&|(a, b)| (a - b).powi(2)).sqrt(),
            rel_mse: mean(&|(a, b)| (a - b).powi(2) / (b * b + 0.01)),
            display_percent: 100.0 * (squares.iter().sum::<f64>() / squares.len() as f64).sqrt(),
            flip: map.iter().sum::<f64>() / map.len() as f64,
            flip_p99: sorted[(sorted.len() * 99).div_ceil(100) - 1],
            brightness_percent: if sum_b > 0.0 { 100.0 * (sum_a / sum_b - 1.0) } else { 0.0 },
            worst_tiles: worst_tiles(&squares, a.width, tiles),
            flip_map: map,
        })
    }

    fn describe(&self) -> String {
        let mut text = format!(
            "{} against {}, {}x{}\n\
             RMSE        {:.6}\n\
             relMSE      {:.6}\n\
             display     {:.3} % of white\n\
             FLIP        {:.4} mean, {:.4} at the 99th percentile\n\
             brightness  {:+.3} %",
            self.picture,
            self.reference,
            self.size[0],
            self.size[1],
            self.rmse,
            self.rel_mse,
            self.display_percent,
            self.flip,
            self.flip_p99,
            self.brightness_percent,
        );
        for Tile { x, y, display_percent } in &self.worst_tiles {
            // Writing to a string cannot fail.
            let _ = write!(text, "\nworst tile  ({x}, {y}): {display_percent:.3} % of white");
        }
        text
    }
}

/// Mean over the channels of the squared difference that a display shows, of every pixel.
fn display_squares(a: &Picture, b: &Picture) -> Vec<f64> {
    let shown = |value: f32| f64::from(value).clamp(0.0, 1.0).sqrt();
    let square = |(a, b): (&[f32; 3], &[f32; 3])| {
        (0..3).map(|c| (shown(a[c]) - shown(b[c])).powi(2)).sum::<f64>() / 3.0
    };
    a.rgb.iter().zip(&b.rgb).map(square).collect()
}

fn worst_tiles(squares: &[f64], width: u32, most: usize) -> Vec<Tile> {
    let height = squares.len() as u32 / width;
    let mut tiles = Vec::new();
    for y in (0..height).step_by(8) {
        for x in (0..width).step_by(8) {
            let (columns, rows) = (x..(x + 8).min(width), y..(y + 8).min(height));
            let pixels = rows.flat_map(|y| columns.clone().map(move |x| squares[(y * width + x) as usize]));
            let (sum, count) = pixels.fold((0.0, 0.0), |(sum, count), square| (sum + square, count + 1.0));
            tiles.push(Tile { x, y, display_percent: 100.0 * f64::sqrt(sum / count) });
        }
    }
    tiles.sort_by(|a, b| b.display_percent.total_cmp(&a.display_percent));
    tiles.truncate(most);
    tiles.retain(|tile| tile.display_percent > 0.0);
    tiles
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(value: f32) -> Picture {
        Picture { width: 20, height: 10, rgb: vec![[value; 3]; 200] }
    }

    #[test]
    fn figures_of_a_known_difference() {
        let (truth, mut other) = (grey(0.25), grey(0.25));
        // One pixel of the tile at (16, 8), whose part inside of the picture is 4x2.
        other.rgb[9 * 20 + 17] = [1.0; 3];
        let named = |name: &str, picture| (name.to_owned(), picture);
        let found = Comparison::new(&named("a", other), &named("b", truth), 5).unwrap();
        assert!((found.rmse - 0.75 / f64::sqrt(200.0)).abs() < 1e-9);
        assert!((found.rel_mse - 0.5625 / 0.0725 / 200.0).abs() < 1e-9);
        assert!((found.display_percent - 50.0 / f64::sqrt(200.0)).abs() < 1e-6);
        assert!((found.brightness_percent - 100.0 * 0.75 / 0.25 / 200.0).abs() < 1e-6);
        assert_eq!(found.worst_tiles.len(), 1, "tiles without a difference are not listed");
        let Tile { x, y, display_percent } = found.worst_tiles[0];
        assert_eq!((x, y), (16, 8));
        assert!((display_percent - 50.0 / f64::sqrt(8.0)).abs() < 1e-6);
        assert!(found.flip > 0.0 && found.flip_p99 >= found.flip);
    }

    #[test]
    fn sizes_must_agree() {
        let other = Picture { width: 10, height: 20, rgb: vec![[0.0; 3]; 200] };
        let error = Comparison::new(&("a".into(), other), &("b".into(), grey(0.0)), 1).unwrap_err();
        assert!(error.message.contains("10x20") && error.message.contains("20x10"), "{}", error.message);
    }
}
