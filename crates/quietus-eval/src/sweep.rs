//! The sweep: every method at every budget, many runs each.

use quietus::Settings;
use quietus_render::noise::Noise;
use rayon::prelude::*;

use crate::{
    Bank, EvalError, Method, Reference, Replay,
    discovery::{Feature, discovery},
    measure::{Energy, EnergyMeter, Errors, Stops, Structure, errors, flip, stops, structure},
    noise_check::reported_noise,
    replay,
    runs::independent_runs,
};

/// What to compare.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Methods beside uniform sampling, which is always there to compare with.
    pub methods: Vec<Method>,
    /// Mean samples per pixel at which methods are compared; the target error of each method is chosen so
    /// that it takes about as many.
    pub budgets: Vec<f64>,
    /// Runs of each method at each budget: at least 2, at most as many as share no sample.
    pub runs: u64,
    /// Everything else: least and most samples, regions, mode, replicates. Policy and target are the methods'
    /// own.
    pub settings: Settings,
}

impl Plan {
    /// All methods at budgets from 24 to 256 samples per pixel (as far as the bank reaches), with as many
    /// runs as share no sample, and the library's defaults.
    pub fn new(bank: &Bank) -> Self {
        let spec = bank.spec();
        let mut settings = Settings::new(spec.look.width, spec.look.height);
        settings.max_samples = settings.max_samples.min(spec.samples * settings.replicates);
        let reach = f64::from(settings.max_samples) / 2.0;
        let budgets = [24.0, 32.0, 48.0, 64.0, 96.0, 128.0, 192.0, 256.0];
        Self {
            methods: Method::ALL[1..].to_vec(),
            budgets: budgets.into_iter().filter(|&b| b <= reach).collect(),
            runs: independent_runs(spec.streams, settings.replicates).into(),
            settings,
        }
    }
}

/// What one run was found to be.
#[derive(Clone, Debug)]
pub struct RunRecord {
    /// Mean samples of a pixel.
    pub spp: f64,
    /// Mean rays of a pixel.
    pub rays: f64,
    /// How far the picture is from the reference.
    pub errors: Errors,
    /// Mean FLIP.
    pub flip: f64,
    /// How bright it is.
    pub energy: Energy,
    /// The noise that the render would report, where the bank has streams to measure it with.
    pub noise: Option<Noise>,
    /// Whether its error knows tiles.
    pub structure: Structure,
    /// How well it stopped.
    pub stops: Stops,
    /// Pixels that were complete and then active again, counted each time.
    pub reopened_pixels: u64,
    /// Regions that were complete and then active again, counted each time.
    pub reopened_regions: u64,
}

/// All runs of one method at one budget.
#[derive(Clone, Debug)]
pub struct Series {
    /// The method.
    pub method: Method,
    /// Samples per pixel asked for.
    pub budget: f64,
    /// The target error that takes about as many; none for uniform sampling.
    pub target_error: Option<f64>,
    /// What was replayed.
    pub settings: Settings,
    /// Runs in which the late feature was found, with the samples per pixel spent by then; none where the
    /// reference has no such feature.
    pub discoveries: Option<Vec<Option<f64>>>,
    /// Its runs; equal places used the same samples, in all series of a sweep.
    pub runs: Vec<RunRecord>,
    /// The first of them whole.
    pub first: Replay,
}

impl Series {
    /// Mean over runs.
    pub fn mean(&self, value: impl Fn(&RunRecord) -> f64) -> f64 {
        self.runs.iter().map(value).sum::<f64>() / self.runs.len() as f64
    }
}

/// A sweep over one scene: uniform sampling first, then method by method, budgets rising. Budgets that a
/// method cannot be made to take (because it starts with more samples, or by leaps) are left out.
///
/// # Errors
/// Where the plan does not fit bank and reference.
pub fn sweep(bank: &Bank, reference: &Reference, plan: &Plan) -> Result<Vec<Series>, EvalError> {
    check(bank, reference, plan)?;
    let context = Context {
        bank,
        reference,
        meter: EnergyMeter::new(reference),
        feature: Feature::of(reference),
        plan,
    };
    let uniform = uniform_counts(plan).into_iter().map(|n| (Method::Uniform, n));
    let adaptive = plan.methods.iter().filter(|m| **m != Method::Uniform);
    let adaptive = adaptive.flat_map(|&m| plan.budgets.iter().map(move |&b| (m, b)));
    let cells: Vec<(Method, f64)> = uniform.chain(adaptive).collect();
    cells.into_par_iter().filter_map(|(method, budget)| context.series(method, budget).transpose()).collect()
}

fn check(bank: &Bank, reference: &Reference, plan: &Plan) -> Result<(), EvalError> {
    let refuse = |message: String| Err(EvalError::Request(message));
    let (spec, other) = (bank.spec(), &reference.spec);
    if spec.look != other.look || spec.scene != other.scene {
        return refuse(format!(
            "bank and reference do not belong together: {} {:?}, and {} {:?}",
            spec.scene, spec.look, other.scene, other.look
        ));
    }
    let most = independent_runs(spec.streams, plan.settings.replicates);
    if plan.runs < 2 || plan.runs > most.into() {
        return refuse(format!(
            "{} runs were asked for: confidence intervals need at least 2, and the bank's {} streams hold {most} \
             that share no sample",
            plan.runs, spec.streams
        ));
    }
    if plan.budgets.is_empty() {
        return refuse("no budget was asked for, or none that the bank reaches".to_owned());
    }
    if let Some(bad) = plan.budgets.iter().find(|b| !(b.is_finite() && **b > 0.0)) {
        return refuse(format!("a budget of {bad} samples per pixel: expected a number above 0"));
    }
    let (seeds, streams) = (spec.seed..spec.seed + u64::from(spec.streams), u64::from(other.streams));
    if (other.seed..other.seed + streams).any(|seed| seeds.contains(&seed)) {
        return refuse("bank and reference share seeds, so they are not independent".to_owned());
    }
    Ok(())
}

/// Even counts from a quarter of the least budget to all the bank holds, in steps of about the square root of
/// 2.
fn uniform_counts(plan: &Plan) -> Vec<f64> {
    let step = f64::from(plan.settings.replicates);
    let least = plan.budgets.iter().copied().fold(f64::INFINITY, f64::min) / 4.0;
    let most = f64::from(plan.settings.max_samples);
    let mut counts = Vec::new();
    let mut n = least.max(step);
    while n < most {
        counts.push((n / step).round() * step);
        n *= std::f64::consts::SQRT_2;
    }
    counts.push(most);
    counts.dedup();
    counts
}

/// What all series of a sweep share.
struct Context<'a> {
    bank: &'a Bank,
    reference: &'a Reference,
    meter: EnergyMeter,
    feature: Option<Feature>,
    plan: &'a Plan,
}

impl Context<'_> {
    fn record(&self, replay: &Replay, settings: &Settings, run: u64) -> RunRecord {
        let reference = self.reference;
        RunRecord {
            spp: replay.samples_per_pixel(),
            rays: replay.rays / replay.counts.len() as f64,
            errors: errors(&replay.picture, reference),
            flip: flip(&replay.picture, &reference.mean),
            energy: self.meter.measure(&replay.picture),
            noise: reported_noise(self.bank, replay, run),
            structure: structure(&replay.picture, reference),
            stops: stops(replay, reference, settings),
            reopened_pixels: replay.statistics.reopened_pixels,
            reopened_regions: replay.statistics.reopened_regions,
        }
    }

    fn series(&self, method: Method, budget: f64) -> Result<Option<Series>, EvalError> {
        let (bank, plan) = (self.bank, self.plan);
        let mut settings = method.apply(&plan.settings);
        let target_error = if method == Method::Uniform {
            settings.max_samples = budget as u32;
            settings.min_samples = settings.min_samples.min(settings.max_samples);
            None
        } else {
            let Some(target) = find_target(bank, &settings, budget, plan.runs)? else { return Ok(None) };
            settings.target_error = target;
            Some(target)
        };
        let replays: Vec<Replay> = (0..plan.runs)
            .into_par_iter()
            .map(|run| replay(bank, &settings, run))
            .collect::<Result<_, _>>()?;
        let runs = replays.par_iter().enumerate();
        let runs = runs.map(|(run, replay)| self.record(replay, &settings, run as u64)).collect();
        let discoveries = self.feature.as_ref().map(|feature| {
            (0..plan.runs).into_par_iter().map(|run| discovery(bank, &settings, run, feature)).collect()
        });
        let first = replays.into_iter().next();
        let first = first.ok_or_else(|| EvalError::Request("a series without runs".to_owned()))?;
        let discoveries = discoveries.transpose()?;
        Ok(Some(Series { method, budget, target_error, settings, discoveries, runs, first }))
    }
}

/// Range of the logarithm of the target error: from far below a step of the pixel error to far above its
/// largest value.
const TARGETS: [f64; 2] = [-9.0, 4.0];
/// Halvings of that range: 1e-4 of a decade is left.
const HALVINGS: u32 = 17;
/// Most runs that are averaged for the search.
const PILOT_RUNS: u64 = 4;
/// How far the samples may be from the budget, relatively: near enough for the search to end, and to be of
/// use.
const NEAR: [f64; 2] = [0.005, 0.1];

/// The target error with which the method of `settings` takes `budget` samples per pixel, found by halving
/// over the mean of the first `runs` runs (at most four); none where it can't be made to take within a tenth
/// of that.
///
/// # Errors
/// As [`replay()`].
pub fn find_target(
    bank: &Bank,
    settings: &Settings,
    budget: f64,
    runs: u64,
) -> Result<Option<f64>, EvalError> {
    let pilots = runs.clamp(1, PILOT_RUNS);
    let [mut low, mut high] = TARGETS;
    let mut best = (f64::INFINITY, None);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        let tried = Settings { target_error: 10.0_f64.powf(middle), ..settings.clone() };
        let spp: Result<Vec<f64>, EvalError> = (0..pilots)
            .into_par_iter()
            .map(|run| replay(bank, &tried, run).map(|r| r.samples_per_pixel()))
            .collect();
        let spp = spp?.iter().sum::<f64>() / pilots as f64;
        let distance = (spp / budget - 1.0).abs();
        if distance < best.0 {
            best = (distance, Some(tried.target_error));
        }
        if distance < NEAR[0] {
            break;
        }
        // A larger error is reached with fewer samples.
        if spp > budget { low = middle } else { high = middle }
    }
    Ok(best.1.filter(|_| best.0 < NEAR[1]))
}
