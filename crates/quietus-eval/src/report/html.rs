//! The HTML page: everything in one file, to be opened without a network.

use std::fmt::Write;

use base64::{Engine, engine::general_purpose::STANDARD};

use super::plot::{Line, heat, log_plot, png};
use super::table::{find, table};
use crate::{
    EvalError, Method, Picture, Reference,
    compare::{Comparison, Point},
    measure::{Measure, flip_map},
    statistics::mean,
    sweep::Series,
};

/// Style of the page.
const HEAD: &str = "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>quietus eval</title><style>\
    body{font:15px/1.45 system-ui,sans-serif;margin:2em auto;max-width:1200px;color:#222}\
    pre{font-size:11px;overflow-x:auto;background:#f6f6f4;padding:1em}\
    .row{display:flex;flex-wrap:wrap;gap:12px}figure{margin:0}figcaption{font-size:12px;max-width:260px}\
    img{image-rendering:pixelated;max-width:260px}</style>";

/// One scene of a report.
pub struct Scene<'a> {
    /// What was found.
    pub comparison: &'a Comparison,
    /// The runs, for pictures.
    pub sweep: &'a [Series],
    /// What they were compared with.
    pub reference: &'a Reference,
}

/// The whole page.
///
/// # Errors
/// Where a plot or a picture cannot be made.
pub fn html(scenes: &[Scene<'_>], measure: Measure) -> Result<String, EvalError> {
    let mut page = format!("{HEAD}<h1>Sampling policies on recorded samples</h1>\n{NOTES}");
    for scene in scenes {
        section(&mut page, scene, measure)?;
    }
    Ok(page)
}

/// How to read it.
const NOTES: &str = "<p>Every method was replayed on the same recorded samples through the library's own code, in \
    runs that share no sample. Errors are against an independent reference whose own variance is subtracted. \
    <b>Gain</b>: samples that uniform sampling takes for the same error, over samples taken; it counts the \
    error that bias makes, and says nothing of bias otherwise. <b>Energy</b>: brightness gained or lost against uniform \
    sampling of the same samples. <b>Share</b>: of what the best allocation that does not look at the values it \
    keeps could gain. <b>Block, step, edge</b>: error on the 8x8 grid against a displaced one, relative to uniform \
    sampling; 1 where it knows no tiles. <b>False</b>: stopped area whose true error is not below the target. \
    <b>Found</b>: samples per pixel spent when the light that few samples catch is found. <b>Gain in time</b>: from live \
    renders, CPU time that uniform sampling takes over CPU time taken; <b>live</b>: how many of them had the picture of \
    their replay, bit for bit. Bars and \
    brackets are 95 % confidence; a star marks a gain read from the extended fit.</p>\n";

fn section(page: &mut String, scene: &Scene<'_>, measure: Measure) -> Result<(), EvalError> {
    let comparison = scene.comparison;
    // Writing to a string cannot fail, here and below.
    let _ = writeln!(page, "<h2>{}</h2>", escape(&comparison.bank.scene));
    let _ = writeln!(page, "<pre>{}</pre><div class=\"row\">", escape(&table(comparison, measure)));
    for measure in Measure::ALL {
        let errors =
            lines(comparison, |p| find(p, measure).map(|e| [e.error.value, e.error.low, e.error.high]));
        page.push_str(&log_plot(
            &format!("error: {}", measure.name()),
            [SPP, "mean squared error"],
            &errors,
        )?);
    }
    let gains = lines(comparison, |p| find(p, measure).map(|e| [e.gain.value, e.gain.low, e.gain.high]));
    page.push_str(&log_plot(&format!("gain at equal error: {}", measure.name()), [SPP, "gain"], &gains)?);
    let flips = lines(comparison, |p| Some([p.flip.value, p.flip.low, p.flip.high]));
    page.push_str(&log_plot("mean FLIP", [SPP, "FLIP"], &flips)?);
    if comparison.points.iter().any(|p| p.live.is_some()) {
        timed(page, comparison, measure)?;
    }
    page.push_str("</div>\n");
    pictures(page, scene)
}

/// Plots over CPU time.
fn timed(page: &mut String, comparison: &Comparison, measure: Measure) -> Result<(), EvalError> {
    let seconds = |p: &Point| p.live.as_ref().map_or(f64::NAN, |live| mean(&live.cpu_seconds));
    let value = |p: &Point| find(p, measure).map(|e| [e.error.value, e.error.low, e.error.high]);
    let errors = lines_over(comparison, seconds, value);
    let labels = ["CPU seconds", "mean squared error"];
    page.push_str(&log_plot(&format!("error over time: {}", measure.name()), labels, &errors)?);
    let value = |p: &Point| find(p, measure)?.gain_in_time.map(|gain| [gain.value, gain.low, gain.high]);
    let gains = lines_over(comparison, seconds, value);
    page.push_str(&log_plot(
        &format!("gain at equal time: {}", measure.name()),
        ["CPU seconds", "gain"],
        &gains,
    )?);
    Ok(())
}

/// Label of the axis that most plots have.
const SPP: &str = "samples per pixel";

fn lines(comparison: &Comparison, value: impl Fn(&Point) -> Option<[f64; 3]>) -> Vec<Line> {
    lines_over(comparison, |p| p.spp, value)
}

fn lines_over(
    comparison: &Comparison,
    x: impl Fn(&Point) -> f64,
    value: impl Fn(&Point) -> Option<[f64; 3]>,
) -> Vec<Line> {
    let line = |method: Method| {
        let points = comparison.points.iter().filter(|p| p.method == method);
        Line { method, points: points.filter_map(|p| Some((x(p), value(p)?))).collect() }
    };
    Method::ALL.into_iter().map(line).filter(|line| !line.points.is_empty()).collect()
}

/// The reference, and for each method picture, samples and FLIP of one run at about the middle budget.
fn pictures(page: &mut String, scene: &Scene<'_>) -> Result<(), EvalError> {
    let mut budgets: Vec<f64> =
        scene.sweep.iter().filter(|s| s.method != Method::Uniform).map(|s| s.budget).collect();
    budgets.sort_unstable_by(f64::total_cmp);
    let middle = budgets.get(budgets.len() / 2).copied().unwrap_or(64.0);
    let reference = &scene.reference.mean;
    page.push_str("<div class=\"row\">");
    figure(page, reference.width, &srgb(reference), "reference")?;
    page.push_str("</div>\n");
    for method in Method::ALL {
        let distance = |s: &&Series| (s.budget / middle).ln().abs();
        let series = scene.sweep.iter().filter(|s| s.method == method);
        let Some(series) = series.min_by(|a, b| distance(a).total_cmp(&distance(b))) else { continue };
        let run = &series.first;
        let name = format!("{}, {:.1} spp", method.name(), run.samples_per_pixel());
        let most = run.counts.iter().copied().max().unwrap_or(1);
        // Logarithmic from a quarter of the mean (black) to 16 times that.
        let base = run.samples_per_pixel() / 4.0;
        let counts = run.counts.iter().map(|&n| heat((f64::from(n) / base).log2() / 6.0));
        let counts: Vec<[u8; 3]> = counts.collect();
        let flip: Vec<[u8; 3]> = flip_map(&run.picture, reference).into_iter().map(heat).collect();
        page.push_str("<div class=\"row\">");
        figure(page, reference.width, &srgb(&run.picture), &name)?;
        figure(
            page,
            reference.width,
            &counts,
            &format!("samples, at most {most}; yellow is 16 times the mean"),
        )?;
        figure(page, reference.width, &flip, "FLIP, 0 black to 1 yellow")?;
        page.push_str("</div>\n");
    }
    Ok(())
}

fn figure(page: &mut String, width: u32, pixels: &[[u8; 3]], caption: &str) -> Result<(), EvalError> {
    let data = STANDARD.encode(png(width, pixels, 2)?);
    let caption = escape(caption);
    let _ = writeln!(
        page,
        "<figure><img alt=\"{caption}\" src=\"data:image/png;base64,{data}\"><figcaption>{caption}</figcaption></figure>"
    );
    Ok(())
}

/// With the sRGB curve.
fn srgb(picture: &Picture) -> Vec<[u8; 3]> {
    let encode = |v: f32| {
        let v = v.clamp(0.0, 1.0);
        let curve = if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
        (curve * 255.0).round() as u8
    };
    picture.rgb.iter().map(|rgb| rgb.map(encode)).collect()
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_comes_from_files_cannot_break_the_page() {
        assert_eq!(escape("<a href=\"x\">&"), "&lt;a href=&quot;x&quot;&gt;&amp;");
    }
}
