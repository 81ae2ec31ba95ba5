//! The program, killed: what it saved is whole, and what comes of it has the same bits.

#![cfg(unix)]

mod common;

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use common::{command, quietus, stderr, succeeded};
use quietus_film::{Picture, read_exr};
use tempfile::TempDir;

/// A picture that takes some tenths of a second.
const PICTURE: &str = "render --size 48x32 --max-depth 6 --target-error 0.004 --max-samples 512 -o a.exr";

/// Another one, in several rounds, with measurements of the noise between them.
const ROUNDS: &str = "render --size 40x24 --max-depth 6 --noise 4% -o a.exr";

fn dir() -> TempDir {
    tempfile::tempdir().expect("a temporary directory")
}

fn succeeds(dir: &Path, arguments: &str) -> Output {
    succeeded(arguments, quietus(dir, arguments))
}

fn picture(dir: &Path) -> Picture {
    read_exr(&dir.join("a.exr")).expect("a picture").0
}

/// The picture of an uninterrupted render without checkpoints.
fn uninterrupted(picture_flags: &str) -> Picture {
    let dir = dir();
    succeeds(dir.path(), picture_flags);
    picture(dir.path())
}

/// Numbers that differ from run to run in nothing (a linear congruential generator, Knuth's constants).
struct Dice(u64);

impl Dice {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % limit
    }
}

/// Kills the render of `flags` again and again, after up to `longest` milliseconds each time, until it is through or was
/// killed `most` times, and lets it end. Returns how often it was killed.
fn drawn_under_fire(dir: &Path, flags: &str, longest: u64, most: u32, seed: u64) -> u32 {
    let mut dice = Dice(seed);
    for kills in 0..most {
        let threads = 1 + dice.below(4);
        let arguments =
            format!("{flags} --checkpoint c.qck --checkpoint-every 0.002 --resume --threads {threads}");
        let mut child = command(dir, &arguments).stderr(Stdio::null()).stdout(Stdio::null()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(5 + dice.below(longest)));
        child.kill().unwrap();
        if child.wait().unwrap().success() {
            return kills;
        }
    }
    succeeds(dir, &format!("{flags} --checkpoint c.qck --resume"));
    most
}

#[test]
fn killed_again_and_again_it_ends_with_the_same_bits() {
    let mut kills = 0;
    for (flags, seed) in [(PICTURE, 1), (ROUNDS, 2), (ROUNDS, 3)] {
        let expected = uninterrupted(flags);
        let dir = dir();
        kills += drawn_under_fire(dir.path(), flags, 150, 12, seed);
        assert!(picture(dir.path()) == expected, "{flags}, seed {seed}");
        let left: Vec<_> = std::fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert!(!left.iter().any(|name| name.to_string_lossy().ends_with(".part")), "{left:?}");
    }
    assert!(kills >= 10, "only {kills} times killed");
}

#[test]
#[ignore = "takes minutes: the same, hundreds of times, in every way of sampling"]
fn killed_hundreds_of_times() {
    let mut kills = 0;
    for sampling in ["quietus", "unbiased", "talk", "tile", "dammertz", "pixel"] {
        for flags in ["", " --lag 1", " --regions 3 --checks locks"] {
            let flags = format!("{PICTURE} --sampling {sampling}{flags}");
            let expected = uninterrupted(&flags);
            for seed in 0..4 {
                let dir = dir();
                kills += drawn_under_fire(dir.path(), &flags, 300, 25, seed);
                assert!(picture(dir.path()) == expected, "{flags}, seed {seed}");
            }
        }
    }
    for seed in 0..20 {
        let expected = uninterrupted(ROUNDS);
        let dir = dir();
        kills += drawn_under_fire(dir.path(), ROUNDS, 300, 25, seed);
        assert!(picture(dir.path()) == expected, "{ROUNDS}, seed {seed}");
    }
    println!("killed {kills} times");
}

#[test]
fn a_picture_that_time_ended_is_drawn_again_bit_for_bit() {
    for (goal, sampling) in [
        ("--time 0.6", ""),
        ("--time 0.3 --target-error 1e-9", "--sampling talk"),
        ("--time 0.3", "--sampling uniform"),
    ] {
        let dir = dir();
        let again = format!("render --size 40x24 --max-depth 6 -o a.exr {sampling}");
        let flags = format!("{again} {goal}");
        succeeds(dir.path(), &format!("{flags} --record r.qrec --threads 3"));
        let expected = picture(dir.path());
        for threads in [1, 4] {
            std::fs::remove_file(dir.path().join("a.exr")).unwrap();
            succeeds(dir.path(), &format!("{again} --replay r.qrec --threads {threads}"));
            assert!(picture(dir.path()) == expected, "{flags}, {threads} threads");
        }
        let output = quietus(dir.path(), &format!("{again} --replay r.qrec --seed 5"));
        assert!(stderr(&output).contains("seed was 0, is 5"), "{}", stderr(&output));
    }
}

#[test]
fn what_was_asked_of_aovs_need_not_be_known_to_draw_again() {
    let dir = dir();
    let again = "render --size 40x24 --max-depth 6 -o a.exr";
    succeeds(
        dir.path(),
        &format!("{again} --noise 4% --aov-noise alpha=3% --aov-noise normal=3% --record r.qrec"),
    );
    let expected = picture(dir.path());
    std::fs::remove_file(dir.path().join("a.exr")).unwrap();
    succeeds(dir.path(), &format!("{again} --replay r.qrec"));
    assert!(picture(dir.path()) == expected);
}

#[test]
fn interrupted_by_hand_it_goes_on_with_another_number_of_threads() {
    let expected = uninterrupted(PICTURE);
    let dir = dir();
    let mut child = command(dir.path(), &format!("{PICTURE} --checkpoint c.qck --threads 1"));
    let child = child.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(300));
    Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    let ended = child.wait_with_output().unwrap();
    assert!(matches!(ended.status.code(), Some(130 | 0)), "{:?}", ended.status);
    assert!(dir.path().join("c.qck").exists());
    succeeds(dir.path(), &format!("{PICTURE} --checkpoint c.qck --resume --threads 3"));
    assert!(picture(dir.path()) == expected);
}

/// A finished render and its checkpoint.
fn finished() -> TempDir {
    let dir = dir();
    succeeds(dir.path(), &format!("{PICTURE} --checkpoint c.qck"));
    dir
}

/// Wants exit code `code` and that nothing changes; returns the message.
fn refused(dir: &Path, arguments: &str, code: i32) -> String {
    let before = std::fs::read(dir.join("c.qck")).unwrap();
    let output = quietus(dir, arguments);
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(code), "{arguments}: {message}");
    assert!(message.contains("error: ") && !message.contains("panicked"), "{arguments}: {message}");
    assert!(std::fs::read(dir.join("c.qck")).unwrap() == before, "{arguments}: the checkpoint was changed");
    message
}

#[test]
fn a_finished_render_goes_on_to_less_noise_and_loses_nothing() {
    let dir = finished();
    let before = picture(dir.path());
    succeeds(dir.path(), &format!("{PICTURE} --checkpoint c.qck --resume"));
    assert!(picture(dir.path()) == before, "asked for the same, it is the same");
    let finer = PICTURE.replace("0.004", "0.002");
    succeeds(dir.path(), &format!("{finer} --checkpoint c.qck --resume"));
    let after = picture(dir.path());
    let pairs = || before.samples.iter().zip(&after.samples);
    assert!(pairs().all(|(before, after)| before <= after) && pairs().any(|(before, after)| before < after));
    let message = refused(dir.path(), &format!("{PICTURE} --checkpoint c.qck --resume"), 3);
    assert!(message.contains("target_error was 0.002, is 0.004"), "{message}");
}

#[test]
fn crops_killed_again_and_again_end_with_the_same_bits() {
    let crop = "render --size 64x48 --crop 13,7,53,31 --max-depth 6 --noise 2% -o a.exr";
    let expected = uninterrupted(crop);
    let dir = dir();
    let kills = drawn_under_fire(dir.path(), crop, 150, 8, 4);
    assert!(kills >= 3, "only {kills} times killed");
    assert!(picture(dir.path()) == expected);
}

#[test]
fn frames_go_on_where_they_were_killed() {
    // A camera before an emitter under a sky; nothing moves, so that frames differ by their numbers alone.
    let scene = r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5126, "count": 2, "type": "SCALAR"},
            {"componentType": 5126, "count": 2, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 1, "byteLength": 8}],
        "buffers": [{"byteLength": 36, "uri":
            "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"},
            {"byteLength": 8, "uri": "data:application/octet-stream;base64,AACAPwAAAEA="}],
        "animations": [{"channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
            "samplers": [{"input": 1, "output": 2}]}]}"#;
    let flags = "render scene.gltf --frames 3-4 --size 64x48 --noise 0.3% -o a.####.exr";
    let drawn =
        |folder: &Path| ["a.0003.exr", "a.0004.exr"].map(|name| read_exr(&folder.join(name)).unwrap().0);
    let expected = {
        let dir = dir();
        std::fs::write(dir.path().join("scene.gltf"), scene).unwrap();
        succeeds(dir.path(), flags);
        drawn(dir.path())
    };
    let dir = dir();
    std::fs::write(dir.path().join("scene.gltf"), scene).unwrap();
    let kills = drawn_under_fire(dir.path(), flags, 150, 8, 6);
    assert!(kills >= 3, "only {kills} times killed");
    assert!(drawn(dir.path()) == expected);
    // Each frame has a state of its own: the first alone is gone on from, and is finished.
    let files = ["c.0003.qck", "c.0004.qck"].map(|name| dir.path().join(name).exists());
    assert_eq!(files, [true, true]);
}

#[test]
fn a_checkpoint_of_something_else_is_refused_with_what_differs() {
    let dir = finished();
    let resume = "--checkpoint c.qck --resume";
    for (flags, expected) in [
        ("--seed 7", "seed was 0, is 7"),
        ("--filter box", "filter was blackman-harris, is box"),
        ("--lag 1", "lag was 2, is 1"),
        ("--crop 0,0,8,8", "crop was 0,0,48,32, is 0,0,8,8"),
        ("--sampling talk", "sampling was quietus, is talk"),
    ] {
        let message = refused(dir.path(), &format!("{PICTURE} {flags} {resume}"), 3);
        assert!(message.contains(expected), "{flags}: {message}");
    }
    // The same map of weights under another name, and another one.
    let map = |name: &str, value: u8| {
        image::GrayImage::from_pixel(48, 32, image::Luma([value])).save(dir.path().join(name)).unwrap();
    };
    map("map.png", 200);
    map("same.png", 200);
    map("other.png", 100);
    let message = refused(dir.path(), &format!("{PICTURE} --weight map.png {resume}"), 3);
    assert!(message.contains("the file map.png was not part of the scene"), "{message}");
    let weighted = "render --size 48x32 --noise 9% --max-depth 4 -o b.exr --checkpoint w.qck";
    succeeds(dir.path(), &format!("{weighted} --weight map.png --aov-noise normal=9%"));
    let differs = |flags: &str| {
        let output = quietus(dir.path(), &format!("{weighted} {flags} --resume"));
        assert_eq!(output.status.code(), Some(3), "{flags}: {}", stderr(&output));
        stderr(&output)
    };
    let message = differs("--weight other.png --aov-noise normal=9%");
    assert!(message.contains("other.png was not part of the scene"), "{message}");
    let message = differs("--weight map.png --aov-noise normal=5%");
    assert!(message.contains("aov_noise was normal=9, is normal=5"), "{message}");
    succeeds(dir.path(), &format!("{weighted} --weight map.png --aov-noise normal=9% --resume"));
    // Another scene, and then the same with another content.
    let triangle = |albedo: &str| {
        let text = format!(
            "LookAt 0 0 5 0 0 0 0 1 0\nCamera \"perspective\"\nWorldBegin\nLightSource \"infinite\"\n\
             Material \"diffuse\" \"rgb reflectance\" [{albedo}]\nShape \"sphere\"\n"
        );
        std::fs::write(dir.path().join("scene.pbrt"), text).unwrap();
    };
    triangle("0.5 0.5 0.5");
    let with_scene = PICTURE.replace("render", "render scene.pbrt");
    let message = refused(dir.path(), &format!("{with_scene} {resume}"), 3);
    assert!(message.contains("the file scene.pbrt was not part of the scene"), "{message}");
    std::fs::remove_file(dir.path().join("c.qck")).unwrap();
    succeeds(dir.path(), &format!("{with_scene} --checkpoint c.qck"));
    succeeds(dir.path(), &format!("{with_scene} {resume}"));
    triangle("0.5 0.5 0.4");
    let message = refused(dir.path(), &format!("{with_scene} {resume}"), 3);
    assert!(message.contains("the file scene.pbrt has another content"), "{message}");
}

#[test]
fn broken_checkpoints_are_told_apart_and_kept() {
    let dir = finished();
    let path = dir.path().join("c.qck");
    let whole = std::fs::read(&path).unwrap();
    let resume = format!("{PICTURE} --checkpoint c.qck --resume");
    let said = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        refused(dir.path(), &resume, 3)
    };
    for length in [20, whole.len() / 2, whole.len() - 1] {
        assert!(said(&whole[..length]).contains("is cut off"), "{length} bytes");
    }
    for place in [100, whole.len() / 2, whole.len() - 1] {
        let mut bytes = whole.clone();
        bytes[place] ^= 16;
        assert!(said(&bytes).contains("is damaged"), "byte {place}");
    }
    let mut other = whole.clone();
    other[8] += 1;
    assert!(said(&other).contains(&format!("version {} of its format", other[8])));
    assert!(said(b"PNG").contains("is no checkpoint"));
    assert!(said(b"").contains("is no checkpoint"));
    // Nobody overwrites what was saved by asking for the same again.
    std::fs::write(&path, &whole).unwrap();
    let message = refused(dir.path(), &format!("{PICTURE} --checkpoint c.qck"), 2);
    assert!(message.contains("--resume goes on from it"), "{message}");
}

#[test]
fn without_a_file_it_starts_from_the_beginning_and_says_so() {
    let dir = dir();
    let output = succeeds(dir.path(), &format!("{PICTURE} --checkpoint c.qck --resume"));
    assert!(stderr(&output).contains("c.qck: no checkpoint yet"), "{}", stderr(&output));
    assert!(dir.path().join("c.qck").exists());
}
