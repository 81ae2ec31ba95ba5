//! Fuzzes the reader of recorded samples.

#![no_main]
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| quietus_fuzz::bank(bytes));
