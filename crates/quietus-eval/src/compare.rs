//! What the runs of a sweep say about each method: gain over uniform sampling, bias, artefacts, honesty.

use quietus_render::noise::Noise;
use serde::{Deserialize, Serialize};

use crate::{
    Bank, BankSpec, Method, Reference, ReferenceSpec,
    limit::{RayLimits, limit, ray_limits},
    live::Live,
    measure::{EnergyMeter, Measure, Structure, relative},
    statistics::{Estimate, bootstrap, mean, mean_interval},
    sweep::{RunRecord, Series},
};

/// Everything that is reported about one scene.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Comparison {
    /// What was replayed.
    pub bank: BankSpec,
    /// What it was compared with.
    pub reference: ReferenceSpec,
    /// What uniform sampling does, by measure.
    pub uniform: Vec<UniformCurve>,
    /// Every method at every budget, uniform sampling first.
    pub points: Vec<Point>,
}

/// How the error of uniform sampling falls.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct UniformCurve {
    /// The measure.
    pub measure: Measure,
    /// Samples per pixel and mean error.
    pub points: Vec<(f64, f64)>,
    /// The exponent a of the fit `error = c n^-a`: 1 for independent samples.
    pub exponent: f64,
    /// What the best allocation that is blind to the values it keeps could gain ([`crate::limit`]); none
    /// where the error does not fall as noise does.
    pub limit: Option<f64>,
    /// The same in rays.
    pub ray_limits: Option<RayLimits>,
}

/// One method at one budget. Intervals are 95 % confidence over independent runs.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Point {
    /// The method.
    pub method: Method,
    /// Samples per pixel asked for.
    pub budget: f64,
    /// Target error; none for uniform sampling.
    pub target_error: Option<f64>,
    /// Mean samples per pixel.
    pub spp: f64,
    /// Mean rays per pixel.
    pub rays: f64,
    /// Mean errors and gains, by measure.
    pub errors: Vec<ErrorPoint>,
    /// Mean FLIP.
    pub flip: Estimate,
    /// Root of the mean over runs of the worst tile's mean squared display error.
    pub worst_tile: f64,
    /// Mean 99.9th percentile of the display error.
    pub p999: f64,
    /// Relative bias, against uniform sampling of the same samples.
    pub bias: Bias,
    /// Block energy, edge steps and edge error, on the tile grid over displaced, relative to the same for
    /// uniform sampling: 1 where the error knows no tiles.
    pub structure: [Estimate; 3],
    /// Share of the picture in which sampling stopped.
    pub stopped: f64,
    /// Share of that whose true error is not below the target.
    pub false_stops: f64,
    /// Mean of true region error over target where it stopped.
    pub true_over_target: f64,
    /// When the late feature is found ([`crate::discovery`]); none where the reference has none.
    pub discovery: Option<Discovery>,
    /// How honest the noise is that renders report ([`quietus_render::noise`]); none where the bank has no streams to
    /// tell.
    pub noise: Option<NoisePoint>,
    /// What live renders took, where they were asked for.
    pub live: Option<Live>,
    /// Mean pixels re-opened in a run, each time counted.
    pub reopened_pixels: f64,
    /// Mean regions re-opened in a run.
    pub reopened_regions: f64,
}

/// When the late feature is found.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Discovery {
    /// Share of the runs that found it.
    pub found: f64,
    /// Mean samples per pixel of the whole picture that had been spent by then, over these runs; NaN for none.
    pub spp: Estimate,
}

/// The noise that renders report, against the true one.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct NoisePoint {
    /// Root mean square over runs of what is reported, over that of the true error in display space.
    pub reported_over_true: f64,
    /// Runs whose reported interval of 95 % holds their own true error.
    pub covered: u32,
    /// Runs.
    pub runs: u32,
    /// Mean width of the intervals, relative to the report.
    pub width: f64,
}

/// One measure of one point.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ErrorPoint {
    /// The measure.
    pub measure: Measure,
    /// Mean squared error over runs.
    pub error: Estimate,
    /// Its root: of the mean, where that is not negative by chance.
    pub root: Option<f64>,
    /// Samples that uniform sampling takes for the same error, over samples taken.
    pub gain: Estimate,
    /// The same for rays.
    pub gain_in_rays: Estimate,
    /// CPU time that uniform sampling takes for the same error, over CPU time taken; where there are live renders.
    pub gain_in_time: Option<Estimate>,
    /// Whether the error is below (above) all that uniform sampling was measured at, so that its fit was
    /// extended.
    pub extrapolated: bool,
    /// `(gain - 1) / (limit - 1)`.
    pub share_of_limit: Option<Estimate>,
}

/// Energy gained (positive) or lost, relative to the reference's.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Bias {
    /// Of the whole picture.
    pub picture: Estimate,
    /// Of the fifth that is darkest in the reference.
    pub darkest_fifth: Estimate,
    /// Of the tile that has most, chosen by one half of the runs and measured by the other, and the other way
    /// round.
    pub worst_tile: Estimate,
}

/// Summarizes a sweep.
///
/// # Panics
/// Where the sweep has no uniform series.
pub fn compare(bank: &Bank, reference: &Reference, sweep: &[Series]) -> Comparison {
    let uniform: Vec<&Series> = sweep.iter().filter(|s| s.method == Method::Uniform).collect();
    assert!(!uniform.is_empty(), "a sweep is compared with its uniform series");
    let meter = EnergyMeter::new(reference);
    let curves: Vec<UniformCurve> =
        Measure::ALL.iter().map(|&measure| uniform_curve(bank, reference, measure, &uniform)).collect();
    Comparison {
        bank: bank.spec().clone(),
        reference: reference.spec.clone(),
        points: sweep.iter().map(|series| point(series, &uniform, &curves, &meter)).collect(),
        uniform: curves,
    }
}

fn uniform_curve(bank: &Bank, reference: &Reference, measure: Measure, uniform: &[&Series]) -> UniformCurve {
    let points: Vec<(f64, f64)> =
        uniform.iter().map(|s| (s.mean(|r| r.spp), s.mean(|r| r.errors.mean(measure)))).collect();
    let exponent = Curve::new(&points).exponent;
    UniformCurve {
        measure,
        points,
        exponent,
        limit: limit(reference, measure, exponent),
        ray_limits: ray_limits(reference, measure, exponent, bank.rays()),
    }
}

/// Errors over samples on logarithmic scales, linear between the points, and the fitted line beyond.
struct Curve {
    /// Logarithms of samples and errors.
    points: Vec<[f64; 2]>,
    exponent: f64,
}

impl Curve {
    /// Points without a positive error are left out.
    fn new(points: &[(f64, f64)]) -> Self {
        let points: Vec<[f64; 2]> =
            points.iter().filter(|p| p.1 > 0.0).map(|&(n, error)| [n.ln(), error.ln()]).collect();
        let n = points.len() as f64;
        let center = [0, 1].map(|i| points.iter().map(|p| p[i]).sum::<f64>() / n);
        let moment = |i: usize| points.iter().map(|p| (p[0] - center[0]) * (p[i] - center[i])).sum::<f64>();
        Self { exponent: -moment(1) / moment(0), points }
    }

    /// Samples at which the error is `error`, and whether that is beyond the points. NaN for no positive
    /// error.
    fn samples(&self, error: f64) -> (f64, bool) {
        let wanted = error.ln();
        let falls = |pair: &&[[f64; 2]]| pair[0][1] >= wanted && wanted >= pair[1][1];
        if let Some([[n0, e0], [n1, e1]]) = self.points.windows(2).find(falls).and_then(|p| p.first_chunk()) {
            let t = if e0 == e1 { 0.0 } else { (e0 - wanted) / (e0 - e1) };
            return ((n0 + t * (n1 - n0)).exp(), false);
        }
        let (Some(first), Some(last)) = (self.points.first(), self.points.last()) else {
            return (f64::NAN, true);
        };
        let [n, e] = if wanted > first[1] { first } else { last };
        ((n + (e - wanted) / self.exponent).exp(), true)
    }
}

fn point(series: &Series, uniform: &[&Series], curves: &[UniformCurve], meter: &EnergyMeter) -> Point {
    let values = |value: &dyn Fn(&RunRecord) -> f64| -> Vec<f64> { series.runs.iter().map(value).collect() };
    let spp = series.mean(|r| r.spp);
    Point {
        method: series.method,
        budget: series.budget,
        target_error: series.target_error,
        spp,
        rays: series.mean(|r| r.rays),
        errors: curves.iter().map(|curve| error_point(series, uniform, curve)).collect(),
        flip: mean_interval(&values(&|r| r.flip)),
        worst_tile: series.mean(|r| r.errors.worst_tile).max(0.0).sqrt(),
        p999: series.mean(|r| r.errors.p999),
        bias: bias(series, control(series, uniform), meter),
        structure: [0, 1, 2].map(|i| structure_ratio(series, control(series, uniform), i)),
        stopped: series.mean(|r| r.stops.stopped),
        false_stops: series.mean(|r| r.stops.false_stops),
        true_over_target: series.mean(|r| r.stops.true_over_target),
        discovery: series.discoveries.as_deref().map(discovery),
        noise: noise(series),
        live: None,
        reopened_pixels: series.mean(|r| r.reopened_pixels as f64),
        reopened_regions: series.mean(|r| r.reopened_regions as f64),
    }
}

fn discovery(runs: &[Option<f64>]) -> Discovery {
    let spent: Vec<f64> = runs.iter().flatten().copied().collect();
    Discovery { found: spent.len() as f64 / runs.len() as f64, spp: mean_interval(&spent) }
}

fn noise(series: &Series) -> Option<NoisePoint> {
    let reports: Option<Vec<Noise>> = series.runs.iter().map(|run| run.noise).collect();
    let reports = reports?;
    let truths: Vec<f64> = series.runs.iter().map(|run| run.errors.mean(Measure::Display)).collect();
    let squares: f64 = reports.iter().map(|noise| noise.reached * noise.reached).sum();
    let covers = |(noise, &truth): (&Noise, &f64)| (noise.low..=noise.high).contains(&truth.max(0.0).sqrt());
    let width = |noise: &Noise| (noise.high - noise.low) / noise.reached;
    Some(NoisePoint {
        reported_over_true: (squares / truths.iter().sum::<f64>()).sqrt(),
        covered: reports.iter().zip(&truths).filter(|pair| covers(*pair)).count() as u32,
        runs: reports.len() as u32,
        width: reports.iter().map(width).sum::<f64>() / reports.len() as f64,
    })
}

impl Comparison {
    /// Adds what live renders took, one entry for each point, and the gains at equal CPU time: gains in samples
    /// times what a sample of uniform sampling costs over what one of the method costs. Costs are compared within
    /// rounds of renders; their interval (Student's, of the logarithm) and the gain's are added in quadrature.
    ///
    /// # Panics
    /// Where there are not as many entries as points, or no uniform point.
    pub fn add_live(&mut self, live: &[Live]) {
        assert_eq!(live.len(), self.points.len(), "live renders of other points");
        let uniform: Vec<&Live> = self
            .points
            .iter()
            .zip(live)
            .filter(|(p, _)| p.method == Method::Uniform)
            .map(|(_, l)| l)
            .collect();
        let round = |r: usize| {
            let seconds: f64 = uniform.iter().map(|l| l.cpu_seconds[r]).sum();
            seconds / uniform.iter().map(|l| l.samples[r] as f64).sum::<f64>()
        };
        let costs: Vec<f64> = (0..uniform[0].cpu_seconds.len()).map(round).collect();
        for (point, live) in self.points.iter_mut().zip(live) {
            let ratios: Vec<f64> = costs
                .iter()
                .zip(live.seconds_per_sample())
                .map(|(uniform, own)| (uniform / own).ln())
                .collect();
            let ratio = mean_interval(&ratios);
            for error in &mut point.errors {
                error.gain_in_time = Some(times_exp(error.gain, ratio));
            }
            point.live = Some(live.clone());
        }
    }
}

/// An estimate times the exponential of an independent one.
fn times_exp(gain: Estimate, log: Estimate) -> Estimate {
    let value = gain.value * log.value.exp();
    let reach = |end: f64, log_half: f64| ((end / gain.value).ln().powi(2) + log_half.powi(2)).sqrt();
    let (low, high) = (reach(gain.low, log.value - log.low), reach(gain.high, log.high - log.value));
    Estimate { value, low: value * (-low).exp(), high: value * high.exp() }
}

/// Mean of a measure over some runs.
fn mean_over(series: &Series, measure: Measure, runs: &[usize]) -> f64 {
    runs.iter().map(|&i| series.runs[i].errors.mean(measure)).sum::<f64>() / runs.len() as f64
}

fn error_point(series: &Series, uniform: &[&Series], curve: &UniformCurve) -> ErrorPoint {
    let measure = curve.measure;
    let values: Vec<f64> = series.runs.iter().map(|r| r.errors.mean(measure)).collect();
    // Uniform sampling and the method are resampled together: their runs share samples.
    let samples = |runs: &[usize]| {
        let points: Vec<(f64, f64)> =
            uniform.iter().map(|u| (u.runs[0].spp, mean_over(u, measure, runs))).collect();
        Curve::new(&points).samples(mean_over(series, measure, runs))
    };
    let spent = |runs: &[usize], value: &dyn Fn(&RunRecord) -> f64| {
        runs.iter().map(|&i| value(&series.runs[i])).sum::<f64>() / runs.len() as f64
    };
    let gain = bootstrap(series.runs.len(), |runs| samples(runs).0 / spent(runs, &|r| r.spp));
    let rays_per_sample = uniform[0].runs[0].rays / uniform[0].runs[0].spp;
    let in_rays = spent(&(0..series.runs.len()).collect::<Vec<_>>(), &|r| r.spp * rays_per_sample / r.rays);
    let all: Vec<usize> = (0..series.runs.len()).collect();
    let error = mean_interval(&values);
    ErrorPoint {
        measure,
        error,
        root: (error.value >= 0.0).then(|| error.value.sqrt()),
        gain,
        gain_in_rays: gain.map(|g| g * in_rays),
        gain_in_time: None,
        extrapolated: samples(&all).1,
        share_of_limit: curve.limit.map(|limit| gain.map(|g| (g - 1.0) / (limit - 1.0))),
    }
}

/// The uniform series whose samples are nearest in number: subtracted, it takes most of the noise with it.
fn control<'a>(series: &Series, uniform: &[&'a Series]) -> &'a Series {
    let distance = |u: &Series| (u.mean(|r| r.spp) / series.mean(|r| r.spp)).ln().abs();
    uniform.iter().copied().min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(uniform[0])
}

fn bias(series: &Series, control: &Series, meter: &EnergyMeter) -> Bias {
    let pairs = || series.runs.iter().zip(&control.runs);
    let reference = &meter.reference;
    let picture: Vec<f64> =
        pairs().map(|(a, b)| relative(a.energy.picture - b.energy.picture, reference.picture)).collect();
    let darkest: Vec<f64> = pairs()
        .map(|(a, b)| relative(a.energy.darkest_fifth - b.energy.darkest_fifth, reference.darkest_fifth))
        .collect();
    // A tile without light has no relative bias: a hundredth of the picture's mean is the least that counts.
    let floor = 0.01 * reference.picture;
    let tiles: Vec<Vec<f64>> = pairs()
        .map(|(a, b)| {
            let tiles = a.energy.tiles.iter().zip(&b.energy.tiles).zip(&reference.tiles);
            tiles.map(|((a, b), r)| (a - b) / r.max(floor)).collect()
        })
        .collect();
    Bias {
        picture: mean_interval(&picture),
        darkest_fifth: mean_interval(&darkest),
        worst_tile: worst_tile(&tiles),
    }
}

/// The bias of the most biased tile. Choosing and measuring by the same runs would find bias in noise: each
/// half of the runs chooses the tile whose bias is surest to be far from 0, the other half measures it.
fn worst_tile(runs: &[Vec<f64>]) -> Estimate {
    let (even, odd): (Vec<_>, Vec<_>) = runs.iter().enumerate().partition(|(i, _)| i % 2 == 0);
    let halves = [even, odd].map(|half| half.into_iter().map(|(_, tiles)| tiles).collect::<Vec<_>>());
    let choose = |half: &[&Vec<f64>]| {
        let distance = |tile: usize| {
            let values: Vec<f64> = half.iter().map(|tiles| tiles[tile]).collect();
            let m = mean(&values);
            let spread = values.iter().map(|v| (v - m).powi(2)).sum::<f64>();
            m.abs() - (spread / values.len() as f64 / (values.len() as f64 - 1.0).max(1.0)).sqrt()
        };
        (0..half[0].len()).max_by(|&a, &b| distance(a).total_cmp(&distance(b))).unwrap_or(0)
    };
    let tiles = [choose(&halves[1]), choose(&halves[0])];
    let mut values = Vec::new();
    for (half, tile) in halves.iter().zip(tiles) {
        values.extend(half.iter().map(|run| run[tile]));
    }
    mean_interval(&values)
}

fn structure_ratio(series: &Series, control: &Series, which: usize) -> Estimate {
    let ratio = |series: &Series, runs: &[usize]| {
        let mut sum = Structure::default();
        runs.iter().for_each(|&i| sum += &series.runs[i].structure);
        sum.ratios()[which]
    };
    bootstrap(series.runs.len(), |runs| ratio(series, runs) / ratio(control, runs))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_are_read_between_and_beyond_their_points() {
        let curve = Curve::new(&[(8.0, 2.0), (16.0, 1.0), (64.0, 0.25)]);
        assert!((curve.exponent - 1.0).abs() < 1e-12);
        for (error, n, beyond) in
            [(1.0, 16.0, false), (0.5, 32.0, false), (4.0, 4.0, true), (0.125, 128.0, true)]
        {
            let (found, extrapolated) = curve.samples(error);
            assert!((found - n).abs() < 1e-9 && extrapolated == beyond, "{error}: {found}");
        }
        assert!(curve.samples(-1.0).0.is_nan());
    }

    #[test]
    fn gains_in_time_have_the_uncertainty_of_both() {
        let estimate =
            |value: f64, factor: f64| Estimate { value, low: value / factor, high: value * factor };
        // Gain 2 within a factor e^0.3, cost ratio e^-0.5 within e^0.4: e^0.5 in quadrature.
        let found = times_exp(estimate(2.0, 0.3_f64.exp()), Estimate { value: -0.5, low: -0.9, high: -0.1 });
        assert!((found.value - 2.0 * (-0.5_f64).exp()).abs() < 1e-12);
        assert!((found.low - found.value * (-0.5_f64).exp()).abs() < 1e-12, "{found:?}");
        assert!((found.high - found.value * 0.5_f64.exp()).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn the_worst_tile_is_measured_by_runs_that_did_not_choose_it() {
        // Tile 2 is biased by -0.2 in all runs; tile 0 only by chance in those of one half.
        let runs: Vec<Vec<f64>> =
            (0..8).map(|i| vec![if i % 2 == 0 { -0.5 } else { 0.5 }, 0.0, -0.2]).collect();
        let found = worst_tile(&runs);
        assert_eq!(found.value, 0.0, "chosen by one half at -0.5, found +0.5 by the other: no bias shown");
        let runs: Vec<Vec<f64>> = (0..8).map(|i| vec![0.01 * f64::from(i % 3), 0.0, -0.2]).collect();
        assert!((worst_tile(&runs).value + 0.2).abs() < 1e-12);
    }
}
