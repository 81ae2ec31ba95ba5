//! `cargo xtask lint`: formatting, clippy, and house rules that neither knows.

use std::{fs, path::PathBuf, process::Command};

use anyhow::{Context, Result, bail};

use crate::run::{cargo, root, run};

/// Files with more lines than this are warned about: time to split.
const LONG_FILE: usize = 600;

pub(crate) fn lint() -> Result<()> {
    run(cargo().args(["fmt", "--all", "--check"]))?;
    run(cargo().args(["clippy", "--workspace", "--all-targets", "--", "-D", "warnings"]))?;
    house_rules()
}

/// Every module opens with `//!` and says what it is for; the library for renderers forbids unsafe code.
fn house_rules() -> Result<()> {
    let mut broken = Vec::new();
    for file in rust_files()? {
        let text = fs::read_to_string(root().join(&file)).with_context(|| file.display().to_string())?;
        if !text.starts_with("//!") {
            broken.push(format!("{}: opens without `//!`", file.display()));
        }
        if text.lines().count() > LONG_FILE {
            eprintln!("note: {} has more than {LONG_FILE} lines", file.display());
        }
    }
    if !fs::read_to_string(root().join("crates/quietus/src/lib.rs"))?.contains("#![forbid(unsafe_code)]") {
        broken.push("crates/quietus/src/lib.rs: must forbid unsafe code".into());
    }
    if !broken.is_empty() {
        bail!("house rules:\n{}", broken.join("\n"));
    }
    Ok(())
}

/// The Rust files under version control.
fn rust_files() -> Result<Vec<PathBuf>> {
    let output = Command::new("git").args(["ls-files", "*.rs"]).current_dir(root()).output()?;
    let files: Vec<PathBuf> = String::from_utf8(output.stdout)?.lines().map(PathBuf::from).collect();
    if files.is_empty() {
        bail!("git lists no Rust files: {}", String::from_utf8_lossy(&output.stderr));
    }
    Ok(files.into_iter().filter(|file| root().join(file).exists()).collect())
}

pub(crate) fn deny() -> Result<()> {
    if run(cargo().args(["deny", "--version"])).is_err() {
        run(cargo().args(["install", "--locked", "cargo-deny"]))?;
    }
    run(cargo().args(["deny", "check", "licenses", "bans", "sources"]))
}
