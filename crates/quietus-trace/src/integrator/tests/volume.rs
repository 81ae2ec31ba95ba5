//! Media whose light can be derived: what passes, what scatters once, and furnaces.

use std::f64::consts::PI;

use glam::{Affine3A, Vec3};

use super::*;
use crate::desc::{Density, Grid, Medium, MediumId, MediumInterface, Variation};

impl Builder {
    fn medium(&mut self, absorption: Vec3, scattering: Vec3, g: f32) -> Option<MediumId> {
        let name = String::new();
        self.0.media.push(Medium { name, absorption, scattering, emission: Vec3::ZERO, g, variation: None });
        Some(MediumId(self.0.media.len() as u32 - 1))
    }

    /// Makes the last shape the border between two media.
    fn border(&mut self, inside: Option<MediumId>, outside: Option<MediumId>) {
        let shape = &mut self.0.objects.last_mut().expect("a shape").shapes[0];
        shape.media = Some(MediumInterface { inside, outside });
    }

    /// A surface that is nothing but a border.
    fn interface(&mut self) -> MaterialId {
        self.material(Surface::Interface, 0.0, Alpha::Opaque)
    }

    /// Looks from within a medium.
    fn look_within(&self, medium: Option<MediumId>, eye: Vec3, target: Vec3, max_depth: u32) -> Picture {
        let scene = Scene::build(&self.0).expect("a sound scene");
        let mut view = view(eye, target, 64, 1e-3, max_depth);
        view.medium = crate::medium::Inside::new(medium);
        let mut picture = Picture::default();
        for y in 0..64 {
            let work = |x: u32, replicate: u8| PixelWork { x, y, pixel: 0, replicate, first: 0, count: 1 };
            let row: Vec<_> = (0..64).flat_map(|x| (0..4).map(move |r| work(x, r))).collect();
            render_tile(&scene, &view, &row, &mut picture);
        }
        picture
    }
}

/// One channel of all samples.
fn channel(picture: &Picture, channel: usize) -> Mean {
    let mut mean = Mean::default();
    picture.samples.iter().for_each(|s| mean.push(f64::from(s.radiance[channel])));
    mean
}

/// Every sample is the same, to rounding.
fn assert_certain(picture: &Picture, expected: Vec3, what: &str) {
    for sample in &picture.samples {
        let off = (sample.radiance - expected).abs();
        assert!(off.cmple(2e-4 * expected).all(), "{what}: {} instead of {expected}", sample.radiance);
    }
}

const DYE: Vec3 = Vec3::new(0.2, 1.1, 0.0);

/// Beer and Lambert: light through a slab, a ball and from outside to inside a medium is weakened by the way it goes,
/// seen directly and by next-event estimation, over any number of borders.
#[test]
fn absorption_follows_the_way_through() {
    let mut scene = Builder::default();
    scene.sky(2.0);
    let (dye, border) = (scene.medium(DYE, Vec3::ZERO, 0.0), scene.interface());
    scene.sphere(Vec3::ZERO, 1.0, border);
    scene.border(dye, None);
    // A bubble in it.
    scene.sphere(Vec3::new(0.3, 0.0, 0.0), 0.25, border);
    scene.border(None, dye);
    let through = |length: f32| 2.0 * (-DYE * length).map(f32::exp);
    assert_certain(&scene.look(Vec3::X * 3.0, Vec3::ZERO, 1), through(1.5), "ball with a bubble");
    assert_certain(&scene.look(Vec3::Z * 3.0, Vec3::ZERO, 5), through(2.0), "ball");
    let inside = scene.look_within(dye, Vec3::ZERO, Vec3::Y, 1);
    assert_certain(&inside, through(1.0), "from the middle");
    assert!(inside.samples.iter().all(|s| s.alpha == 0.0 && s.depth == 0.0), "borders are not seen");

    let mut scene = ground();
    let position = Vec3::new(0.0, 4.0, 0.0);
    scene.0.lights.push(desc::Light::Point { position, intensity: Vec3::splat(8.0) });
    let (dye, border) = (scene.medium(DYE, Vec3::ZERO, 0.0), scene.interface());
    scene.sphere(Vec3::Y * 2.0, 0.6, border);
    scene.border(dye, None);
    scene.add(square(5.0, 1.0, true), border);
    scene.border(dye, None);
    scene.add(square(5.0, 0.5, true), border);
    scene.border(None, dye);
    let light = GROUND_ALBEDO / std::f32::consts::PI * 8.0 / 16.0;
    let seen = scene.look(Vec3::new(0.0, 0.4, 0.4), Vec3::ZERO, 2);
    assert_certain(&seen, light * (-DYE * (1.2 + 0.5)).map(f32::exp), "a shadow ray through ball and slab");
    assert!(seen.samples.iter().all(|s| (s.depth - 0.4 * f32::sqrt(2.0)).abs() < 1e-3));
}

/// Absorption inside glass: all inner reflections of a pane seen at a right angle.
#[test]
fn coloured_glass_absorbs_inside() {
    let mut scene = Builder::default();
    scene.sky(1.0);
    let dye = scene.medium(DYE, Vec3::ZERO, 0.0);
    let pane = scene.material(glass(1.5, 0.0), 0.0, Alpha::Opaque);
    scene.add(square(5.0, 0.0, true), pane);
    scene.border(dye, None);
    scene.add(square(5.0, -0.8, false), pane);
    scene.border(dye, None);
    let picture = scene.look(Vec3::Y * 3.0, Vec3::ZERO, 60);
    let mut suite = Suite::new(3);
    for c in 0..3 {
        let (f, passed) = (fresnel(1.0, 1.5), f64::from(-DYE[c] * 0.8).exp());
        let round = 1.0 - f * f * passed * passed;
        let transmitted = (1.0 - f) * (1.0 - f) * passed / round;
        let reflected = f + (1.0 - f) * (1.0 - f) * f * passed * passed / round;
        suite.judge(channel(&picture, c).p_equals(transmitted + reflected), format_args!("channel {c}"));
    }
}

/// A medium that absorbs nothing cannot be seen under an even sky, nor in a room whose walls shine evenly: whatever the
/// colour of its coefficients, its phase function, and the glass around it.
#[test]
fn white_media_are_invisible_in_a_furnace() {
    let scattering = Vec3::new(0.7, 1.5, 4.0);
    let mut suite = Suite::new(5 * 3);
    for (g, eye) in [(0.0, Vec3::Z * 3.0), (0.7, Vec3::Z * 3.0), (-0.5, Vec3::X * 1.2)] {
        let mut scene = Builder::default();
        scene.sky(1.0);
        let (fog, border) = (scene.medium(Vec3::ZERO, scattering, g), scene.interface());
        scene.sphere(Vec3::ZERO, 1.0, border);
        scene.border(fog, None);
        let picture = scene.look(eye, Vec3::new(0.2, 0.1, 0.0), 1000);
        for c in 0..3 {
            suite.judge(channel(&picture, c).p_equals(1.0), format_args!("g = {g}, channel {c}"));
        }
    }
    let mut scene = Builder::default();
    scene.sky(1.0);
    let fog = scene.medium(Vec3::ZERO, scattering, 0.3);
    let glass = scene.material(glass(1.5, 0.0), 0.0, Alpha::Opaque);
    scene.sphere(Vec3::ZERO, 1.0, glass);
    scene.border(fog, None);
    let picture = scene.look(Vec3::Z * 3.0, Vec3::new(0.2, 0.1, 0.0), 1000);
    for c in 0..3 {
        suite.judge(channel(&picture, c).p_equals(1.0), format_args!("milky glass, channel {c}"));
    }

    let mut scene = Builder::default();
    let wall = scene.diffuse(0.0, 1.0);
    scene.0.materials[wall.0 as usize].emission_two_sided = true;
    let fog = scene.medium(Vec3::ZERO, scattering, 0.5);
    scene.sphere(Vec3::ZERO, 1.5, wall);
    let picture = scene.look_within(fog, Vec3::new(0.3, 0.2, 0.0), Vec3::ZERO, 1000);
    for c in 0..3 {
        suite.judge(channel(&picture, c).p_equals(1.0), format_args!("a room full of fog, channel {c}"));
    }
}

/// Emission and absorption in equilibrium: deep in a medium that scatters, absorbs and glows, light is what it glows.
#[test]
fn glowing_media_reach_equilibrium() {
    let mut scene = Builder::default();
    let (absorption, scattering) = (Vec3::new(0.5, 0.3, 1.0), Vec3::new(0.2, 0.9, 0.4));
    let glow = scene.medium(absorption, scattering, 0.2);
    scene.0.media[0].emission = Vec3::new(1.0, 2.0, 0.5);
    scene.sky(0.0);
    let picture = scene.look_within(glow, Vec3::ZERO, Vec3::X, 1000);
    let mut suite = Suite::new(3);
    for (c, expected) in [1.0, 2.0, 0.5].into_iter().enumerate() {
        suite.judge(channel(&picture, c).p_equals(expected), format_args!("channel {c}"));
    }
}

/// Light of a point lamp that scatters once on its way to the eye: `int sigma_s p(theta) I / r^2 exp(-sigma_t (t + r))
/// dt`, over a ray that ends on a black wall and over one without end.
#[test]
fn single_scattering_matches_quadrature() {
    let (absorption, scattering, g) = (Vec3::new(0.1, 0.2, 0.0), Vec3::new(0.3, 0.1, 0.6), 0.6_f32);
    let lamp = Vec3::new(0.5, 0.6, 1.5);
    let single = |end: f64, c: usize| {
        let steps = 200_000;
        let (s, t) = (f64::from(scattering[c]), f64::from((absorption + scattering)[c]));
        let step = end / f64::from(steps);
        let g = f64::from(g);
        (0..steps)
            .map(|i| {
                // The eye looks along +z.
                let z = (f64::from(i) + 0.5) * step;
                let to_lamp = lamp.as_dvec3() - DVec3::Z * z;
                let r2 = to_lamp.length_squared();
                // Light travels from the lamp to the eye: it turns from -to_lamp to -z.
                let cosine = to_lamp.z / r2.sqrt();
                let phase = (1.0 - g * g) / (4.0 * PI * (1.0 + g * g - 2.0 * g * cosine).powf(1.5));
                s * phase * 5.0 / r2 * (-t * (z + r2.sqrt())).exp() * step
            })
            .sum::<f64>()
    };
    let mut suite = Suite::new(6);
    for (wall, end) in [(true, 2.5), (false, 60.0)] {
        let mut scene = Builder::default();
        let fog = scene.medium(absorption, scattering, g);
        scene.0.lights.push(desc::Light::Point { position: lamp, intensity: Vec3::splat(5.0) });
        let black = scene.diffuse(0.0, 0.0);
        let turn = Affine3A::from_rotation_x(std::f32::consts::FRAC_PI_2);
        let place = if wall { 2.5 } else { -50.0 };
        scene.place(square(9.0, 0.0, true), black, Affine3A::from_translation(Vec3::Z * place) * turn);
        let picture = scene.look_within(fog, Vec3::ZERO, Vec3::Z, 2);
        for c in 0..3 {
            let what = format!("channel {c}, wall {wall}");
            suite.judge(channel(&picture, c).p_equals(single(end, c)), what);
        }
    }
}

/// An area light in fog, found by next-event estimation and by chance: both, weighted, give what chance alone gives
/// (seen through a pane of index 1 that hides the lamp from light sampling).
#[test]
fn strategies_agree_in_fog() {
    let picture = |pane: bool| {
        let mut scene = Builder::default();
        let fog = scene.medium(Vec3::new(0.1, 0.2, 0.3), Vec3::new(1.0, 0.5, 0.2), 0.7);
        let lamp = scene.diffuse(0.0, 4.0);
        scene.sphere(Vec3::new(0.0, 1.0, 1.5), 0.6, lamp);
        if pane {
            let glass = scene.material(glass(1.0, 0.0), 0.0, Alpha::Opaque);
            scene.sphere(Vec3::new(0.0, 1.0, 1.5), 0.61, glass);
        }
        // The pane takes a segment of its own; light that scatters twice still has none left to pass it.
        scene.look_within(fog, Vec3::ZERO, Vec3::new(0.0, 0.1, 1.0), if pane { 3 } else { 2 })
    };
    let (weighted, chance) = (picture(false), picture(true));
    let mut suite = Suite::new(3);
    for c in 0..3 {
        suite.judge(channel(&weighted, c).p_same(&channel(&chance, c)), format_args!("channel {c}"));
    }
}

/// A grid of colours from 0.5 to 1.5 in a box that holds the ball of radius 1.
fn mottled(scene: &mut Builder, medium: Option<MediumId>) {
    let mut rng = Rng::new(7);
    let values =
        (0..8 * 9 * 10).map(|_| 1.5 - Vec3::new(rng.next_1d(), rng.next_1d(), rng.next_1d())).collect();
    let scattering = Some(Grid::dense([8, 9, 10], values));
    let from_world = Affine3A::from_translation(Vec3::splat(0.5)) * Affine3A::from_scale(Vec3::splat(0.4));
    let density = Density::Colors { absorption: None, scattering };
    let medium = &mut scene.0.media[medium.expect("a medium").0 as usize];
    medium.variation = Some(Arc::new(Variation { from_world, density, glow: None }));
}

/// What varies and absorbs nothing cannot be seen under an even sky either, nor in a room full of it.
#[test]
fn white_media_that_vary_are_invisible_in_a_furnace() {
    let scattering = Vec3::new(0.7, 1.5, 4.0);
    let mut suite = Suite::new(2 * 3);
    let mut scene = Builder::default();
    scene.sky(1.0);
    let (fog, border) = (scene.medium(Vec3::ZERO, scattering, 0.4), scene.interface());
    mottled(&mut scene, fog);
    scene.sphere(Vec3::ZERO, 1.0, border);
    scene.border(fog, None);
    let picture = scene.look(Vec3::Z * 3.0, Vec3::new(0.2, 0.1, 0.0), 1000);
    for c in 0..3 {
        suite.judge(channel(&picture, c).p_equals(1.0), format_args!("a ball, channel {c}"));
    }
    let mut scene = Builder::default();
    let wall = scene.diffuse(0.0, 1.0);
    scene.0.materials[wall.0 as usize].emission_two_sided = true;
    let fog = scene.medium(Vec3::ZERO, scattering, 0.5);
    mottled(&mut scene, fog);
    scene.sphere(Vec3::ZERO, 1.5, wall);
    let picture = scene.look_within(fog, Vec3::new(0.3, 0.2, 0.0), Vec3::ZERO, 1000);
    for c in 0..3 {
        suite.judge(channel(&picture, c).p_equals(1.0), format_args!("a room, channel {c}"));
    }
}

/// A grid that is the same everywhere is drawn as the medium without it.
#[test]
fn even_grids_look_like_homogeneous_media() {
    let picture = |even: bool| {
        let mut scene = Builder::default();
        let (absorption, scattering) = (Vec3::new(0.1, 0.2, 0.3), Vec3::new(1.0, 0.5, 0.2));
        let fog = scene.medium(absorption, scattering, 0.7);
        scene.0.media[0].emission = Vec3::new(0.3, 0.2, 0.1);
        if even {
            // Wide enough for its rim to lie outside.
            let from_world =
                Affine3A::from_translation(Vec3::splat(0.5)) * Affine3A::from_scale(Vec3::splat(0.1));
            let density = Density::Grid(Grid::dense([8; 3], vec![1.0; 512]));
            scene.0.media[0].variation = Some(Arc::new(Variation { from_world, density, glow: None }));
        }
        let (lamp, border) = (scene.diffuse(0.0, 4.0), scene.interface());
        scene.sphere(Vec3::new(0.0, 1.0, 1.5), 0.6, lamp);
        scene.sphere(Vec3::ZERO, 3.0, border);
        scene.border(fog, None);
        scene.sky(0.5);
        scene.look_within(fog, Vec3::ZERO, Vec3::new(0.0, 0.1, 1.0), 6)
    };
    let (plain, grid) = (picture(false), picture(true));
    let mut suite = Suite::new(3);
    for c in 0..3 {
        suite.judge(channel(&plain, c).p_same(&channel(&grid, c)), format_args!("channel {c}"));
    }
}

/// Media and borders that cannot be are refused by name.
#[test]
fn unsound_media_are_refused() {
    let sound = || {
        let mut scene = Builder::default();
        let fog = scene.medium(Vec3::ONE, Vec3::ONE, 0.0);
        let border = scene.interface();
        scene.sphere(Vec3::ZERO, 1.0, border);
        scene.border(fog, None);
        scene
    };
    let refusal = |spoil: &dyn Fn(&mut Builder)| {
        let mut scene = sound();
        spoil(&mut scene);
        Scene::build(&scene.0).expect_err("spoilt").to_string()
    };
    Scene::build(&sound().0).expect("sound before it is spoilt");
    assert!(refusal(&|s| s.0.media[0].g = 1.5).starts_with("medium 0 \"\": asymmetry is 1.5;"));
    assert!(refusal(&|s| s.0.media[0].scattering.y = -1.0).contains("scattering is"));
    assert!(refusal(&|s| s.0.media[0].emission.y = f32::NAN).contains("emission is"));
    let even = |size: [u32; 3]| {
        let density = Density::Grid(Grid::dense(size, vec![1.0; 8]));
        Some(Arc::new(Variation { from_world: Affine3A::IDENTITY, density, glow: None }))
    };
    let message = refusal(&|s| s.0.media[0].variation = even([2, 2, 3]));
    assert!(message.contains("8 values in the grid, expected 12"), "{message}");
    assert!(refusal(&|s| s.0.media[0].variation = even([8, 0, 1])).contains("size of the grid is 8x0x1"));
    assert!(refusal(&|s| s.border(None, Some(MediumId(1)))).contains("medium 1 does not exist; there are 1"));
}
