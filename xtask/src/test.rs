//! `cargo xtask test`: everything that must pass.

use anyhow::Result;

use crate::{
    browser,
    lint::lint,
    run::{cargo, root, run},
};

/// Lints, then all tests; the concurrency protocol once more under loom and shuttle, which replace the standard
/// library's atomics and locks and so need builds of their own.
pub(crate) fn test() -> Result<()> {
    lint()?;
    let axe = browser::prepare().map(|path| ("QUIETUS_AXE", path));
    run(cargo().args(["test", "--workspace"]).envs(axe))?;
    for checker in ["loom", "shuttle"] {
        // Their own target folders: other flags would rebuild everything each time.
        let target = root().join("target").join(checker);
        run(cargo()
            .args(["test", "--release", "--package", "quietus", "--test", checker])
            .env("CARGO_TARGET_DIR", target)
            .env("RUSTFLAGS", format!("--cfg {checker}")))?;
    }
    Ok(())
}
