//! Time of one look-up: constants, images magnified and filtered, near each other and all over a large image.
//!
//! `cargo bench -p quietus-trace --bench textures`; times are CPU time of the one thread.

use std::hint::black_box;
use std::sync::Arc;

use cpu_time::ThreadTime;
use criterion::{Criterion, criterion_group, criterion_main};
use glam::{Affine2, Vec2, Vec4};
use quietus_trace::desc::{
    ColorParam, Image, ImageTexture, Mapping, ScalarParam, TexelFilter, Texels, Texture, TextureId, Wrap,
};
use quietus_trace::sampler::Sampler;
use quietus_trace::texture::{Footprint, SurfacePoint, TextureTable};

/// Texels along a side of the image: 64 MiB of them, beyond any cache.
const SIDE: u32 = 4096;

fn table() -> TextureTable {
    let texel = |i: u32| (i.wrapping_mul(0x9e37_79b9)).to_le_bytes();
    let texels = Texels::Srgb8((0..SIDE * SIDE).map(texel).collect());
    let image = Image { name: "noise".into(), width: SIDE, height: SIDE, texels };
    let textures = [
        Texture::Constant(Vec4::ONE),
        Texture::Image(ImageTexture {
            image: Arc::new(image),
            wrap: [Wrap::Repeat; 2],
            filter: TexelFilter::Linear,
            mapping: Mapping::Uv { set: 0, transform: Affine2::IDENTITY },
            invert: false,
        }),
        Texture::Scale {
            color: ColorParam { factor: glam::Vec3::ONE, texture: Some(TextureId(1)) },
            scale: ScalarParam { factor: 0.5, texture: Some((TextureId(0), 0)) },
        },
    ];
    TextureTable::compile(&textures, |_| false).expect("sound textures")
}

/// A point anywhere in `extent` of the image, that stands for `texels` of them.
fn point(sampler: &mut Sampler, extent: f32, texels: f32) -> SurfacePoint {
    let half = 0.5 * texels / SIDE as f32;
    let footprint = Footprint { uv: [[Vec2::new(half, 0.0), Vec2::new(0.0, half)]; 2], ..Footprint::POINT };
    SurfacePoint { uv: [sampler.next_2d() * extent; 2], footprint, ..SurfacePoint::default() }
}

fn look_ups(criterion: &mut Criterion) {
    let table = table();
    let mut group = criterion.benchmark_group("textures");
    for (name, texture, extent, texels) in [
        ("constant", 0, 1.0, 0.0),
        ("bilinear, near each other", 1, 0.001, 0.0),
        ("bilinear, all over", 1, 1.0, 0.0),
        ("filtered over 6 texels, near each other", 1, 0.001, 6.0),
        ("filtered over 6 texels, all over", 1, 1.0, 6.0),
        ("filtered over 100 texels, all over", 1, 1.0, 100.0),
        ("product with a constant, near each other", 2, 0.001, 0.0),
    ] {
        let mut sampler = Sampler::new(1, 2, 3, 0, 5);
        let points: Vec<_> = (0..1 << 12).map(|_| point(&mut sampler, extent, texels)).collect();
        group.bench_function(name, |bencher| {
            bencher.iter_custom(|iterations| {
                let start = ThreadTime::now();
                for point in points.iter().cycle().take(iterations as usize) {
                    black_box(table.lookup(black_box(TextureId(texture)), point));
                }
                start.elapsed()
            });
        });
    }
}

criterion_group!(benches, look_ups);
criterion_main!(benches);
