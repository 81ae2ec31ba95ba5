//! The kernel against the school's quadratic formula, and the parametrisation of pbrt-v4.

use std::f32::consts::TAU as TAU_32;

use super::*;
use crate::geometry::offset_ray_origin;
use crate::testing::Rng;

const ALL: (f32, f32) = (0.0, f32::MAX);

fn some_quadric(rng: &mut Rng, kind: usize) -> Quadric {
    let radius = 0.3 + rng.next_1d();
    let z_min = radius * (-1.2 + 0.8 * rng.next_1d()).max(-1.0);
    let z_max = (z_min + radius * (0.2 + rng.next_1d())).min(radius);
    let phi_max = if kind.is_multiple_of(2) { TAU_32 } else { 0.2 + 6.0 * rng.next_1d() };
    match kind % 3 {
        0 => Quadric::PartialSphere { radius, z_min, z_max, phi_max },
        1 => Quadric::Disk { height: z_min, radius, inner_radius: (radius - 0.8).max(0.0), phi_max },
        _ => Quadric::Cylinder { radius, z_min, z_max, phi_max },
    }
}

/// The point with texture coordinates (u, v), after pbrt-v4.
fn at(quadric: &Quadric, u: f64, v: f64) -> DVec3 {
    let phi = u * f64::from(phi_max(quadric));
    let ring = |across: f64, z: f64| DVec3::new(across * phi.cos(), across * phi.sin(), z);
    let lerp = |a: f64, b: f64| a + (b - a) * v;
    match *quadric {
        Quadric::PartialSphere { radius, z_min, z_max, .. } => {
            let polar = |z: f32| (f64::from(z) / f64::from(radius)).clamp(-1.0, 1.0).acos();
            let theta = lerp(polar(z_min), polar(z_max));
            ring(f64::from(radius) * theta.sin(), f64::from(radius) * theta.cos())
        }
        Quadric::Disk { height, radius, inner_radius, .. } => {
            ring(lerp(radius.into(), inner_radius.into()), height.into())
        }
        Quadric::Cylinder { radius, z_min, z_max, .. } => {
            ring(radius.into(), lerp(z_min.into(), z_max.into()))
        }
    }
}

fn somewhere(quadric: &Quadric, rng: &mut Rng) -> Point {
    let uv = rng.next_2d().as_dvec2();
    point(quadric, at(quadric, uv.x, uv.y).as_vec3())
}

/// How far inside of the part's borders a point of its surface lies; negative outside.
fn inside(quadric: &Quadric, p: DVec3) -> f64 {
    let phi_max = f64::from(phi_max(quadric));
    let phi = angle(p);
    let swept = if phi_max > TAU - 1e-5 { f64::INFINITY } else { phi.min(phi_max - phi) };
    let between = |x: f64, low: f32, high: f32| (x - f64::from(low)).min(f64::from(high) - x);
    swept.min(match *quadric {
        Quadric::PartialSphere { z_min, z_max, radius, .. } => {
            let low = if z_min <= -radius { f32::NEG_INFINITY } else { z_min };
            between(p.z, low, if z_max >= radius { f32::INFINITY } else { z_max })
        }
        Quadric::Disk { radius, inner_radius, .. } => {
            between(p.truncate().length(), if inner_radius == 0.0 { -1.0 } else { inner_radius }, radius)
        }
        Quadric::Cylinder { z_min, z_max, .. } => between(p.z, z_min, z_max),
    })
}

/// Both intersections with the whole surface by the formula of school.
fn school(quadric: &Quadric, o: DVec3, d: DVec3) -> Vec<f64> {
    let solve = |a: f64, b: f64, c: f64| {
        let root = (b * b - 4.0 * a * c).sqrt();
        let mut found: Vec<f64> = [(-b - root) / (2.0 * a), (-b + root) / (2.0 * a)]
            .into_iter()
            .filter(|t| t.is_finite())
            .collect();
        found.sort_by(f64::total_cmp);
        found
    };
    match *quadric {
        Quadric::Disk { height, .. } => vec![(f64::from(height) - o.z) / d.z],
        Quadric::PartialSphere { radius, .. } => {
            solve(d.dot(d), 2.0 * o.dot(d), o.dot(o) - f64::from(radius * radius))
        }
        Quadric::Cylinder { radius, .. } => {
            let (o, d) = (o.truncate(), d.truncate());
            solve(d.dot(d), 2.0 * o.dot(d), o.dot(o) - f64::from(radius * radius))
        }
    }
}

#[test]
fn quadrics_are_met_where_the_formula_says() {
    let mut rng = Rng::new(51);
    let (mut hits, mut misses) = (0, 0);
    for i in 0..60_000 {
        let quadric = some_quadric(&mut rng, i);
        let origin = 2.0 * rng.next_direction() * rng.next_1d();
        let target = somewhere(&quadric, &mut rng).position + 0.5 * rng.next_direction();
        let direction = (target - origin) * (0.1 + rng.next_1d());
        let (o, d) = (origin.as_dvec3(), direction.as_dvec3());
        let met = school(&quadric, o, d);
        // So near to a border or to the origin that roundings decide.
        if met.iter().any(|&t| t.abs() < 1e-5 || inside(&quadric, o + t * d).abs() < 1e-5) {
            continue;
        }
        let expected = met.into_iter().find(|&t| t > 0.0 && inside(&quadric, o + t * d) > 0.0);
        let found = intersect(origin, direction, ALL, &quadric);
        assert_eq!(found.is_some(), expected.is_some(), "{quadric:?} {origin} {direction}");
        if let (Some(found), Some(expected)) = (found, expected) {
            assert!((f64::from(found) - expected).abs() < 1e-6 * (1.0 + expected), "{found} {expected}");
            hits += 1;
        } else {
            misses += 1;
        }
    }
    assert!(hits > 10_000 && misses > 10_000, "{hits} hits, {misses} misses");
}

#[test]
fn points_know_their_coordinates_and_directions() {
    let mut rng = Rng::new(52);
    for i in 0..3000 {
        let quadric = some_quadric(&mut rng, i);
        let [u, v] = [0; 2].map(|_| 0.01 + 0.98 * f64::from(rng.next_1d()));
        let p = at(&quadric, u, v);
        let found = point(&quadric, (p * 1.0001).as_vec3());
        let found =
            if matches!(quadric, Quadric::Cylinder { .. }) { point(&quadric, p.as_vec3()) } else { found };
        assert!((found.position.as_dvec3() - p).length() < 1e-3);
        let exact = point(&quadric, p.as_vec3());
        let off = (exact.position.as_dvec3() - p).abs().as_vec3();
        assert!(off.cmple(exact.error + 1e-6).all(), "{quadric:?}: off by {off}");
        let uv = exact.uv.as_dvec2();
        assert!((uv.x - u).abs() < 1e-5 && (uv.y - v).abs() < 1e-3, "{quadric:?}: {uv} instead of {u} {v}");
        let h = 1e-5;
        let by_u = (at(&quadric, u + h, v) - at(&quadric, u - h, v)) / (2.0 * h);
        let by_v = (at(&quadric, u, v + h) - at(&quadric, u, v - h)) / (2.0 * h);
        assert!((exact.along_u.as_dvec3() - by_u).length() < 1e-4 * (1.0 + by_u.length()));
        let normal = by_u.cross(by_v).normalize();
        assert!(exact.normal.as_dvec3().dot(normal) > 1.0 - 1e-5, "{quadric:?} {exact:?} {normal}");
        let bounds = bounds(&quadric);
        assert!(exact.position.cmpge(bounds.min).all() && exact.position.cmple(bounds.max).all());
    }
}

#[test]
fn offset_rays_leave_their_quadric() {
    let mut rng = Rng::new(54);
    for i in 0..60_000 {
        let quadric = some_quadric(&mut rng, i);
        let p = somewhere(&quadric, &mut rng);
        let w = rng.next_direction();
        // Half of them grazing.
        let w = if i % 2 == 0 { w } else { (w - (1.0 - 1e-4) * w.dot(p.normal) * p.normal).normalize() };
        let origin = offset_ray_origin(p.position, p.error, p.normal, w);
        let again = intersect(origin, w, ALL, &quadric);
        if w.dot(p.normal) > 0.0 || matches!(quadric, Quadric::Disk { .. }) {
            assert_eq!(again, None, "{quadric:?} {origin} {w}");
        } else {
            // Across the inside, as far as the chord is long.
            let chord = -2.0 * w.dot(p.normal) * radius(&quadric);
            assert!(again.is_none_or(|t| t > 0.9 * chord), "{quadric:?} {origin} {w}: {again:?}");
        }
    }
}
