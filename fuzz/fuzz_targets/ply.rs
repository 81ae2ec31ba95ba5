//! Fuzzes the reader of PLY meshes.

#![no_main]
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| quietus_fuzz::readers::ply(bytes));
