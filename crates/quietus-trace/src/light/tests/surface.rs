//! Points on quadrics and patches are chosen with the density they claim.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use glam::{Affine3A, Quat, Vec2, Vec3};

use crate::desc::Quadric;
use crate::light::{PatchLight, QuadricLight, SurfaceLight};
use crate::testing::{Mean, Rng, Suite};

/// A parametrised surface: from the unit square to a point.
type Surface = Box<dyn Fn(Vec2) -> Vec3>;

fn quadrics() -> Vec<(&'static str, Quadric, Surface)> {
    let (phi_max, radius) = (4.0_f32, 0.7_f32);
    let turn = move |u: Vec2| phi_max * u.x;
    vec![
        (
            "cap",
            Quadric::PartialSphere { radius, z_min: -0.2, z_max: 0.6, phi_max },
            Box::new(move |u| {
                let [low, high] = [(-0.2 / radius).asin(), (0.6 / radius).asin()];
                let latitude = low + u.y * (high - low);
                let ring = radius * latitude.cos();
                Vec3::new(ring * turn(u).cos(), ring * turn(u).sin(), radius * latitude.sin())
            }),
        ),
        (
            "ring",
            Quadric::Disk { height: 0.3, radius, inner_radius: 0.2, phi_max },
            Box::new(move |u| {
                let ring = 0.2 + u.y * (radius - 0.2);
                Vec3::new(ring * turn(u).cos(), ring * turn(u).sin(), 0.3)
            }),
        ),
        (
            "cylinder",
            Quadric::Cylinder { radius, z_min: -0.5, z_max: 0.4, phi_max },
            Box::new(move |u| Vec3::new(radius * turn(u).cos(), radius * turn(u).sin(), -0.5 + 0.9 * u.y)),
        ),
    ]
}

fn lights() -> Vec<(String, SurfaceLight, Surface)> {
    let turned = Quat::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -0.4);
    let skewed = Affine3A::from_scale_rotation_translation(Vec3::new(0.5, -1.5, 2.0), turned, Vec3::Y);
    let mut lights: Vec<(String, SurfaceLight, Surface)> = Vec::new();
    for (how, transform) in [("as it is", Affine3A::IDENTITY), ("skewed", skewed)] {
        for (name, quadric, surface) in quadrics() {
            let light = SurfaceLight::Quadric(QuadricLight::new(quadric, transform, false));
            let placed: Surface = Box::new(move |u| transform.transform_point3(surface(u)));
            lights.push((format!("{name} {how}"), light, placed));
        }
        let corners = [Vec3::ZERO, Vec3::X, Vec3::new(0.2, 1.5, 0.4), Vec3::new(1.4, 1.0, -0.3)];
        let light = SurfaceLight::Patch(PatchLight::new(corners, &transform, false));
        let placed: Surface = Box::new(move |u| {
            let [a, b, c, d] = corners;
            transform.transform_point3(a.lerp(b, u.x).lerp(c.lerp(d, u.x), u.y))
        });
        lights.push((format!("patch {how}"), light, placed));
    }
    lights
}

/// Some function of the point on the light.
fn test_function(p: Vec3) -> f64 {
    f64::from((1.3 * p.x + 0.4).sin() + p.y * p.y + 0.5 * p.z + 2.0)
}

/// The solid-angle integral of a function over the light, by quadrature over the surface's parameters.
fn quadrature(surface: &Surface, from: Vec3) -> f64 {
    const STEPS: u32 = 400;
    const H: f32 = 1e-3;
    let mut sum = 0.0;
    for i in 0..STEPS * STEPS {
        let u = (Vec2::new((i % STEPS) as f32, (i / STEPS) as f32) + 0.5) / STEPS as f32;
        let [du, dv] = [Vec2::X, Vec2::Y].map(|step| {
            let [a, b] = [surface(u + H * step), surface(u - H * step)];
            (a.as_dvec3() - b.as_dvec3()) / (2.0 * f64::from(H))
        });
        let to_light = surface(u).as_dvec3() - from.as_dvec3();
        // |cos| dA / d^2, the cosine's normal being that of the area.
        let solid_angle = du.cross(dv).dot(to_light).abs() / to_light.length().powi(3);
        sum += solid_angle * test_function(surface(u));
    }
    sum / f64::from(STEPS * STEPS)
}

#[test]
fn samples_integrate_over_the_solid_angle() {
    let lights = lights();
    let mut suite = Suite::new(lights.len());
    let from = Vec3::new(2.5, 2.0, 1.0);
    for (seed, (name, light, surface)) in (0u64..).zip(&lights) {
        let mut rng = Rng::new(seed);
        let estimate = Mean::of(40_000, || {
            let u = rng.next_2d();
            light.sample(from, u).map_or(0.0, |sample| {
                let distance = sample.target.position.distance(from);
                // The point lies where the surface is, and a ray that finds it there learns the same density.
                let again = light.pdf(sample.direction, distance, sample.target.normal, u);
                assert!((again - sample.pdf).abs() <= 1e-4 * sample.pdf, "{name}: {again}, {}", sample.pdf);
                test_function(sample.target.position) / f64::from(sample.pdf)
            })
        });
        suite.judge(estimate.p_equals(quadrature(surface, from)), name);
    }
}

/// Which side is seen follows the normal, mirrors keep the front the front, and flipping exchanges the sides.
#[test]
fn fronts_are_where_the_description_says() {
    let mirror = Affine3A::from_scale(Vec3::new(1.0, 1.0, -1.0));
    for flipped in [false, true] {
        for (transform, up) in [(Affine3A::IDENTITY, 1.0), (mirror, -1.0)] {
            let disk = Quadric::Disk { height: 0.0, radius: 1.0, inner_radius: 0.0, phi_max: TAU };
            let square = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(1.0, 1.0, 0.0)];
            let lights = [
                SurfaceLight::Quadric(QuadricLight::new(disk, transform, flipped)),
                SurfaceLight::Patch(PatchLight::new(square, &transform, flipped)),
            ];
            for light in lights {
                let above = Vec3::new(0.3, 0.4, 2.0 * up);
                let sample = light.sample(above, Vec2::new(0.4, 0.6)).expect("not on the light");
                assert_eq!(sample.front, !flipped, "{light:?}");
                assert_eq!(sample.target.normal.z > 0.0, (up > 0.0) != flipped);
            }
        }
    }
    let tube = Quadric::Cylinder { radius: 1.0, z_min: -1.0, z_max: 1.0, phi_max: FRAC_PI_2 };
    let tube = SurfaceLight::Quadric(QuadricLight::new(tube, Affine3A::from_rotation_z(PI), false));
    assert!(tube.sample(Vec3::new(-3.0, -3.0, 0.0), Vec2::splat(0.5)).expect("seen").front);
    assert!(!tube.sample(Vec3::ZERO, Vec2::splat(0.5)).expect("seen").front);
}
