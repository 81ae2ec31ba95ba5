//! What the default policy gains where noise is uneven but has no heavy tail: there it has to gain much, and a small loss of
//! gain is seen. The embedded scene, whose light comes by rare bright paths, cannot show that.
//!
//! Significance is 1e-6 for the suite of two tests: 5e-7 each by Sidak's correction.

use std::path::Path;

use quietus_eval::{
    BankSpec, Look, Method, Reference, ReferenceSpec, Subject,
    bank::record_in_memory,
    measure::Measure,
    reference::REFERENCE_SEED,
    sweep::{Plan, Series, sweep},
};
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Runs that share no sample.
const RUNS: u32 = 24;
/// Samples per pixel that methods are compared at.
const BUDGET: f64 = 64.0;
/// Of each test.
const SIGNIFICANCE: f64 = 5e-7;

/// A ball on a table in the light of a wide lamp, before an even sky: shadows are noisy, lit places less, the sky not at all.
const TABLE: &str = r#"
LookAt 0 2 6  0 0.6 0  0 1 0
Camera "perspective" "float fov" 50
Film "rgb" "integer xresolution" 40 "integer yresolution" 24
WorldBegin
LightSource "infinite" "rgb L" [0.3 0.35 0.4]
AttributeBegin
  Translate 1 4 1
  Rotate 90 1 0 0
  AreaLightSource "diffuse" "rgb L" [4 4 4]
  Shape "disk" "float radius" 1.2
AttributeEnd
Material "diffuse" "rgb reflectance" [0.6 0.5 0.4]
Shape "bilinearmesh" "point3 P" [-3 0 -3  3 0 -3  -3 0 3  3 0 3]
Translate 0 0.8 0
Shape "sphere" "float radius" 0.8
"#;

/// Student's t of the mean of independent values, less the quantile that it exceeds by chance with [`SIGNIFICANCE`].
fn beyond_chance(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let spread = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let quantile = StudentsT::new(0.0, 1.0, n - 1.0).unwrap().inverse_cdf(1.0 - SIGNIFICANCE);
    mean / (spread / n).sqrt() - quantile
}

fn squared_errors(series: &Series) -> Vec<f64> {
    series.runs.iter().map(|run| run.errors.mean(Measure::Weighted)).collect()
}

/// At as many samples, the squared error of the default policy is below 0.7 of that of uniform sampling, and below that of the
/// talk's tree.
#[test]
fn quotas_gain_much_on_ordinary_noise() {
    let scene = quietus_scene::load_bytes(Path::new("table.pbrt"), TABLE.as_bytes()).unwrap();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let subject = Subject::new("table", &scene.scene, Vec::new()).unwrap();
    let (look, scene) = (Look { max_depth: 4, ..Look::new(40, 24) }, subject.name.clone());
    let spec = BankSpec { scene: scene.clone(), look: look.clone(), streams: 2 * RUNS, samples: 96, seed: 0 };
    let bank = record_in_memory(&subject, &spec).unwrap();
    let spec = ReferenceSpec { scene, look, streams: 16, samples: 1024, seed: REFERENCE_SEED };
    let reference = Reference::render(&subject, &spec).unwrap();
    let plan =
        Plan { methods: vec![Method::Quietus, Method::Talk], budgets: vec![BUDGET], ..Plan::new(&bank) };
    let all = sweep(&bank, &reference, &plan).unwrap();
    let series = |method: Method| {
        let distance = |s: &&Series| (s.budget - BUDGET).abs();
        all.iter().filter(|s| s.method == method).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap()
    };
    let (quietus, talk, uniform) = (series(Method::Quietus), series(Method::Talk), series(Method::Uniform));
    let spp = |s: &Series| s.mean(|run| run.spp);
    for other in [uniform, talk] {
        assert!(
            spp(quietus) < 1.05 * spp(other),
            "the search found the budget: {} {}",
            spp(quietus),
            spp(other)
        );
    }
    for (other, share) in [(uniform, 0.7), (talk, 1.0)] {
        let pairs = squared_errors(other).into_iter().zip(squared_errors(quietus));
        let spare: Vec<f64> = pairs.map(|(other, own)| share * other - own).collect();
        let mean = |s: &Series| squared_errors(s).iter().sum::<f64>() / f64::from(RUNS);
        println!("{:?}: {:.3} of its error", other.method, mean(quietus) / mean(other));
        assert!(beyond_chance(&spare) > 0.0, "{:?}: {}", other.method, mean(quietus) / mean(other));
    }
}
