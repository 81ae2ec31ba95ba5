//! Fuzzes the reader of environment maps.

#![no_main]
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| quietus_fuzz::readers::environment(bytes));
