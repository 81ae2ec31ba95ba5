//! Environment maps written in the tests and read back.

use std::path::Path;

use exr::prelude::{WritableImage, f16, write_rgb_file};
use quietus_scene::{ErrorKind, SceneError, load_environment};
use quietus_trace::desc::{Environment, Texels};

fn read(bytes: &[u8]) -> Result<Environment, SceneError> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("sky");
    std::fs::write(&path, bytes).expect("a writable folder");
    load_environment(&path)
}

fn texels(environment: &Environment) -> &[[f32; 4]] {
    match &environment.image.as_ref().expect("a picture").texels {
        Texels::Float(texels) => texels,
        other => panic!("expected floats, got {other:?}"),
    }
}

/// A 4 x 2 OpenEXR picture whose red is the column, green the row, and blue as given.
fn exr_file(blue: f32) -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("sky.exr");
    write_rgb_file(&path, 4, 2, |x, y| (x as f32, y as f32, blue)).expect("a writable folder");
    std::fs::read(path).expect("just written")
}

#[test]
fn openexr() {
    let environment = read(&exr_file(-0.5)).expect("a sound file");
    let image = environment.image.as_ref().expect("a picture");
    assert_eq!((image.width, image.height), (4, 2));
    // Row by row from the top, negative values lifted to 0.
    let expected: Vec<_> = (0..8_u8).map(|i| [f32::from(i % 4), f32::from(i / 4), 0.0, 1.0]).collect();
    assert_eq!(texels(&environment), expected);
}

#[test]
fn half_floats() {
    use exr::prelude::{Image, SpecificChannels};
    let channels = SpecificChannels::rgb(|_| (f16::from_f32(0.5), f16::from_f32(1.0), f16::from_f32(2.0)));
    let mut bytes = std::io::Cursor::new(Vec::new());
    let picture = Image::from_channels((2, 2), channels);
    picture.write().to_buffered(&mut bytes).expect("memory does not fail");
    assert_eq!(texels(&read(&bytes.into_inner()).expect("a sound file")), [[0.5, 1.0, 2.0, 1.0]; 4]);
}

#[test]
fn radiance() {
    let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n".to_vec();
    // Mantissas over 256, times 2 to the exponent less 128 (Ward 1991, "Real Pixels").
    bytes.extend([128, 64, 32, 129, 255, 0, 0, 128]);
    let environment = read(&bytes).expect("a sound file");
    assert_eq!(texels(&environment)[0], [1.0, 0.5, 0.25, 1.0]);
}

#[test]
fn values_that_are_not_finite_are_named() {
    let error = read(&exr_file(f32::INFINITY)).expect_err("an infinite sky");
    assert_eq!((error.kind(), error.place()), (ErrorKind::Invalid, "column 0, row 0"));
}

#[test]
fn foreign_and_broken_files() {
    assert_eq!(read(b"").expect_err("empty").kind(), ErrorKind::Syntax);
    assert_eq!(read(b"\x89PNG").expect_err("a PNG").kind(), ErrorKind::Syntax);
    let huge = read(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 100000 +X 100000\n").expect_err("no texels");
    assert_eq!(huge.kind(), ErrorKind::Unsupported, "{huge}");
    let sound = exr_file(1.0);
    for length in 0..sound.len() {
        let error = read(&sound[..length]).expect_err("a truncated file");
        assert_eq!(error.kind(), ErrorKind::Syntax, "{length} bytes: {error}");
    }
    // Every third bit of the file in turn: an error or not, but never a panic.
    for bit in (0..sound.len() * 8).step_by(3) {
        let mut bytes = sound.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        let _ = read(&bytes);
    }
    assert!(load_environment(Path::new(".")).is_err_and(|error| error.kind() == ErrorKind::Unreadable));
}
