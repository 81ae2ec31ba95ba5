//! Flights through media that vary, against integrals of what they pass.

use super::*;
use crate::medium::Passage;
use crate::testing::{Mean, Rng, Suite, chi_square};

const ABSORPTION: Vec3 = Vec3::new(0.4, 1.0, 0.1);
const SCATTERING: Vec3 = Vec3::new(1.5, 0.3, 2.0);

/// A box from -1 to 1 with voxels of random density, some of them empty.
fn variation(seed: u64, size: [u32; 3]) -> Variation {
    let mut rng = Rng::new(seed);
    let values = (0..size.iter().product()).map(|_| (3.0 * rng.next_1d() - 1.0).max(0.0)).collect();
    let from_world = Affine3A::from_translation(Vec3::splat(0.5)) * Affine3A::from_scale(Vec3::splat(0.5));
    Variation { from_world, density: Density::Grid(Grid::dense(size, values)), glow: None }
}

fn medium(absorption: Vec3, scattering: Vec3, variation: Variation) -> (Medium, Field) {
    let description = desc::Medium {
        name: String::new(),
        absorption,
        scattering,
        emission: Vec3::new(1.0, 2.0, 3.0),
        g: 0.0,
        variation: Some(Arc::new(variation)),
    };
    (Medium::new(&description), Field::new(&description).expect("it varies"))
}

const SIZE: [u32; 3] = [9, 6, 13];

/// Through the box along no axis, from outside to outside.
fn way() -> Way {
    let (from, to) = (Vec3::new(-1.3, -0.4, -1.5), Vec3::new(1.2, 0.7, 1.6));
    Way { origin: from, direction: (to - from).normalize(), length: from.distance(to) }
}

/// The density along [`way`], by its definition: trilinear between the middles of voxels, 0 outside of the box.
fn density(variation: &Variation, t: f64) -> f64 {
    let Density::Grid(grid) = &variation.density else { panic!("a grid") };
    let p = (way().origin.as_dvec3() + t * way().direction.as_dvec3() + 1.0) * 0.5;
    if p.min_element() < 0.0 || p.max_element() > 1.0 {
        return 0.0;
    }
    let mut sum = 0.0;
    for (i, value) in grid.values.iter().enumerate() {
        let i = i as u32;
        let at = [i % SIZE[0], i / SIZE[0] % SIZE[1], i / SIZE[0] / SIZE[1]];
        let tent = |axis: usize| {
            let place = p[axis] * f64::from(SIZE[axis]) - 0.5 - f64::from(at[axis]);
            (1.0 - place.abs()).max(0.0)
        };
        sum += f64::from(*value) * tent(0) * tent(1) * tent(2);
    }
    sum
}

/// Midpoints of slices of the way, with the optical depth in front of each for an extinction of 1, and all of it.
fn slices(variation: &Variation) -> (Vec<(f64, f64, f64)>, f64) {
    const COUNT: usize = 4000;
    let step = f64::from(way().length) / COUNT as f64;
    let mut depth = 0.0;
    let slices = (0..COUNT).map(|i| {
        let t = (i as f64 + 0.5) * step;
        let density = density(variation, t);
        depth += density * step;
        (t, density * step, depth - 0.5 * density * step)
    });
    (slices.collect(), depth)
}

/// Where light scatters, what arrives, and what is emitted on the way, channel by channel.
#[test]
fn flights_carry_what_the_medium_lets_through() {
    const DRAWS: usize = 60_000;
    const PARTS: usize = 5;
    let variation = variation(1, SIZE);
    let (slices, depth) = slices(&variation);
    let (medium, field) = medium(ABSORPTION, SCATTERING, variation);
    let carried = Vec3::new(0.2, 1.0, 0.5);
    let mut rng = Rng::new(3);
    let mut scattered = [[Mean::default(); 3]; PARTS];
    let (mut passed, mut emitted) = ([Mean::default(); 3], [Mean::default(); 3]);
    let part = |t: f64| (t / f64::from(way().length) * PARTS as f64) as usize;
    for _ in 0..DRAWS {
        let mut flight = Flight::new(carried, rng.next_1d());
        let (mut chance, mut light) = (Chance::new(rng.next_u64()), Vec3::ZERO);
        let end = field.fly(&medium, &mut flight, &way(), &mut chance, |radiance| light += radiance);
        for c in 0..3 {
            for (i, means) in scattered.iter_mut().enumerate() {
                let here = end.filter(|end| part(f64::from(end.distance)).min(PARTS - 1) == i);
                means[c].push(here.map_or(0.0, |end| f64::from(end.weight[c])));
            }
            let weight = f64::from(flight.passage.weight()[c]);
            passed[c].push(if end.is_some() { 0.0 } else { weight });
            emitted[c].push(f64::from(light[c]));
        }
    }
    let mut suite = Suite::new(3 * (PARTS + 2));
    for c in 0..3 {
        let (a, s) = (f64::from(ABSORPTION[c]), f64::from(SCATTERING[c]));
        let left = |depth: f64| (-(a + s) * depth).exp();
        suite.judge(passed[c].p_equals(left(depth)), format_args!("what arrives in channel {c}"));
        let all: f64 = slices.iter().map(|(_, thickness, depth)| thickness * left(*depth)).sum();
        let glow = a * (c + 1) as f64 * all;
        suite.judge(emitted[c].p_equals(glow), format_args!("what glows in channel {c}"));
        for (i, means) in scattered.iter().enumerate() {
            let within = slices.iter().filter(|(t, ..)| part(*t) == i);
            let exact: f64 = within.map(|(_, thickness, depth)| s * thickness * left(*depth)).sum();
            suite.judge(means[c].p_equals(exact), format_args!("what scatters in part {i}, channel {c}"));
        }
    }
}

/// The places where grey light scatters, against their density.
#[test]
fn flights_end_as_often_as_they_should() {
    const DRAWS: u64 = 60_000;
    const CELLS: usize = 24;
    let variation = variation(2, SIZE);
    let (slices, depth) = slices(&variation);
    let (medium, field) = medium(Vec3::splat(0.4), Vec3::splat(0.9), variation);
    let cell = |t: f64| ((t / f64::from(way().length) * CELLS as f64) as usize).min(CELLS - 1);
    let mut expected = [0.0; CELLS + 1];
    for (t, thickness, depth) in slices {
        // Midpoints know where a slice is, and its ends how much of it scatters.
        let (from, to) = (depth - 0.5 * thickness, depth + 0.5 * thickness);
        expected[cell(t)] += DRAWS as f64 * ((-1.3 * from).exp() - (-1.3 * to).exp());
    }
    expected[CELLS] = DRAWS as f64 * (-1.3 * depth).exp();
    let mut rng = Rng::new(4);
    let mut observed = [0; CELLS + 1];
    for _ in 0..DRAWS {
        let mut flight = Flight::new(Vec3::ONE, rng.next_1d());
        let mut chance = Chance::new(rng.next_u64());
        let end = field.fly(&medium, &mut flight, &way(), &mut chance, |_| ());
        observed[end.map_or(CELLS, |end| cell(f64::from(end.distance)))] += 1;
    }
    Suite::new(1).judge(chi_square(&observed, &expected), "flights");
}

/// What next-event estimation gets, through media that scatter and through those that do not; and the number that
/// weights both strategies is the same for both.
#[test]
fn passages_let_through_what_they_should() {
    for (seed, scattering) in [(5, SCATTERING), (6, Vec3::ZERO)] {
        // Dense enough for coins to be tossed.
        let absorption = 2.0 * ABSORPTION;
        let variation = variation(seed, SIZE);
        let (_, depth) = slices(&variation);
        let (medium, field) = medium(absorption, scattering, variation);
        let mut rng = Rng::new(seed);
        let mut left = [Mean::default(); 3];
        let mut probability = None;
        for _ in 0..40_000 {
            let mut passage = Passage::new(Vec3::ONE);
            field.pass(&medium, &mut passage, &way(), &mut Chance::new(rng.next_u64()));
            (0..3).for_each(|c| left[c].push(f64::from(passage.transmittance()[c])));
            if passage.is_dark() {
                continue;
            }
            let first = *probability.get_or_insert(passage.probability());
            assert_eq!(passage.probability(), first, "it depends on the way alone");
        }
        let mut suite = Suite::new(3);
        for (c, mean) in left.iter().enumerate() {
            let exact = (-f64::from((absorption + scattering)[c]) * depth).exp();
            suite.judge(mean.p_equals(exact), format_args!("channel {c}"));
        }
        let mut flight = Flight::new(Vec3::ONE, 0.999_999);
        flight.depth = 1e9;
        let mut chance = Chance::new(1);
        if scattering == Vec3::ZERO && field.fly(&medium, &mut flight, &way(), &mut chance, |_| ()).is_none()
        {
            assert_eq!(Some(flight.passage.probability()), probability);
        }
    }
}

/// Ways that start inside, miss, graze, go along an axis, have no end or no length.
#[test]
fn marches_cover_what_lies_in_the_box() {
    let (_, field) = medium(ABSORPTION, SCATTERING, variation(7, SIZE));
    let length = |origin: Vec3, direction: Vec3, length: f32| {
        let way = Way { origin, direction: direction.normalize(), length };
        let Some(mut march) = March::new(&field, &way) else { return 0.0 };
        let (mut sum, mut last) = (0.0, None);
        while let Some((from, to, _)) = march.next(&field) {
            assert!(from <= to && last.is_none_or(|last| last == from), "{from} {to}");
            (sum, last) = (sum + to - from, Some(to));
        }
        sum
    };
    let close = |a: f32, b: f32| assert!((a - b).abs() < 1e-4, "{a} instead of {b}");
    close(length(Vec3::ZERO, Vec3::X, f32::INFINITY), 1.0);
    close(length(Vec3::ZERO, Vec3::NEG_Y, 0.3), 0.3);
    close(length(Vec3::new(-5.0, 0.5, 0.2), Vec3::X, f32::INFINITY), 2.0);
    close(length(Vec3::new(-5.0, 1.5, 0.2), Vec3::X, f32::INFINITY), 0.0);
    close(length(Vec3::splat(-3.0), Vec3::ONE, f32::INFINITY), 2.0 * 3.0_f32.sqrt());
    close(length(Vec3::splat(3.0), Vec3::ONE, f32::INFINITY), 0.0);
    close(length(Vec3::new(0.0, 0.0, -9.0), Vec3::Z, 8.5), 0.5);
    close(length(Vec3::ZERO, Vec3::Z, 0.0), 0.0);
    let mut rng = Rng::new(8);
    for _ in 0..2000 {
        let from = 4.0 * (Vec3::new(rng.next_1d(), rng.next_1d(), rng.next_1d()) - 0.5);
        let direction = rng.next_direction();
        // Where it enters and leaves, plane by plane.
        let (mut enters, mut leaves) = (0.0_f32, f32::INFINITY);
        for axis in 0..3 {
            let [a, b] = [-1.0, 1.0].map(|plane| (plane - from[axis]) / direction[axis]);
            (enters, leaves) = (enters.max(a.min(b)), leaves.min(a.max(b)));
        }
        close(length(from, direction, f32::INFINITY), (leaves - enters).max(0.0));
    }
}

/// No place is denser than its cell says, whatever the medium is made of.
#[test]
fn majorants_are_never_exceeded() {
    let colors = |seed: u64| {
        let mut rng = Rng::new(seed);
        let values = (0..7 * 5 * 6).map(|_| Vec3::new(rng.next_1d(), rng.next_1d(), rng.next_1d())).collect();
        Grid::dense([7, 5, 6], values)
    };
    let to_cloud = Affine3A::IDENTITY;
    let densities = [
        variation(9, [17, 1, 8]).density,
        Density::Colors { absorption: Some(colors(1)), scattering: None },
        Density::Colors { absorption: Some(colors(2)), scattering: Some(colors(3)) },
        Density::Cloud { density: 5.0, wispiness: 1.0, frequency: 4.0, to_cloud },
    ];
    let mut rng = Rng::new(10);
    for density in densities {
        let (medium, field) = medium(ABSORPTION, SCATTERING, Variation { density, ..variation(0, [1; 3]) });
        let [nx, ny, _] = field.size;
        for _ in 0..20_000 {
            let p = Vec3::new(rng.next_1d(), rng.next_1d(), rng.next_1d());
            let at: [u32; 3] = std::array::from_fn(|axis| (p[axis] * field.size[axis] as f32) as u32);
            let cell = field.cells[((at[2] * ny + at[1]) * nx + at[0]) as usize];
            let Local { absorption, scattering } = field.at(&medium, p);
            assert!((absorption + scattering).max_element() <= cell.majorant * 1.0001, "{p}");
            assert!(absorption.min_element() >= 0.0 && scattering.min_element() >= 0.0);
        }
    }
}

/// Colours of temperatures in between are mixed, hotter ones than the hottest are like it.
#[test]
fn hot_places_glow_in_the_colour_of_their_heat() {
    let colors: Arc<[Vec3]> = Arc::from([Vec3::ZERO, Vec3::X, Vec3::new(1.0, 2.0, 0.0)]);
    for (kelvin, expected) in [(0.0, Vec3::ZERO), (250.0, 0.5 * Vec3::X), (750.0, Vec3::new(1.0, 1.0, 0.0))] {
        let temperature = Grid::dense([2, 1, 1], vec![kelvin; 2]);
        let scale = Some(Grid::dense([1, 1, 1], vec![2.0]));
        let glow = Glow::Heat { temperature, scale, colors: Arc::clone(&colors), hottest: 1000.0 };
        let (_, field) =
            medium(ABSORPTION, SCATTERING, Variation { glow: Some(glow), ..variation(0, [1; 3]) });
        assert!((field.glow(Vec3::splat(0.5)) - 2.0 * expected).length() < 1e-5, "{kelvin}");
    }
}

/// A grid in bricks is the grid that has all its values, and majorants are the same.
#[test]
fn bricks_are_but_another_way_to_store_a_grid() {
    let size = [17, 9, 20];
    let mut rng = Rng::new(5);
    // Blocks 0, 3, 6, ... are empty, and blocks 1 and 2 share their brick.
    let blocks = size.map(|n: u32| n.div_ceil(8));
    let count = blocks.iter().product::<u32>();
    let brick = |block: u32| match block {
        _ if block.is_multiple_of(3) => Grid::<f32>::NOTHING,
        2 => 0,
        _ => block - 1 - (block - 1) / 3 - u32::from(block > 2),
    };
    let bricks: Vec<u32> = (0..count).map(brick).collect();
    let stored = bricks.iter().filter(|&&b| b != Grid::<f32>::NOTHING).max().expect("bricks") + 1;
    let mut values: Vec<f32> = (0..stored * 512).map(|_| rng.next_1d()).collect();
    values[512..1024].fill(0.25);
    let sparse = Grid { size, values, bricks: Some(bricks) };
    let all = (0..size[2]).flat_map(|z| (0..size[1]).flat_map(move |y| (0..size[0]).map(move |x| [x, y, z])));
    let dense = Grid::dense(size, all.map(|at| sparse.value(at)).collect());
    assert!(dense.values.contains(&0.0) && dense.value([8, 0, 0]) == dense.value([16, 0, 0]));
    for _ in 0..1000 {
        let p = Vec3::new(rng.next_1d(), rng.next_1d(), rng.next_1d());
        assert_eq!(sparse.at(p), dense.at(p));
    }
    let part = [[0.1, 0.4], [0.5, 0.8], [0.0, 0.3]];
    let uniform = sparse.uniform_bricks();
    let ((most, mean), (dense_most, dense_mean)) =
        (sparse.over(part, &uniform, 0.0, f32::max), dense.over(part, &[], 0.0, f32::max));
    // Sums in another order.
    assert!(most == dense_most && (mean - dense_mean).abs() < 1e-5, "{mean} and {dense_mean}");
}
