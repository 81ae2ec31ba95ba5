//! Scenes whose answer can be derived, drawn by the whole tracer.

mod direct;
mod emitters;
mod motion;
mod shapes;
mod subsurface;
mod surfaces;
mod textures;
mod volume;

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{Affine3A, DVec3, Mat3, Quat, Vec3};

use crate::desc::{
    self, Alpha, ColorParam, Geometry, Image, Material, MaterialId, Mesh, Metal, ObjectId, Roughness,
    ScalarParam, Surface, Texels,
};
use crate::filter::Filter;
use crate::isa::Level;
use crate::scene::Scene;
use crate::testing::{Mean, Rng, Suite};
use crate::tile::{PixelWork, Sample, SampleSink, render_tile};
use crate::view::View;

#[test]
fn weights_are_numbers_whatever_underflows() {
    for (own, other, expected) in
        [(0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1e-30, 0.0, 1.0), (3e38, 3e38, 0.5), (1e-45, 3e38, 0.0)]
    {
        assert_eq!(super::power_heuristic(own, other), expected, "{own} {other}");
    }
}

/// A scene under construction.
#[derive(Default)]
struct Builder(desc::SceneDesc);

impl Builder {
    fn material(&mut self, surface: Surface, emission: f32, alpha: Alpha) -> MaterialId {
        self.0.materials.push(Material {
            name: String::new(),
            surface,
            emission: ColorParam::constant(Vec3::splat(emission)),
            emission_two_sided: false,
            normal_map: None,
            bump: None,
            alpha,
        });
        MaterialId(self.0.materials.len() as u32 - 1)
    }

    fn diffuse(&mut self, albedo: f32, emission: f32) -> MaterialId {
        self.material(diffuse(albedo), emission, Alpha::Opaque)
    }

    fn place(&mut self, geometry: Geometry, material: MaterialId, to_world: Affine3A) {
        let object = ObjectId(self.0.objects.len() as u32);
        let shapes = vec![desc::Shape::new(geometry, material)];
        self.0.objects.push(desc::Object { name: String::new(), shapes });
        self.0.instances.push(desc::Instance::still(object, to_world));
    }

    fn add(&mut self, geometry: Geometry, material: MaterialId) {
        self.place(geometry, material, Affine3A::IDENTITY);
    }

    fn sphere(&mut self, center: Vec3, radius: f32, material: MaterialId) {
        self.add(Geometry::Sphere { center, radius }, material);
    }

    fn sky(&mut self, radiance: f32) {
        let scale = Vec3::splat(radiance);
        self.0.environment = Some(desc::Environment {
            layout: crate::desc::EnvironmentLayout::LatLong,
            image: None,
            scale,
            to_world: Mat3::IDENTITY,
            portal: None,
        });
    }

    /// What comes from `target` to `eye`, sample by independent sample.
    fn look(&self, eye: Vec3, target: Vec3, max_depth: u32) -> Picture {
        let scene = Scene::build(&self.0).expect("a sound scene");
        draw(&scene, eye, target, max_depth, 64)
    }
}

fn diffuse(albedo: f32) -> Surface {
    Surface::Diffuse { reflectance: ColorParam::constant(Vec3::splat(albedo)) }
}

fn glass(ior: f32, roughness: f32) -> Surface {
    Surface::Dielectric {
        ior,
        roughness: Roughness::perceptual(ScalarParam::constant(roughness)),
        tint: ColorParam::constant(Vec3::ONE),
    }
}

fn quad(corners: [Vec3; 4]) -> Geometry {
    Geometry::Mesh(Arc::new(Mesh {
        positions: corners.to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }))
}

/// The square of half size `half` in the plane y = `y`, facing up or down.
fn square(half: f32, y: f32, up: bool) -> Geometry {
    let at = |x: f32, z: f32| Vec3::new(x * half, y, z * half);
    let corners = [at(-1., 1.), at(1., 1.), at(1., -1.), at(-1., -1.)];
    quad(if up { corners } else { [corners[3], corners[2], corners[1], corners[0]] })
}

/// Samples of a bundle of rays narrow enough to see one point.
#[derive(Default)]
struct Picture {
    radiance: Mean,
    alpha: Mean,
    samples: Vec<Sample>,
}

impl SampleSink for Picture {
    fn add(&mut self, _: &PixelWork, _: u32, sample: &Sample) {
        self.radiance.push(f64::from(sample.radiance.y));
        self.alpha.push(f64::from(sample.alpha));
        self.samples.push(*sample);
    }
}

fn view(eye: Vec3, target: Vec3, size: u32, fov_y: f32, max_depth: u32) -> View {
    let back = (eye - target).normalize();
    let right = back.any_orthonormal_vector();
    let rotation = Mat3::from_cols(right, back.cross(right), back);
    let camera = desc::Camera::perspective("", Affine3A::from_mat3_translation(rotation, eye), fov_y);
    View::new(&camera, [size, size], Filter::BOX, max_depth, 1).expect("a sound view")
}

/// Every pixel and replicate has its own scramble: the first sample of each is independent of all others.
fn draw(scene: &Scene, eye: Vec3, target: Vec3, max_depth: u32, size: u32) -> Picture {
    let view = view(eye, target, size, 1e-3, max_depth);
    let mut picture = Picture::default();
    for y in 0..size {
        let work = |x: u32, replicate: u8| PixelWork { x, y, pixel: 0, replicate, first: 0, count: 1 };
        let row: Vec<_> = (0..size).flat_map(|x| (0..8).map(move |r| work(x, r))).collect();
        render_tile(scene, &view, &row, &mut picture);
    }
    picture
}

/// A closed room of albedo a that emits e: each bounce adds the same light again, `e (1 - a^depth) / (1 - a)`.
#[test]
fn furnace_room_adds_up_its_bounces() {
    let (albedo, emission) = (0.6, 0.5);
    let mut room = Builder::default();
    let wall = room.diffuse(albedo, emission);
    for turn in 0..6 {
        let rotation = match turn {
            0..4 => Quat::from_rotation_z(turn as f32 * std::f32::consts::FRAC_PI_2),
            4 => Quat::from_rotation_x(std::f32::consts::FRAC_PI_2),
            _ => Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2),
        };
        room.place(square(1.0, -1.0, true), wall, Affine3A::from_quat(rotation));
    }
    let mut suite = Suite::new(5);
    for depth in [1, 2, 3, 5, 8] {
        let picture = room.look(Vec3::new(0.1, 0.2, -0.3), Vec3::new(0.3, -1.0, 0.4), depth);
        let (a, e) = (f64::from(albedo), f64::from(emission));
        let expected = e * (1.0 - a.powi(depth as i32)) / (1.0 - a);
        suite.judge(picture.radiance.p_equals(expected), format_args!("depth {depth}"));
    }
}

const GROUND_ALBEDO: f32 = 0.7;

/// A plane y = 0 that shines nothing back on any light.
fn ground() -> Builder {
    let mut scene = Builder::default();
    let material = scene.diffuse(GROUND_ALBEDO, 0.0);
    scene.add(square(50.0, 0.0, true), material);
    scene
}

/// Judges direct light on the origin of the ground by its irradiance.
fn judge_irradiance(suite: &mut Suite, scene: &Builder, irradiance: f64, what: &str) {
    let expected = f64::from(GROUND_ALBEDO) / PI * irradiance;
    let picture = scene.look(Vec3::new(1.0, 1.3, 0.2), Vec3::ZERO, 2);
    if irradiance == 0.0 {
        assert!(picture.samples.iter().all(|s| s.radiance == Vec3::ZERO), "{what}: not black");
        return;
    }
    suite.judge(picture.radiance.p_equals(expected), what);
}

/// Irradiance from a polygon of radiance 1 (Lambert 1760): half the sum over its edges of the angle they fill times
/// the cosine between the surface's normal and the normal of the plane through the edge.
fn polygon_irradiance(corners: &[DVec3], normal: DVec3) -> f64 {
    let edge = |i: usize| {
        let (a, b) = (corners[i].normalize(), corners[(i + 1) % corners.len()].normalize());
        a.cross(b).normalize().dot(normal) * a.dot(b).acos()
    };
    (0.5 * (0..corners.len()).map(edge).sum::<f64>()).abs()
}

/// Under a sky of radiance 1 a convex object shows its directional albedo, here averaged from its BSDF alone.
#[test]
fn sky_furnace_shows_the_albedo_of_every_material() {
    let scalar = ScalarParam::constant;
    let gold = [Vec3::new(0.143, 0.375, 1.442), Vec3::new(3.983, 2.386, 1.603)];
    let metal = |roughness| Surface::Conductor {
        metal: Metal::Index { eta: gold[0], k: gold[1] },
        roughness: Roughness::perceptual(scalar(roughness)),
    };
    let principled = |metallic, roughness, clearcoat| {
        Surface::MetalRough(Box::new(desc::MetalRough {
            base_color: ColorParam::constant(Vec3::new(0.8, 0.5, 0.2)),
            metallic: scalar(metallic),
            roughness: scalar(roughness),
            clearcoat: scalar(clearcoat),
            clearcoat_roughness: scalar(0.1),
            ..desc::MetalRough::default()
        }))
    };
    let surfaces = [
        diffuse(0.8),
        metal(0.0),
        metal(0.4),
        metal(1.0),
        principled(0.0, 0.5, 0.0),
        principled(1.0, 0.3, 0.0),
        principled(0.3, 0.6, 1.0),
    ];
    let (eye, target) = (Vec3::new(0.0, 0.0, 3.0), Vec3::new(0.5, 0.3, 0.0));
    let mut suite = Suite::new(surfaces.len());
    for surface in surfaces {
        let mut scene = Builder::default();
        scene.sky(1.0);
        let material = scene.material(surface.clone(), 0.0, Alpha::Opaque);
        let target = target.normalize() * 0.5 + Vec3::new(0.0, 0.0, 0.75_f32.sqrt());
        scene.sphere(Vec3::ZERO, 1.0, material);
        let compiled = Scene::build(&scene.0).expect("a sound scene");
        let bsdf = compiled.materials.bsdf(material, &crate::material::SurfacePoint::default(), 0);
        let wo = (eye - target).normalize();
        let wo = crate::frame::Frame::from_normal(target.normalize()).to_local(wo);
        let mut rng = Rng::new(9);
        let albedo = Mean::of(40_000, || {
            bsdf.sample(wo, rng.next_1d(), rng.next_2d()).map_or(0.0, |s| f64::from(s.weight.y))
        });
        let picture = draw(&compiled, eye, target, 3, 64);
        suite.judge(picture.radiance.p_same(&albedo), format_args!("{surface:?}"));
    }
}

/// Glass takes no light away: under a sky of radiance 1 it cannot be seen. Rays that end inside, or are refracted
/// with the wrong index on the way out, would show.
#[test]
fn smooth_glass_is_invisible_under_an_even_sky() {
    let mut scene = Builder::default();
    scene.sky(1.0);
    let outer = scene.material(glass(1.5, 0.0), 0.0, Alpha::Opaque);
    // A bubble in the glass: its normal points into the glass, and the index inside over outside is 1 / 1.5.
    let bubble = scene.material(glass(1.0 / 1.5, 0.0), 0.0, Alpha::Opaque);
    scene.sphere(Vec3::ZERO, 1.0, outer);
    scene.sphere(Vec3::new(0.1, 0.0, 0.2), 0.5, bubble);
    let mut suite = Suite::new(3);
    for (eye, what) in [
        (Vec3::new(0.0, 0.0, 3.0), "from outside"),
        (Vec3::new(-0.7, 0.1, 0.2), "from within the glass"),
        (Vec3::new(0.1, 0.0, 0.2), "from the bubble"),
    ] {
        let picture = scene.look(eye, Vec3::new(0.4, 0.2, -0.2), 200);
        suite
            .judge(picture.radiance.p_equals(if what == "from within the glass" { 2.25 } else { 1.0 }), what);
    }
}

/// Reflectance of a smooth surface for unpolarised light at cosine `cos_i`, `eta` the index behind over before.
fn fresnel(cos_i: f64, eta: f64) -> f64 {
    let cos_t = (1.0 - (1.0 - cos_i * cos_i) / (eta * eta)).sqrt();
    let perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    let parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    0.5 * (perpendicular * perpendicular + parallel * parallel)
}

/// Reflectance of a smooth pane of index 1.5 with all its inner reflections, unpolarised per reflection as the
/// tracer has it: `2 F / (1 + F)`.
fn pane_reflectance(cos_i: f64) -> f64 {
    let f = fresnel(cos_i, 1.5);
    2.0 * f / (1.0 + f)
}

/// Light through a pane onto the ground can only be found by chance. With R the pane's reflectance for diffuse
/// light, the sky gives `pi (1 - R)` and what the ground sends up comes back R times: `E = pi (1 - R) / (1 - a R)`.
#[test]
fn light_through_a_pane_arrives() {
    let steps = 20_000;
    let reflectance: f64 = (0..steps)
        .map(|i| (f64::from(i) + 0.5) / f64::from(steps))
        .map(|cos2| pane_reflectance(cos2.sqrt()) / f64::from(steps))
        .sum();
    let mut scene = Builder::default();
    let floor = scene.diffuse(GROUND_ALBEDO, 0.0);
    scene.add(square(1000.0, 0.0, true), floor);
    scene.sky(1.0);
    let pane = scene.material(glass(1.5, 0.0), 0.0, Alpha::Opaque);
    scene.add(square(1000.0, 1.0, false), pane);
    scene.add(square(1000.0, 1.1, true), pane);
    let picture = scene.look(Vec3::new(0.3, 0.7, 0.2), Vec3::ZERO, 100);
    let albedo = f64::from(GROUND_ALBEDO);
    let expected = albedo * (1.0 - reflectance) / (1.0 - albedo * reflectance);
    Suite::new(1).judge(picture.radiance.p_equals(expected), "pane");
}

/// At one point of the ground: light sampling with what it leaves to chance, BSDF sampling alone, and both weighted have
/// the same mean.
#[test]
fn strategies_agree() {
    let mut scene = ground();
    let lamp = scene.diffuse(0.0, 5.0);
    scene.sphere(Vec3::new(0.2, 1.0, 0.1), 0.5, lamp);
    let squashed = Affine3A::from_scale_rotation_translation(
        Vec3::new(0.5, -0.2, 0.9),
        Quat::from_rotation_z(0.5),
        Vec3::new(-1.5, 1.0, 0.0),
    );
    scene.place(Geometry::Sphere { center: Vec3::ZERO, radius: 1.0 }, lamp, squashed);
    let [a, b, c, d] =
        [[1.0, 0.5, 1.0], [2.0, 0.5, 1.0], [2.0, 1.5, 0.5], [1.0, 1.5, 0.5]].map(Vec3::from_array);
    scene.0.materials[lamp.0 as usize].emission_two_sided = true;
    scene.add(quad([a, b, c, d]), lamp);
    let mut rng = Rng::new(4);
    scene.sky(0.7);
    let texels = Texels::Float((0..32).map(|_| [0; 4].map(|_| rng.next_1d())).collect());
    let clouds = Image { name: "clouds".into(), width: 8, height: 4, texels };
    scene.0.environment.as_mut().expect("a sky").image = Some(Arc::new(clouds));
    let scene = Scene::build(&scene.0).expect("a sound scene");
    let mut draw_one = || Level::portable().run(OnePoint { scene: &scene, rng: &mut rng });
    let (mut by_light, mut by_bsdf, mut weighted) = <(Mean, Mean, Mean)>::default();
    for _ in 0..100_000 {
        let [light, bsdf] = draw_one();
        by_light.push(light.0 + if bsdf.2 > 0.0 { 0.0 } else { bsdf.0 });
        by_bsdf.push(bsdf.0);
        // Draws of its own, so that it is independent of the other two.
        let heuristic =
            |(value, own, other): (f64, f64, f64)| value * own * own / (own * own + other * other);
        weighted.push(draw_one().map(heuristic).iter().sum());
    }
    let traced = draw(&scene, Vec3::new(1.0, 0.3, -1.0), Vec3::ZERO, 2, 64).radiance;
    let mut suite = Suite::new(3);
    suite.judge(by_light.p_same(&by_bsdf), "light sampling and BSDF sampling");
    suite.judge(by_light.p_same(&weighted), "light sampling and both weighted");
    suite.judge(by_light.p_same(&traced), "light sampling and the tracer");
}

/// Reflected radiance by one light sample and one BSDF sample: value, own density, the other's density.
struct OnePoint<'a> {
    scene: &'a Scene,
    rng: &'a mut Rng,
}

impl crate::isa::Job for OnePoint<'_> {
    type Output = [(f64, f64, f64); 2];

    fn run<I: crate::isa::Isa>(self, isa: I) -> Self::Output {
        let (scene, rng) = (self.scene, self.rng);
        let cast = |w: Vec3| {
            let ray = crate::bvh::Ray::new(Vec3::Y * 1e-4, w, 0.0);
            scene.accel.closest(isa, &ray, |_| true)
        };
        let brdf = f64::from(GROUND_ALBEDO) / PI;
        // What is seen along w, and the density with which light sampling would have chosen it.
        let receiver = crate::light::Receiver::surface(Vec3::ZERO, 0.0, Vec3::Y, false);
        let arrives = |w: Vec3| match cast(w) {
            None => {
                let (radiance, pdf) =
                    scene.environment().map_or((Vec3::ZERO, 0.0), |e| e.radiance_pdf(Vec3::ZERO, w));
                (f64::from(radiance.y), pdf * scene.lights.probability_of_environment(isa, &receiver))
            }
            Some(hit) => {
                let surface = scene.interaction(&hit, &crate::bvh::Ray::new(Vec3::Y * 1e-4, w, 0.0));
                (5.0, scene.light_pdf(isa, &hit, &surface, &receiver, w))
            }
        };
        let light = scene.sample_light(isa, &receiver, rng.next_1d(), rng.next_2d());
        let by_light = light.map_or((0.0, 1.0, 0.0), |light| {
            let cosine = f64::from(light.direction.y.max(0.0));
            // The lamps hide the sky, which is darker, but not each other.
            let hidden = arrives(light.direction).0 > f64::from(light.radiance.y) + 1.0;
            let radiance = if hidden { 0.0 } else { f64::from(light.radiance.y) };
            let pdf = f64::from(light.pdf);
            (brdf * cosine * radiance / pdf, pdf, cosine / PI)
        });
        let w = crate::warp::cosine_hemisphere(rng.next_2d());
        let w = Vec3::new(w.x, w.z, w.y);
        let (radiance, light_pdf) = arrives(w);
        [by_light, (f64::from(GROUND_ALBEDO) * radiance, f64::from(w.y) / PI, f64::from(light_pdf))]
    }
}

/// Coverage counts for camera rays, shadow rays and alpha alike.
#[test]
fn partial_coverage_lets_light_through() {
    let coverage = 0.3_f32;
    let alpha = Alpha::Blend { value: ScalarParam::constant(coverage) };
    let mut suite = Suite::new(4);
    let mut scene = Builder::default();
    let veil = scene.material(diffuse(0.0), 0.0, alpha);
    scene.sky(1.0);
    scene.add(square(5.0, 0.0, true), veil);
    scene.add(square(5.0, -1.0, true), veil);
    let picture = scene.look(Vec3::Y * 2.0, Vec3::ZERO, 1);
    let through = f64::from(1.0 - coverage).powi(2);
    suite.judge(picture.radiance.p_equals(through), "the sky through two veils");
    suite.judge(picture.alpha.p_equals(1.0 - through), "alpha of two veils");

    let mut scene = ground();
    let veil = scene.material(diffuse(0.0), 0.0, alpha);
    scene.add(square(5.0, 1.5, true), veil);
    scene.0.lights.push(desc::Light::Point { position: Vec3::Y * 2.0, intensity: Vec3::splat(4.0) });
    judge_irradiance(&mut suite, &scene, f64::from(1.0 - coverage), "a point light behind a veil");

    // A lamp that covers only partly shines only partly, whichever way it is found.
    let mut scene = ground();
    let lamp = scene.material(diffuse(0.0), 2.0, alpha);
    scene.sphere(Vec3::Y * 2.0, 1.0, lamp);
    judge_irradiance(&mut suite, &scene, f64::from(coverage) * 2.0 * PI / 4.0, "a lamp of partial coverage");
}

/// A mirrored instance looks like the same thing modelled mirrored: bit for bit where no rounding differs.
#[test]
fn mirrored_instances_keep_their_front() {
    let mut suite = Suite::new(2);
    let mut scene = ground();
    let lamp = scene.diffuse(0.0, 2.0);
    let at = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
    let corners = [at(0.2, 1.5, 0.9), at(0.2, 1.5, -0.4), at(1.2, 1.0, -0.4), at(1.2, 1.0, 0.9)];
    let facing_down = (corners[1] - corners[0]).cross(corners[2] - corners[0]).y < 0.0;
    assert!(facing_down, "the lamp shines on the ground");
    scene.place(quad(corners), lamp, Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0)));
    let mirrored = corners.map(|p| p.as_dvec3() * DVec3::new(-1.0, 1.0, 1.0));
    judge_irradiance(&mut suite, &scene, 2.0 * polygon_irradiance(&mirrored, DVec3::Y), "mirrored lamp");

    // Inside and outside of glass swapped would show as 2.25 or 1 / 2.25.
    let mut scene = Builder::default();
    scene.sky(1.0);
    let material = scene.material(glass(1.5, 0.0), 0.0, Alpha::Opaque);
    let mirror = Affine3A::from_scale(Vec3::new(1.0, -2.0, 1.0));
    scene.place(Geometry::Sphere { center: Vec3::ZERO, radius: 1.0 }, material, mirror);
    let picture = scene.look(Vec3::new(0.2, 0.3, 0.1), Vec3::new(0.9, 0.7, 0.4), 200);
    suite.judge(picture.radiance.p_equals(2.25), "from within mirrored glass");
}

/// Unlit surfaces show their colour to the camera and through mirrors, and light nothing.
#[test]
fn unlit_surfaces_show_their_colour_and_light_nothing() {
    let unlit = desc::MetalRough {
        base_color: ColorParam::constant(Vec3::splat(0.25)),
        unlit: true,
        ..desc::MetalRough::default()
    };
    let mut scene = ground();
    let sign = scene.material(Surface::MetalRough(Box::new(unlit)), 0.0, Alpha::Opaque);
    scene.sphere(Vec3::Y * 2.0, 1.0, sign);
    let seen = scene.look(Vec3::new(0.0, 2.0, 4.0), Vec3::Y * 2.0, 5);
    assert!(seen.samples.iter().all(|s| s.radiance == Vec3::splat(0.25)));
    let lit = scene.look(Vec3::new(1.0, 1.3, 0.2), Vec3::ZERO, 5);
    assert!(lit.samples.iter().all(|s| s.radiance == Vec3::ZERO));
}

/// Albedo and normal are those behind glass and in mirrors, depth that of what is hit first.
#[test]
fn guides_follow_mirrors_and_glass() {
    let mut scene = ground();
    let metal = Metal::Index { eta: Vec3::ONE, k: Vec3::splat(5.0) };
    let mirror = Surface::Conductor { metal, roughness: Roughness::SMOOTH };
    let mirror = scene.material(mirror, 0.0, Alpha::Opaque);
    let corners = [[-1., 0., -2.], [1., 0., -2.], [1., 2., -2.], [-1., 2., -2.]];
    scene.add(quad(corners.map(Vec3::from_array)), mirror);
    let picture = scene.look(Vec3::new(0.0, 1.0, 1.0), Vec3::new(0.0, 0.6, -2.0), 4);
    for sample in &picture.samples {
        assert_eq!((sample.albedo, sample.normal), (Vec3::splat(GROUND_ALBEDO), Vec3::Y));
        assert!((f64::from(sample.depth) - (9.0_f64 + 0.16).sqrt()).abs() < 1e-2, "{}", sample.depth);
        assert_eq!(sample.alpha, 1.0);
    }
}

/// The same samples whatever stands beside them in the work list and however runs are cut.
#[test]
fn samples_do_not_depend_on_batching() {
    struct Keep(Vec<(u32, u32, u32, Sample)>);
    impl SampleSink for Keep {
        fn add(&mut self, work: &PixelWork, index: u32, sample: &Sample) {
            self.0.push((work.x, work.y, index, *sample));
        }
    }
    let mut scene = ground();
    let lamp = scene.diffuse(0.1, 3.0);
    scene.sphere(Vec3::Y, 0.5, lamp);
    scene.sky(0.5);
    let scene = Scene::build(&scene.0).expect("a sound scene");
    let view = view(Vec3::new(0.0, 1.0, 4.0), Vec3::Y * 0.5, 16, 0.8, 6);
    let run = |x, y, first, count| PixelWork { x, y, pixel: 0, replicate: 1, first, count };
    let whole: Vec<_> = (0..16).map(|i| run(i, 15 - i, 3, 9)).collect();
    let mut cut: Vec<_> = whole.iter().flat_map(|w| [run(w.x, w.y, 8, 4), run(w.x, w.y, 3, 5)]).collect();
    cut.reverse();
    let draw = |work: &[PixelWork]| {
        let mut kept = Keep(Vec::new());
        let counts = render_tile(&scene, &view, work, &mut kept);
        assert_eq!(counts.paths, kept.0.len() as u64);
        kept.0.sort_by_key(|&(x, y, index, _)| (x, y, index));
        kept.0
    };
    assert_eq!(draw(&whole), draw(&cut));
    let portable = {
        let mut kept = Keep(Vec::new());
        render_tile(&scene, &view.clone().with_level(Level::portable()), &whole, &mut kept);
        kept.0.sort_by_key(|&(x, y, index, _)| (x, y, index));
        kept.0
    };
    assert_eq!(draw(&whole), portable, "nor on the instruction set");
}

#[test]
fn depth_is_zero_and_alpha_zero_where_nothing_is_hit() {
    let mut scene = Builder::default();
    scene.sky(0.4);
    let picture = scene.look(Vec3::ZERO, Vec3::X, 3);
    for sample in &picture.samples {
        assert_eq!((sample.alpha, sample.depth, sample.normal), (0.0, 0.0, Vec3::ZERO));
        assert_eq!(sample.albedo, Vec3::splat(0.4));
    }
}

#[test]
#[should_panic(expected = "sample indices fit into 32 bits")]
fn runs_past_the_last_index_are_refused() {
    let scene = Scene::build(&ground().0).expect("a sound scene");
    let view = view(Vec3::Y, Vec3::ZERO, 1, 1e-3, 1);
    let run = PixelWork { x: 0, y: 0, pixel: 0, replicate: 0, first: u32::MAX, count: 1 };
    render_tile(&scene, &view, &[run], &mut Picture::default());
}
