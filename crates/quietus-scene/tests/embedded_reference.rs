//! The embedded scene against Mitsuba 3, an independent renderer: `reference/embedded_mitsuba.py` made the picture.
//!
//! Light through glass has heavy tails, so means over tiles of 8x8 pixels are compared, by the variances that
//! independent batches of both renderers show.

use std::collections::HashMap;
use std::path::Path;

use exr::prelude::{ReadChannels, ReadLayers, read};
use glam::DVec3;
use quietus_trace::desc::{ColorParam, Roughness, SceneDesc, Surface};
use quietus_trace::filter::Filter;
use quietus_trace::scene::Scene;
use quietus_trace::tile::{PixelWork, Sample, SampleSink, render_tile};
use quietus_trace::view::View;
use statrs::distribution::{ContinuousCDF, Normal};

const SIZE: usize = 64;
const TILE: usize = 8;
const MAX_DEPTH: u32 = 8;
/// Independent batches per pixel, and samples in each.
const REPLICATES: u8 = 16;
const SPP: u32 = 32;
/// Probability that the test fails although both renderers are right.
const SIGNIFICANCE: f64 = 1e-6;

/// What both renderers can express exactly: smooth metals, and a diffuse ball instead of porcelain.
fn simplified() -> SceneDesc {
    let mut scene = quietus_scene::embedded();
    for material in &mut scene.materials {
        match &mut material.surface {
            Surface::Conductor { roughness, .. } => *roughness = Roughness::SMOOTH,
            Surface::MetalRough(m) => {
                let reflectance = ColorParam::constant(m.base_color.factor);
                material.surface = Surface::Diffuse { reflectance };
            }
            _ => {}
        }
    }
    scene
}

/// Mean and variance of the mean, per tile and channel.
struct Tiles(Vec<(DVec3, DVec3)>);

impl Tiles {
    /// From means and variances of pixels, which are independent.
    fn new(pixel: impl Fn(usize, usize) -> (DVec3, DVec3)) -> Self {
        let area = (TILE * TILE) as f64;
        let tile = |tile: usize| {
            let (left, top) = (tile % (SIZE / TILE) * TILE, tile / (SIZE / TILE) * TILE);
            let pixels = (0..TILE * TILE).map(|i| pixel(left + i % TILE, top + i / TILE));
            let (mean, variance) =
                pixels.fold((DVec3::ZERO, DVec3::ZERO), |sum, p| (sum.0 + p.0, sum.1 + p.1));
            (mean / area, variance / (area * area))
        };
        Self((0..(SIZE / TILE).pow(2)).map(tile).collect())
    }
}

/// Sums of each replicate of each pixel.
struct Batches(Vec<DVec3>);

impl SampleSink for Batches {
    fn add(&mut self, work: &PixelWork, _: u32, sample: &Sample) {
        let pixel = work.y as usize * SIZE + work.x as usize;
        self.0[pixel * usize::from(REPLICATES) + usize::from(work.replicate)] += sample.radiance.as_dvec3();
    }
}

fn ours() -> Tiles {
    let desc = simplified();
    let scene = Scene::build(&desc).expect("the embedded scene is sound");
    let size = [SIZE as u32; 2];
    let view = View::new(&desc.cameras[0], size, Filter::BOX, MAX_DEPTH, 0).expect("a sound camera");
    let mut batches = Batches(vec![DVec3::ZERO; SIZE * SIZE * usize::from(REPLICATES)]);
    let runs = (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (x, y)));
    let work: Vec<_> = runs
        .flat_map(|(x, y)| (0..REPLICATES).map(move |replicate| (x, y, replicate)))
        .map(|(x, y, replicate)| PixelWork { x, y, pixel: 0, replicate, first: 0, count: SPP })
        .collect();
    render_tile(&scene, &view, &work, &mut batches);
    Tiles::new(|x, y| {
        let n = usize::from(REPLICATES);
        let batches = &batches.0[(y * SIZE + x) * n..][..n];
        let mean = batches.iter().sum::<DVec3>() / n as f64;
        let spread: DVec3 = batches.iter().map(|b| (b - mean) * (b - mean)).sum();
        let spp = f64::from(SPP);
        (mean / spp, spread / ((n * (n - 1)) as f64 * spp * spp))
    })
}

fn reference() -> Tiles {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference/embedded.exr");
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_file(&path)
        .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    assert_eq!((image.layer_data.size.0, image.layer_data.size.1), (SIZE, SIZE));
    let channels: HashMap<String, Vec<f32>> = image
        .layer_data
        .channel_data
        .list
        .into_iter()
        .map(|channel| (channel.name.to_string(), channel.sample_data.values_as_f32().collect()))
        .collect();
    let at = |names: [&str; 3], pixel: usize| DVec3::from_array(names.map(|n| f64::from(channels[n][pixel])));
    Tiles::new(|x, y| {
        let pixel = y * SIZE + x;
        (at(["R", "G", "B"], pixel), at(["V.R", "V.G", "V.B"], pixel))
    })
}

#[test]
fn embedded_scene_agrees_with_mitsuba() {
    let (ours, reference) = (ours(), reference());
    let tests = ours.0.len() * 3;
    // Sidak: each of the tests gets this much.
    let each = -((-SIGNIFICANCE).ln_1p() / tests as f64).exp_m1();
    let mut failures = Vec::new();
    for (tile, ((a, va), (b, vb))) in ours.0.iter().zip(&reference.0).enumerate() {
        for channel in 0..3 {
            let z = (a[channel] - b[channel]) / (va[channel] + vb[channel]).sqrt();
            let p = 2.0 * Normal::standard().sf(z.abs());
            if p < each || p.is_nan() {
                failures.push(format!(
                    "tile {tile} channel {channel}: {} against {}, z = {z:.1}",
                    a[channel], b[channel]
                ));
            }
        }
    }
    assert!(
        failures.is_empty(),
        "{} of {tests} (has the scene changed? then the reference and its script must too):\n{}",
        failures.len(),
        failures.join("\n")
    );
}
