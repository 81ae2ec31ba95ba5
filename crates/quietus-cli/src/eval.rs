//! `quietus eval`: measure sampling policies on recorded samples.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use quietus_eval::{
    EvalError, FILTERS, Look, Method, Reference, Study, StudySpec, Subject, cache_directory,
    compare::{Comparison, compare},
    equivalence::{EquivalencePlan, equivalence},
    goals::{Asked, GoalPlan, GoalRun, goal_runs},
    live::{Live, live},
    measure::Measure,
    report,
    sweep::{Plan, Series, sweep},
};
use quietus_film::{check_writable, write_atomically};
use serde::Serialize;

use crate::args::MOST_DEPTH;
use crate::args::values::{parse_noise, parse_size, parse_time, within};
use crate::error::{EXIT_CODES, Ending, Failure};
use crate::say;

/// What to try first.
const EXAMPLES: &str = "\
Examples:
  quietus eval                                  # the scene that is built in
  quietus eval scene.glb --html report.html
  quietus eval scene.glb --methods quietus,talk --budgets 64,256 --measure display
  quietus eval --equivalence unbiased           # is a method free of bias?";

/// Flags of `quietus eval`.
#[derive(Args, Clone, Debug)]
#[command(after_help = format!("{EXAMPLES}\n\n{EXIT_CODES}"))]
pub(crate) struct EvalArgs {
    /// Scenes: `embedded`, or glTF 2.0 (.gltf, .glb) and pbrt-v4 files (.pbrt).
    #[arg(default_values = ["embedded"])]
    scenes: Vec<String>,

    /// Size of the pictures in pixels.
    #[arg(long, value_name = "WxH", value_parser = parse_size, default_value = "96x64")]
    size: [u32; 2],

    /// Sample sequences recorded for each pixel; half as many runs share no sample.
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = within(1..=u32::MAX))]
    streams: u32,

    /// Samples in each of them; a run takes at most twice as many per pixel. [default: 512; 64 with --equivalence]
    #[arg(long, value_name = "N", value_parser = within(1..=u32::MAX))]
    samples: Option<u32>,

    /// Seed of the recorded samples.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = within(0..=u64::MAX))]
    seed: u64,

    /// Samples per pixel of the reference, drawn with other seeds.
    #[arg(long, value_name = "N", default_value_t = 16384, value_parser = within(1..=u32::MAX))]
    reference_spp: u32,

    /// Longest path in segments from the camera.
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = within(1..=MOST_DEPTH))]
    max_depth: u32,

    /// Pixel filter: box, triangle, gaussian or blackman-harris; others have samples below 0, which are not recorded.
    #[arg(long, value_name = "FILTER", default_value = "blackman-harris", value_parser = parse_filter)]
    filter: String,

    /// Where recorded samples and references are kept. [default: quietus/eval in $XDG_CACHE_HOME or ~/.cache]
    #[arg(long, value_name = "DIR")]
    cache: Option<PathBuf>,

    /// Only record samples and draw the reference.
    #[arg(long)]
    record_only: bool,

    /// Methods to compare with uniform sampling, as render's --sampling calls them. [default: all]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', value_parser = parse_method)]
    methods: Vec<Method>,

    /// Samples per pixel at which they are compared. [default: 24,32,48,64,96,128,192,256, as far as samples
    /// reach]
    #[arg(long, value_name = "SPP,...", value_delimiter = ',', value_parser = parse_budget)]
    budgets: Vec<f64>,

    /// Runs of each. [default: as many as share no sample]
    #[arg(long, value_name = "N", value_parser = within(1..=u64::MAX))]
    runs: Option<u64>,

    /// Samples every pixel gets before any may stop. [default: 16]
    #[arg(long, value_name = "N", value_parser = within(1..=u32::MAX))]
    min_samples: Option<u32>,

    /// Error measure of the table: mse, rel_mse, weighted or display.
    #[arg(long, value_name = "NAME", default_value = "weighted", value_parser = parse_measure)]
    measure: Measure,

    /// Test instead whether METHOD is free of bias: many short runs (--runs, default 1000) with seeds of their own,
    /// at one budget (--budgets, default 40).
    #[arg(long, value_name = "METHOD", value_parser = parse_method, conflicts_with_all = ["methods", "html"])]
    equivalence: Option<Method>,

    /// Test instead whether renders get the noises they are asked for, in percent of white: --runs of each (default
    /// 20), with seeds of their own. Pictures are at the exposure that the scene asks for.
    #[arg(long, value_name = "P%,...", value_delimiter = ',', value_parser = parse_noise)]
    #[arg(conflicts_with_all = ["methods", "html", "equivalence"])]
    noise: Vec<f64>,

    /// Begin no more renders of a noise after this time, and leave out a noise whose first renders would take longer than
    /// twice as much, going by those of the one before it.
    #[arg(long, value_name = "DURATION", value_parser = parse_time, requires = "noise")]
    noise_time: Option<Duration>,

    /// As --noise, for renders that are asked for times.
    #[arg(long, value_name = "DURATION,...", value_delimiter = ',', value_parser = parse_time)]
    #[arg(conflicts_with_all = ["methods", "html", "equivalence"])]
    time: Vec<Duration>,

    /// Also render each live, so many times: CPU time, gain at equal time, and whether replays are what renders do.
    #[arg(long, value_name = "N", default_value_t = 0, conflicts_with = "equivalence", value_parser = within(0..=u32::MAX))]
    live: u32,

    /// Write everything here, as JSON.
    #[arg(long, value_name = "FILE.json")]
    json: Option<PathBuf>,

    /// Write a report with plots and pictures here, as one HTML file.
    #[arg(long, value_name = "FILE.html")]
    html: Option<PathBuf>,
}

fn parse_method(text: &str) -> Result<Method, String> {
    let names = || Method::ALL.map(Method::name).join(", ");
    Method::ALL.into_iter().find(|m| m.name() == text).ok_or_else(|| format!("expected one of {}", names()))
}

fn parse_filter(text: &str) -> Result<String, String> {
    let names = || FILTERS.map(|(name, _)| name).join(", ");
    let is_known = FILTERS.iter().any(|(name, _)| *name == text);
    is_known.then(|| text.to_owned()).ok_or_else(|| format!("expected one of {}", names()))
}

fn parse_budget(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(budget) if budget.is_finite() && budget > 0.0 => Ok(budget),
        _ => Err("expected a number above 0".to_owned()),
    }
}

fn parse_measure(text: &str) -> Result<Measure, String> {
    let names = || Measure::ALL.map(Measure::name).join(", ");
    Measure::ALL.into_iter().find(|m| m.name() == text).ok_or_else(|| format!("expected one of {}", names()))
}

/// A scene with everything found about it.
struct Found {
    study: Study,
    sweep: Vec<Series>,
    comparison: Comparison,
}

/// Runs the command.
pub(crate) fn run(args: &EvalArgs) -> Result<Ending, Failure> {
    // Minutes of work should not end at a missing directory.
    for path in [&args.json, &args.html].into_iter().flatten() {
        check_writable(path)?;
    }
    if let Some(method) = args.equivalence {
        return show_equivalence(args, method);
    }
    if !args.noise.is_empty() || !args.time.is_empty() {
        return show_goals(args);
    }
    let mut found = Vec::new();
    for source in &args.scenes {
        let subject = subject(source)?;
        let study = open(args, source, &subject)?;
        if args.record_only {
            continue;
        }
        study.reference.expect_light()?;
        let plan = plan(args, &study);
        say::aside(format_args!(
            "{source}: {} methods at {} budgets",
            plan.methods.len(),
            plan.budgets.len()
        ));
        let sweep = sweep(&study.bank, &study.reference, &plan)?;
        let mut comparison = compare(&study.bank, &study.reference, &sweep);
        if args.live > 0 {
            comparison.add_live(&render_live(args, source, &subject, &study, &sweep)?);
        }
        say::result(report::table(&comparison, args.measure));
        found.push(Found { study, sweep, comparison });
    }
    if !args.record_only {
        write_reports(args, &found)?;
    }
    Ok(Ending::Success)
}

/// `--equivalence`: bias with its intervals, and whether they lie within the margins.
fn show_equivalence(args: &EvalArgs, method: Method) -> Result<Ending, Failure> {
    let mut all = Vec::new();
    for source in &args.scenes {
        let subject = subject(source)?;
        let plan = EquivalencePlan {
            method,
            look: look(args),
            runs: u32::try_from(args.runs.unwrap_or(1000)).unwrap_or(u32::MAX),
            budget: args.budgets.first().copied().unwrap_or(40.0),
            min_samples: args.min_samples.unwrap_or(16),
            max_samples: args.samples.unwrap_or(64).saturating_mul(2),
            reference_spp: args.reference_spp,
        };
        let found = equivalence(&subject, &plan)?;
        say::result(report::equivalence_table(&found));
        all.push(found);
    }
    write_json(args, &all)?;
    Ok(Ending::Success)
}

fn study_spec(args: &EvalArgs) -> StudySpec {
    StudySpec {
        look: look(args),
        streams: args.streams,
        samples: args.samples.unwrap_or(512),
        seed: args.seed,
        reference_spp: args.reference_spp,
    }
}

/// Tables of what renders come to that are asked for noises and times: of noises, of what was foreseen of them, of times, and
/// of what was foretold of noises.
struct GoalTables([Vec<String>; 4]);

impl GoalTables {
    fn new() -> Self {
        use report::goals::{FORESEEN_HEAD, FORETOLD_HEAD, NOISE_HEAD, TIME_HEAD};
        Self([NOISE_HEAD, FORESEEN_HEAD, TIME_HEAD, FORETOLD_HEAD].map(|head| vec![head.to_owned()]))
    }

    fn add(&mut self, scene: &str, asked: Asked, runs: &[GoalRun]) {
        use report::goals::{foreseen_row, foretold_row, noise_row, time_row};
        match asked {
            Asked::Noise(noise) => {
                self.0[0].push(noise_row(scene, noise, runs));
                self.0[1].push(foreseen_row(scene, noise, runs));
                self.0[3].extend(foretold_row(scene, noise, runs));
            }
            Asked::Time(_) => self.0[2].push(time_row(scene, asked, runs)),
        }
        self.filled().for_each(|rows| say::aside(&rows[rows.len() - 1]));
    }

    /// Those with more than a head.
    fn filled(&self) -> impl Iterator<Item = &Vec<String>> {
        self.0.iter().filter(|rows| rows.len() > 1)
    }
}

/// `--noise` and `--time`: what renders that are asked for them come to.
fn show_goals(args: &EvalArgs) -> Result<Ending, Failure> {
    let (mut all, mut tables) = (Vec::new(), GoalTables::new());
    for source in &args.scenes {
        let subject = subject(source)?.as_shown();
        goals_of(args, source, &subject, |asked, runs| {
            tables.add(&subject.name, asked, &runs);
            all.push((subject.name.clone(), runs));
        })?;
    }
    tables.filled().for_each(|rows| say::result(rows.join("\n") + "\n"));
    write_json(args, &all)?;
    Ok(Ending::Success)
}

/// Renders one scene to everything that is asked for, and hands over what each came to.
fn goals_of(
    args: &EvalArgs,
    source: &str,
    subject: &Subject,
    mut take: impl FnMut(Asked, Vec<GoalRun>),
) -> Result<(), Failure> {
    let spec = study_spec(args);
    let path = spec.shown_path(&args.cache.clone().unwrap_or_else(cache_directory), &subject.name);
    let spec = spec.reference(&subject.name);
    let drawing = || say::aside(format_args!("{source}: drawing the reference"));
    let reference = Reference::open_or_render(subject, &spec, &path, drawing)?;
    let noises = args.noise.iter().map(|&noise| Asked::Noise(noise));
    let mut before = None;
    for asked in noises.chain(args.time.iter().map(|&time| Asked::Time(time))) {
        if let (Asked::Noise(noise), Some(time)) = (asked, args.noise_time)
            && is_too_long(before, noise, time)
        {
            say::aside(format_args!("{source}: {} % would take too long", 100.0 * noise));
            continue;
        }
        let runs = goal_runs(subject, &reference, &goal_plan(args, asked))?;
        if let Asked::Noise(noise) = asked {
            let longest = runs.iter().map(|run| run.seconds).fold(0.0, f64::max);
            before = Some((noise, longest));
        }
        take(asked, runs);
    }
    Ok(())
}

fn goal_plan(args: &EvalArgs, asked: Asked) -> GoalPlan {
    GoalPlan {
        asked,
        runs: u32::try_from(args.runs.unwrap_or(20)).unwrap_or(u32::MAX),
        time: args.noise_time,
        seed: args.seed,
        min_samples: args.min_samples.unwrap_or(16),
        max_samples: args.samples.map_or(u32::MAX, |samples| samples.saturating_mul(2)),
    }
}

/// Whether renders to `noise` are expected to take more than twice `time`, where those to another noise took so many seconds.
fn is_too_long(before: Option<(f64, f64)>, noise: f64, time: Duration) -> bool {
    before.is_some_and(|(other, seconds)| seconds * (other / noise).powi(2) > 2.0 * time.as_secs_f64())
}

fn subject(source: &str) -> Result<Subject, Failure> {
    let subject = Subject::open(source)?;
    for warning in &subject.warnings {
        say::aside(format_args!("{source}: {warning}"));
    }
    Ok(subject)
}

fn look(args: &EvalArgs) -> Look {
    let [width, height] = args.size;
    Look { width, height, max_depth: args.max_depth, filter: args.filter.clone() }
}

/// `--live`.
fn render_live(
    args: &EvalArgs,
    source: &str,
    subject: &Subject,
    study: &Study,
    sweep: &[Series],
) -> Result<Vec<Live>, Failure> {
    let mut last = -1;
    let tell = |share: f64| {
        let tenth = (share * 10.0) as i32;
        if last != tenth {
            say::aside(format_args!("{source}: rendering live, {tenth}0 %"));
            last = tenth;
        }
    };
    Ok(live(subject, &study.bank, sweep, args.live, tell)?)
}

fn open(args: &EvalArgs, source: &str, subject: &Subject) -> Result<Study, Failure> {
    let spec = study_spec(args);
    let directory = args.cache.clone().unwrap_or_else(cache_directory);
    let mut last = (String::new(), -1);
    let tell = |what: &str, share: f64| {
        // Tenths are enough, on a terminal and in a log.
        let tenth = (share * 10.0) as i32;
        if last.0 != what || last.1 != tenth {
            say::aside(format_args!("{source}: making the {what} in {}, {tenth}0 %", directory.display()));
            last = (what.to_owned(), tenth);
        }
    };
    Ok(Study::open(subject, &spec, &directory, tell)?)
}

fn plan(args: &EvalArgs, study: &Study) -> Plan {
    let mut plan = Plan::new(&study.bank);
    if !args.methods.is_empty() {
        plan.methods.clone_from(&args.methods);
    }
    if !args.budgets.is_empty() {
        plan.budgets.clone_from(&args.budgets);
    }
    plan.runs = args.runs.unwrap_or(plan.runs);
    plan.settings.min_samples = args.min_samples.unwrap_or(plan.settings.min_samples);
    plan
}

fn write_reports(args: &EvalArgs, found: &[Found]) -> Result<(), Failure> {
    write_json(args, &found.iter().map(|f| &f.comparison).collect::<Vec<_>>())?;
    if let Some(path) = &args.html {
        let scenes: Vec<report::Scene<'_>> = found
            .iter()
            .map(|f| report::Scene {
                comparison: &f.comparison,
                sweep: &f.sweep,
                reference: &f.study.reference,
            })
            .collect();
        write(path, &report::html(&scenes, args.measure)?)?;
    }
    Ok(())
}

/// `--json`.
fn write_json(args: &EvalArgs, all: &impl Serialize) -> Result<(), Failure> {
    let Some(path) = &args.json else { return Ok(()) };
    let text = serde_json::to_string_pretty(all).map_err(|error| Failure::internal(error.to_string()))?;
    write(path, &text)
}

fn write(path: &Path, text: &str) -> Result<(), Failure> {
    write_atomically(path, |out| {
        out.write_all(text.as_bytes())
            .map_err(|source| quietus_film::OutputError::Write { path: path.to_owned(), source })
    })?;
    say::aside(format_args!("wrote {}", path.display()));
    Ok(())
}

impl From<EvalError> for Failure {
    fn from(error: EvalError) -> Self {
        let ending = match error {
            EvalError::Settings(_) | EvalError::Request(_) => Ending::Usage,
            EvalError::Io { .. } => Ending::Output,
            EvalError::NegativeSample { .. } => Ending::Internal,
            _ => Ending::Input,
        };
        Self { ending, message: error.to_string() }
    }
}
