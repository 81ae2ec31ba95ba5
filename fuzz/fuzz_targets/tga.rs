//! Fuzzes the reader of Truevision pictures, which have no magic number.

#![no_main]
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| quietus_fuzz::readers::tga(bytes));
