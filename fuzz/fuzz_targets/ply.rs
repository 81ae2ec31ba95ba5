//! Any bytes as a PLY file: `cargo +nightly fuzz run ply` in the repository's root. The corpus in `corpus/ply` is
//! replayed by the ordinary tests of `quietus-scene` too.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = quietus_scene::read_ply_bytes("fuzz.ply".as_ref(), bytes);
});
