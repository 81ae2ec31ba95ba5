//! Lights that send pictures.

use super::*;
use crate::desc::PictureSpread;
use crate::light::luminance;

fn drawing(width: u32, height: u32) -> Arc<Image> {
    let mut rng = Rng::new(21);
    let texel = |_| [rng.next_1d(), rng.next_1d(), rng.next_1d(), 1.0];
    let texels = Texels::Float((0..width * height).map(texel).collect());
    Arc::new(Image { name: "diagram".into(), width, height, texels })
}

fn light(image: &Arc<Image>, spread: PictureSpread) -> PunctualLight {
    let turned = Mat3::from_quat(Quat::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -0.4));
    PunctualLight::new(&desc::Light::Picture {
        position: Vec3::new(1.0, 2.0, 3.0),
        from_world: turned,
        intensity: Vec3::new(2.0, 3.0, 0.5),
        image: Arc::clone(image),
        spread,
    })
}

const WINDOW: PictureSpread = PictureSpread::Window { half: Vec2::new(0.8, 0.3) };

/// What goes to all sides, added up, is the power that lights are chosen by, and nothing goes where bounds say it
/// cannot.
#[test]
fn powers_are_those_of_the_directions() {
    let mut suite = Suite::new(2);
    for (seed, spread, image) in [(1, PictureSpread::AllAround, drawing(8, 8)), (2, WINDOW, drawing(9, 4))] {
        let light = light(&image, spread);
        let position = Vec3::new(1.0, 2.0, 3.0);
        let bounds = light.bounds();
        let mut rng = Rng::new(seed);
        let power = Mean::of(200_000, || {
            let direction = rng.next_direction();
            let found = light.sample(position + 2.0 * direction).map_or(Vec3::ZERO, |s| 4.0 * s.radiance);
            if found != Vec3::ZERO {
                assert!(direction.angle_between(bounds.axis) <= bounds.theta_o + bounds.theta_e);
            }
            4.0 * std::f64::consts::PI * f64::from(luminance(found))
        });
        suite.judge(power.p_equals(f64::from(light.power())), format_args!("{spread:?}"));
    }
}

/// The first texel of a projector lies towards -x and -y, and a diagram's middle at its pole.
#[test]
fn pictures_are_the_right_way_round() {
    let texels = (0..6).map(|i| [i as f32, 1.0, 1.0, 1.0]).collect();
    let image = Arc::new(Image { name: String::new(), width: 3, height: 2, texels: Texels::Float(texels) });
    let spread = WINDOW;
    let light = |from_world| {
        let (position, intensity) = (Vec3::ZERO, Vec3::ONE);
        let image = Arc::clone(&image);
        PunctualLight::new(&desc::Light::Picture { position, from_world, intensity, image, spread })
    };
    let upright = light(Mat3::IDENTITY);
    for (place, expected) in
        [(Vec2::new(-0.7, -0.2), 0.0), (Vec2::new(0.0, -0.2), 1.0), (Vec2::new(0.7, 0.2), 5.0)]
    {
        let sample = upright.sample(place.extend(1.0)).expect("in the window");
        assert_eq!(sample.radiance.x / sample.radiance.y, expected, "{place}");
    }
    for outside in [Vec3::new(0.9, 0.0, 1.0), Vec3::new(0.0, -0.4, 1.0), Vec3::new(0.1, 0.0, -1.0), Vec3::X] {
        assert!(upright.sample(outside).is_none(), "{outside}");
    }
    let mirrored = light(Mat3::from_diagonal(Vec3::new(-1.0, 1.0, 1.0)));
    let sample = mirrored.sample(Vec3::new(0.7, -0.2, 1.0)).expect("in the window");
    assert_eq!(sample.radiance.x, 0.0, "the first texel");
}
