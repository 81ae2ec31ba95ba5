//! Time of one whole camera path: a Cornell box with a tiled floor, a glass sphere, a gold one and a coated one.
//!
//! `cargo bench -p quietus-trace --bench paths`; times are CPU time of the one thread.

use std::hint::black_box;
use std::sync::Arc;

use cpu_time::ThreadTime;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::{Affine2, Affine3A, Vec2, Vec3};
use quietus_trace::desc::{
    Alpha, Camera, ColorParam, Geometry, Image, ImageTexture, Instance, Mapping, Material, MaterialId, Mesh,
    Metal, MetalRough, Object, ObjectId, Roughness, ScalarParam, SceneDesc, Shape, Surface, TexelFilter,
    Texels, Texture, TextureId, Wrap,
};
use quietus_trace::filter::Filter;
use quietus_trace::scene::Scene;
use quietus_trace::tile::{PixelWork, Sample, SampleSink, render_tile};
use quietus_trace::view::View;

const SIZE: u32 = 64;

fn material(scene: &mut SceneDesc, surface: Surface, emission: f32) -> MaterialId {
    scene.materials.push(Material {
        name: String::new(),
        surface,
        emission: ColorParam::constant(Vec3::splat(emission)),
        emission_two_sided: false,
        normal_map: None,
        bump: None,
        alpha: Alpha::Opaque,
    });
    MaterialId(scene.materials.len() as u32 - 1)
}

fn place(scene: &mut SceneDesc, geometry: Geometry, material: MaterialId) {
    let object = ObjectId(scene.objects.len() as u32);
    scene.objects.push(Object { name: String::new(), shapes: vec![Shape::new(geometry, material)] });
    scene.instances.push(Instance::still(object, Affine3A::IDENTITY));
}

fn diffuse(reflectance: Vec3) -> Surface {
    Surface::Diffuse { reflectance: ColorParam::constant(reflectance) }
}

/// A parallelogram with a corner and the edges that start there; its front is where they turn counter-clockwise.
fn quad(corner: Vec3, u: Vec3, v: Vec3) -> Geometry {
    Geometry::Mesh(Arc::new(Mesh {
        positions: vec![corner, corner + u, corner + u + v, corner + v],
        uvs: [vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y], Vec::new()],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }))
}

fn tiles(scene: &mut SceneDesc) -> Surface {
    let [light, dark] = [[0.7, 0.7, 0.6, 1.0], [0.3, 0.3, 0.25, 1.0]];
    let texels = Texels::Float(vec![light, dark, dark, light]);
    scene.textures.push(Texture::Image(ImageTexture {
        image: Arc::new(Image { name: "tiles".into(), width: 2, height: 2, texels }),
        wrap: [Wrap::Repeat; 2],
        filter: TexelFilter::Nearest,
        mapping: Mapping::Uv { set: 0, transform: Affine2::from_scale(Vec2::splat(4.0)) },
        invert: false,
    }));
    Surface::Diffuse { reflectance: ColorParam { factor: Vec3::ONE, texture: Some(TextureId(0)) } }
}

fn balls(scene: &mut SceneDesc) {
    let scalar = ScalarParam::constant;
    let glass =
        Surface::Dielectric { ior: 1.5, roughness: Roughness::SMOOTH, tint: ColorParam::constant(Vec3::ONE) };
    let gold = Surface::Conductor {
        metal: Metal::Index { eta: Vec3::new(0.143, 0.375, 1.442), k: Vec3::new(3.983, 2.386, 1.603) },
        roughness: Roughness::perceptual(scalar(0.3)),
    };
    let coated = Surface::MetalRough(Box::new(MetalRough {
        base_color: ColorParam::constant(Vec3::new(0.05, 0.16, 0.42)),
        metallic: scalar(0.0),
        roughness: scalar(0.45),
        clearcoat: scalar(1.0),
        clearcoat_roughness: scalar(0.1),
        ..MetalRough::default()
    }));
    for (surface, x, radius) in [(glass, -0.4, 0.4), (gold, 0.25, 0.2), (coated, 0.7, 0.25)] {
        let material = material(scene, surface, 0.0);
        place(scene, Geometry::Sphere { center: Vec3::new(x, radius, x), radius }, material);
    }
}

fn cornell_box() -> SceneDesc {
    let mut scene = SceneDesc::default();
    let floor = tiles(&mut scene);
    let floor = material(&mut scene, floor, 0.0);
    let [white, red, green] = [Vec3::splat(0.73), Vec3::new(0.63, 0.06, 0.05), Vec3::new(0.14, 0.45, 0.09)]
        .map(|color| material(&mut scene, diffuse(color), 0.0));
    let lamp = material(&mut scene, diffuse(Vec3::ZERO), 15.0);
    let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| 2.0 * axis);
    let corner = Vec3::new(-1.0, 0.0, -1.0);
    place(&mut scene, quad(corner, z, x), floor);
    place(&mut scene, quad(corner + y, x, z), white);
    place(&mut scene, quad(corner, x, y), white);
    place(&mut scene, quad(corner, y, z), red);
    place(&mut scene, quad(corner + x, z, y), green);
    place(&mut scene, quad(Vec3::new(-0.25, 1.99, -0.25), 0.25 * x, 0.25 * z), lamp);
    balls(&mut scene);
    scene
}

/// Sums over the samples of each pixel: how noisy a path is says what one is worth.
#[derive(Default)]
struct Noise {
    pixel: (f64, f64),
    variance: f64,
}

impl SampleSink for Noise {
    fn add(&mut self, work: &PixelWork, index: u32, sample: &Sample) {
        let value = f64::from(sample.radiance.y);
        self.pixel = (self.pixel.0 + value, self.pixel.1 + value * value);
        if index + 1 == work.first + work.count {
            let n = f64::from(work.count);
            let (sum, squares) = std::mem::take(&mut self.pixel);
            self.variance += (squares - sum * sum / n) / (n - 1.0) / f64::from(SIZE * SIZE);
        }
    }
}

struct Sum(Vec3);

impl SampleSink for Sum {
    fn add(&mut self, _: &PixelWork, _: u32, sample: &Sample) {
        self.0 += sample.radiance;
    }
}

/// The whole frame, `count` samples a pixel.
fn frame(count: u32) -> Vec<PixelWork> {
    let at = |i: u32| PixelWork { x: i % SIZE, y: i / SIZE, pixel: 0, replicate: 0, first: 0, count };
    (0..SIZE * SIZE).map(at).collect()
}

fn paths(criterion: &mut Criterion) {
    let scene = Scene::build(&cornell_box()).expect("a sound scene");
    let camera = Camera::perspective("", Affine3A::from_translation(Vec3::new(0.0, 1.0, 4.0)), 0.6);
    let mut group = criterion.benchmark_group("paths");
    for depth in [2, 8] {
        let view = View::new(&camera, [SIZE, SIZE], Filter::BLACKMAN_HARRIS, depth, 1).expect("a sound view");
        let mut noise = Noise::default();
        let counts = render_tile(&scene, &view, &frame(256), &mut noise);
        let rays = counts.rays as f64 / counts.paths as f64;
        eprintln!("depth {depth}: {rays:.2} rays per path, variance {:.4}", noise.variance);
        let work = frame(4);
        group.throughput(Throughput::Elements(u64::from(4 * SIZE * SIZE)));
        group.bench_function(format!("depth {depth}"), |bencher| {
            bencher.iter_custom(|iterations| {
                // Time of this thread, not of the clock on the wall: other work on the machine counts less.
                let start = ThreadTime::now();
                for _ in 0..iterations {
                    let mut sum = Sum(Vec3::ZERO);
                    render_tile(&scene, &view, &work, &mut sum);
                    black_box(sum.0);
                }
                start.elapsed()
            });
        });
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20);
    targets = paths
}
criterion_main!(benches);
