//! Lights, skies and media.

use super::*;

#[test]
fn skies_turn_with_their_light() {
    let folder = tempfile::tempdir().expect("a folder");
    float_map(&folder.path().join("sky.pfm"), 4, &[1.0; 8]);
    let path = folder.path().join("test.pbrt");
    let light = "LightSource \"infinite\" \"string filename\" \"sky.pfm\" \"float scale\" 3";
    std::fs::write(&path, format!("WorldBegin Rotate 30 0 1 0 Rotate -90 1 0 0 {light}")).expect("writable");
    let sky = load(&path).expect("sound").scene.environment.expect("a sky");
    assert_eq!((sky.layout, sky.scale), (EnvironmentLayout::LatLong, Vec3::splat(3.0)));
    let turn = glam::Mat3::from_rotation_y(30_f32.to_radians()) * glam::Mat3::from_rotation_x(-0.5 * PI);
    for (u, v) in [(0.1, 0.2), (0.5, 0.5), (0.8, 0.7)] {
        // u counts phi from +x to +y and v theta from +z, in the light's space.
        let (phi, theta) = (2.0 * PI * u, PI * v);
        let own = Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
        assert!(close(sky.to_world * lat_long(u, v), turn * own));
    }
    // The same radiance everywhere gives pi times as much on a surface, of which pbrt counts a half.
    std::fs::write(&path, format!("WorldBegin {light} \"float illuminance\" 5")).expect("writable");
    let sky = load(&path).expect("sound").scene.environment.expect("a sky");
    assert!(close(sky.scale, Vec3::splat(3.0 * 5.0 * 2.0 / PI)), "{}", sky.scale);
    float_map(&folder.path().join("sky.pfm"), 2, &[1.0; 4]);
    let sky = load(&path).expect("sound").scene.environment.expect("a sky");
    assert_eq!(sky.layout, EnvironmentLayout::EqualArea);
}

#[test]
fn power_counts_the_picture_of_a_light() {
    let folder = tempfile::tempdir().expect("a folder");
    float_map(&folder.path().join("shade.pfm"), 2, &[0.0, 1.0, 2.0, 5.0]);
    let path = folder.path().join("test.pbrt");
    let light = "AreaLightSource \"diffuse\" \"string filename\" \"shade.pfm\" \"float power\" 6";
    std::fs::write(&path, format!("WorldBegin {light} Shape \"disk\"")).expect("writable");
    let scene = load(&path).expect("sound").scene;
    let emission = &scene.materials[shapes(&scene)[0].material.0 as usize].emission;
    // Mean radiance 2 and area pi give 2 pi^2.
    assert!(close(emission.factor, Vec3::splat(6.0 / (2.0 * PI * PI))), "{}", emission.factor);
}

#[test]
fn portals_stay_where_they_are() {
    let portal = "\"point3 portal\" [96 280 -523  96 280 -269  96 9 -269  96 9 -523]";
    let light = |more: &str| format!("Rotate 340 0 1 0 LightSource \"infinite\" \"rgb L\" [3 2 1] {more}\n");
    let sky = world(&light(portal)).environment.expect("a sky");
    let edges = [Vec3::new(0.0, -271.0, 0.0), Vec3::new(0.0, 0.0, 254.0)];
    let expected = Portal { corner: Vec3::new(96.0, 280.0, -523.0), edges };
    assert_eq!((sky.portal, sky.scale), (Some(expected), Vec3::new(3.0, 2.0, 1.0)));
    assert_eq!(world(&(light(portal) + &light(portal))).environment.expect("a sky").portal, Some(expected));
    let Loaded { scene, warnings } = read(&format!("WorldBegin {}{}", light(portal), light("")));
    assert_eq!(scene.environment.expect("a sky").portal, None);
    assert!(warnings.iter().any(|warning| warning.message.contains("portals of several")), "{warnings:?}");
}

#[test]
fn several_skies_become_one() {
    let scene =
        world("LightSource \"infinite\" \"rgb L\" [1 2 3] LightSource \"infinite\" \"rgb L\" [1 1 1]");
    assert_eq!(scene.environment.expect("a sky").scale, Vec3::new(2.0, 3.0, 4.0));
}

#[test]
fn area_lights_shine_from_one_side_with_their_power() {
    let light = |text: &str, shape: &str| {
        let scene = world(&format!("AreaLightSource \"diffuse\" {text} {shape}"));
        scene.materials[shapes(&scene)[0].material.0 as usize].clone()
    };
    let plain = light("\"rgb L\" [1 2 3] \"float scale\" 2", "Shape \"sphere\"");
    assert_eq!((plain.emission.factor, plain.emission_two_sided), (Vec3::new(2.0, 4.0, 6.0), false));
    let power = light("\"float power\" 8 \"bool twosided\" true", "Shape \"sphere\" \"float radius\" 2");
    let expected = 8.0 / (2.0 * 4.0 * PI * 4.0 * PI);
    assert!(close(power.emission.factor, Vec3::splat(expected)) && power.emission_two_sided);
    let triangle = light("\"float power\" 8", &format!("Scale 2 2 2 {TRIANGLE}"));
    assert!(close(triangle.emission.factor, Vec3::splat(8.0 / (2.0 * PI))));
    let glowing = light("\"blackbody L\" 3000 \"float scale\" 5", "Shape \"sphere\"");
    let luminance = glowing.emission.factor.dot(Vec3::new(0.2126, 0.7152, 0.0722));
    assert!((luminance - 5.0).abs() < 1e-2, "{luminance}");
}

#[test]
fn lights_without_surfaces() {
    let scene = world(
        "Translate 1 0 0
         LightSource \"point\" \"rgb I\" [1 2 3] \"point3 from\" [0 1 0] \"float power\" 4
         LightSource \"spot\" \"point3 to\" [2 0 0] \"float coneangle\" 40 \"float conedelta\" 10
         LightSource \"distant\" \"point3 from\" [0 5 0] \"point3 to\" [0 0 0] \"float illuminance\" 7",
    );
    let [Light::Point { position, intensity }, Light::Spot { direction, inner_angle, outer_angle, .. }, sun] =
        &scene.lights[..]
    else {
        panic!("{:?}", scene.lights)
    };
    assert_eq!(*position, Vec3::new(1.0, 1.0, 0.0));
    assert!(close(*intensity, Vec3::new(1.0, 2.0, 3.0) / PI));
    assert!(close(*direction, Vec3::X));
    assert_eq!((*inner_angle, *outer_angle), (30_f32.to_radians(), 40_f32.to_radians()));
    let Light::Directional { direction, irradiance } = sun else { panic!("{sun:?}") };
    assert!(close(*direction, Vec3::NEG_Y) && close(*irradiance, Vec3::splat(7.0)));
}

#[test]
fn media_lie_where_interfaces_say() {
    let scene = read(
        "MakeNamedMedium \"fog\" \"string type\" \"homogeneous\" \"rgb sigma_s\" [1 2 3] \"float scale\" 0.5
             \"float g\" 0.2
         MediumInterface \"\" \"fog\" Camera \"perspective\"
         WorldBegin Shape \"sphere\"
         MediumInterface \"fog\" \"fog\" Shape \"sphere\"
         MediumInterface \"\" Shape \"sphere\"",
    )
    .scene;
    assert_eq!(scene.media[0].scattering, Vec3::new(0.5, 1.0, 1.5));
    assert_eq!(scene.media[0].g, 0.2);
    let fog = Some(quietus_trace::desc::MediumId(0));
    assert_eq!(scene.cameras[0].medium, fog);
    let media: Vec<_> = shapes(&scene).iter().map(|shape| shape.media).collect();
    let border = media[0].expect("a border");
    assert_eq!((border.inside, border.outside), (None, fog));
    assert_eq!(media[1..], [None, None]);
}

/// The medium that `text` describes, which must be sound all the way to the tracer.
fn medium(text: &str) -> quietus_trace::desc::Medium {
    let scene = world(&format!("MakeNamedMedium \"m\" {text}"));
    quietus_trace::scene::Scene::build(&scene).unwrap_or_else(|error| panic!("{text}: {error}"));
    scene.media[0].clone()
}

#[test]
fn media_without_coefficients_are_those_of_pbrt() {
    let plain = medium("\"string type\" \"homogeneous\" \"float scale\" 2");
    assert_eq!([plain.absorption, plain.scattering], [Vec3::splat(2.0); 2]);
    let preset =
        medium("\"string type\" \"homogeneous\" \"string preset\" \"Espresso\" \"rgb sigma_a\" [9 9 9]");
    assert_eq!(preset.absorption, Vec3::new(4.7984, 6.5751, 8.8493), "presets count");
}

#[test]
fn media_on_grids() {
    let text = "\"string type\" \"uniformgrid\" \"integer nx\" 2 \"integer ny\" 1 \"integer nz\" 3
        \"float density\" [1 2 3 4 5 6] \"rgb sigma_a\" [1 1 1] \"rgb sigma_s\" [2 2 2] \"float scale\" 3
        \"point3 p0\" [0 0 0] \"point3 p1\" [2 4 8]";
    let scene = world(&format!("Translate 10 0 0 Scale 2 2 2 MakeNamedMedium \"m\" {text}"));
    let variation = scene.media[0].variation.as_ref().expect("a grid");
    assert_eq!(scene.media[0].scattering, Vec3::splat(6.0));
    assert!(close(variation.from_world.transform_point3(Vec3::new(14.0, 8.0, 16.0)), Vec3::ONE));
    let Density::Grid(grid) = &variation.density else { panic!("{variation:?}") };
    assert_eq!((grid.size, grid.values[5]), ([2, 1, 3], 6.0));

    let fire = medium(
        "\"string type\" \"uniformgrid\" \"integer nx\" 2 \"float density\" [1 1] \"float temperature\" [ .5 .2 ]
         \"float temperaturescale\" 4000 \"float temperatureoffset\" .1 \"float Lescale\" [ 3 4 ]",
    );
    let glow = fire.variation.expect("a grid").glow.clone();
    let Some(Glow::Heat { colors, hottest, scale, .. }) = &glow else { panic!("{glow:?}") };
    assert_eq!((*hottest, scale.as_ref().expect("a grid").values[1]), (0.5, 4.0));
    let [first, last] = [colors[0], colors[colors.len() - 1]];
    assert_eq!(first, Vec3::ZERO, "nothing glows below the offset");
    assert!(last.x > 2.0 * last.y && last.y > 2.0 * last.z, "1600 K are orange: {last}");

    // One number counts everywhere.
    for light in ["\"float temperature\" [1 2]", "\"rgb Le\" [1 1 1]"] {
        let even = medium(&format!(
            "\"string type\" \"uniformgrid\" \"integer nx\" 2 \"float density\" [1 1] \"float Lescale\" 3 {light}"
        ));
        assert_eq!(even.emission, Vec3::splat(3.0), "{light}");
    }

    let colored = medium(
        "\"string type\" \"rgbgrid\" \"rgb sigma_a\" [1 2 3] \"rgb Le\" [ 4 5 6 ] \"float Lescale\" .5
         \"float scale\" 2",
    );
    assert_eq!((colored.absorption, colored.emission), (Vec3::splat(2.0), Vec3::splat(0.5)));
    let variation = colored.variation.expect("a grid");
    let Density::Colors { absorption: Some(grid), scattering: None } = &variation.density else {
        panic!("{variation:?}")
    };
    assert_eq!(grid.values, [Vec3::new(1.0, 2.0, 3.0)]);
    assert!(
        matches!(&variation.glow, Some(Glow::Colors(grid)) if grid.values[0] == Vec3::new(4.0, 5.0, 6.0))
    );

    let cloud = medium("\"string type\" \"cloud\" \"float density\" 2 \"point3 p1\" [3 1 1]");
    let density = cloud.variation.expect("a cloud").density.clone();
    let Density::Cloud { density, wispiness, frequency, to_cloud } = density else { panic!("{density:?}") };
    assert_eq!([density, wispiness, frequency], [2.0, 1.0, 5.0]);
    assert!(close(to_cloud.transform_point3(Vec3::ONE), Vec3::new(3.0, 1.0, 1.0)));
}

#[test]
fn lights_that_send_pictures() {
    let folder = tempfile::tempdir().expect("a folder");
    let pfm = |name: &str, width: u32, texels: &[f32]| {
        let mut bytes = format!("PF\n{width} 2\n-1.0\n").into_bytes();
        texels.iter().flat_map(|t| [t; 3]).for_each(|t| bytes.extend(t.to_le_bytes()));
        std::fs::write(folder.path().join(name), bytes).expect("writable");
    };
    pfm("square.pfm", 2, &[1.0, 2.0, 3.0, 2.0]);
    pfm("wide.pfm", 4, &[1.0; 8]);
    let path = folder.path().join("main.pbrt");
    let lights = |text: &str| {
        std::fs::write(&path, format!("WorldBegin Translate 0 0 3 {text}")).expect("writable");
        let scene = load(&path).unwrap_or_else(|error| panic!("{error}")).scene;
        quietus_trace::scene::Scene::build(&scene).unwrap_or_else(|error| panic!("{text}: {error}"));
        scene.lights
    };
    let found = lights("LightSource \"goniometric\" \"string filename\" \"square.pfm\" \"float power\" 8");
    let Light::Picture { position, from_world, intensity, spread, .. } = &found[0] else {
        panic!("{found:?}")
    };
    assert_eq!((*position, *spread), (Vec3::Z * 3.0, PictureSpread::AllAround));
    assert!(close(*from_world * Vec3::Y, Vec3::Z), "the diagram's pole is y");
    // The mean of the diagram is 2.
    assert!(
        (intensity.dot(Vec3::new(0.2126, 0.7152, 0.0722)) - 8.0 / (4.0 * PI * 2.0)).abs() < 1e-3,
        "{intensity}"
    );

    let found = lights(
        "LightSource \"projection\" \"string filename\" \"wide.pfm\" \"float fov\" 90 \"float scale\" 2",
    );
    let Light::Picture { from_world, intensity, spread, .. } = &found[0] else { panic!("{found:?}") };
    let PictureSpread::Window { half } = spread else { panic!("{spread:?}") };
    assert!(half.abs_diff_eq(Vec2::new(2.0, 1.0), 1e-5), "the shorter side has the angle: {half}");
    assert_eq!(*intensity, Vec3::splat(2.0));
    assert!(close(*from_world * Vec3::Y, Vec3::NEG_Y), "the first row is on top");

    std::fs::write(&path, "WorldBegin LightSource \"goniometric\" \"string filename\" \"wide.pfm\"")
        .expect("writable");
    let error = load(&path).expect_err("no square").to_string();
    assert!(error.contains("4 x 2, expected a square"), "{error}");
}

#[test]
fn lights_of_alpha_0_are_not_seen() {
    let scene = world("AreaLightSource \"diffuse\" Shape \"sphere\" \"float alpha\" 0");
    assert_eq!(scene.materials[0].alpha, Alpha::Unseen);
    let scene = world("Shape \"sphere\" \"float alpha\" 0");
    assert!(matches!(scene.materials[0].alpha, Alpha::Blend { .. }));
}

/// The fuzzer's seeds are good for this, too: densities and temperatures in one file, where the file says they lie.
#[test]
fn media_of_nanovdb_lie_where_their_file_says() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/nanovdb");
    let medium = |name: &str, more: &str| {
        let text = format!(
            "WorldBegin Translate 1 0 0 MakeNamedMedium \"a\" \"string type\" \"nanovdb\" {more}\
             \"string filename\" \"{name}\" \"rgb sigma_s\" [1 2 3] \"rgb sigma_a\" [0 0 0] \"float scale\" 2"
        );
        load_bytes(&folder.join("scene.pbrt"), text.as_bytes()).map(|loaded| loaded.scene.media[0].clone())
    };
    let fog = medium("zip.nvdb", "").expect("sound");
    assert!(close(fog.scattering, Vec3::new(2.0, 4.0, 6.0)) && fog.absorption == Vec3::ZERO);
    let variation = fog.variation.expect("it varies");
    let Density::Grid(grid) = &variation.density else { panic!("{:?}", variation.density) };
    // One leaf from 0, 0, 0 on, and what surrounds it.
    assert_eq!((grid.blocks(), grid.values.len()), ([3; 3], 512));
    assert!(variation.glow.is_none());
    // Voxels are half a unit wide, and the medium is moved by one.
    let middle_of_voxel = |x: f32| variation.from_world.transform_point3(Vec3::new(1.0 + 0.5 * x, 0.0, 0.0));
    assert!(close(24.0 * middle_of_voxel(3.0), Vec3::new(11.5, 8.5, 8.5)), "{}", middle_of_voxel(3.0));

    // Temperatures lie elsewhere than densities.
    let fire =
        medium("two-grids.nvdb", "\"float LeScale\" 3 \"float temperaturescale\" 4000").expect("sound");
    assert_eq!(fire.emission, Vec3::splat(3.0));
    let error = medium("two-segments.nvdb", "\"rgb Le\" [1 1 1]").expect_err("Le is not for these");
    assert!(error.message().contains("\"Le\""), "{error}");
    for (name, words) in
        [("blosc.nvdb", "cannot be unpacked"), ("vectors.nvdb", "32-bit floats"), ("no.nvdb", "no such file")]
    {
        let error = medium(name, "").expect_err(name);
        assert!(error.to_string().contains(words) && error.to_string().contains(name), "{error}");
    }
}
