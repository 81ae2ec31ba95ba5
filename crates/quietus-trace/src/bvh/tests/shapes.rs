//! Curves, patches and quadrics in the tree.

use super::*;
use crate::desc::{CurveKind, CurveSegment, Curves, PatchMesh, Quadric};
use crate::geometry::curve;

impl Random {
    /// Curves of about the given length in a cube from -1 to 1.
    pub(super) fn curves(&mut self, count: u32, length: f32, kind: CurveKind, material: MaterialId) -> Shape {
        let segments = (0..count).map(|_| {
            let (start, way) = (self.vec(), length * self.unit());
            let mut between = |t: f32| start + t * way + 0.2 * length * self.vec();
            CurveSegment {
                points: [start, between(0.3), between(0.7), start + way],
                widths: [0.05 * length, 0.02 * length],
                u_range: [0.0, 1.0],
                normals: [self.unit(), self.unit()],
            }
        });
        Shape::new(Geometry::Curves(Arc::new(Curves { kind, segments: segments.collect() })), material)
    }

    pub(super) fn patches(&mut self, count: u32, size: f32, material: MaterialId) -> Shape {
        let mut positions = Vec::new();
        for _ in 0..count {
            let center = self.vec();
            positions.extend([0; 4].map(|_| center + size * self.vec()));
        }
        let patches = (0..count).map(|i| [4 * i, 4 * i + 1, 4 * i + 2, 4 * i + 3]).collect();
        let mesh = PatchMesh { positions, patches, ..PatchMesh::default() };
        Shape::new(Geometry::Patches(Arc::new(mesh)), material)
    }

    pub(super) fn quadrics(&mut self) -> Vec<Shape> {
        let mut half = |scale: f32| scale * (1.0 + 0.5 * self.next());
        let sphere =
            Quadric::PartialSphere { radius: half(0.5), z_min: -0.2, z_max: half(0.3), phi_max: 4.0 };
        let (height, radius) = (half(0.7), half(0.6));
        let disk = Quadric::Disk { height, radius, inner_radius: 0.2, phi_max: 5.0 };
        let cylinder = Quadric::Cylinder { radius: half(0.6), z_min: -0.8, z_max: -0.3, phi_max: 6.0 };
        [sphere, disk, cylinder].map(|quadric| Shape::new(Geometry::Quadric(quadric), OPAQUE)).to_vec()
    }
}

#[test]
fn curves_patches_and_quadrics_are_hit_as_by_brute_force() {
    let mut random = Random(61);
    let mut shapes = random.quadrics();
    for material in [OPAQUE, FILTERED] {
        for kind in [CurveKind::Flat, CurveKind::Cylinder, CurveKind::Ribbon] {
            shapes.push(random.curves(20, 1.0, kind, material));
        }
        shapes.push(random.patches(30, 0.2, material));
    }
    shapes.push(random.soup(100, 0.1, OPAQUE));
    let objects = [object(shapes)];
    let instances = [instance(0, Affine3A::IDENTITY)];
    let accel = build(&objects, &instances);
    assert!(accel.store.singles.curves.len() > 80 && !accel.store.singles.ribbons.is_empty());
    let filter = |hit: &Hit| !hit.primitive.is_multiple_of(3);
    let mut hits = vec![0; objects[0].shapes.len()];
    for _ in 0..5000 {
        let ray = random.ray();
        let hit = trace(&accel, &ray, filter);
        let expected = brute_force(&objects, &instances, &ray, filter);
        // Neighbouring pieces of a curve overlap, and differ in roundings.
        let same = |a: Hit, b: Hit| {
            let off = (a.t - b.t).abs().max((a.u - b.u).abs()).max((a.v - b.v).abs());
            Hit { t: b.t, u: b.u, v: b.v, ..a } == b && off < 1e-4
        };
        let agree = hit == expected || hit.zip(expected).is_some_and(|(a, b)| same(a, b));
        assert!(agree, "{ray:?}: {hit:?} instead of {expected:?}");
        if let Some(hit) = hit {
            hits[hit.shape as usize] += 1;
        }
    }
    assert!(hits.iter().all(|&n| n > 4), "{hits:?}");
}

/// Curves and patches in the world's tree are those of an instance's own tree, and quadrics stand where placed.
#[test]
fn other_shapes_are_instanced_as_copied() {
    let mut random = Random(62);
    let mut shapes = vec![random.curves(100, 0.6, CurveKind::Flat, OPAQUE), random.patches(50, 0.2, OPAQUE)];
    shapes.push(random.curves(60, 0.6, CurveKind::Ribbon, OPAQUE));
    let places = [0; 2].map(|_| turned(&mut random, Vec3::splat(1.3)));
    let shared = build(&[object(shapes.clone())], &places.map(|place| instance(0, place)));
    let copies = [0; 2].map(|_| object(shapes.clone()));
    let flat = build(&copies, &[instance(0, places[0]), instance(1, places[1])]);
    assert_eq!([shared.instances.len(), flat.instances.len()], [2, 0]);
    let (mut hits, mut odd) = (0, 0);
    for _ in 0..20_000 {
        let ray = random.ray();
        let [a, b] = [&shared, &flat].map(|accel| trace_all(accel, &ray));
        let name = |hit: Hit| (hit.instance, hit.shape, hit.primitive);
        hits += u32::from(a.is_some());
        if a.map(name) != b.map(name) {
            odd += 1;
        } else if let (Some(a), Some(b)) = (a, b) {
            assert!((a.t - b.t).abs() * ray.direction.length() < 2e-3, "{a:?} {b:?}");
            assert!((a.v - b.v).abs() < 2e-2, "{a:?} {b:?}");
        }
    }
    // An edge is a few 1e-7 wide where strips are 0.01 wide.
    assert!(hits > 3000 && odd <= 8, "{hits} hits, {odd} of them odd");
}

/// A strip shaded as a tube has the silhouette and the normals of the tube.
#[test]
fn curves_are_tubes() {
    const SIDES: u32 = 48;
    const RINGS: u32 = 200;
    let points = [Vec3::new(-1.0, 0.0, 0.0), Vec3::new(-0.4, 0.3, 0.1), Vec3::new(0.3, 0.2, -0.2), Vec3::X];
    let segment = CurveSegment { points, widths: [0.06; 2], u_range: [0.0, 1.0], normals: [Vec3::Z; 2] };
    let ring = |i: u32| {
        let u = i as f32 / RINGS as f32;
        let center = curve::point(&points, u);
        let tangent = curve::tangent(&points, u).normalize();
        let side = tangent.cross(Vec3::Y).normalize();
        (0..SIDES).map(move |s| {
            let (sin, cos) = (std::f32::consts::TAU * s as f32 / SIDES as f32).sin_cos();
            center + 0.03 * (cos * side + sin * side.cross(tangent))
        })
    };
    let positions: Vec<Vec3> = (0..=RINGS).flat_map(ring).collect();
    let corner = |i: u32, s: u32| i * SIDES + s % SIDES;
    let triangles = (0..RINGS)
        .flat_map(|i| (0..SIDES).map(move |s| (i, s)))
        .flat_map(|(i, s)| {
            let [a, b, c, d] = [corner(i, s), corner(i, s + 1), corner(i + 1, s), corner(i + 1, s + 1)];
            [[a, b, d], [a, d, c]]
        })
        .collect();
    let here = [instance(0, Affine3A::IDENTITY)];
    let tube = build(&[object(vec![mesh(positions.clone(), triangles, OPAQUE)])], &here);
    let strip = Curves { kind: CurveKind::Cylinder, segments: vec![segment] };
    let strip = build(&[object(vec![Shape::new(Geometry::Curves(Arc::new(strip)), OPAQUE)])], &here);
    let mut random = Random(63);
    let (mut both, mut odd) = (0, 0);
    for _ in 0..30_000 {
        let u = 0.5 + 0.4 * random.next();
        let tangent = curve::tangent(&points, u).normalize();
        // From the side: seen end-on a strip has no depth, and a tube has.
        let side = random.unit();
        let side = (side - tangent * side.dot(tangent)).normalize() + 0.3 * random.next() * tangent;
        let origin = curve::point(&points, u) + 2.0 * side;
        let target = curve::point(&points, u) + 0.05 * random.vec();
        let ray = ray(origin, (target - origin).normalize());
        let (Some(a), Some(b)) = (trace_all(&tube, &ray), trace_all(&strip, &ray)) else {
            // The inscribed tube is narrower by half of a thousandth, the strip's edge is straight between.
            odd += u32::from(trace_all(&tube, &ray).is_some() != trace_all(&strip, &ray).is_some());
            continue;
        };
        both += 1;
        let tangent = curve::tangent(&points, b.u);
        let shaded = curve::Strip::facing(tangent, ray.direction, b.v).rounded();
        let on_tube = ray.origin + a.t * ray.direction;
        let axis = (0..=1000).map(|i| curve::point(&points, i as f32 / 1000.0));
        let nearest = axis.min_by(|a, b| a.distance(on_tube).total_cmp(&b.distance(on_tube)));
        let normal = (on_tube - nearest.expect("there are some")).normalize();
        // The ray goes on along the tube while it crosses the strip's depth, by at most 0.03 * 0.35 here.
        if (b.v - 0.5).abs() < 0.45 {
            assert!(shaded.normal.dot(normal) > 0.97, "{b:?}: {} instead of {normal}", shaded.normal);
        }
    }
    assert!(both > 10_000 && odd < both / 50, "{both} hit both, {odd} one of them");
}

/// From inside of a closed surface of patches every ray must hit, also when aimed at edges and corners.
#[test]
fn closed_patches_do_not_leak() {
    const CELLS: u32 = 6;
    let mut random = Random(64);
    let mut positions = Vec::new();
    let mut seen = std::collections::HashMap::new();
    let mut patches = Vec::new();
    let mut index = |at: [i32; 3], random: &mut Random| {
        *seen.entry(at).or_insert_with(|| {
            let direction = Vec3::from(at.map(|x| x as f32)).normalize();
            positions.push((1.0 + 0.2 * random.next()) * direction);
            positions.len() as u32 - 1
        })
    };
    let n = CELLS as i32;
    for (axis, side) in (0..3).flat_map(|axis| [(axis, -n), (axis, n)]) {
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let corner = |di: i32, dj: i32| {
                let mut at = [0; 3];
                at[axis] = side;
                at[(axis + 1) % 3] = 2 * (i + di) - n;
                at[(axis + 2) % 3] = 2 * (j + dj) - n;
                at
            };
            patches.push([(0, 0), (1, 0), (0, 1), (1, 1)].map(|(di, dj)| index(corner(di, dj), &mut random)));
        }
    }
    let mesh = PatchMesh { positions, patches, ..PatchMesh::default() };
    let objects = [object(vec![Shape::new(Geometry::Patches(Arc::new(mesh.clone())), OPAQUE)])];
    let accel = build(&objects, &[instance(0, Affine3A::IDENTITY)]);
    let rays: Vec<Ray> = (0..200_000)
        .map(|i| {
            let origin = 0.3 * random.unit();
            let pick = (random.next() + 1.0) * 0.5 * mesh.patches.len() as f32;
            let [a, b, ..] =
                mesh.patches[(pick as usize).min(mesh.patches.len() - 1)].map(|i| mesh.positions[i as usize]);
            let target = [a, a.lerp(b, 0.5), a.lerp(b, 0.5 + 0.5 * random.next())][i % 3];
            ray(origin, target - origin)
        })
        .collect();
    assert_eq!(Level::detect().run(CountMisses(&accel, &rays)), 0);
}

#[test]
fn broken_shapes_do_no_harm() {
    let mut random = Random(65);
    let mut shapes = vec![random.soup(10, 0.3, OPAQUE)];
    for bad in [f32::NAN, f32::INFINITY] {
        let Geometry::Curves(curves) = random.curves(5, 0.5, CurveKind::Flat, OPAQUE).geometry else {
            unreachable!()
        };
        let mut curves = Curves::clone(&curves);
        curves.segments[0].points[1].x = bad;
        curves.segments[1].widths[0] = bad;
        shapes.push(Shape::new(Geometry::Curves(Arc::new(curves)), OPAQUE));
        let Geometry::Patches(patches) = random.patches(5, 0.5, OPAQUE).geometry else { unreachable!() };
        let mut patches = PatchMesh::clone(&patches);
        patches.positions[3].z = bad;
        shapes.push(Shape::new(Geometry::Patches(Arc::new(patches)), OPAQUE));
        let disk = Quadric::Disk { height: bad, radius: bad, inner_radius: bad, phi_max: bad };
        shapes.push(Shape::new(Geometry::Quadric(disk), OPAQUE));
    }
    let accel = build(&[object(shapes)], &[instance(0, Affine3A::IDENTITY)]);
    assert!(accel.bounds().min.is_finite() && accel.bounds().max.is_finite());
    for _ in 0..2000 {
        trace_all(&accel, &random.ray());
    }
}
