//! Shapes other than meshes and spheres, drawn by the whole tracer.

use super::*;
use crate::desc::{CurveKind, CurveSegment, Curves, PatchMesh, Quadric};

fn strand(kind: CurveKind) -> Geometry {
    let points =
        [[-2.0, 0.0, 0.0], [-0.7, 0.1, 0.1], [0.7, 0.1, -0.1], [2.0, 0.0, 0.0]].map(Vec3::from_array);
    let segment = CurveSegment { points, widths: [0.02; 2], u_range: [0.0, 1.0], normals: [Vec3::Z; 2] };
    Geometry::Curves(Arc::new(Curves { kind, segments: vec![segment] }))
}

/// Each around the origin, its front towards +z.
fn shapes() -> Vec<(&'static str, Geometry)> {
    let (radius, phi_max) = (1.0, 6.0);
    let sphere =
        Quadric::PartialSphere { radius, z_min: -0.5, z_max: 1.0, phi_max: 2.0 * std::f32::consts::PI };
    let disk = Quadric::Disk { height: 0.1, radius, inner_radius: 0.0, phi_max };
    let patch = PatchMesh {
        positions: [[-1.0, -1.0, 0.3], [1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [1.0, 1.0, 0.3]]
            .map(Vec3::from_array)
            .to_vec(),
        patches: vec![[0, 1, 2, 3]],
        ..PatchMesh::default()
    };
    vec![
        ("sphere", Geometry::Quadric(sphere)),
        ("disk", Geometry::Quadric(disk)),
        ("patch", Geometry::Patches(Arc::new(patch))),
        ("flat curve", strand(CurveKind::Flat)),
        ("tube", strand(CurveKind::Cylinder)),
        ("ribbon", strand(CurveKind::Ribbon)),
    ]
}

/// A place each can be looked at: not where some end or meet.
const SPOT: Vec3 = Vec3::new(0.03, 0.078, 0.0);

/// Under an even sky a convex surface shows its albedo, whatever its form: nothing shadows itself.
#[test]
fn sky_furnace_shows_the_albedo_of_every_shape() {
    let shapes = shapes();
    let mut suite = Suite::new(2 * shapes.len());
    for (name, geometry) in shapes {
        let mut scene = Builder::default();
        let grey = scene.diffuse(0.6, 0.0);
        scene.sky(1.0);
        let turned = Affine3A::from_scale_rotation_translation(
            Vec3::new(2.0, -2.0, 2.0),
            Quat::from_rotation_x(0.4),
            Vec3::new(20.0, -5.0, 3.0),
        );
        scene.add(geometry.clone(), grey);
        let eye = SPOT + Vec3::new(0.2, 0.3, 4.0);
        let picture = scene.look(eye, SPOT, 2);
        assert!(picture.alpha.mean() > 0.99, "{name} is not in the picture: {}", picture.alpha.mean());
        // The patch is a saddle and sees a little of itself, twice as dark where it does.
        let expected = |picture: &Picture| 1.0 - (1.0 - 0.6) * picture.alpha.mean();
        let convex = name != "patch";
        let judge = |suite: &mut Suite, picture: &Picture| {
            let p = picture.radiance.p_equals(expected(picture));
            suite.judge(if convex { p } else { picture.radiance.p_at_most(expected(picture)) }, name);
        };
        judge(&mut suite, &picture);
        scene.0.instances[0].to_world = turned;
        let place = |p: Vec3| turned.transform_point3(p);
        let picture = scene.look(place(eye), place(SPOT), 2);
        assert!(picture.alpha.mean() > 0.99, "{name} is not in the picture when placed");
        judge(&mut suite, &picture);
    }
}

/// One-sided emission leaves from the front, and from the back of what is flipped, also by next-event estimation.
#[test]
fn flipped_shapes_shine_to_the_other_side() {
    let mut all = shapes();
    all.push((
        "mesh",
        quad([[-1., -1., 0.], [1., -1., 0.], [1., 1., 0.], [-1., 1., 0.]].map(Vec3::from_array)),
    ));
    all.push(("whole sphere", Geometry::Sphere { center: Vec3::ZERO, radius: 1.0 }));
    for (name, geometry) in all {
        let faces_all = name.contains("curve") || name == "tube";
        for flipped in [false, true] {
            let mut scene = Builder::default();
            let glow = scene.diffuse(0.0, 3.0);
            scene.add(geometry.clone(), glow);
            scene.0.objects[0].shapes[0].flipped = flipped;
            let seen = |from: f32| scene.look(SPOT + Vec3::Z * from, SPOT, 1).radiance.mean();
            let expected = if flipped { [0.0, 3.0] } else { [3.0, 0.0] };
            let expected = match (faces_all, name) {
                // What faces every ray has no other side; from behind, a sphere shows its outside again.
                (true, _) => [expected[0]; 2],
                (_, "whole sphere") => [expected[0]; 2],
                _ => expected,
            };
            assert_eq!([seen(4.0), seen(-4.0)], expected, "{name}, flipped: {flipped}");
        }
    }
    for flipped in [false, true] {
        let mut scene = ground();
        let glow = scene.diffuse(0.0, 5.0);
        // Faces up: only when flipped does it light the ground below.
        scene.add(square(0.5, 1.0, true), glow);
        scene.0.objects.last_mut().expect("just added").shapes[0].flipped = flipped;
        let scene = Scene::build(&scene.0).expect("a sound scene");
        let lit = draw(&scene, Vec3::new(1.0, 0.3, -1.0), Vec3::ZERO, 2, 64).radiance;
        if !flipped {
            assert_eq!(lit.mean(), 0.0);
            continue;
        }
        let corners =
            [[-0.5, 0.5], [0.5, 0.5], [0.5, -0.5], [-0.5, -0.5]].map(|[x, z]| DVec3::new(x, 1.0, z));
        let irradiance = 5.0 * polygon_irradiance(&corners, DVec3::Y).abs();
        let expected = f64::from(GROUND_ALBEDO) / PI * irradiance;
        Suite::new(1).judge(lit.p_equals(expected), "flipped lamp");
    }
}

/// The frame's x axis is the direction in which u grows, its z axis the normal, and it is right-handed.
#[test]
fn frames_follow_the_texture_coordinates() {
    use crate::bvh::Ray;
    use crate::isa::{Isa, Job};
    struct Cast<'a>(&'a Scene, Ray);
    impl Job for Cast<'_> {
        type Output = Option<crate::bvh::Hit>;
        #[inline(always)]
        fn run<I: Isa>(self, isa: I) -> Self::Output {
            self.0.accel.closest(isa, &self.1, |_| true)
        }
    }
    let mirror = Affine3A::from_scale(Vec3::new(1.0, -1.0, 1.0));
    for (name, geometry) in shapes() {
        for to_world in [Affine3A::IDENTITY, mirror, Affine3A::from_rotation_x(0.7)] {
            let mut scene = Builder::default();
            let grey = scene.diffuse(0.5, 0.0);
            scene.place(geometry.clone(), grey, to_world);
            let scene = Scene::build(&scene.0).expect("a sound scene");
            let at = |offset: Vec3| {
                let target = to_world.transform_point3(SPOT + offset);
                let origin = to_world.transform_point3(SPOT + offset + Vec3::new(0.0, 0.0, 4.0));
                let ray = Ray::new(origin, (target - origin).normalize(), 0.0);
                let hit = Level::detect().run(Cast(&scene, ray)).expect("is hit");
                let surface = scene.interaction(&hit, &ray);
                let frame = scene.tangent_frame(&hit, surface.shading_normal, &ray);
                (surface, frame)
            };
            let (surface, frame) = at(Vec3::ZERO);
            assert!(frame.tangent.cross(frame.bitangent).dot(frame.normal) > 0.999, "{name}");
            // The texture coordinates are those of the frame, to first order.
            let h = 2e-3;
            for offset in [Vec3::X * h, Vec3::Y * h, Vec3::new(-h, h, 0.0)] {
                let (moved, _) = at(offset);
                let along = (moved.position - surface.position).dot(frame.tangent);
                let du = moved.surface.uv[0].x - surface.surface.uv[0].x;
                if along.abs() > 0.5 * h && !name.contains("sphere") && !name.contains("disk") {
                    assert!(along * du > 0.0, "{name} {to_world}: u changes by {du} over {along}");
                }
                let across = (moved.position - surface.position).dot(frame.bitangent);
                let dv = moved.surface.uv[0].y - surface.surface.uv[0].y;
                if name.contains("curve") || name == "tube" || name == "ribbon" {
                    let across = if name == "tube" {
                        (moved.shading_normal - surface.shading_normal).dot(frame.bitangent)
                    } else {
                        across
                    };
                    let enough = if name == "tube" { 1e-2 } else { 0.5 * h };
                    if across.abs() > enough {
                        assert!(across * dv > 0.0, "{name} {to_world}: v changes by {dv} over {across}");
                    }
                }
            }
        }
    }
}
