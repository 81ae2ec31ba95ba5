//! What watches a render: flags of `quietus render` that change nothing about the picture.

mod courier;
mod saver;
mod tev;

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use quietus_film::{Film, Metadata, OutputFormat};
use quietus_render::Watched;

use self::courier::Courier;
use self::saver::Saver;
use self::tev::Tev;
use crate::args::values::parse_time;
use crate::progress::{Measure, ProgressArg, Reporter};
use crate::say;

/// Flags on watching.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Watching")]
pub(crate) struct WatchingArgs {
    /// How progress is shown.
    #[arg(long, value_enum, default_value_t, value_name = "HOW")]
    pub progress: ProgressArg,

    /// Also write the picture so far that often, such as every 30s or 5m: any viewer can watch the file.
    #[arg(long, value_name = "DURATION", value_parser = parse_time)]
    pub save_every: Option<Duration>,

    /// Show the picture so far in the viewer tev, which listens there; its port is 14158 unless you say otherwise.
    #[arg(long, value_name = "HOST[:PORT]", value_parser = tev::parse_address)]
    pub tev: Option<String>,

    /// Write here what every thread did when: https://ui.perfetto.dev and chrome://tracing show it.
    #[arg(long, value_name = "FILE.json")]
    pub trace: Option<PathBuf>,
}

/// After the first picture, tev gets one that often.
const TEV_INTERVAL: Duration = Duration::from_secs(1);
/// There is something to see.
const TEV_FIRST: Duration = Duration::from_millis(200);

/// What one render is watched by.
pub(crate) struct Onlookers {
    reporter: Reporter,
    saver: Option<Courier>,
    tev: Option<Courier>,
    has_warned: bool,
}

/// The render that is watched.
pub(crate) struct Subject {
    /// What it is called.
    pub name: String,
    /// What its progress is the share of.
    pub measure: Measure,
    /// Files that the picture goes to.
    pub outputs: Vec<(PathBuf, OutputFormat)>,
    /// Its settings.
    pub metadata: Metadata,
}

impl Onlookers {
    /// Everybody that `args` ask for.
    pub(crate) fn new(args: &WatchingArgs, subject: Subject) -> Self {
        let Subject { name, measure, outputs, metadata } = subject;
        // First of all: from here on, words go through it.
        let reporter = Reporter::new(args.progress, measure);
        let saver = args.save_every.and_then(|interval| {
            Courier::start(Saver { outputs, metadata, trouble: None }, interval, interval)
        });
        let tev = args.tev.clone();
        let tev = tev.and_then(|address| Courier::start(Tev::new(address, name), TEV_FIRST, TEV_INTERVAL));
        Self { reporter, saver, tev, has_warned: false }
    }

    /// Lets them look.
    pub(crate) fn look(&mut self, watched: &Watched<'_>) {
        self.reporter.update(watched);
        if let Some(noise) = watched.progress.noise
            && let Some(expected) = noise.expected
            && !std::mem::replace(&mut self.has_warned, true)
        {
            say::aside(format_args!(
                "--max-samples keeps the noise from {} %: about {:.2} % will be reached",
                100.0 * noise.asked,
                100.0 * expected
            ));
        }
        [&mut self.saver, &mut self.tev].into_iter().flatten().for_each(|courier| courier.offer(watched));
    }

    /// Shows the finished picture, where there is one, and lets them go. Whoever drew it writes it to its files.
    pub(crate) fn leave(self, film: Option<&Film>) {
        let Self { reporter, saver, tev, .. } = self;
        saver.into_iter().for_each(|saver| saver.finish(None));
        tev.into_iter().for_each(|tev| tev.finish(film));
        drop(reporter);
    }
}
