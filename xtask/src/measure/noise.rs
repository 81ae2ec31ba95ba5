//! Whether renders get the noise, and the time, that they are asked for: the tables of docs/noise.md.

use std::path::PathBuf;
use std::process::Command;

use anyhow::Result;

use super::results::SCENES;
use crate::run::{Quietus, run, shared_scenes};

/// Prints a table of noise and one of time for each scene.
pub(super) fn noise(quietus: &Quietus, only: Option<&str>, runs: u32) -> Result<()> {
    for (scene, size, depth) in SCENES {
        if only.is_some_and(|only| !scene.contains(only)) {
            continue;
        }
        let path = if scene == "embedded" { PathBuf::from(scene) } else { shared_scenes()?.join(scene) };
        let mut command = Command::new(quietus.program());
        command.arg("eval").arg(&path).args(["--size", size, "--max-depth", depth]);
        command.args(["--reference-spp", "65536", "--noise", "0.5%,1%,2%,4%", "--runs", &runs.to_string()]);
        run(&mut command)?;
        let mut command = Command::new(quietus.program());
        command.arg("eval").arg(&path).args(["--size", size, "--max-depth", depth]);
        run(command.args(["--reference-spp", "65536", "--time", "2s,10s", "--runs", "3"]))?;
    }
    Ok(())
}
