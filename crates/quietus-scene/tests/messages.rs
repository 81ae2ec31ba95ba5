//! The words of errors: one document per fault, all messages in one snapshot.

mod common;

use common::{add_accessor, data_uri, read, triangle};
use quietus_scene::SceneError;
use serde_json::{Value, json};

/// Each fault: a name, and how to break the triangle.
type Fault = (&'static str, fn(&mut Value));

const FAULTS: &[Fault] = &[
    ("no asset version", |d| d["asset"] = json!({"version": "two"})),
    ("a newer version", |d| d["asset"] = json!({"version": "3.0"})),
    ("a newer minimum", |d| d["asset"] = json!({"version": "2.0", "minVersion": "2.1"})),
    ("required extension", |d| {
        d["extensionsRequired"] = json!(["EXT_lights_image_based", "KHR_lights_punctual"])
    }),
    ("wrong type", |d| d["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!("zero")),
    ("negative index", |d| d["nodes"][0]["mesh"] = json!(-1)),
    ("missing field", |d| d["accessors"][0] = json!({"componentType": 5126, "type": "VEC3"})),
    ("mesh out of range", |d| d["nodes"][0]["mesh"] = json!(7)),
    ("node out of range", |d| d["scenes"][0]["nodes"] = json!([3])),
    ("scene out of range", |d| d["scene"] = json!(9)),
    ("material out of range", |d| d["meshes"][0]["primitives"][0]["material"] = json!(0)),
    ("accessor out of range", |d| d["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(99)),
    ("cycle", |d| d["nodes"] = json!([{"children": [1]}, {"children": [0]}])),
    ("two parents", |d| d["nodes"] = json!([{"children": [1, 2]}, {"children": [2]}, {"mesh": 0}])),
    ("projective matrix", |d| {
        d["nodes"][0]["matrix"] = json!([1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])
    }),
    ("matrix and scale", |d| {
        d["nodes"][0] =
            json!({"matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1], "scale": [1, 1, 1]});
    }),
    ("zero quaternion", |d| d["nodes"][0]["rotation"] = json!([0, 0, 0, 0])),
    ("infinite translation", |d| d["nodes"][0]["translation"] = json!([1e300, 0, 0])),
    ("too many elements", |d| d["accessors"][0]["count"] = json!(6)),
    ("absurd count", |d| d["accessors"][0]["count"] = json!(u64::MAX)),
    ("absurd count of zeros", |d| {
        d["accessors"][0] = json!({"componentType": 5126, "type": "VEC3", "count": 1_000_000_000_000_u64});
    }),
    ("absurd offset", |d| d["accessors"][0]["byteOffset"] = json!(u64::MAX)),
    ("component type", |d| d["accessors"][0]["componentType"] = json!(5124)),
    ("positions as scalars", |d| d["accessors"][0]["type"] = json!("SCALAR")),
    ("stride too small", |d| d["bufferViews"][0]["byteStride"] = json!(4)),
    ("view beyond buffer", |d| d["bufferViews"][0]["byteLength"] = json!(37)),
    ("view wraps around", |d| d["bufferViews"][0]["byteOffset"] = json!(u64::MAX)),
    ("buffer too short", |d| d["buffers"][0]["byteLength"] = json!(37)),
    ("buffer without data", |d| d["buffers"][0] = json!({"byteLength": 36})),
    ("missing buffer file", |d| d["buffers"][0]["uri"] = json!("not%20there.bin")),
    ("buffer from the net", |d| d["buffers"][0]["uri"] = json!("https://example.org/a.bin")),
    ("broken base64", |d| d["buffers"][0]["uri"] = json!("data:application/octet-stream;base64,A$BC")),
    ("data URI without comma", |d| d["buffers"][0]["uri"] = json!("data:application/octet-stream;base64")),
    ("empty URI", |d| d["buffers"][0]["uri"] = json!("")),
    ("not a number", |d| {
        let bytes = common::floats(&[0., 0., 0., f32::NAN, 0., 0., 0., 1., 0.]);
        d["buffers"][0]["uri"] = json!(data_uri(&bytes));
    }),
    ("two corners left", |d| {
        let fields = json!({"componentType": 5121, "count": 5, "type": "SCALAR"});
        let indices = add_accessor(d, &[0, 1, 2, 0, 1], fields);
        d["meshes"][0]["primitives"][0]["indices"] = json!(indices);
    }),
    ("index beyond vertices", |d| {
        let fields = json!({"componentType": 5121, "count": 3, "type": "SCALAR"});
        let indices = add_accessor(d, &[0, 1, 200], fields);
        d["meshes"][0]["primitives"][0]["indices"] = json!(indices);
    }),
    ("float indices", |d| d["meshes"][0]["primitives"][0]["indices"] = json!(0)),
    ("fewer normals", |d| {
        let bytes = common::floats(&[0., 0., 1.]);
        let normal = add_accessor(d, &bytes, json!({"componentType": 5126, "count": 1, "type": "VEC3"}));
        d["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(normal);
    }),
    ("sparse index beyond", |d| {
        let fields = json!({"componentType": 5121, "count": 1, "type": "SCALAR"});
        let index = add_accessor(d, &[200], fields);
        let view = d["accessors"][index]["bufferView"].clone();
        d["accessors"][0]["sparse"] = json!({"count": 1,
            "indices": {"bufferView": view, "componentType": 5121}, "values": {"bufferView": 0}});
    }),
    ("primitive mode", |d| d["meshes"][0]["primitives"][0]["mode"] = json!(8)),
    ("alpha mode", |d| material(d, json!({"alphaMode": "GLASS"}))),
    ("index of refraction", |d| material(d, json!({"extensions": {"KHR_materials_ior": {"ior": 0.5}}}))),
    ("negative emission", |d| material(d, json!({"emissiveFactor": [-1, 0, 0]}))),
    ("texture out of range", |d| material(d, json!({"normalTexture": {"index": 0}}))),
    ("missing picture", |d| picture(d, json!({"uri": "gone.png"}))),
    ("picture of no kind", |d| picture(d, json!({"uri": "data:image/png;base64,AAAA"}))),
    ("truncated picture", |d| picture(d, json!({"uri": data_uri(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR")}))),
    ("picture from nowhere", |d| picture(d, json!({}))),
    ("camera angle", |d| camera(d, json!({"type": "perspective", "perspective": {"yfov": 4}}))),
    ("camera type", |d| camera(d, json!({"type": "fisheye"}))),
    ("camera without numbers", |d| camera(d, json!({"type": "perspective"}))),
    ("camera extent", |d| camera(d, json!({"type": "orthographic", "orthographic": {"xmag": 0, "ymag": 1}}))),
    ("light type", |d| light(d, json!({"type": "area"}))),
    ("light strength", |d| light(d, json!({"type": "point", "intensity": -1}))),
    ("light cone", |d| {
        light(d, json!({"type": "spot", "spot": {"innerConeAngle": 1, "outerConeAngle": 0.5}}))
    }),
];

fn material(document: &mut Value, material: Value) {
    document["materials"] = json!([material]);
    document["meshes"][0]["primitives"][0]["material"] = json!(0);
}

fn picture(document: &mut Value, image: Value) {
    material(document, json!({"emissiveTexture": {"index": 0}}));
    document["textures"] = json!([{"source": 0}]);
    document["images"] = json!([image]);
}

fn camera(document: &mut Value, camera: Value) {
    document["cameras"] = json!([camera]);
    document["nodes"][0]["camera"] = json!(0);
}

fn light(document: &mut Value, light: Value) {
    document["extensions"] = json!({"KHR_lights_punctual": {"lights": [light]}});
    document["nodes"][0]["extensions"] = json!({"KHR_lights_punctual": {"light": 0}});
}

fn say(error: &SceneError) -> String {
    // Columns of compact JSON move with every edit of the triangle above.
    let text = error.to_string();
    let text = text.split_once(" at line ").map_or(text.as_str(), |(text, _)| text);
    format!("{:?}: {text}", error.kind())
}

#[test]
fn every_fault_is_named() {
    let mut said = String::new();
    for (name, fault) in FAULTS {
        let mut document = triangle();
        fault(&mut document);
        let error = read(&document).expect_err(name);
        said += &format!("{name}\n    {}\n", say(&error));
    }
    insta::assert_snapshot!(said);
}

#[test]
fn broken_containers() {
    let read =
        |bytes: &[u8]| quietus_scene::load_bytes("test.glb".as_ref(), bytes).expect_err("a broken file");
    let cases: &[(&str, &[u8])] = &[
        ("empty", b""),
        ("text", b"hello"),
        ("no JSON", b"{\"asset\": }"),
        ("half of JSON", b"{\"asset\": {\"version\":"),
        ("two documents", b"{\"asset\": {\"version\": \"2.0\"}} {}"),
        ("magic only", b"glTF"),
        ("version 1", b"glTF\x01\0\0\0\x14\0\0\0"),
        ("too long a header", b"glTF\x02\0\0\0\xff\0\0\0"),
        ("no chunk", b"glTF\x02\0\0\0\x0c\0\0\0"),
        ("first chunk binary", b"glTF\x02\0\0\0\x14\0\0\0\0\0\0\0BIN\0"),
        ("too long a chunk", b"glTF\x02\0\0\0\x14\0\0\0\xff\xff\xff\xffJSON"),
    ];
    let said: String =
        cases.iter().map(|(name, bytes)| format!("{name}\n    {}\n", say(&read(bytes)))).collect();
    insta::assert_snapshot!(said);
}

#[test]
fn missing_files() {
    let error = quietus_scene::load("no/such/scene.gltf".as_ref()).expect_err("no such file");
    assert_eq!(error.to_string(), "no/such/scene.gltf: no such file");
    assert_eq!(error.kind(), quietus_scene::ErrorKind::NotFound);
    let error = quietus_scene::load_environment("no/such/sky.hdr".as_ref()).expect_err("no such file");
    assert_eq!(error.kind(), quietus_scene::ErrorKind::NotFound);
}
