//! Light of emitters of every shape, still, flipped and moving, against what can be derived or summed up.

use std::f64::consts::{PI, TAU};

use glam::{Affine3A, DVec3, Quat, Vec3};

use super::*;
use crate::desc::{Instance, PatchMesh, Quadric};

impl Builder {
    /// Exchanges front and back of the last shape.
    fn flip(&mut self) {
        self.0.objects.last_mut().expect("a shape").shapes[0].flipped = true;
    }

    /// Lets the last instance move.
    fn moving_to(&mut self, end: Affine3A) {
        let instance: &mut Instance = self.0.instances.last_mut().expect("an instance");
        instance.end_to_world = Some(end);
    }
}

/// A transform that takes the z axis to `-y`, and the origin to `center`.
fn facing_down(center: Vec3) -> Affine3A {
    Affine3A::from_rotation_translation(Quat::from_rotation_x(std::f32::consts::FRAC_PI_2), center)
}

/// Irradiance at the origin, facing up, of a surface of radiance 1 that shines along `du x dv`, by quadrature over its
/// parameters.
fn surface_irradiance(point: impl Fn(f64, f64) -> DVec3) -> f64 {
    const STEPS: u32 = 600;
    const H: f64 = 1e-5;
    let mut sum = 0.0;
    for i in 0..STEPS * STEPS {
        let [u, v] = [i % STEPS, i / STEPS].map(|i| (f64::from(i) + 0.5) / f64::from(STEPS));
        let du = (point(u + H, v) - point(u - H, v)) / (2.0 * H);
        let dv = (point(u, v + H) - point(u, v - H)) / (2.0 * H);
        let p = point(u, v);
        let distance = p.length();
        let leaving = -du.cross(dv).dot(p) / distance;
        sum += leaving.max(0.0) * (p.y / distance).max(0.0) / (distance * distance);
    }
    sum / f64::from(STEPS * STEPS)
}

#[test]
fn quadrics_and_patches_light_the_ground() {
    let mut suite = Suite::new(7);
    let (radius, height) = (0.8_f32, 1.1_f32);
    let [r, h] = [f64::from(radius), f64::from(height)];
    let disk = Quadric::Disk { height: 0.0, radius, inner_radius: 0.3, phi_max: TAU as f32 };
    let ring = |r: f64| PI * r * r / (r * r + h * h);
    for (flipped, expected) in [(false, ring(r) - ring(0.3)), (true, 0.0)] {
        let mut scene = ground();
        let lamp = scene.diffuse(0.0, 2.0);
        scene.place(Geometry::Quadric(disk), lamp, facing_down(Vec3::Y * height));
        if flipped {
            scene.flip();
        }
        judge_irradiance(&mut suite, &scene, 2.0 * expected, "ring");
    }
    let center = Vec3::new(0.6, 2.0, -0.8);
    let ball = Quadric::PartialSphere { radius: 0.7, z_min: -0.7, z_max: 0.7, phi_max: TAU as f32 };
    let mut scene = ground();
    let lamp = scene.diffuse(0.0, 3.0);
    scene.place(Geometry::Quadric(ball), lamp, Affine3A::from_translation(center));
    let distance2 = f64::from(center.length_squared());
    let expected = 3.0 * PI * 0.49 / distance2 * f64::from(center.y) / distance2.sqrt();
    judge_irradiance(&mut suite, &scene, expected, "a sphere as a quadric");

    let half = Quadric::Cylinder { radius: 0.4, z_min: -0.5, z_max: 0.7, phi_max: 4.0 };
    let squeezed = Affine3A::from_scale_rotation_translation(
        Vec3::new(1.0, 0.5, 1.5),
        Quat::from_rotation_y(0.4),
        Vec3::new(0.3, 1.5, 0.2),
    );
    let mut scene = ground();
    let lamp = scene.diffuse(0.0, 1.0);
    scene.place(Geometry::Quadric(half), lamp, squeezed);
    let on_cylinder = |u: f64, v: f64| {
        let (sin, cos) = (4.0 * u).sin_cos();
        // In double precision, or differences of neighbours are noise.
        let m = squeezed.matrix3;
        let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis].map(|a| Vec3::from(a).as_dvec3());
        let [a, b, c] = [0.4 * cos, 0.4 * sin, -0.5 + 1.2 * v];
        x * a + y * b + z * c + Vec3::from(squeezed.translation).as_dvec3()
    };
    // The inner side is dark and hides part of the outer one, but from below only behind the horizon of the outside.
    let expected = surface_irradiance(on_cylinder);
    judge_irradiance(&mut suite, &scene, expected, "an open cylinder, squeezed");

    let corners = [[-0.3, 1.5, 0.9], [0.9, 1.2, 0.8], [-0.4, 1.0, -0.4], [0.8, 1.4, -0.5]];
    let patch = PatchMesh {
        positions: corners.map(|p| Vec3::from_array(p.map(|x: f64| x as f32))).to_vec(),
        patches: vec![[0, 1, 2, 3]],
        ..PatchMesh::default()
    };
    let [a, b, c, d] = corners.map(DVec3::from_array);
    let on_patch = |u: f64, v: f64| a.lerp(b, u).lerp(c.lerp(d, u), v);
    // Its normal points up: what shines down is its back.
    let shines_down = surface_irradiance(|u, v| on_patch(v, u));
    for (flipped, two_sided, expected) in
        [(false, false, 0.0), (true, false, shines_down), (false, true, shines_down)]
    {
        let mut scene = ground();
        let lamp = scene.diffuse(0.0, 2.0);
        scene.0.materials[lamp.0 as usize].emission_two_sided = two_sided;
        scene.add(Geometry::Patches(Arc::new(patch.clone())), lamp);
        if flipped {
            scene.flip();
        }
        judge_irradiance(&mut suite, &scene, 2.0 * expected, "patch");
    }
    // Two of the pictures had to be black, which is judged without a p-value.
    (0..2).for_each(|_| suite.judge(1.0, "black"));
}

/// Lamps that move along a line, turn, or change their form: the ground gets the mean over the shutter's time.
#[test]
fn moving_lamps_light_the_ground_on_average() {
    const TIMES: u32 = 2000;
    let mean = |at: &dyn Fn(f64) -> f64| {
        (0..TIMES).map(|i| at((f64::from(i) + 0.5) / f64::from(TIMES))).sum::<f64>() / f64::from(TIMES)
    };
    let mut suite = Suite::new(3);
    let [start, end] = [Vec3::new(-1.0, 0.8, 0.3), Vec3::new(1.5, 1.6, -0.2)];
    let mut scene = ground();
    let lamp = scene.diffuse(0.0, 9.0);
    let sphere = Geometry::Sphere { center: Vec3::ZERO, radius: 0.2 };
    scene.place(sphere, lamp, Affine3A::from_translation(start));
    scene.moving_to(Affine3A::from_translation(end));
    let of_sphere = |time: f64| {
        let center = start.as_dvec3().lerp(end.as_dvec3(), time);
        9.0 * PI * 0.04 * center.y / center.length().powi(3)
    };
    judge_irradiance(&mut suite, &scene, mean(&of_sphere), "a sphere on its way");

    let mut scene = ground();
    let lamp = scene.diffuse(0.0, 4.0);
    scene.0.materials[lamp.0 as usize].emission_two_sided = true;
    let square = [[-0.2, 0.0, -0.2], [0.2, 0.0, -0.2], [0.2, 0.0, 0.2], [-0.2, 0.0, 0.2]];
    let place = |angle: f32| Affine3A::from_rotation_translation(Quat::from_rotation_x(angle), Vec3::Y * 1.2);
    scene.place(quad(square.map(|p| Vec3::from_array(p.map(|x: f64| x as f32)))), lamp, place(0.2));
    scene.moving_to(place(1.4));
    let of_turning = |time: f64| {
        let (sin, cos) = (0.2 + 1.2 * time).sin_cos();
        let turned = square.map(|[x, y, z]| DVec3::new(x, 1.2 + cos * y - sin * z, sin * y + cos * z));
        4.0 * polygon_irradiance(&turned, DVec3::Y)
    };
    judge_irradiance(&mut suite, &scene, mean(&of_turning), "a square that turns");

    let mut scene = ground();
    let lamp = scene.diffuse(0.0, 4.0);
    scene.0.materials[lamp.0 as usize].emission_two_sided = true;
    let [before, after] = [
        [[-0.3, 1.0, 0.1], [0.2, 1.1, 0.3], [0.1, 1.3, -0.4]],
        [[0.6, 0.9, 0.2], [1.0, 1.4, 0.3], [0.5, 1.2, -0.1]],
    ];
    let positions = |corners: [[f64; 3]; 3]| corners.map(|p| Vec3::from_array(p.map(|x| x as f32))).to_vec();
    let mesh = Mesh {
        positions: positions(before),
        end_positions: positions(after),
        triangles: vec![[0, 1, 2]],
        ..Mesh::default()
    };
    scene.add(Geometry::Mesh(Arc::new(mesh)), lamp);
    let of_triangle = |time: f64| {
        let corner = |i: usize| DVec3::from_array(before[i]).lerp(DVec3::from_array(after[i]), time);
        4.0 * polygon_irradiance(&[corner(0), corner(1), corner(2)], DVec3::Y)
    };
    judge_irradiance(&mut suite, &scene, mean(&of_triangle), "a triangle that changes its form");
}

/// What moves is found by light sampling, not by chance alone: the sphere above fills 0.3 % of the sky, and chance alone
/// would leave a relative variance of some hundreds.
#[test]
fn moving_lamps_are_sampled() {
    let mut scene = ground();
    let lamp = scene.diffuse(0.0, 9.0);
    let sphere = Geometry::Sphere { center: Vec3::ZERO, radius: 0.1 };
    scene.place(sphere, lamp, Affine3A::from_translation(Vec3::new(-0.3, 1.0, 0.0)));
    scene.moving_to(Affine3A::from_translation(Vec3::new(0.3, 1.0, 0.0)));
    let picture = scene.look(Vec3::new(1.0, 1.3, 0.2), Vec3::ZERO, 2);
    let relative = picture.radiance.variance() / picture.radiance.mean().powi(2);
    assert!(relative < 0.1, "relative variance {relative}");
}

/// A lamp that is never hit lights the ground as one that can be, with a picture on it too, and is not seen.
#[test]
fn unseen_lamps_shine() {
    let picture = |alpha: Alpha, target: Vec3| {
        let mut scene = ground();
        let lamp = scene.material(diffuse(0.0), 2.0, alpha);
        scene.sphere(Vec3::Y * 1.5, 0.5, lamp);
        scene.look(Vec3::new(0.0, 0.4, 0.6), target, 2)
    };
    let brightness = |picture: &Picture| {
        let mut mean = Mean::default();
        picture.samples.iter().for_each(|sample| mean.push(f64::from(sample.radiance.y)));
        mean
    };
    let [seen, unseen] = [Alpha::Opaque, Alpha::Unseen].map(|alpha| picture(alpha, Vec3::ZERO));
    let mut suite = Suite::new(1);
    suite.judge(brightness(&seen).p_same(&brightness(&unseen)), "the ground");
    let lamp = picture(Alpha::Unseen, Vec3::Y * 1.5);
    assert!(lamp.samples.iter().all(|sample| sample.radiance == Vec3::ZERO), "the lamp itself");
}

/// The rectangle `from + u * du + v * dv` as a patch and as two triangles.
fn rectangle(from: Vec3, du: Vec3, dv: Vec3) -> [Geometry; 2] {
    let positions = vec![from, from + du, from + dv, from + du + dv];
    let patches = PatchMesh { positions, patches: vec![[0, 1, 2, 3]], ..PatchMesh::default() };
    [Geometry::Patches(Arc::new(patches)), quad([from, from + du, from + du + dv, from + dv])]
}

/// What lies exactly in a plane of the axes through the origin neither shadows itself nor hides its own light, near or far:
/// along one axis nothing is rounded there, along the others it is.
#[test]
fn patches_in_planes_of_the_axes_light_and_are_lit_as_triangles() {
    let far = [0.4, 3.0, 40.0];
    let mut suite = Suite::new(3 * far.len());
    for distance in far {
        let [patch, triangles] = rectangle(Vec3::new(-1.0, 1.0, 0.0), 2.0 * Vec3::X, 1.6 * Vec3::Y);
        let [floor, _] = rectangle(Vec3::new(-50.0, 0.0, -50.0), 100.0 * Vec3::Z, 100.0 * Vec3::X);
        let picture = |lamp: &Geometry, floor: Option<&Geometry>| {
            let mut scene = match floor {
                None => ground(),
                Some(floor) => {
                    let mut scene = Builder::default();
                    let material = scene.diffuse(GROUND_ALBEDO, 0.0);
                    scene.add(floor.clone(), material);
                    scene
                }
            };
            let shine = scene.diffuse(0.0, 2.0);
            scene.add(lamp.clone(), shine);
            let spot = Vec3::new(0.37, 0.0, distance);
            scene.look(spot + Vec3::new(0.2, 0.5, 0.1), spot, 2)
        };
        let expected = picture(&triangles, None);
        suite.judge(picture(&patch, None).radiance.p_same(&expected.radiance), "light of a patch");
        suite.judge(picture(&triangles, Some(&floor)).radiance.p_same(&expected.radiance), "on a patch");
        suite.judge(picture(&patch, Some(&floor)).radiance.p_same(&expected.radiance), "both");
    }
}

/// The same of a disk, under an even sky.
#[test]
fn disks_at_height_0_are_not_in_their_own_shadow() {
    let disk = Quadric::Disk { height: 0.0, radius: 7.0, inner_radius: 0.0, phi_max: TAU as f32 };
    let mut suite = Suite::new(3);
    for x in [0.1, 2.0, 6.5] {
        let mut scene = Builder::default();
        let grey = scene.diffuse(0.6, 0.0);
        scene.sky(1.0);
        scene.add(Geometry::Quadric(disk), grey);
        let spot = Vec3::new(x, 0.3, 0.0);
        let picture = scene.look(spot + Vec3::new(0.3, 0.1, 1.0), spot, 2);
        suite.judge(picture.radiance.p_equals(f64::from(0.6_f32)), format_args!("at {x}"));
    }
}
