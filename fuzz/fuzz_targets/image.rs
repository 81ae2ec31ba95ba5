//! Fuzzes the reader of pictures of all formats.

#![no_main]
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| quietus_fuzz::readers::image(bytes));
