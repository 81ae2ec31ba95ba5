//! Rays against closed forms.

use glam::{Mat3, Quat};

use super::*;
use crate::testing::Rng;
use crate::warp;

const EYE: Vec3 = Vec3::new(1.0, 2.0, 3.0);

fn turned() -> Affine3A {
    let turn = Quat::from_euler(glam::EulerRot::XYZ, 0.3, -1.2, 0.5);
    Affine3A::from_mat3_translation(Mat3::from_quat(turn), EYE)
}

fn described(lens_radius: f32) -> desc::Camera {
    let camera = desc::Camera::perspective("test", turned(), 0.8);
    desc::Camera { lens_radius, focus_distance: 2.5, ..camera }
}

fn camera(described: &desc::Camera, width: u32, height: u32) -> Camera {
    Camera::new(described, width, height).expect("a sound camera")
}

/// Origin and direction in camera space when the shutter opens.
fn local(described: &desc::Camera, ray: &CameraRay) -> (Vec3, Vec3) {
    let to_camera = described.to_world.inverse();
    (to_camera.transform_point3(ray.origin), to_camera.transform_vector3(ray.direction))
}

/// The corners of the frame lie at the tangent of half the angle of view, right is right and up is up, whichever side
/// the angle spans; a mirror exchanges right and left.
#[test]
fn pinhole_rays_span_the_angle_of_view() {
    let tangent = 0.4_f32.tan();
    for (axis, [width, height], half) in [
        (FrameAxis::Vertical, [300, 200], Vec2::new(1.5, 1.0)),
        (FrameAxis::Vertical, [200, 300], Vec2::new(1.0 / 1.5, 1.0)),
        (FrameAxis::Shorter, [300, 200], Vec2::new(1.5, 1.0)),
        (FrameAxis::Shorter, [200, 300], Vec2::new(1.0, 1.5)),
    ] {
        for mirror in [1.0, -1.0] {
            let to_world = turned() * Affine3A::from_scale(Vec3::new(mirror, 1.0, 1.0));
            let projection = desc::Projection::Perspective { fov: 0.8, axis };
            let described = desc::Camera { to_world, projection, ..described(0.0) };
            let camera = camera(&described, width, height);
            for place in [Vec2::ZERO, Vec2::new(1.0, 0.0), Vec2::new(0.5, 1.0), Vec2::splat(0.7)] {
                let ray = camera.ray(place * Vec2::new(width as f32, height as f32), Vec2::ZERO, 0.0);
                assert_eq!(ray.origin, EYE);
                let (_, direction) = local(&described, &ray);
                let expected = Vec2::new(2.0 * place.x - 1.0, 1.0 - 2.0 * place.y) * half * tangent;
                let found = direction.truncate() / -direction.z;
                assert!((found - expected).length() < 1e-5, "{axis:?} {width}x{height} {place}: {direction}");
                assert!((ray.axis_cosine + direction.z).abs() < 1e-6);
                let (right, seen) = (turned().transform_vector3(Vec3::X), ray.direction);
                assert!(expected.x == 0.0 || (seen.dot(right) * mirror > 0.0) == (expected.x > 0.0));
            }
        }
    }
}

/// A frame that lies a quarter of its width to the right and half its height below the axis, of pixels twice as wide as high.
#[test]
fn frames_lie_beside_the_axis_where_they_are_shifted() {
    let (shift, pixel_aspect) = (Vec2::new(0.25, -0.5), 2.0);
    let axis = FrameAxis::Vertical;
    let flat = desc::Projection::Orthographic { extent: 2.0 * 0.4_f32.tan(), axis };
    for projection in [described(0.0).projection, flat] {
        let described = desc::Camera { shift, pixel_aspect, projection, ..described(0.0) };
        let camera = camera(&described, 150, 200);
        let half = Vec2::new(2.0 * 0.75, 1.0) * 0.4_f32.tan();
        for place in [Vec2::ZERO, Vec2::new(1.0, 0.0), Vec2::new(0.25, 1.0), Vec2::splat(0.5)] {
            let ray = camera.ray(place * Vec2::new(150.0, 200.0), Vec2::ZERO, 0.0);
            let (origin, direction) = local(&described, &ray);
            let found = (origin + direction / -direction.z).truncate();
            let expected = (Vec2::new(2.0 * place.x - 1.0, 1.0 - 2.0 * place.y) + 2.0 * shift) * half;
            assert!((found - expected).length() < 1e-5, "{projection:?} {place}: {found} {expected}");
        }
    }
}

#[test]
fn orthographic_rays_are_parallel_and_start_across_the_extent() {
    for (axis, half) in
        [(FrameAxis::Vertical, Vec2::new(2.0, 3.0)), (FrameAxis::Shorter, Vec2::new(3.0, 4.5))]
    {
        let projection = desc::Projection::Orthographic { extent: 6.0, axis };
        let described = desc::Camera { projection, ..described(0.0) };
        let camera = camera(&described, 200, 300);
        for place in [Vec2::ZERO, Vec2::new(1.0, 0.0), Vec2::new(0.25, 1.0)] {
            let ray = camera.ray(place * Vec2::new(200.0, 300.0), Vec2::ZERO, 0.0);
            let (origin, direction) = local(&described, &ray);
            let expected = Vec2::new(2.0 * place.x - 1.0, 1.0 - 2.0 * place.y) * half;
            assert!((origin - expected.extend(0.0)).length() < 1e-5, "{axis:?} {place}: {origin}");
            assert!((direction - Vec3::NEG_Z).length() < 1e-6 && (ray.axis_cosine - 1.0).abs() < 1e-6);
        }
    }
}

/// The middle of the frame looks along -z, its quarters to the sides, its top up; every direction is hit.
#[test]
fn spherical_rays_go_all_around() {
    let described = desc::Camera { projection: desc::Projection::Spherical, ..described(0.0) };
    let camera = camera(&described, 400, 200);
    for (film, expected) in [
        (Vec2::new(200.0, 100.0), Vec3::NEG_Z),
        (Vec2::new(300.0, 100.0), Vec3::X),
        (Vec2::new(100.0, 100.0), Vec3::NEG_X),
        (Vec2::new(0.0, 100.0), Vec3::Z),
        (Vec2::new(400.0, 100.0), Vec3::Z),
        (Vec2::new(77.0, 0.0), Vec3::Y),
        (Vec2::new(300.0, 200.0), Vec3::NEG_Y),
        (Vec2::new(300.0, 50.0), Vec3::new(0.5, 0.5, 0.0).normalize()),
    ] {
        let (origin, direction) = local(&described, &camera.ray(film, Vec2::ZERO, 0.0));
        assert!(origin.length() < 1e-5 && (direction - expected).length() < 1e-5, "{film}: {direction}");
    }
}

/// Whatever part of the lens a ray leaves from, it passes the same point of the plane in focus.
#[test]
fn lens_rays_meet_in_the_plane_of_focus() {
    let orthographic = desc::Projection::Orthographic { extent: 6.0, axis: FrameAxis::Vertical };
    for projection in [described(0.0).projection, orthographic] {
        let with = |lens| camera(&desc::Camera { projection, ..described(lens) }, 300, 200);
        let (pinhole, lens) = (with(0.0), with(0.2));
        let mut rng = Rng::new(1);
        for _ in 0..1000 {
            let film = rng.next_2d() * Vec2::new(300.0, 200.0);
            let at_focus = |ray: CameraRay| ray.origin + ray.direction * (2.5 / ray.axis_cosine);
            let from = pinhole.ray(film, Vec2::ZERO, 0.0);
            let ray = lens.ray(film, warp::disk(rng.next_2d()), 0.0);
            assert!(ray.origin.distance(from.origin) <= 0.2 * 1.0001);
            assert!(at_focus(ray).distance(at_focus(from)) < 1e-5, "{film}");
        }
    }
}

/// A camera that turns and walks: at both ends its rays are those of the still ones, half-way those of half a turn.
#[test]
fn moving_cameras_turn_and_walk_at_constant_speed() {
    let place =
        |angle: f32, x: f32| Affine3A::from_rotation_translation(Quat::from_rotation_y(angle), Vec3::X * x);
    let still = |angle, x| camera(&desc::Camera::perspective("", place(angle, x), 0.8), 30, 20);
    let mut described = desc::Camera::perspective("", place(0.2, 1.0), 0.8);
    assert!(!camera(&described, 30, 20).moves());
    described.end_to_world = Some(place(1.0, 5.0));
    let moving = camera(&described, 30, 20);
    assert!(moving.moves());
    for (time, angle, x) in [(0.0, 0.2, 1.0), (0.5, 0.6, 3.0), (0.75, 0.8, 4.0), (1.0, 1.0, 5.0)] {
        let film = Vec2::new(4.0, 17.0);
        let (found, expected) =
            (moving.ray(film, Vec2::ZERO, time), still(angle, x).ray(film, Vec2::ZERO, 0.0));
        assert!(found.origin.distance(expected.origin) < 1e-5, "{time}");
        assert!(found.direction.distance(expected.direction) < 1e-6, "{time}");
    }
}

/// Rays half a pixel apart lie as far apart as twice the radius of the cone, but for what it is narrowed by.
#[test]
fn cones_are_as_wide_as_the_pixel() {
    let orthographic = desc::Projection::Orthographic { extent: 6.0, axis: FrameAxis::Vertical };
    for projection in [described(0.0).projection, orthographic, desc::Projection::Spherical] {
        let camera = camera(&desc::Camera { projection, ..described(0.0) }, 400, 200);
        for film in [Vec2::new(200.0, 100.0), Vec2::new(210.0, 60.0)] {
            let at = |x: f32, y: f32| {
                let ray = camera.ray(film + Vec2::new(x, y), Vec2::ZERO, 0.0);
                ray.origin + 10.0 * ray.direction
            };
            let across = at(-0.5, 0.0).distance(at(0.5, 0.0)).min(at(0.0, -0.5).distance(at(0.0, 0.5)));
            let Cone { radius, spread } = camera.ray(film, Vec2::ZERO, 0.0).cone;
            let width = 2.0 * (radius + 10.0 * spread) / NARROWED;
            // Off the axis a pixel is not round; the cone may be the smaller by the cosine (0.97 here).
            assert!(
                width <= 1.001 * across / 0.97 && width > 0.9 * across,
                "{projection:?} {width} {across}"
            );
        }
    }
}

#[test]
fn cameras_that_make_no_sense_are_refused() {
    let sound = described(0.0);
    let refuse = |camera: &desc::Camera| Camera::new(camera, 4, 4).expect_err("must be refused");
    assert_eq!(Camera::new(&sound, 0, 4).expect_err("no pixels"), CameraError::EmptyFrame(0, 4));
    for value in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let axis = FrameAxis::Shorter;
        let projection = desc::Projection::Perspective { fov: value, axis };
        let error = refuse(&desc::Camera { projection, ..sound.clone() });
        assert!(matches!(error, CameraError::FieldOfView { .. }), "{error}");
        let projection = desc::Projection::Orthographic { extent: value, axis };
        let error = refuse(&desc::Camera { projection, ..sound.clone() });
        assert!(matches!(error, CameraError::Extent { .. }), "{error}");
    }
    for (lens_radius, focus_distance) in [(-1.0, 1.0), (0.1, 0.0), (f32::NAN, 1.0), (0.1, f32::INFINITY)] {
        let error = refuse(&desc::Camera { lens_radius, focus_distance, ..sound.clone() });
        assert!(matches!(error, CameraError::Lens { .. }), "{error}");
    }
    let projection = desc::Projection::Spherical;
    let error = refuse(&desc::Camera { projection, ..described(0.1) });
    assert!(matches!(error, CameraError::SphericalLens { .. }), "{error}");
    for (shift, pixel_aspect) in [(Vec2::NAN, 1.0), (Vec2::ZERO, 0.0), (Vec2::ZERO, f32::INFINITY)] {
        let error = refuse(&desc::Camera { shift, pixel_aspect, ..sound.clone() });
        assert!(matches!(error, CameraError::Frame { .. }), "{error}");
    }
    let nothing = desc::Lenses { surfaces: vec![], film_height: 1.0, film_radius: 1.0, aperture: None };
    let error = refuse(&desc::Camera { lenses: Some(std::sync::Arc::new(nothing)), ..sound.clone() });
    assert!(matches!(error, CameraError::Lenses { .. }), "{error}");
    let scaled = Affine3A::from_scale(Vec3::splat(2.0));
    let error = refuse(&desc::Camera { to_world: scaled, ..sound.clone() });
    assert!(matches!(error, CameraError::Transform { .. }), "{error}");
    let error = refuse(&desc::Camera { end_to_world: Some(scaled), ..sound.clone() });
    assert!(matches!(error, CameraError::Transform { .. }), "{error}");
    let mirrored = sound.to_world * Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
    let error = refuse(&desc::Camera { end_to_world: Some(mirrored), ..sound });
    assert!(matches!(error, CameraError::Motion { .. }), "{error}");
}

/// Every pixel sees as much of the sphere; the middle looks up, and across the frame's edge directions go on.
#[test]
fn equal_area_frames_hold_the_whole_sphere_evenly() {
    let described = desc::Camera { projection: desc::Projection::EqualArea, ..described(0.0) };
    let camera = camera(&described, 64, 64);
    let direction = |film: Vec2| local(&described, &camera.ray(film, Vec2::ZERO, 0.0)).1;
    for (film, expected) in [
        (Vec2::splat(32.0), Vec3::Y),
        (Vec2::new(64.0, 32.0), Vec3::X),
        (Vec2::new(32.0, 64.0), Vec3::NEG_Z),
        (Vec2::ZERO, Vec3::NEG_Y),
    ] {
        assert!(direction(film).abs_diff_eq(expected, 1e-5), "{film}: {}", direction(film));
    }
    let mut rng = Rng::new(9);
    let counts = (0..200_000).fold([0_u64; 8], |mut counts, _| {
        let d = direction(64.0 * rng.next_2d());
        counts[usize::from(d.x > 0.0) | usize::from(d.y > 0.0) << 1 | usize::from(d.z > 0.0) << 2] += 1;
        counts
    });
    let p = crate::testing::chi_square(&counts, &[25_000.0; 8]);
    crate::testing::Suite::new(1).judge(p, "octants");
    for along in [0.1, 20.0, 50.0] {
        for (inside, outside) in [
            (Vec2::new(0.01, along), Vec2::new(-0.01, along)),
            (Vec2::new(along, 63.99), Vec2::new(along, 64.01)),
        ] {
            assert!(direction(inside).abs_diff_eq(direction(outside), 2e-3), "{inside}");
        }
    }
}
