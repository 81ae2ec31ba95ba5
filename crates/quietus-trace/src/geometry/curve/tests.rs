//! The kernel against the plainest of searches in double precision.

use glam::{DVec2, Quat};

use super::*;
use crate::isa::{Job, Level};
use crate::testing::Rng;

fn signed(rng: &mut Rng) -> f32 {
    2.0 * rng.next_1d() - 1.0
}

fn vector(rng: &mut Rng) -> Vec3 {
    Vec3::new(signed(rng), signed(rng), signed(rng))
}

/// From nearly straight to knotted.
fn segment(rng: &mut Rng, knotted: f32) -> CurveSegment {
    let [start, end] = [vector(rng), vector(rng)];
    let mut between = |t| start.lerp(end, t) + knotted * vector(rng);
    let points = [start, between(1.0 / 3.0), between(2.0 / 3.0), end];
    let widths = [0.02 + 0.1 * rng.next_1d(), 0.1 * rng.next_1d()];
    CurveSegment { points, widths, u_range: [0.0, 1.0], normals: [Vec3::X; 2] }
}

/// The nearest of what all parts find, at both levels.
fn kernel(segment: &CurveSegment, parts: u32, ray: &CurveRay) -> Option<(f32, f32, f32)> {
    struct Ask<'a>(&'a CurvePart, &'a CurveRay);
    impl Job for Ask<'_> {
        type Output = Option<Candidates>;
        #[inline(always)]
        fn run<I: Isa>(self, isa: I) -> Self::Output {
            self.0.intersect(isa, self.1, isa.splat(0.0), isa.splat(f32::MAX))
        }
    }
    let mut best: Option<(f32, f32, f32)> = None;
    for part in 0..parts {
        let part = CurvePart::new(segment, part, parts, 7);
        let found = Level::detect().run(Ask(&part, ray));
        let portable = Level::portable().run(Ask(&part, ray));
        assert_eq!(found.map(|f| (f.mask, f.t)), portable.map(|f| (f.mask, f.t)), "levels differ");
        let Some(found) = found else { continue };
        for lane in (0..BLOCK).filter(|lane| found.mask >> lane & 1 == 1) {
            let hit = (found.t.0[lane], found.u.0[lane], found.v.0[lane]);
            if best.is_none_or(|best| hit.0 < best.0) {
                best = Some(hit);
            }
        }
    }
    best
}

/// Where a curve comes nearest to a ray.
#[derive(Debug)]
struct Near {
    t: f64,
    u: f64,
    v: f64,
    /// Distance from the ray over the half width.
    off: f64,
    /// Whether the nearest point is well defined: not where the curve bends around the ray as seen along it, or
    /// runs along it.
    sound: bool,
}

/// Parameters at which the curve, seen along the ray, comes nearest to it: where a fine sequence of points changes
/// from coming nearer to going away, then by bisection.
fn nearest(segment: &CurveSegment, ray: &CurveRay) -> Vec<Near> {
    const STEPS: u32 = 1000;
    let local = segment.points.map(|p| {
        let p = (p - ray.origin).as_dvec3();
        let axis = |v: Vec3| p.dot(v.as_dvec3());
        DVec3::new(axis(ray.frame.tangent), axis(ray.frame.bitangent), axis(ray.frame.normal))
    });
    let point = |u: f64| blossom(&local, [u; 3]);
    let slope = |u: f64| {
        let h = 1e-6;
        (point(u + h) - point(u - h)) / (2.0 * h)
    };
    let going_away = |u: f64| slope(u).truncate().dot(point(u).truncate());
    let mut found = Vec::new();
    for i in 0..STEPS {
        let (mut from, mut to) = (f64::from(i) / f64::from(STEPS), f64::from(i + 1) / f64::from(STEPS));
        if going_away(from) > 0.0 || going_away(to) <= 0.0 {
            continue;
        }
        for _ in 0..50 {
            let middle = 0.5 * (from + to);
            if going_away(middle) > 0.0 { to = middle } else { from = middle }
        }
        let p = point(from);
        let width = f64::from(segment.widths[0]).mul_add(1.0 - from, f64::from(segment.widths[1]) * from);
        // The ray lies at -p from the curve; the direction across is the facing normal, -z, times the tangent.
        let tangent = slope(from).truncate().normalize();
        let across = DVec2::new(tangent.y, -tangent.x).dot(-p.truncate()) / width;
        let h = 1e-4;
        let bend = (point(from + h) - 2.0 * p + point(from - h)) / (h * h);
        let speed = slope(from).truncate().length_squared();
        let sound =
            4.0 * bend.truncate().length() * width < speed && speed > 0.05 * slope(from).length_squared();
        let off = 2.0 * p.truncate().length() / width;
        found.push(Near { t: p.z / f64::from(ray.length), u: from, v: 0.5 + across, off, sound });
    }
    found
}

#[test]
fn strips_are_met_where_a_search_finds_them() {
    let mut rng = Rng::new(31);
    let (mut hits, mut misses, mut cut) = (0, 0, [0; 4]);
    for i in 0..6000 {
        let knotted = [0.0, 0.1, 0.5, 1.5][i % 4];
        let segment = segment(&mut rng, knotted);
        let count = parts(&segment, MAX_PARTS);
        cut[count.ilog2() as usize] += 1;
        let target = point(&segment.points, rng.next_1d()) + 0.08 * vector(&mut rng);
        let origin = 3.0 * rng.next_direction();
        let ray = CurveRay::new(origin, (target - origin) * (0.1 + 3.0 * rng.next_1d()));
        let found = kernel(&segment, count, &ray);
        let met: Vec<_> = nearest(&segment, &ray).into_iter().filter(|near| near.t > 0.0).collect();
        // So near to the edge of the strip that roundings decide.
        if met.iter().any(|near| (near.off - 1.0).abs() < 1e-2 || !near.sound) {
            continue;
        }
        let expected = met.iter().filter(|near| near.off < 1.0).min_by(|a, b| a.t.total_cmp(&b.t));
        let (Some(found), Some(expected)) = (found, expected) else {
            // Near the ends rounding decides whether they are passed.
            let at_end = |u: f64| !(1e-4..=1.0 - 1e-4).contains(&u);
            let end = found.map_or(f64::NAN, |f| f.1.into());
            assert!(
                found.is_none() == expected.is_none() || at_end(end) || expected.is_some_and(|e| at_end(e.u)),
                "{segment:?} {ray:?}: {found:?} instead of {expected:?}, {count} parts"
            );
            misses += 1;
            continue;
        };
        hits += 1;
        // Coordinates of 3 in f32, seen along a curve of which a fifth shows across: the rest is the iteration's.
        let off = (f64::from(found.0) - expected.t).abs() * f64::from(ray.length);
        assert!(off < 1e-3, "{segment:?} {ray:?}: {found:?} instead of {expected:?}");
        assert!((f64::from(found.2) - expected.v).abs() < 5e-3, "{found:?} instead of {expected:?}");
    }
    assert!(hits > 1000 && misses > 500, "{hits} hits, {misses} misses");
    assert!(cut.iter().filter(|&&count| count > 0).count() > 1, "all cut alike: {cut:?}");
}

/// However it is cut, a curve is the same curve.
#[test]
fn parts_make_the_whole() {
    let mut rng = Rng::new(32);
    let mut hits = 0;
    for _ in 0..2000 {
        let segment = segment(&mut rng, 0.1);
        let origin = 3.0 * rng.next_direction();
        let target = point(&segment.points, rng.next_1d()) + 0.02 * vector(&mut rng);
        let ray = CurveRay::new(origin, target - origin);
        if nearest(&segment, &ray).iter().any(|near| !near.sound) {
            continue;
        }
        let [one, two, eight] = [1, 2, 8].map(|parts| kernel(&segment, parts, &ray));
        let differ = |other: Option<(f32, f32, f32)>| one.is_some() != other.is_some();
        // A strip's edge may lie a rounding off.
        let edge = [one, two, eight].iter().flatten().any(|hit| (hit.2 - 0.5).abs() > 0.49);
        let end = [one, two, eight].iter().flatten().any(|hit| !(1e-3..0.999).contains(&hit.1));
        assert!(!(differ(two) || differ(eight)) || edge || end, "{segment:?}: {one:?} {two:?} {eight:?}");
        if let (Some(one), Some(eight)) = (one, eight) {
            assert!((one.0 - eight.0).abs() < 1e-3 || edge || end, "{segment:?}: {one:?} {eight:?}");
            hits += 1;
        }
    }
    assert!(hits > 500, "{hits}");
}

/// Rays along the middle line slip through nowhere, joints of curves that go on smoothly among them.
#[test]
fn strands_have_no_gaps() {
    let mut rng = Rng::new(33);
    for _ in 0..300 {
        let first = segment(&mut rng, 0.3);
        let [_, _, c, d] = first.points;
        let mut second = segment(&mut rng, 0.3);
        second.points[0] = d;
        second.points[1] = d + (d - c);
        second.widths = [first.widths[1], first.widths[0]];
        for i in 0..100 {
            // Half of them at the joint, or one piece's joint.
            let (of, u) = if i % 2 == 0 { (&first, 1.0) } else { (&second, (i / 2) as f32 / 64.0) };
            if width(of, u.min(1.0)) < 1e-3 {
                continue;
            }
            let origin = 3.0 * rng.next_direction();
            let ray = CurveRay::new(origin, point(&of.points, u.min(1.0)) - origin);
            let count = [&first, &second].map(|s| kernel(s, parts(s, MAX_PARTS), &ray).is_some());
            assert!(count[0] || count[1], "{first:?} {second:?} {u}");
        }
    }
}

/// Ribbons are as wide as their normal's cosine lets them be seen.
#[test]
fn ribbons_narrow_as_they_turn() {
    let mut rng = Rng::new(34);
    let straight = [Vec3::ZERO, Vec3::X / 3.0, Vec3::X * 2.0 / 3.0, Vec3::X];
    for _ in 0..2000 {
        let turn = |rng: &mut Rng| Quat::from_rotation_x(3.0 * rng.next_1d()) * Vec3::Z;
        let first = turn(&mut rng);
        let normals = [first, Quat::from_rotation_x(rng.next_1d()) * first];
        let segment = CurveSegment { points: straight, widths: [0.2; 2], u_range: [0.0, 1.0], normals };
        let ribbon = RibbonPart::new(&segment, 0, 1, 3);
        let (u, y) = (0.05 + 0.9 * rng.next_1d(), 0.12 * signed(&mut rng));
        let ray = CurveRay::new(Vec3::new(u, y, 2.0), -2.0 * Vec3::Z);
        struct Ask<'a>(&'a RibbonPart, &'a CurveRay);
        impl Job for Ask<'_> {
            type Output = Option<Candidates>;
            #[inline(always)]
            fn run<I: Isa>(self, isa: I) -> Self::Output {
                self.0.intersect(isa, self.1, isa.splat(0.0), isa.splat(f32::MAX))
            }
        }
        let found = Level::detect().run(Ask(&ribbon, &ray));
        let half = 0.1 * normal_at(&normals, u).z.abs();
        if (y.abs() - half).abs() > 1e-4 {
            assert_eq!(found.is_some(), y.abs() < half, "{normals:?} {u} {y}");
        }
        if let Some(found) = found.filter(|_| half > 1e-3) {
            let lane = found.mask.trailing_zeros() as usize;
            // Across is the facing normal, +z, times the tangent, +x: +y.
            assert!(
                (found.v.0[lane] - (0.5 + 0.5 * y / half)).abs() < 1e-2,
                "{} {}",
                found.v.0[lane],
                y / half
            );
        }
    }
}

#[test]
fn strips_know_their_directions() {
    let mut rng = Rng::new(35);
    for _ in 0..1000 {
        let (tangent, direction, v) = (rng.next_direction(), rng.next_direction(), rng.next_1d());
        let flat = Strip::facing(3.0 * tangent, direction, v);
        assert!(flat.normal.dot(direction) <= 1e-6 && flat.normal.dot(tangent).abs() < 1e-5, "{flat:?}");
        let tube = flat.rounded();
        let across = flat.normal.cross(flat.tangent);
        assert!((tube.normal.dot(across) - (2.0 * v - 1.0)).abs() < 1e-5 && tube.normal.is_normalized());
        assert!(tube.normal.dot(tangent).abs() < 1e-5);
        let normal = rng.next_direction();
        let ribbon = flat.turned(normal);
        assert!(ribbon.normal.dot(normal) >= -1e-6 && ribbon.normal.dot(tangent).abs() < 1e-5);
        // The same place, measured in the other direction where the normal points away from the ray.
        let place = |strip: Strip| (strip.v - 0.5) * strip.normal.dot(flat.normal).signum();
        assert!((place(ribbon) - place(flat)).abs() < 1e-6);
    }
}

#[test]
fn broken_and_degenerate_curves_do_no_harm() {
    let point = Vec3::new(0.1, 0.2, 0.3);
    let nan = Vec3::NAN;
    let curves =
        [[point; 4], [point, point, nan, Vec3::ONE], [nan; 4], [Vec3::ZERO, Vec3::ZERO, Vec3::X, Vec3::X]];
    for points in curves {
        for widths in [[0.1; 2], [0.0; 2], [f32::NAN, 0.1]] {
            let segment = CurveSegment { points, widths, u_range: [0.0, 1.0], normals: [Vec3::Z; 2] };
            let count = parts(&segment, MAX_PARTS);
            for direction in [Vec3::X, Vec3::ONE, -Vec3::Z] {
                let found = kernel(&segment, count, &CurveRay::new(point - 2.0 * direction, direction));
                assert!(found.is_none_or(|(t, u, v)| t.is_finite() && u.is_finite() && v.is_finite()));
            }
        }
    }
}

/// What the kernel finds lies within the box of the part that found it.
#[test]
fn boxes_hold_their_parts() {
    let mut rng = Rng::new(36);
    for _ in 0..2000 {
        let segment = segment(&mut rng, 1.0);
        for part in 0..4 {
            let bounds = bounds(&segment, part, 4);
            let u = (part as f32 + rng.next_1d()) / 4.0;
            let on_edge = point(&segment.points, u) + 0.5 * width(&segment, u) * rng.next_direction();
            let outside = (bounds.min - on_edge).max(on_edge - bounds.max).max_element();
            assert!(outside <= 1e-6, "{segment:?} {u}: {outside}");
        }
    }
}
