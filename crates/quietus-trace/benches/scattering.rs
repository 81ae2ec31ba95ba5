//! Cost of what every path segment does: random numbers, BSDF samples and evaluations.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use glam::Vec3;
use quietus_trace::{
    bsdf::{Bsdf, Conductor, Dielectric, Diffuse, MetalRough, MetalRoughParams, ggx::Ggx},
    sampler::Sampler,
};

fn sampler(c: &mut Criterion) {
    let mut group = c.benchmark_group("sampler");
    let mut index = 0;
    group.bench_function("new and next_2d", |b| {
        b.iter(|| {
            index += 1;
            Sampler::new(1, black_box(3), 4, 0, index).next_2d()
        });
    });
    let mut sampler = Sampler::new(1, 2, 3, 0, 77);
    group.bench_function("next_1d", |b| b.iter(|| sampler.next_1d()));
    group.bench_function("next_2d", |b| b.iter(|| sampler.next_2d()));
}

fn bsdfs() -> Vec<(&'static str, Bsdf<'static>)> {
    let plastic = MetalRoughParams { metallic: 0.0, roughness: 0.4, ..Default::default() };
    let coated = MetalRoughParams { clearcoat: 1.0, clearcoat_roughness: 0.1, metallic: 0.5, ..plastic };
    vec![
        ("diffuse", Bsdf::Diffuse(Diffuse { reflectance: Vec3::splat(0.5) })),
        (
            "conductor",
            Bsdf::Conductor(Conductor::new(Vec3::splat(0.2), Vec3::splat(3.0), Ggx::from_roughness(0.4))),
        ),
        ("glass", Bsdf::Dielectric(Dielectric::new(1.5, Ggx::from_roughness(0.4), Vec3::ONE))),
        ("smooth glass", Bsdf::Dielectric(Dielectric::new(1.5, Ggx::from_roughness(0.0), Vec3::ONE))),
        ("metal-rough", Bsdf::MetalRough(MetalRough::new(&plastic))),
        ("coated metal-rough", Bsdf::MetalRough(MetalRough::new(&coated))),
    ]
}

fn scattering(c: &mut Criterion) {
    let wo = Vec3::new(0.48, -0.36, 0.8);
    let wi = Vec3::new(-0.6, 0.48, 0.64);
    for (name, bsdf) in bsdfs() {
        let mut group = c.benchmark_group(name);
        let mut sampler = Sampler::new(1, 2, 3, 0, 5);
        group.bench_function("sample", |b| {
            b.iter(|| {
                let u_lobe = sampler.next_1d();
                black_box(&bsdf).sample(black_box(wo), u_lobe, sampler.next_2d())
            });
        });
        group.bench_function("eval_pdf", |b| {
            b.iter(|| black_box(&bsdf).eval_pdf(black_box(wo), black_box(wi)))
        });
    }
    let params = MetalRoughParams { metallic: 0.0, roughness: 0.4, ..Default::default() };
    c.bench_function("metal-rough/new", |b| b.iter(|| MetalRough::new(black_box(&params))));
}

criterion_group!(benches, sampler, scattering);
criterion_main!(benches);
