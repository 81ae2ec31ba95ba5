//! Light below surfaces: furnaces, the same as glass filled with a medium, and the colour that was asked for.

use glam::Vec3;

use super::*;
use crate::bsdf::subsurface::{SubsurfaceTable, WALKS};
use crate::desc::{Interior, Medium, MediumId, MediumInterface, Subsurface};

fn below(ior: f32, g: f32, interior: Interior) -> Surface {
    Surface::Subsurface(Box::new(Subsurface { ior, roughness: Roughness::SMOOTH, interior, g }))
}

fn coefficients(absorption: Vec3, scattering: Vec3) -> Interior {
    let [absorption, scattering] = [absorption, scattering].map(ColorParam::constant);
    Interior::Coefficients { absorption, scattering }
}

/// One channel of all samples.
fn channel(picture: &Picture, channel: usize) -> Mean {
    let mut mean = Mean::default();
    picture.samples.iter().for_each(|s| mean.push(f64::from(s.radiance[channel])));
    mean
}

/// What absorbs nothing cannot be seen under an even sky, whatever wanders below: also where normals point inwards and
/// where two things overlap, and with few segments, since walks do not count.
#[test]
fn white_interiors_are_invisible_in_a_furnace() {
    let scattering = Vec3::new(0.7, 3.0, 12.0);
    let mut suite = Suite::new(4 * 3);
    for (ior, g, inverted, two) in [
        (1.4, 0.0, false, false),
        (1.0, 0.8, false, false),
        (1.4, -0.5, true, false),
        (1.0, 0.0, false, true),
    ] {
        let mut scene = Builder::default();
        scene.sky(1.0);
        let interior = coefficients(Vec3::ZERO, scattering);
        let skin = scene.material(below(ior, g, interior), 0.0, Alpha::Opaque);
        scene.sphere(Vec3::ZERO, 1.0, skin);
        scene.0.objects[0].shapes[0].flipped = inverted;
        if two {
            scene.sphere(Vec3::X * 0.7, 1.0, skin);
        }
        // Straight through glass light is reflected inside a few times.
        let picture = scene.look(Vec3::Z * 3.0, Vec3::new(0.2, 0.1, 0.0), 40);
        for c in 0..3 {
            suite.judge(channel(&picture, c).p_equals(1.0), format_args!("{ior} {g} {inverted} {two}: {c}"));
        }
    }
}

/// Under an even sky it does not matter where light leaves to: glass filled with a medium, whose paths are made of plain
/// segments, gives back as much.
#[test]
fn walks_give_back_what_filled_glass_does() {
    let (absorption, scattering) = (Vec3::new(0.02, 0.3, 2.0), Vec3::new(2.0, 3.0, 5.0));
    let mut suite = Suite::new(2 * 3);
    for g in [0.0, 0.6] {
        let mut walks = Builder::default();
        walks.sky(1.0);
        let skin = walks.material(below(1.4, g, coefficients(absorption, scattering)), 0.0, Alpha::Opaque);
        walks.sphere(Vec3::ZERO, 1.0, skin);
        let mut filled = Builder::default();
        filled.sky(1.0);
        let glass = filled.material(glass(1.4, 0.0), 0.0, Alpha::Opaque);
        filled.sphere(Vec3::ZERO, 1.0, glass);
        let (name, emission) = (String::new(), Vec3::ZERO);
        filled.0.media.push(Medium { name, absorption, scattering, emission, g, variation: None });
        filled.0.objects[0].shapes[0].media =
            Some(MediumInterface { inside: Some(MediumId(0)), outside: None });
        let look = |scene: &Builder| scene.look(Vec3::Z * 3.0, Vec3::new(0.2, 0.1, 0.0), 2000);
        let (walks, filled) = (look(&walks), look(&filled));
        for c in 0..3 {
            suite.judge(channel(&walks, c).p_same(&channel(&filled, c)), format_args!("g = {g}, {c}"));
        }
    }
}

/// What only absorbs is coloured glass, sample by sample.
#[test]
fn what_does_not_scatter_is_coloured_glass() {
    let dye = Vec3::new(0.2, 1.1, 0.0);
    let mut walks = ground();
    let skin = walks.material(below(1.5, 0.0, coefficients(dye, Vec3::ZERO)), 0.0, Alpha::Opaque);
    walks.sphere(Vec3::Y, 0.8, skin);
    walks.sky(1.0);
    let mut filled = ground();
    let glass = filled.material(glass(1.5, 0.0), 0.0, Alpha::Opaque);
    filled.sphere(Vec3::Y, 0.8, glass);
    filled.sky(1.0);
    let (name, emission, scattering) = (String::new(), Vec3::ZERO, Vec3::ZERO);
    filled.0.media.push(Medium { name, absorption: dye, scattering, emission, g: 0.0, variation: None });
    filled.0.objects[1].shapes[0].media = Some(MediumInterface { inside: Some(MediumId(0)), outside: None });
    let look = |scene: &Builder| scene.look(Vec3::new(2.0, 2.0, 0.1), Vec3::Y, 12);
    for (a, b) in look(&walks).samples.iter().zip(&look(&filled).samples) {
        let off = (a.radiance - b.radiance).abs();
        assert!(
            off.cmple(1e-4 * b.radiance.max(Vec3::splat(1e-3))).all(),
            "{} and {}",
            a.radiance,
            b.radiance
        );
    }
}

/// A half-space that is asked to give back a colour gives it back to even light: what is reflected by its surface, and of
/// the rest the share that was asked for. Seen from directions that are distributed as such light is.
#[test]
fn half_spaces_have_the_reflectance_asked_for() {
    const ANGLES: u32 = 512;
    let asked = Vec3::new(0.25, 0.6, 0.92);
    let free = Vec3::new(1.0, 0.5, 0.2);
    let mut suite = Suite::new(2 * 3);
    for (ior, g) in [(1.33, 0.0), (1.5, 0.7)] {
        let mut scene = Builder::default();
        scene.sky(1.0);
        let [reflectance, mean_free_path] = [asked, free].map(ColorParam::constant);
        let interior = Interior::Reflectance { reflectance, mean_free_path };
        let skin = scene.material(below(ior, g, interior), 0.0, Alpha::Opaque);
        scene.add(square(1e4, 0.0, true), skin);
        let compiled = Scene::build(&scene.0).expect("a sound scene");
        let mut rng = Rng::new(3);
        let mut picture = Picture::default();
        for i in 0..ANGLES {
            let squared = (i as f32 + rng.next_1d()) / ANGLES as f32;
            let (sine, cosine) = ((1.0 - squared).sqrt(), squared.sqrt());
            let mut view = view(10.0 * Vec3::new(sine, cosine, 0.0), Vec3::ZERO, 1, 1e-3, 10);
            for seed in 0..64 {
                view.seed = u64::from(64 * i + seed);
                let work = PixelWork { x: 0, y: 0, pixel: 0, replicate: 0, first: 0, count: 1 };
                render_tile(&compiled, &view, &[work], &mut picture);
            }
        }
        let entering = SubsurfaceTable::new(ior, g).entering;
        for c in 0..3 {
            let expected = 1.0 - entering + entering * asked[c];
            // The table is an estimate too: of values between 0 and 1, drawn so many times.
            let (n, r) = (WALKS as usize, f64::from(asked[c]));
            let (mean, spread) = (f64::from(expected), f64::from(entering) * (r * (1.0 - r)).sqrt());
            let table = Mean::from_sums(n, n as f64 * mean, n as f64 * (mean * mean + spread * spread));
            suite.judge(channel(&picture, c).p_same(&table), format_args!("{ior}, {g}, channel {c}"));
        }
    }
}

/// A lamp found by light sampling where light leaves, and by chance: both, weighted, give what chance alone gives (seen
/// through a pane of index 1 that hides the lamp from light sampling). A lamp without extent, which chance never finds,
/// lights it too.
#[test]
fn lamps_light_what_is_below() {
    let interior = coefficients(Vec3::new(0.05, 0.1, 0.3), Vec3::new(4.0, 5.0, 6.0));
    let room = || {
        let mut scene = Builder::default();
        let skin = scene.material(below(1.3, 0.0, interior), 0.0, Alpha::Opaque);
        scene.sphere(Vec3::ZERO, 1.0, skin);
        scene
    };
    let picture = |pane: bool| {
        let mut scene = room();
        let lamp = scene.diffuse(0.0, 4.0);
        scene.sphere(Vec3::new(0.0, 2.5, 1.5), 1.0, lamp);
        if pane {
            let glass = scene.material(glass(1.0, 0.0), 0.0, Alpha::Opaque);
            scene.sphere(Vec3::new(0.0, 2.5, 1.5), 1.01, glass);
        }
        scene.look(Vec3::Z * 4.0, Vec3::new(0.0, 0.3, 0.0), if pane { 4 } else { 3 })
    };
    let (weighted, chance) = (picture(false), picture(true));
    let mut suite = Suite::new(3);
    for c in 0..3 {
        suite.judge(channel(&weighted, c).p_same(&channel(&chance, c)), format_args!("channel {c}"));
    }
    let mut scene = room();
    let position = Vec3::new(0.0, 2.0, 2.0);
    scene.0.lights.push(desc::Light::Point { position, intensity: Vec3::splat(8.0) });
    let seen = scene.look(Vec3::Z * 4.0, Vec3::new(0.0, 0.3, 0.0), 3);
    assert!(seen.radiance.mean() > 0.1, "{}", seen.radiance.mean());
}
