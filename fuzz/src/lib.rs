//! Fuzz targets of everything that reads files: `cargo xtask fuzz`, see docs/fuzzing.md.

pub mod going_on;
pub mod readers;

/// Any bytes as a bank of recorded samples.
pub fn bank(bytes: &[u8]) {
    if let Err(error) = quietus_eval::Bank::from_bytes("fuzz", bytes.to_vec()) {
        assert!(!error.to_string().is_empty());
    }
}

/// Any bytes as a checkpoint of each way of sampling whose state has a form of its own.
pub fn checkpoint(bytes: &[u8]) {
    use quietus_render::Sampling::{Dammertz, Quietus, Unbiased};
    for sampling in [Quietus, Unbiased, Dammertz] {
        if let Err(error) = going_on::checkpoint(bytes, sampling) {
            assert!(!error.is_empty());
        }
    }
}
