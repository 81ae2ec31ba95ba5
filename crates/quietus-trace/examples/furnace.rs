//! What surfaces that absorb nothing make of an even sky: mean and standard deviation of the throughput of one
//! interaction, and the share of draws that end, by the cosine of `wo`.
//!
//! `cargo run --release -p quietus-trace --example furnace`

use glam::{Vec2, Vec3};
use quietus_trace::{
    bsdf::{Bsdf, Dielectric, FrostedTable, MetalRough, MetalRoughParams, ggx::Ggx},
    sampler::Sampler,
};

const DRAWS: u32 = 1 << 18;
const COSINES: [f32; 5] = [0.98, 0.8, 0.5, 0.2, 0.05];

/// Mean, deviation and share of draws that end.
fn throughput(bsdf: &Bsdf<'_>, wo: Vec3) -> [f64; 3] {
    let (mut sum, mut squares, mut ended) = (0.0, 0.0, 0);
    for i in 0..DRAWS {
        let mut sampler = Sampler::new(1, 2, 3, 0, i);
        let (u_lobe, u) = (sampler.next_1d(), sampler.next_2d());
        let sample = bsdf.sample(wo, u_lobe, u);
        ended += u32::from(sample.is_none());
        // The compression of radiance undone.
        let weight = sample.map_or(0.0, |s| f64::from(s.weight.x * s.eta * s.eta));
        sum += weight;
        squares += weight * weight;
    }
    let n = f64::from(DRAWS);
    let mean = sum / n;
    [mean, (squares / n - mean * mean).max(0.0).sqrt(), f64::from(ended) / n]
}

fn line(name: &str, bsdf: &Bsdf<'_>, side: f32, azimuth: f32) {
    print!("{name:44}");
    for cos in COSINES {
        let sin = (1.0 - cos * cos).sqrt();
        let wo = Vec3::new(sin * azimuth.cos(), sin * azimuth.sin(), side * cos);
        let [mean, deviation, ended] = throughput(bsdf, wo);
        print!(" | {mean:.3} {deviation:.3} {ended:.3}");
    }
    println!();
}

fn main() {
    println!("{:44} | mean, deviation, ended at cosines {COSINES:?}", "");
    for (ior, roughness) in
        [(1.3, 0.1), (1.5, 0.1), (1.3, 0.3), (1.5, 0.3), (1.3, 0.5), (1.5, 0.5), (1.8, 0.7), (1.5, 1.0)]
    {
        let alpha = roughness * roughness;
        let table = FrostedTable::new(ior, Some(alpha));
        let bsdf =
            Bsdf::FrostedGlass(table.glass(Dielectric::new(ior, Ggx::new(Vec2::splat(alpha)), Vec3::ONE)));
        for (name, side) in [("outside", 1.0), ("inside", -1.0)] {
            line(&format!("glass {ior}, roughness {roughness}, {name}"), &bsdf, side, 0.6);
        }
    }
    for anisotropy in [0.0, 0.5, 0.9] {
        for roughness in [0.1, 0.2, 0.4, 0.6, 0.8] {
            let params = MetalRoughParams { roughness, anisotropy, ..Default::default() };
            let bsdf = Bsdf::MetalRough(MetalRough::new(&params));
            for (name, azimuth) in [("along", 0.0), ("across", std::f32::consts::FRAC_PI_2)] {
                if anisotropy > 0.0 || azimuth == 0.0 {
                    line(&format!("metal {roughness}, anisotropy {anisotropy}, {name}"), &bsdf, 1.0, azimuth);
                }
            }
        }
    }
}
