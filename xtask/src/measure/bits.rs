//! The same bits for any number of threads.

use anyhow::{Result, ensure};
use quietus_film::{Picture, read_exr};
use sha2::{Digest, Sha256};

use crate::run::Quietus;

/// Draws the embedded scene with 1, 2, 3, 4 and 7 threads and compares the SHA-256 of every pixel of every layer.
pub(super) fn bits(quietus: &Quietus) -> Result<()> {
    println!("| policy | threads | SHA-256 of the pixel data |\n|---|---|---|");
    for sampling in ["quietus", "talk", "tile", "dammertz", "pixel", "uniform"] {
        let mut first: Option<String> = None;
        for threads in ["1", "2", "3", "4", "7"] {
            let limit = if sampling == "uniform" { ["--spp", "32"] } else { ["--max-samples", "256"] };
            let mut words = vec!["--sampling", sampling, "--size", "320x180", "--threads", threads];
            words.extend(limit);
            quietus.render(&words)?;
            let hash = hash(&read_exr(&quietus.picture())?.0);
            println!("| {sampling} | {threads} | {hash} |");
            ensure!(*first.get_or_insert_with(|| hash.clone()) == hash, "{sampling}: the bits differ");
        }
    }
    Ok(())
}

fn hash(picture: &Picture) -> String {
    let mut sha = Sha256::new();
    let mut floats = |values: &[f32]| values.iter().for_each(|v| sha.update(v.to_bits().to_le_bytes()));
    floats(picture.beauty.as_flattened());
    floats(&picture.error);
    floats(picture.albedo.as_flattened());
    floats(picture.normal.as_flattened());
    floats(&picture.depth);
    picture.samples.iter().for_each(|v| sha.update(v.to_le_bytes()));
    sha.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}
