//! Fuzz targets of everything that reads files: `cargo xtask fuzz`, see docs/fuzzing.md.

pub mod readers;

/// Any bytes as a bank of recorded samples.
pub fn bank(bytes: &[u8]) {
    if let Err(error) = quietus_eval::Bank::from_bytes("fuzz", bytes.to_vec()) {
        assert!(!error.to_string().is_empty());
    }
}
