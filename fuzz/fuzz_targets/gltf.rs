//! Fuzzes the reader of glTF 2.0 files.

#![no_main]
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| quietus_fuzz::readers::gltf(bytes));
