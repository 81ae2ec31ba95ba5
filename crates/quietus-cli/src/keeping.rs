//! Going on from a render that was interrupted, and drawing again one that depended on time: whether a file may be gone
//! on from, and what differs where it may not.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use quietus_film::{Layout, Metadata, OutputError};
use quietus_render::checkpoint::{Checkpoint, FileMark, Header, Identity, Keeper, PROGRAM, RenderState};
use quietus_render::{Keeping, Recording, RecordingFile, Sampling};

use crate::args::values::parse_time;
use crate::error::Failure;
use crate::plan::Plan;
use crate::say;

/// Flags about what is kept of a render.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Going on")]
pub(crate) struct KeepingArgs {
    /// Save the state of the render here every few minutes, when it is interrupted, and when it is finished: --resume goes
    /// on from it (see docs/checkpoint.md).
    #[arg(long, value_name = "FILE")]
    pub checkpoint: Option<PathBuf>,

    /// How often. [default: 5m]
    #[arg(long, value_name = "DURATION", requires = "checkpoint", value_parser = parse_time)]
    pub checkpoint_every: Option<Duration>,

    /// Go on from the file of --checkpoint, where there is one; the noise asked for may be lower. The picture will have the
    /// same bits as if nothing had happened, with any number of threads.
    #[arg(long, requires = "checkpoint")]
    pub resume: bool,

    /// Record here what it takes to draw the very same picture again, also where time decides.
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,

    /// Draw again, bit for bit, what was drawn when this was recorded.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["checkpoint", "time", "noise", "target_error"])]
    pub replay: Option<PathBuf>,
}

/// How often a state is saved where nobody says.
const EVERY: Duration = Duration::from_secs(300);

/// Settings without a say in the picture, or no other than the content of files.
const FREE: [&str; 9] = [
    "version",
    "scene",
    "environment",
    "weight",
    "from_scene",
    "threads",
    "checks",
    "rebuild",
    "time_limit_seconds",
];

/// Settings that a render may go on to in one direction.
const ONE_WAY: [(&str, Direction); 3] =
    [("noise", Direction::Down), ("target_error", Direction::Down), ("max_samples", Direction::Up)];

/// What a recording holds itself, so that who draws again need not know it.
const RECORDED: &[&str] = &["aov_noise"];

#[derive(Clone, Copy, PartialEq)]
enum Direction {
    Up,
    Down,
}

impl KeepingArgs {
    /// Checks before anything is loaded that nothing saved is about to be overwritten, and that it can be drawn again.
    ///
    /// # Errors
    /// Where there is a checkpoint and nobody asks to go on from it, or the timing of threads would be lost.
    pub(crate) fn check(&self, plan: &Plan) -> Result<(), Failure> {
        if (self.record.is_some() || self.replay.is_some()) && plan.sampling == Sampling::FreeRunning {
            return Err(Failure::usage(
                "--record and --replay need a picture that does not depend on the timing of threads, as that of \
                 --sampling free-running does",
            ));
        }
        let Some(path) = self.checkpoint.as_deref().filter(|_| !self.resume) else { return Ok(()) };
        let paths: Vec<PathBuf> = match &plan.timeline {
            Some(timeline) => timeline.frames().map(|frame| plan.name(path, Some(frame))).collect(),
            None => vec![path.to_owned()],
        };
        match paths.iter().find(|path| path.exists()) {
            None => Ok(()),
            Some(path) => Err(Failure::usage(format!(
                "{}: exists; --resume goes on from it, and to start anew it has to be removed",
                path.display()
            ))),
        }
    }

    /// What to go on from, if this is the first picture of the kind, and where to keep the state of a picture of `layout`
    /// with these settings; `named` gives files their numbers.
    ///
    /// # Errors
    /// Where a file is damaged, or of another picture.
    pub(crate) fn keeping(
        &self,
        named: impl Fn(&PathBuf) -> PathBuf,
        settings: Metadata,
        layout: &Layout,
        is_first: bool,
    ) -> Result<Keeping, Failure> {
        let mut keeping = Keeping::default();
        if let Some(path) = self.replay.as_ref().filter(|_| is_first).map(&named) {
            keeping.replay = Some(recording(&path, &identity(settings), layout)?);
        } else if let Some(path) = self.checkpoint.as_ref().map(&named) {
            let identity = identity(settings);
            if self.resume && is_first && path.exists() {
                keeping.from = Some(state(&path, &identity, layout)?);
            } else if self.resume && is_first {
                say::aside(format_args!(
                    "{}: no checkpoint yet, starting from the beginning",
                    path.display()
                ));
            }
            let warn = |error: &OutputError| {
                say::warning(format!("{error}; the render goes on, and what was saved before stays"));
            };
            let every = self.checkpoint_every.unwrap_or(EVERY);
            keeping.keeper = Some(Keeper::new(path, every, identity, warn));
        }
        Ok(keeping)
    }

    /// Writes the recording that was asked for.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub(crate) fn write_recording(
        &self,
        named: impl Fn(&PathBuf) -> PathBuf,
        settings: Metadata,
        recording: &Recording,
    ) -> Result<(), Failure> {
        match self.record.as_ref().map(named) {
            Some(path) => Ok(recording.write(&path, identity(settings))?),
            None => Ok(()),
        }
    }
}

/// The state to go on from.
fn state(path: &Path, now: &Identity, layout: &Layout) -> Result<RenderState, Failure> {
    let broken = |error| Failure::input(format!("{}: {error}", path.display()));
    let checkpoint = Checkpoint::open(path).map_err(broken)?;
    let then = &checkpoint.header().identity;
    let one_way = ONE_WAY
        .into_iter()
        .filter_map(|(name, direction)| forbidden(name, direction, then.setting(name), now.setting(name)));
    check_same(path, checkpoint.header(), now, &[], one_way)?;
    checkpoint.state(layout).map_err(broken)
}

/// The rounds to draw again.
fn recording(path: &Path, now: &Identity, layout: &Layout) -> Result<Recording, Failure> {
    let broken = |error| Failure::input(format!("{}: {error}", path.display()));
    let file = RecordingFile::open(path).map_err(broken)?;
    check_same(path, file.header(), now, RECORDED, None)?;
    file.recording(layout).map_err(broken)
}

/// Refuses a file of another picture than `now`, the settings in `free` aside, or with `more` that speaks against it; warns of
/// one of another machine.
fn check_same(
    path: &Path,
    then: &Header,
    now: &Identity,
    free: &[&str],
    more: impl IntoIterator<Item = String>,
) -> Result<(), Failure> {
    let mut differences = differences(&then.program, &then.identity, now, free);
    differences.extend(more);
    if !differences.is_empty() {
        let differences = differences.join("\n  ");
        return Err(Failure::input(format!("{}: is of another picture:\n  {differences}", path.display())));
    }
    if !then.is_of_this_machine() {
        say::warning(format!(
            "{}: was drawn on another kind of machine: last digits may differ from what that one would have drawn",
            path.display()
        ));
    }
    Ok(())
}

fn identity(settings: Metadata) -> Identity {
    let mut files: Vec<FileMark> = quietus_scene::files_read()
        .into_iter()
        .map(|file| FileMark {
            name: file.path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            bytes: file.bytes,
            hash: format!("{:032x}", file.hash),
        })
        .collect();
    files.sort();
    files.dedup();
    Identity { settings, files }
}

/// What differs of the program, the scene and the settings that have to be the same, which those in `free` need not.
fn differences(program: &str, then: &Identity, now: &Identity, free: &[&str]) -> Vec<String> {
    let is_free = |name: &str| FREE.contains(&name) || free.contains(&name);
    let may_differ = |name: &str| is_free(name) || ONE_WAY.iter().any(|(other, _)| *other == name);
    let other_program =
        (program != PROGRAM).then(|| format!("it was drawn by version {program}, this is {PROGRAM}"));
    other_program.into_iter().chain(then.differences(now, may_differ)).collect()
}

/// What is wrong with a change from `then` to `now`. Without a maximum of samples it is infinite.
fn forbidden(name: &str, direction: Direction, then: Option<&str>, now: Option<&str>) -> Option<String> {
    let number = |text: Option<&str>| match (text, direction) {
        (Some(text), _) => text.parse().ok(),
        (None, Direction::Up) => Some(f64::INFINITY),
        (None, Direction::Down) => None,
    };
    let allowed = match (number(then), number(now)) {
        (Some(then), Some(now)) if direction == Direction::Down => now <= then,
        (Some(then), Some(now)) => now >= then,
        _ => then == now,
    };
    let [then, now] = [then, now].map(|value| value.unwrap_or("not set"));
    let side = if direction == Direction::Down { "less" } else { "more" };
    (!allowed).then(|| format!("{name} was {then}, is {now}: a render goes on to the same or {side}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn goals_may_be_set_higher_but_not_lower() {
        let forbids = |name: &str, then, now| {
            let (_, direction) = ONE_WAY.into_iter().find(|(other, _)| *other == name).unwrap();
            forbidden(name, direction, then, now).is_some()
        };
        assert!(!forbids("noise", Some("1.0"), Some("0.5")) && !forbids("noise", Some("1"), Some("1")));
        assert!(forbids("noise", Some("1"), Some("1.5")) && forbids("noise", Some("1"), None));
        assert!(forbids("target_error", None, Some("0.1")) && !forbids("target_error", None, None));
        assert!(
            !forbids("max_samples", Some("64"), Some("128")) && !forbids("max_samples", Some("64"), None)
        );
        assert!(forbids("max_samples", None, Some("64")) && forbids("max_samples", Some("64"), Some("8")));
    }
}
