//! Cameras, film and what stands before the world.

use super::*;

#[test]
fn cameras_look_along_left_handed_axes() {
    let camera = camera("LookAt 0 0 5  0 0 0  0 1 0\nCamera \"perspective\" \"float fov\" 40");
    assert!(close(camera.to_world.translation.into(), Vec3::new(0.0, 0.0, 5.0)));
    assert!(close(camera.to_world.transform_vector3(Vec3::NEG_Z), Vec3::NEG_Z), "forward");
    assert!(close(camera.to_world.transform_vector3(Vec3::Y), Vec3::Y), "up");
    // The world's +x is on the left of the picture.
    assert!(close(camera.to_world.transform_vector3(Vec3::X), Vec3::NEG_X), "right");
    assert_eq!(
        camera.projection,
        Projection::Perspective { fov: 40_f32.to_radians(), axis: FrameAxis::Shorter }
    );
    assert_eq!((camera.lens_radius, camera.focus_distance), (0.0, 1e6));
}

#[test]
fn scaled_cameras_see_the_same_with_longer_lengths() {
    let lens = "\"float lensradius\" 0.5 \"float focaldistance\" 4";
    let camera = camera(&format!("Scale 0.5 0.5 0.5\nCamera \"perspective\" {lens}"));
    assert_eq!((camera.lens_radius, camera.focus_distance), (1.0, 8.0));
    let scale = camera.to_world.matrix3.x_axis.length();
    assert!((scale - 1.0).abs() < 1e-6, "cameras do not scale: {scale}");
}

#[test]
fn screens_that_are_not_the_usual_ones() {
    let film = "Film \"rgb\" \"integer xresolution\" 200 \"integer yresolution\" 100\n";
    let fov = |camera: &str| match self::camera(&format!("{film}Camera \"perspective\" {camera}")).projection
    {
        Projection::Perspective { fov, axis } => (fov.to_degrees(), axis),
        other => panic!("{other:?}"),
    };
    assert_eq!(fov("\"float screenwindow\" [-2 2 -1 1]").1, FrameAxis::Vertical);
    assert!((fov("\"float screenwindow\" [-2 2 -1 1]").0 - 90.0).abs() < 1e-4);
    let half = 2.0 * 0.5_f32.atan().to_degrees();
    assert!((fov("\"float screenwindow\" [-1 1 -.5 .5]").0 - half).abs() < 1e-4);
    assert!((fov("\"float frameaspectratio\" 2").0 - 90.0).abs() < 1e-4);
    let camera = camera(&format!("{film}Camera \"orthographic\" \"float screenwindow\" [-6 6 -3 3]"));
    assert_eq!(camera.projection, Projection::Orthographic { extent: 6.0, axis: FrameAxis::Vertical });
    assert_eq!(camera.aspect, Some(2.0));
}

#[test]
fn spherical_cameras_turn_as_pbrts_do() {
    let camera = camera("Camera \"spherical\" \"string mapping\" \"equirectangular\"");
    assert_eq!(camera.projection, Projection::Spherical);
    for (u, v) in [(0.1, 0.2), (0.5, 0.5), (0.8, 0.7)] {
        let (phi, theta) = (2.0 * PI * u, PI * v);
        let expected = Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
        let found = camera.to_world.transform_vector3(lat_long(u, v));
        assert!(close(found, expected), "{found} {expected}");
    }
}

#[test]
fn film_filter_sampler_and_integrator() {
    let picture = header(
        "Film \"rgb\" \"integer xresolution\" 200 \"integer yresolution\" 100 \"float iso\" 200
             \"float maxcomponentvalue\" 20 \"integer pixelbounds\" [50 100 0 50]
         Camera \"perspective\" \"float shutterclose\" 0.25
         PixelFilter \"mitchell\" \"float xradius\" 3
         Sampler \"stratified\" \"integer xsamples\" 3
         Integrator \"path\" \"integer maxdepth\" 0",
    )
    .picture;
    assert_eq!(picture.size, Some([200, 100]));
    assert_eq!(picture.crop, Some([0.25, 0.5, 0.0, 0.5]));
    assert_eq!(picture.exposure, Some(Vec3::splat(0.5)), "a quarter of the time, twice the speed");
    assert_eq!(picture.max_component, Some(20.0));
    assert_eq!((picture.samples, picture.max_depth), (Some(12), Some(1)));
    let filter = picture.filter.expect("a filter");
    assert_eq!(filter.radius, Vec2::new(3.0, 2.0));
    assert!(matches!(filter.shape, FilterShape::Mitchell { .. }));
    assert_eq!(header("Sampler \"independent\"").picture.samples, Some(4));
    assert_eq!(header("Sampler \"halton\"").picture.samples, Some(16));
    let plain = header("").picture;
    assert_eq!((plain.size, plain.exposure, plain.max_depth), (Some([1280, 720]), None, Some(6)));
    assert_eq!(plain.filter, Some(quietus_trace::filter::Filter::GAUSSIAN));
}

#[test]
fn cameras_see_all_around_evenly_unless_told_otherwise() {
    assert_eq!(camera("Camera \"spherical\"").projection, Projection::EqualArea);
}

/// Daylight that is asked to be white is; 6504 K nearly is already, and red light is dimmed in red.
#[test]
fn white_balance_makes_its_light_white() {
    let exposure = |kelvin: &str| {
        header(&format!("Film \"rgb\" \"float iso\" 200 \"float whitebalance\" {kelvin}")).picture.exposure
    };
    assert_eq!(exposure("0"), Some(Vec3::splat(2.0)));
    assert!((exposure("6504").expect("balanced") - 2.0).abs().max_element() < 0.01, "{:?}", exposure("6504"));
    let warm = exposure("3000").expect("balanced");
    assert!(warm.x < 2.0 && warm.z > 4.0, "{warm}");
    // A lamp of that temperature is white.
    let scene = header("Film \"rgb\" \"float whitebalance\" 3000");
    let lamp = world("LightSource \"point\" \"blackbody I\" 3000");
    let Light::Point { intensity, .. } = lamp.lights[0] else { panic!("a lamp") };
    let white = intensity * scene.picture.exposure.expect("balanced");
    assert!((white / white.y - 1.0).abs().max_element() < 1e-3, "{white}");
}

/// One lens of two surfaces, 50 mm wide: its focal length by the lensmaker's formula, 100 mm.
#[test]
fn lenses_of_realistic_cameras_are_one_thin_lens() {
    let folder = tempfile::tempdir().expect("a folder");
    // Radii of 100 mm, an index of 1.5, next to no thickness; the stop lies behind it.
    let file = "# a comment\n100 0.001 1.5 50\n-100 0.001 1 50\n0 50 1 30\n";
    std::fs::write(folder.path().join("lens.dat"), file).expect("a writable folder");
    let camera = |more: &str| {
        let text = format!(
            "Camera \"realistic\" \"string lensfile\" \"lens.dat\" {more}\nFilm \"rgb\" \"float diagonal\" 50\
             \"integer xresolution\" 400 \"integer yresolution\" 300\nWorldBegin"
        );
        load_bytes(&folder.path().join("a.pbrt"), text.as_bytes())
    };
    let scene = camera("\"float aperturediameter\" 20 \"float focusdistance\" 10").expect("sound").scene;
    let camera_read = &scene.cameras[0];
    // 1 / image + 1 / object = 1 / 0.1, and 10 m from the film to what is sharp.
    let image = 5.0 - (25.0_f32 - 1.0).sqrt();
    let close = |a: f32, b: f32| (a / b - 1.0).abs() < 1e-3;
    assert!(close(camera_read.focus_distance, 10.0 - image), "{}", camera_read.focus_distance);
    assert!(close(camera_read.lens_radius, 0.01), "{}", camera_read.lens_radius);
    let Projection::Perspective { fov, axis: FrameAxis::Vertical } = camera_read.projection else { panic!() };
    assert!(close((0.5 * fov).tan(), 0.015 / image), "{fov}");
    assert!(close(camera_read.to_world.translation.z, image), "{}", camera_read.to_world.translation);
    let light = scene.picture.exposure.expect("as much light as the opening lets through").x;
    assert!(close(light, PI * (0.01 / image).powi(2)), "{light}");
    // The stop is no wider than it was made.
    let wide = camera("\"float aperturediameter\" 90").expect("sound").scene;
    assert!(close(wide.cameras[0].lens_radius, 0.015));
    let near = camera("\"float focusdistance\" 0.3").expect_err("nearer than four focal lengths");
    assert!(near.message().contains("focused"), "{near}");
}
