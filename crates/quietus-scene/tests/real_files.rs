//! Real files: counts taken from their JSON by hand, and damaged copies that must never panic.

mod common;

use std::path::Path;

use common::shared;
use quietus_scene::{ErrorKind, SceneFile, load, load_bytes, load_environment, summary};
use quietus_trace::desc::{Alpha, Surface, Texels, Texture};

#[test]
fn flight_helmet() {
    let Some(path) = shared("flight-helmet/FlightHelmet.gltf") else { return };
    let loaded = load(&path).expect("a sound file");
    let sum = summary(&loaded.scene);
    assert_eq!((sum.triangles, sum.materials, sum.textures, sum.instances), (94_722, 6, 15, 6));
    let blended = |alpha: &Alpha| matches!(alpha, Alpha::Blend { .. });
    assert_eq!(loaded.scene.materials.iter().filter(|material| blended(&material.alpha)).count(), 1);
    // Colours are sRGB, normals and roughness are not: 5 base colours among 15 textures.
    let srgb = |texels: &Texels| matches!(texels, Texels::Srgb8(_));
    assert_eq!(
        loaded
            .scene
            .textures
            .iter()
            .filter(|texture| matches!(texture, Texture::Image(t) if srgb(&t.image.texels)))
            .count(),
        5
    );
}

#[test]
fn cornell_box() {
    let Some(path) = shared("cornell-box/gltf/CornellBox.glb") else { return };
    let loaded = load(&path).expect("a sound file");
    let sum = summary(&loaded.scene);
    assert_eq!((sum.triangles, sum.emitters, sum.environment), (36, 1, false));
    let lamp = &loaded.scene.materials[0];
    assert_eq!((lamp.emission.factor.to_array(), lamp.emission_two_sided), ([100.0; 3], true));
    assert!(matches!(lamp.surface, Surface::MetalRough(_)));
}

#[test]
fn fox_and_morph_targets() {
    let Some(path) = shared("animated-fox/Fox.glb") else { return };
    let fox = SceneFile::open(&path).expect("a sound file");
    let clips: Vec<_> = fox.animations().iter().map(|clip| clip.name.as_str()).collect();
    assert_eq!(clips, ["Survey", "Walk", "Run"]);
    let frame = fox.animated(1, [0.25, 0.27]).expect("a sound file");
    assert_eq!(summary(&frame.scene).triangles, 576);
    assert_eq!(frame.warnings.len(), 2, "only camera and sky are missing: {:?}", frame.warnings);
    let Some(path) = shared("animated-fox/MorphStressTest.gltf") else { return };
    let morph = SceneFile::open(&path).expect("a sound file");
    let frame = morph.animated(2, [0.5, 0.5]).expect("a sound file");
    assert_eq!(summary(&frame.scene).triangles, 2412);
    assert_eq!(frame.warnings.len(), 2, "only camera and sky are missing: {:?}", frame.warnings);
}

#[test]
fn environment_map() {
    let Some(path) = shared("hdri/studio_small_03_1k.hdr") else { return };
    let environment = load_environment(&path).expect("a sound file");
    let image = environment.image.expect("a picture");
    assert_eq!((image.width, image.height), (1024, 512));
    let Texels::Float(texels) = &image.texels else { panic!("expected floats") };
    assert_eq!(texels.len(), 1024 * 512);
    assert!(texels.iter().flatten().all(|value| value.is_finite() && *value >= 0.0));
    let bytes = std::fs::read(&path).expect("just read");
    let folder = tempfile::tempdir().expect("a folder");
    let cut = folder.path().join("cut.hdr");
    for length in [0, 1, 5, 40, 200, bytes.len() / 2, bytes.len() - 1] {
        std::fs::write(&cut, &bytes[..length]).expect("a writable folder");
        let error = load_environment(&cut).expect_err("a truncated file");
        assert_eq!(error.kind(), ErrorKind::Syntax, "{length} bytes: {error}");
    }
}

/// A truncated file is always an error: its header says how long it is.
#[test]
fn truncated_everywhere() {
    for name in ["cornell-box/gltf/CornellBox.glb", "animated-fox/Fox.glb"] {
        let Some(path) = shared(name) else { return };
        let bytes = std::fs::read(&path).expect("a readable file");
        let step = (bytes.len() / 700).max(1);
        for length in (0..bytes.len()).step_by(step).chain([bytes.len() - 1]) {
            let error = load_bytes(&path, &bytes[..length]).expect_err("a truncated file");
            assert_eq!(error.kind(), ErrorKind::Syntax, "{length} bytes of {name}: {error}");
        }
    }
}

/// Flipped bytes may go unnoticed or be an error, but never a panic; errors always say what is wrong.
#[test]
fn flipped_bytes() {
    let Some(path) = shared("cornell-box/gltf/CornellBox.glb") else { return };
    let sound = std::fs::read(&path).expect("a readable file");
    let mut state = 0x5EED_u64;
    let mut next = move || {
        // Knuth's linear congruential generator (MMIX); its high bits are good enough to pick bytes.
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize
    };
    let mut refused = 0;
    for _ in 0..6000 {
        let mut bytes = sound.clone();
        for _ in 0..1 + next() % 3 {
            let at = next() % bytes.len();
            bytes[at] ^= 1 << (next() % 8);
        }
        if let Err(error) = load_bytes(Path::new("flipped.glb"), &bytes) {
            assert!(!error.message().is_empty());
            refused += 1;
        }
    }
    assert!(refused > 1000, "only {refused} of 6000 damaged files were refused");
}
