//! One small document per feature of glTF.

mod common;

use common::{add_accessor, data_uri, floats, read, read_ok, triangle};
use glam::{Vec2, Vec3, Vec4};
use quietus_scene::Loaded;
use quietus_trace::desc::{
    Alpha, Camera, FrameAxis, Geometry, ImageTexture, Light, Mapping, Mesh, MetalRough, Projection,
    SceneDesc, Surface, TexelFilter, Texels, Texture, Wrap,
};
use serde_json::{Value, json};

fn mesh(scene: &SceneDesc) -> &Mesh {
    match &scene.objects[0].shapes[0].geometry {
        Geometry::Mesh(mesh) => mesh,
        other => panic!("glTF has no {other:?}"),
    }
}

fn fov(camera: &Camera) -> f32 {
    match camera.projection {
        Projection::Perspective { fov, axis: FrameAxis::Vertical } => fov,
        other => panic!("glTF has no {other:?}"),
    }
}

fn image_texture(scene: &SceneDesc, index: usize) -> &ImageTexture {
    match &scene.textures[index] {
        Texture::Image(texture) => texture,
        other => panic!("glTF has no {other:?}"),
    }
}

fn metal_rough(scene: &SceneDesc) -> &MetalRough {
    match &scene.materials[0].surface {
        Surface::MetalRough(surface) => surface,
        other => panic!("glTF has no {other:?}"),
    }
}

fn warns(document: &Value, about: &str) {
    let warnings = read_ok(document).warnings;
    assert!(warnings.iter().any(|warning| warning.to_string().contains(about)), "{warnings:?}");
}

/// A picture of 2 x 1 texels as PNG.
fn png(picture: image::DynamicImage) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut bytes, image::ImageFormat::Png).expect("memory does not fail");
    bytes.into_inner()
}

fn small_png() -> Vec<u8> {
    let texels = vec![255, 0, 0, 255, 128, 128, 128, 64];
    png(image::RgbaImage::from_raw(2, 1, texels).expect("eight numbers").into())
}

/// The triangle with one material and one texture.
fn textured(material: Value) -> Value {
    let mut document = triangle();
    document["materials"] = json!([material]);
    document["meshes"][0]["primitives"][0]["material"] = json!(0);
    document["textures"] = json!([{"source": 0, "sampler": 0}]);
    document["samplers"] = json!([{"magFilter": 9728, "wrapS": 33071, "wrapT": 33648}]);
    document["images"] = json!([{"uri": data_uri(&small_png())}]);
    document
}

#[test]
fn a_plain_triangle() {
    let loaded = read_ok(&triangle());
    let mesh = mesh(&loaded.scene);
    assert_eq!(mesh.positions, [Vec3::ZERO, Vec3::X, Vec3::Y]);
    assert_eq!(mesh.triangles, [[0, 1, 2]]);
    assert!(mesh.normals.is_empty(), "flat normals");
    assert!(loaded.scene.environment.is_some(), "a sky");
    assert_eq!(loaded.warnings.len(), 2, "{:?}", loaded.warnings);
}

#[test]
fn the_added_camera_sees_every_corner() {
    let loaded = read_ok(&triangle());
    let camera = &loaded.scene.cameras[0];
    let outermost = common::outermost(camera, mesh(&loaded.scene).positions.iter().copied());
    // As near as the margin allows.
    assert!((outermost - 0.95).abs() < 1e-4, "{outermost}");
}

/// The added camera goes where it sees fronts.
#[test]
fn the_added_camera_looks_past_backs() {
    let direction = |document: &Value| read_ok(document).scene.cameras[0].to_world.matrix3.z_axis;
    let mut document = triangle();
    assert!(direction(&document).x > 0.1, "a front is seen from the right");
    // A quarter turn: the triangle's front looks to -x.
    document["nodes"][0]["rotation"] = json!([0, -0.5_f32.sqrt(), 0, 0.5_f32.sqrt()]);
    assert!(direction(&document).x < -0.1, "a front that looks to the left is seen from the left");
}

/// A cube of `size` metres around `center`, as positions of its triangles.
fn cube(size: f32, center: Vec3) -> Vec<f32> {
    let corner =
        |i: u32| center + size * (Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) - 0.5);
    let sides = [[0, 2, 1, 3], [4, 5, 6, 7], [0, 1, 4, 5], [2, 6, 3, 7], [0, 4, 2, 6], [1, 3, 5, 7]];
    let triangles = sides.into_iter().flat_map(|[a, b, c, d]| [a, b, c, b, d, c]);
    triangles.flat_map(|i| corner(i).to_array()).collect()
}

/// The added camera does not show a thing as a speck for the sake of the ground it stands on, or of one that is lost.
#[test]
fn the_added_camera_shows_what_a_scene_is_about() {
    let thing = cube(1.0, Vec3::ZERO);
    let plane = |size: f32| {
        let [a, b, c, d] = [[-size, 0., -size], [size, 0., -size], [-size, 0., size], [size, 0., size]];
        [a, c, b, b, c, d].concat()
    };
    let with = |other: &[f32]| {
        let mut document = triangle();
        document["meshes"] = json!([]);
        document["nodes"] = json!([]);
        for (i, positions) in [&thing[..], other].into_iter().enumerate() {
            let fields = json!({"componentType": 5126, "count": positions.len() / 3, "type": "VEC3"});
            let accessor = add_accessor(&mut document, &floats(positions), fields);
            let mesh = json!({"primitives": [{"attributes": {"POSITION": accessor}}]});
            document["meshes"].as_array_mut().expect("an array").push(mesh);
            document["nodes"].as_array_mut().expect("an array").push(json!({"mesh": i}));
        }
        document["scenes"][0]["nodes"] = json!([0, 1]);
        read_ok(&document)
    };
    let said = |loaded: &Loaded| loaded.warnings.iter().any(|warning| warning.message.contains("backdrops"));
    let thing_seen = |loaded: &Loaded| {
        let points = thing.as_chunks::<3>().0.iter().map(|&point| Vec3::from_array(point));
        common::outermost(&loaded.scene.cameras[0], points)
    };
    // A ground plane, and a crumb far off.
    for other in [plane(500.0), cube(0.01, Vec3::new(300.0, 20.0, 40.0))] {
        let loaded = with(&other);
        let seen = thing_seen(&loaded);
        assert!(said(&loaded) && (seen - 0.95).abs() < 1e-3, "{seen}");
    }
    // A table top and a second thing belong to the scene.
    for other in [plane(2.0), cube(1.0, Vec3::new(30.0, 0.0, 0.0))] {
        let loaded = with(&other);
        let seen = thing_seen(&loaded);
        assert!(!said(&loaded) && seen < 0.96, "{seen}");
        let points = other.as_chunks::<3>().0.iter().map(|&point| Vec3::from_array(point));
        assert!(common::outermost(&loaded.scene.cameras[0], points) < 0.951);
    }
}

#[test]
fn strips_and_fans() {
    let corners = [0., 0., 0., 1., 0., 0., 0., 1., 0., 1., 1., 0., 0., 2., 0.];
    for (mode, expected) in
        [(5, vec![[0, 1, 2], [1, 3, 2], [2, 3, 4]]), (6, vec![[1, 2, 0], [2, 3, 0], [3, 4, 0]])]
    {
        let mut document = triangle();
        let fields = json!({"componentType": 5126, "count": 5, "type": "VEC3"});
        let position = add_accessor(&mut document, &floats(&corners), fields);
        let primitive = &mut document["meshes"][0]["primitives"][0];
        primitive["attributes"]["POSITION"] = json!(position);
        primitive["mode"] = json!(mode);
        assert_eq!(mesh(&read_ok(&document).scene).triangles, expected);
    }
}

/// About a pixel wide, in the colours of the vertices, and lit only where they have normals.
#[test]
fn points_and_lines_have_an_extent() {
    for (mode, vertices, triangles) in [(0, 3 * 6, 3 * 8), (1, 8, 8), (2, 3 * 8, 3 * 8), (3, 2 * 8, 2 * 8)] {
        let mut document = triangle();
        document["nodes"][0]["scale"] = json!([10, 10, 10]);
        let colors = floats(&[1., 0., 0., 0., 1., 0., 0., 0., 1.]);
        let color =
            add_accessor(&mut document, &colors, json!({"componentType": 5126, "count": 3, "type": "VEC3"}));
        let primitive = &mut document["meshes"][0]["primitives"][0];
        primitive["mode"] = json!(mode);
        primitive["attributes"]["COLOR_0"] = json!(color);
        if mode == 1 {
            // The third vertex has no partner.
            primitive["attributes"]["NORMAL"] = json!(0);
        }
        let loaded = read_ok(&document);
        let mesh = mesh(&loaded.scene);
        assert_eq!((mesh.positions.len(), mesh.triangles.len()), (vertices, triangles), "mode {mode}");
        // The diagonal of the box in the world is 10 times that of the unit square, and so is the node's scale.
        let radius = if mode == 0 { 1.5e-3 } else { 0.5e-3 } * 2.0_f32.sqrt();
        let at_corner = mesh.positions.iter().zip(&mesh.colors).filter(|(_, color)| color.x == 1.0);
        for (position, _) in at_corner {
            assert!((position.length() - radius).abs() < 1e-6, "{position}");
        }
        let Surface::MetalRough(surface) = &loaded.scene.materials[0].surface else {
            panic!("expected glTF's")
        };
        assert_eq!(surface.unlit, mode != 1);
    }
}

#[test]
fn indices_of_every_type() {
    for (code, bytes) in [
        (5121, vec![2, 1, 0]),
        (5123, vec![2, 0, 1, 0, 0, 0]),
        (5125, vec![2, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0]),
    ] {
        let mut document = triangle();
        let fields = json!({"componentType": code, "count": 3, "type": "SCALAR"});
        let indices = add_accessor(&mut document, &bytes, fields);
        document["meshes"][0]["primitives"][0]["indices"] = json!(indices);
        assert_eq!(mesh(&read_ok(&document).scene).triangles, [[2, 1, 0]]);
    }
}

#[test]
fn sparse_accessors() {
    let mut document = triangle();
    let index =
        add_accessor(&mut document, &[1], json!({"componentType": 5121, "count": 1, "type": "SCALAR"}));
    let value = floats(&[5., 6., 7.]);
    let value =
        add_accessor(&mut document, &value, json!({"componentType": 5126, "count": 1, "type": "VEC3"}));
    let view = |document: &Value, accessor: usize| document["accessors"][accessor]["bufferView"].clone();
    document["accessors"][0]["sparse"] = json!({
        "count": 1,
        "indices": {"bufferView": view(&document, index), "componentType": 5121},
        "values": {"bufferView": view(&document, value)}
    });
    let expected = Vec3::new(5., 6., 7.);
    assert_eq!(mesh(&read_ok(&document).scene).positions, [Vec3::ZERO, expected, Vec3::Y]);
    // Without a buffer view the other elements are zero.
    document["accessors"][0].as_object_mut().expect("an object").remove("bufferView");
    assert_eq!(mesh(&read_ok(&document).scene).positions, [Vec3::ZERO, expected, Vec3::ZERO]);
}

#[test]
fn strides_and_normalized_integers() {
    let mut document = triangle();
    // Two bytes of texture coordinates, two of something else.
    let bytes = [0, 255, 9, 9, 51, 102, 9, 9, 255, 0];
    let fields = json!({"componentType": 5121, "normalized": true, "count": 3, "type": "VEC2"});
    let uv = add_accessor(&mut document, &bytes, fields);
    let view = document["accessors"][uv]["bufferView"].as_u64().expect("an index") as usize;
    document["bufferViews"][view]["byteStride"] = json!(4);
    document["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = json!(uv);
    let expected = [Vec2::new(0., 1.), Vec2::new(0.2, 0.4), Vec2::new(1., 0.)];
    assert_eq!(mesh(&read_ok(&document).scene).uvs, [vec![], expected.to_vec()]);
}

#[test]
fn vertex_colors_without_alpha() {
    let mut document = triangle();
    let bytes: Vec<u8> =
        [65535_u16, 0, 0, 0, 65535, 0, 0, 0, 0].iter().flat_map(|c| c.to_le_bytes()).collect();
    let fields = json!({"componentType": 5123, "normalized": true, "count": 3, "type": "VEC3"});
    let color = add_accessor(&mut document, &bytes, fields);
    document["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(color);
    let expected = [Vec4::new(1., 0., 0., 1.), Vec4::new(0., 1., 0., 1.), Vec4::W];
    assert_eq!(mesh(&read_ok(&document).scene).colors, expected);
}

#[test]
fn normals_without_direction_are_replaced() {
    let mut document = triangle();
    let normals = floats(&[0., 0., 2., 0., 0., 0., 0., 3., 0.]);
    let fields = json!({"componentType": 5126, "count": 3, "type": "VEC3"});
    let normal = add_accessor(&mut document, &normals, fields);
    document["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(normal);
    assert_eq!(mesh(&read_ok(&document).scene).normals, [Vec3::Z, Vec3::Z, Vec3::Y]);
    warns(&document, "attributes.NORMAL: 1 normals");
}

#[test]
fn directions_that_are_no_numbers_are_replaced() {
    let mut document = triangle();
    let normals = floats(&[f32::NAN, 0., 0., 0., 0., 1., 0., f32::INFINITY, 0.]);
    let index =
        add_accessor(&mut document, &normals, json!({"componentType": 5126, "count": 3, "type": "VEC3"}));
    document["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(index);
    assert_eq!(mesh(&read_ok(&document).scene).normals, [Vec3::Z; 3]);
    warns(&document, "meshes[0].primitives[0].attributes.NORMAL: 2 elements");
}

#[test]
fn what_is_not_visible_is_left_out_with_all_below() {
    let mut document = triangle();
    document["extensionsUsed"] = json!(["KHR_node_visibility", "KHR_lights_punctual"]);
    document["extensionsRequired"] = json!(["KHR_node_visibility"]);
    document["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point"}]}});
    document["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]);
    let hidden = json!({"KHR_node_visibility": {"visible": false}});
    document["nodes"] = json!([
        {"mesh": 0},
        {"extensions": hidden, "children": [2]},
        {"mesh": 0, "camera": 0, "extensions": {
            "KHR_lights_punctual": {"light": 0}, "KHR_node_visibility": {"visible": true}}}
    ]);
    document["scenes"][0]["nodes"] = json!([0, 1]);
    let scene = read_ok(&document).scene;
    assert_eq!((scene.instances.len(), scene.lights.len(), scene.cameras.len()), (1, 0, 1));
    document["nodes"][1]["extensions"] = json!({});
    let scene = read_ok(&document).scene;
    assert_eq!((scene.instances.len(), scene.lights.len(), scene.cameras.len()), (2, 1, 1));
}

#[test]
fn what_glows_no_brighter_than_white_lights_no_scene() {
    let mut document = triangle();
    document["materials"] = json!([{"emissiveFactor": [1, 1, 1]}]);
    document["meshes"][0]["primitives"][0]["material"] = json!(0);
    assert!(read_ok(&document).scene.environment.is_some());
    let strength = json!({"KHR_materials_emissive_strength": {"emissiveStrength": 2}});
    document["materials"][0]["extensions"] = strength;
    assert!(read_ok(&document).scene.environment.is_none());
}

#[test]
fn node_transforms() {
    let mut document = triangle();
    document["nodes"] = json!([
        {"translation": [1, 2, 3], "rotation": [0, 0, 0.707_106_77, 0.707_106_77], "scale": [2, 2, 2], "children": [1]},
        {"matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 10, 0, 0, 1], "mesh": 0}
    ]);
    let to_world = read_ok(&document).scene.instances[0].to_world;
    // (1, 0, 0) is moved to (11, 0, 0), doubled, turned to +y, and moved.
    let corner = to_world.transform_point3(Vec3::X);
    assert!(corner.distance(Vec3::new(1., 24., 3.)) < 1e-4, "{corner}");
}

#[test]
fn one_object_for_a_mesh_used_twice() {
    let mut document = triangle();
    document["nodes"] =
        json!([{"mesh": 0}, {"mesh": 0, "scale": [-1, 1, 1]}, {"mesh": 0, "scale": [0, 1, 1]}]);
    document["scenes"][0]["nodes"] = json!([0, 1, 2]);
    let scene = read_ok(&document).scene;
    assert_eq!((scene.objects.len(), scene.instances.len()), (1, 2));
    assert!(scene.instances[1].to_world.matrix3.determinant() < 0.0);
    warns(&document, "nodes[2]: is scaled to nothing");
}

#[test]
fn several_scenes_and_none() {
    let mut document = triangle();
    document["scenes"] = json!([{"nodes": []}, {"nodes": [0]}]);
    document["scene"] = json!(1);
    assert_eq!(read_ok(&document).scene.instances.len(), 1);
    warns(&document, "only scenes[1] is drawn");
    document.as_object_mut().expect("an object").retain(|name, _| name != "scene" && name != "scenes");
    assert_eq!(read_ok(&document).scene.instances.len(), 1);
}

#[test]
fn cameras() {
    let mut document = triangle();
    document["cameras"] = json!([
        {"type": "perspective", "perspective": {"yfov": 0.7, "aspectRatio": 1.5, "znear": 0.1}},
        {"type": "orthographic", "orthographic": {"xmag": 3, "ymag": -2, "zfar": 2, "znear": 1}}
    ]);
    document["nodes"] = json!([
        {"mesh": 0},
        {"camera": 0, "name": "left", "translation": [0, 0, 5], "scale": [3, 3, -3]},
        {"camera": 0, "name": "left"},
        {"camera": 1}
    ]);
    document["scenes"][0]["nodes"] = json!([0, 1, 2, 3]);
    let cameras = read_ok(&document).scene.cameras;
    assert_eq!(
        cameras.iter().map(|camera| camera.name.as_str()).collect::<Vec<_>>(),
        ["left", "left 2", "cameras[1]"]
    );
    assert_eq!((fov(&cameras[0]), cameras[0].aspect), (0.7, Some(1.5)));
    let axes = cameras[0].to_world.matrix3;
    assert_eq!(axes.determinant(), 1.0, "scale and mirroring are taken off: {axes}");
    assert_eq!(axes.z_axis, glam::Vec3A::NEG_Z, "the mirrored node looks the other way");
    assert_eq!(cameras[2].projection, Projection::Orthographic { extent: 4.0, axis: FrameAxis::Vertical });
    assert_eq!(cameras[2].aspect, Some(1.5));
}

#[test]
fn punctual_lights() {
    let mut document = triangle();
    document["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "point", "color": [1, 0.5, 0], "intensity": 10},
        {"type": "spot", "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.3}},
        {"type": "directional", "intensity": 3}
    ]}});
    let light =
        |i: usize| json!({"extensions": {"KHR_lights_punctual": {"light": i}}, "translation": [0, i, 0]});
    document["nodes"] = json!([{"mesh": 0}, light(0), light(1), light(2)]);
    document["scenes"][0]["nodes"] = json!([0, 1, 2, 3]);
    let scene = read_ok(&document).scene;
    assert!(scene.environment.is_none(), "lit scenes get no sky");
    assert!(matches!(scene.lights[0], Light::Point { intensity, .. } if intensity == Vec3::new(10., 5., 0.)));
    let Light::Spot { position, direction, inner_angle, outer_angle, .. } = scene.lights[1] else {
        panic!("expected a spot")
    };
    assert_eq!((position, direction, inner_angle, outer_angle), (Vec3::Y, Vec3::NEG_Z, 0.1, 0.3));
    assert!(
        matches!(scene.lights[2], Light::Directional { irradiance, .. } if irradiance == Vec3::splat(3.))
    );
}

#[test]
fn material_with_every_extension() {
    let texture = json!({"index": 0});
    let document = textured(json!({
        "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.5,
            "roughnessFactor": 0.6, "baseColorTexture": texture, "metallicRoughnessTexture": texture},
        "normalTexture": {"index": 0, "scale": 2.0},
        "emissiveFactor": [0.5, 0.25, 0], "doubleSided": true,
        "alphaMode": "MASK", "alphaCutoff": 0.3,
        "extensions": {
            "KHR_materials_emissive_strength": {"emissiveStrength": 8},
            "KHR_materials_transmission": {"transmissionFactor": 0.7, "transmissionTexture": texture},
            "KHR_materials_ior": {"ior": 1.33},
            "KHR_materials_specular": {"specularFactor": 0.8, "specularTexture": texture,
                "specularColorFactor": [1, 2, 3]},
            "KHR_materials_clearcoat": {"clearcoatFactor": 0.9, "clearcoatRoughnessFactor": 0.2,
                "clearcoatRoughnessTexture": texture, "clearcoatNormalTexture": texture}
        }
    }));
    let scene = read_ok(&document).scene;
    let (material, surface) = (&scene.materials[0], metal_rough(&scene));
    assert_eq!(surface.base_color.factor, Vec3::new(0.1, 0.2, 0.3));
    assert_eq!((surface.metallic.factor, surface.roughness.factor, surface.ior), (0.5, 0.6, 1.33));
    let channel = |texture: Option<(quietus_trace::desc::TextureId, u8)>| texture.map(|(_, channel)| channel);
    assert_eq!(channel(surface.metallic.texture), Some(2));
    assert_eq!(channel(surface.roughness.texture), Some(1));
    assert_eq!((surface.transmission.factor, channel(surface.transmission.texture)), (0.7, Some(0)));
    assert_eq!((surface.specular.factor, channel(surface.specular.texture)), (0.8, Some(3)));
    assert_eq!(surface.specular_color.factor, Vec3::new(1., 2., 3.));
    assert_eq!((surface.clearcoat.factor, channel(surface.clearcoat.texture)), (0.9, None));
    assert_eq!(channel(surface.clearcoat_roughness.texture), Some(1));
    assert!(surface.clearcoat_normal.is_some_and(|(_, scale)| scale == 1.0));
    assert!(material.normal_map.is_some_and(|(_, scale)| scale == 2.0));
    assert_eq!(material.emission.factor, Vec3::new(4., 2., 0.));
    assert!(material.emission_two_sided && scene.environment.is_none());
    let Alpha::Mask { value, cutoff } = material.alpha else { panic!("expected a mask") };
    assert_eq!((value.factor, channel(value.texture), cutoff), (0.4, Some(3), 0.3));
    // One texture as colours, one as numbers, each decoded once.
    assert_eq!(scene.textures.len(), 2);
    assert!(
        matches!(&image_texture(&scene, 0).image.texels, Texels::Linear8(t) if t[1] == [128, 128, 128, 64])
    );
    assert!(matches!(&image_texture(&scene, 1).image.texels, Texels::Srgb8(t) if t[0] == [255, 0, 0, 255]));
    assert_eq!(image_texture(&scene, 0).wrap, [Wrap::Clamp, Wrap::Mirror]);
    assert_eq!(image_texture(&scene, 0).filter, TexelFilter::Nearest);
}

#[test]
fn unlit_and_blend() {
    let document = textured(json!({
        "alphaMode": "BLEND", "emissiveFactor": [1, 1, 1], "extensions": {"KHR_materials_unlit": {}}
    }));
    let scene = read_ok(&document).scene;
    assert!(metal_rough(&scene).unlit);
    assert_eq!(scene.materials[0].emission.factor, Vec3::ZERO);
    assert!(matches!(scene.materials[0].alpha, Alpha::Blend { .. }));
}

#[test]
fn texture_transforms_reach_every_texture() {
    let transformed = json!({"index": 0, "texCoord": 0, "extensions": {"KHR_texture_transform":
        {"offset": [0.5, 0.25], "rotation": std::f32::consts::FRAC_PI_2, "scale": [2, 3], "texCoord": 1}}});
    let document = textured(json!({"normalTexture": transformed, "emissiveTexture": {"index": 0}}));
    let scene = read_ok(&document).scene;
    let (map, _) = scene.materials[0].normal_map.expect("a normal map");
    let Mapping::Uv { set, transform } = image_texture(&scene, map.0 as usize).mapping else {
        panic!("mapped by uv")
    };
    assert_eq!(set, 1);
    // u is doubled, then turned counter-clockwise as seen, that is towards smaller v.
    let (u, v) = (transform.transform_point2(Vec2::X), transform.transform_point2(Vec2::Y));
    assert!(u.distance(Vec2::new(0.5, 0.25 - 2.)) < 1e-6, "{u}");
    assert!(v.distance(Vec2::new(0.5 + 3., 0.25)) < 1e-6, "{v}");
    assert_eq!(scene.textures.len(), 2, "the plain use is another texture");
    assert!(
        std::sync::Arc::ptr_eq(&image_texture(&scene, 0).image, &image_texture(&scene, 1).image)
            || scene.textures.len() == 2
    );
}

#[test]
fn sixteen_bit_pictures_become_floats() {
    let texels = vec![65535_u16, 32768, 0, 0, 0, 65535];
    let picture = image::ImageBuffer::<image::Rgb<u16>, _>::from_raw(2, 1, texels).expect("six numbers");
    let mut document = textured(json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    document["images"] = json!([{"uri": data_uri(&png(picture.into()))}]);
    let scene = read_ok(&document).scene;
    let Texels::Float(texels) = &image_texture(&scene, 0).image.texels else { panic!("expected floats") };
    // The sRGB curve at 32768/65535, from its definition: ((0.5000076 + 0.055) / 1.055)^2.4.
    let expected = ((32768.0_f64 / 65535.0 + 0.055) / 1.055).powf(2.4) as f32;
    assert!((texels[0][1] - expected).abs() < 1e-6, "{texels:?}");
    assert_eq!((texels[0][0], texels[0][3], texels[1][2]), (1.0, 1.0, 1.0));
}

#[test]
fn pictures_and_buffers_from_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut document = textured(json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    document["images"] = json!([{"uri": "my%20picture.png"}]);
    document["buffers"][0]["uri"] = json!("b%C3%BCffer.bin");
    let write = |name: &str, bytes: &[u8]| {
        std::fs::write(folder.path().join(name), bytes).expect("a writable folder");
    };
    write("my picture.png", &small_png());
    write("büffer.bin", &floats(&[0., 0., 0., 1., 0., 0., 0., 1., 0.]));
    write("scene.gltf", document.to_string().as_bytes());
    let scene = quietus_scene::load(&folder.path().join("scene.gltf")).expect("a sound file").scene;
    assert_eq!(image_texture(&scene, 0).image.width, 2);
    assert_eq!(mesh(&scene).positions[1], Vec3::X);
}

#[test]
fn pictures_from_buffer_views_of_a_binary_file() {
    let mut document = textured(json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    let picture = small_png();
    document["buffers"][0] = json!({"byteLength": 36 + picture.len()});
    document["bufferViews"] = json!([{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": picture.len()}]);
    document["images"] = json!([{"bufferView": 1, "mimeType": "image/png"}]);
    let mut bin = floats(&[0., 0., 0., 1., 0., 0., 0., 1., 0.]);
    bin.extend(&picture);
    bin.resize(bin.len().next_multiple_of(4), 0);
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut glb = b"glTF\x02\0\0\0".to_vec();
    glb.extend((12 + 16 + json.len() as u32 + bin.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &json), (b"BIN\0", &bin)] {
        glb.extend((chunk.len() as u32).to_le_bytes());
        glb.extend(kind);
        glb.extend(chunk);
    }
    let scene = quietus_scene::load_bytes("test.glb".as_ref(), &glb).expect("a sound file").scene;
    assert_eq!(image_texture(&scene, 0).image.width, 2);
}

#[test]
fn optional_extensions_are_named_once() {
    let mut document = triangle();
    document["extensionsUsed"] =
        json!(["EXT_lights_image_based", "KHR_materials_ior", "EXT_other", "KHR_xmp_json_ld"]);
    let warnings = read_ok(&document).warnings;
    let named: Vec<_> = warnings.iter().filter(|warning| warning.place == "extensionsUsed").collect();
    assert_eq!(named.len(), 2, "{named:?}");
    document["extensionsRequired"] = json!(["KHR_xmp_json_ld"]);
    read_ok(&document);
    document["extensionsRequired"] = json!(["EXT_lights_image_based"]);
    let error = read(&document).expect_err("an extension that is not supported");
    assert!(error.message().contains("EXT_lights_image_based"), "{error}");
}
