//! Statistical tests of every BSDF: samplers against densities, weights, reciprocity, energy.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::{Bsdf, Conductor, Dielectric, Diffuse, MetalRough, MetalRoughParams};
use crate::testing::{Mean, Rng, Suite, chi_square_directions};

fn metal_rough(p: MetalRoughParams) -> Bsdf {
    Bsdf::MetalRough(MetalRough::new(&p))
}

/// Gold at 630, 532 and 465 nm, roughly.
const GOLD: (Vec3, Vec3) = (Vec3::new(0.18, 0.42, 1.37), Vec3::new(3.42, 2.35, 1.77));

fn glass(ior: f32, roughness: f32) -> Bsdf {
    Bsdf::Dielectric(Dielectric::new(ior, roughness, Vec3::ONE))
}

/// One of each kind that has a density, over the range of widths.
fn rough_bsdfs() -> Vec<(String, Bsdf)> {
    let mut all = vec![("diffuse".to_owned(), Bsdf::Diffuse(Diffuse { reflectance: Vec3::ONE }))];
    for roughness in [0.04, 0.15, 0.5, 1.0] {
        let conductor = Bsdf::Conductor(Conductor::new(GOLD.0, GOLD.1, roughness));
        all.push((format!("conductor, roughness {roughness}"), conductor));
        for ior in [1.5, 1.0 / 1.33] {
            all.push((format!("glass {ior}, roughness {roughness}"), glass(ior, roughness)));
        }
    }
    let base = MetalRoughParams { base_color: Vec3::new(0.9, 0.5, 0.2), ..Default::default() };
    let plastic = MetalRoughParams { metallic: 0.0, roughness: 0.3, ..base };
    let named = [
        ("metal", MetalRoughParams { roughness: 0.4, ..base }),
        ("rough metal", base),
        ("plastic", plastic),
        ("half metal", MetalRoughParams { metallic: 0.5, ..plastic }),
        ("thin wall", MetalRoughParams { transmission: 0.7, ..plastic }),
        ("coated", MetalRoughParams { clearcoat: 1.0, clearcoat_roughness: 0.2, ..plastic }),
    ];
    all.extend(named.map(|(name, p)| (name.to_owned(), metal_rough(p))));
    all
}

/// Those with delta parts.
fn smooth_bsdfs() -> Vec<(String, Bsdf)> {
    let plastic = MetalRoughParams { metallic: 0.0, roughness: 0.0, ..Default::default() };
    let named = [
        ("mirror", Bsdf::Conductor(Conductor::new(GOLD.0, GOLD.1, 0.0))),
        ("smooth glass", glass(1.5, 0.0)),
        ("smooth plastic", metal_rough(plastic)),
        ("smooth thin wall", metal_rough(MetalRoughParams { transmission: 1.0, ..plastic })),
        ("smooth coat", metal_rough(MetalRoughParams { clearcoat: 0.7, roughness: 0.5, ..plastic })),
    ];
    named.map(|(name, b)| (name.to_owned(), b)).to_vec()
}

/// Outgoing directions by cosine, from both sides, off every axis.
fn outgoing() -> Vec<Vec3> {
    [1.0f32, 0.8, 0.3, 0.02, -0.999, -0.6, -0.1]
        .map(|z| {
            let r = (1.0 - z * z).sqrt();
            Vec3::new(r * 0.6, -r * 0.8, z)
        })
        .to_vec()
}

#[test]
fn samples_follow_the_density() {
    let bsdfs = rough_bsdfs();
    let mut suite = Suite::new(bsdfs.len() * outgoing().len());
    for (i, (name, bsdf)) in bsdfs.iter().enumerate() {
        for (j, wo) in outgoing().into_iter().enumerate() {
            let sample = |rng: &mut Rng| {
                let s = bsdf.sample(wo, rng.next_1d(), rng.next_2d())?;
                assert!(!s.delta);
                Some(s.wi)
            };
            let seed = (i * 100 + j) as u64;
            let start = std::time::Instant::now();
            let p = chi_square_directions(seed, 300_000, sample, |wi| bsdf.pdf(wo, wi));
            if std::env::var("T").is_ok() {
                println!("{name} {wo} p {p} {:?}", start.elapsed());
            }
            suite.judge(p, format!("{name}, wo = {wo}"));
        }
    }
}
