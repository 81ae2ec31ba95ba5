//! Replays the fuzzers' corpora of pbrt, PLY and tensor files, whole, cut short and damaged: every file gives a scene or an
//! error, never a panic.

use std::path::Path;

use quietus_scene::{SceneError, load_bytes, read_measured_bytes, read_ply_bytes};

type Files = Vec<(String, Vec<u8>)>;

fn corpus(name: &str) -> Files {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus").join(name);
    let entries = std::fs::read_dir(&folder).expect("the corpus is part of the repository");
    let mut files: Files = entries
        .map(|entry| {
            let path = entry.expect("a readable folder").path();
            (path.display().to_string(), std::fs::read(&path).expect("a readable file"))
        })
        .collect();
    files.sort();
    assert!(files.len() >= 8, "only {} files in {}", files.len(), folder.display());
    files
}

/// Reads a scene without looking for files: the folder does not exist.
fn read_pbrt(bytes: &[u8]) -> Result<(), SceneError> {
    load_bytes("no/such/folder/fuzz.pbrt".as_ref(), bytes).map(|_| ())
}

fn read_ply(bytes: &[u8]) -> Result<(), SceneError> {
    let mesh = read_ply_bytes("fuzz.ply".as_ref(), bytes)?;
    let vertices = mesh.positions.len();
    assert!(mesh.triangles.as_flattened().iter().all(|&index| (index as usize) < vertices));
    Ok(())
}

fn read_measured(bytes: &[u8]) -> Result<(), SceneError> {
    read_measured_bytes("fuzz.bsdf".as_ref(), bytes).map(|_| ())
}

/// Numbers from Knuth's linear congruential generator (MMIX); its high bits are good enough to pick bytes.
struct Generator(u64);

impl Generator {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % end
    }
}

/// Reads every file of a corpus as it is, cut at many places, and with bytes flipped, moved and repeated.
fn torture(files: &Files, read: fn(&[u8]) -> Result<(), SceneError>) -> [usize; 2] {
    let mut generator = Generator(0x5EED);
    let mut outcomes = [0, 0];
    let mut count = |bytes: &[u8]| {
        let outcome = read(bytes);
        outcomes[usize::from(outcome.is_err())] += 1;
        if let Err(error) = outcome {
            assert!(!error.message().is_empty());
        }
    };
    for (_, bytes) in files {
        count(bytes);
        for _ in 0..40 {
            count(&bytes[..generator.below(bytes.len())]);
        }
        for _ in 0..160 {
            let mut damaged = bytes.clone();
            for _ in 0..1 + generator.below(3) {
                let at = generator.below(damaged.len());
                let other = generator.below(damaged.len());
                match generator.below(4) {
                    0 => damaged[at] ^= 1 << generator.below(8),
                    1 => damaged[at] = damaged[other],
                    2 => drop(damaged.drain(at.min(other)..at.max(other).min(at.min(other) + 30))),
                    _ => {
                        let part = damaged[at..damaged.len().min(at + 30)].to_vec();
                        damaged.splice(other..other, part);
                    }
                }
                if damaged.is_empty() {
                    damaged.push(0);
                }
            }
            count(&damaged);
        }
    }
    outcomes
}

/// Damaged files must have come out both ways: else little of the reader has been tried.
fn check(files: &Files, read: fn(&[u8]) -> Result<(), SceneError>) {
    let [read, refused] = torture(files, read);
    assert!(read > files.len() && refused > files.len(), "{read} were read, {refused} refused");
}

#[test]
fn scenes_of_pbrt() {
    check(&corpus("pbrt"), read_pbrt);
}

#[test]
fn ply_files() {
    check(&corpus("ply"), read_ply);
}

#[test]
fn measured_materials() {
    check(&corpus("measured"), read_measured);
}
