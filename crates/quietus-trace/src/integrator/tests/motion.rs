//! Motion blur is the mean of stills.

use glam::Quat;

use super::*;
use crate::geometry::motion::Motion;

/// Pixels on a side of the pictures.
const SIZE: u32 = 6;

/// Each pixel's mean, over pictures each of which is independent of the others.
#[derive(Default)]
struct Pixels(Vec<Mean>);

impl Pixels {
    /// Adds the mean of each pixel of a picture drawn with `count` samples a pixel of a sequence of its own.
    fn add(&mut self, scene: &Scene, seed: u64, count: u32) {
        let view = View { seed, ..view(Vec3::new(0.0, 2.0, 5.0), Vec3::ZERO, SIZE, 0.7, 4) };
        self.0.resize_with((SIZE * SIZE) as usize, Mean::default);
        for y in 0..SIZE {
            for x in 0..SIZE {
                let mut picture = Picture::default();
                let work = PixelWork { x, y, pixel: 0, replicate: 0, first: 0, count };
                render_tile(scene, &view, &[work], &mut picture);
                self.0[(y * SIZE + x) as usize].push(picture.radiance.mean());
            }
        }
    }
}

/// A triangle that turns and shifts, a mesh that grows and whose shading normals tilt, a sphere that flies past,
/// over a floor under a sky and a lamp.
fn scene(frozen: Option<f32>) -> Scene {
    let mut scene = Builder::default();
    let (grey, bright) = (scene.diffuse(0.5, 0.0), scene.diffuse(0.8, 0.0));
    let glow = scene.diffuse(0.0, 2.0);
    scene.sky(0.3);
    scene.add(square(3.0, -0.5, true), grey);
    scene.sphere(Vec3::new(0.0, 3.0, 0.0), 0.4, glow);
    let blade = quad([[-1., 0., 0.], [1., 0., 0.], [1., 0.3, 0.2], [-1., 0.3, 0.]].map(Vec3::from_array));
    let turn = Affine3A::from_rotation_translation(Quat::from_rotation_y(2.5), Vec3::new(0.3, 0.1, 0.5));
    let ball = Geometry::Sphere { center: Vec3::ZERO, radius: 0.4 };
    let flight = Affine3A::from_scale_rotation_translation(
        Vec3::new(1.0, 0.5, 1.0),
        Quat::IDENTITY,
        Vec3::new(1.5, 0.4, 1.0),
    );
    let start = Affine3A::from_translation(Vec3::new(-1.0, 0.0, 1.0));
    for (geometry, material, [start, end]) in
        [(blade, bright, [Affine3A::IDENTITY, turn]), (ball, grey, [start, flight])]
    {
        let motion = Motion::new(&start, &end).expect("invertible");
        scene.place(geometry, material, frozen.map_or(start, |time| motion.at(time)));
        let placed = scene.0.instances.last_mut().expect("just placed");
        placed.end_to_world = frozen.is_none().then_some(end);
    }
    scene.add(growing(frozen), bright);
    Scene::build(&scene.0).expect("a sound scene")
}

fn growing(frozen: Option<f32>) -> Geometry {
    let start = [[-1., -0.4, -1.], [0., -0.4, -1.], [0., 0.5, -1.]].map(Vec3::from_array);
    let end = start.map(|p| p + Vec3::new(1.0, 0.3 * p.x, 0.8));
    let normals = [[0., 0., 1.], [0.4, 0., 0.9]].map(|n| Vec3::from_array(n).normalize());
    let still = Mesh { triangles: vec![[0, 1, 2]], ..Mesh::default() };
    Geometry::Mesh(Arc::new(match frozen {
        None => Mesh {
            positions: start.to_vec(),
            end_positions: end.to_vec(),
            normals: vec![normals[0]; 3],
            end_normals: vec![normals[1]; 3],
            ..still
        },
        Some(t) => Mesh {
            positions: (0..3).map(|i| start[i].lerp(end[i], t)).collect(),
            normals: vec![normals[0].lerp(normals[1], t).normalize(); 3],
            ..still
        },
    }))
}

#[test]
fn motion_blur_is_the_mean_of_stills() {
    let (mut blurred, mut stills) = (Pixels::default(), Pixels::default());
    let moving = scene(None);
    let mut rng = Rng::new(5);
    for picture in 0..1500 {
        blurred.add(&moving, 2 * picture, 4);
        stills.add(&scene(Some(rng.next_1d())), 2 * picture + 1, 4);
    }
    let mut suite = Suite::new((SIZE * SIZE) as usize);
    for (i, (blurred, still)) in blurred.0.iter().zip(&stills.0).enumerate() {
        suite.judge(blurred.p_same(still), format!("pixel {i}"));
    }
    // It would be no test if nothing moved through the picture.
    let mut frozen = Pixels::default();
    (0..1500).for_each(|picture| frozen.add(&scene(Some(0.0)), picture, 4));
    let differs = (frozen.0.iter().zip(&stills.0)).filter(|(a, b)| a.p_same(b) < 1e-9).count();
    assert!(differs > 5, "{differs} pixels show motion");
}

/// Nothing that stands still takes random numbers for time: the same samples with and without `end_to_world`.
#[test]
fn ends_like_starts_are_no_motion() {
    let mut still = Builder::default();
    let grey = still.diffuse(0.5, 0.0);
    still.sky(1.0);
    still.add(square(1.0, 0.0, true), grey);
    let mut ended = Builder(still.0.clone());
    ended.0.instances[0].end_to_world = Some(Affine3A::IDENTITY);
    let scene = Scene::build(&ended.0).expect("a sound scene");
    assert!(!scene.moves());
    let look = |scene: &Builder| scene.look(Vec3::Y, Vec3::ZERO, 3).samples;
    assert_eq!(look(&still), look(&ended));
}
