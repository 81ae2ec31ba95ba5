//! Running other programs: cargo, and the quietus program itself.

use std::{
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, Result, bail};
use serde_json::Value;

/// The root of the repository.
pub(crate) fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

/// The folder of larger scenes, beside the repository; an error that says so where it is absent.
pub(crate) fn shared_scenes() -> Result<PathBuf> {
    let path = root().join("../shared/scenes");
    path.canonicalize()
        .with_context(|| format!("the scenes beside the repository are absent: {}", path.display()))
}

/// Where cargo puts what it builds.
pub(crate) fn target() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from)
}

/// The triple of this machine.
pub(crate) fn host() -> Result<String> {
    let output = Command::new("rustc").arg("-vV").output().context("rustc does not start")?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let host = text.lines().find_map(|line| line.strip_prefix("host: "));
    Ok(host.context("rustc does not tell its host")?.to_owned())
}

/// A cargo command in the repository.
pub(crate) fn cargo() -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root());
    command
}

/// Runs to success, or fails with the command's words.
pub(crate) fn run(command: &mut Command) -> Result<()> {
    let words = words(command);
    eprintln!("$ {words}");
    let status = command.status().with_context(|| format!("cannot start {words}"))?;
    if !status.success() {
        bail!("failed ({status}): {words}");
    }
    Ok(())
}

fn words(command: &Command) -> String {
    let environment = command
        .get_envs()
        .filter_map(|(k, v)| Some(format!("{}={:?} ", k.to_string_lossy(), v?.to_string_lossy())));
    let arguments = command.get_args().map(|a| format!(" {}", a.to_string_lossy()));
    let program = Path::new(command.get_program()).file_name().unwrap_or_default().to_string_lossy();
    environment.chain([program.into_owned()]).chain(arguments).collect()
}

/// The release build of the program.
pub(crate) struct Quietus {
    program: PathBuf,
    /// A folder for pictures and statistics that nobody keeps.
    pub(crate) scratch: tempfile::TempDir,
}

impl Quietus {
    /// Builds it.
    pub(crate) fn build() -> Result<Self> {
        run(cargo().args(["build", "--release", "--package", "quietus-cli"]))?;
        let program = target().join("release/quietus").canonicalize().context("the program was not built")?;
        Ok(Self { program, scratch: tempfile::tempdir()? })
    }

    /// Renders with the words given and returns the statistics. Where no `-o` is given, the picture is an EXR
    /// at [`Self::picture`].
    pub(crate) fn render(&self, words: &[&str]) -> Result<Value> {
        let stats = self.scratch.path().join("stats.json");
        let mut command = Command::new(&self.program);
        command.arg("render").args(words).arg("--stats").arg(&stats).current_dir(root());
        if !words.contains(&"-o") {
            command.arg("-o").arg(self.picture());
        }
        run(&mut command)?;
        let text = std::fs::read_to_string(&stats)?;
        serde_json::from_str(&text).context("the statistics are no JSON")
    }

    /// As [`Self::render`], and returns what the program said beside its results.
    pub(crate) fn render_and_listen(&self, words: &[&str]) -> Result<(Value, String)> {
        let stats = self.scratch.path().join("stats.json");
        let mut command = Command::new(&self.program);
        command.arg("render").args(words).arg("--stats").arg(&stats).current_dir(root());
        eprintln!("$ {}", self::words(&command));
        let output = command.output().context("the program does not start")?;
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        if !output.status.success() {
            let error = said.lines().find_map(|line| line.strip_prefix("error: "));
            bail!("{} ({})", error.unwrap_or("no message"), output.status);
        }
        let text = std::fs::read_to_string(&stats)?;
        Ok((serde_json::from_str(&text).context("the statistics are no JSON")?, said))
    }

    /// The program.
    pub(crate) fn program(&self) -> &Path {
        &self.program
    }

    /// Where a render without `-o` puts its picture.
    pub(crate) fn picture(&self) -> PathBuf {
        self.scratch.path().join("picture.exr")
    }
}

/// A number out of the statistics.
pub(crate) fn number(stats: &Value, key: &str) -> Result<f64> {
    stats[key].as_f64().with_context(|| format!("no number `{key}` in the statistics"))
}

/// The median of some figures.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    0.5 * (values[(n - 1) / 2] + values[n / 2])
}
