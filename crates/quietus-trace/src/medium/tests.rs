//! Phase functions and free flights against their densities.

use glam::Vec3;

use super::{Border, Flight, HenyeyGreenstein, Inside, Medium, Passage};
use crate::desc::{self, MediumId, MediumInterface};
use crate::testing::{Mean, Rng, Suite, chi_square, chi_square_directions};

fn medium(absorption: Vec3, scattering: Vec3) -> Medium {
    Medium::new(&desc::Medium {
        name: String::new(),
        absorption,
        scattering,
        emission: Vec3::new(1.0, 2.0, 3.0),
        g: 0.0,
        variation: None,
    })
}

#[test]
fn phase_functions_are_sampled_with_their_density() {
    let asymmetries = [-0.7, -2e-4, 0.0, 9e-4, 1.1e-3, 0.3, 0.85];
    let mut suite = Suite::new(2 * asymmetries.len());
    let from = Vec3::new(0.48, -0.6, 0.64);
    for (seed, g) in (0u64..).zip(asymmetries) {
        let phase = HenyeyGreenstein::new(g);
        let sample = |rng: &mut Rng| Some(phase.sample(from, rng.next_2d()).0);
        let p = chi_square_directions(seed, 40_000, sample, |w| phase.density(from, w));
        suite.judge(p, format_args!("g = {g}"));
        let mut rng = Rng::new(100 + seed);
        let cosine = Mean::of(40_000, || f64::from(phase.sample(from, rng.next_2d()).0.dot(from)));
        suite.judge(cosine.p_equals(f64::from(g)), format_args!("mean cosine at g = {g}"));
    }
}

/// The sharpest peaks stay finite, and what `sample` returns is what `density` says.
#[test]
fn extreme_asymmetries_stay_finite() {
    let mut rng = Rng::new(1);
    for g in [-1.0, -0.9999, 0.9999, 1.0] {
        let phase = HenyeyGreenstein::new(g);
        for _ in 0..1000 {
            let (to, density) = phase.sample(Vec3::Z, rng.next_2d());
            assert!(density.is_finite() && density >= 0.0, "{density} at {g}");
            assert!((to.length() - 1.0).abs() < 1e-5);
            assert_eq!(density, phase.density(Vec3::Z, to));
        }
    }
}

/// Two layers of chromatic media, the second one without scattering in green, and absorption alone between them.
fn layers() -> [(Medium, f32); 3] {
    [
        (medium(Vec3::new(0.1, 0.0, 0.4), Vec3::new(0.5, 2.0, 0.8)), 0.7),
        (medium(Vec3::new(0.3, 0.1, 0.0), Vec3::ZERO), 0.5),
        (medium(Vec3::new(0.0, 0.9, 0.2), Vec3::new(3.0, 0.0, 0.4)), 0.6),
    ]
}

/// Share of light that passes all layers before the one of this number, and that one up to `distance`.
fn transmittance(number: usize, distance: f32) -> Vec3 {
    let layers = layers();
    let before = layers[..number].iter().map(|(m, d)| m.extinction * *d).sum::<Vec3>();
    (-(before + layers[number].0.extinction * distance)).map(f32::exp)
}

#[test]
fn flights_carry_what_the_medium_lets_through() {
    const DRAWS: usize = 60_000;
    const SLICES: usize = 4;
    let carried = Vec3::new(0.2, 1.0, 0.5);
    let mut rng = Rng::new(3);
    // Per slice of each layer what scatters there, and at the end what passes: by channel.
    let mut scattered = [[[Mean::default(); 3]; SLICES]; 3];
    let mut passed = [Mean::default(); 3];
    for _ in 0..DRAWS {
        let mut flight = Flight::new(carried, rng.next_1d());
        let mut end = None;
        for (number, (medium, length)) in layers().iter().enumerate() {
            if let Some(found) = flight.fly(medium, *length) {
                assert!((0.0..*length).contains(&found.distance));
                let slice = (found.distance / length * SLICES as f32) as usize;
                end = Some((number, slice.min(SLICES - 1), found.weight * carried));
                break;
            }
        }
        for channel in 0..3 {
            for (number, layer) in scattered.iter_mut().enumerate() {
                for (slice, mean) in layer.iter_mut().enumerate() {
                    let here = end.filter(|&(n, s, _)| (n, s) == (number, slice));
                    mean[channel].push(here.map_or(0.0, |(.., weight)| f64::from(weight[channel])));
                }
            }
            let arrived = flight.passage.weight() * carried;
            passed[channel].push(if end.is_some() { 0.0 } else { f64::from(arrived[channel]) });
        }
    }
    let mut suite = Suite::new(3 + 2 * SLICES * 3);
    for (channel, mean) in passed.iter().enumerate() {
        let exact = f64::from((carried * transmittance(2, layers()[2].1))[channel]);
        suite.judge(mean.p_equals(exact), format_args!("channel {channel} through all layers"));
    }
    for (number, (medium, length)) in layers().iter().enumerate() {
        for (slice, means) in scattered[number].iter().enumerate() {
            let at = |s: usize| length * s as f32 / SLICES as f32;
            let lost = transmittance(number, at(slice)) - transmittance(number, at(slice + 1));
            let albedo = medium.albedo();
            for (channel, mean) in means.iter().enumerate() {
                let exact = f64::from((carried * lost * albedo)[channel]);
                if exact == 0.0 {
                    assert_eq!(mean.mean(), 0.0, "layer {number} scatters nothing in channel {channel}");
                    if medium.scatters {
                        suite.judge(1.0, "nothing");
                    }
                } else {
                    suite.judge(
                        mean.p_equals(exact),
                        format_args!("layer {number}, slice {slice}, {channel}"),
                    );
                }
            }
        }
    }
}

/// Distances, whatever their weight, come up as often as a mixture of exponentials says; the number that arrive is what
/// next-event estimation reckons with.
#[test]
fn flights_end_as_often_as_they_say() {
    const DRAWS: u64 = 60_000;
    const CELLS: usize = 16;
    let medium = medium(Vec3::new(0.1, 0.0, 0.4), Vec3::new(0.5, 2.0, 0.0));
    let carried = Vec3::new(0.2, 0.3, 0.5);
    let length = 1.5_f32;
    let survivors = |distance: f32| {
        let mut passage = Passage::new(carried);
        passage.pass(&medium, distance);
        f64::from(passage.probability())
    };
    let mut rng = Rng::new(4);
    let mut observed = [0u64; CELLS + 1];
    for _ in 0..DRAWS {
        let found = Flight::new(carried, rng.next_1d()).fly(&medium, length);
        observed[found.map_or(CELLS, |f| (f.distance / length * CELLS as f32) as usize)] += 1;
    }
    let at = |cell: usize| survivors(length * cell as f32 / CELLS as f32);
    let mut expected: Vec<f64> = (0..CELLS).map(|cell| (at(cell) - at(cell + 1)) * DRAWS as f64).collect();
    expected.push(survivors(length) * DRAWS as f64);
    Suite::new(1).judge(chi_square(&observed, &expected), "free flights");
}

/// Grey light in a grey medium keeps its weight: nothing is lost to the choice of channels.
#[test]
fn grey_flights_have_no_variance() {
    let medium = medium(Vec3::splat(0.5), Vec3::splat(1.5));
    let mut rng = Rng::new(5);
    for _ in 0..1000 {
        let mut flight = Flight::new(Vec3::splat(0.7), rng.next_1d());
        let weight = flight.fly(&medium, 0.5).map_or_else(|| flight.passage.weight() * 0.75, |s| s.weight);
        assert!((weight - 0.75).abs().max_element() < 1e-5, "{weight}");
    }
}

/// Borders at infinity, light that carries nothing, and vacuum that calls itself a medium.
#[test]
fn flights_without_end_or_light_stay_finite() {
    let void = medium(Vec3::ZERO, Vec3::ZERO);
    let red = medium(Vec3::new(1.0, 0.0, 0.0), Vec3::new(1.0, 0.0, 0.0));
    let mut rng = Rng::new(6);
    for carried in [Vec3::ZERO, Vec3::ONE, Vec3::X, Vec3::Y, Vec3::NAN, Vec3::splat(1e-42)] {
        for u in [0.0, 0.5, 1.0 - f32::EPSILON / 2.0, rng.next_1d()] {
            for medium in [void, red] {
                let mut flight = Flight::new(carried, u);
                match flight.fly(&medium, f32::INFINITY) {
                    Some(scattered) => {
                        assert!(scattered.weight.is_finite() && scattered.distance.is_finite())
                    }
                    None => assert!(flight.passage.weight().is_finite(), "{carried} {u}"),
                }
            }
        }
    }
    let mut flight = Flight::new(Vec3::Y, 0.99);
    assert_eq!(flight.fly(&red, f32::INFINITY), None, "green light passes");
    assert_eq!(flight.passage.weight().y, 1.0);
}

/// `j (1 - exp(-sigma d)) / sigma`, by summing up slices.
#[test]
fn emission_adds_up_along_the_way() {
    let medium = medium(Vec3::new(0.1, 2.0, 0.0), Vec3::new(0.5, 0.0, 1.0));
    let (length, slices) = (1.7_f32, 4000);
    let emission = Vec3::new(1.0, 2.0, 3.0) * Vec3::new(0.1, 2.0, 0.0);
    let step = length / slices as f32;
    let at = |i: i32| medium.transmittance((i as f32 + 0.5) * step) * emission * step;
    let sum: Vec3 = (0..slices).map(at).sum();
    let emitted = medium.emitted(length);
    assert!((emitted - sum).abs().max_element() < 1e-4, "{emitted} against {sum}");
    assert!(medium.emitted(f32::INFINITY).is_finite());
    assert_eq!(medium.emitted(0.0), Vec3::ZERO);
}

#[test]
fn borders_know_their_sides() {
    let [a, b] = [MediumId(3), MediumId(5)].map(Some);
    let border = Border::new(Some(MediumInterface { inside: a, outside: b })).expect("two media");
    assert_eq!(border.beyond(Vec3::Z, Vec3::Z), Inside::new(b));
    assert_eq!(border.beyond(-Vec3::Z, Vec3::Z), Inside::new(a));
    assert!(Border::new(Some(MediumInterface { inside: a, outside: a })).is_none());
    assert!(Border::new(None).is_none());
    assert!(Inside::VACUUM.of(&[medium(Vec3::ONE, Vec3::ONE)]).is_none());
}

/// The number that chooses channels stays uniform over the walk, whatever becomes of the light in each of them.
#[test]
fn numbers_of_channels_stay_uniform() {
    let medium = Medium::below([Vec3::new(0.1, 1.5, 0.0), Vec3::new(1.0, 2.0, 0.3)], 0.0);
    let mut rng = Rng::new(77);
    let (mut counts, walks) = ([0_u64; 32], 200_000);
    for _ in 0..walks {
        let (mut carried, mut number) = (Vec3::new(0.2, 0.5, 0.9), rng.next_1d());
        for step in 0..4 {
            let (mut flight, left) = Flight::in_channel(carried, number, rng.next_1d());
            // Now and then something is in the way.
            let length = if step == 2 { 0.4 } else { f32::INFINITY };
            let scattered = flight.fly(&medium, length);
            number = flight.channel_number(&medium, scattered.map(|s| s.distance), left);
            carried *= scattered.map_or_else(|| flight.passage.weight(), |s| s.weight);
        }
        counts[(number * 32.0) as usize] += 1;
    }
    let mut suite = Suite::new(1);
    suite.judge(chi_square(&counts, &[f64::from(walks) / 32.0; 32]), "numbers after four flights");
}
