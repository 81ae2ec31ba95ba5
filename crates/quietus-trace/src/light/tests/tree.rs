//! The choice among lights: as probable as it says, leaving nothing out, with the same mean as a uniform choice and
//! less noise than one by power.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::Vec3;

use crate::bvh::Bounds;
use crate::isa::{Level, Portable};
use crate::light::bounds::{LightBounds, Receiver};
use crate::light::select::LightSelector;
use crate::light::tree::LightTree;
use crate::testing::{Mean, Rng, Suite, chi_square};

const LIGHTS: usize = 300;

/// A lamp so small that its light follows from the laws of distance and cosine.
#[derive(Clone, Copy)]
struct Lamp {
    position: Vec3,
    axis: Vec3,
    /// Half angle of a spot's hard cone; none for flat lamps.
    cone: Option<f32>,
    two_sided: bool,
    power: f32,
}

impl Lamp {
    /// Some lamp in a room of size 10; powers span four decades.
    fn random(rng: &mut Rng) -> Self {
        let cone = [None, None, Some(PI), Some(0.2 + 1.5 * rng.next_1d())][(rng.next_u64() % 4) as usize];
        // Most lamps hang in clusters and look down, as in a real room.
        let cluster = Vec3::new((rng.next_u64() % 3) as f32, 2.0, (rng.next_u64() % 2) as f32) * 3.0;
        let axis = (rng.next_direction() - 0.8 * Vec3::Y).normalize();
        Self {
            position: cluster + rng.next_direction(),
            axis,
            cone,
            two_sided: cone.is_none() && rng.next_1d() < 0.3,
            power: 10f32.powf(4.0 * rng.next_1d()),
        }
    }

    fn bounds(&self) -> LightBounds {
        let bounds = Bounds { min: self.position, max: self.position };
        match self.cone {
            None => LightBounds::surface(bounds, self.axis, 0.0, self.power, self.two_sided),
            Some(PI) => LightBounds::omnidirectional(bounds, self.power),
            Some(theta_o) => LightBounds {
                theta_o,
                axis: self.axis,
                theta_e: 1e-3,
                ..LightBounds::omnidirectional(bounds, self.power)
            },
        }
    }

    /// Irradiance on a surface, from its front, or from all sides; at a point without normal the fluence.
    fn irradiance(&self, at: Vec3, normal: Vec3, transmits: bool) -> f32 {
        let to_point = at - self.position;
        let distance2 = to_point.length_squared();
        let w = to_point / distance2.sqrt();
        let cosine = w.dot(self.axis);
        let intensity = match self.cone {
            None if self.two_sided => self.power * cosine.abs() / (2.0 * PI),
            None => self.power * cosine.max(0.0) / PI,
            Some(cone) if cosine >= cone.cos() => self.power / (2.0 * PI * (1.0 - cone.cos())),
            Some(_) => 0.0,
        };
        let arriving = -w.dot(normal);
        let arriving = match () {
            () if normal == Vec3::ZERO => 1.0,
            () if transmits => arriving.abs(),
            () => arriving.max(0.0),
        };
        intensity * arriving / distance2
    }
}

/// Receivers of all kinds: position, normal (0 in a medium), whether light passes through.
fn receivers(rng: &mut Rng, count: usize) -> Vec<(Receiver, Vec3, Vec3, bool)> {
    (0..count)
        .map(|i| {
            let position = Vec3::new(4.0, 4.0, 2.0) + 5.0 * rng.next_direction();
            let normal = if i % 3 == 0 { Vec3::ZERO } else { rng.next_direction() };
            let receiver = match i % 3 {
                0 => Receiver::medium(position, 0.0),
                kind => Receiver::surface(position, 0.0, normal, kind == 2),
            };
            (receiver, position, normal, i % 3 == 2)
        })
        .collect()
}

fn room() -> (Vec<Lamp>, Rng) {
    let mut rng = Rng::new(21);
    let lamps = (0..LIGHTS).map(|_| Lamp::random(&mut rng)).collect();
    (lamps, rng)
}

fn tree_over(lamps: &[Lamp]) -> LightTree {
    let bounds: Vec<_> = lamps.iter().map(Lamp::bounds).collect();
    LightTree::new(&bounds).expect("lamps that shine")
}

#[test]
fn lights_come_up_as_often_as_they_say() {
    const DRAWS: usize = 60_000;
    let (lamps, mut rng) = room();
    let mut suite = Suite::new(6 + 5);
    for count in [1, 2, 7, 8, 9, LIGHTS] {
        let tree = tree_over(&lamps[..count]);
        for (receiver, ..) in receivers(&mut rng, if count == LIGHTS { 6 } else { 1 }) {
            let probability = |light: usize| tree.probability(Portable, &receiver, light as u32);
            let mut expected: Vec<f64> =
                (0..count).map(|light| f64::from(probability(light)) * DRAWS as f64).collect();
            // A group may look brighter than all its lights turn out to be: the choice may come to nothing.
            let lost = 1.0 - expected.iter().sum::<f64>() / DRAWS as f64;
            assert!(lost > -1e-5, "probabilities sum up to {}", 1.0 - lost);
            expected.push(if lost < 1e-5 { 0.0 } else { lost * DRAWS as f64 });
            let mut observed = vec![0u64; count + 1];
            for _ in 0..DRAWS {
                let Some((light, p)) = tree.sample(Portable, &receiver, rng.next_1d()) else {
                    observed[count] += 1;
                    continue;
                };
                observed[light as usize] += 1;
                let up = probability(light as usize);
                assert!((p - up).abs() <= 1e-6 * up, "{p} on the way down, {up} on the way up");
            }
            let certain = expected.iter().filter(|&&e| e > 0.0).count() == 1;
            let p = if certain { 1.0 } else { chi_square(&observed, &expected) };
            suite.judge(p, format_args!("{count} lights"));
        }
    }
}

/// A light that can do something is never left out, however narrow its cone or low above the horizon it is: nothing
/// else could find a light without extent.
#[test]
fn no_light_that_matters_is_left_out() {
    let (lamps, mut rng) = room();
    let tree = tree_over(&lamps);
    for (receiver, position, normal, transmits) in receivers(&mut rng, 600) {
        for (number, lamp) in (0u32..).zip(&lamps) {
            let irradiance = lamp.irradiance(position, normal, transmits);
            let probability = tree.probability(Portable, &receiver, number);
            assert!(probability > 0.0 || irradiance < 1e-6 * lamp.power, "{irradiance} from light {number}");
        }
    }
}

/// The same mean as a uniform choice, and for nearly every receiver less variance than a choice by power.
#[test]
fn the_tree_has_the_right_mean_and_less_noise() {
    const DRAWS: usize = 20_000;
    let (lamps, mut rng) = room();
    let tree = tree_over(&lamps);
    let by_power = crate::light::distribution::AliasTable::new(
        &lamps.iter().map(|lamp| f64::from(lamp.power)).collect::<Vec<_>>(),
    );
    let receivers = receivers(&mut rng, 30);
    let mut suite = Suite::new(receivers.len());
    let mut gains = Vec::new();
    for (receiver, position, normal, transmits) in &receivers {
        let irradiance =
            |light: u32| f64::from(lamps[light as usize].irradiance(*position, *normal, *transmits));
        // What a uniform choice would average to, without its noise.
        let exact: f64 = (0..LIGHTS as u32).map(irradiance).sum();
        let estimate = |choice: Option<(u32, f32)>| choice.map_or(0.0, |(l, p)| irradiance(l) / f64::from(p));
        let chosen = Mean::of(DRAWS, || estimate(tree.sample(Portable, receiver, rng.next_1d())));
        let power = Mean::of(DRAWS, || estimate(by_power.sample(rng.next_1d())));
        if exact == 0.0 {
            assert_eq!(chosen.mean(), 0.0, "light from nowhere");
            suite.judge(1.0, "a receiver in the dark");
            continue;
        }
        suite.judge(chosen.p_equals(exact), format_args!("at {position}"));
        gains.push(power.variance() / chosen.variance());
    }
    gains.sort_by(f64::total_cmp);
    // That most receivers gain much is what must not get lost.
    assert!(gains[gains.len() / 4] > 2.0, "gains over a choice by power: {gains:?}");
}

/// What is far off is weighed by the irradiance it causes, within bounds; the shares and choices still sum up to 1.
#[test]
fn infinite_lights_get_their_share() {
    let (lamps, mut rng) = room();
    let bounds: Vec<_> = lamps[..20].iter().map(Lamp::bounds).collect();
    for irradiance in [0.0, 1e-3, 30.0, 1e9] {
        let selector = LightSelector::new(&bounds, &[irradiance, 2.0 * irradiance]);
        for (receiver, ..) in receivers(&mut rng, 9) {
            let probability = |light| selector.probability(Portable, &receiver, light);
            let infinite = probability(20) + probability(21);
            let local: f32 = (0..20).map(probability).sum();
            if irradiance == 0.0 && local == 0.0 {
                assert_eq!(infinite, 0.0, "nothing shines on it");
                continue;
            }
            assert!(infinite + local < 1.0 + 1e-5, "{infinite} and {local}");
            let expected = match irradiance {
                _ if local == 0.0 => 1.0..=1.0,
                0.0 => 0.0..=0.0,
                1e-3 => 0.2499..=0.2501,
                1e9 => 0.7499..=0.7501,
                _ => 0.25..=0.75,
            };
            assert!(expected.contains(&infinite), "{infinite} of {irradiance}");
            for u in [0.0, 0.1, 0.25, 0.5, 0.75, 0.99, 1.0 - f32::EPSILON / 2.0] {
                let Some((light, p)) = selector.sample(Portable, &receiver, u) else { continue };
                assert!((p - probability(light)).abs() <= 1e-6 * p);
            }
        }
    }
    // A rectangular lamp in two halves: each comes up half the time, whoever asks.
    let corner = Bounds { min: Vec3::ZERO, max: Vec3::ONE.with_y(0.0) };
    let half = LightBounds::surface(corner, Vec3::NEG_Y, 0.0, 1.0, false);
    let receiver = Receiver::medium(Vec3::NEG_Y, 0.0);
    let lamp = LightSelector::new(&[half, half], &[]);
    assert_eq!([0, 1].map(|l| lamp.probability(Portable, &receiver, l)), [0.5; 2]);
    assert_eq!(lamp.sample(Portable, &receiver, 0.2), Some((0, 0.5)));
    let under_a_sky = LightSelector::new(&[half, half], &[1e9]);
    assert!((under_a_sky.probability(Portable, &receiver, 2) - 0.75).abs() < 1e-4);
    assert!(LightSelector::new(&[], &[]).sample(Portable, &Receiver::medium(Vec3::ZERO, 0.0), 0.5).is_none());
}

/// Both instruction sets choose alike: a picture must not depend on the processor.
#[test]
fn choices_do_not_depend_on_the_instruction_set() {
    struct Choices<'a>(&'a LightTree, &'a [(Receiver, Vec3, Vec3, bool)]);
    impl crate::isa::Job for Choices<'_> {
        type Output = Vec<Option<(u32, f32)>>;
        fn run<I: crate::isa::Isa>(self, isa: I) -> Self::Output {
            let mut rng = Rng::new(5);
            self.1.iter().map(|(receiver, ..)| self.0.sample(isa, receiver, rng.next_1d())).collect()
        }
    }
    let (lamps, mut rng) = room();
    let tree = tree_over(&lamps);
    let receivers = receivers(&mut rng, 300);
    let here = Level::detect().run(Choices(&tree, &receivers));
    assert_eq!(here, Level::portable().run(Choices(&tree, &receivers)));
}

/// Lights in one place, without power, not finite, or of all sizes at once: the tree stands, and finds what shines.
#[test]
fn awkward_lights_do_not_break_the_tree() {
    let at =
        |position: Vec3, power| LightBounds::omnidirectional(Bounds { min: position, max: position }, power);
    assert!(LightTree::new(&[]).is_none());
    assert!(
        LightTree::new(&[at(Vec3::ZERO, 0.0), at(Vec3::NAN, 1.0), at(Vec3::ONE, f32::INFINITY)]).is_none()
    );
    let mut lights = vec![at(Vec3::ONE, 1.0); 50];
    lights.push(at(Vec3::ONE, 0.0));
    lights.extend((0..60).map(|i| at(Vec3::X * 2f32.powi(i - 30), 1.0)));
    let huge = Bounds { min: Vec3::splat(-1e18), max: Vec3::splat(1e18) };
    lights.push(LightBounds::surface(huge, Vec3::Y, FRAC_PI_2, 1.0, true));
    let tree = LightTree::new(&lights).expect("lights that shine");
    for position in [Vec3::ZERO, Vec3::ONE, 1e15 * Vec3::Y] {
        let receiver = Receiver::medium(position, 0.0);
        let total: f32 = (0..lights.len() as u32).map(|l| tree.probability(Portable, &receiver, l)).sum();
        assert!(total > 0.5 && total < 1.0 + 1e-4, "{total} at {position}");
        assert_eq!(tree.probability(Portable, &receiver, 50), 0.0, "a light without power");
    }
}
