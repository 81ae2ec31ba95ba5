//! Materials, textures and spectra.

use super::*;

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
