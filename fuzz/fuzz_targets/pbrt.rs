//! Any bytes as a scene of pbrt: `cargo +nightly fuzz run pbrt` in the repository's root. The corpus in `corpus/pbrt` is
//! replayed by the ordinary tests of `quietus-scene` too.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    // The path names no folder that exists, so that only the bytes themselves are read.
    let _ = quietus_scene::load_bytes("no/such/folder/fuzz.pbrt".as_ref(), bytes);
});
