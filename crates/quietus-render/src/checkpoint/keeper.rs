//! Saves the state of a running render from time to time, beside the threads that draw.

use std::path::PathBuf;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use quietus_film::OutputError;

use super::file::{self, Header, Kind};
use super::{Identity, RenderState};

/// Writes checkpoints to a file, one at a time, on a thread of its own: the render waits only while its state is copied.
pub struct Keeper {
    path: PathBuf,
    every: Duration,
    header: Header,
    /// Since when nothing was saved.
    since: Instant,
    writer: Option<JoinHandle<Result<(), OutputError>>>,
    warn: Box<dyn Fn(&OutputError)>,
    cost: CheckpointCost,
}

/// What checkpoints have cost.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CheckpointCost {
    /// How many were begun.
    pub count: u32,
    /// How long threads were kept from drawing, at most: until each was between visits, and the state copied.
    pub paused: Duration,
}

impl Keeper {
    /// Saves to `path` as often as `every`, as the state of what `identity` says. `warn` is told where that fails: the
    /// render goes on, and what was saved before stays.
    pub fn new(
        path: PathBuf,
        every: Duration,
        identity: Identity,
        warn: impl Fn(&OutputError) + 'static,
    ) -> Self {
        Self {
            path,
            every,
            header: Header::new(identity),
            since: Instant::now(),
            writer: None,
            warn: Box::new(warn),
            cost: CheckpointCost::default(),
        }
    }

    /// What it has cost so far.
    pub fn cost(&self) -> CheckpointCost {
        self.cost
    }

    /// Whether it is time to save. Not while the last state is still being written.
    pub(crate) fn is_due(&self) -> bool {
        let is_writing = self.writer.as_ref().is_some_and(|writer| !writer.is_finished());
        self.since.elapsed() >= self.every && !is_writing
    }

    /// Writes the state that `copy` gives, which keeps threads from drawing meanwhile.
    pub(crate) fn save(&mut self, copy: impl FnOnce() -> Option<RenderState>) {
        self.wait();
        self.since = Instant::now();
        let Some(state) = copy() else { return };
        self.cost.count += 1;
        self.cost.paused += self.since.elapsed();
        let (path, header) = (self.path.clone(), self.header.clone());
        let write = move || file::write(&path, Kind::Checkpoint, &header, &state);
        match std::thread::Builder::new().name("checkpoint".to_owned()).spawn(write) {
            Ok(writer) => self.writer = Some(writer),
            Err(source) => (self.warn)(&OutputError::Write { path: self.path.clone(), source }),
        }
    }

    /// Waits until what was saved last is on the disk.
    pub(crate) fn wait(&mut self) {
        match self.writer.take().map(JoinHandle::join) {
            Some(Ok(Err(error))) => (self.warn)(&error),
            Some(Err(panic)) => std::panic::resume_unwind(panic),
            Some(Ok(Ok(()))) | None => {}
        }
    }
}
