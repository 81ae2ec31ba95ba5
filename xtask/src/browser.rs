//! What the tests of the live view need beside cargo: Chromium with its driver, and axe-core's rules for accessibility.

use std::{
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, Result, bail};

use crate::run::{root, run};

/// Rules change with versions: tests that passed should go on passing.
const AXE: &str = "axe-core@4.14.1";

/// Installs what is missing, as far as may be, and returns where axe-core is. What is missing still is said here; the
/// tests say that they did not run, and fail where `CI` is set.
pub(crate) fn prepare() -> Option<PathBuf> {
    for (program, packages) in [("chromedriver", &["chromium", "chromium-driver"][..]), ("npm", &["npm"])] {
        if !is_installed(program)
            && let Err(error) = install(packages)
        {
            eprintln!("warning: {program} is missing, and so some tests of the live view: {error:#}");
        }
    }
    axe().inspect_err(|error| eprintln!("warning: accessibility is not tested: {error:#}")).ok()
}

fn is_installed(program: &str) -> bool {
    let paths = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&paths).any(|path| path.join(program).is_file())
}

/// By Debian's means, where they are there and we may.
fn install(packages: &[&str]) -> Result<()> {
    let user = Command::new("id").arg("-u").output().context("cannot tell who we are")?;
    if user.stdout.trim_ascii() != b"0" || !is_installed("apt-get") {
        bail!("install it (Debian and Ubuntu: sudo apt-get install {})", packages.join(" "));
    }
    run(Command::new("apt-get").args(["install", "--yes", "--no-install-recommends"]).args(packages))
}

/// From the npm registry, into the target folder.
fn axe() -> Result<PathBuf> {
    let folder = target().join("browser");
    let script = folder.join("package/axe.min.js");
    if !script.is_file() {
        std::fs::create_dir_all(&folder)?;
        run(Command::new("npm").args(["pack", "--silent", AXE]).current_dir(&folder))?;
        let archive = format!("{}.tgz", AXE.replace('@', "-"));
        run(Command::new("tar").args(["-xzf", &archive]).current_dir(&folder))?;
    }
    script.canonicalize().context("axe-core has no axe.min.js")
}

fn target() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR")
        .map_or_else(|| root().join("target"), |path| Path::new(&path).to_owned())
}
