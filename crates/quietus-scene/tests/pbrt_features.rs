//! Scenes of pbrt written in place, each for one thing that its reader has to get right.

use std::f32::consts::PI;
use std::path::Path;

use glam::{Vec2, Vec3};
use quietus_scene::{Loaded, load, load_bytes};
use quietus_trace::desc::{
    Alpha, Camera, CurveKind, Density, EnvironmentLayout, FrameAxis, Geometry, Glow, HairColor, Interior,
    Light, Mapping, Material, Mesh, Metal, NoisePattern, PictureSpread, Portal, Projection, Quadric,
    RoughnessScale, SceneDesc, Shape, Surface, Texels, Texture, Wrap,
};
use quietus_trace::filter::FilterShape;

fn read(text: &str) -> Loaded {
    load_bytes(Path::new("test.pbrt"), text.as_bytes()).unwrap_or_else(|error| panic!("{error}"))
}

/// What stands after `WorldBegin`.
fn world(text: &str) -> SceneDesc {
    read(&format!("WorldBegin\n{text}")).scene
}

/// What stands before it.
fn header(text: &str) -> SceneDesc {
    read(&format!("{text}\nWorldBegin")).scene
}

fn camera(text: &str) -> Camera {
    header(text).cameras.remove(0)
}

fn material(text: &str) -> Material {
    let scene = world(&format!("{text}\nShape \"sphere\""));
    scene.materials[shapes(&scene)[0].material.0 as usize].clone()
}

fn shapes(scene: &SceneDesc) -> Vec<&Shape> {
    scene.objects.iter().flat_map(|object| &object.shapes).collect()
}

fn mesh(shape: &Shape) -> &Mesh {
    let Geometry::Mesh(mesh) = &shape.geometry else { panic!("expected a mesh, found {:?}", shape.geometry) };
    mesh
}

fn close(a: Vec3, b: Vec3) -> bool {
    a.abs_diff_eq(b, 1e-5)
}

const TRIANGLE: &str = "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]";

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

/// The direction at (u, v) of a picture with latitude and longitude, as `EnvironmentLayout` and `Projection` define it.
fn lat_long(u: f32, v: f32) -> Vec3 {
    let (longitude, polar) = (2.0 * PI * (u - 0.5), PI * v);
    Vec3::new(polar.sin() * longitude.sin(), polar.cos(), -polar.sin() * longitude.cos())
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

/// A float map of one row of `values` over another.
fn float_map(path: &Path, width: usize, values: &[f32]) {
    let mut bytes = format!("Pf\n{width} {}\n-1\n", values.len() / width).into_bytes();
    for row in values.chunks(width).rev() {
        bytes.extend(row.iter().flat_map(|value| value.to_le_bytes()));
    }
    std::fs::write(path, bytes).expect("a writable folder");
}

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
fn glass_splits_colours_by_its_spectrum() {
    let index = |eta: &str| match material(&format!("Material \"dielectric\" {eta}")).surface {
        Surface::Glass(glass) => glass.ior,
        Surface::Dielectric { ior, .. } => Vec3::splat(ior),
        other => panic!("{other:?}"),
    };
    // The more of blue, the more it bends; between its indices at 700 and 400 nm (Schott's table of N-BK7).
    let bk7 = index("\"spectrum eta\" \"glass-BK7\"");
    assert!(1.5131 < bk7.x && bk7.x < bk7.y && bk7.y < bk7.z && bk7.z < 1.5308, "{bk7}");
    assert_eq!(index("\"spectrum eta\" [200 1.25 900 1.25]"), Vec3::splat(1.25));
    assert_eq!(index("\"rgb eta\" [1.25 1.5 1.75]"), Vec3::new(1.25, 1.5, 1.75));
    assert_eq!(index("\"float eta\" 1.25"), Vec3::splat(1.25));
    // Linear from 400 to 700 nm: about 1.7, 1.53 and 1.2 where red, green and blue are seen.
    let ramp = index("\"spectrum eta\" [400 1 700 2]");
    assert!(ramp.abs_diff_eq(Vec3::new(1.68, 1.5, 1.18), 0.06), "{ramp}");
}

#[test]
fn what_transforms_flatten_is_left_out() {
    let flat = "ConcatTransform [-0 -0 0 0 0 1 0 0 -1e-16 0 -1 0 7 8 9 1]";
    let Loaded { scene, warnings } = read(&format!(
        "WorldBegin ObjectBegin \"a\" Shape \"sphere\" ObjectEnd AttributeBegin {flat} AttributeBegin AttributeEnd
         Shape \"sphere\" LightSource \"point\" ObjectInstance \"a\" AttributeEnd LightSource \"point\" {TRIANGLE}"
    ));
    assert_eq!((shapes(&scene).len(), scene.instances.len(), scene.lights.len()), (2, 1, 1));
    let said = warnings.iter().filter(|warning| warning.message.contains("flattens space")).count();
    assert_eq!(said, 3, "{warnings:?}");
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
fn mirrors_keep_the_front_and_reversal_exchanges_it() {
    let scene = world(&format!("Scale -1 1 1 {TRIANGLE}"));
    let [shape] = shapes(&scene)[..] else { panic!("expected one shape") };
    let [a, b, c] = mesh(shape).triangles[0].map(|i| mesh(shape).positions[i as usize]);
    assert!((b - a).cross(c - a).z > 0.0, "the front of the unmirrored triangle faces +z, and so it stays");
    assert!(!shape.flipped);
    let scene = world(&format!("ReverseOrientation {TRIANGLE} ReverseOrientation {TRIANGLE}"));
    assert_eq!(shapes(&scene).iter().map(|shape| shape.flipped).collect::<Vec<_>>(), [true, false]);
    // Normals decide the front where they are given.
    let scene = world(&format!("{TRIANGLE} \"normal N\" [0 0 -1 0 0 -1 0 0 -1]"));
    assert_eq!(mesh(shapes(&scene)[0]).triangles, [[0, 2, 1]]);
}

#[test]
fn world_shapes_share_an_object_and_instances_stay() {
    let scene = world(
        "Translate 1 0 0 Shape \"sphere\" Shape \"disk\"
         ObjectBegin \"a\" Translate 0 1 0 Shape \"sphere\" Rotate 90 1 0 0 Shape \"cylinder\" ObjectEnd
         Scale 2 2 2 ObjectInstance \"a\" ObjectInstance \"a\"",
    );
    // The sphere; the disk, which has its own place; the object's sphere and cylinder, twice.
    assert_eq!(scene.instances.len(), 1 + 1 + 2 * 2);
    let Geometry::Sphere { center, radius } = scene.objects[0].shapes[0].geometry else { panic!("a sphere") };
    assert_eq!((center, radius), (Vec3::X, 1.0));
    let of_a: Vec<_> = scene.objects.iter().enumerate().filter(|(_, object)| object.name == "a").collect();
    assert_eq!(of_a.len(), 2);
    let sphere = scene.instances.iter().find(|i| i.object.0 as usize == of_a[0].0).expect("placed");
    // Defined one to the right and one up, in a world that is then doubled and one further to the right.
    assert!(close(sphere.to_world.transform_point3(Vec3::new(1.0, 1.0, 0.0)), Vec3::new(3.0, 2.0, 0.0)));
}

#[test]
fn motion_is_what_the_shutter_sees_of_it() {
    let moving = "ActiveTransform EndTime Translate 4 0 0 ActiveTransform All Shape \"sphere\"";
    let instance = |header: &str| {
        let scene = read(&format!("{header}\nWorldBegin {moving}")).scene;
        assert_eq!(scene.instances.len(), 1);
        let end = scene.instances[0].end_to_world.expect("it moves");
        [Vec3::from(scene.instances[0].to_world.translation), end.translation.into()]
    };
    assert_eq!(instance(""), [Vec3::ZERO, Vec3::new(4.0, 0.0, 0.0)]);
    let half = "Camera \"perspective\" \"float shutteropen\" 0.25 \"float shutterclose\" 0.5";
    assert_eq!(instance(half), [Vec3::X, Vec3::new(2.0, 0.0, 0.0)]);
    let later = "TransformTimes 0.25 0.75 Camera \"perspective\" \"float shutteropen\" 0.5";
    assert_eq!(instance(later), [Vec3::new(2.0, 0.0, 0.0), Vec3::new(4.0, 0.0, 0.0)]);
    let camera = camera("ActiveTransform EndTime Translate 0 0 1 ActiveTransform All Camera \"perspective\"");
    assert!(camera.end_to_world.is_some());
}

#[test]
fn materials_have_pbrts_defaults() {
    let Surface::Diffuse { reflectance } = material("").surface else { panic!("diffuse") };
    assert_eq!(reflectance.factor, Vec3::splat(0.5));
    let Surface::CoatedDiffuse { coat, .. } = material("Material \"coateddiffuse\"").surface else {
        panic!()
    };
    assert_eq!((coat.ior, coat.thickness.factor, coat.max_depth), (1.5, 0.01, 10));
    assert_eq!((coat.albedo.factor, coat.roughness.scale), (Vec3::ZERO, RoughnessScale::SquareRoot));
    let raw =
        "Material \"dielectric\" \"float eta\" 1.3 \"float roughness\" 0.2 \"bool remaproughness\" false";
    let Surface::Dielectric { ior, roughness, .. } = material(raw).surface else { panic!() };
    assert_eq!((ior, roughness.u.factor, roughness.v.factor), (1.3, 0.2, 0.2));
    assert_eq!(roughness.scale, RoughnessScale::Alpha);
    let Surface::Conductor { metal: Metal::Index { eta, k }, .. } =
        material("Material \"conductor\"").surface
    else {
        panic!("a metal")
    };
    // Copper: redder than blue.
    let reflectance = ((eta - 1.0).powf(2.0) + k * k) / ((eta + 1.0).powf(2.0) + k * k);
    assert!(reflectance.x > reflectance.y && reflectance.y > reflectance.z, "{reflectance}");
    let Surface::Hair(hair) = material("Material \"hair\"").surface else { panic!() };
    assert!(matches!(hair.color, HairColor::Pigments { eumelanin, .. } if eumelanin.factor == 1.3));
    assert_eq!((hair.ior, hair.beta_m.factor, hair.alpha), (1.55, 0.3, 2_f32.to_radians()));
}

#[test]
fn attributes_and_named_materials() {
    let scene = world(
        "NamedMaterial \"later\"
         AttributeBegin Attribute \"shape\" \"float radius\" 3 Shape \"sphere\" Shape \"sphere\" \"float radius\" 2
         AttributeEnd Shape \"sphere\"
         MakeNamedMaterial \"later\" \"string type\" \"thindielectric\"",
    );
    let radius = |shape: &Shape| match shape.geometry {
        Geometry::Sphere { radius, .. } => radius,
        _ => panic!("a sphere"),
    };
    assert_eq!(shapes(&scene).into_iter().map(radius).collect::<Vec<_>>(), [3.0, 2.0, 1.0]);
    assert!(matches!(scene.materials[0].surface, Surface::ThinDielectric { .. }));
}

#[test]
fn equal_materials_are_one() {
    let one =
        "AttributeBegin Material \"diffuse\" \"rgb reflectance\" [.1 .2 .3] Shape \"sphere\" AttributeEnd\n";
    assert_eq!(world(&one.repeat(9)).materials.len(), 1);
    let lit = "AttributeBegin AreaLightSource \"diffuse\" \"rgb L\" [1 2 3] Shape \"sphere\" AttributeEnd\n";
    assert_eq!(world(&(one.repeat(2) + &lit.repeat(2))).materials.len(), 2);
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
fn pictures_hang_upright() {
    let folder = tempfile::tempdir().expect("a folder");
    float_map(&folder.path().join("a.pfm"), 1, &[0.25, 0.75]);
    let path = folder.path().join("test.pbrt");
    let text = "WorldBegin
        Texture \"a\" \"spectrum\" \"imagemap\" \"string filename\" \"a.pfm\" \"float vscale\" 2 \"float vdelta\" 0.25
            \"string wrap\" \"clamp\" \"float scale\" 0.5 \"bool invert\" true
        Texture \"b\" \"float\" \"imagemap\" \"string filename\" \"a.pfm\" \"bool invert\" true
        Texture \"c\" \"float\" \"scale\" \"texture tex\" \"b\" \"float scale\" 3
        Material \"diffuse\" \"texture reflectance\" \"a\" \"texture displacement\" \"c\"
        Shape \"sphere\" \"texture alpha\" \"b\"";
    std::fs::write(&path, text).expect("writable");
    let scene = load(&path).expect("sound").scene;
    let Texture::Image(a) = &scene.textures[0] else { panic!("an image") };
    assert_eq!((a.wrap, a.invert), ([Wrap::Clamp; 2], false));
    let Mapping::Uv { transform, .. } = a.mapping else { panic!("{:?}", a.mapping) };
    assert!(transform.transform_point2(Vec2::new(0.5, 0.25)).abs_diff_eq(Vec2::new(0.5, 0.25), 1e-6));
    // A factor comes before inverting.
    let Texels::Float(texels) = &a.image.texels else { panic!("floats") };
    assert_eq!([texels[0][0], texels[1][0]], [1.0 - 0.5 * 0.25, 1.0 - 0.5 * 0.75]);
    let material = &scene.materials[0];
    let bump = material.bump.expect("a bump map");
    assert_eq!((bump.factor, bump.texture), (3.0, Some((quietus_trace::desc::TextureId(1), 0))));
    assert!(matches!(material.alpha, Alpha::Blend { value } if value.factor == 1.0));
    // Texels lie where pbrt's parametrisation of the sphere puts them.
    assert!(matches!(shapes(&scene)[0].geometry, Geometry::Quadric(Quadric::PartialSphere { .. })));
}

#[test]
fn textures_of_textures() {
    let scene = world(
        "Texture \"a\" \"float\" \"checkerboard\" \"integer dimension\" 3
         Texture \"b\" \"spectrum\" \"mix\" \"rgb tex1\" [1 0 0] \"texture amount\" \"a\"
         Texture \"c\" \"spectrum\" \"scale\" \"texture tex\" \"b\" \"float scale\" 0.5
         Texture \"d\" \"spectrum\" \"constant\" \"rgb value\" [.1 .2 .3]
         Material \"diffusetransmission\" \"texture reflectance\" \"c\" \"texture transmittance\" \"d\"
         Shape \"sphere\"",
    );
    assert!(matches!(scene.textures[0], Texture::Checkerboard { mapping: Mapping::Solid { .. }, .. }));
    assert!(matches!(scene.textures[1], Texture::Mix { .. }));
    let Surface::DiffuseTransmission { reflectance, transmittance } = scene.materials[0].surface else {
        panic!()
    };
    assert_eq!(reflectance.factor, Vec3::splat(0.5));
    assert_eq!(reflectance.texture, Some(quietus_trace::desc::TextureId(1)));
    assert_eq!((transmittance.factor, transmittance.texture), (Vec3::new(0.1, 0.2, 0.3), None));
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

#[test]
fn curves_that_look_the_same_are_one_shape() {
    let curve = "Shape \"curve\" \"string type\" \"cylinder\" \"float width0\" 0.2 \"float width1\" 0.1
        \"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0 4 0 0 5 0 0 6 0 0]\n";
    let scene = world(&format!("Scale 2 2 2 {curve} {curve} ReverseOrientation {curve}"));
    let [a, b] = shapes(&scene)[..] else { panic!("{} shapes", shapes(&scene).len()) };
    let segments = |shape: &Shape| match &shape.geometry {
        Geometry::Curves(curves) => (curves.kind, curves.segments.clone()),
        _ => panic!("curves"),
    };
    let (kind, both) = segments(if a.flipped { b } else { a });
    assert_eq!((kind, both.len()), (CurveKind::Cylinder, 4));
    assert!(close(both[1].points[3], Vec3::new(12.0, 0.0, 0.0)));
    assert!((both[0].widths[1] - 0.3).abs() < 1e-6 && (both[1].widths[0] - 0.3).abs() < 1e-6);
    assert_eq!(segments(if a.flipped { a } else { b }).1.len(), 2);
}

#[test]
fn colour_spaces_and_coordinate_systems() {
    let scene = world(
        "ColorSpace \"rec2020\" Material \"diffuse\" \"rgb reflectance\" [.5 .5 .5] Shape \"sphere\"
         Translate 1 2 3 CoordinateSystem \"here\" Identity AttributeBegin CoordSysTransform \"here\"
         Shape \"sphere\" AttributeEnd",
    );
    let Surface::Diffuse { reflectance } = scene.materials[0].surface else { panic!() };
    assert!(close(reflectance.factor, Vec3::splat(0.5)), "grey is grey everywhere");
    let Geometry::Sphere { center, .. } = shapes(&scene)[1].geometry else { panic!() };
    assert_eq!(center, Vec3::new(1.0, 2.0, 3.0));
}

#[test]
fn included_files_go_on_and_imported_ones_leave_no_trace() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &[u8]| std::fs::write(folder.path().join(name), text).expect("writable");
    write("part.pbrt", b"Translate 1 0 0 Shape \"sphere\"");
    let read = |text: &str| {
        write("main.pbrt", text.as_bytes());
        let scene = load(&folder.path().join("main.pbrt")).unwrap_or_else(|error| panic!("{error}")).scene;
        let center = |shape: &&Shape| match shape.geometry {
            Geometry::Sphere { center, .. } => center.x,
            _ => panic!("a sphere"),
        };
        shapes(&scene).iter().map(center).collect::<Vec<_>>()
    };
    assert_eq!(read("WorldBegin Include \"part.pbrt\" Shape \"sphere\""), [1.0, 1.0]);
    // A list of parameters goes on behind the file that begins it, and over the ends of several.
    write("nested.pbrt", b"Translate 1 0 0 Include \"part.pbrt\" # the end");
    for text in [
        "WorldBegin Include \"part.pbrt\" \"float radius\" 2 Shape \"sphere\"",
        "WorldBegin Include \"nested.pbrt\"\n\"float radius\" [ 2 ]\nTranslate -1 0 0 Shape \"sphere\"",
    ] {
        let centers = read(text);
        assert_eq!(centers.len(), 2, "{text}");
        assert_eq!(centers[1], 1.0, "{text}");
        let scene = load(&folder.path().join("main.pbrt")).expect("sound").scene;
        assert!(matches!(shapes(&scene)[0].geometry, Geometry::Sphere { radius: 2.0, .. }), "{text}");
    }
    assert_eq!(read("WorldBegin Import \"part.pbrt\" Shape \"sphere\""), [1.0, 0.0]);
    // The same, packed.
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    std::io::Write::write_all(&mut packed, b"Translate 1 0 0 Shape \"sphere\"").expect("a writable vector");
    write("part.pbrt.gz", &packed.finish().expect("a writable vector"));
    assert_eq!(read("WorldBegin Include \"part.pbrt.gz\" Shape \"sphere\""), [1.0, 1.0]);
}

#[test]
fn a_mesh_file_that_several_shapes_use() {
    let folder = tempfile::tempdir().expect("a folder");
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 1 0 0 0 1 0 3 0 1 2\n";
    std::fs::write(folder.path().join("a.ply"), ply).expect("writable");
    let path = folder.path().join("main.pbrt");
    let shape = "Shape \"plymesh\" \"string filename\" \"a.ply\"";
    std::fs::write(&path, format!("WorldBegin {shape} Translate 0 0 1 {shape}")).expect("writable");
    let scene = load(&path).expect("sound").scene;
    let heights: Vec<_> = shapes(&scene).iter().map(|shape| mesh(shape).positions[0].z).collect();
    assert_eq!(heights, [0.0, 1.0]);
    assert_eq!(scene.instances.len(), 1);
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
fn patterns_without_pictures() {
    let texture = |kind: &str, text: &str| {
        let scene = world(&format!(
            "Translate 1 0 0 Texture \"t\" \"{kind}\" {text}\nMaterial \"diffuse\" \"texture {}\" \"t\" Shape \"sphere\"",
            if kind == "float" { "displacement" } else { "reflectance" }
        ));
        quietus_trace::scene::Scene::build(&scene).unwrap_or_else(|error| panic!("{text}: {error}"));
        scene.textures[0].clone()
    };
    let marble = texture("spectrum", "\"marble\" \"float scale\" 4 \"integer octaves\" 3");
    let Texture::Noise { from_world, pattern } = marble else { panic!("{marble:?}") };
    assert!(close(from_world.transform_point3(Vec3::X), Vec3::ZERO));
    assert_eq!(pattern, NoisePattern::Marble { octaves: 3, roughness: 0.5, scale: 4.0, variation: 0.2 });
    for (name, expected) in [
        ("fbm", NoisePattern::Brownian { octaves: 8, roughness: 0.5 }),
        ("wrinkled", NoisePattern::Wrinkled { octaves: 8, roughness: 0.5 }),
        ("windy", NoisePattern::Windy),
    ] {
        let found = texture("float", &format!("\"{name}\""));
        assert!(matches!(found, Texture::Noise { pattern, .. } if pattern == expected), "{found:?}");
    }
    let corners = texture("spectrum", "\"bilerp\" \"rgb v10\" [1 0 0] \"rgb v01\" [0 1 0]");
    let Texture::Corners { colors, .. } = corners else { panic!("{corners:?}") };
    assert_eq!(colors, [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE]);
    let dots = texture("spectrum", "\"dots\" \"rgb inside\" [1 0 0]");
    assert!(matches!(dots, Texture::Dots { colors: [c, _], .. } if c.factor == Vec3::X), "{dots:?}");
    let mix = texture("spectrum", "\"directionmix\" \"vector3 dir\" [0 0 2]");
    assert!(matches!(mix, Texture::Facing { direction, .. } if direction == Vec3::Z), "{mix:?}");
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
fn subdivision_surfaces_are_divided() {
    let scene = world(
        "Shape \"loopsubdiv\" \"integer levels\" 2 \"integer indices\" [0 1 2 0 3 1 0 2 3 1 3 2]
         \"point3 P\" [0 0 1 1 0 -.5 -1 1 -.5 -1 -1 -.5]",
    );
    let surface = mesh(shapes(&scene)[0]);
    assert_eq!(surface.triangles.len(), 4 * 16);
    assert_eq!(surface.normals.len(), surface.positions.len());
}

#[test]
fn lights_of_alpha_0_are_not_seen() {
    let scene = world("AreaLightSource \"diffuse\" Shape \"sphere\" \"float alpha\" 0");
    assert_eq!(scene.materials[0].alpha, Alpha::Unseen);
    let scene = world("Shape \"sphere\" \"float alpha\" 0");
    assert!(matches!(scene.materials[0].alpha, Alpha::Blend { .. }));
}

#[test]
fn light_wanders_below_what_is_named_measured_or_coloured() {
    let below = |text: &str| match material(&format!("Material \"subsurface\" {text}")).surface {
        Surface::Subsurface(s) => *s,
        surface => panic!("expected light below, found {surface:?}"),
    };
    let coefficients = |text: &str| match below(text).interior {
        Interior::Coefficients { absorption, scattering } => {
            [absorption, scattering].map(|color| color.factor)
        }
        interior => panic!("expected coefficients, found {interior:?}"),
    };
    let skin = below("\"string name\" \"Skin1\" \"float scale\" 10");
    assert_eq!((skin.ior, skin.g), (1.33, 0.0));
    let [absorption, scattering] = coefficients("\"string name\" \"Skin1\" \"float scale\" 10");
    assert!(close(absorption, Vec3::new(0.32, 1.7, 4.8)) && close(scattering, Vec3::new(7.4, 8.8, 10.1)));
    let [absorption, _] = coefficients("");
    assert!(close(absorption, Vec3::new(0.0011, 0.0024, 0.014)), "whole milk, {absorption}");
    let [absorption, scattering] =
        coefficients("\"spectrum sigma_a\" [300 2 800 2] \"spectrum sigma_s\" [300 5 800 5]");
    assert!(close(absorption, Vec3::splat(2.0)) && close(scattering, Vec3::splat(5.0)));
    let texture = "Texture \"t\" \"spectrum\" \"checkerboard\"\n";
    let scene = world(&format!(
        "{texture}Material \"subsurface\" \"texture reflectance\" \"t\" \"rgb mfp\" [1 2 4]\
         \"float scale\" 0.5 \"float eta\" 1.5 \"float g\" 0.5 Shape \"sphere\""
    ));
    let Surface::Subsurface(s) = &scene.materials[0].surface else { panic!("expected light below") };
    let Interior::Reflectance { reflectance, mean_free_path } = s.interior else {
        panic!("{:?}", s.interior)
    };
    assert!(reflectance.texture.is_some() && close(mean_free_path.factor, Vec3::new(0.5, 1.0, 2.0)));
    assert_eq!((s.ior, s.g), (1.5, 0.5));
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

/// What is grey at all wavelengths stays so, what is red becomes red; a file is read once.
#[test]
fn measured_materials_come_from_tensor_files() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/measured");
    let load = |name: &str| {
        let one = format!("Material \"measured\" \"string filename\" \"{name}\" Shape \"sphere\"\n");
        let text = format!("WorldBegin {one} Translate 3 0 0 {one}");
        load_bytes(&folder.join("scene.pbrt"), text.as_bytes()).map(|loaded| loaded.scene)
    };
    let scene = load("isotropic.bsdf").expect("sound");
    assert_eq!(scene.materials.len(), 1);
    let Surface::Measured(measured) = &scene.materials[0].surface else { panic!("{:?}", scene.materials[0]) };
    assert!(measured.is_isotropic() && measured.polar_angles.len() == 3);
    let color = measured.colors.values[0];
    assert!(color.x > color.y && color.y > color.z && color.z > 0.0, "{color}");
    let scene = load("anisotropic.bsdf").expect("sound");
    let Surface::Measured(measured) = &scene.materials[0].surface else { panic!("{:?}", scene.materials[0]) };
    assert!(!measured.is_isotropic());
    let error = load("cut.bsdf").expect_err("cut");
    assert!(error.file().ends_with("cut.bsdf") && error.message().contains("are left"), "{error}");
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
