//! Against a stub that is compiled here, and against the real library where `QUIETUS_OIDN` names it.

use std::path::{Path, PathBuf};
use std::process::Command;

use quietus_denoise::{DenoiseError, Denoiser, Noisy};

/// Compiles the stub.
fn stub(dir: &Path) -> PathBuf {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/stub/oidn.rs");
    let library = dir.join(format!("stub{}", std::env::consts::DLL_SUFFIX));
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let flags =
        ["--edition=2024", "--crate-type=cdylib", "-Anon_snake_case", "-Aimproper_ctypes_definitions", "-o"];
    let status = Command::new(rustc).args(flags).arg(&library).arg(source).status().expect("rustc starts");
    assert!(status.success());
    library
}

#[test]
fn guides_are_cleaned_and_used() {
    let dir = tempfile::tempdir().unwrap();
    let denoiser = Denoiser::load(Some(&stub(dir.path()))).unwrap();
    assert_eq!(denoiser.version().unwrap(), 20_099);
    let pixels = |value: f32| vec![[value, 0.0, 2.0 * value]; 6];
    let (color, albedo, normal) = (pixels(1.0), pixels(10.0), pixels(100.0));
    let plain = Noisy { width: 3, height: 2, color: &color, albedo: None, normal: None };
    assert_eq!(denoiser.denoise(&plain).unwrap(), color);
    let guided = Noisy { albedo: Some(&albedo), ..plain };
    assert_eq!(denoiser.denoise(&guided).unwrap(), pixels(21.0));
    let both = Noisy { normal: Some(&normal), ..guided };
    assert_eq!(denoiser.denoise(&both).unwrap(), pixels(221.0));
    let alone = Noisy { normal: Some(&normal), ..plain };
    assert_eq!(denoiser.denoise(&alone).unwrap(), color, "normals alone are not used");
}

#[test]
fn what_cannot_be_denoised_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let denoiser = Denoiser::load(Some(&stub(dir.path()))).unwrap();
    let color = vec![[0.0; 3]; 6];
    let noisy = Noisy { width: 3, height: 2, color: &color, albedo: None, normal: None };
    let said = |noisy: Noisy<'_>| denoiser.denoise(&noisy).unwrap_err().to_string();
    assert_eq!(said(Noisy { width: 2, ..noisy }), "color has 6 pixels instead of 2x2");
    assert_eq!(said(Noisy { albedo: Some(&color[1..]), ..noisy }), "albedo has 5 pixels instead of 3x2");
    let mut broken = color.clone();
    broken[4][1] = f32::NAN;
    assert_eq!(said(Noisy { color: &broken, ..noisy }), "color is not finite at (1, 1)");
    let wide = vec![[0.0; 3]; 101];
    let wide = Noisy { width: 101, height: 1, color: &wide, albedo: None, normal: None };
    assert_eq!(said(wide), "Open Image Denoise: too wide for a stub");
}

#[test]
fn what_is_not_the_library_is_told_apart() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("not.so");
    std::fs::write(&file, "not a library").unwrap();
    assert!(matches!(Denoiser::load(Some(&file)), Err(DenoiseError::Unloadable { .. })));
    assert!(matches!(
        Denoiser::load(Some(&dir.path().join("none.so"))),
        Err(DenoiseError::Unloadable { .. })
    ));
    let other = dir.path().join(format!("other{}", std::env::consts::DLL_SUFFIX));
    let source = dir.path().join("other.rs");
    std::fs::write(&source, "#[unsafe(no_mangle)] pub extern \"C\" fn oidnNewDevice() {}").unwrap();
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let flags = ["--edition=2024", "--crate-type=cdylib", "-Anon_snake_case", "-o"];
    assert!(Command::new(rustc).args(flags).args([&other, &source]).status().unwrap().success());
    match Denoiser::load(Some(&other)) {
        Err(DenoiseError::NotVersion2 { reason, .. }) => {
            assert!(reason.contains("oidnSetFilterBool"), "{reason}")
        }
        other => panic!("{:?}", other.map(|_| "loaded").map_err(|error| error.to_string())),
    }
}

#[test]
fn the_real_library_removes_noise() {
    let Some(path) = std::env::var_os("QUIETUS_OIDN") else {
        eprintln!("NOT TESTED: the real Open Image Denoise; QUIETUS_OIDN does not name it");
        return;
    };
    let denoiser = Denoiser::load(Some(path.as_ref())).unwrap();
    assert!((20_000..30_000).contains(&denoiser.version().unwrap()));
    // A grey plane under noise of a linear congruential generator.
    let mut state = 1_u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / 16_777_216.0
    };
    let color: Vec<[f32; 3]> = (0..128 * 96).map(|_| std::array::from_fn(|_| 2.0 * random())).collect();
    let (albedo, normal) = (vec![[0.5; 3]; color.len()], vec![[0.0, 0.0, 1.0]; color.len()]);
    let noisy = Noisy { width: 128, height: 96, color: &color, albedo: Some(&albedo), normal: Some(&normal) };
    let clean = denoiser.denoise(&noisy).unwrap();
    let variance = |pixels: &[[f32; 3]]| {
        let squares = pixels.as_flattened().iter().map(|value| (f64::from(*value) - 1.0).powi(2));
        squares.sum::<f64>() / (3 * pixels.len()) as f64
    };
    assert!(variance(&clean) < 0.05 * variance(&color), "{} of {}", variance(&clean), variance(&color));
}
