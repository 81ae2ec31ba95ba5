//! Extensions that store or place geometry in other ways, against the same geometry in the plain one; and those of
//! materials with an inside.

mod common;

use common::{add_accessor, data_uri, floats, read, read_ok, triangle};
use glam::{Affine3A, Quat, Vec2, Vec3, Vec4};
use proptest::prelude::*;
use quietus_scene::Choice;
use quietus_trace::desc::{
    Geometry, Mapping, Medium, MediumId, MediumInterface, Mesh, ScalarParam, SceneDesc, Surface, Texture,
    TextureId,
};
use serde_json::{Value, json};

fn mesh(scene: &SceneDesc) -> &Mesh {
    match &scene.objects[0].shapes[0].geometry {
        Geometry::Mesh(mesh) => mesh,
        other => panic!("glTF has no {other:?}"),
    }
}

fn message(document: &Value) -> String {
    read(document).expect_err("a broken document").to_string()
}

fn shorts(values: &[i16]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

proptest! {
    /// KHR_mesh_quantization: a mesh of integers of any kind is the mesh of the floats they stand for.
    #[test]
    fn quantized_meshes_are_float_meshes(
        positions in prop::collection::vec(any::<i16>(), 9), normals in prop::collection::vec(-127_i8..=127, 9),
        uvs in prop::collection::vec(any::<u16>(), 6),
    ) {
        let mut plain = triangle();
        let mut small = triangle();
        small["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
        let mut add = |name: &str, kind: &str, bytes: &[u8], code: u32, normalized: bool, values: &[f32]| {
            let fields = json!({"componentType": code, "normalized": normalized, "count": 3, "type": kind});
            let index = add_accessor(&mut small, bytes, fields);
            small["meshes"][0]["primitives"][0]["attributes"][name] = json!(index);
            let fields = json!({"componentType": 5126, "count": 3, "type": kind});
            let index = add_accessor(&mut plain, &floats(values), fields);
            plain["meshes"][0]["primitives"][0]["attributes"][name] = json!(index);
        };
        let values: Vec<f32> = positions.iter().map(|&p| f32::from(p)).collect();
        add("POSITION", "VEC3", &shorts(&positions), 5122, false, &values);
        let values: Vec<f32> = normals.iter().map(|&n| f32::from(n) / 127.0).collect();
        let bytes: Vec<u8> = normals.iter().map(|&n| n as u8).collect();
        add("NORMAL", "VEC3", &bytes, 5120, true, &values);
        let values: Vec<f32> = uvs.iter().map(|&uv| f32::from(uv) / 65535.0).collect();
        let bytes: Vec<u8> = uvs.iter().flat_map(|uv| uv.to_le_bytes()).collect();
        add("TEXCOORD_0", "VEC2", &bytes, 5123, true, &values);
        let (plain, small) = (read_ok(&plain).scene, read_ok(&small).scene);
        prop_assert_eq!(&mesh(&small).positions, &mesh(&plain).positions);
        prop_assert_eq!(&mesh(&small).normals, &mesh(&plain).normals);
        prop_assert_eq!(&mesh(&small).uvs, &mesh(&plain).uvs);
    }
}

/// EXT_mesh_gpu_instancing against nodes.
#[test]
fn instances_are_nodes() {
    let moves = [[1_f32, 2., 3.], [4., 5., 6.]];
    let scales = [[2_f32, 2., 2.], [1., 1., 3.]];
    let turns: [[i16; 4]; 2] = [[0, 32767, 0, 0], [0, 0, 0, 32767]];
    let mut document = triangle();
    let vectors = json!({"componentType": 5126, "count": 2, "type": "VEC3"});
    let translation = add_accessor(&mut document, &floats(moves.as_flattened()), vectors.clone());
    let scale = add_accessor(&mut document, &floats(scales.as_flattened()), vectors);
    let fields = json!({"componentType": 5122, "normalized": true, "count": 2, "type": "VEC4"});
    let rotation = add_accessor(&mut document, &shorts(turns.as_flattened()), fields);
    document["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    document["nodes"][0]["translation"] = json!([10, 0, 0]);
    let attributes = json!({"TRANSLATION": translation, "ROTATION": rotation, "SCALE": scale, "_ID": 0});
    document["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing": {"attributes": attributes}});
    let scene = read_ok(&document).scene;
    let turns = [Quat::from_xyzw(0., 1., 0., 0.), Quat::IDENTITY];
    assert_eq!((scene.objects.len(), scene.instances.len()), (1, 2));
    for (i, instance) in scene.instances.iter().enumerate() {
        let copy = Affine3A::from_scale_rotation_translation(scales[i].into(), turns[i], moves[i].into());
        assert_eq!(instance.to_world, Affine3A::from_translation(Vec3::new(10., 0., 0.)) * copy);
    }
    document["accessors"][scale]["count"] = json!(1);
    assert!(message(&document).contains("have [2, 2, 1] elements, expected equal numbers"));
    document["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = json!({});
    assert!(message(&document).contains("has neither TRANSLATION nor ROTATION nor SCALE"));
}

/// A triangle whose positions are compressed by meshoptimizer: `attribute` is one element of 4 bytes.
fn compressed() -> Value {
    let bytes = include_bytes!("compressed/indices.bin");
    let mut document = triangle();
    document["extensionsRequired"] = json!(["EXT_meshopt_compression"]);
    // The stream lists 0, 1000, 1, 1002, 2, 1004 and so on, up to 122 indices.
    let positions: Vec<f32> = (0..70_001).flat_map(|i| [i as f32, 0.0, 0.0]).collect();
    let fields = json!({"componentType": 5126, "count": 70_001, "type": "VEC3"});
    let position = add_accessor(&mut document, &floats(&positions), fields);
    let fields = json!({"componentType": 5125, "count": 120, "type": "SCALAR"});
    let index = add_accessor(&mut document, bytes, fields);
    let buffers = document["buffers"].as_array_mut().expect("an array");
    buffers.push(json!({"byteLength": 488}));
    let placeholder = buffers.len() - 1;
    let view = document["accessors"][index]["bufferView"].as_u64().expect("an index") as usize;
    document["bufferViews"][view] = json!({"buffer": placeholder, "byteLength": 488, "extensions": {
        "EXT_meshopt_compression": {"buffer": placeholder - 1, "byteLength": bytes.len(), "byteStride": 4,
            "count": 122, "mode": "INDICES"}}});
    let primitive = &mut document["meshes"][0]["primitives"][0];
    (primitive["indices"], primitive["attributes"]["POSITION"]) = (json!(index), json!(position));
    document
}

#[test]
fn views_are_decompressed() {
    let document = compressed();
    let scene = read_ok(&document).scene;
    assert_eq!(mesh(&scene).triangles[..2], [[0, 1000, 1], [1002, 2, 1004]]);
    assert_eq!(mesh(&scene).triangles.len(), 40);
    let view = document["bufferViews"].as_array().expect("an array").len() - 1;
    let broken = |name: &str, value: Value| {
        let mut document = compressed();
        document["bufferViews"][view]["extensions"]["EXT_meshopt_compression"][name] = value;
        message(&document)
    };
    assert!(
        broken("mode", json!("ZIP")).contains("mode: is \"ZIP\", expected ATTRIBUTES, TRIANGLES or INDICES")
    );
    assert!(broken("filter", json!("SEPIA")).contains("filter: is \"SEPIA\", which is not known"));
    assert!(broken("filter", json!("QUATERNION")).contains("byteStride: is 4, which does not suit"));
    assert!(broken("byteStride", json!(3)).contains("byteStride: is 3"));
    assert!(broken("count", json!(121)).contains("count: is 121, but the view has 488 bytes"));
    assert!(broken("byteLength", json!(100)).contains("the compressed data"));
    assert!(broken("byteLength", json!(9999)).contains("9999 bytes from byte 0 on"));
    assert!(broken("buffer", json!(77)).contains("refers to buffers[77]"));
    let mut document = compressed();
    document["bufferViews"][view]["extensions"] = json!({});
    assert!(message(&document).contains("has 0 bytes"), "nothing is in the placeholder");
}

/// A grid of 9 x 9 vertices (x, y, x y / 8), which Draco compressed in one of its ways.
fn draco(bytes: &[u8]) -> Value {
    let mut document = triangle();
    document["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    document["buffers"] = json!([{"byteLength": bytes.len(), "uri": data_uri(bytes)}]);
    document["bufferViews"] = json!([{"buffer": 0, "byteLength": bytes.len()}]);
    let accessor = |code: u32, kind: &str| json!({"componentType": code, "count": 81, "type": kind, "normalized": code == 5121});
    document["accessors"] = json!([accessor(5126, "VEC3"), accessor(5126, "VEC3"), accessor(5126, "VEC2"), accessor(5121, "VEC4"),
            {"componentType": 5125, "count": 384, "type": "SCALAR"}]);
    let attributes = json!({"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2, "COLOR_0": 3});
    document["meshes"][0]["primitives"][0] = json!({"attributes": attributes, "indices": 4, "extensions": {
        "KHR_draco_mesh_compression": {"bufferView": 0, "attributes": attributes}}});
    document
}

#[test]
fn draco_meshes_are_decoded() {
    let streams: [&[u8]; 3] = [
        include_bytes!("compressed/draco-standard.bin"),
        include_bytes!("compressed/draco-valence.bin"),
        include_bytes!("compressed/draco-sequential.bin"),
    ];
    for bytes in streams {
        let scene = read_ok(&draco(bytes)).scene;
        let mesh = mesh(&scene);
        assert_eq!((mesh.positions.len(), mesh.triangles.len()), (81, 128));
        let mut seen = [false; 81];
        for (i, p) in mesh.positions.iter().enumerate() {
            // Half a step of 14 bits over the longest side, and a rounding of numbers up to 8.
            let step = 8.0 / f32::from((1_u16 << 14) - 1);
            let (x, y) = (p.x.round(), p.y.round());
            let near =
                p.distance(Vec3::new(x, y, x * y / 8.0)) <= 0.5 * step * 3_f32.sqrt() + 16.0 * f32::EPSILON;
            assert!(near, "{p}");
            let vertex = (9.0 * y + x) as usize;
            seen[vertex] = true;
            assert!(
                (mesh.uvs[0][i] - Vec2::new(x, y) / 8.0).abs().max_element()
                    <= 1.0 / f32::from((1_u16 << 12) - 1)
            );
            assert_eq!(mesh.colors[i], Vec4::new(vertex as f32, 255.0 - vertex as f32, 0.0, 255.0) / 255.0);
            let normal = Vec3::new(-y, -x, 8.0).normalize();
            // On an octahedron of 511 steps per unit x and y are off by up to half a step and z by both together;
            // then the vector becomes up to sqrt(3) times as long, to have unit length.
            let steps = (0.25_f32 + 0.25 + 1.0).sqrt() * 3_f32.sqrt() / 511.0;
            assert!(mesh.normals[i].distance(normal) <= steps, "{} {normal}", mesh.normals[i]);
        }
        assert!(seen.iter().all(|seen| *seen));
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|i| mesh.positions[i as usize].truncate());
            assert!(((b - a).perp_dot(c - a) - 1.0).abs() < 0.01, "half a cell, counter-clockwise");
        }
    }
}

#[test]
fn broken_draco_meshes_are_refused() {
    let bytes = include_bytes!("compressed/draco-valence.bin");
    let mut document = draco(bytes);
    let extension = "KHR_draco_mesh_compression";
    document["meshes"][0]["primitives"][0]["extensions"][extension]["attributes"]["NORMAL"] = json!(9);
    assert!(message(&document).contains("attributes.NORMAL: is 9, which the compressed mesh does not have"));
    let mut document = draco(bytes);
    document["accessors"][2]["count"] = json!(80);
    assert!(message(&document).contains("TEXCOORD_0: has 80 elements, expected 81"));
    for length in 0..bytes.len() {
        let error = message(&draco(&bytes[..length]));
        assert!(error.contains("is not a whole Draco mesh"), "{length}: {error}");
    }
    // Flipped bits may go unnoticed or be an error, but never a panic.
    for bit in 0..8 * bytes.len() {
        let mut bytes = *bytes;
        bytes[bit / 8] ^= 1 << (bit % 8);
        let _ = read(&draco(&bytes));
    }
}

/// The triangle with one material.
fn with_material(material: Value) -> SceneDesc {
    let mut document = triangle();
    document["materials"] = json!([material]);
    document["meshes"][0]["primitives"][0]["material"] = json!(0);
    read_ok(&document).scene
}

fn glass(transmission: f32, metallic: f32, volume: Value) -> Value {
    json!({
        "name": "tea", "emissiveFactor": [1, 1, 1],
        "pbrMetallicRoughness": {"metallicFactor": metallic, "roughnessFactor": 0.25, "baseColorFactor": [0.5, 1, 1, 1]},
        "extensions": {"KHR_materials_transmission": {"transmissionFactor": transmission},
            "KHR_materials_ior": {"ior": 1.33}, "KHR_materials_volume": volume}
    })
}

#[test]
fn volumes_are_glass_with_an_inside() {
    let volume = json!({"thicknessFactor": 2, "attenuationDistance": 0.5, "attenuationColor": [1, 0.25, 0]});
    let scene = with_material(glass(1.0, 0.0, volume.clone()));
    let Surface::Glass(found) = &scene.materials[0].surface else {
        panic!("expected glass: {:?}", scene.materials[0].surface)
    };
    assert_eq!((found.ior, found.roughness.u), (Vec3::splat(1.33), ScalarParam::constant(0.25)));
    assert_eq!((found.tint.factor, found.keeps_light), (Vec3::new(0.5, 1., 1.), true));
    let media = Some(MediumInterface { inside: Some(MediumId(0)), outside: None });
    assert_eq!(scene.objects[0].shapes[0].media, media);
    // After half a metre a quarter of green is left, and after one a sixteenth.
    let medium = &scene.media[0];
    assert_eq!((medium.absorption.x, medium.scattering), (0.0, Vec3::ZERO));
    assert!(((-medium.absorption.y).exp() - 1.0 / 16.0).abs() < 1e-6);
    assert!(medium.absorption.z.is_finite() && (-0.5 * medium.absorption.z).exp() < 1e-5);
    // Clear glass has no medium, thin walls have no inside, and neither have things that nothing passes.
    let clear = with_material(glass(1.0, 0.0, json!({"thicknessFactor": 1})));
    assert!(matches!(clear.materials[0].surface, Surface::Glass(_)) && clear.media.is_empty());
    let mut smooth = glass(1.0, 0.0, json!({"thicknessFactor": 1}));
    smooth["pbrMetallicRoughness"]["roughnessFactor"] = json!(0);
    assert!(matches!(with_material(smooth).materials[0].surface, Surface::Dielectric { .. }));
    for (transmission, thickness) in [(1.0, 0.0), (0.0, 1.0)] {
        let scene = with_material(glass(transmission, 0.0, json!({"thicknessFactor": thickness})));
        assert!(matches!(scene.materials[0].surface, Surface::MetalRough(_)));
        assert_eq!(scene.objects[0].shapes[0].media, None);
    }
}

#[test]
fn partial_transmission_is_a_mixture() {
    let volume = json!({"thicknessFactor": 2, "attenuationDistance": 0.5, "attenuationColor": [1, 0.25, 0]});
    let scene = with_material(glass(0.5, 0.5, volume));
    let whole = &scene.materials[scene.objects[0].shapes[0].material.0 as usize];
    let Surface::Mix { materials, amount } = &whole.surface else { panic!("expected a mixture") };
    assert_eq!((*amount, whole.emission.factor), (ScalarParam::constant(0.25), Vec3::ONE));
    let [opaque, glass] = materials.map(|id| &scene.materials[id.0 as usize]);
    let Surface::MetalRough(opaque_surface) = &opaque.surface else { panic!("expected the base material") };
    assert_eq!((opaque_surface.transmission.factor, opaque_surface.metallic.factor), (0.0, 0.5));
    assert!(matches!(glass.surface, Surface::Glass(_)));
    assert_eq!((opaque.emission.factor, glass.emission.factor), (Vec3::ZERO, Vec3::ZERO), "it emits once");
    assert!(scene.objects[0].shapes[0].media.is_some());
}

#[test]
fn leaves_let_light_pass() {
    let leaf = json!({"diffuseTransmissionFactor": 0.75, "diffuseTransmissionColorFactor": [0, 1, 0]});
    let material = |thickness: f32, transmission: f32| {
        let volume =
            json!({"thicknessFactor": thickness, "attenuationDistance": 1, "attenuationColor": [1, 0.5, 0]});
        let extensions = json!({"KHR_materials_diffuse_transmission": leaf, "KHR_materials_volume": volume,
            "KHR_materials_transmission": {"transmissionFactor": transmission}});
        json!({"pbrMetallicRoughness": {"metallicFactor": 0}, "extensions": extensions})
    };
    let scene = with_material(material(0.0, 0.0));
    let Surface::MetalRough(surface) = &scene.materials[0].surface else {
        panic!("expected the base material")
    };
    assert_eq!(surface.diffuse_transmission.factor, 0.75);
    assert_eq!((surface.diffuse_transmission_color.factor, scene.media.len()), (Vec3::Y, 0));
    // With an inside light is absorbed there; where glass is part of it, the rest is a leaf.
    let solid = with_material(material(1.0, 0.0));
    assert!(matches!(solid.materials[0].surface, Surface::MetalRough(_)) && solid.media.len() == 1);
    assert!(solid.objects[0].shapes[0].media.is_some());
    let both = with_material(material(1.0, 0.5));
    let whole = &both.materials[both.objects[0].shapes[0].material.0 as usize];
    let Surface::Mix { materials: [rest, _], .. } = whole.surface else { panic!("expected a mixture") };
    let Surface::MetalRough(rest) = &both.materials[rest.0 as usize].surface else {
        panic!("expected a leaf")
    };
    assert_eq!((rest.transmission.factor, rest.diffuse_transmission.factor), (0.0, 0.75));
}

#[test]
fn films_and_dispersion() {
    let film = json!({"iridescenceFactor": 0.5, "iridescenceIor": 1.8, "iridescenceThicknessMaximum": 550});
    let scene = with_material(json!({"extensions": {"KHR_materials_iridescence": film}}));
    let Surface::MetalRough(surface) = &scene.materials[0].surface else {
        panic!("expected the base material")
    };
    assert_eq!((surface.film.strength.factor, surface.film.ior), (0.5, 1.8));
    assert_eq!((surface.film.thickness, surface.film.place), ([100.0, 550.0], ScalarParam::constant(1.0)));
    // Abbe's number of 30 on an index of 1.6.
    let mut glass = glass(1.0, 0.0, json!({"thicknessFactor": 1}));
    glass["extensions"]["KHR_materials_ior"] = json!({"ior": 1.6});
    glass["extensions"]["KHR_materials_dispersion"] = json!({"dispersion": 20.0 / 30.0});
    glass["extensions"]["KHR_materials_iridescence"] = film;
    let scene = with_material(glass.clone());
    let Surface::Glass(found) = &scene.materials[0].surface else { panic!("expected glass") };
    let abbe = (found.ior.y - 1.0) / (found.ior.z - found.ior.x);
    assert!((abbe - 30.0).abs() < 1e-3 && found.film.ior == 1.8, "{found:?}");
    // A thin wall refracts nothing apart.
    glass["extensions"]["KHR_materials_volume"] = json!({});
    let thin = with_material(glass);
    assert!(matches!(thin.materials[0].surface, Surface::MetalRough(_)));
    let mut document = triangle();
    document["materials"] = json!([{"extensions": {"KHR_materials_iridescence": {"iridescenceIor": 0.5}}}]);
    document["meshes"][0]["primitives"][0]["material"] = json!(0);
    assert!(message(&document).contains("KHR_materials_iridescence.iridescenceIor: is 0.5, expected"));
}

#[test]
fn sheen_and_anisotropy() {
    let scene = with_material(json!({"extensions": {
        "KHR_materials_sheen": {"sheenColorFactor": [0.5, 0.25, 1], "sheenRoughnessFactor": 0.75},
        "KHR_materials_anisotropy": {"anisotropyStrength": 0.5, "anisotropyRotation": 1.5}
    }}));
    let Surface::MetalRough(surface) = &scene.materials[0].surface else {
        panic!("expected the base material")
    };
    assert_eq!(
        (surface.sheen_color.factor, surface.sheen_roughness.factor),
        (Vec3::new(0.5, 0.25, 1.), 0.75)
    );
    assert_eq!((surface.anisotropy.strength, surface.anisotropy.rotation), (0.5, 1.5));
}

/// A WebP picture of 1 x 1 texel, without loss: (10, 20, 30, 255).
fn webp() -> Vec<u8> {
    let mut bytes = Vec::new();
    let encoder = image::codecs::webp::WebPEncoder::new_lossless(&mut bytes);
    encoder.encode(&[10, 20, 30, 255], 1, 1, image::ExtendedColorType::Rgba8).expect("memory does not fail");
    bytes
}

#[test]
fn pictures_of_other_kinds() {
    let mut document = triangle();
    document["materials"] = json!([{"emissiveTexture": {"index": 0}}]);
    document["meshes"][0]["primitives"][0]["material"] = json!(0);
    document["images"] = json!([{"uri": "not there.png"}, {"uri": data_uri(&webp())}]);
    document["textures"] = json!([{"source": 0, "extensions": {"EXT_texture_webp": {"source": 1}}}]);
    let scene = read_ok(&document).scene;
    let Texture::Image(texture) = &scene.textures[0] else { panic!("expected a picture") };
    let quietus_trace::desc::Texels::Srgb8(texels) = &texture.image.texels else {
        panic!("expected colours")
    };
    assert_eq!(texels[..], [[10, 20, 30, 255]]);
}

/// KHR_materials_pbrSpecularGlossiness becomes what KHR_materials_specular says it is.
#[test]
fn gloss_becomes_roughness() {
    let plain = with_material(json!({"extensions": {"KHR_materials_pbrSpecularGlossiness": {
        "diffuseFactor": [0.5, 0.25, 1, 1], "specularFactor": [0.25, 0.5, 0.75], "glossinessFactor": 0.75}}}));
    let Surface::MetalRough(surface) = &plain.materials[0].surface else {
        panic!("expected the base material")
    };
    assert_eq!(surface.base_color.factor, Vec3::new(0.5, 0.25, 1.));
    assert_eq!(surface.specular_color.factor, Vec3::new(0.25, 0.5, 0.75));
    assert_eq!((surface.metallic.factor, surface.roughness.factor, surface.specular.factor), (0., 0.25, 1.));
    // What reflects everything, times the specular colour.
    let reflected = ((surface.ior - 1.) / (surface.ior + 1.)).powi(2);
    assert!(reflected > 0.9999, "{reflected}");

    let mut document = triangle();
    document["materials"] = json!([{"alphaMode": "BLEND", "extensions": {"KHR_materials_pbrSpecularGlossiness": {
        "diffuseTexture": {"index": 0}, "specularGlossinessTexture": {"index": 0}, "glossinessFactor": 0.5}}}]);
    document["extensionsRequired"] = json!(["KHR_materials_pbrSpecularGlossiness"]);
    document["meshes"][0]["primitives"][0]["material"] = json!(0);
    document["images"] = json!([{"uri": data_uri(&webp())}]);
    document["textures"] = json!([{"extensions": {"EXT_texture_webp": {"source": 0}}}]);
    let scene = read_ok(&document).scene;
    let Surface::MetalRough(surface) = &scene.materials[0].surface else {
        panic!("expected the base material")
    };
    assert!(surface.base_color.texture.is_some() && surface.specular_color.texture.is_some());
    let table = quietus_trace::texture::TextureTable::compile(&scene.textures, |_| false).expect("sound");
    // The texel's alpha is 1: half of it is gloss.
    let roughness = surface.roughness.at(&Default::default(), &table);
    assert!((roughness - 0.5).abs() < 1e-6, "{roughness}");
}

/// What goes straight is what the volume says, whatever is scattered; more of that the brighter the thing is to be.
#[test]
fn volumes_that_scatter() {
    let media = |name: &str, color: f32, anisotropy: f32| {
        let mut document = triangle();
        let volume =
            json!({"thicknessFactor": 1, "attenuationDistance": 2, "attenuationColor": [0.5, 0.25, 1]});
        let mut scatter = json!({"scatterAnisotropy": anisotropy});
        scatter[name] = json!([color, color, color]);
        document["materials"] = json!([{"extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 1},
            "KHR_materials_volume": volume,
            "KHR_materials_volume_scatter": scatter,
        }}]);
        document["meshes"][0]["primitives"][0]["material"] = json!(0);
        let medium = read_ok(&document).scene.media.remove(0);
        let straight = (medium.absorption + medium.scattering) * -2.0;
        assert!((straight.map(f32::exp) - Vec3::new(0.5, 0.25, 1.0)).length() < 1e-6, "{straight}");
        medium
    };
    let albedo = |medium: &Medium| medium.scattering.x / (medium.absorption.x + medium.scattering.x);
    assert_eq!(media("multiscatterColor", 0.0, 0.0).scattering, Vec3::ZERO);
    let (half, forward) = (media("multiscatterColor", 0.5, 0.0), media("multiscatterColorFactor", 0.5, 0.7));
    // A half-space of albedo 0.5 takes single scattering of 0.93 or so, and of more where light goes on.
    assert!((0.9..0.95).contains(&albedo(&half)), "{half:?}");
    assert!(albedo(&forward) > albedo(&half) && forward.g == 0.7);
    assert!((albedo(&media("multiscatterColor", 1.0, 1.0)) - 1.0).abs() < 1e-3);
}

#[test]
fn variants_of_materials() {
    let mut document = triangle();
    document["extensionsRequired"] = json!(["KHR_materials_variants"]);
    document["extensions"] =
        json!({"KHR_materials_variants": {"variants": [{"name": "day"}, {"name": "night"}]}});
    document["materials"] = json!([{"name": "plain"}, {"name": "dark"}]);
    let primitive = &mut document["meshes"][0]["primitives"][0];
    primitive["material"] = json!(0);
    primitive["extensions"] =
        json!({"KHR_materials_variants": {"mappings": [{"material": 1, "variants": [1]}]}});
    let loaded = read_ok(&document);
    let said = "the file has the variants \"day\", \"night\": it is drawn as it is without any";
    assert!(loaded.warnings.iter().any(|warning| warning.message == said), "{:?}", loaded.warnings);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("chair.gltf");
    std::fs::write(&path, document.to_string()).expect("written");
    let open = |name: &str| {
        quietus_scene::SceneFile::open_choice(&path, Choice { variant: Some(name), ..Choice::default() })
    };
    for (variant, material) in [("day", "plain"), ("night", "dark")] {
        let file = open(variant).expect("sound");
        assert_eq!(file.variants(), ["day", "night"]);
        let loaded = file.still().expect("sound");
        assert_eq!(loaded.scene.materials[0].name, material);
        assert!(!loaded.warnings.iter().any(|warning| warning.message.contains("variant")));
    }
    let error = open("dusk").expect_err("there is none").to_string();
    assert!(error.contains("there is no variant \"dusk\", expected \"day\", \"night\""), "{error}");
}

#[test]
fn scenes_by_name_and_number() {
    let mut document = triangle();
    document["scenes"] = json!([{"name": "kitchen", "nodes": [0]}, {"nodes": [1, 2]}]);
    document["nodes"] = json!([{"mesh": 0}, {"mesh": 0}, {"mesh": 0, "translation": [1, 0, 0]}]);
    let said = "the file has the scenes \"kitchen\", \"1\": only scenes[0] is drawn";
    let loaded = read_ok(&document);
    assert!(loaded.warnings.iter().any(|warning| warning.message == said), "{:?}", loaded.warnings);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("house.gltf");
    std::fs::write(&path, document.to_string()).expect("written");
    let open = |name| {
        quietus_scene::SceneFile::open_choice(&path, Choice { scene: Some(name), ..Choice::default() })
    };
    for (name, instances) in [("kitchen", 1), ("0", 1), ("1", 2)] {
        let file = open(name).expect("sound");
        assert_eq!(file.scenes(), ["kitchen", "1"]);
        let loaded = file.still().expect("sound");
        assert_eq!(loaded.scene.instances.len(), instances, "{name}");
        assert!(!loaded.warnings.iter().any(|warning| warning.place == "scenes"));
    }
    let error = open("2").expect_err("there is none").to_string();
    assert!(
        error.contains("there is no scene \"2\", expected \"kitchen\", \"1\", or a number below 2"),
        "{error}"
    );
}

/// A picture of 20 x 12 texels by the encoder of Basis Universal, and what its own transcoder makes of it.
const BASIS: [(&[u8], &[u8]); 2] = [
    (include_bytes!("compressed/basis-etc1s.ktx2"), include_bytes!("compressed/basis-etc1s.rgba")),
    (include_bytes!("compressed/basis-uastc.ktx2"), include_bytes!("compressed/basis-uastc.rgba")),
];

/// A triangle that shows the KTX2 picture `bytes`, and has no other.
fn textured(bytes: &[u8]) -> Value {
    let mut document = triangle();
    document["materials"] = json!([{"emissiveTexture": {"index": 0}}]);
    document["meshes"][0]["primitives"][0]["material"] = json!(0);
    document["extensionsRequired"] = json!(["KHR_texture_basisu"]);
    document["images"] = json!([{"mimeType": "image/ktx2", "uri": data_uri(bytes)}]);
    document["textures"] = json!([{"extensions": {"KHR_texture_basisu": {"source": 0}}}]);
    document
}

fn texels(scene: &SceneDesc) -> &[[u8; 4]] {
    let Texture::Image(texture) = &scene.textures[0] else { panic!("expected a picture") };
    match &texture.image.texels {
        quietus_trace::desc::Texels::Srgb8(texels) => texels,
        other => panic!("expected colours, not {other:?}"),
    }
}

#[test]
fn basis_universal_is_transcoded() {
    for (bytes, expected) in BASIS {
        let scene = read_ok(&textured(bytes)).scene;
        assert_eq!(texels(&scene).as_flattened(), expected);
    }
}

#[test]
fn broken_pictures_of_basis_universal_are_refused() {
    for (bytes, _) in BASIS {
        for length in 0..bytes.len() {
            let error = message(&textured(&bytes[..length]));
            assert!(error.contains("images[0]"), "{length}: {error}");
        }
        // Flipped bits may go unnoticed or be an error, but never a panic.
        for bit in 0..8 * bytes.len() {
            let mut bytes = bytes.to_vec();
            bytes[bit / 8] ^= 1 << (bit % 8);
            let _ = read(&textured(&bytes));
        }
    }
}

/// KTX2 of plain texels: two of them, green and blue with half coverage.
#[test]
fn plain_ktx2_is_read() {
    let header = |format: u32, compression: u32| {
        let mut bytes = b"\xabKTX 20\xbb\r\n\x1a\n".to_vec();
        [format, 1, 2, 1, 0, 0, 1, 1, compression, 0, 0, 0, 0]
            .iter()
            .for_each(|word| bytes.extend(word.to_le_bytes()));
        [0_u64, 0, 104, 8, 8].iter().for_each(|word| bytes.extend(word.to_le_bytes()));
        bytes
    };
    let pixels = [0, 255, 0, 255, 0, 0, 255, 128];
    let plain = [header(43, 0), pixels.to_vec()].concat();
    assert_eq!(texels(&read_ok(&textured(&plain)).scene), [[0, 255, 0, 255], [0, 0, 255, 128]]);
    assert!(message(&textured(&plain[..111])).contains("its first level has 8 bytes from byte 104 on"));
    let other = [header(97, 0), pixels.to_vec()].concat();
    assert!(message(&textured(&other)).contains("has Vulkan's format 97, expected"));
    let compressed = [header(43, 2), pixels.to_vec()].concat();
    assert!(message(&textured(&compressed)).contains("is compressed a second time"));
}

/// A material may look at any two sets of texture coordinates, and meshes keep those.
#[test]
fn any_two_sets_of_texture_coordinates() {
    let mut document = textured(BASIS[0].0);
    let set = |set: u32| json!({"index": 0, "texCoord": set});
    document["materials"] = json!([{"emissiveTexture": set(5), "normalTexture": set(0), "pbrMetallicRoughness":
        {"baseColorTexture": set(5), "metallicRoughnessTexture": set(2)}}]);
    for name in 0..6 {
        let fields = json!({"componentType": 5126, "count": 3, "type": "VEC2"});
        let uv = add_accessor(&mut document, &floats(&[name as f32; 6]), fields);
        document["meshes"][0]["primitives"][0]["attributes"][format!("TEXCOORD_{name}")] = json!(uv);
    }
    let loaded = read_ok(&document);
    // The third one asked for finds no place.
    let left_out = loaded.warnings.iter().filter(|warning| warning.message.contains("the third set"));
    assert_eq!(left_out.map(|warning| &*warning.place).collect::<Vec<_>>(), ["materials[0].normalTexture"]);
    let Surface::MetalRough(surface) = &loaded.scene.materials[0].surface else {
        panic!("expected the base")
    };
    let shown = |texture: Option<TextureId>| {
        let Texture::Image(texture) = &loaded.scene.textures[texture.expect("a texture").0 as usize] else {
            panic!()
        };
        let Mapping::Uv { set, .. } = texture.mapping else { panic!("expected texture coordinates") };
        mesh(&loaded.scene).uvs[usize::from(set)][0].x
    };
    let roughness = surface.roughness.texture.map(|(texture, _)| texture);
    assert_eq!([shown(surface.base_color.texture), shown(roughness)], [5.0, 2.0]);
    assert_eq!(shown(loaded.scene.materials[0].emission.texture), 5.0);
}

/// A file with nothing to draw can be drawn.
#[test]
fn nothing_has_a_camera() {
    let mut document = triangle();
    document["nodes"][0] = json!({});
    let loaded = read_ok(&document);
    assert!(loaded.scene.instances.is_empty());
    let to_world = loaded.scene.cameras[0].to_world;
    assert!(to_world.is_finite(), "{to_world}");
}
