//! Pictures written in the tests and read back.

use std::io::Cursor;

use image::{Rgba, RgbaImage};

use super::*;

/// 5 x 3 texels that all differ.
fn numbers() -> RgbaImage {
    RgbaImage::from_fn(5, 3, |x, y| Rgba([x as u8 * 40, y as u8 * 90, 255 - x as u8, 255]))
}

fn encoded(format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let rgb = DynamicImage::ImageRgba8(numbers()).into_rgb8();
    rgb.write_to(&mut bytes, format).expect("memory does not fail");
    bytes.into_inner()
}

fn decoded(name: &str, bytes: &[u8], encoding: Encoding) -> Result<Image, SceneError> {
    let file = Path::new(name);
    let format =
        Format::of(file, bytes).ok_or_else(|| SceneError::new(ErrorKind::Unsupported, file, "", ""))?;
    decode(file, "", bytes.into(), format, encoding, name.to_owned())
}

const LOSSLESS: [(ImageFormat, &str); 5] = [
    (ImageFormat::Png, "a.png"),
    (ImageFormat::Tga, "a.TGA"),
    (ImageFormat::Bmp, "a.bmp"),
    (ImageFormat::WebP, "a.webp"),
    (ImageFormat::Qoi, "a.qoi"),
];

#[test]
fn eight_bits_stay_as_they_are() {
    let expected: Vec<[u8; 4]> = numbers().pixels().map(|pixel| pixel.0).collect();
    for (format, name) in LOSSLESS {
        let image = decoded(name, &encoded(format), Encoding::Srgb).expect(name);
        assert_eq!((image.width, image.height), (5, 3), "{name}");
        let Texels::Srgb8(texels) = image.texels else { panic!("{name} is not 8-bit sRGB") };
        assert_eq!(texels, expected, "{name}");
    }
    let linear = decoded("a.png", &encoded(ImageFormat::Png), Encoding::Linear).expect("a sound file");
    assert!(matches!(linear.texels, Texels::Linear8(texels) if texels == expected));
}

#[test]
fn gamma_is_undone_for_colours_alone() {
    let image = decoded("a.png", &encoded(ImageFormat::Png), Encoding::Gamma(2.0)).expect("a sound file");
    let Texels::Float(texels) = image.texels else { panic!("expected floats") };
    for (texel, expected) in texels.iter().zip(numbers().pixels()) {
        for c in 0..4 {
            let value = f32::from(expected.0[c]) / 255.0;
            let value = if c < 3 { value * value } else { value };
            assert!((texel[c] - value).abs() < 1e-6, "{texel:?} {expected:?}");
        }
    }
}

#[test]
fn float_maps_have_either_byte_order_and_their_bottom_row_first() {
    let file = |header: &str, floats: &[[u8; 4]]| [header.as_bytes(), floats.as_flattened()].concat();
    let values = [1.0_f32, 2.0, 3.0, 4.0, 5.0, 6.0];
    let expected = [[4.0, 5.0, 6.0, 1.0], [1.0, 2.0, 3.0, 1.0]];
    for (scale, bytes) in [("-1.0", values.map(f32::to_le_bytes)), ("1", values.map(f32::to_be_bytes))] {
        let image =
            decoded("a", &file(&format!("PF\n1 2\n{scale}\n"), &bytes), Encoding::Srgb).expect("sound");
        assert!(matches!(&image.texels, Texels::Float(texels) if *texels == expected), "{image:?}");
    }
    let grey = decoded("a", &file("Pf\n2 1\n-1\n", &[0.5_f32, 0.25].map(f32::to_le_bytes)), Encoding::Srgb);
    let grey = grey.expect("a sound file");
    let expected = [[0.5, 0.5, 0.5, 1.0], [0.25, 0.25, 0.25, 1.0]];
    assert!(matches!(&grey.texels, Texels::Float(texels) if *texels == expected), "{grey:?}");
}

#[test]
fn openexr_may_be_grey_or_have_alpha() {
    use exr::prelude::{AnyChannel, AnyChannels, FlatSamples, Image as Exr, SmallVec, WritableImage};
    let write = |channels: &[(&str, [f32; 2])]| {
        let channel =
            |(name, values): &(&str, [f32; 2])| AnyChannel::new(*name, FlatSamples::F32(values.to_vec()));
        let list: SmallVec<[_; 4]> = channels.iter().map(channel).collect();
        let mut bytes = Cursor::new(Vec::new());
        let picture = Exr::from_channels((2, 1), AnyChannels::sort(list));
        picture.write().to_buffered(&mut bytes).expect("memory does not fail");
        bytes.into_inner()
    };
    let read = |channels: &[(&str, [f32; 2])]| decoded("a.exr", &write(channels), Encoding::Srgb);
    let grey = read(&[("Y", [0.5, 2.0])]).expect("a sound file");
    assert!(matches!(grey.texels, Texels::Float(t) if t == [[0.5, 0.5, 0.5, 1.0], [2.0, 2.0, 2.0, 1.0]]));
    let color = [("R", [1.0, -1.0]), ("G", [2.0, 2.0]), ("B", [3.0, 3.0]), ("A", [0.5, 0.0])];
    let texels = read(&color).expect("a sound file").texels;
    assert!(matches!(texels, Texels::Float(t) if t == [[1.0, 2.0, 3.0, 0.5], [0.0, 2.0, 3.0, 0.0]]));
    assert_eq!(read(&[("Z", [0.0, 0.0])]).expect_err("no colour").kind(), ErrorKind::Syntax);
}

/// Every truncation and many single changed bits of every format: an error or a picture, never a panic.
#[test]
fn broken_files_are_errors() {
    let jpeg = (ImageFormat::Jpeg, "a.jpg");
    let mut files: Vec<_> = LOSSLESS.into_iter().chain([jpeg]).map(|(f, name)| (encoded(f), name)).collect();
    files.push((b"PF\n1 1\n-1\n0123456789ab".to_vec(), "a.pfm"));
    for (sound, name) in files {
        decoded(name, &sound, Encoding::Srgb).expect(name);
        for length in 0..sound.len() {
            let _ = decoded(name, &sound[..length], Encoding::Srgb);
        }
        for bit in (0..sound.len() * 8).step_by(5) {
            let mut bytes = sound.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            let _ = decoded(name, &bytes, Encoding::Srgb);
        }
    }
}

#[test]
fn pictures_beyond_the_limits_are_refused_by_their_header() {
    let refused = |bytes: &[u8]| decoded("a", bytes, Encoding::Srgb).expect_err("too large or empty").kind();
    assert_eq!(refused(b"PF\n100000 100000\n-1\n"), ErrorKind::Unsupported);
    assert_eq!(refused(b"PF\n0 5\n-1\n"), ErrorKind::Invalid);
    let mut tga = encoded(ImageFormat::Tga);
    tga[12..16].fill(0xff);
    let error = decoded("a.tga", &tga, Encoding::Srgb).expect_err("65535 x 65535 texels");
    assert_eq!(error.kind(), ErrorKind::Unsupported);
}

#[test]
fn a_batch_reads_each_file_once_per_encoding_and_names_who_wants_a_missing_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.png");
    std::fs::write(&path, encoded(ImageFormat::Png)).expect("a writable folder");
    let mut images = Images::default();
    let first = images.request(path.clone(), Encoding::Srgb, "scene:1:1");
    let again = images.request(path.clone(), Encoding::Srgb, "scene:2:1");
    let linear = images.request(path.clone(), Encoding::Linear, "scene:3:1");
    assert_eq!((first, again, linear), (ImageId(0), ImageId(0), ImageId(1)));
    let loaded = images.load().expect("both can be read");
    assert!(matches!(loaded[0].texels, Texels::Srgb8(_)) && matches!(loaded[1].texels, Texels::Linear8(_)));
    let mut images = Images::default();
    images.request(path, Encoding::Srgb, "scene:1:1");
    images.request(folder.path().join("gone.png"), Encoding::Srgb, "scene:7:5");
    let error = images.load().expect_err("one is gone");
    assert_eq!((error.kind(), error.place()), (ErrorKind::NotFound, "named by scene:7:5"));
}

/// A PFM file of 2x2 greys, whose rows go from the bottom to the top.
fn pfm_of(greys: [f32; 4]) -> Vec<u8> {
    let mut bytes = b"Pf\n2 2\n-1.0\n".to_vec();
    [2, 3, 0, 1].map(|i: usize| greys[i]).iter().for_each(|grey| bytes.extend(grey.to_le_bytes()));
    bytes
}

#[test]
fn numbers_that_make_no_sense_are_refused_with_their_place() {
    let of = |grey: f32, encoding| decoded("a.pfm", &pfm_of([0.0, 1.0, grey, 2.0]), encoding);
    for (grey, encoding) in [
        (f32::NAN, Encoding::Linear),
        (f32::INFINITY, Encoding::NotNegative),
        (f32::NAN, Encoding::NotNegative),
        (-0.25, Encoding::NotNegative),
    ] {
        let message = of(grey, encoding).expect_err("it makes no sense").to_string();
        assert!(message.contains("column 0, row 1") && message.contains(&grey.to_string()), "{message}");
    }
    // Filters leave behind negative colours; and -0 is 0.
    let Texels::Float(texels) = of(-0.25, Encoding::Linear).expect("lifted to 0").texels else {
        panic!("no floats")
    };
    assert_eq!(texels[2][..3], [0.0; 3]);
    assert!(of(-0.0, Encoding::NotNegative).is_ok());
}
