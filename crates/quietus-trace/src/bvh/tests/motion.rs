//! What moves is met where it is at the ray's time.

use super::*;
use crate::geometry::motion::Motion;
use crate::geometry::triangle::corners_at;

/// A soup whose vertices move, but for the first third of the triangles.
fn moving_soup(random: &mut Random, count: u32, material: MaterialId) -> Shape {
    let Geometry::Mesh(mesh) = random.soup(count, 0.2, material).geometry else { unreachable!() };
    let still = mesh.positions.len() / 3;
    let moved = |(i, &p): (usize, &Vec3)| if i < still { p } else { p + 0.3 * random.vec() };
    let end_positions = mesh.positions.iter().enumerate().map(moved).collect();
    let mesh = Mesh { end_positions, ..Mesh::clone(&mesh) };
    Shape::new(Geometry::Mesh(Arc::new(mesh)), material)
}

/// The soup as it stands at `time`.
fn frozen(shape: &Shape, time: f32) -> Shape {
    let Geometry::Mesh(mesh) = &shape.geometry else { unreachable!() };
    let positions = (mesh.positions.iter().zip(&mesh.end_positions))
        .map(|(&a, &b)| corners_at([a; 3], [b; 3], time)[0])
        .collect();
    let mesh = Mesh { positions, triangles: mesh.triangles.clone(), ..Mesh::default() };
    Shape::new(Geometry::Mesh(Arc::new(mesh)), shape.material)
}

#[test]
fn deforming_meshes_are_hit_as_if_frozen() {
    let mut random = Random(21);
    let shapes = [moving_soup(&mut random, 600, OPAQUE), moving_soup(&mut random, 300, FILTERED)];
    let still = [instance(0, Affine3A::IDENTITY)];
    let accel = build(&[object(shapes.to_vec())], &still);
    assert!(!accel.store.moving.is_empty() && !accel.store.triangles.is_empty());
    let filter = |hit: &Hit| !hit.primitive.is_multiple_of(3);
    let mut hits = 0;
    for i in 0..40 {
        let time = i as f32 / 39.0;
        let objects = [object(shapes.iter().map(|shape| frozen(shape, time)).collect())];
        for _ in 0..100 {
            let ray = Ray { time, ..random.ray() };
            let hit = trace(&accel, &ray, filter);
            assert_eq!(hit, brute_force(&objects, &still, &ray, filter), "{ray:?}");
            hits += u32::from(hit.is_some());
        }
    }
    assert!(hits > 500, "{hits}");
}

/// Instances that move, one of them of an object of its own, are met in their objects' space at the ray's time.
#[test]
fn moving_instances_are_hit_in_their_objects_space() {
    let mut random = Random(22);
    let sphere = Geometry::Sphere { center: Vec3::splat(0.3), radius: 0.4 };
    let shapes = vec![random.soup(200, 0.2, OPAQUE), Shape::new(sphere, OPAQUE)];
    let objects = [object(shapes), object(vec![moving_soup(&mut random, 200, OPAQUE)])];
    let scales = [Vec3::ONE, Vec3::new(-1.0, 1.0, 1.5), Vec3::new(0.5, 2.0, 1.0)];
    let instances: Vec<_> = (0..3)
        .map(|i| {
            let [start, end] = [0; 2].map(|_| turned(&mut random, scales[i]));
            Instance { end_to_world: Some(end), ..instance(u32::from(i == 1), start) }
        })
        .collect();
    let accel = build(&objects, &instances);
    assert_eq!([accel.instances.len(), accel.motions.len()], [3, 3]);
    let mut hits = [0; 3];
    for _ in 0..5000 {
        let world = Ray { time: 0.5 + 0.5 * random.next(), ..random.ray() };
        let mut expected: Option<Hit> = None;
        for (i, at) in (0..).zip(&instances) {
            let motion = Motion::new(&at.to_world, &at.end_to_world.expect("moves")).expect("invertible");
            let to_object = motion.at(world.time).inverse();
            let local = Ray {
                origin: to_object.transform_point3(world.origin),
                direction: to_object.transform_vector3(world.direction),
                ..world
            };
            let object = &objects[at.object.0 as usize];
            let alone = if i == 1 {
                self::object(vec![frozen(&object.shapes[0], world.time)])
            } else {
                object.clone()
            };
            let hit = brute_force(&[alone], &[instance(0, Affine3A::IDENTITY)], &local, |_| true);
            let nearer = |hit: &Hit| expected.is_none_or(|e| hit.t < e.t);
            expected = hit.map(|hit| Hit { instance: i, ..hit }).filter(nearer).or(expected);
        }
        assert_eq!(trace_all(&accel, &world), expected, "{world:?}");
        if let Some(hit) = expected {
            hits[hit.instance as usize] += 1;
        }
    }
    assert!(hits.iter().all(|&n| n > 200), "{hits:?}");
}

/// Closed surfaces stay closed while they change their form and move.
#[test]
fn moving_surfaces_do_not_leak() {
    let mut random = Random(23);
    let (positions, triangles) = lump(&mut random, 4, Vec3::ZERO);
    let end_positions: Vec<_> = positions.iter().map(|&p| p * (1.0 + 0.2 * random.next())).collect();
    let mesh = Mesh { positions, end_positions, triangles, ..Mesh::default() };
    let objects = [object(vec![Shape::new(Geometry::Mesh(Arc::new(mesh.clone())), OPAQUE)])];
    let [start, end] = [0; 2].map(|_| turned(&mut random, Vec3::ONE));
    for moves in [false, true] {
        let at = instance(0, Affine3A::IDENTITY);
        let at = if moves { Instance { to_world: start, end_to_world: Some(end), ..at } } else { at };
        let accel = build(&objects, &[at]);
        let motion = Motion::new(&at.to_world, at.motion().unwrap_or(&at.to_world)).expect("invertible");
        let rays: Vec<Ray> = (0..100_000)
            .map(|i| {
                let time = 0.5 + 0.5 * random.next();
                let to_world = motion.at(time);
                let pick = (random.next() + 1.0) * 0.5 * mesh.triangles.len() as f32;
                let corners =
                    mesh.triangles[(pick as usize).min(mesh.triangles.len() - 1)].map(|i| i as usize);
                let [a, b, _] = corners_at(
                    corners.map(|i| mesh.positions[i]),
                    corners.map(|i| mesh.end_positions[i]),
                    time,
                );
                let target = if i % 2 == 0 { a } else { a.lerp(b, 0.5 + 0.5 * random.next()) };
                let origin = to_world.transform_point3(0.4 * random.unit());
                Ray { time, ..ray(origin, to_world.transform_point3(target) - origin) }
            })
            .collect();
        assert_eq!(Level::detect().run(CountMisses(&accel, &rays)), 0, "moves: {moves}");
    }
}

/// Motions through flatness cannot be drawn, and what is not finite is left out.
#[test]
fn broken_motions_do_no_harm() {
    let mut random = Random(24);
    let Geometry::Mesh(mesh) = moving_soup(&mut random, 30, OPAQUE).geometry else { unreachable!() };
    let mut mesh = Mesh::clone(&mesh);
    mesh.end_positions[40] = Vec3::NAN;
    mesh.end_positions[43] = Vec3::INFINITY;
    let objects = [object(vec![Shape::new(Geometry::Mesh(Arc::new(mesh)), OPAQUE)])];
    let mirror = Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
    let still = instance(0, Affine3A::IDENTITY);
    let accel = build(&objects, &[still, Instance { end_to_world: Some(mirror), ..still }]);
    assert!(accel.bounds().min.is_finite() && accel.bounds().max.is_finite());
    for _ in 0..1000 {
        let ray = Ray { time: 0.5, ..random.ray() };
        assert!(trace_all(&accel, &ray).is_none_or(|hit| hit.instance == 0));
    }
}
