//! `quietus inspect` and `quietus convert` from outside.

mod common;

use std::path::Path;

use common::{quietus, refusal, stdout, succeeded};
use quietus_film::{read_exr, read_exr_planes, srgb8};

/// Runs it, wants success, returns what it printed.
fn run(dir: &Path, arguments: &str) -> String {
    stdout(&succeeded(arguments, quietus(dir, arguments)))
}

/// Runs it, wants that exit code, returns the message.
fn refused(dir: &Path, arguments: &str, code: i32) -> String {
    refusal(arguments, &quietus(dir, arguments), code)
}

/// A directory with a cropped picture in `a.exr`.
fn drawn() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    run(dir.path(), "render -o a.exr --size 60x40 --crop 4,2,60,40 --target-error 0.02 --max-samples 64");
    dir
}

fn png(dir: &Path, name: &str) -> image::RgbImage {
    image::open(dir.join(name)).unwrap().to_rgb8()
}

#[test]
fn inspect_says_what_was_asked_reached_and_spent() {
    let dir = drawn();
    let said = run(dir.path(), "inspect a.exr --samples s.png --error e.png");
    for expected in [
        "picture   60x40, cropped to 4,2,60,40 of built-in",
        "asked     quietus, target error 0.02, at least 16 samples, at most 64 samples, seed 0",
        "finished  yes",
        "% of white (95 % interval",
        "samples   mean",
        "16-31",
        "error     mean",
    ] {
        assert!(said.contains(expected), "{expected:?} is not in:\n{said}");
    }
    for name in ["s.png", "e.png"] {
        assert_eq!(png(dir.path(), name).dimensions(), (192, 38 + 48), "{name}: the picture and its legend");
    }
    let json: serde_json::Value = serde_json::from_str(&run(dir.path(), "inspect a.exr --json")).unwrap();
    let picture = read_exr(&dir.path().join("a.exr")).unwrap().0;
    let mean = picture.samples.iter().map(|&n| f64::from(n)).sum::<f64>() / picture.samples.len() as f64;
    assert!((json["samples"]["mean"].as_f64().unwrap() - mean).abs() < 1e-9);
    assert_eq!(json["settings"]["sampling"], "quietus");
    assert!(json["settings"]["noise_reached"].as_str().unwrap().parse::<f64>().unwrap() > 0.0);
    run(dir.path(), "convert a.exr colors.exr --layer albedo");
    let message = refused(dir.path(), "inspect colors.exr", 3);
    assert!(message.contains("lacks the channel") && message.contains("quietus render"), "{message}");
    assert!(refused(dir.path(), "inspect none.exr", 3).contains("none.exr: no such file"));
    assert!(refused(dir.path(), "inspect a.exr --samples no/such/s.png", 4).contains("no/such/s.png"));
}

#[test]
fn convert_shows_light_and_layers() {
    let dir = drawn();
    let planes = read_exr_planes(&dir.path().join("a.exr")).unwrap();
    let beauty = planes.rgb().unwrap();
    let codes = |factor: f32| -> Vec<u8> {
        beauty.iter().flat_map(|pixel| pixel.map(|value| srgb8(value * factor))).collect()
    };
    run(dir.path(), "convert a.exr plain.png");
    assert_eq!(png(dir.path(), "plain.png").into_raw(), codes(1.0));
    run(dir.path(), "convert a.exr bright.png --stops 1");
    assert_eq!(png(dir.path(), "bright.png").into_raw(), codes(2.0));
    run(dir.path(), "convert a.exr agx.png --tone agx");
    assert_ne!(png(dir.path(), "agx.png").into_raw(), codes(1.0));
    let normals = planes.triple(["normal.X", "normal.Y", "normal.Z"]).unwrap();
    run(dir.path(), "convert a.exr normal.png --layer normal");
    let expected = normals[0].map(|value| ((0.5 * value + 0.5) * 255.0).round() as u8);
    assert_eq!(png(dir.path(), "normal.png").get_pixel(0, 0).0, expected);
    for layer in ["depth", "samples", "error", "alpha"] {
        run(dir.path(), &format!("convert a.exr {layer}.png --layer {layer}"));
        assert_eq!(png(dir.path(), &format!("{layer}.png")).dimensions(), (192, 38 + 48), "{layer}");
    }
}

#[test]
fn convert_keeps_what_an_exr_holds() {
    let dir = drawn();
    let read = |name: &str| read_exr(&dir.path().join(name)).unwrap();
    run(dir.path(), "convert a.exr same.exr");
    assert!(read("a.exr") == read("same.exr"));
    run(dir.path(), "convert a.exr half.exr --exposure 0.5");
    let (half, full) = (read("half.exr").0, read("a.exr").0);
    assert!(half.beauty.iter().zip(&full.beauty).all(|(a, b)| a[0] == 0.5 * b[0] && a[3] == b[3]));
    assert_eq!((half.window, half.samples), (full.window, full.samples));
    run(dir.path(), "convert a.exr depth.exr --layer depth");
    let depth = read_exr_planes(&dir.path().join("depth.exr")).unwrap();
    assert_eq!(depth.channels.len(), 3);
    assert_eq!(depth.channel("G"), Some(full.depth.as_slice()));
}

#[test]
fn convert_refuses_what_makes_no_sense() {
    let dir = drawn();
    let cases = [
        ("convert a.exr a.jpeg", 2, "a.jpeg: unknown picture format"),
        ("convert a.exr b.exr --tone agx", 2, "--tone is for PNG files"),
        ("convert a.exr b.png --layer depth --stops 1", 2, "are for light"),
        ("convert a.exr b.png --layer albedo --denoise", 2, "--denoise is for the picture itself"),
        ("convert a.exr b.png --stops 1 --exposure 2", 2, "cannot be used with"),
        ("convert a.exr no/b.png", 4, "no/b.png: cannot write"),
        ("convert none.exr b.png", 3, "none.exr: no such file"),
        ("convert a.exr b.png --denoise --oidn none.so", 3, "none.so: cannot load it"),
    ];
    for (arguments, code, expected) in cases {
        let message = refused(dir.path(), arguments, code);
        assert!(message.contains(expected), "{arguments}: {message}");
        assert!(!dir.path().join("b.png").exists() && !dir.path().join("b.exr").exists());
    }
}
