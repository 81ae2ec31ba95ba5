//! Direct light of lights of every kind, against their irradiance in closed form.

use super::*;

#[test]
fn direct_light_matches_form_factors() {
    let mut suite = Suite::new(7);
    // A sphere above the horizon: E = pi L sin^2(half angle) cos(angle of its centre).
    let (center, radius) = (Vec3::new(0.6, 2.0, -0.8), 0.7_f32);
    let sphere_irradiance = |radius: f32| {
        let distance2 = f64::from(center.length_squared());
        PI * f64::from(radius).powi(2) / distance2 * f64::from(center.y) / distance2.sqrt()
    };
    let mut scene = ground();
    let lamp = scene.diffuse(0.0, 3.0);
    scene.sphere(center, radius, lamp);
    judge_irradiance(&mut suite, &scene, 3.0 * sphere_irradiance(radius), "sphere");

    let mut scene = ground();
    let lamp = scene.diffuse(0.0, 3.0);
    let scaled =
        Affine3A::from_scale_rotation_translation(Vec3::splat(-0.35), Quat::from_rotation_x(1.0), center);
    scene.place(Geometry::Sphere { center: Vec3::ZERO, radius: 2.0 }, lamp, scaled);
    judge_irradiance(&mut suite, &scene, 3.0 * sphere_irradiance(0.7), "mirrored and scaled sphere");

    let corners = [[-0.3, 1.5, 0.9], [0.9, 1.5, 0.9], [0.9, 1.0, -0.4], [-0.3, 1.0, -0.4]];
    let lamp_corners = corners.map(|[x, y, z]| Vec3::new(x, y, z));
    let exact = polygon_irradiance(&lamp_corners.map(Vec3::as_dvec3), DVec3::Y);
    let [a, b, c, d] = lamp_corners;
    for (corners, irradiance, what) in
        [([d, c, b, a], 2.0 * exact, "rectangle"), ([a, b, c, d], 0.0, "its back")]
    {
        let mut scene = ground();
        let lamp = scene.diffuse(0.0, 2.0);
        scene.add(quad(corners), lamp);
        judge_irradiance(&mut suite, &scene, irradiance, what);
    }
    let mut scene = ground();
    let lamp = scene.diffuse(0.0, 2.0);
    scene.0.materials[lamp.0 as usize].emission_two_sided = true;
    scene.add(quad(lamp_corners), lamp);
    judge_irradiance(&mut suite, &scene, 2.0 * exact, "the back of a two-sided rectangle");

    let mut scene = ground();
    let (position, intensity) = (Vec3::new(0.5, 1.5, 0.3), Vec3::splat(4.0));
    scene.0.lights.push(desc::Light::Point { position, intensity });
    let distance2 = f64::from(position.length_squared());
    let irradiance = 4.0 * f64::from(position.y) / distance2.powf(1.5);
    judge_irradiance(&mut suite, &scene, irradiance, "point light");

    let mut scene = ground();
    let direction = Vec3::new(0.3, -0.8, 0.1).normalize();
    scene.0.lights.push(desc::Light::Directional { direction, irradiance: Vec3::splat(5.0) });
    judge_irradiance(&mut suite, &scene, -5.0 * f64::from(direction.y), "directional light");

    let mut scene = ground();
    scene.sky(2.0);
    judge_irradiance(&mut suite, &scene, 2.0 * PI, "sky");
}

/// All kinds of light at once: whoever picks the light must divide by the right probability.
#[test]
fn lights_add_up() {
    let mut scene = ground();
    let lamp = scene.diffuse(0.0, 3.0);
    let mut expected = PI;
    scene.sky(1.0);
    for (i, x) in [-2.0_f32, -1.0, 1.5].into_iter().enumerate() {
        let (center, radius) = (Vec3::new(x, 2.0 + i as f32, 1.0), 0.3_f32);
        scene.sphere(center, radius, lamp);
        let (distance2, height) = (f64::from(center.length_squared()), f64::from(center.y));
        // The lamps hide a part of the sky and shine with 3 instead.
        expected += (3.0 - 1.0) * PI * f64::from(radius).powi(2) / distance2 * height / distance2.sqrt();
    }
    let position = Vec3::new(0.3, 1.0, -0.5);
    scene.0.lights.push(desc::Light::Point { position, intensity: Vec3::splat(0.8) });
    expected += 0.8 * f64::from(position.y) / f64::from(position.length_squared()).powf(1.5);
    judge_irradiance(&mut Suite::new(1), &scene, expected, "sky, three spheres, a point light");
}

/// A disc of radius R at height h over the ground: `E = pi L R^2 / (R^2 + h^2)`. The polygon that stands for it has
/// so many corners that it lacks less than a millionth.
#[test]
fn direct_light_of_a_disc() {
    const CORNERS: u32 = 4096;
    let (radius, height) = (0.8_f32, 1.1_f32);
    let corner = |i: u32| {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / f64::from(CORNERS)).sin_cos();
        Vec3::new(radius * cos as f32, height, radius * sin as f32)
    };
    let disc = Mesh {
        positions: (0..CORNERS).map(corner).chain([Vec3::Y * height]).collect(),
        triangles: (0..CORNERS).map(|i| [i, (i + 1) % CORNERS, CORNERS]).collect(),
        ..Mesh::default()
    };
    let mut scene = ground();
    let lamp = scene.diffuse(0.0, 2.0);
    scene.0.materials[lamp.0 as usize].emission_two_sided = true;
    scene.add(Geometry::Mesh(Arc::new(disc)), lamp);
    let (r2, h2) = (f64::from(radius).powi(2), f64::from(height).powi(2));
    let irradiance = 2.0 * PI * r2 / (r2 + h2);
    judge_irradiance(&mut Suite::new(1), &scene, irradiance, "disc");
}

/// Inside the cone, at its soft edge (KHR_lights_punctual: the square of a ramp in the cosine), and outside.
#[test]
fn direct_light_of_a_spot() {
    let (inner_angle, outer_angle) = (0.3_f32, 0.7_f32);
    let position = Vec3::new(0.5, 1.5, 0.3);
    let to_ground = -position.normalize();
    let distance2 = f64::from(position.length_squared());
    let mut suite = Suite::new(2);
    for (off_axis, what) in [(0.2_f32, "inside"), (0.5, "at the edge"), (0.8, "outside")] {
        let axis = to_ground.any_orthonormal_vector();
        let mut scene = ground();
        scene.0.lights.push(desc::Light::Spot {
            position,
            direction: Quat::from_axis_angle(axis, off_axis) * to_ground,
            intensity: Vec3::splat(4.0),
            inner_angle,
            outer_angle,
            falloff: desc::SpotFalloff::Square,
        });
        let [at, inner, outer] = [off_axis, inner_angle, outer_angle].map(|a| f64::from(a).cos());
        let ramp = ((at - outer) / (inner - outer)).clamp(0.0, 1.0);
        let irradiance = ramp * ramp * 4.0 * f64::from(position.y) / distance2.powf(1.5);
        judge_irradiance(&mut suite, &scene, irradiance, what);
    }
}
