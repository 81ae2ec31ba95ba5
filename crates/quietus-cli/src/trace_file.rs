//! `--trace`: what every thread did when, in the format of Chrome's tracing, which <https://ui.perfetto.dev> shows.
//!
//! A thread of its own writes the file. Others hand it lines that are ready, and go on: where it cannot keep up lines
//! are left out and counted, and where the disk is full the render does not notice until it is over. That, and the
//! stretches of time that are told when they are over ([`TIMELINE`]), is why this is not `tracing-chrome`, which
//! panics where it cannot write and knows only spans that are open.

use std::cell::Cell;
use std::fmt;
use std::io::Write;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::Instant;

use quietus_film::{OutputError, check_writable, write_atomically};
use quietus_render::TIMELINE;
use serde_json::{Map, Value, json};
use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id};
use tracing::{Event, Subscriber};
use tracing_subscriber::layer::{Context, Layer};
use tracing_subscriber::registry::LookupSpan;

use crate::error::{Ending, Failure};
use crate::say;

/// Lines that wait to be written; some megabytes at most.
const MOST_WAITING: usize = 1 << 16;

/// What the writing thread is sent.
enum Message {
    Line(String),
    End,
}

/// The file in the making.
pub(crate) struct TraceFile {
    sender: SyncSender<Message>,
    thread: JoinHandle<Result<(), OutputError>>,
}

/// What listens to spans and events.
pub(crate) struct TraceLayer {
    sender: SyncSender<Message>,
    start: Instant,
    left_out: AtomicU64,
}

/// Starts a trace that goes to `path`.
///
/// # Errors
/// When no file can be written there.
pub(crate) fn start(path: &Path) -> Result<(TraceFile, TraceLayer), Failure> {
    check_writable(path)?;
    let (sender, messages) = sync_channel(MOST_WAITING);
    let path = path.to_owned();
    let thread = std::thread::Builder::new()
        .name("trace".to_owned())
        .spawn(move || write_atomically(&path, |writer| write(writer, &path, &messages)))
        .map_err(|error| Failure::internal(format!("--trace: cannot start a thread: {error}")))?;
    let layer = TraceLayer { sender: sender.clone(), start: Instant::now(), left_out: AtomicU64::new(0) };
    Ok((TraceFile { sender, thread }, layer))
}

fn write(writer: &mut impl Write, path: &Path, messages: &Receiver<Message>) -> Result<(), OutputError> {
    let failed = |source| OutputError::Write { path: path.to_owned(), source };
    writer.write_all(b"[\n").map_err(failed)?;
    let mut separator = "";
    for message in messages {
        let Message::Line(line) = message else { break };
        write!(writer, "{separator}{line}").map_err(failed)?;
        separator = ",\n";
    }
    writer.write_all(b"\n]\n").map_err(failed)
}

impl TraceFile {
    /// Writes what is still to be written.
    ///
    /// # Errors
    /// When something could not be written, now or before; there is no file then.
    pub(crate) fn finish(self) -> Result<(), Failure> {
        // Fails where the thread has given up, which it says itself.
        let _ = self.sender.send(Message::End);
        match self.thread.join() {
            Ok(written) => Ok(written?),
            Err(_) => {
                Err(Failure { ending: Ending::Internal, message: "the trace's thread panicked".to_owned() })
            }
        }
    }
}

thread_local! {
    /// Number of this thread's track, 0 before it has one.
    static TRACK: Cell<u64> = const { Cell::new(0) };
}
/// Numbers given so far.
static TRACKS: AtomicU64 = AtomicU64::new(0);

impl TraceLayer {
    fn send(&self, slice: &Value) {
        if self.sender.try_send(Message::Line(slice.to_string())).is_err()
            && self.left_out.fetch_add(1, Ordering::Relaxed) == 0
        {
            say::warning(
                "the trace cannot be written as fast as it comes, or at all: parts of it are left out",
            );
        }
    }

    /// The track of this thread.
    fn track(&self) -> u64 {
        TRACK.with(|track| {
            if track.get() == 0 {
                track.set(TRACKS.fetch_add(1, Ordering::Relaxed) + 1);
                let thread = std::thread::current();
                let args = json!({ "name": thread.name().unwrap_or("unnamed") });
                self.send(&json!({
                    "ph": "M", "name": "thread_name", "pid": 1, "tid": track.get(), "args": args
                }));
            }
            track.get()
        })
    }

    /// A stretch that ended so many microseconds after the start of the trace.
    fn stretch(&self, name: &str, end: f64, microseconds: f64, args: Map<String, Value>) {
        // What began before the trace begins with it.
        let begin = (end - microseconds).max(0.0);
        self.send(&json!({
            "ph": "X", "name": name, "pid": 1, "tid": self.track(), "ts": begin, "dur": end - begin, "args": args
        }));
    }

    fn now(&self) -> f64 {
        self.start.elapsed().as_secs_f64() * 1e6
    }
}

/// Values of a span or event.
#[derive(Default)]
struct Fields {
    message: String,
    values: Map<String, Value>,
}

impl Fields {
    /// Takes a number of nanoseconds out, as microseconds.
    fn take(&mut self, name: &str) -> Option<f64> {
        Some(self.values.remove(name)?.as_u64()? as f64 * 1e-3)
    }
}

impl Visit for Fields {
    fn record_u64(&mut self, field: &Field, value: u64) {
        self.values.insert(field.name().to_owned(), value.into());
    }

    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        match field.name() {
            "message" => self.message = format!("{value:?}"),
            name => {
                self.values.insert(name.to_owned(), format!("{value:?}").into());
            }
        }
    }
}

/// When a span was entered, and its values.
struct Entered(f64, Map<String, Value>);

impl<S: Subscriber + for<'a> LookupSpan<'a>> Layer<S> for TraceLayer {
    fn on_new_span(&self, attributes: &Attributes<'_>, id: &Id, context: Context<'_, S>) {
        let mut fields = Fields::default();
        attributes.record(&mut fields);
        if let Some(span) = context.span(id) {
            span.extensions_mut().insert(Entered(0.0, fields.values));
        }
    }

    fn on_enter(&self, id: &Id, context: Context<'_, S>) {
        if let Some(span) = context.span(id)
            && let Some(entered) = span.extensions_mut().get_mut::<Entered>()
        {
            entered.0 = self.now();
        }
    }

    fn on_exit(&self, id: &Id, context: Context<'_, S>) {
        if let Some(span) = context.span(id)
            && let Some(Entered(begin, args)) = span.extensions_mut().get_mut::<Entered>()
        {
            let end = self.now();
            self.stretch(span.name(), end, end - *begin, args.clone());
        }
    }

    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let mut fields = Fields::default();
        event.record(&mut fields);
        if event.metadata().target() == TIMELINE {
            let nanoseconds = fields.take("nanoseconds").unwrap_or(0.0);
            let end = self.now() - fields.take("ago").unwrap_or(0.0);
            self.stretch(&fields.message, end, nanoseconds, fields.values);
        } else {
            self.send(&json!({
                "ph": "i", "s": "t", "name": fields.message, "pid": 1, "tid": self.track(), "ts": self.now(),
                "args": fields.values
            }));
        }
    }
}
