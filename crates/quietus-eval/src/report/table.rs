//! The table for the terminal.

use std::fmt::Write;

use crate::{
    compare::{Comparison, Discovery, ErrorPoint, Point},
    equivalence::{CONFIDENCE, Equivalence},
    measure::Measure,
    statistics::Estimate,
};

/// Measure of the columns on gain, unless another is asked for: see [`Measure::Weighted`].
pub const DEFAULT_MEASURE: Measure = Measure::Weighted;

/// Lines of text: limits, then a row for every method at every budget. `measure` is that of the error, the
/// gain and the share of the limit.
pub fn table(comparison: &Comparison, measure: Measure) -> String {
    let mut text = String::new();
    let (bank, reference) = (&comparison.bank, &comparison.reference);
    // Writing to a string cannot fail, here and below.
    let _ = writeln!(
        text,
        "{}: {}x{}, {} streams of {} samples; reference of {} spp",
        bank.scene,
        bank.look.width,
        bank.look.height,
        bank.streams,
        bank.samples,
        u64::from(reference.streams) * u64::from(reference.samples)
    );
    for curve in &comparison.uniform {
        let _ = writeln!(
            text,
            "  {:<8} uniform error falls as n^-{:.2}; limit of the gain {}; in rays {}, for who knows what samples cost {}",
            curve.measure.name(),
            curve.exponent,
            number(curve.limit, 3),
            number(curve.ray_limits.map(|limits| limits.blind), 3),
            number(curve.ray_limits.map(|limits| limits.knowing), 3)
        );
    }
    head(&mut text, measure);
    for point in &comparison.points {
        row(&mut text, point, measure);
    }
    text
}

fn head(text: &mut String, measure: Measure) {
    let _ = writeln!(
        text,
        "{:<13}{:>7}{:>10} {:>10} {:>20} {:>7} {:>7} {:>8} {:>7} {:>7} {:>7} {:>16} {:>16} {:>18} {:>17} {:>6} {:>7} {:>8} {:>12} {:>10} {:>20} {:>5}",
        "method",
        "spp",
        "target",
        format!("{} root", measure.name()),
        "gain",
        "in rays",
        "share",
        "display%",
        "FLIP",
        "p99.9",
        "worst",
        "energy %",
        "dark fifth %",
        "worst tile %",
        "block step edge",
        "false",
        "true/t",
        "re-open",
        "found spp",
        "noise",
        "gain in time",
        "live"
    );
}

fn row(text: &mut String, point: &Point, measure: Measure) {
    let (Some(error), Some(display)) = (find(point, measure), find(point, Measure::Display)) else { return };
    let root = |e: &ErrorPoint| e.root.unwrap_or(f64::NAN);
    let target = point.target_error.map_or_else(|| "-".to_owned(), |t| format!("{t:.2e}"));
    let gain = format!("{}{}", interval(error.gain, 2), if error.extrapolated { "*" } else { "" });
    let structure = point.structure.map(|e| number(Some(e.value), 2)).join(" ");
    let _ = writeln!(
        text,
        "{:<13}{:>7.1}{:>10} {:>10.5} {:>20} {:>7} {:>7} {:>8.3} {:>7.4} {:>7.3} {:>7.3} {:>16} {:>16} {:>18} {:>17} {:>6.2} {:>7.2} {:>8.0} {:>12} {:>10} {:>20} {:>5}",
        point.method.name(),
        point.spp,
        target,
        root(error),
        gain,
        number(Some(error.gain_in_rays.value), 2),
        number(error.share_of_limit.map(|e| e.value), 2),
        100.0 * root(display),
        point.flip.value,
        point.p999,
        point.worst_tile,
        percent(point.bias.picture),
        percent(point.bias.darkest_fifth),
        percent(point.bias.worst_tile),
        structure,
        point.false_stops,
        point.true_over_target,
        point.reopened_pixels,
        point.discovery.map_or_else(|| "-".to_owned(), found),
        point.noise.map_or_else(
            || "-".to_owned(),
            |noise| {
                let ratio = number(Some(noise.reported_over_true), 2);
                format!("{ratio} {}/{}", noise.covered, noise.runs)
            }
        ),
        error.gain_in_time.map_or_else(|| "-".to_owned(), |gain| interval(gain, 2)),
        point
            .live
            .as_ref()
            .map_or_else(|| "-".to_owned(), |live| format!("{}/{}", live.confirmed, live.renders)),
    );
}

/// Samples per pixel at which the late feature is found, and the percentage of the runs that find it, where that is
/// not all.
fn found(discovery: Discovery) -> String {
    match discovery.found {
        0.0 => "never".to_owned(),
        1.0 => format!("{:.1}", discovery.spp.value),
        share => format!("{:.1} ({:.0} %)", discovery.spp.value, 100.0 * share),
    }
}

/// `-` where there is none, or where nothing was divided by nothing.
pub(crate) fn number(value: Option<f64>, digits: usize) -> String {
    value.filter(|v| !v.is_nan()).map_or_else(|| "-".to_owned(), |v| format!("{v:.digits$}"))
}

/// What a point says by a measure.
pub(crate) fn find(point: &Point, measure: Measure) -> Option<&ErrorPoint> {
    point.errors.iter().find(|e| e.measure == measure)
}

/// `value [low, high]`.
pub(crate) fn interval(e: Estimate, digits: usize) -> String {
    if e.value.is_nan() {
        return "-".to_owned();
    }
    format!("{:.digits$} [{:.digits$}, {:.digits$}]", e.value, e.low, e.high)
}

/// `value +- half of the interval`, in percent.
pub(crate) fn percent(e: Estimate) -> String {
    format!("{:+.2} +-{:.2}", 100.0 * e.value, 50.0 * (e.high - e.low))
}

/// Lines of text on whether a method is free of bias.
pub fn equivalence_table(found: &Equivalence) -> String {
    let line = |name: &str, e: Estimate, margin: f64| {
        let [value, low, high] = [e.value, e.low, e.high].map(|v| 100.0 * v);
        format!("  {name:<14} {value:+.3} % [{low:+.3}, {high:+.3}], allowed +-{:.1} %\n", 100.0 * margin)
    };
    let Equivalence { scene, runs, spp, tiles, margins, .. } = found;
    let method = found.method.name();
    let verdict = if found.is_shown() { "shown" } else { "not shown" };
    format!(
        "{scene}: energy of {method} against uniform sampling, {runs} runs of {spp:.1} spp, {:.0} % confidence\n{}{}{}  \
         {tiles} tiles are at least half as bright as the median one; equivalence {verdict}\n",
        100.0 * CONFIDENCE,
        line("picture", found.picture, margins.picture),
        line("darkest fifth", found.darkest_fifth, margins.darkest_fifth),
        line("worst tile", found.worst_tile, margins.tile),
    )
}
