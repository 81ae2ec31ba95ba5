//! Benches: criterion's, the ray kernel against Embree, and whole pictures against Mitsuba.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Result, bail};

use crate::profile_guided::{self, Package};
use crate::run::{cargo, root, run, shared_scenes, target};

/// Word that has `peers` measure what [`profile_guided`] builds.
const PROFILE_GUIDED: &str = "--profile-guided";

/// `peers`, `kernel`, or what goes to `cargo bench`.
pub(crate) fn bench(arguments: &[String]) -> Result<()> {
    match arguments.split_first() {
        Some((what, rest)) if what == "peers" => peers(rest),
        Some((what, rest)) if what == "kernel" => kernel(rest),
        _ => run(cargo().arg("bench").args(arguments)),
    }
}

/// The ray kernel against Embree 3 in robust mode.
fn kernel(arguments: &[String]) -> Result<()> {
    let manifest = root().join("bench/embree/Cargo.toml");
    run(cargo().args(["run", "--release", "--manifest-path"]).arg(manifest).arg("--").args(arguments))
}

/// Whole pictures against Mitsuba 3, in an environment of Python's that is set up on first use.
fn peers(arguments: &[String]) -> Result<()> {
    let python = python_with_mitsuba()?;
    let scenes = shared_scenes()?;
    let file = |path: &str| scenes.join(path).display().to_string();
    let drawn = ["veach-ajar/veach-ajar-local.pbrt", "bmw-m6/bmw-m6-local.pbrt"].map(file);
    let (flags, arguments): (Vec<_>, Vec<_>) = arguments.iter().partition(|a| *a == PROFILE_GUIDED);
    let mut command = if flags.is_empty() {
        let mut command = cargo();
        let manifest = root().join("bench/peers/Cargo.toml");
        command.args(["run", "--release", "--manifest-path"]).arg(manifest).arg("--");
        command
    } else {
        Command::new(profile_guided::build(&Package { name: "quietus-bench-peers", draw: draw_as_peer })?)
    };
    command.arg("--python").arg(python);
    if !arguments.iter().any(|argument| argument.starts_with("--scenes")) {
        command.arg("--scenes").arg(["embedded", "lump", &drawn[0], &drawn[1]].join(","));
    }
    if std::env::var_os("DRJIT_LIBLLVM_PATH").is_none() {
        command.env("DRJIT_LIBLLVM_PATH", llvm()?);
    }
    run(command.args(arguments))
}

/// One measurement of `program`, as the comparison starts it.
fn draw_as_peer(program: &Path, scene: Option<&str>, folder: &Path) -> Command {
    let mut command = Command::new(program);
    command.args(["ours", "--size=96", "--samples=16", "--max-depth=8", "--threads=1", "--folder"]);
    command.arg(folder).arg(scene.unwrap_or("embedded"));
    command
}

/// A virtual environment in the target folder.
fn python_with_mitsuba() -> Result<PathBuf> {
    let folder = target().join("mitsuba-venv");
    let python = folder.join("bin/python");
    if !python.exists() {
        run(Command::new("python3").args(["-m", "venv"]).arg(&folder))?;
    }
    run(Command::new(&python).args(["-m", "pip", "install", "--quiet", "mitsuba==3.9.1", "numpy"]))?;
    Ok(python)
}

/// Mitsuba's llvm variants load LLVM at run time.
fn llvm() -> Result<PathBuf> {
    let path = PathBuf::from("/usr/lib/x86_64-linux-gnu/libLLVM-19.so");
    if !path.exists() {
        bail!("Mitsuba's llvm variants need LLVM: install Debian's libllvm19, or set DRJIT_LIBLLVM_PATH");
    }
    Ok(path)
}
