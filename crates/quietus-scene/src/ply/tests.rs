//! Small files of every kind, and broken ones.

use std::fmt::Write;

use super::*;

fn read_bytes(bytes: &[u8]) -> Result<Mesh, SceneError> {
    parse(Path::new("test.ply"), bytes)
}

fn header(format: &str, vertex: &[&str], faces: &str, counts: [usize; 2]) -> String {
    let mut text = format!("ply\nformat {format} 1.0\ncomment made by hand\nelement vertex {}\n", counts[0]);
    for property in vertex {
        writeln!(text, "property {property}").expect("a writable string");
    }
    write!(text, "element face {}\nproperty {faces}\nend_header\n", counts[1]).expect("a writable string");
    text
}

const XYZ: [&str; 3] = ["float x", "float y", "float z"];
const LIST: &str = "list uchar int vertex_indices";
const SQUARE: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];

/// A square of one face with four corners, in binary.
fn square(big_endian: bool) -> Vec<u8> {
    let name = if big_endian { "binary_big_endian" } else { "binary_little_endian" };
    let mut bytes = header(name, &XYZ, LIST, [4, 1]).into_bytes();
    let put = |bytes: &mut Vec<u8>, word: [u8; 4]| {
        let [a, b, c, d] = word;
        bytes.extend(if big_endian { [d, c, b, a] } else { word });
    };
    SQUARE.iter().flatten().for_each(|value| put(&mut bytes, value.to_le_bytes()));
    bytes.push(4);
    (0..4_u32).for_each(|index| put(&mut bytes, index.to_le_bytes()));
    bytes
}

#[test]
fn quads_become_two_triangles_in_either_byte_order() {
    for big_endian in [false, true] {
        let mesh = read_bytes(&square(big_endian)).expect("sound");
        assert_eq!(mesh.positions, SQUARE.map(Vec3::from_array));
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert!(mesh.normals.is_empty() && mesh.uvs[0].is_empty());
    }
}

#[test]
fn text_with_everything_and_more() {
    let vertex = [
        "double x",
        "float y",
        "float z",
        "float nx",
        "float ny",
        "float nz",
        "uchar red",
        "float s",
        "float t",
    ];
    let mut text = header("ascii", &vertex, "list int uint vertex_index", [3, 2]);
    text = text.replace("element face", "element light 1\nproperty list uchar float power\nelement face");
    text += "0 0 0 0 0 2 255 0 0\n1 0 0 0 0 1 0 1 0\n0 1 0 0 0 0 0 0 1\n2 7.5 8\n3 0 1 2\n5 0 1 2 1 0\n";
    let mesh = read_bytes(text.as_bytes()).expect("sound");
    assert_eq!(mesh.normals, [Vec3::Z, Vec3::Z, Vec3::ZERO]);
    assert_eq!(mesh.uvs[0], [Vec2::ZERO, Vec2::X, Vec2::Y]);
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 1, 2], [0, 2, 1], [0, 1, 0]]);
}

#[test]
fn other_types_of_numbers() {
    let mut bytes = header(
        "binary_little_endian",
        &["char x", "short y", "uint z"],
        "list ushort uchar vertex_indices",
        [3, 1],
    )
    .into_bytes();
    for (x, y, z) in [(-1_i8, -300_i16, 70_000_u32), (1, 1, 1), (0, 0, 0)] {
        bytes.extend(x.to_le_bytes());
        bytes.extend(y.to_le_bytes());
        bytes.extend(z.to_le_bytes());
    }
    bytes.extend([3, 0, 2, 1, 0]);
    let mesh = read_bytes(&bytes).expect("sound");
    assert_eq!(mesh.positions[0], Vec3::new(-1.0, -300.0, 70_000.0));
    assert_eq!(mesh.triangles, [[2, 1, 0]]);
}

#[test]
fn truncated_files_are_refused() {
    let sound = square(false);
    for length in 0..sound.len() {
        assert!(read_bytes(&sound[..length]).is_err(), "{length} bytes");
    }
}

/// Faults, and what must be said about them.
#[test]
fn faults_are_named() {
    let with = |vertices: &str, faces: &str| header("ascii", &XYZ, LIST, [3, 1]) + vertices + faces;
    let corners = "0 0 0 1 0 0 0 1 0 ";
    let huge = |elements: &str| format!("ply\nformat binary_little_endian 1.0\n{elements}end_header\n");
    let cases = [
        (String::new(), "expected the line \"ply\""),
        ("plx\n".to_owned(), "1: expected the line \"ply\""),
        ("ply\nformat ascii 1.0\n".to_owned(), "3: the header has no end_header"),
        ("ply\nformat binary 1.0\n".to_owned(), "2: format binary, expected ascii"),
        ("ply\nelement vertex x\n".to_owned(), "2: x, expected a number of rows"),
        ("ply\nproperty float x\n".to_owned(), "2: a property before any element"),
        ("ply\nelement a 1\nproperty half x\n".to_owned(), "3: half is no type"),
        ("ply\nelement a 1\nproperty list float int x\n".to_owned(), "3: the length of a list is a float"),
        ("ply\nhello\n".to_owned(), "2: unknown line"),
        ("ply\nend_header\n".to_owned(), "the header names no format"),
        ("ply\nformat ascii 1.0\nend_header\n".to_owned(), "expected one called vertex"),
        (with(corners, "3 0 1 3"), "refers to vertex 3"),
        (with(corners, "3 0 -1 2"), "refers to vertex -1"),
        (with(corners, "9 0 1 2"), "a list of 9 values"),
        (with(corners, "3 0 1"), "the file ends inside its 1 elements called face"),
        (with("0 0 0 1 0 0 0 1 nan ", "3 0 1 2"), "expected finite numbers"),
        (with("0 0 0 1 0 x 0 1 0 ", "3 0 1 2"), "x, expected a number"),
        (
            huge("element vertex 99999999999\nproperty float x\nproperty float y\nproperty float z\n"),
            "ends inside",
        ),
        (
            huge(
                "element vertex 18446744073709551615\nproperty float x\nproperty float y\nproperty float z\n",
            ),
            "ends inside",
        ),
        (huge("element vertex 0\nproperty float x\n"), "vertices have no x, y and z"),
        (
            huge(
                "element vertex 0\nproperty float x\nproperty float y\nproperty float z\nelement face 0\nproperty int a\n",
            ),
            "faces have no list vertex_indices",
        ),
    ];
    for (text, expected) in cases {
        let error = read_bytes(text.as_bytes()).expect_err(expected).to_string();
        assert!(error.contains(expected), "{error}\nexpected {expected}");
    }
}

#[test]
fn elements_without_properties_take_no_time() {
    let text = "ply\nformat ascii 1.0\nelement nothing 18446744073709551615\nend_header\n";
    assert!(read_bytes(text.as_bytes()).is_err());
}
