//! Tables of what renders that were asked for a noise or a time came to.

use super::table::number;
use crate::goals::{Asked, GoalRun, MOMENTS};

/// The head of a table of [`noise_row`]s, in Markdown.
pub const NOISE_HEAD: &str = "\
| scene | asked | runs | reported / asked (5-95 %) | true / asked (5-95 %) | true / reported | intervals that hold the truth | \
half-width | spp | rounds | measuring | bound |
|---|---|---|---|---|---|---|---|---|---|---|---|";

/// The head of a table of [`foreseen_row`]s.
pub const FORESEEN_HEAD: &str = "\
| scene | asked | runs | seconds | samples foreseen / drawn after 10 % (5-95 %), within a fifth, within the range that was said | after 25 % | after 50 % | after 75 % | \
time foreseen / taken after 10 % | after 25 % | after 50 % | after 75 % |
|---|---|---|---|---|---|---|---|---|---|---|---|";

/// The head of a table of [`foretold_row`]s.
pub const FORETOLD_HEAD: &str = "\
| scene | asked | runs that foretold another noise | foretold / true (5-95 %) | foretold / reported (5-95 %) | foretold | true noise | \
after this share of samples |
|---|---|---|---|---|---|---|---|";

/// The head of a table of [`time_row`]s.
pub const TIME_HEAD: &str = "\
| scene | asked | runs | time / asked, least - most | true noise | spp | rounds |
|---|---|---|---|---|---|---|";

/// Runs that were asked for one noise.
pub fn noise_row(scene: &str, asked: f64, runs: &[GoalRun]) -> String {
    let reported: Vec<[f64; 3]> = runs.iter().filter_map(|run| run.reported).collect();
    let covered = runs.iter().filter(|run| run.is_covered() == Some(true)).count();
    // Where no noise was found there is none to compare with.
    let widths = reported.iter().filter(|r| r[0] > 0.0).map(|[reached, _, high]| high / reached - 1.0);
    let ratio = rms(runs.iter().map(|run| run.true_square)) / rms(reported.iter().map(|r| r[0] * r[0]));
    let ratio = number(Some(ratio), 3);
    format!(
        "| {scene} | {} % | {} | {} | {} | {ratio} | {covered} of {} ({:.1} %) | {:.0} % | {:.0} | {:.1} | {:.1} % | {} |",
        100.0 * asked,
        runs.len(),
        spread(reported.iter().map(|r| r[0] / asked)),
        spread(runs.iter().map(|run| run.truth() / asked)),
        reported.len(),
        100.0 * covered as f64 / reported.len().max(1) as f64,
        100.0 * median(widths),
        mean(runs.iter().map(|run| run.spp)),
        mean(runs.iter().map(|run| f64::from(run.rounds))),
        100.0 * mean(runs.iter().map(|run| run.measuring)),
        runs.iter().filter(|run| run.bound).count(),
    )
}

/// What runs said of their end, over the end they came to: after a tenth of it, and so on.
pub fn foreseen_row(scene: &str, asked: f64, runs: &[GoalRun]) -> String {
    let column = |of: &dyn Fn(&GoalRun) -> Option<f64>| {
        let said: Vec<f64> = runs.iter().filter_map(of).collect();
        let near = said.iter().filter(|ratio| (0.8..=1.2).contains(*ratio)).count();
        format!("{}, {near} of {}", spread(said.iter().copied()), said.len())
    };
    let moments = 0..MOMENTS.len();
    let samples = moments.clone().map(|moment| {
        let held = runs.iter().filter(|run| run.expected_held[moment] == Some(true)).count();
        format!("{}, {held}", column(&|run: &GoalRun| run.expected_samples[moment]))
    });
    let times = moments.map(|moment| column(&|run: &GoalRun| run.expected[moment]));
    let columns: Vec<String> = samples.chain(times).collect();
    let seconds = mean(runs.iter().map(|run| run.seconds));
    format!("| {scene} | {} % | {} | {seconds:.1} | {} |", 100.0 * asked, runs.len(), columns.join(" | "))
}

/// What runs said would be reached instead of the noise asked for, over what was; nothing where none said so.
pub fn foretold_row(scene: &str, asked: f64, runs: &[GoalRun]) -> Option<String> {
    let said: Vec<(&GoalRun, [f64; 2])> =
        runs.iter().filter_map(|run| run.foretold.map(|said| (run, said))).collect();
    let reported = said.iter().filter_map(|(run, [noise, _])| Some(noise / run.reported?[0]));
    (!said.is_empty()).then(|| {
        format!(
            "| {scene} | {} % | {} of {} | {} | {} | {:.2} % | {:.2} % | {} |",
            100.0 * asked,
            said.len(),
            runs.len(),
            spread(said.iter().map(|(run, [noise, _])| noise / run.truth())),
            spread(reported),
            100.0 * mean(said.iter().map(|(_, [noise, _])| *noise)),
            100.0 * rms(said.iter().map(|(run, _)| run.true_square)),
            spread(said.iter().map(|(_, [_, share])| *share)),
        )
    })
}

/// Runs that were asked for one time.
pub fn time_row(scene: &str, asked: Asked, runs: &[GoalRun]) -> String {
    let Asked::Time(time) = asked else { return String::new() };
    let times: Vec<f64> = runs.iter().map(|run| run.seconds / time.as_secs_f64()).collect();
    format!(
        "| {scene} | {} s | {} | {:.3} - {:.3} | {:.2} % | {:.0} | {:.1} |",
        time.as_secs_f64(),
        runs.len(),
        times.iter().copied().fold(f64::INFINITY, f64::min),
        times.iter().copied().fold(0.0, f64::max),
        100.0 * rms(runs.iter().map(|run| run.true_square)),
        mean(runs.iter().map(|run| run.spp)),
        mean(runs.iter().map(|run| f64::from(run.rounds))),
    )
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / f64::max(count, 1.0)
}

/// The upper median; 0 where there are none.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Root of the mean of squares.
fn rms(squares: impl Iterator<Item = f64>) -> f64 {
    mean(squares).max(0.0).sqrt()
}

/// Median, and the range of nine tenths.
fn spread(values: impl Iterator<Item = f64>) -> String {
    let mut values: Vec<f64> = values.collect();
    if values.is_empty() {
        return "-".to_owned();
    }
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values[((values.len() - 1) as f64 * share).round() as usize];
    format!("{:.2} ({:.2} - {:.2})", at(0.5), at(0.05), at(0.95))
}
