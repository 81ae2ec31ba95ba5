//! Whether a method is free of bias, shown as equivalence: confidence intervals of its brightness that lie within
//! margins, not just tests that find nothing.
//!
//! Many short runs, each with a seed of its own: its samples are recorded, the method and uniform sampling are
//! replayed on them, and the difference of their brightness is kept. Uniform sampling has no bias, and shares most
//! of the samples' noise with the method.

use quietus::Settings;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{
    BankSpec, EvalError, Look, Method, Reference, ReferenceSpec, Subject,
    bank::record_in_memory,
    measure::{Energy, EnergyMeter, relative},
    reference::REFERENCE_SEED,
    replay,
    statistics::{Estimate, mean_interval_at},
    sweep::find_target,
};

/// Confidence of the intervals: of the picture's, of the darkest fifth's, and of all tiles' together.
pub const CONFIDENCE: f64 = 0.99;

/// What the relative bias may be at most, either way.
pub const MARGINS: Margins = Margins { picture: 1e-3, darkest_fifth: 3e-3, tile: 5e-3 };

/// A tile is of typical brightness where it is at least this share of the median tile's.
const TYPICAL: f64 = 0.5;

/// Streams of the recording that the target error is searched on.
const PILOT_STREAMS: u32 = 8;

/// Seeds of the runs start here, far from those of recordings and references.
const FIRST_SEED: u64 = 1 << 32;

/// Largest relative biases that count as none.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Margins {
    /// Of the picture.
    pub picture: f64,
    /// Of the fifth that is darkest in the reference.
    pub darkest_fifth: f64,
    /// Of every 8x8 tile of typical brightness.
    pub tile: f64,
}

/// What to test.
#[derive(Clone, Debug)]
pub struct EquivalencePlan {
    /// The method.
    pub method: Method,
    /// How the scene is looked at.
    pub look: Look,
    /// Independent runs, at least 2.
    pub runs: u32,
    /// Mean samples per pixel of a run.
    pub budget: f64,
    /// Least samples of a pixel.
    pub min_samples: u32,
    /// Most samples of a pixel: even.
    pub max_samples: u32,
    /// Samples per pixel of the reference, which says how bright, and how dark, the picture is.
    pub reference_spp: u32,
}

/// What was found. Biases are relative to the reference's brightness; their intervals have [`CONFIDENCE`].
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Equivalence {
    /// The scene.
    pub scene: String,
    /// The method.
    pub method: Method,
    /// Runs.
    pub runs: u32,
    /// Mean samples per pixel.
    pub spp: f64,
    /// Target error that was found for the budget.
    pub target_error: f64,
    /// Of the picture.
    pub picture: Estimate,
    /// Of the fifth that is darkest in the reference.
    pub darkest_fifth: Estimate,
    /// Of the tile whose interval reaches farthest from 0, among those of typical brightness; intervals of all of
    /// these hold together (Sidak).
    pub worst_tile: Estimate,
    /// How many tiles are of typical brightness.
    pub tiles: usize,
    /// What was allowed.
    pub margins: Margins,
}

impl Equivalence {
    /// Whether all intervals lie within the margins.
    pub fn is_shown(&self) -> bool {
        let within = |estimate: Estimate, margin: f64| -margin < estimate.low && estimate.high < margin;
        within(self.picture, self.margins.picture)
            && within(self.darkest_fifth, self.margins.darkest_fifth)
            && within(self.worst_tile, self.margins.tile)
    }
}

/// Tests a method on a scene.
///
/// # Errors
/// Where the scene cannot be drawn, the plan makes no sense, or the method cannot be made to take the budget.
pub fn equivalence(subject: &Subject, plan: &EquivalencePlan) -> Result<Equivalence, EvalError> {
    if plan.runs < 2 {
        return Err(EvalError::Request("an equivalence test takes at least 2 runs".to_owned()));
    }
    let reference = reference(subject, plan)?;
    reference.expect_light()?;
    let meter = EnergyMeter::new(&reference);
    let settings = settings(subject, plan)?;
    let runs: Vec<Run> = (0..plan.runs)
        .into_par_iter()
        .map(|run| one_run(subject, plan, &settings, &meter, run))
        .collect::<Result<_, _>>()?;
    let of = |value: &dyn Fn(&Energy) -> f64, confidence: f64| {
        let whole = value(&meter.reference);
        let differences: Vec<f64> =
            runs.iter().map(|run| relative(value(&run.method) - value(&run.uniform), whole)).collect();
        mean_interval_at(&differences, confidence)
    };
    let typical = typical_tiles(&meter.reference.tiles);
    let each = CONFIDENCE.powf(1.0 / typical.len() as f64);
    let reach = |e: &Estimate| e.low.abs().max(e.high.abs());
    let tiles = typical.iter().map(|&tile| of(&|energy| energy.tiles[tile], each));
    let worst_tile = tiles.max_by(|a, b| reach(a).total_cmp(&reach(b)));
    Ok(Equivalence {
        scene: subject.name.clone(),
        method: plan.method,
        runs: plan.runs,
        spp: runs.iter().map(|run| run.spp).sum::<f64>() / f64::from(plan.runs),
        target_error: settings.target_error,
        picture: of(&|energy| energy.picture, CONFIDENCE),
        darkest_fifth: of(&|energy| energy.darkest_fifth, CONFIDENCE),
        worst_tile: worst_tile.ok_or_else(|| EvalError::Dark { scene: subject.name.clone() })?,
        tiles: typical.len(),
        margins: MARGINS,
    })
}

/// Energies of one run.
struct Run {
    method: Energy,
    uniform: Energy,
    spp: f64,
}

fn reference(subject: &Subject, plan: &EquivalencePlan) -> Result<Reference, EvalError> {
    const STREAMS: u32 = 32;
    let spec = ReferenceSpec {
        scene: subject.name.clone(),
        look: plan.look.clone(),
        streams: STREAMS,
        samples: plan.reference_spp.div_ceil(STREAMS),
        seed: REFERENCE_SEED,
    };
    Reference::render(subject, &spec)
}

/// The method's settings, with the target error that takes the budget on a recording of its own.
fn settings(subject: &Subject, plan: &EquivalencePlan) -> Result<Settings, EvalError> {
    let settings = plan.method.apply(&Settings {
        min_samples: plan.min_samples,
        max_samples: plan.max_samples,
        ..Settings::new(plan.look.width, plan.look.height)
    });
    let bank = record_in_memory(subject, &bank_spec(subject, plan, PILOT_STREAMS, 0))?;
    let runs = u64::from(PILOT_STREAMS / settings.replicates);
    let target_error = find_target(&bank, &settings, plan.budget, runs)?.ok_or_else(|| {
        let (method, budget) = (plan.method.name(), plan.budget);
        EvalError::Request(format!("{method} cannot be made to take {budget} samples per pixel here"))
    })?;
    Ok(Settings { target_error, ..settings })
}

fn bank_spec(subject: &Subject, plan: &EquivalencePlan, streams: u32, seed: u64) -> BankSpec {
    let samples = plan.max_samples.div_ceil(2);
    BankSpec { scene: subject.name.clone(), look: plan.look.clone(), streams, samples, seed }
}

fn one_run(
    subject: &Subject,
    plan: &EquivalencePlan,
    settings: &Settings,
    meter: &EnergyMeter,
    run: u32,
) -> Result<Run, EvalError> {
    let bank = record_in_memory(subject, &bank_spec(subject, plan, 2, FIRST_SEED + u64::from(run)))?;
    let found = replay(&bank, settings, 0)?;
    // Of an even number of samples near the budget, which does not depend on the run.
    let max_samples = ((plan.budget / 2.0).round() as u32 * 2).clamp(2, plan.max_samples);
    let min_samples = settings.min_samples.min(max_samples);
    let uniform = Method::Uniform.apply(&Settings { min_samples, max_samples, ..settings.clone() });
    let uniform = replay(&bank, &uniform, 0)?;
    Ok(Run {
        method: meter.measure(&found.picture),
        uniform: meter.measure(&uniform.picture),
        spp: found.samples_per_pixel(),
    })
}

/// Tiles that are at least half as bright as the median one.
fn typical_tiles(tiles: &[f64]) -> Vec<usize> {
    let mut sorted = tiles.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let least = TYPICAL * sorted[sorted.len() / 2];
    (0..tiles.len()).filter(|&tile| tiles[tile] >= least && tiles[tile] > 0.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn typical_tiles_are_neither_dark_nor_black() {
        assert_eq!(typical_tiles(&[1.0, 0.49, 0.5, 3.0, 1.0]), [0, 2, 3, 4]);
        assert_eq!(typical_tiles(&[0.0, 0.0]), [0_usize; 0]);
    }

    #[test]
    fn equivalence_takes_every_interval_within_its_margin() {
        let at = |value: f64, half: f64| Estimate { value, low: value - half, high: value + half };
        let shown = |picture, darkest_fifth, worst_tile| {
            let (scene, method, margins) = (String::new(), Method::Unbiased, MARGINS);
            let found = Equivalence {
                scene,
                method,
                runs: 2,
                spp: 1.0,
                target_error: 1.0,
                picture,
                darkest_fifth,
                worst_tile,
                tiles: 1,
                margins,
            };
            found.is_shown()
        };
        let good = [at(0.0, 0.0005), at(0.001, 0.0015), at(-0.002, 0.002)];
        assert!(shown(good[0], good[1], good[2]));
        assert!(!shown(at(0.0, 0.0011), good[1], good[2]), "nothing found is not enough");
        assert!(!shown(good[0], at(-0.004, 0.0005), good[2]));
        assert!(!shown(good[0], good[1], at(0.0049, 0.0002)));
    }
}
