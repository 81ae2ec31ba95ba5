//! Fuzzes the reader of checkpoints, and what goes on from them.

#![no_main]
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| quietus_fuzz::checkpoint(bytes));
