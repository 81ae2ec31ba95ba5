//! Any bytes as a glTF file: `cargo +nightly fuzz run gltf` in the repository's root. The corpus in `corpus/gltf` is
//! replayed by the ordinary tests of `quietus-scene` too.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    // The path names no folder that exists, so that only the bytes themselves are read.
    let _ = quietus_scene::load_bytes("no/such/folder/fuzz.gltf".as_ref(), bytes);
});
