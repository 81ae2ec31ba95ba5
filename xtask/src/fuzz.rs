//! `cargo xtask fuzz`: hostile files for every reader, on a stable toolchain.

use std::fs;

use anyhow::{Context, Result, bail};

use crate::run::{cargo, host, root, run};

/// Coverage counters and comparisons as libFuzzer reads them. They are LLVM's own, so that neither a nightly toolchain
/// nor cargo-fuzz is needed; without the address sanitizer, which is, what goes wrong outside of safe Rust shows only
/// where it crashes.
const FLAGS: &str = "--cfg fuzzing -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
    -Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table \
    -Cllvm-args=-sanitizer-coverage-trace-compares -Ccodegen-units=1";

/// What to fuzz, and for how long.
#[derive(clap::Args)]
pub(crate) struct Fuzz {
    /// Names of targets, see fuzz/fuzz_targets; all of them, in turn, where none is given
    targets: Vec<String>,
    /// Minutes for each of them
    #[arg(long, default_value_t = 5)]
    minutes: u32,
    /// Most memory, in MiB, that a target may hold
    #[arg(long, default_value_t = 2048)]
    memory: u32,
    /// Keep of the corpus only what is needed to reach what it reaches, instead of looking for more
    #[arg(long)]
    minimize: bool,
}

/// Builds the targets and runs them one by one on one core, at the lowest priority. New inputs go to the corpus, and
/// what breaks a reader to fuzz/artifacts.
pub(crate) fn fuzz(task: &Fuzz) -> Result<()> {
    let folder = root().join("fuzz");
    let host = host()?;
    run(cargo()
        .args(["build", "--release", "--bins", "--manifest-path"])
        .arg(folder.join("Cargo.toml"))
        // With a target named, build scripts and macros are built without counters.
        .args(["--target", &host])
        .env("RUSTFLAGS", FLAGS))?;
    let built = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| folder.join("target"), Into::into);
    let mut targets = task.targets.clone();
    if targets.is_empty() {
        for entry in fs::read_dir(folder.join("fuzz_targets"))? {
            targets.push(stem(&entry?.path()));
        }
    }
    targets.sort();
    for target in &targets {
        let program = built.join(&host).join("release").join(target);
        if !program.exists() {
            bail!("there is no fuzz target `{target}`");
        }
        let (corpus, artifacts) = (folder.join("corpus").join(target), folder.join("artifacts").join(target));
        fs::create_dir_all(&corpus)?;
        fs::create_dir_all(&artifacts)?;
        let mut command = std::process::Command::new("nice");
        command.args(["-n", "19"]).arg(program).arg(format!("-artifact_prefix={}/", artifacts.display()));
        command.args(["-timeout=10", "-max_len=16384", &format!("-rss_limit_mb={}", task.memory)]);
        if task.minimize {
            let kept = tempfile::tempdir()?;
            run(command.arg("-merge=1").arg(kept.path()).arg(&corpus))?;
            fs::remove_dir_all(&corpus)?;
            fs::create_dir(&corpus)?;
            for entry in fs::read_dir(kept.path())? {
                let from = entry?.path();
                fs::copy(&from, corpus.join(from.file_name().context("a file has a name")?))?;
            }
        } else {
            run(command.arg(format!("-max_total_time={}", 60 * task.minutes)).arg(&corpus))?;
        }
    }
    Ok(())
}

fn stem(path: &std::path::Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}
