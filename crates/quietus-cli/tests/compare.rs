//! `quietus compare` from outside.

mod common;

use std::path::Path;

use common::{quietus, stderr, stdout, succeeded};
use serde_json::Value;

fn draw(dir: &Path, flags: &str) {
    succeeded(flags, quietus(dir, &format!("render --size 32x24 {flags}")));
}

#[test]
fn pictures_are_compared_and_exit_codes_tell() {
    let dir = tempfile::tempdir().unwrap();
    let at = dir.path();
    draw(at, "--spp 4 --seed 1 -o a.exr");
    draw(at, "--spp 4 --seed 2 -o b.exr");
    draw(at, "--spp 64 --seed 3 -o c.exr");
    let same = quietus(at, "compare a.exr a.exr --max-flip 0");
    assert_eq!(same.status.code(), Some(0));
    let other = quietus(at, "compare a.exr b.exr --max-flip 0.001 --difference flip.png");
    assert_eq!(other.status.code(), Some(1));
    let said = stdout(&other);
    for word in ["RMSE", "relMSE", "display", "FLIP", "brightness", "worst tile"] {
        assert!(said.contains(word), "{word} is missing: {said}");
    }
    assert_eq!(image_size(&at.join("flip.png")), [192, 24 + 48], "with its legend");
    let json = quietus(at, "compare a.exr c.exr --reference b.exr --json");
    let found: Value = serde_json::from_slice(&json.stdout).unwrap();
    let error = |i: usize| found[i]["rmse"].as_f64().unwrap();
    assert!(error(1) < error(0), "more samples are nearer to any other picture: {found}");
}

/// Width and height stand in a PNG's first chunk.
fn image_size(path: &Path) -> [u32; 2] {
    let bytes = std::fs::read(path).unwrap();
    [16, 20].map(|at| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap()))
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let at = dir.path();
    draw(at, "--spp 1 -o a.exr");
    let output = quietus(at, "render --size 16x24 --spp 1 -o b.exr");
    assert!(output.status.success());
    std::fs::write(at.join("broken.exr"), b"no picture").unwrap();
    for (arguments, word) in [
        ("compare a.exr b.exr", "only pictures of one size"),
        ("compare a.exr missing.exr", "missing.exr"),
        ("compare a.exr broken.exr", "not a readable OpenEXR file"),
    ] {
        let output = quietus(at, arguments);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(3), "{arguments}: {said}");
        assert!(said.starts_with("error: ") && said.contains(word), "{arguments}: {said}");
    }
}
