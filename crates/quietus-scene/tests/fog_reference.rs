//! A box full of coloured fog against Mitsuba 3, an independent renderer.
//!
//! The scene has a medium around the camera, glass filled with dye, and a border between media that is nothing else;
//! coefficients and phase functions differ by colour and place. `reference/fog_mitsuba.py` drew it with `volpath` and
//! printed the numbers below.

use std::path::Path;

use glam::DVec3;
use quietus_trace::filter::Filter;
use quietus_trace::scene::Scene;
use quietus_trace::tile::{PixelWork, Sample, SampleSink, render_tile};
use quietus_trace::view::View;
use statrs::distribution::{ContinuousCDF, StudentsT};

const SIZE: u32 = 40;
/// Segments, as Mitsuba counts its depth.
const MAX_DEPTH: u32 = 16;
/// Independent samples per pixel.
const REPLICATES: u8 = 96;
/// Probability that the test fails although both renderers are right.
const SIGNIFICANCE: f64 = 1e-6;

/// Means and standard errors of the quarters of Mitsuba's picture, row by row.
const MITSUBA: [([f64; 3], [f64; 3]); 4] = [
    ([0.617409, 0.328978, 0.272962], [0.002753, 0.001208, 0.000919]),
    ([0.719983, 0.304, 0.271161], [0.002742, 0.001218, 0.000945]),
    ([0.227877, 0.116054, 0.102985], [0.001272, 0.000336, 0.000402]),
    ([0.262336, 0.104486, 0.104709], [0.001268, 0.0003, 0.000376]),
];

/// Sums of the quarters of the picture, by replicate.
struct Quarters(Vec<[DVec3; 4]>);

impl SampleSink for Quarters {
    fn add(&mut self, work: &PixelWork, _: u32, sample: &Sample) {
        let quarter = work.y / (SIZE / 2) * 2 + work.x / (SIZE / 2);
        self.0[usize::from(work.replicate)][quarter as usize] += sample.radiance.as_dvec3();
    }
}

#[test]
fn fog_agrees_with_mitsuba() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference/fog.pbrt");
    let desc = quietus_scene::load(&path).expect("a sound file").scene;
    let scene = Scene::build(&desc).expect("a sound scene");
    let view = View::new(&desc.cameras[0], [SIZE; 2], Filter::BOX, MAX_DEPTH, 0).expect("a sound camera");
    let runs = (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (x, y)));
    let work: Vec<_> = runs
        .flat_map(|(x, y)| (0..REPLICATES).map(move |replicate| (x, y, replicate)))
        .map(|(x, y, replicate)| PixelWork { x, y, pixel: 0, replicate, first: 0, count: 1 })
        .collect();
    let mut quarters = Quarters(vec![[DVec3::ZERO; 4]; usize::from(REPLICATES)]);
    render_tile(&scene, &view, &work, &mut quarters);
    let (count, area) = (f64::from(REPLICATES), f64::from(SIZE * SIZE / 4));
    // Fewer degrees of freedom than the two errors have together.
    let distribution = StudentsT::new(0.0, 1.0, count - 1.0).expect("a sound distribution");
    // One test per quarter and channel (Sidak 1967).
    let significance = -((-SIGNIFICANCE).ln_1p() / 12.0).exp_m1();
    for (quarter, (expected, error)) in MITSUBA.iter().enumerate() {
        for channel in 0..3 {
            let means = quarters.0.iter().map(|replicate| replicate[quarter][channel] / area);
            let mean = means.clone().sum::<f64>() / count;
            let variance = means.map(|m| (m - mean).powi(2)).sum::<f64>() / (count - 1.0) / count;
            let z = (mean - expected[channel]) / variance.sqrt().hypot(error[channel]);
            let p = 2.0 * distribution.sf(z.abs());
            println!(
                "quarter {quarter}, channel {channel}: {mean:.5} against {:.5}, z = {z:.2}",
                expected[channel]
            );
            assert!(p >= significance, "quarter {quarter}, channel {channel}: z = {z:.2}");
        }
    }
}
