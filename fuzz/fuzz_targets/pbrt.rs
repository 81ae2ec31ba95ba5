//! Fuzzes the reader of pbrt-v4 files.

#![no_main]
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| quietus_fuzz::readers::pbrt(bytes));
