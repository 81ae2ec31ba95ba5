//! `cargo xtask build`: the program, optimised by a profile of what it does (docs/performance.md tells what that brings).
//!
//! It is built twice: with counters, to draw a dozen small pictures, and then for what they counted. Pictures are the
//! same to the bit.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::run::{cargo, host, root, run, shared_scenes, target};

/// Scenes of the repository that are drawn for the profile, beside the embedded one.
const OWN: [&str; 2] = ["docs/scenes/lens.pbrt", "docs/scenes/swing.gltf"];

/// Scenes beside the repository: between them all kinds of materials, shapes, lights and media. Those that are compared
/// with other renderers are not among them.
const SHARED: [&str; 9] = [
    "animated-fox/Fox.glb",
    "chopper-titan/chopper-titan-v4-local.pbrt",
    "cornell-box/cornell-box-specular-volume.pbrt",
    "cornell-box/gltf/CornellBox.glb",
    "flight-helmet/FlightHelmet.gltf",
    "generated/grass.pbrt",
    "generated/hairball.pbrt",
    "generated/motion-blur.pbrt",
    "veach-mis/veach-mis.pbrt",
];

/// A program to be built.
pub(crate) struct Package {
    /// Its package; the program is called so, too, unless it is Quietus itself.
    pub(crate) name: &'static str,
    /// How the program draws a scene, the embedded one where none is named, into a folder, on one thread: counters are not
    /// made for more.
    pub(crate) draw: fn(&Path, Option<&str>, &Path) -> Command,
}

/// Builds Quietus and says where it is.
pub(crate) fn program() -> Result<()> {
    let built = build(&Package { name: "quietus-cli", draw })?;
    eprintln!("built {}", built.display());
    Ok(())
}

fn draw(program: &Path, scene: Option<&str>, folder: &Path) -> Command {
    let mut command = Command::new(program);
    command.arg("render").args(scene);
    command.args(["--size=96x64", "--noise=2%", "--max-samples=64", "--threads=1", "--progress=none", "-o"]);
    command.arg(folder.join("picture.exr"));
    command
}

/// Builds the program of `package` by a profile and returns where it is.
pub(crate) fn build(package: &Package) -> Result<PathBuf> {
    let merge = profile_merger()?;
    // The compiler and the counting program have working folders of their own.
    let folder = std::path::absolute(target())?.join("profile-guided");
    let counts = folder.join("counts");
    // Counts of older programs say nothing of this one.
    if counts.exists() {
        std::fs::remove_dir_all(&counts)?;
    }
    let counting = compile(package, &folder.join("counting"), flag("-Cprofile-generate=", &counts))?;
    let scratch = tempfile::tempdir()?;
    for scene in std::iter::once(None).chain(scenes()?.iter().map(|scene| Some(scene.as_str()))) {
        run(&mut (package.draw)(&counting, scene, scratch.path()))?;
    }
    let profile = folder.join("merged.profdata");
    run(Command::new(merge).args(["merge", "-o"]).arg(&profile).arg(&counts))?;
    compile(package, &folder, flag("-Cprofile-use=", &profile))
}

/// What is drawn for the profile.
fn scenes() -> Result<Vec<String>> {
    let shared = shared_scenes()
        .context("a profile without hair, media, maps and meshes would slow them down: nothing is built")?;
    let own = OWN.iter().map(|scene| root().join(scene));
    let paths = own.chain(SHARED.iter().map(|scene| shared.join(scene)));
    Ok(paths.map(|path| path.display().to_string()).collect())
}

/// A flag of the compiler's with a path.
fn flag(name: &str, path: &Path) -> OsString {
    let mut flag = OsString::from(name);
    flag.push(path);
    flag
}

/// A release build with a flag in a folder of its own; returns the program. Naming the target keeps the flag from build
/// scripts and macros.
fn compile(package: &Package, folder: &Path, flag: OsString) -> Result<PathBuf> {
    let host = host()?;
    run(cargo()
        .args(["build", "--release", "--package", package.name, "--target", &host])
        .env("CARGO_TARGET_DIR", folder)
        .env("CARGO_ENCODED_RUSTFLAGS", flag))?;
    let name = if package.name == "quietus-cli" { "quietus" } else { package.name };
    folder.join(host).join("release").join(name).canonicalize().context("the program was not built")
}

/// LLVM's tool of the compiler's own version.
fn profile_merger() -> Result<PathBuf> {
    let output = Command::new("rustc").args(["--print", "target-libdir"]).current_dir(root()).output();
    let output = output.context("rustc does not start")?.stdout;
    let libraries = PathBuf::from(String::from_utf8_lossy(&output).trim());
    let tool = libraries.with_file_name("bin").join("llvm-profdata");
    if !tool.exists() {
        bail!("profiles are merged by a tool of the toolchain's: `rustup component add llvm-tools`");
    }
    Ok(tool)
}
