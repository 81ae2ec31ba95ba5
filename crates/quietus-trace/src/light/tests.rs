//! Every light sampler against its density, and the density of a chosen point against that of the same point hit.

mod picture;
mod surface;
mod tree;

use std::f32::consts::PI;
use std::sync::Arc;

use glam::{Affine3A, Mat3, Quat, Vec2, Vec3};

use super::distribution::{AliasTable, Cells};
use super::{Environment, PunctualLight, SphereLight, TriangleLight, luminance};
use crate::desc::{self, EnvironmentLayout, Image, SpotFalloff, Texels};
use crate::geometry::{sphere, triangle};
use crate::testing::{Mean, Rng, Suite, chi_square, chi_square_directions};

const SAMPLES: usize = 50_000;

/// p-value of "`sample` draws from `pdf`" where the density jumps at the light's outline, which quadrature does not
/// like: per cell of a grid of directions, how often the sampler came there against the density averaged over
/// independent uniform directions. The smallest p-value of all cells, after Sidak.
fn compare_with_density(
    seed: u64,
    mut sample: impl FnMut(&mut Rng) -> Option<Vec3>,
    pdf: impl Fn(Vec3) -> f32,
) -> f64 {
    const CELLS: [usize; 2] = [12, 24];
    // Fewer hits than this and the mean is not yet normal: such cells are pooled.
    const ENOUGH: u32 = 50;
    let cell = |w: Vec3| {
        let turn = (f64::from(w.y.atan2(w.x)) / std::f64::consts::TAU).rem_euclid(1.0);
        let row = (f64::from(0.5 - 0.5 * w.z) * CELLS[0] as f64) as usize;
        row.min(CELLS[0] - 1) * CELLS[1] + ((turn * CELLS[1] as f64) as usize).min(CELLS[1] - 1)
    };
    let mut rng = Rng::new(seed);
    let drawn: Vec<usize> = (0..SAMPLES).filter_map(|_| sample(&mut rng)).map(cell).collect();
    let uniform: Vec<(usize, f64)> = (0..4 * SAMPLES)
        .map(|_| rng.next_direction())
        .map(|w| (cell(w), 4.0 * std::f64::consts::PI * f64::from(pdf(w))))
        .filter(|&(_, value)| value > 0.0)
        .collect();
    let mut counts = vec![[0u32; 2]; CELLS[0] * CELLS[1]];
    drawn.iter().for_each(|&cell| counts[cell][0] += 1);
    uniform.iter().for_each(|&(cell, _)| counts[cell][1] += 1);
    let pool = counts.len();
    let label = |cell: usize| if counts[cell].iter().all(|&n| n >= ENOUGH) { cell } else { pool };
    let mut means = vec![[(0usize, 0.0, 0.0); 2]; pool + 1];
    let mut push = |cell: usize, side: usize, value: f64| {
        let (n, sum, squares) = &mut means[label(cell)][side];
        (*n, *sum, *squares) = (*n + 1, *sum + value, *squares + value * value);
    };
    drawn.iter().for_each(|&cell| push(cell, 0, 1.0));
    uniform.iter().for_each(|&(cell, value)| push(cell, 1, value));
    let moments = |&(_, sum, squares): &(usize, f64, f64), total: usize| Mean::from_sums(total, sum, squares);
    let tested: Vec<f64> = means
        .iter()
        .filter(|sides| sides.iter().all(|side| side.0 >= ENOUGH as usize))
        .map(|[a, b]| moments(a, SAMPLES).p_same(&moments(b, 4 * SAMPLES)))
        .collect();
    assert!(!tested.is_empty(), "the grid is too fine or the samples too few");
    let smallest = tested.iter().copied().fold(1.0, f64::min);
    1.0 - (1.0 - smallest).powi(tested.len() as i32)
}

#[test]
fn triangles_are_sampled_with_their_density() {
    let corners = [Vec3::new(-0.3, 1.0, 0.2), Vec3::new(1.4, 0.8, -0.1), Vec3::new(0.1, 1.1, 1.7)];
    let mirror = Affine3A::from_scale(Vec3::new(-1.0, 0.7, 1.3));
    let mut suite = Suite::new(4);
    for (seed, transform) in [Affine3A::IDENTITY, mirror].into_iter().enumerate() {
        let light = TriangleLight::new(corners, &transform, false);
        let placed = corners.map(|p| transform.transform_point3(p));
        for from in [Vec3::ZERO, Vec3::new(0.2, 2.0, -0.4)] {
            let p = compare_with_density(
                seed as u64,
                |rng| light.sample(from, rng.next_2d()).map(|(sample, _)| sample.direction),
                |w| {
                    triangle::intersect(from, &triangle::Sheared::new(w), placed)
                        .filter(|hit| hit.0 > 0.0)
                        .map_or(0.0, |(t, ..)| light.pdf(w, t))
                },
            );
            suite.judge(p, format_args!("triangle under {transform} seen from {from}"));
        }
    }
}

/// Spheres of several apparent sizes, an ellipsoid, and points inside.
#[test]
fn spheres_are_sampled_with_their_density() {
    let (center, radius) = (Vec3::new(0.4, -0.2, 0.3), 0.8);
    let turned = Quat::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -0.4);
    let ellipsoid = Affine3A::from_scale_rotation_translation(Vec3::new(0.5, -1.5, 2.0), turned, Vec3::Y);
    let mut suite = Suite::new(8);
    for (seed, transform) in [Affine3A::IDENTITY, ellipsoid].into_iter().enumerate() {
        let light = SphereLight::new(center, radius, transform, false);
        let inverse = transform.inverse();
        let place = |object: Vec3| transform.transform_point3(object);
        for offset in [0.5, 1.1, 3.0, 0.0] {
            let from = place(center + Vec3::new(0.48, 0.6, 0.64) * radius * offset);
            let hits = |w: Vec3| {
                let (o, d) = (inverse.transform_point3(from), inverse.transform_vector3(w));
                sphere::intersect(o, d, (0.0, f32::INFINITY), center, radius).is_some()
            };
            let p = compare_with_density(
                seed as u64,
                |rng| light.sample(from, rng.next_2d()).map(|sample| sample.direction),
                |w| if hits(w) { light.pdf(from, w) } else { 0.0 },
            );
            suite.judge(p, format_args!("sphere under {transform} seen from {offset} radii"));
        }
    }
}

/// What the sample says about itself is what a ray in its direction finds.
#[test]
fn sphere_samples_lie_where_rays_hit() {
    let (center, radius, from) = (Vec3::new(4.0, -2.0, 3.0), 0.5, Vec3::new(1.0, 1.0, 1.0));
    let light = SphereLight::new(center, radius, Affine3A::IDENTITY, false);
    let mut rng = Rng::new(7);
    for _ in 0..1000 {
        let sample = light.sample(from, rng.next_2d()).expect("outside points see the sphere");
        let t = sphere::intersect(from, sample.direction, (0.0, f32::INFINITY), center, radius);
        // At the silhouette a ray in the rounded direction may miss; the point must lie beside it all the same.
        let along = t.unwrap_or_else(|| (center - from).dot(sample.direction));
        let distance = (from + along * sample.direction).distance(sample.target.position);
        let grazing = sample.target.normal.dot(sample.direction).abs().max(1e-3);
        assert!(distance * grazing < 1e-5, "{distance} at cosine {grazing}");
        let same = light.pdf(from, sample.direction);
        assert!((sample.pdf - same).abs() <= 1e-5 * same, "{} against {same}", sample.pdf);
    }
}

fn sunny_map(layout: EnvironmentLayout) -> desc::Environment {
    let mut rng = Rng::new(3);
    let (width, height) = match layout {
        EnvironmentLayout::LatLong => (16, 8),
        EnvironmentLayout::EqualArea => (16, 16),
    };
    let mut texels: Vec<[f32; 4]> =
        (0..width * height).map(|_| [0; 4].map(|_| rng.next_1d() * rng.next_1d())).collect();
    // A sun, one at the seam, and darkness from pole to pole.
    texels[2 * width + 5] = [40.0, 30.0, 20.0, 1.0];
    texels[4 * width + 15] = [10.0, 20.0, 30.0, 1.0];
    for row in 0..height {
        for column in 8..13 {
            texels[row * width + column] = [0.0; 4];
        }
    }
    let image = Image {
        name: "sunny".into(),
        width: width as u32,
        height: height as u32,
        texels: Texels::Float(texels),
    };
    let to_world = Mat3::from_quat(Quat::from_euler(glam::EulerRot::XYZ, 0.7, -0.3, 1.9));
    desc::Environment { layout, image: Some(Arc::new(image)), scale: Vec3::ONE, to_world, portal: None }
}

/// Seen from the origin, from -1 to 2 and -0.5 to 1.5 along its edges at 1.5 ahead.
fn with_portal(environment: desc::Environment) -> desc::Environment {
    let turn = Mat3::from_quat(Quat::from_euler(glam::EulerRot::XYZ, -0.4, 1.1, 0.6));
    let edges = [turn * Vec3::new(3.0, 0.0, 0.0), turn * Vec3::new(0.0, 2.0, 0.0)];
    let portal = desc::Portal { corner: turn * Vec3::new(-1.0, -0.5, 1.5), edges };
    desc::Environment { portal: Some(portal), ..environment }
}

#[test]
fn environments_are_sampled_with_their_density() {
    let constant = desc::Environment {
        layout: EnvironmentLayout::LatLong,
        image: None,
        scale: Vec3::ONE,
        to_world: Mat3::IDENTITY,
        portal: None,
    };
    let environments = [
        ("lat-long map", sunny_map(EnvironmentLayout::LatLong)),
        ("equal-area map", sunny_map(EnvironmentLayout::EqualArea)),
        ("constant behind a portal", with_portal(constant)),
        ("map behind a portal", with_portal(sunny_map(EnvironmentLayout::LatLong))),
    ];
    let mut suite = Suite::new(environments.len());
    for (name, environment) in environments {
        let environment = Environment::new(&environment);
        let p = chi_square_directions(
            11,
            SAMPLES,
            |rng| environment.sample(Vec3::ZERO, rng.next_2d()).map(|sample| sample.direction),
            |w| environment.radiance_pdf(Vec3::ZERO, w).1,
        );
        suite.judge(p, name);
    }
}

/// Light through a portal is all that rays which go through its rectangle find, and nothing else: from before it, beside
/// it and behind it.
#[test]
fn portals_let_in_what_lies_behind_them() {
    let open = sunny_map(EnvironmentLayout::EqualArea);
    let closed = with_portal(open.clone());
    let desc::Portal { corner, edges } = closed.portal.expect("a portal");
    let [open, closed] = [open, closed].map(|environment| Environment::new(&environment));
    let ahead = edges[0].cross(edges[1]).normalize();
    let through = |from: Vec3, direction: Vec3| {
        let t = (corner - from).dot(ahead) / direction.dot(ahead);
        let at = from + t * direction - corner;
        let part = |edge: Vec3| (0.0..=1.0).contains(&(at.dot(edge) / edge.length_squared()));
        direction.dot(ahead) > 0.0 && t > 0.0 && edges.into_iter().all(part)
    };
    let places = [Vec3::ZERO, corner - 0.2 * ahead - 2.0 * edges[0], corner + 0.5 * edges[0] - 9.0 * ahead];
    let mut suite = Suite::new(places.len());
    for from in places {
        let (mut all, mut drawn) = (Mean::default(), Mean::default());
        let mut rng = Rng::new(17);
        for _ in 0..200_000 {
            let w = rng.next_direction();
            let radiance = if through(from, w) { open.radiance(from, w) } else { Vec3::ZERO };
            assert_eq!(closed.radiance(from, w), radiance, "{from} {w}");
            all.push(f64::from(luminance(radiance) * 4.0 * PI));
            let sample = closed.sample(from, rng.next_2d());
            drawn.push(sample.map_or(0.0, |sample| f64::from(luminance(sample.radiance) / sample.pdf)));
        }
        suite.judge(all.p_same(&drawn), format!("from {from}"));
    }
    assert!(closed.sample(corner + edges[0] + ahead, Vec2::splat(0.5)).is_none(), "behind it");
}

/// Where the map is brighter than on average it must be found, and the sample must say how bright.
#[test]
fn environment_density_covers_its_light() {
    let maps = [EnvironmentLayout::LatLong, EnvironmentLayout::EqualArea].map(sunny_map);
    let portal = with_portal(maps[1].clone());
    for environment in maps.into_iter().chain([portal]) {
        let (environment, from) = (Environment::new(&environment), Vec3::new(0.1, 0.2, -0.3));
        let mut rng = Rng::new(5);
        let directions: Vec<_> = (0..20_000).map(|_| rng.next_direction()).collect();
        let bright = |w: Vec3| luminance(environment.radiance(from, w));
        let mean = directions.iter().map(|&w| bright(w)).sum::<f32>() / directions.len() as f32;
        for w in directions {
            let pdf = environment.radiance_pdf(from, w).1;
            // The mean is known to some percent, from a map that is dark but for two suns.
            assert!(pdf > 0.0 || bright(w) < 1.3 * mean, "{w}");
            let Some(sample) = environment.sample(from, rng.next_2d()) else { continue };
            let radiance = environment.radiance(from, sample.direction);
            // The direction went through a rotation and back: interpolation between a dark texel and the sun.
            assert!((sample.radiance - radiance).abs().max_element() <= 1e-3 * 40.0, "{radiance}");
        }
    }
}

/// What is the same everywhere is left to paths that find it by chance, as a map and without one.
#[test]
fn even_environments_are_not_asked() {
    let grey = [0.3, 0.7, 0.1, 1.0];
    for layout in [EnvironmentLayout::LatLong, EnvironmentLayout::EqualArea] {
        let texels = Texels::Float(vec![grey; 16 * 16]);
        let image = Image { name: "grey".into(), width: 16, height: 16, texels };
        for image in [None, Some(Arc::new(image))] {
            let sky = desc::Environment {
                layout,
                image,
                scale: Vec3::splat(0.9),
                to_world: Mat3::IDENTITY,
                portal: None,
            };
            let sky = Environment::new(&sky);
            assert_eq!(sky.mean_irradiance(), 0.0);
            assert!(sky.sample(Vec3::ZERO, Vec2::splat(0.5)).is_none());
            assert_eq!(sky.radiance_pdf(Vec3::ZERO, Vec3::X).1, 0.0);
        }
    }
}

/// Row 0 is up, the middle column is -z, columns run towards +x, as the description promises.
#[test]
fn environment_maps_are_laid_out_as_described() {
    let texel = |value: f32| [value, 0.0, 0.0, 1.0];
    let texels = (0..8 * 4).map(|i| texel(i as f32)).collect();
    let image = Image { name: "grid".into(), width: 8, height: 4, texels: Texels::Float(texels) };
    let environment = Environment::new(&desc::Environment {
        layout: EnvironmentLayout::LatLong,
        image: Some(Arc::new(image)),
        scale: Vec3::ONE,
        to_world: Mat3::IDENTITY,
        portal: None,
    });
    let red = |x: f32, y: f32, z: f32| environment.radiance(Vec3::ZERO, Vec3::new(x, y, z).normalize()).x;
    assert!((red(0.0, 1.0, -1e-4) - 3.5).abs() < 0.1, "the top row between its middle columns");
    assert!((red(0.0, 0.0, -1.0) - 15.5).abs() < 1e-3, "between columns 3 and 4, rows 1 and 2");
    assert!((red(1.0, 0.0, 0.0) - 17.5).abs() < 1e-3, "between columns 5 and 6");
    assert!((red(-1.0, 0.0, 0.0) - 13.5).abs() < 1e-3, "between columns 1 and 2");
}

/// The middle of the square is +z, its corners are -z, its edges' middles +-x and +-y; what runs out of an edge comes
/// back mirrored at the edge's middle: the look-up has no seams.
#[test]
fn equal_area_maps_are_laid_out_as_described() {
    let size = 8;
    let map = |value: &dyn Fn(u32, u32) -> f32| {
        let texels = (0..size * size).map(|i| [value(i % size, i / size), 0.0, 0.0, 1.0]).collect();
        let image = Image { name: "grid".into(), width: size, height: size, texels: Texels::Float(texels) };
        Environment::new(&desc::Environment {
            layout: EnvironmentLayout::EqualArea,
            image: Some(Arc::new(image)),
            scale: Vec3::ONE,
            to_world: Mat3::IDENTITY,
            portal: None,
        })
    };
    let (columns, rows) = (map(&|x, _| x as f32), map(&|_, y| y as f32));
    let place = |w: Vec3| [columns.radiance(Vec3::ZERO, w).x, rows.radiance(Vec3::ZERO, w).x];
    let close = |w: Vec3, expected: [f32; 2]| {
        let found = place(w);
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-3), "{w}: {found:?}");
    };
    close(Vec3::Z, [3.5, 3.5]);
    close(Vec3::X, [7.0, 3.5]);
    close(Vec3::NEG_X, [0.0, 3.5]);
    close(Vec3::Y, [3.5, 7.0]);
    close(Vec3::NEG_Y, [3.5, 0.0]);
    // Equal areas: a quarter of the square's width from its middle lies as far down as a quarter of its area says.
    let z = 1.0 - 0.25;
    close(Vec3::new(f32::sqrt(1.0 - z * z), 0.0, z), [5.5, 3.5]);
    let noise = {
        let mut rng = Rng::new(8);
        let texels: Vec<f32> = (0..size * size).map(|_| rng.next_1d()).collect();
        map(&move |x, y| texels[(y * size + x) as usize])
    };
    let mut rng = Rng::new(9);
    for _ in 0..2000 {
        let w = (rng.next_direction() - Vec3::Z).normalize();
        let aside = (w + 1e-5 * rng.next_direction()).normalize();
        let step = (noise.radiance(Vec3::ZERO, w).x - noise.radiance(Vec3::ZERO, aside).x).abs();
        assert!(step < 1e-2, "{w} to {aside}: {step}");
    }
}

#[test]
fn tables_draw_in_proportion_to_their_weights() {
    let mut suite = Suite::new(2);
    let weights = [0.0, 3.0, 1e-3, 0.0, 7.5, 1.0, 0.25, 0.0];
    let total: f64 = weights.iter().sum();
    let table = AliasTable::new(&weights);
    let mut rng = Rng::new(1);
    let mut observed = [0u64; 8];
    for _ in 0..SAMPLES {
        let (index, probability) = table.sample(rng.next_1d()).expect("not empty");
        observed[index as usize] += 1;
        assert_eq!(probability, table.probability(index));
    }
    let expected = weights.map(|w| w / total * SAMPLES as f64);
    suite.judge(chi_square(&observed, &expected), "alias table");
    assert_eq!(AliasTable::new(&[0.0; 3]).sample(0.5), None);

    let weights: Vec<f32> = (0..35).map(|i| if i % 4 == 1 { 0.0 } else { (i % 7) as f32 }).collect();
    let total: f64 = weights.iter().map(|&w| f64::from(w)).sum();
    let cells = Cells::new(7, &weights).expect("not black");
    let mut observed = [0u64; 35];
    for _ in 0..SAMPLES {
        let ([column, row], _) = cells.sample(rng.next_2d());
        observed[row * 7 + column] += 1;
    }
    let expected: Vec<f64> = weights.iter().map(|&w| f64::from(w) / total * SAMPLES as f64).collect();
    suite.judge(chi_square(&observed, &expected), "cells");
    assert!(Cells::new(2, &[0.0; 4]).is_none());
}

/// The fade of pbrt-v4 is half done half-way, and the power that goes with it is right.
#[test]
fn spots_may_fade_smoothly() {
    let light = PunctualLight::new(&desc::Light::Spot {
        position: Vec3::ZERO,
        direction: Vec3::Z,
        intensity: Vec3::ONE,
        inner_angle: 0.4,
        outer_angle: 0.9,
        falloff: SpotFalloff::Smooth,
    });
    let at = |cosine: f32| {
        let from = 2.0 * Vec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
        light.sample(from).map_or(0.0, |sample| sample.radiance.x * 4.0)
    };
    let [inner, outer] = [0.4_f32.cos(), 0.9_f32.cos()];
    assert!((at(0.5 * (inner + outer)) - 0.5).abs() < 1e-5);
    assert!((at(outer + 0.25 * (inner - outer)) - 0.15625).abs() < 1e-5, "t^2 (3 - 2 t) at a quarter");
    let steps = 20_000;
    let mean =
        (0..steps).map(|i| f64::from(at((i as f32 + 0.5) / steps as f32))).sum::<f64>() / f64::from(steps);
    let power = std::f64::consts::TAU * mean;
    assert!((f64::from(light.power()) - power).abs() < 1e-3 * power, "{} against {power}", light.power());
}

/// A spot's edges, and the power that weighs it against other lights, by quadrature over its cone.
#[test]
fn spots_fade_between_their_angles() {
    let (inner_angle, outer_angle) = (0.4_f32, 0.9_f32);
    let light = PunctualLight::new(&desc::Light::Spot {
        position: Vec3::ZERO,
        direction: Vec3::Z,
        intensity: Vec3::ONE,
        inner_angle,
        outer_angle,
        falloff: SpotFalloff::Square,
    });
    let at = |angle: f32| {
        let from = 2.0 * Vec3::new(angle.sin(), 0.0, angle.cos());
        light.sample(from).map_or(0.0, |sample| sample.radiance.x * 4.0)
    };
    assert_eq!((at(0.0), at(0.99 * inner_angle), at(1.01 * outer_angle)), (1.0, 1.0, 0.0));
    let steps = 20_000;
    let width = std::f64::consts::PI / f64::from(steps);
    let power: f64 = (0..steps)
        .map(|i| (f64::from(i) + 0.5) * width)
        .map(|angle| f64::from(at(angle as f32)) * angle.sin() * std::f64::consts::TAU * width)
        .sum();
    assert!((f64::from(light.power()) - power).abs() < 1e-3 * power, "{} against {power}", light.power());
    assert!(light.sample(Vec2::ZERO.extend(0.0)).is_none(), "nothing at the light itself");
}
