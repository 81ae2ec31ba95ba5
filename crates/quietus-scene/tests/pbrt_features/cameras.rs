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

/// Windows beside the middle and pixels that are not square are drawn as they are.
#[test]
fn screens_beside_the_axis() {
    let film = "Film \"rgb\" \"integer xresolution\" 200 \"integer yresolution\" 100\n";
    for kind in ["perspective", "orthographic"] {
        let camera = |more: &str| camera(&format!("{film}Camera \"{kind}\" {more}"));
        let shifted = camera("\"float screenwindow\" [0 2 -1.5 -.5]");
        assert_eq!((shifted.shift, shifted.pixel_aspect), (Vec2::new(0.5, -1.0), 1.0));
        let stretched = camera("\"float screenwindow\" [-1 1 -1 1]");
        assert_eq!((stretched.shift, stretched.pixel_aspect), (Vec2::ZERO, 0.5));
        assert_eq!(camera("\"float frameaspectratio\" 4").pixel_aspect, 2.0);
        assert_eq!((camera("").shift, camera("").pixel_aspect), (Vec2::ZERO, 1.0));
    }
}

/// One lens of two surfaces, 50 mm wide: its focal length by the lensmaker's formula, 100 mm.
const LENS: &str = "# a comment\n100 0.001 1.5 50\n-100 0.001 1 50\n0 50 0 30\n";

/// What is read of a realistic camera with [`LENS`], and what is warned of.
fn realistic(more: &str) -> Result<quietus_scene::Loaded, quietus_scene::SceneError> {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("lens.dat"), LENS).expect("a writable folder");
    let text = format!(
        "Camera \"realistic\" \"string lensfile\" \"lens.dat\" {more}\nFilm \"rgb\" \"float diagonal\" 50\
         \"integer xresolution\" 400 \"integer yresolution\" 300\nWorldBegin"
    );
    load_bytes(&folder.path().join("a.pbrt"), text.as_bytes())
}

#[test]
fn realistic_cameras_have_the_lenses_of_their_file_in_focus() {
    let scene = realistic("\"float aperturediameter\" 20 \"float focusdistance\" 10").expect("sound").scene;
    let camera = &scene.cameras[0];
    // 1 / image + 1 / object = 1 / 0.1, and 10 m from the film to what is sharp.
    let image = 5.0 - (25.0_f32 - 1.0).sqrt();
    let close = |a: f32, b: f32| (a / b - 1.0).abs() < 1e-3;
    let lenses = camera.lenses.as_ref().expect("lenses");
    let [front, back, stop] = lenses.surfaces[..] else { panic!("{lenses:?}") };
    assert!(close(stop.place, image) && front.place > back.place && back.place > stop.place, "{lenses:?}");
    assert!(close(front.curvature, 0.1) && close(back.curvature, -0.1) && stop.curvature == 0.0);
    assert!(close(front.rim, 0.025) && close(stop.rim, 0.01), "the stop is narrowed, the rims are not");
    assert_eq!([front, back, stop].map(|surface| surface.index), [1.5, 1.0, 1.0]);
    assert!(close(lenses.film_height, 0.03) && close(lenses.film_radius, 0.025));
    assert!(lenses.aperture.is_none() && scene.picture.exposure.is_none());
    // Roughly the same through one thin lens.
    assert!(close(camera.focus_distance, 10.0 - image) && close(camera.lens_radius, 0.01));
    let Projection::Perspective { fov, axis: FrameAxis::Vertical } = camera.projection else { panic!() };
    assert!(close((0.5 * fov).tan(), 0.015 / image), "{fov}");
    let near = realistic("\"float focusdistance\" 0.3").expect_err("nearer than four focal lengths");
    assert!(near.message().contains("focused"), "{near}");
}

/// The stop is no wider than it was made.
#[test]
fn stops_open_as_far_as_they_can() {
    let wide = realistic("\"float aperturediameter\" 90").expect("sound");
    let lenses = wide.scene.cameras[0].lenses.clone().expect("lenses");
    assert!((lenses.surfaces[2].rim - 0.015).abs() < 1e-6);
    assert!(wide.warnings.iter().any(|warning| warning.message.contains("no further than 30 mm")));
}

/// Forms of openings are as bright as a round one, which fills a quarter of pi of the square around it.
#[test]
fn openings_have_the_form_that_is_named() {
    for (name, middle) in [("gaussian", true), ("square", true), ("pentagon", true), ("star", true)] {
        let scene = realistic(&format!("\"string aperture\" \"{name}\"")).expect("sound").scene;
        let lenses = scene.cameras[0].lenses.clone().expect("lenses");
        let aperture = lenses.aperture.as_ref().expect("a form");
        let [width, height] = aperture.size.map(|side| side as usize);
        let sum: f64 = aperture.weights.iter().map(|weight| f64::from(*weight)).sum();
        let mean = sum / aperture.weights.len() as f64;
        assert!(
            (mean / (0.25 * std::f64::consts::PI) - 1.0).abs() < f64::from(f32::EPSILON),
            "{name}: {mean}"
        );
        let at = |x: usize, y: usize| aperture.weights[y * width + x];
        assert_eq!(at(width / 2, height / 2) > 0.0, middle, "{name}");
        assert_eq!(at(0, 0) > 0.0, name == "square", "{name}");
    }
    let missing = realistic("\"string aperture\" \"none.png\"").expect_err("no such file");
    assert!(missing.to_string().contains("none.png"), "{missing}");
}
