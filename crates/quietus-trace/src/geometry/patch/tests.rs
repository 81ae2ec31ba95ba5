//! Whatever lies on a patch is met, and what is met lies on it.

use super::*;
use crate::geometry::offset_ray_origin;
use crate::testing::Rng;

const ALL: (f32, f32) = (0.0, f32::MAX);

fn vector(rng: &mut Rng) -> Vec3 {
    2.0 * Vec3::new(rng.next_1d(), rng.next_1d(), rng.next_1d()) - 1.0
}

/// Flat parallelograms, triangles and twisted ones.
fn corners(rng: &mut Rng, kind: usize) -> Corners {
    let [a, b, c, d] = [0; 4].map(|_| vector(rng));
    match kind % 4 {
        0 => [a, b, c, b + c - a],
        1 => [a, b, c, c],
        2 => [a, b, c, b + c - a + 0.1 * d],
        _ => [a, b, c, d],
    }
}

#[test]
fn patches_are_met_where_they_are() {
    let mut rng = Rng::new(41);
    let mut missed = 0;
    for i in 0..40_000 {
        let corners = corners(&mut rng, i);
        let (u, v) = (rng.next_1d(), rng.next_1d());
        let target = blend(corners, u, v);
        let origin = 3.0 * rng.next_direction();
        let direction = (target - origin) * 2.0;
        let Some((t, u, v)) = intersect(origin, direction, ALL, &corners) else {
            // The target is rounded: seen edge-on it may lie beside the patch.
            let cosine = normal(&corners, u, v).dot(direction.normalize()).abs();
            let edge = u.min(v).min(1.0 - u).min(1.0 - v);
            assert!(cosine < 1e-2 || edge < 1e-4, "{corners:?} {origin} {u} {v} {cosine}");
            missed += 1;
            continue;
        };
        let cosine = normal(&corners, u, v).dot(direction.normalize()).abs();
        // Nothing is met behind the point that is known to be there.
        assert!(t <= 0.5 + 1e-5 / cosine.max(1e-4), "{corners:?} {origin} {t}");
        let off = (blend(corners, u, v) - (origin + t * direction)).length();
        // A small step of t or of the parameters, in f32.
        assert!(off < 1e-5, "{corners:?} {origin} {off}");
        assert_eq!(intersect(origin, direction, (t, f32::MAX), &corners).filter(|hit| hit.0 <= t), None);
    }
    assert!(missed < 100, "{missed}");
}

/// The same picture as of its halves where it is flat.
#[test]
fn flat_patches_are_two_triangles() {
    use crate::geometry::triangle;
    let mut rng = Rng::new(42);
    let mut hits = 0;
    for _ in 0..20_000 {
        let [a, b, c, d] = corners(&mut rng, 0);
        let origin = 3.0 * rng.next_direction();
        let direction = vector(&mut rng) - origin;
        let sheared = triangle::Sheared::new(direction);
        let halves = [[a, b, d], [a, d, c]].map(|half| triangle::intersect(origin, &sheared, half));
        let expected = halves.into_iter().flatten().map(|hit| hit.0).find(|&t| t > 0.0);
        let found = intersect(origin, direction, ALL, &[a, b, c, d]);
        let normal = (b - a).cross(c - a);
        if normal.length() < 1e-2 || normal.normalize().dot(direction.normalize()).abs() < 1e-2 {
            continue;
        }
        let edge = found.is_some_and(|(_, u, v)| u.min(v).min(1.0 - u).min(1.0 - v) < 1e-4);
        assert!(
            found.is_some() == expected.is_some() || edge || expected.is_some(),
            "{found:?} {expected:?}"
        );
        if let (Some(found), Some(expected)) = (found, expected) {
            assert!((found.0 - expected).abs() < 1e-4, "{found:?} {expected}");
            hits += 1;
        }
    }
    assert!(hits > 1000, "{hits}");
}

#[test]
fn derivatives_are_differences() {
    let mut rng = Rng::new(43);
    for i in 0..1000 {
        let corners = corners(&mut rng, i);
        let (u, v, h) = (rng.next_1d(), rng.next_1d(), 1e-2);
        // Linear along each parameter: differences are exact but for rounding.
        let by_u = (blend(corners, u + h, v) - blend(corners, u - h, v)) / (2.0 * h);
        let by_v = (blend(corners, u, v + h) - blend(corners, u, v - h)) / (2.0 * h);
        let [along_u, along_v] = derivatives(&corners, u, v);
        assert!((by_u - along_u).length() < 1e-4 && (by_v - along_v).length() < 1e-4);
        let normal = normal(&corners, u, v);
        assert!(normal.dot(along_u).abs() < 1e-4 && normal.dot(along_u.cross(along_v)) >= 0.0);
    }
}

#[test]
fn offset_rays_leave_their_patch() {
    let mut rng = Rng::new(44);
    for i in 0..60_000 {
        let center = [0.0, 30.0, 1000.0][i % 3] * rng.next_direction();
        let corners = corners(&mut rng, i / 3).map(|p| p + center);
        let (u, v) = (rng.next_1d(), rng.next_1d());
        let normal = normal(&corners, u, v);
        let [along_u, along_v] = derivatives(&corners, u, v);
        // Slivers have no reliable normal, and folds turn it around within no distance.
        if along_u.cross(along_v).length() < 0.1 {
            continue;
        }
        let w = rng.next_direction();
        // At such a grazing angle a twisted patch may well be met again nearby.
        if i / 3 % 4 > 1 && w.dot(normal).abs() < 1e-2 {
            continue;
        }
        let origin = offset_ray_origin(blend(corners, u, v), point_error(&corners), normal, w);
        // A twisted patch may be met again, further on.
        let again = intersect(origin, w, ALL, &corners);
        assert!(
            again.is_none_or(|(t, ..)| t > 1e-2 || i / 3 % 4 > 1 && t > 1e-4),
            "{corners:?} {origin} {w} {again:?}"
        );
    }
}

#[test]
fn broken_patches_do_no_harm() {
    let (nan, inf) = (Vec3::NAN, Vec3::INFINITY);
    for corners in
        [[nan; 4], [Vec3::ZERO, Vec3::X, Vec3::Y, inf], [Vec3::ZERO; 4], [Vec3::X, Vec3::X, Vec3::Y, Vec3::Y]]
    {
        for direction in [Vec3::X, Vec3::Z, Vec3::ONE, nan] {
            let hit = intersect(Vec3::ZERO, direction, ALL, &corners);
            assert!(hit.is_none_or(|(t, u, v)| t.is_finite() && u.is_finite() && v.is_finite()));
        }
    }
}
