//! Replays the fuzzers' corpora.

use std::path::Path;

#[allow(unreachable_pub, reason = "the fuzzer has it as a library")]
#[path = "../../../fuzz/src/readers.rs"]
mod readers;

#[test]
fn replay() {
    for (name, read) in readers::READERS {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus").join(name);
        let mut count = 0;
        for entry in std::fs::read_dir(&folder).expect("the corpora are part of the repository") {
            let path = entry.expect("a readable folder").path();
            println!("{}", path.display());
            read(&std::fs::read(&path).expect("a readable file"));
            count += 1;
        }
        assert!(count >= 8, "only {count} files in {}", folder.display());
    }
}
