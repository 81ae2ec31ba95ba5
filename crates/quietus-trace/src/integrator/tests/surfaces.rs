//! What surfaces do to light: what passes them, where caustics fall, where normal maps turn them.

use glam::Vec2;

use super::*;
use crate::frame::Frame;
use crate::material::SurfacePoint;

fn filmed_glass(ior: Vec3, roughness: f32) -> Surface {
    Surface::Glass(Box::new(desc::Glass {
        ior,
        roughness: Roughness::perceptual(ScalarParam::constant(roughness)),
        tint: ColorParam::constant(Vec3::new(1.0, 0.8, 0.9)),
        film: desc::ThinFilm { strength: ScalarParam::constant(0.7), ..desc::ThinFilm::NONE },
        keeps_light: false,
    }))
}

/// Each channel of glass that disperses light is that channel of glass with its index: through two surfaces of a ball, from
/// a lamp that both strategies find and from the sky.
#[test]
fn dispersion_draws_each_channel_by_its_own_index() {
    let ior = Vec3::new(1.3, 1.5, 1.8);
    let look = |ior: Vec3, roughness: f32| {
        let mut scene = Builder::default();
        scene.sky(0.3);
        let lamp = scene.diffuse(0.0, 20.0);
        scene.sphere(Vec3::new(0.3, 0.8, -3.0), 0.5, lamp);
        let ball = scene.material(filmed_glass(ior, roughness), 0.0, Alpha::Opaque);
        scene.sphere(Vec3::ZERO, 1.0, ball);
        scene.look(Vec3::new(0.2, 0.1, 4.0), Vec3::new(0.3, 0.3, 0.0), 12).samples
    };
    let mean = |samples: &[Sample], channel: usize| {
        let mut mean = Mean::default();
        samples.iter().for_each(|sample| mean.push(f64::from(sample.radiance[channel])));
        mean
    };
    let mut suite = Suite::new(6);
    for roughness in [0.0, 0.5] {
        let all = look(ior, roughness);
        for channel in 0..3 {
            let one = look(Vec3::splat(ior[channel]), roughness);
            let (found, expected) = (mean(&all, channel), mean(&one, channel));
            let what = format!("{roughness}, {channel}: {} and {}", found.mean(), expected.mean());
            suite.judge(found.p_same(&expected), what);
        }
    }
}

/// A single surface under a sky of radiance 1 on both sides shows all it reflects and lets through.
#[test]
fn sky_furnace_shows_what_passes_a_surface() {
    let thin_wall = |roughness| {
        Surface::MetalRough(Box::new(desc::MetalRough {
            metallic: ScalarParam::constant(0.0),
            roughness: ScalarParam::constant(roughness),
            transmission: ScalarParam::constant(0.7),
            ..desc::MetalRough::default()
        }))
    };
    let petal = Surface::MetalRough(Box::new(desc::MetalRough {
        metallic: ScalarParam::constant(0.0),
        roughness: ScalarParam::constant(0.4),
        diffuse_transmission: ScalarParam::constant(0.6),
        film: desc::ThinFilm { strength: ScalarParam::constant(0.8), ..desc::ThinFilm::NONE },
        ..desc::MetalRough::default()
    }));
    let surfaces = [
        glass(1.5, 0.2),
        glass(1.5, 0.6),
        thin_wall(0.3),
        thin_wall(0.8),
        petal,
        filmed_glass(Vec3::splat(1.5), 0.4),
    ];
    let mut suite = Suite::new(2 * surfaces.len());
    for surface in surfaces {
        let mut scene = Builder::default();
        scene.sky(1.0);
        let material = scene.material(surface.clone(), 0.0, Alpha::Opaque);
        scene.add(square(10.0, 0.0, true), material);
        let compiled = Scene::build(&scene.0).expect("a sound scene");
        let bsdf = compiled.materials.bsdf(material, &SurfacePoint::default(), 0);
        for side in [1.0, -1.0] {
            let eye = Vec3::new(0.8, side, 0.3);
            let wo = Frame::from_normal(Vec3::Y).to_local(eye.normalize());
            let mut rng = Rng::new(9);
            let albedo = Mean::of(40_000, || {
                bsdf.sample(wo, rng.next_1d(), rng.next_2d()).map_or(0.0, |s| f64::from(s.weight.y))
            });
            let picture = draw(&compiled, eye, Vec3::ZERO, 2, 64);
            suite.judge(picture.radiance.p_same(&albedo), format_args!("{surface:?} from side {side}"));
        }
    }
}

/// A small lamp of radius r in the middle of a glass ball of radius R: its light can only be found by chance.
///
/// A ray that leaves the lamp passes the centre at a distance b, which neither reflection nor refraction by the
/// concentric ball changes but by the index: what the ball reflects meets the lamp again, which is black. So the
/// power `pi L 4 pi r^2` is let through once, at the sine `b / R`; `b^2 / r^2` of Lambert's rays is uniform. By
/// symmetry it then spreads evenly over all directions.
#[test]
fn caustics_carry_the_power_that_glass_lets_through() {
    let (lamp_radius, ball_radius, radiance) = (0.25_f32, 0.5_f32, 3.0_f32);
    let center = Vec3::new(-0.5, 1.0, 0.3);
    let mut scene = ground();
    let lamp = scene.diffuse(0.0, radiance);
    let ball = scene.material(glass(1.5, 0.0), 0.0, Alpha::Opaque);
    scene.sphere(center, lamp_radius, lamp);
    scene.sphere(center, ball_radius, ball);
    let steps = 10_000;
    let let_through: f64 = (0..steps)
        .map(|i| (f64::from(i) + 0.5) / f64::from(steps) * f64::from(lamp_radius / ball_radius).powi(2))
        .map(|sin2| (1.0 - fresnel((1.0 - sin2).sqrt(), 1.0 / 1.5)) / f64::from(steps))
        .sum();
    let power = PI * f64::from(radiance) * 4.0 * PI * f64::from(lamp_radius).powi(2) * let_through;
    let distance2 = f64::from(center.length_squared());
    let irradiance = power / (4.0 * PI * distance2) * f64::from(center.y) / distance2.sqrt();
    // Camera, ground, ball, lamp.
    let picture = scene.look(Vec3::new(1.0, 1.3, 0.2), Vec3::ZERO, 3);
    let expected = f64::from(GROUND_ALBEDO) / PI * irradiance;
    Suite::new(1).judge(picture.radiance.p_equals(expected), "caustic");
}

/// A texture of one texel that says `normal` in tangent space.
fn normal_map(scene: &mut Builder, normal: Vec3) -> Option<(desc::TextureId, f32)> {
    let texels = desc::Texels::Float(vec![(0.5 * normal + 0.5).extend(1.0).to_array()]);
    scene.0.textures.push(desc::Texture::Image(desc::ImageTexture {
        image: Arc::new(desc::Image { name: "normal".into(), width: 1, height: 1, texels }),
        wrap: [desc::Wrap::Repeat; 2],
        filter: desc::TexelFilter::Nearest,
        mapping: desc::Mapping::Uv { set: 0, transform: glam::Affine2::IDENTITY },
        invert: false,
    }));
    Some((desc::TextureId(scene.0.textures.len() as u32 - 1), 1.0))
}

/// The ground around the origin with u along x and v along z, so that tangent space is (x, -z, y); with tangents of
/// its own or without.
fn mapped_ground(tangents: bool) -> Geometry {
    let positions: Vec<_> =
        [[-1., 1.], [1., 1.], [1., -1.], [-1., -1.]].map(|[x, z]| Vec3::new(x, 0.0, z)).into();
    let uvs = positions.iter().map(|p| Vec2::new(p.x, p.z)).collect();
    Geometry::Mesh(Arc::new(Mesh {
        tangents: if tangents { vec![Vec3::X.extend(1.0); 4] } else { Vec::new() },
        uvs: [uvs, Vec::new()],
        positions,
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }))
}

const TILT: Vec3 = Vec3::new(0.36, 0.48, 0.8);
const MIRRORS: [Vec3; 3] = [Vec3::ONE, Vec3::new(-1.0, 1.0, 1.0), Vec3::new(1.0, 1.0, -1.0)];

/// Mirrors turn what a normal map shows around with the mesh.
#[test]
fn normal_maps_follow_mirrored_instances() {
    for (tangents, mirror) in [false, true].into_iter().flat_map(|t| MIRRORS.map(|m| (t, m))) {
        let mut scene = Builder::default();
        let material = scene.diffuse(0.5, 0.0);
        scene.0.materials[0].normal_map = normal_map(&mut scene, TILT);
        scene.place(mapped_ground(tangents), material, Affine3A::from_scale(mirror));
        let expected = mirror * Vec3::new(TILT.x, TILT.z, -TILT.y);
        for sample in scene.look(Vec3::Y * 2.0, Vec3::ZERO, 1).samples {
            assert!(sample.normal.distance(expected) < 1e-5, "{mirror}, {tangents}: {}", sample.normal);
        }
    }
}

/// A smooth coat mirrors a lamp at the normal its own map gives, whether or not the base has a map, and whichever
/// way the mesh is turned. From above, the direction is `2 z n - y`.
#[test]
fn clear_coats_have_normals_of_their_own() {
    for (base, mirror) in [None, Some(Vec3::Z), Some(Vec3::new(-0.48, 0.36, 0.8))]
        .into_iter()
        .flat_map(|b| MIRRORS.map(|m| (b, m)))
    {
        let mut scene = Builder::default();
        let coated = desc::MetalRough {
            base_color: ColorParam::constant(Vec3::ZERO),
            metallic: ScalarParam::constant(0.0),
            roughness: ScalarParam::constant(0.0),
            specular: ScalarParam::constant(0.0),
            clearcoat: ScalarParam::constant(1.0),
            clearcoat_normal: normal_map(&mut scene, TILT),
            ..desc::MetalRough::default()
        };
        let material = scene.material(Surface::MetalRough(Box::new(coated)), 0.0, Alpha::Opaque);
        scene.0.materials[0].normal_map = base.and_then(|normal| normal_map(&mut scene, normal));
        scene.place(mapped_ground(false), material, Affine3A::from_scale(mirror));
        let mirrored = 2.0 * TILT.z * mirror * Vec3::new(TILT.x, TILT.z, -TILT.y) - Vec3::Y;
        let lamp = scene.diffuse(0.0, 1.0);
        scene.sphere(3.0 * mirrored, 0.01, lamp);
        // Schlick's approximation for the coat's index of 1.5.
        let expected = 0.04 + 0.96 * (1.0 - TILT.z).powi(5);
        for sample in scene.look(Vec3::Y * 2.0, Vec3::ZERO, 2).samples {
            let found = sample.radiance.y;
            assert!((found - expected).abs() < 1e-5, "{base:?}, {mirror}: {found} instead of {expected}");
        }
    }
}
