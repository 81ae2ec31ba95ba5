//! Coats against a plain simulation of light between the layers.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::*;
use crate::{
    bsdf::Bsdf,
    testing::{Mean, Rng, Suite, chi_square_directions},
};

/// Light followed as it goes: no connections, no roulette, no closed form. From `wo` inwards; returns where it leaves
/// and what is left of it, the compression of radiance undone.
fn simulate(p: &LayeredParams, wo: Vec3, rng: &mut Rng) -> Option<(Vec3, Vec3)> {
    let coat = |w: Vec3, rng: &mut Rng| p.coat.sample(w, rng.next_1d(), rng.next_2d());
    let first = coat(wo, rng)?;
    if !first.transmission {
        return Some((first.wi, first.weight));
    }
    let mut weight = first.weight;
    let (mut w, mut depth) = (first.wi, 0.0f32);
    for step in 0..=p.max_depth {
        // Depth below the coat after a free flight.
        let flight = -(1.0 - rng.next_1d()).ln();
        let end = depth - flight * w.z;
        // After the last step it may still leave.
        if step == p.max_depth && (w.z < 0.0 || end > 0.0) {
            return None;
        }
        if end > 0.0 && end < p.thickness {
            if p.albedo == Vec3::ZERO {
                return None;
            }
            depth = end;
            weight *= p.albedo;
            w = phase(p.g, w, rng);
            continue;
        }
        let s = if w.z < 0.0 {
            depth = p.thickness;
            p.base.sample(-w, rng.next_2d())?
        } else {
            depth = 0.0;
            coat(-w, rng)?
        };
        weight *= s.weight;
        if w.z > 0.0 && s.transmission {
            return Some((s.wi, weight));
        }
        w = s.wi;
    }
    None
}

/// Henyey and Greenstein's phase function by rejection from uniform directions.
fn phase(g: f32, w: Vec3, rng: &mut Rng) -> Vec3 {
    let density = |cos: f32| (1.0 + g * g - 2.0 * g * cos).powf(-1.5);
    loop {
        let candidate = rng.next_direction();
        if rng.next_1d() * density(g.signum()) <= density(w.dot(candidate)) {
            return candidate;
        }
    }
}

fn facets(alpha: f32) -> Option<Ggx> {
    Ggx::new(Vec2::splat(alpha))
}

fn coat(ior: f32, alpha: f32) -> Dielectric {
    Dielectric::new(ior, facets(alpha), Vec3::ONE)
}

fn diffuse() -> Base {
    Base::Diffuse(Diffuse { reflectance: Vec3::new(0.9, 0.5, 0.2) })
}

fn metal(ggx: Option<Ggx>) -> Base {
    Base::Conductor(Conductor::new(Vec3::new(0.18, 0.42, 1.37), Vec3::new(3.42, 2.35, 1.77), ggx))
}

/// pbrt-v4's defaults over a diffuse base.
fn plain() -> LayeredParams {
    LayeredParams {
        coat: coat(1.5, 0.0),
        base: diffuse(),
        thickness: 0.01,
        albedo: Vec3::ZERO,
        g: 0.0,
        max_depth: 10,
        key: 1,
    }
}

/// Coats over diffuse bases that have a closed form, with their alphas.
fn closed() -> Vec<(&'static str, LayeredParams)> {
    vec![
        ("smooth", plain()),
        ("rough", LayeredParams { coat: coat(1.5, 0.3), ..plain() }),
        ("thick, narrow", LayeredParams { coat: coat(2.0, 0.05), thickness: 0.5, ..plain() }),
        ("once", LayeredParams { coat: coat(1.3, 0.0), max_depth: 2, ..plain() }),
    ]
}

/// Coats that only the walk can tell of.
fn open() -> Vec<(&'static str, LayeredParams)> {
    let fog = LayeredParams { thickness: 0.7, albedo: Vec3::new(0.9, 0.6, 0.1), g: 0.5, ..plain() };
    let lacquer = LayeredParams { base: metal(facets(0.2)), ..plain() };
    let brushed = Ggx::new(Vec2::new(0.05, 0.3));
    vec![
        ("fog", fog),
        ("backward fog below rough", LayeredParams { coat: coat(1.5, 0.4), g: -0.3, ..fog }),
        ("fog over a mirror", LayeredParams { base: metal(None), ..fog }),
        ("lacquer", lacquer),
        ("rough lacquer", LayeredParams { coat: coat(1.5, 0.2), ..lacquer }),
        ("rough lacquer over a mirror", LayeredParams { coat: coat(1.5, 0.3), base: metal(None), ..plain() }),
        ("lacquer over a mirror", LayeredParams { base: metal(None), ..plain() }),
        ("brushed", LayeredParams { base: metal(brushed), coat: coat(1.4, 0.1), ..plain() }),
    ]
}

fn layered(p: LayeredParams) -> Bsdf<'static> {
    Bsdf::Layered(Layered::new(p))
}

/// The closed form's table for a coat of the tests: of its own alpha, or out of the rows for all.
fn table(p: &LayeredParams, any_alpha: bool) -> CoatTable {
    CoatTable::new(p.coat.ior(), p.thickness, (!any_alpha).then_some(p.coat.alpha().x))
}

fn coated_diffuse<'a>(p: &LayeredParams, table: &'a CoatTable) -> Bsdf<'a> {
    let Base::Diffuse(base) = p.base else { panic!("not diffuse") };
    Bsdf::CoatedDiffuse(CoatedDiffuse::new(p.coat, table, base.reflectance, p.max_depth))
}

fn outgoing() -> [Vec3; 4] {
    [0.98f32, 0.7, -0.3, 0.05].map(|z| {
        let r = (1.0 - z * z).sqrt();
        Vec3::new(r * 0.6, -r * 0.8, z)
    })
}

/// Cells of the hemisphere on `wo`'s side: four of the cosine by four of the azimuth.
fn cell(wi: Vec3) -> usize {
    let turn = wi.y.atan2(wi.x) / (2.0 * PI) + 0.5;
    (wi.z.abs() * 4.0).min(3.0) as usize * 4 + (turn * 4.0).min(3.0) as usize
}

/// Means per cell of what `draw` finds: green alone, since channels are not independent.
fn means(samples: usize, mut draw: impl FnMut() -> Option<(Vec3, Vec3)>) -> Vec<Mean> {
    let mut sums = vec![[0.0f64; 2]; 16];
    for _ in 0..samples {
        if let Some((wi, weight)) = draw() {
            let value = f64::from(weight.y);
            let sum = &mut sums[cell(wi)];
            *sum = [sum[0] + value, sum[1] + value * value];
        }
    }
    sums.iter().map(|&[sum, squares]| Mean::from_sums(samples, sum, squares)).collect()
}

/// What leaves into each cell by sampling `bsdf`; its compression of radiance cancels, in and out.
fn judge_against_simulation(suite: &mut Suite, name: &str, bsdf: &Bsdf, p: &LayeredParams, bias: f64) {
    let mut rng = Rng::new(21);
    for wo in outgoing() {
        let up = wo * wo.z.signum();
        let simulated = means(60_000, || simulate(p, up, &mut rng));
        let found = means(60_000, || {
            let s = bsdf.sample(wo, rng.next_1d(), rng.next_2d())?;
            Some((s.wi * wo.z.signum(), s.weight))
        });
        for (i, (simulated, found)) in simulated.iter().zip(&found).enumerate() {
            let message =
                || format!("{name}, wo = {wo}, cell {i}: {} and {}", simulated.mean(), found.mean());
            suite.judge(simulated.p_within(found, bias), message());
        }
    }
}

/// The walk is keyed by its directions, so the same ones give the same value: here each pair is drawn once.
#[test]
fn walks_scatter_as_simulated_light_does() {
    let cases = [closed(), open()].concat();
    let mut suite = Suite::new(cases.len() * outgoing().len() * 16);
    for (name, p) in cases {
        judge_against_simulation(&mut suite, name, &layered(p), &p, 0.0);
    }
}

#[test]
fn the_closed_form_scatters_as_simulated_light_does() {
    let mut suite = Suite::new(2 * closed().len() * outgoing().len() * 16);
    for (name, p) in closed() {
        for any_alpha in [false, true] {
            let table = table(&p, any_alpha);
            // Both passages and the series are off by the table's error at most, relative to what passes.
            let bias = if p.coat.is_delta() { 0.0 } else { 4.0 * f64::from(coat_table::MAX_ERROR) };
            judge_against_simulation(&mut suite, name, &coated_diffuse(&p, &table), &p, bias);
        }
    }
}

/// Value by value: the mean of walks under many keys is the closed form.
#[test]
fn walks_and_the_closed_form_agree() {
    let mut rng = Rng::new(22);
    let mut suite = Suite::new(closed().len() * 8);
    for (name, p) in closed() {
        let table = table(&p, false);
        let closed = coated_diffuse(&p, &table);
        for _ in 0..8 {
            let (wo, wi) = (rng.next_direction(), rng.next_direction());
            let wi = wi.with_z(wi.z.abs() * wo.z.signum());
            let mut key = 0;
            let walks = Mean::of(20_000, || {
                key += 1;
                f64::from(layered(LayeredParams { key, ..p }).eval(wo, wi).y)
            });
            let expected = f64::from(closed.eval(wo, wi).y);
            let bias = if p.coat.is_delta() { 0.0 } else { 4.0 * f64::from(coat_table::MAX_ERROR) };
            let found = walks.p_within(&Mean::exact(expected), bias);
            suite.judge(found, format!("{name}, {wo} -> {wi}: {} and {expected}", walks.mean()));
        }
    }
}

#[test]
fn samples_follow_the_density() {
    let delta = |p: &LayeredParams| p.coat.is_delta();
    let cases: Vec<_> = [closed(), open()].concat().into_iter().filter(|(_, p)| !delta(p)).collect();
    let mut suite = Suite::new(cases.len() * outgoing().len());
    for (i, (name, p)) in cases.iter().enumerate() {
        let table = table(p, false);
        let bsdf = match p.base {
            Base::Diffuse(_) if p.albedo == Vec3::ZERO => coated_diffuse(p, &table),
            _ => layered(*p),
        };
        for (j, wo) in outgoing().into_iter().enumerate() {
            let sample = |rng: &mut Rng| Some(bsdf.sample(wo, rng.next_1d(), rng.next_2d())?.wi);
            let p = chi_square_directions((i * 10 + j) as u64, 100_000, sample, |wi| bsdf.pdf(wo, wi));
            suite.judge(p, format!("{name}, wo = {wo}"));
        }
    }
}

#[test]
fn sampled_values_are_those_of_eval() {
    let mut rng = Rng::new(23);
    for (name, p) in [closed(), open()].concat() {
        let table = table(&p, false);
        let mut bsdfs = vec![layered(p)];
        if matches!(p.base, Base::Diffuse(_)) && p.albedo == Vec3::ZERO {
            bsdfs.push(coated_diffuse(&p, &table));
        }
        for bsdf in bsdfs {
            for _ in 0..1000 {
                let wo = rng.next_direction();
                let Some(s) = bsdf.sample(wo, rng.next_1d(), rng.next_2d()) else { continue };
                let (value, pdf) = bsdf.eval_pdf(wo, s.wi);
                assert!(
                    s.delta || (value / pdf == s.weight && pdf == s.pdf),
                    "{name}: {s:?}, {value} / {pdf}"
                );
                assert!(!s.transmission && s.wi.z * wo.z > 0.0);
                assert!(s.weight.is_finite() && s.weight.min_element() >= 0.0, "{name}: {s:?}");
            }
        }
    }
}

/// On average: two walks between the same directions differ.
#[test]
fn coats_are_reciprocal() {
    let mut rng = Rng::new(24);
    let mut cases = [closed(), open()].concat();
    cases.retain(|(_, p)| !Layered::new(*p).is_delta());
    let mut suite = Suite::new(cases.len() * 4);
    for (name, p) in cases {
        for _ in 0..4 {
            let (wo, wi) = (rng.next_direction(), rng.next_direction());
            let wi = wi.with_z(wi.z.abs() * wo.z.signum());
            let mut key = 0;
            let mut mean = |a: Vec3, b: Vec3| {
                Mean::of(20_000, || {
                    key += 1;
                    f64::from(layered(LayeredParams { key, ..p }).eval(a, b).y / b.z.abs())
                })
            };
            let (forth, back) = (mean(wo, wi), mean(wi, wo));
            let p = forth.p_same(&back);
            suite.judge(p, format!("{name}, {wo} and {wi}: {} and {}", forth.mean(), back.mean()));
        }
    }
}

/// White below a smooth coat without absorption: all that enters comes out, if it is given the time.
#[test]
fn white_furnace() {
    let white = Base::Diffuse(Diffuse { reflectance: Vec3::ONE });
    let p = LayeredParams { base: white, thickness: 0.0, max_depth: 200, ..plain() };
    let fog = LayeredParams { thickness: 1.0, albedo: Vec3::ONE, max_depth: 2000, ..p };
    let table = table(&p, false);
    let mut rng = Rng::new(25);
    let mut suite = Suite::new(2 * outgoing().len());
    for (name, bsdf, samples) in
        [("diffuse", coated_diffuse(&p, &table), 50_000), ("fog", layered(fog), 20_000)]
    {
        for wo in outgoing() {
            let mean = Mean::of(samples, || {
                let s = bsdf.sample(wo, rng.next_1d(), rng.next_2d());
                s.map_or(0.0, |s| f64::from(s.weight.y))
            });
            suite.judge(mean.p_equals(1.0), format!("{name}, wo = {wo}: {}", mean.mean()));
        }
    }
}
