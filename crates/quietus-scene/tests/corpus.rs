//! Replays the fuzzer's corpus: every file gives a scene or an error, never a panic.

use std::path::Path;

#[test]
fn replay() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/gltf");
    let mut count = 0;
    for entry in std::fs::read_dir(&folder).expect("the corpus is part of the repository") {
        let path = entry.expect("a readable folder").path();
        let bytes = std::fs::read(&path).expect("a readable file");
        if let Err(error) = quietus_scene::load_bytes("no/such/folder/fuzz.gltf".as_ref(), &bytes) {
            assert!(!error.message().is_empty(), "{}", path.display());
        }
        count += 1;
    }
    assert!(count >= 8, "only {count} files in {}", folder.display());
}
