//! The tree against the plainest of kernels: every primitive, one after another.

mod motion;
mod shapes;

use std::sync::Arc;

use glam::{Affine3A, Quat, Vec3};
use proptest::prelude::*;

use super::*;
use crate::desc::{CurveKind, CurveSegment, Mesh, ObjectId, Shape};
use crate::geometry::{Candidates, curve, patch, quadric, sphere, triangle};
use crate::isa::{Job, Level};

const OPAQUE: MaterialId = MaterialId(0);
const FILTERED: MaterialId = MaterialId(1);

fn is_opaque(material: MaterialId) -> bool {
    material == OPAQUE
}

struct Trace<'a, F>(&'a Accel, &'a Ray, F);

impl<F: FnMut(&Hit) -> bool> Job for Trace<'_, F> {
    type Output = (Option<Hit>, bool);

    #[inline(always)]
    fn run<I: Isa>(mut self, isa: I) -> Self::Output {
        let hit = self.0.closest(isa, self.1, &mut self.2);
        (hit, self.0.occluded(isa, self.1, self.2))
    }
}

/// The nearest hit, after checking that all levels and `occluded` agree.
fn trace(accel: &Accel, ray: &Ray, filter: impl Fn(&Hit) -> bool) -> Option<Hit> {
    let (hit, occluded) = Level::portable().run(Trace(accel, ray, &filter));
    assert_eq!(hit.is_some(), occluded, "{ray:?}");
    assert_eq!((hit, occluded), Level::detect().run(Trace(accel, ray, &filter)), "{ray:?}");
    hit
}

fn trace_all(accel: &Accel, ray: &Ray) -> Option<Hit> {
    trace(accel, ray, |_| true)
}

/// The specification of [`Accel::closest`], for transforms that keep spheres spheres.
fn brute_force(
    objects: &[Object],
    instances: &[Instance],
    ray: &Ray,
    filter: impl Fn(&Hit) -> bool,
) -> Option<Hit> {
    let sheared = triangle::Sheared::new(ray.direction);
    let mut best: Option<Hit> = None;
    let mut consider = |hit: Hit, material| {
        let nearer = hit.t > ray.t_min && hit.t <= ray.t_max && best.is_none_or(|b| hit.t < b.t);
        if nearer && (is_opaque(material) || filter(&hit)) {
            best = Some(hit);
        }
    };
    for (i, instance) in instances.iter().enumerate() {
        let place = |p: Vec3| instance.to_world.transform_point3(p);
        for (s, shape) in objects[instance.object.0 as usize].shapes.iter().enumerate() {
            let hit = Hit { t: 0.0, u: 0.0, v: 0.0, instance: i as u32, shape: s as u32, primitive: 0 };
            match &shape.geometry {
                Geometry::Mesh(mesh) => {
                    for (p, indices) in mesh.triangles.iter().enumerate() {
                        let vertices = indices.map(|i| place(mesh.positions[i as usize]));
                        if let Some((t, u, v)) = triangle::intersect(ray.origin, &sheared, vertices) {
                            consider(Hit { t, u, v, primitive: p as u32, ..hit }, shape.material);
                        }
                    }
                }
                &Geometry::Sphere { center, radius } => {
                    let radius = radius * instance.to_world.matrix3.x_axis.length();
                    let range = (ray.t_min, ray.t_max);
                    let t = sphere::intersect(ray.origin, ray.direction, range, place(center), radius);
                    if let Some(t) = t {
                        consider(Hit { t, ..hit }, shape.material);
                    }
                }
                Geometry::Quadric(quadric) => {
                    let range = (ray.t_min, ray.t_max);
                    if let Some(t) = quadric::intersect(ray.origin, ray.direction, range, quadric) {
                        consider(Hit { t, ..hit }, shape.material);
                    }
                }
                Geometry::Patches(mesh) => {
                    for (p, corners) in mesh.patches.iter().enumerate() {
                        let corners = corners.map(|i| place(mesh.positions[i as usize]));
                        let range = (ray.t_min, ray.t_max);
                        if let Some((t, u, v)) = patch::intersect(ray.origin, ray.direction, range, &corners)
                        {
                            consider(Hit { t, u, v, primitive: p as u32, ..hit }, shape.material);
                        }
                    }
                }
                Geometry::Curves(curves) => {
                    for (p, segment) in curves.segments.iter().enumerate() {
                        for (t, u, v) in curve_hits(curves.kind, segment, ray) {
                            consider(Hit { t, u, v, primitive: p as u32, ..hit }, shape.material);
                        }
                    }
                }
            }
        }
    }
    best
}

/// All that a curve's parts find.
fn curve_hits(kind: CurveKind, segment: &CurveSegment, ray: &Ray) -> Vec<(f32, f32, f32)> {
    struct Ask<'a>(CurveKind, &'a CurveSegment, &'a Ray);

    impl Job for Ask<'_> {
        type Output = Vec<(f32, f32, f32)>;

        fn run<I: Isa>(self, isa: I) -> Self::Output {
            let Self(kind, segment, ray) = self;
            let count = curve::parts(segment, curve::MAX_PARTS);
            let prepared = curve::CurveRay::new(ray.origin, ray.direction);
            let (t_min, t_max) = (isa.splat(ray.t_min), isa.splat(ray.t_max));
            let part = |i| match kind {
                CurveKind::Ribbon => {
                    curve::RibbonPart::new(segment, i, count, 0).intersect(isa, &prepared, t_min, t_max)
                }
                _ => curve::CurvePart::new(segment, i, count, 0).intersect(isa, &prepared, t_min, t_max),
            };
            let lanes = |found: Candidates| {
                (0..8)
                    .filter(move |lane| found.mask >> lane & 1 == 1)
                    .map(move |lane| (found.t.0[lane], found.u.0[lane], found.v.0[lane]))
            };
            (0..count).filter_map(part).flat_map(lanes).collect()
        }
    }

    Level::portable().run(Ask(kind, segment, ray))
}

fn mesh(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>, material: MaterialId) -> Shape {
    let mesh = Mesh { positions, triangles, ..Mesh::default() };
    Shape::new(Geometry::Mesh(Arc::new(mesh)), material)
}

fn object(shapes: Vec<Shape>) -> Object {
    Object { name: String::new(), shapes }
}

fn instance(object: u32, to_world: Affine3A) -> Instance {
    Instance::still(ObjectId(object), to_world)
}

fn build(objects: &[Object], instances: &[Instance]) -> Accel {
    Accel::build(objects, instances, is_opaque)
}

fn ray(origin: Vec3, direction: Vec3) -> Ray {
    Ray::new(origin, direction, 0.0)
}

/// Numbers of a linear congruential generator (Knuth's MMIX), uniform in -1..1.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    }

    fn vec(&mut self) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next())
    }

    fn unit(&mut self) -> Vec3 {
        loop {
            let v = self.vec();
            if v.length_squared() <= 1.0 && v.length_squared() > 1e-4 {
                return v.normalize();
            }
        }
    }

    /// Triangles of about the given size in a cube from -1 to 1.
    fn soup(&mut self, count: u32, size: f32, material: MaterialId) -> Shape {
        let mut positions = Vec::new();
        for _ in 0..count {
            let center = self.vec();
            positions.extend([0; 3].map(|_| center + size * self.vec()));
        }
        mesh(positions, (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(), material)
    }

    fn ray(&mut self) -> Ray {
        ray(2.0 * self.vec(), self.unit() * (2.0 * self.next()).exp())
    }
}

#[test]
fn empty_scenes_are_missed() {
    let nothing = build(&[], &[]);
    assert!(nothing.bounds().is_empty());
    assert_eq!(trace_all(&nothing, &ray(Vec3::ZERO, Vec3::X)), None);
    let empty = build(&[object(vec![])], &[instance(0, Affine3A::IDENTITY); 3]);
    assert!(empty.bounds().is_empty());
    assert_eq!(trace_all(&empty, &ray(Vec3::ZERO, Vec3::X)), None);
}

#[test]
fn a_single_triangle_is_hit_from_both_sides_with_its_coordinates() {
    let shape = mesh(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]], OPAQUE);
    let accel = build(&[object(vec![shape])], &[instance(0, Affine3A::IDENTITY)]);
    assert_eq!(accel.bounds(), Bounds { min: Vec3::ZERO, max: Vec3::new(1.0, 1.0, 0.0) });
    for side in [1.0, -1.0] {
        // The direction is twice as long as a unit: distances are halved.
        let ray = ray(Vec3::new(0.25, 0.5, 3.0 * side), Vec3::new(0.0, 0.0, -2.0 * side));
        let hit = Hit { t: 1.5, u: 0.25, v: 0.5, instance: 0, shape: 0, primitive: 0 };
        assert_eq!(trace_all(&accel, &ray), Some(hit));
        assert_eq!(trace_all(&accel, &Ray { t_max: 1.5, ..ray }), Some(hit));
        assert_eq!(trace_all(&accel, &Ray { t_max: 1.5f32.next_down(), ..ray }), None);
        assert_eq!(trace_all(&accel, &Ray { t_min: 1.5, ..ray }), None);
    }
}

#[test]
fn soups_and_spheres_are_hit_as_by_brute_force() {
    let mut random = Random(1);
    for (count, size) in [(1, 1.0), (9, 0.5), (200, 0.3), (5000, 0.05)] {
        let spheres = (0..count.min(40)).map(|_| {
            let geometry = Geometry::Sphere { center: random.vec(), radius: 0.1 + 0.05 * random.next() };
            Shape::new(geometry, OPAQUE)
        });
        let mut shapes: Vec<_> = spheres.collect();
        shapes.push(random.soup(count, size, OPAQUE));
        shapes.push(random.soup(count / 2, size, FILTERED));
        let turned = turned(&mut random, Vec3::splat(1.5));
        let objects = [object(shapes), object(vec![random.soup(count, size, OPAQUE)])];
        let instances = [instance(0, turned), instance(1, Affine3A::IDENTITY)];
        let accel = build(&objects, &instances);
        let filter = |hit: &Hit| !hit.primitive.is_multiple_of(3);
        let hits = (0..2000).filter(|_| {
            let ray = random.ray();
            let hit = trace(&accel, &ray, filter);
            assert_eq!(hit, brute_force(&objects, &instances, &ray, filter), "{ray:?}");
            hit.is_some()
        });
        assert!(hits.count() > 50);
    }
}

/// A grid of unit cubes, and rays through its faces, edges and corners along the axes and diagonals.
#[test]
fn boxes_are_hit_along_the_axes() {
    let mut random = Random(2);
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for corner in (0..27).map(|i| Vec3::new((i % 3) as f32, (i / 3 % 3) as f32, (i / 9) as f32)) {
        let base = positions.len() as u32;
        positions.extend(
            (0..8).map(|i| 2.0 * corner + Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32)),
        );
        for [a, b, c, d] in
            [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
        {
            triangles.extend([[a, b, c], [a, c, d]].map(|t| t.map(|i: u32| i + base)));
        }
    }
    let objects = [object(vec![mesh(positions, triangles, OPAQUE)])];
    let instances = [instance(0, Affine3A::IDENTITY)];
    let accel = build(&objects, &instances);
    let mut hits = 0;
    for _ in 0..20_000 {
        let mut integer = |n: f32| (random.vec() * n).round();
        let direction = integer(1.3);
        if direction == Vec3::ZERO {
            continue;
        }
        let origin = 2.5 + 0.5 * integer(9.0);
        for direction in [direction, direction.map(|d| if d == 0.0 { -0.0 } else { d })] {
            let ray = ray(origin, direction);
            let hit = trace_all(&accel, &ray);
            assert_eq!(hit, brute_force(&objects, &instances, &ray, |_| true), "{ray:?}");
            hits += u32::from(hit.is_some());
        }
    }
    assert!(hits > 3000, "{hits}");
}

#[test]
fn degenerate_and_broken_triangles_do_no_harm() {
    let mut random = Random(3);
    let point = random.vec();
    let mut positions = vec![point, point, point, Vec3::X, Vec3::Y, 0.5 * (Vec3::X + Vec3::Y)];
    let first = positions.len() as u32;
    positions.extend([Vec3::NAN, Vec3::INFINITY, Vec3::new(0.0, f32::NAN, 0.0)]);
    let last = positions.len() as u32;
    // Many triangles in one place cannot be told apart by their centroids.
    let mut triangles = vec![[0, 1, 2]; 500];
    triangles.extend([[3, 4, 5]; 500]);
    triangles.extend((first..last).map(|i| [i, 3, 4]));
    triangles.extend([[0, 3, 4]; 100]);
    let soup = random.soup(300, 0.4, OPAQUE);
    let objects = [object(vec![mesh(positions, triangles, OPAQUE), soup])];
    let instances = [instance(0, Affine3A::IDENTITY)];
    let accel = build(&objects, &instances);
    assert!(accel.bounds().min.is_finite() && accel.bounds().max.is_finite());
    for _ in 0..2000 {
        let mut ray = random.ray();
        if random.next() > 0.5 {
            ray.direction = point - ray.origin;
        }
        assert_eq!(trace_all(&accel, &ray), brute_force(&objects, &instances, &ray, |_| true));
    }
}

/// A series that shrinks towards a corner: splits take off little at a time.
#[test]
fn deep_trees_are_traversed() {
    let mut random = Random(11);
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for i in 0..2000 {
        let scale = 0.5f32.powf(i as f32 / 50.0);
        let base = positions.len() as u32;
        positions.extend([0; 3].map(|_| scale * (Vec3::ONE + random.vec())));
        triangles.push([base, base + 1, base + 2]);
    }
    let objects = [object(vec![mesh(positions, triangles, OPAQUE)])];
    let instances = [instance(0, Affine3A::IDENTITY)];
    let accel = build(&objects, &instances);
    let mut hits = 0;
    for _ in 0..1000 {
        let origin = Vec3::ONE + 2.0 * random.unit();
        let ray = ray(origin, 1e-3 * (Vec3::ONE + random.vec()) * (10.0 * random.next()).exp2() - origin);
        let hit = trace_all(&accel, &ray);
        let expected = brute_force(&objects, &instances, &ray, |_| true);
        // The later triangles are smaller than the roundings of their distance: without their bounds they are
        // met by rays that pass them by.
        let tiny = |hit: Option<Hit>| hit.is_some_and(|hit| hit.primitive >= 900);
        assert!(hit == expected || tiny(hit) || tiny(expected), "{ray:?}: {hit:?} instead of {expected:?}");
        hits += u32::from(hit.is_some_and(|hit| hit.primitive < 900));
    }
    assert!(hits > 100, "{hits}");
}

#[test]
fn broken_rays_meet_nothing() {
    let mut random = Random(4);
    let accel = build(&[object(vec![random.soup(1000, 0.3, OPAQUE)])], &[instance(0, Affine3A::IDENTITY)]);
    let fine = ray(Vec3::ZERO, Vec3::X);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for axis in 0..3 {
            let mut broken = [fine; 2];
            broken[0].origin[axis] = bad;
            broken[1].direction[axis] = bad;
            assert_eq!(broken.map(|ray| trace_all(&accel, &ray)), [None; 2]);
        }
    }
    assert_eq!(trace_all(&accel, &Ray { t_min: f32::NAN, ..fine }), None);
    assert_eq!(trace_all(&accel, &Ray { t_max: f32::NAN, ..fine }), None);
    assert_eq!(trace_all(&accel, &Ray { t_min: 2.0, t_max: 1.0, ..fine }), None);
    assert_eq!(trace_all(&accel, &Ray { direction: Vec3::ZERO, ..fine }), None);
}

#[test]
fn scale_does_not_matter() {
    let mut random = Random(5);
    let Geometry::Mesh(unit) = random.soup(500, 0.2, OPAQUE).geometry else { unreachable!() };
    let rays: Vec<_> = (0..2000).map(|_| random.ray()).collect();
    let trace_at = |scale: f32| -> Vec<_> {
        let positions = unit.positions.iter().map(|&p| scale * p).collect();
        let objects = [object(vec![mesh(positions, unit.triangles.clone(), OPAQUE)])];
        let accel = build(&objects, &[instance(0, Affine3A::IDENTITY)]);
        rays.iter().map(|r| trace_all(&accel, &Ray { origin: scale * r.origin, ..*r })).collect()
    };
    let expected: Vec<_> = trace_at(1.0);
    assert!(expected.iter().flatten().count() > 100);
    for exponent in [-40, -20, 20, 40] {
        let scale = 2f32.powi(exponent);
        let scaled = trace_at(scale);
        // Scaling by powers of two is exact.
        let expected = expected.iter().map(|h| h.map(|h| Hit { t: h.t * scale, ..h }));
        assert!(scaled.into_iter().eq(expected), "2^{exponent}");
    }
}

/// A closed surface: an octahedron subdivided, its vertices pushed in and out and moved to `center`.
fn lump(random: &mut Random, level: u32, center: Vec3) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut positions = vec![Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for (x, y, z) in (0..8).map(|i| (i & 1, 2 + (i >> 1 & 1), 4 + (i >> 2))) {
        triangles.push(if (x + y + z) % 2 == 0 { [x, y, z] } else { [y, x, z] });
    }
    for _ in 0..level {
        let mut middles = std::collections::HashMap::new();
        let mut finer = Vec::new();
        for [a, b, c] in triangles {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(a, b)| {
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    positions.push((positions[a as usize] + positions[b as usize]).normalize());
                    positions.len() as u32 - 1
                })
            });
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    let roughness = 0.3 / 2f32.powi(level as i32);
    (positions.iter().map(|&p| center + p * (1.0 + roughness * random.next())).collect(), triangles)
}

/// From inside of a closed surface every ray must hit, also when aimed at its edges and vertices.
#[test]
fn closed_surfaces_do_not_leak() {
    let mut random = Random(6);
    for (level, center, scale) in [(1, 0.0, 1.0), (4, 0.0, 1e-3), (5, 100.0, 1.0), (5, 1.0, 1e6)] {
        let center = center * random.unit();
        let (positions, triangles) = lump(&mut random, level, center);
        let positions: Vec<_> = positions.into_iter().map(|p| p * scale).collect();
        let objects = [object(vec![mesh(positions.clone(), triangles.clone(), OPAQUE)])];
        let accel = build(&objects, &[instance(0, Affine3A::IDENTITY)]);
        let rays: Vec<Ray> = (0..400_000)
            .map(|i| {
                let origin = scale * (center + 0.4 * random.unit() * random.next());
                let pick = (random.next() + 1.0) * 0.5 * triangles.len() as f32;
                let [a, b, _] =
                    triangles[(pick as usize).min(triangles.len() - 1)].map(|i| positions[i as usize]);
                let target = match i % 4 {
                    0 => a,
                    1 => a.lerp(b, 0.5),
                    2 => a.lerp(b, 0.5 + 0.5 * random.next()),
                    _ => origin + random.unit(),
                };
                ray(origin, target - origin)
            })
            .collect();
        let leaks = Level::detect().run(CountMisses(&accel, &rays));
        assert_eq!(leaks, 0, "level {level}, center {center}, scale {scale}");
        let leaks = Level::portable().run(CountMisses(&accel, &rays[..40_000]));
        assert_eq!(leaks, 0, "level {level}, center {center}, scale {scale}");
    }
}

struct CountMisses<'a>(&'a Accel, &'a [Ray]);

impl Job for CountMisses<'_> {
    type Output = usize;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> usize {
        self.1.iter().filter(|ray| self.0.closest(isa, ray, |_| true).is_none()).count()
    }
}

fn turned(random: &mut Random, scale: Vec3) -> Affine3A {
    let rotation = Quat::from_axis_angle(random.unit(), 2.0);
    Affine3A::from_scale_rotation_translation(scale, rotation, random.vec())
}

/// The nearest hit on any instance is the nearest hit on its object of the ray brought to its space: exactly.
#[test]
fn instances_are_hit_in_their_objects_space() {
    let mut random = Random(7);
    let sphere = Geometry::Sphere { center: Vec3::splat(0.5), radius: 0.3 };
    let shapes =
        vec![random.soup(300, 0.2, OPAQUE), Shape::new(sphere, FILTERED), random.soup(300, 0.2, FILTERED)];
    let objects = [object(shapes)];
    let instances: Vec<_> = [Vec3::ONE, Vec3::new(-1.0, 1.0, 1.5), Vec3::new(0.5, -2.0, -1.0)]
        .map(|scale| instance(0, turned(&mut random, scale)))
        .to_vec();
    let accel = build(&objects, &instances);
    assert_eq!(accel.instances.len(), 3);
    let filter = |hit: &Hit| hit.primitive % 2 == hit.instance % 2;
    let mut hits = [0; 3];
    for _ in 0..5000 {
        let world = random.ray();
        let mut expected: Option<Hit> = None;
        for (i, placed) in (0..).zip(&instances) {
            let to_object = placed.to_world.inverse();
            let origin = to_object.transform_point3(world.origin);
            let local = ray(origin, to_object.transform_vector3(world.direction));
            let filter = |hit: &Hit| filter(&Hit { instance: i, ..*hit });
            let hit = brute_force(&objects, &[instance(0, Affine3A::IDENTITY)], &local, filter);
            let nearer = |hit: &Hit| expected.is_none_or(|e| hit.t < e.t);
            expected = hit.map(|hit| Hit { instance: i, ..hit }).filter(nearer).or(expected);
        }
        assert_eq!(trace(&accel, &world, filter), expected, "{world:?}");
        if let Some(hit) = expected {
            hits[hit.instance as usize] += 1;
        }
    }
    assert!(hits.iter().all(|&n| n > 200), "{hits:?}");
}

/// Instances and copies, mirrored ones among them, have the same surface.
#[test]
fn instances_are_hit_as_copies() {
    let mut random = Random(10);
    let shapes = vec![random.soup(300, 0.2, OPAQUE)];
    let places = [Vec3::ONE, Vec3::new(-1.0, 1.0, 1.5), Vec3::new(0.5, -2.0, -1.0)]
        .map(|scale| turned(&mut random, scale));
    let shared = build(&[object(shapes.clone())], &places.map(|place| instance(0, place)));
    let copies = [0; 3].map(|_| object(shapes.clone()));
    let copied: Vec<_> = (0..3).map(|i| instance(i, places[i as usize])).collect();
    let flat = build(&copies, &copied);
    assert_eq!([shared.instances.len(), flat.instances.len()], [3, 0]);
    let (mut hits, mut odd) = (0, 0);
    for _ in 0..5000 {
        let ray = random.ray();
        let [a, b] = [&shared, &flat].map(|accel| trace_all(accel, &ray));
        hits += u32::from(a.is_some());
        let name = |hit: Hit| (hit.instance, hit.shape, hit.primitive);
        if a.map(name) != b.map(name) {
            // Rounding moved an edge across the ray.
            odd += 1;
        } else if let (Some(a), Some(b)) = (a, b) {
            // Coordinates are below 8 and the soup's triangles may be met at a grazing angle.
            assert!((a.t - b.t).abs() * ray.direction.length() < 1e-3, "{a:?} {b:?}");
        }
    }
    // An edge is a few 1e-7 wide where triangles are 0.1 wide.
    assert!(hits > 1000 && odd <= 2, "{hits} hits, {odd} of them odd");
}

/// An instance costs its entry and its share of a node, however much it places.
#[test]
fn instances_cost_an_entry_each() {
    let mut random = Random(11);
    let clump = object(vec![random.soup(960, 0.1, OPAQUE)]);
    let mut place = || instance(0, Affine3A::from_translation(20.0 * random.vec()));
    let instances: Vec<_> = (0..5500).map(|_| place()).collect();
    let bytes = |count| build(std::slice::from_ref(&clump), &instances[..count]).bytes();
    let each = (bytes(5500) - bytes(2)) / 5498;
    // 80 bytes of its own, and an eighth of a node of 256 bytes where nodes are full; they are at least a third full.
    assert!((80 + 32..=80 + 96).contains(&each), "{each} bytes each");
    assert_eq!(size_of::<Inner>(), 80);
}

/// A sphere stretched to an ellipsoid has a tree of its own, and the ellipsoid's equation holds at its hits.
#[test]
fn stretched_spheres_are_ellipsoids() {
    let mut random = Random(8);
    let center = Vec3::new(0.25, 0.0, -1.0);
    let shape = Shape::new(Geometry::Sphere { center, radius: 0.5 }, OPAQUE);
    let stretched = turned(&mut random, Vec3::new(1.0, 2.0, -3.0));
    let accel = build(&[object(vec![shape])], &[instance(0, stretched)]);
    let inverse = stretched.inverse();
    let mut hits = 0;
    for _ in 0..2000 {
        let origin = 6.0 * random.unit();
        let ray = ray(origin, 2.0 * random.vec() - origin);
        let Some(hit) = trace_all(&accel, &ray) else { continue };
        hits += 1;
        let p = inverse.transform_point3(ray.origin + hit.t * ray.direction);
        assert!(((p - center).length() - 0.5).abs() < 1e-4, "{hit:?}");
    }
    assert!(hits > 100);
}

/// Rays that start on a surface, moved off it, do not find it again: not even at grazing angles.
#[test]
fn offset_rays_leave_their_surface() {
    use crate::geometry::offset_ray_origin;
    let mut random = Random(9);
    for scale in [1e-3, 1.0, 1e3] {
        for i in 0..50_000 {
            let center = scale * random.vec() * if i % 2 == 0 { 1.0 } else { 30.0 };
            let vertices = [0; 3].map(|_| center + scale * random.vec());
            let normal = (vertices[1] - vertices[0]).cross(vertices[2] - vertices[0]);
            let longest = (vertices[1] - vertices[0]).max(vertices[2] - vertices[0]).length_squared();
            // Slivers have no reliable normal.
            if normal.length() < 1e-2 * longest {
                continue;
            }
            let normal = normal.normalize();
            let [mut u, mut v] = [0.5 + 0.5 * random.next(), 0.5 + 0.5 * random.next()];
            if u + v > 1.0 {
                [u, v] = [1.0 - u, 1.0 - v];
            }
            let error = triangle::point_error(vertices, u, v);
            let mut w = random.unit();
            if i % 3 == 0 {
                w = (w - (1.0 - 1e-4) * w.dot(normal) * normal).normalize();
            }
            let origin = offset_ray_origin(triangle::point(vertices, u, v), error, normal, w);
            let again = triangle::intersect(origin, &triangle::Sheared::new(w), vertices);
            assert!(again.is_none_or(|(t, ..)| t <= 0.0), "{vertices:?} {origin} {w} {again:?}");

            let radius = scale * (1.1 + random.next());
            let normal = random.unit();
            let p = sphere::point(center + radius * normal, center, radius);
            let outwards = if w.dot(normal) < 0.0 { -w } else { w };
            let error = sphere::point_error(p, center, radius);
            let origin = offset_ray_origin(p, error, normal, outwards);
            let again = sphere::intersect(origin, outwards, (0.0, f32::INFINITY), center, radius);
            assert_eq!(again, None, "{center} {radius} {origin} {outwards}");
        }
    }
}

fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        -2.0f32..2.0,
        (-4i8..=4).prop_map(|i| f32::from(i) * 0.5),
        // Products of three smaller ones underflow, where the kernel promises nothing.
        prop_oneof![Just(-0.0f32), Just(1e-9), Just(1e-12)],
    ]
}

fn vector() -> impl Strategy<Value = Vec3> {
    [coordinate(), coordinate(), coordinate()].prop_map(Vec3::from)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]

    /// Awkward triangles and rays: many on common planes, lines and points. Rounding makes the plain test hit
    /// triangles without area far off from where they are, which the tree's boxes mostly prevent: such hits are
    /// turned down on both sides.
    #[test]
    fn awkward_triangles_are_hit_as_by_brute_force(
        positions in proptest::collection::vec(vector(), 3..60),
        rays in proptest::collection::vec((vector(), vector()), 1..8),
    ) {
        let n = positions.len() as u32;
        let triangles: Vec<[u32; 3]> = (0..2 * n).map(|i| [i % n, (i * 7 + 1) % n, (i * 5 + 2) % n]).collect();
        let objects = [object(vec![mesh(positions.clone(), triangles.clone(), FILTERED)])];
        let instances = [instance(0, Affine3A::IDENTITY)];
        let accel = build(&objects, &instances);
        for (origin, direction) in rays {
            if direction.abs().max_element() < 1e-3 {
                continue;
            }
            // Hits at the origin may be nothing but rounding, which the tree need not share.
            let ray = Ray { t_min: 1e-2, ..ray(origin, direction) };
            let lies_there = |hit: &Hit| {
                let [a, b, c] = triangles[hit.primitive as usize].map(|i| positions[i as usize]);
                let point = origin + hit.t * direction;
                let outside = (a.min(b).min(c) - point).max(point - a.max(b).max(c));
                outside.max_element() < 1e-4
            };
            let found = trace(&accel, &ray, lies_there);
            let expected = brute_force(&objects, &instances, &ray, lies_there);
            if found != expected {
                let [found, expected] = [found, expected].map(|hit| hit.map_or(f32::NAN, |hit| hit.t));
                let apart = (found - expected).abs() * direction.length();
                prop_assert!(apart < 1e-4, "{:?}: {} instead of {}", ray, found, expected);
            }
        }
    }
}
