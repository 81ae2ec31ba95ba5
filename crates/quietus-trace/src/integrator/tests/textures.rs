//! Filtered textures against unfiltered ones: less noise, the same energy.

use glam::{Affine2, Vec2};

use super::*;
use crate::desc::{
    Alpha, Image, ImageTexture, Mapping, MetalRough, TexelFilter, Texels, Texture, TextureId, Wrap,
};

const SIZE: u32 = 32;

/// A floor of random texels that runs far away from a camera close above it: from magnified to 100 texels a pixel. It
/// shows its texels and nothing else. With `exact` they are also its coverage, all 1, and therefore not filtered.
fn floor(exact: bool) -> Scene {
    let mut rng = Rng::new(5);
    let texels = (0..64 * 64).map(|_| [rng.next_1d(), rng.next_1d().powi(8), 0.5, 1.0]).collect();
    let image = Image { name: "noise".into(), width: 64, height: 64, texels: Texels::Float(texels) };
    let mut scene = Builder::default();
    scene.0.textures.push(Texture::Image(ImageTexture {
        image: Arc::new(image),
        wrap: [Wrap::Repeat; 2],
        filter: TexelFilter::Linear,
        mapping: Mapping::Uv { set: 0, transform: Affine2::from_scale(Vec2::splat(40.0)) },
        invert: false,
    }));
    let base_color = ColorParam { factor: Vec3::ONE, texture: Some(TextureId(0)) };
    let value = ScalarParam { factor: 1.0, texture: Some((TextureId(0), 3)) };
    let alpha = if exact { Alpha::Blend { value } } else { Alpha::Opaque };
    let unlit = MetalRough { base_color, unlit: true, ..MetalRough::default() };
    let material = scene.material(Surface::MetalRough(Box::new(unlit)), 0.0, alpha);
    let Geometry::Mesh(mesh) = square(40.0, 0.0, true) else { unreachable!("a square is a mesh") };
    let uvs = [vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y], Vec::new()];
    scene.add(Geometry::Mesh(Arc::new(Mesh { uvs, ..Mesh::clone(&mesh) })), material);
    Scene::build(&scene.0).expect("a sound scene")
}

/// Mean of green per pixel over samples `first..first + count` of a sequence.
fn pixels(scene: &Scene, seed: u64, count: u32) -> Vec<f64> {
    let view = View { seed, ..view(Vec3::new(0.3, 0.4, 0.2), Vec3::new(3.0, 0.0, 2.0), SIZE, 0.9, 1) };
    let pixel = |i: u32| {
        let mut picture = Picture::default();
        let work = PixelWork { x: i % SIZE, y: i / SIZE, pixel: 0, replicate: 0, first: 0, count };
        render_tile(scene, &view, &[work], &mut picture);
        picture.radiance.mean()
    };
    (0..SIZE * SIZE).map(pixel).collect()
}

fn squared_error(found: &[f64], truth: &[f64]) -> f64 {
    found.iter().zip(truth).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / truth.len() as f64
}

/// At every usual number of samples a picture with filtered textures is nearer to the truth (a thousand unfiltered
/// samples a pixel) than one without: the blur never outweighs the noise it takes away.
#[test]
fn filtered_textures_are_nearer_to_the_truth() {
    let (filtered, exact) = (floor(false), floor(true));
    let truth = pixels(&exact, 99, 1024);
    for count in [1, 4, 16, 64] {
        let error = |scene| squared_error(&pixels(scene, 1, count), &truth);
        let (with, without) = (error(&filtered), error(&exact));
        println!("{count} samples a pixel: squared error {with:.2e} filtered, {without:.2e} unfiltered");
        assert!(with < without, "{count} samples a pixel: {with} filtered, {without} unfiltered");
    }
}

/// Energy: the same samples with and without filtering differ by nothing on average.
#[test]
fn filtering_keeps_the_mean() {
    let (filtered, exact) = (floor(false), floor(true));
    let mut difference = Mean::default();
    for seed in 0..16 {
        // One sample a pixel: all of them independent.
        for (a, b) in pixels(&filtered, seed, 1).into_iter().zip(pixels(&exact, seed, 1)) {
            difference.push(a - b);
        }
    }
    let mut suite = Suite::new(1);
    suite.judge(difference.p_equals(0.0), "mean with and without filtering");
}
