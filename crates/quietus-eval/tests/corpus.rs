//! Replays the fuzzer's corpus of banks.

use std::path::Path;

#[test]
fn replay() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/bank");
    let (mut opened, mut refused) = (0, 0);
    for entry in std::fs::read_dir(&folder).expect("the corpus is part of the repository") {
        let path = entry.expect("a readable folder").path();
        let bytes = std::fs::read(&path).expect("a readable file");
        match quietus_eval::Bank::from_bytes("fuzz", bytes) {
            Ok(_) => opened += 1,
            Err(error) => {
                assert!(!error.to_string().is_empty(), "{}", path.display());
                refused += 1;
            }
        }
    }
    assert!(opened >= 1 && refused >= 6, "{opened} opened and {refused} refused in {}", folder.display());
}
