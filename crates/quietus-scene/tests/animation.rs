//! Animations, morph targets and skins, against vertices computed by hand.

mod common;

use common::{add_accessor, floats, read, read_ok, scene_file, triangle};
use glam::{Mat4, Quat, Vec3, Vec4};
use proptest::prelude::*;
use quietus_scene::{Loaded, SceneFile};
use quietus_trace::desc::{Geometry, Light, Mapping, Mesh, Projection, SceneDesc, Surface, Texture};
use serde_json::{Value, json};

/// The mesh of instance `index`.
fn mesh(scene: &SceneDesc, index: usize) -> &Mesh {
    let object = scene.instances[index].object.0 as usize;
    match &scene.objects[object].shapes[0].geometry {
        Geometry::Mesh(mesh) => mesh,
        other => panic!("glTF has no {other:?}"),
    }
}

/// Adds an accessor of floats of the type `kind`.
fn add_floats(document: &mut Value, kind: &str, values: &[f32]) -> usize {
    let width = match kind {
        "SCALAR" => 1,
        "VEC3" => 3,
        "VEC4" => 4,
        _ => 16,
    };
    let fields = json!({"componentType": 5126, "count": values.len() / width, "type": kind});
    add_accessor(document, &floats(values), fields)
}

/// Adds an animation of one property of `node`.
fn animate(
    document: &mut Value,
    (node, path): (usize, &str),
    interpolation: &str,
    times: &[f32],
    values: &[f32],
) {
    let kind = match path {
        "rotation" => "VEC4",
        "weights" => "SCALAR",
        _ => "VEC3",
    };
    let input = add_floats(document, "SCALAR", times);
    let output = add_floats(document, kind, values);
    let clip = json!({
        "channels": [{"sampler": 0, "target": {"node": node, "path": path}}],
        "samplers": [{"input": input, "output": output, "interpolation": interpolation}]
    });
    match document["animations"].as_array_mut() {
        Some(clips) => clips.push(clip),
        None => document["animations"] = json!([clip]),
    }
}

/// Adds a morph target that moves the three vertices of the triangle, and its normals if it has any.
fn add_target(document: &mut Value, positions: &[f32], normals: Option<&[f32]>) {
    let mut target = json!({"POSITION": add_floats(document, "VEC3", positions)});
    if let Some(normals) = normals {
        target["NORMAL"] = json!(add_floats(document, "VEC3", normals));
    }
    match document["meshes"][0]["primitives"][0]["targets"].as_array_mut() {
        Some(targets) => targets.push(target),
        None => document["meshes"][0]["primitives"][0]["targets"] = json!([target]),
    }
}

/// Hangs the triangle on the joints 1 and 2, which stand in the origin and a unit above; `weights` are of the first
/// two joints, for each vertex.
fn add_skin(document: &mut Value, weights: [[f32; 2]; 3]) {
    let joints = [0_u8, 1, 0, 0].repeat(3);
    let fields = json!({"componentType": 5121, "count": 3, "type": "VEC4"});
    let joints = add_accessor(document, &joints, fields);
    let weights: Vec<f32> = weights.iter().flat_map(|w| [w[0], w[1], 0.0, 0.0]).collect();
    let weights = add_floats(document, "VEC4", &weights);
    let attributes = &mut document["meshes"][0]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = json!(joints);
    attributes["WEIGHTS_0"] = json!(weights);
    let inverses = [Mat4::IDENTITY, Mat4::from_translation(Vec3::NEG_Y)];
    let inverses: Vec<f32> = inverses.iter().flat_map(Mat4::to_cols_array).collect();
    let inverses = add_floats(document, "MAT4", &inverses);
    document["skins"] = json!([{"joints": [1, 2], "inverseBindMatrices": inverses}]);
    document["nodes"] = json!([
        {"mesh": 0, "skin": 0, "translation": [9, 9, 9]}, {"children": [2]}, {"translation": [0, 1, 0]}
    ]);
    document["scenes"][0]["nodes"] = json!([0, 1]);
}

fn at(file: &SceneFile, time: f32) -> Loaded {
    file.animated(0, [time; 2]).unwrap_or_else(|error| panic!("at {time} s: {error}"))
}

fn close(found: &[Vec3], expected: &[[f32; 3]]) {
    assert_eq!(found.len(), expected.len());
    let near = |(a, b): (&Vec3, &[f32; 3])| {
        a.distance(Vec3::from_array(*b)) <= 4.0 * f32::EPSILON * a.length().max(1.0)
    };
    assert!(found.iter().zip(expected).all(near), "{found:?}, expected {expected:?}");
}

#[test]
fn animations_have_names_and_lengths() {
    let mut document = triangle();
    animate(&mut document, (0, "translation"), "LINEAR", &[0.5, 2.5], &[0.0; 6]);
    animate(&mut document, (0, "scale"), "STEP", &[1.0], &[1.0; 3]);
    document["animations"][1]["name"] = json!("blink");
    let file = scene_file(&document);
    let found: Vec<_> = file.animations().iter().map(|a| (a.name.as_str(), a.seconds)).collect();
    assert_eq!(found, [("animations[0]", 2.5), ("blink", 1.0)]);
    let still = file.still().expect("a sound file");
    assert_eq!(still.scene.instances[0].to_world, glam::Affine3A::IDENTITY);
    assert!(still.warnings.iter().any(|warning| warning.place == "animations"), "{:?}", still.warnings);
}

#[test]
fn every_property_at_every_interpolation() {
    let corner = |document: &Value, time: f32| {
        let scene = at(&scene_file(document), time).scene;
        scene.instances[0].to_world.transform_point3(Vec3::X)
    };
    let mut document = triangle();
    animate(&mut document, (0, "translation"), "LINEAR", &[1., 3.], &[0., 0., 0., 4., 8., 0.]);
    close(&[corner(&document, 0.0), corner(&document, 1.5)], &[[1., 0., 0.], [2., 2., 0.]]);
    let mut document = triangle();
    animate(&mut document, (0, "scale"), "STEP", &[1., 3.], &[1., 1., 1., 4., 4., 4.]);
    close(&[corner(&document, 2.9), corner(&document, 3.0)], &[[1., 0., 0.], [4., 0., 0.]]);
    // A quarter turn around +y, the second key with the other sign, which is the same rotation.
    let mut document = triangle();
    let turn = |angle: f32| Quat::from_rotation_y(angle).to_array();
    let half = std::f32::consts::FRAC_PI_2;
    let keys = [turn(0.0), turn(half).map(|value| -value)].concat();
    animate(&mut document, (0, "rotation"), "LINEAR", &[0., 1.], &keys);
    let third = (half / 3.0).sin_cos();
    close(&[corner(&document, 1.0 / 3.0)], &[[third.1, 0., -third.0]]);
    // A spline from 0 to 2 with slopes 3 and 0: 3 t - t^3 over a second.
    let mut document = triangle();
    let keys = [[7.; 3], [0.; 3], [3.; 3], [0.; 3], [2.; 3], [7.; 3]].concat();
    animate(&mut document, (0, "translation"), "CUBICSPLINE", &[0., 1.], &keys);
    close(&[corner(&document, 0.5)], &[[1. + 1.375, 1.375, 1.375]]);
}

#[test]
fn children_follow_their_parents() {
    let mut document = triangle();
    document["nodes"] = json!([{"children": [1], "translation": [1, 0, 0]}, {"mesh": 0, "scale": [2, 2, 2]}]);
    animate(&mut document, (0, "translation"), "LINEAR", &[0., 1.], &[0., 0., 0., 0., 5., 0.]);
    let scene = at(&scene_file(&document), 1.0).scene;
    assert_eq!(scene.instances[0].to_world.transform_point3(Vec3::X), Vec3::new(2., 5., 0.));
}

#[test]
fn morph_targets_add_up() {
    let mut document = triangle();
    let normals = add_floats(&mut document, "VEC3", &[0., 0., 1.].repeat(3));
    document["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(normals);
    add_target(&mut document, &[1., 0., 0., 0., 2., 0., 0., 0., 0.], Some(&[0., 1., 0.].repeat(3)));
    add_target(&mut document, &[0., 0., 3.].repeat(3), None);
    document["meshes"][0]["weights"] = json!([0.5, 1.0]);
    document["nodes"] =
        json!([{"mesh": 0}, {"mesh": 0, "weights": [0, 0]}, {"mesh": 0, "weights": [0.5, 1]}]);
    document["scenes"][0]["nodes"] = json!([0, 1, 2]);
    let scene = read_ok(&document).scene;
    close(&mesh(&scene, 0).positions, &[[0.5, 0., 3.], [1., 1., 3.], [0., 1., 3.]]);
    let tilted = Vec3::new(0., 0.5, 1.).normalize().to_array();
    close(&mesh(&scene, 0).normals, &[tilted; 3]);
    close(&mesh(&scene, 1).positions, &[[0.; 3], [1., 0., 0.], [0., 1., 0.]]);
    assert_eq!(scene.objects.len(), 2, "equal weights share an object");
    animate(&mut document, (1, "weights"), "LINEAR", &[0., 1.], &[0., 0., 0., 2.]);
    let scene = at(&scene_file(&document), 0.5).scene;
    close(&mesh(&scene, 1).positions, &[[0., 0., 3.], [1., 0., 3.], [0., 1., 3.]]);
}

#[test]
fn sparse_targets_move_what_they_list() {
    let mut document = triangle();
    add_target(&mut document, &[0.; 9], None);
    let fields = json!({"componentType": 5121, "count": 1, "type": "SCALAR"});
    let index = add_accessor(&mut document, &[2], fields);
    let value = add_floats(&mut document, "VEC3", &[5., 6., 7.]);
    let view = |document: &Value, accessor: usize| document["accessors"][accessor]["bufferView"].clone();
    let target = document["meshes"][0]["primitives"][0]["targets"][0]["POSITION"].as_u64().expect("an index");
    document["accessors"][target as usize] = json!({"componentType": 5126, "count": 3, "type": "VEC3", "sparse": {
        "count": 1,
        "indices": {"bufferView": view(&document, index), "componentType": 5121},
        "values": {"bufferView": view(&document, value)}
    }});
    document["meshes"][0]["weights"] = json!([2.0]);
    let scene = read_ok(&document).scene;
    close(&mesh(&scene, 0).positions, &[[0.; 3], [1., 0., 0.], [10., 13., 14.]]);
}

#[test]
fn skins_bend_vertices() {
    let mut document = triangle();
    let normals = add_floats(&mut document, "VEC3", &[0., 1., 0.].repeat(3));
    let tangents = add_floats(&mut document, "VEC4", &[1., 0., 0., 1.].repeat(3));
    document["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(normals);
    document["meshes"][0]["primitives"][0]["attributes"]["TANGENT"] = json!(tangents);
    // The last vertex hangs on the upper joint alone, with a weight that does not add up to 1.
    add_skin(&mut document, [[1., 0.], [0.5, 0.5], [0., 0.25]]);
    let rest = read_ok(&document).scene;
    close(&mesh(&rest, 0).positions, &[[0.; 3], [1., 0., 0.], [0., 1., 0.]]);
    assert_eq!(
        rest.instances[0].to_world,
        glam::Affine3A::IDENTITY,
        "the node's own transform does not count"
    );
    // The upper joint turns +x to -z and is doubled: x' = (2 z, 2 (y - 1) + 1, -2 x).
    let turn = Quat::from_rotation_y(std::f32::consts::FRAC_PI_2).to_array();
    animate(&mut document, (2, "rotation"), "STEP", &[0.], &turn);
    document["nodes"][2]["scale"] = json!([2, 2, 2]);
    let scene = at(&scene_file(&document), 0.0).scene;
    let bent = mesh(&scene, 0);
    close(&bent.positions, &[[0.; 3], [0.5, -0.5, -1.], [0., 1., 0.]]);
    close(&bent.normals, &[[0., 1., 0.]; 3]);
    let between = Vec3::new(0.5, 0., -1.).normalize().to_array();
    let tangents: Vec<_> = bent.tangents.iter().map(|tangent| tangent.truncate()).collect();
    close(&tangents, &[[1., 0., 0.], between, [0., 0., -1.]]);
    assert!(bent.tangents.iter().all(|tangent| tangent.w == 1.0) && bent.end_positions.is_empty());
}

#[test]
fn two_sets_of_joints() {
    let mut document = triangle();
    add_skin(&mut document, [[0.25, 0.25]; 3]);
    let fields = json!({"componentType": 5123, "count": 3, "type": "VEC4"});
    let joints = add_accessor(&mut document, &[1_u8, 0, 0, 0, 0, 0, 0, 0].repeat(3), fields);
    let fields = json!({"componentType": 5121, "normalized": true, "count": 3, "type": "VEC4"});
    // A weight of 51/255 beside 1/4 and 1/4: shares of 2/7 and 5/14 and 5/14.
    let weights = add_accessor(&mut document, &[51_u8, 0, 0, 0].repeat(3), fields);
    document["meshes"][0]["primitives"][0]["attributes"]["JOINTS_1"] = json!(joints);
    document["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_1"] = json!(weights);
    document["nodes"][2]["translation"] = json!([0, 15, 0]);
    let scene = read_ok(&document).scene;
    // The upper joint stands 14 above where it was bound, and has 9/14 of the weight.
    close(&mesh(&scene, 0).positions, &[[0., 9., 0.], [1., 9., 0.], [0., 10., 0.]]);
}

#[test]
fn mirrored_skins_keep_their_front() {
    let mut document = triangle();
    let normals = add_floats(&mut document, "VEC3", &[0., 0., 1.].repeat(3));
    let tangents = add_floats(&mut document, "VEC4", &[1., 0., 0., 1.].repeat(3));
    document["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(normals);
    document["meshes"][0]["primitives"][0]["attributes"]["TANGENT"] = json!(tangents);
    add_skin(&mut document, [[1., 0.]; 3]);
    document["nodes"][1]["scale"] = json!([-1, 1, 1]);
    let scene = read_ok(&document).scene;
    let shape = &scene.objects[0].shapes[0];
    assert!(shape.flipped, "triangles turned clockwise");
    close(&mesh(&scene, 0).positions, &[[0.; 3], [-1., 0., 0.], [0., 1., 0.]]);
    close(&mesh(&scene, 0).normals, &[[0., 0., 1.]; 3]);
    assert_eq!(mesh(&scene, 0).tangents[0], Vec4::new(-1., 0., 0., -1.));
}

#[test]
fn what_moves_has_an_end() {
    let mut document = triangle();
    document["nodes"] = json!([{"mesh": 0}, {"mesh": 0}, {"camera": 0}]);
    document["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1}}]);
    document["scenes"][0]["nodes"] = json!([0, 1, 2]);
    animate(&mut document, (1, "translation"), "LINEAR", &[0., 1.], &[0., 0., 0., 4., 0., 0.]);
    let file = scene_file(&document);
    let scene = file.animated(0, [0.25, 0.5]).expect("a sound file").scene;
    assert_eq!(scene.instances[0].end_to_world, None, "stands still");
    assert_eq!(scene.instances[1].to_world.translation.x, 1.0);
    assert_eq!(scene.instances[1].end_to_world.map(|end| end.translation.x), Some(2.0));
    assert_eq!((scene.cameras[0].end_to_world, scene.objects.len()), (None, 1));
    let behind = file.animated(0, [2.0, 2.5]).expect("a sound file").scene;
    assert_eq!(behind.instances[1].end_to_world, None, "the animation is over");
    document["animations"][0]["channels"][0]["target"]["node"] = json!(2);
    let scene = scene_file(&document).animated(0, [0.25, 0.5]).expect("a sound file").scene;
    assert_eq!(scene.cameras[0].end_to_world.map(|end| end.translation.x), Some(2.0));
}

#[test]
fn what_bends_has_an_end() {
    let mut document = triangle();
    add_target(&mut document, &[0., 0., 4.].repeat(3), None);
    animate(&mut document, (0, "weights"), "LINEAR", &[0., 1.], &[0., 1.]);
    let file = scene_file(&document);
    let scene = file.animated(0, [0.0, 0.5]).expect("a sound file").scene;
    close(&mesh(&scene, 0).positions, &[[0.; 3], [1., 0., 0.], [0., 1., 0.]]);
    close(&mesh(&scene, 0).end_positions, &[[0., 0., 2.], [1., 0., 2.], [0., 1., 2.]]);
    assert!(mesh(&scene, 0).end_normals.is_empty(), "as the normals");
    let frozen = file.animated(0, [0.5, 0.5]).expect("a sound file").scene;
    assert!(mesh(&frozen, 0).end_positions.is_empty());
}

#[test]
fn what_turns_inside_out_stands_still() {
    let mut document = triangle();
    animate(&mut document, (0, "scale"), "LINEAR", &[0., 1.], &[1., 1., 1., -1., 1., 1.]);
    let file = scene_file(&document);
    for end in [0.5, 1.0] {
        let loaded = file.animated(0, [0.0, end]).expect("a sound file");
        assert_eq!(loaded.scene.instances[0].end_to_world, None);
        assert!(loaded.warnings.iter().any(|warning| warning.message.contains("inside out")));
    }
}

#[test]
fn lights_stand_where_they_are_at_the_opening() {
    let mut document = triangle();
    document["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point"}]}});
    document["nodes"][0]["extensions"] = json!({"KHR_lights_punctual": {"light": 0}});
    animate(&mut document, (0, "translation"), "LINEAR", &[0., 1.], &[0., 0., 0., 4., 0., 0.]);
    let loaded = scene_file(&document).animated(0, [0.25, 0.5]).expect("a sound file");
    assert!(matches!(loaded.scene.lights[0], Light::Point { position, .. } if position == Vec3::X));
    assert!(loaded.warnings.iter().any(|warning| warning.message.contains("at the opening")));
}

/// The made-up camera sees the whole animation, and is the same for all of it.
#[test]
fn the_added_camera_sees_the_whole_animation() {
    let mut document = triangle();
    animate(&mut document, (0, "translation"), "LINEAR", &[0., 2.], &[0., 0., 0., 0., 7., 3.]);
    let mut file = scene_file(&document);
    for shape in [None, Some(0.5), Some(1.0), Some(2.5)] {
        if let Some(shape) = shape {
            file.set_picture_shape(shape);
        }
        let cameras: Vec<_> = [0.0, 1.0, 2.0].map(|time| at(&file, time).scene.cameras.remove(0)).into();
        assert!(cameras.iter().all(|camera| camera.to_world == cameras[0].to_world));
        let aspect = cameras[0].aspect.expect("a shape");
        assert!(shape.is_none_or(|shape| shape == aspect));
        let outermost = [0.0, 1.0, 2.0].map(|time| {
            let scene = at(&file, time).scene;
            common::outermost(
                &cameras[0],
                mesh(&scene, 0).positions.iter().map(|p| scene.instances[0].to_world.transform_point3(*p)),
            )
        });
        let outermost = outermost.into_iter().fold(0.0, f32::max);
        assert!(outermost < 1.0, "{shape:?}: {outermost} is outside of the picture");
        assert!(outermost > 0.9, "{shape:?}: only {outermost} of the picture is used");
    }
}

/// A document whose animations change what `pointers` lead to, from zeros to `value` in one second, by numbers of this type.
fn pointing(document: &mut Value, pointers: &[(&str, &str, &[f32])]) {
    document["extensionsUsed"] = json!(["KHR_animation_pointer"]);
    for (i, (pointer, kind, value)) in pointers.iter().enumerate() {
        animate(document, (0, "translation"), "LINEAR", &[0., 1.], &[0.; 6]);
        let zeros = vec![0.0; value.len()];
        let output = add_accessor(
            document,
            &floats(&[&zeros, *value].concat()),
            json!({"componentType": 5126, "count": 2, "type": kind}),
        );
        let animation = document["animations"].as_array_mut().expect("animations").pop().expect("one more");
        let mut sampler = animation["samplers"][0].clone();
        sampler["output"] = json!(output);
        if i == 0 {
            document["animations"]
                .as_array_mut()
                .expect("animations")
                .push(json!({"channels": [], "samplers": []}));
        }
        let last = document["animations"].as_array_mut().expect("animations").last_mut().expect("one");
        let extensions = json!({"KHR_animation_pointer": {"pointer": pointer}});
        let target = json!({"path": "pointer", "extensions": extensions});
        last["samplers"].as_array_mut().expect("samplers").push(sampler);
        last["channels"].as_array_mut().expect("channels").push(json!({"sampler": i, "target": target}));
    }
}

#[test]
fn pointers_change_materials() {
    let mut document = triangle();
    document["materials"] = json!([{"name": "still"}, {"name": "moving", "emissiveFactor": [0, 0, 0]}]);
    document["meshes"][0]["primitives"][0]["material"] = json!(1);
    let strength = "/materials/1/extensions/KHR_materials_emissive_strength/emissiveStrength";
    pointing(
        &mut document,
        &[
            ("/materials/1/pbrMetallicRoughness/baseColorFactor", "VEC4", &[1., 0.5, 0.25, 1.]),
            ("/materials/1/pbrMetallicRoughness/roughnessFactor", "SCALAR", &[0.5]),
            ("/materials/1/emissiveFactor", "VEC3", &[1., 0.5, 0.]),
            (strength, "SCALAR", &[8.]),
        ],
    );
    let file = scene_file(&document);
    let scene = file.animated(0, [0.5; 2]).expect("a sound moment").scene;
    let material = &scene.materials[scene.objects[0].shapes[0].material.0 as usize];
    let Surface::MetalRough(surface) = &material.surface else { panic!("expected glTF's") };
    assert_eq!((&*material.name, surface.base_color.factor), ("moving", Vec3::new(0.5, 0.25, 0.125)));
    assert_eq!(surface.roughness.factor, 0.25);
    assert_eq!(
        material.emission.factor,
        Vec3::new(2.0, 1.0, 0.0),
        "half the colour at half the strength of 8"
    );
    let still = file.still().expect("sound").scene;
    let material = &still.materials[still.objects[0].shapes[0].material.0 as usize];
    assert_eq!(material.emission.factor, Vec3::ZERO, "the pose that is stored");
}

#[test]
fn pointers_change_lights_and_cameras() {
    let mut document = triangle();
    document["cameras"] =
        json!([{"type": "perspective", "perspective": {"yfov": 1.0, "aspectRatio": 2.0, "znear": 1.0}}]);
    let light = json!({"type": "point", "intensity": 3, "color": [1, 0.5, 1]});
    document["extensions"] = json!({"KHR_lights_punctual": {"lights": [light]}});
    document["nodes"] = json!([
        {"mesh": 0}, {"camera": 0, "name": "mine"}, {"extensions": {"KHR_lights_punctual": {"light": 0}}}
    ]);
    document["scenes"][0]["nodes"] = json!([0, 1, 2]);
    pointing(
        &mut document,
        &[
            ("/cameras/0/perspective/yfov", "SCALAR", &[2.0]),
            ("/extensions/KHR_lights_punctual/lights/0/intensity", "SCALAR", &[8.]),
        ],
    );
    let scene = scene_file(&document).animated(0, [0.75; 2]).expect("a sound moment").scene;
    let Projection::Perspective { fov, .. } = scene.cameras[0].projection else { panic!() };
    assert_eq!((fov, &*scene.cameras[0].name), (1.5, "mine"));
    let Light::Point { intensity, .. } = scene.lights[0] else { panic!("expected a point light") };
    assert_eq!(intensity, Vec3::new(6.0, 3.0, 6.0));
}

/// The picture moves, and is decoded but once.
#[test]
fn pointers_change_transforms_of_textures() {
    let mut document = triangle();
    let mut png = std::io::Cursor::new(Vec::new());
    image::RgbImage::new(2, 2).write_to(&mut png, image::ImageFormat::Png).expect("a picture");
    document["images"] = json!([{"uri": common::data_uri(&png.into_inner())}]);
    document["textures"] = json!([{"source": 0}]);
    document["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
    document["meshes"][0]["primitives"][0]["material"] = json!(0);
    let transform =
        "/materials/0/pbrMetallicRoughness/baseColorTexture/extensions/KHR_texture_transform/offset";
    pointing(&mut document, &[(transform, "VEC2", &[1., 0.5])]);
    let file = scene_file(&document);
    let shown = |time: f32| {
        let scene = file.animated(0, [time; 2]).expect("a sound moment").scene;
        let material = &scene.materials[scene.objects[0].shapes[0].material.0 as usize];
        let Surface::MetalRough(surface) = &material.surface else { panic!("expected glTF's") };
        let texture = surface.base_color.texture.expect("a texture");
        let Texture::Image(texture) = scene.textures[texture.0 as usize].clone() else { panic!("a picture") };
        let Mapping::Uv { transform, .. } = texture.mapping else { panic!("texture coordinates") };
        (transform.translation.to_array(), texture.image)
    };
    let (first, second) = (shown(0.0), shown(0.5));
    assert_eq!((first.0, second.0), ([0.0; 2], [0.5, 0.25]));
    assert!(std::sync::Arc::ptr_eq(&first.1, &second.1) && first.1.width == 2);
}

#[test]
fn pointers_show_and_hide() {
    let mut document = triangle();
    document["nodes"] = json!([
        {"children": [1], "extensions": {"KHR_node_visibility": {"visible": false}}}, {"mesh": 0}
    ]);
    pointing(&mut document, &[("/nodes/0/extensions/KHR_node_visibility/visible", "SCALAR", &[1.])]);
    document["animations"][0]["samplers"][0]["interpolation"] = json!("STEP");
    let file = scene_file(&document);
    assert!(file.still().expect("sound").scene.instances.is_empty());
    for (time, count) in [(0.0, 0), (0.9, 0), (1.0, 1)] {
        assert_eq!(file.animated(0, [time; 2]).expect("sound").scene.instances.len(), count, "at {time}");
    }
}

#[test]
fn pointers_to_nothing_are_errors() {
    let refuse = |pointer: &str, kind: &str, value: &[f32], expected: &str| {
        let mut document = triangle();
        document["materials"] = json!([{"name": "only"}]);
        pointing(&mut document, &[(pointer, kind, value)]);
        let error = read(&document).expect_err(expected).to_string();
        assert!(error.contains(expected), "{error}");
    };
    refuse("/materials/0/name/first", "SCALAR", &[1.], "leads nowhere in the file");
    refuse(
        "/materials/0/emissiveFactor",
        "VEC4",
        &[1.; 4],
        "materials[0].emissiveFactor: an animation that changes it",
    );
}

#[test]
fn pointers_to_nodes_are_followed_and_others_are_named() {
    let mut document = triangle();
    document["extensionsRequired"] = json!(["KHR_animation_pointer"]);
    animate(&mut document, (0, "translation"), "LINEAR", &[0., 1.], &[0., 0., 0., 2., 0., 0.]);
    animate(&mut document, (0, "translation"), "STEP", &[0.], &[0., 0., 0.]);
    animate(&mut document, (0, "translation"), "STEP", &[0.], &[0., 0., 0.]);
    let pointers = ["/nodes/0/translation", "/materials/6/emissiveFactor", "/materials/7/emissiveFactor"];
    for (animation, pointer) in pointers.into_iter().enumerate() {
        let extensions = json!({"KHR_animation_pointer": {"pointer": pointer}});
        document["animations"][animation]["channels"][0]["target"] =
            json!({"path": "pointer", "extensions": extensions});
    }
    let loaded = scene_file(&document).animated(0, [0.5; 2]).expect("a sound moment");
    assert_eq!(loaded.scene.instances[0].to_world.translation.x, 1.0);
    let named = loaded.warnings.iter().filter(|warning| warning.message.contains("emissiveFactor"));
    assert_eq!(named.map(|warning| warning.message.contains("/materials/{}/")).collect::<Vec<_>>(), [true]);
}

#[test]
fn faults_are_named() {
    let refuse = |fault: fn(&mut Value), expected: &str| {
        let mut document = triangle();
        add_target(&mut document, &[0.; 9], None);
        add_skin(&mut document, [[1., 0.]; 3]);
        animate(&mut document, (1, "translation"), "LINEAR", &[0., 1.], &[0.; 6]);
        assert!(read(&document).is_ok());
        fault(&mut document);
        let error = read(&document).expect_err(expected).to_string();
        assert!(error.contains(expected), "{error}");
    };
    refuse(
        |d| animate(d, (1, "scale"), "LINEAR", &[1., 0.5], &[0.; 6]),
        "animations[1].samplers[0].input: time 1 is 0.5 after 1",
    );
    refuse(|d| animate(d, (1, "scale"), "LINEAR", &[-1.], &[0.; 3]), "starts at -1");
    refuse(
        |d| animate(d, (1, "scale"), "LINEAR", &[0., 1.], &[0.; 3]),
        "output: has 3 numbers, expected 3 for each of 2 keys",
    );
    refuse(|d| animate(d, (1, "scale"), "CUBICSPLINE", &[0.], &[0.; 3]), "expected 9 for each of 1 keys");
    refuse(
        |d| animate(d, (1, "scale"), "BEZIER", &[0.], &[0.; 3]),
        "is \"BEZIER\", expected STEP, LINEAR or CUBICSPLINE",
    );
    refuse(|d| animate(d, (1, "rotation"), "STEP", &[0.], &[0.; 4]), "expected a unit quaternion");
    refuse(|d| animate(d, (1, "weights"), "STEP", &[0.], &[0.; 1]), "without a mesh that has morph targets");
    refuse(
        |d| animate(d, (77, "scale"), "STEP", &[0.], &[0.; 3]),
        "channels[0].target.node: refers to nodes[77]",
    );
    refuse(
        |d| d["animations"][0]["channels"][0]["sampler"] = json!(4),
        "channels[0].sampler: refers to animations[0].samplers[4]",
    );
    refuse(
        |d| {
            let channel = d["animations"][0]["channels"][0].clone();
            d["animations"][0]["channels"] = json!([channel, channel]);
        },
        "animations[0].channels[1]: changes what another channel",
    );
    refuse(
        |d| d["nodes"][1]["matrix"] = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]),
        "animates the translation of nodes[1], which has a matrix",
    );
    refuse(
        |d| d["nodes"][0]["weights"] = json!([1, 2]),
        "nodes[0].weights: has 2 numbers, but the mesh has 1 morph",
    );
    refuse(|d| d["meshes"][0]["weights"] = json!([1, 2]), "meshes[0].weights: has 2 numbers");
    refuse(|d| d["meshes"][0]["primitives"][0]["targets"][0]["POSITION"] = json!(3), "targets[0].POSITION");
    refuse(
        |d| {
            let mut second = d["meshes"][0]["primitives"][0].clone();
            second["targets"] = json!([]);
            d["meshes"][0]["primitives"].as_array_mut().expect("an array").push(second);
        },
        "primitives[1]: has 0 morph targets, expected 1",
    );
    refuse(|d| d["skins"][0]["joints"] = json!([]), "skins[0].joints: is empty");
    refuse(|d| d["skins"][0]["joints"] = json!([1, 2, 1]), "has 2 matrices, expected one for each of 3");
    refuse(|d| d["skins"][0]["joints"] = json!([1, 55]), "skins[0].joints[1]: refers to nodes[55]");
    refuse(|d| d["nodes"][0]["skin"] = json!(3), "nodes[0].skin: refers to skins[3]");
    refuse(
        |d| {
            let attributes =
                d["meshes"][0]["primitives"][0]["attributes"].as_object_mut().expect("an object");
            attributes.remove("JOINTS_0");
        },
        "has no JOINTS_0",
    );
    refuse(
        |d| d["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"] = json!(1),
        "has componentType 5126, expected 5121",
    );
    refuse(
        |d| {
            let weights = add_floats(d, "VEC4", &[-1., 2., 0., 0.].repeat(3));
            d["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = json!(weights);
        },
        "WEIGHTS_0: element 0 is [-1.0, 2.0, 0.0, 0.0], expected weights of at least 0",
    );
    refuse(
        |d| {
            let fields = json!({"componentType": 5121, "count": 3, "type": "VEC4"});
            let joints = add_accessor(d, &[7_u8, 0, 0, 0].repeat(3), fields);
            d["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"] = json!(joints);
        },
        "skins[0].joints: has 2 joints, but meshes[0] hangs on joint 7",
    );
    refuse(|d| d["meshes"][0]["weights"] = json!([1e39]), "meshes[0].weights: expected finite numbers");
}

/// Faults that only show at some time are named with it.
#[test]
fn faults_in_time_are_named() {
    let mut document = triangle();
    animate(&mut document, (0, "scale"), "LINEAR", &[0., 1.], &[1., 1., 1., f32::MAX, 1., 1.]);
    document["nodes"] = json!([{"children": [1]}, {"mesh": 0, "scale": [10, 10, 10]}]);
    let file = scene_file(&document);
    assert!(file.still().is_ok());
    let error = file.animated(0, [1.0, 1.0]).expect_err("an overflow").to_string();
    assert_eq!(
        error,
        "test.gltf: nodes[1]: its transform to the world is not finite at 1 s of animations[0]"
    );
}

proptest! {
    /// A mesh whose joints all moved in the same way since they were bound moves so, too, whatever its weights.
    #[test]
    fn equal_joints_move_a_mesh_as_a_whole(
        weights in prop::array::uniform3(prop::array::uniform2(0.0_f32..1.0)),
        axis in prop::array::uniform3(-1.0_f32..1.0), angle in -3.0_f32..3.0,
        translation in prop::array::uniform3(-9.0_f32..9.0),
    ) {
        let mut document = triangle();
        add_skin(&mut document, weights);
        let rotation = Quat::from_axis_angle(Vec3::from_array(axis).normalize_or(Vec3::X), angle);
        document["nodes"][1]["rotation"] = json!(rotation.to_array());
        document["nodes"][1]["translation"] = json!(translation);
        let scene = read_ok(&document).scene;
        for (found, rest) in mesh(&scene, 0).positions.iter().zip([Vec3::ZERO, Vec3::X, Vec3::Y]) {
            let expected = rotation * rest + Vec3::from_array(translation);
            // A few roundings of numbers of up to 10.
            prop_assert!(found.distance(expected) < 10.0 * 16.0 * f32::EPSILON, "{found} {expected}");
        }
    }
}
