//! Fuzzes the reader of NanoVDB files.

#![no_main]
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| quietus_fuzz::readers::nanovdb(bytes));
