//! `-v` and `--trace`: who listens to `tracing`.

use std::io::{self, Write};

use quietus_render::TIMELINE;
use tracing::Level;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::fmt::MakeWriter;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{Layer, fmt};

use crate::say;
use crate::trace_file::TraceLayer;

/// Starts to log what `-v`, given so many times, asks for, and to trace, where that is asked for.
pub(crate) fn start(verbosity: u8, trace: Option<TraceLayer>) {
    let level = match verbosity {
        0 => None,
        1 => Some(Level::INFO),
        _ => Some(Level::DEBUG),
    };
    // Targets are module paths: everything of ours starts so.
    let ours = |level| Targets::new().with_target("quietus", level);
    let lines = level.map(|level| {
        let lines = fmt::layer().with_writer(Lines).with_ansi(false).with_target(verbosity > 1);
        lines.with_timer(fmt::time::uptime()).with_filter(ours(level))
    });
    let trace = trace.map(|trace| trace.with_filter(ours(Level::DEBUG).with_target(TIMELINE, Level::TRACE)));
    if lines.is_some() || trace.is_some() {
        // Fails only where there is a log already.
        let _ = tracing_subscriber::registry().with(lines).with(trace).try_init();
    }
}

/// Hands each message to [`say`] as a line.
struct Lines;

/// A message in the making.
#[derive(Default)]
struct Line(Vec<u8>);

impl<'a> MakeWriter<'a> for Lines {
    type Writer = Line;

    fn make_writer(&'a self) -> Line {
        Line::default()
    }
}

impl Write for Line {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        say::log(String::from_utf8_lossy(&self.0).trim_end());
    }
}
