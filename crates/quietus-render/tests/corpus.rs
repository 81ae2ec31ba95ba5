//! Replays the fuzzer's corpus of checkpoints.

use std::path::{Path, PathBuf};
use std::time::Duration;

use quietus_render::checkpoint::{Identity, Keeper};
use quietus_render::{Keeping, Sampling};

#[allow(unreachable_pub, reason = "the fuzzer has it as a library")]
#[path = "../../../fuzz/src/going_on.rs"]
mod going_on;

const SAMPLINGS: [(&str, Sampling); 3] =
    [("quietus", Sampling::Quietus), ("unbiased", Sampling::Unbiased), ("dammertz", Sampling::Dammertz)];

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/checkpoint")
}

#[test]
fn replay() {
    let (mut drawn, mut refused) = (0, 0);
    for entry in std::fs::read_dir(folder()).expect("the corpus is part of the repository") {
        let path = entry.expect("a readable folder").path();
        let bytes = std::fs::read(&path).expect("a readable file");
        for (_, sampling) in SAMPLINGS {
            match going_on::checkpoint(&bytes, sampling) {
                Ok(_) => drawn += 1,
                Err(error) => {
                    assert!(!error.is_empty(), "{}", path.display());
                    refused += 1;
                }
            }
        }
    }
    assert!(drawn >= 3 && refused >= 8, "{drawn} drawn and {refused} refused in {}", folder().display());
}

/// A checkpoint without its seal, of a finished picture.
fn checkpoint(sampling: Sampling) -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("a.qck");
    let warn = |error: &quietus_film::OutputError| panic!("{error}");
    let keeper = Keeper::new(path.clone(), Duration::from_secs(99), Identity::default(), warn);
    let mut keeping = Keeping { keeper: Some(keeper), ..Keeping::default() };
    going_on::draw(&going_on::settings(sampling), &mut keeping).expect("a picture");
    let mut bytes = std::fs::read(path).expect("a checkpoint");
    bytes.truncate(bytes.len() - 24);
    bytes
}

#[test]
fn every_byte_of_a_checkpoint_may_be_another_one() {
    let whole = checkpoint(Sampling::Quietus);
    let drawn = going_on::checkpoint(&whole, Sampling::Quietus).expect("it is whole");
    let again =
        going_on::draw(&going_on::settings(Sampling::Quietus), &mut Keeping::default()).expect("a picture");
    assert!(drawn.film.state() == again.film.state());
    // A sample of all of them, evenly spread.
    for place in (0..whole.len()).step_by(whole.len() / 300) {
        for bit in [1, 64, 255] {
            let mut bytes = whole.clone();
            bytes[place] ^= bit;
            let _ = going_on::checkpoint(&bytes, Sampling::Quietus);
        }
    }
}

#[test]
#[ignore = "writes the first files of the corpus anew, as after a change of the format"]
fn write_corpus() {
    std::fs::create_dir_all(folder()).expect("a folder");
    for (name, sampling) in SAMPLINGS {
        let bytes = checkpoint(sampling);
        std::fs::write(folder().join(name), &bytes).expect("a file");
        std::fs::write(folder().join(format!("{name}-cut")), &bytes[..bytes.len() / 2]).expect("a file");
    }
}
