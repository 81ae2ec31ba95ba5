//! What a render shows of itself while it runs: a bar, lines of text, or JSON.
//!
//! A thread of its own shows it. Whoever reports progress or has something to say leaves it in an [`Inbox`] and
//! goes on, so that a terminal that is stopped, or a reader that sleeps, holds up nothing.

mod bar;
mod block;
mod json;
mod lines;
mod words;

use std::io::IsTerminal;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use clap::ValueEnum;
use quietus::AdaptiveSampling;
use quietus_render::noise::Noise;
use quietus_render::{NoiseProgress, Progress, Watched};

use crate::say::{self, Kind};

/// `--progress`.
#[derive(ValueEnum, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum ProgressArg {
    /// A bar where stderr is a terminal, else plain lines.
    #[default]
    Auto,
    /// A bar on stderr.
    Bar,
    /// Lines of text on stderr, at growing intervals.
    Plain,
    /// One JSON object per line on stdout, in place of the closing words (see docs/terminal.md).
    Json,
    /// Nothing.
    None,
}

/// How often the display looks into its inbox.
const INTERVAL: Duration = Duration::from_millis(100);
/// Finding the largest count of samples takes a look at every pixel: that long is waited for each look's time.
const REST_AFTER_LOOK: u32 = 100;
/// Most words that wait for a display that does not show them; what comes later is counted and not kept.
const MOST_WAITING: usize = 1000;

/// What the share of the work done is a share of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Measure {
    /// Pixels that are done.
    Converged,
    /// The samples that the noise asked for will take.
    Noise,
    /// So many samples.
    Samples(f64),
    /// So much time.
    Time(Duration),
}

impl Measure {
    /// The share that is done, 0..=1, and what it is called; `None` while nobody knows.
    fn share(self, snapshot: &Snapshot) -> Option<(f64, &'static str)> {
        let progress = &snapshot.progress;
        let (share, name) = match self {
            Self::Converged => (progress.converged_fraction, "converged"),
            Self::Noise => (snapshot.noise_share()?, "of the way"),
            Self::Samples(all) => (progress.samples as f64 / all, "drawn"),
            Self::Time(all) => (progress.elapsed.as_secs_f64() / all.as_secs_f64(), "of the time"),
        };
        Some((share.clamp(0.0, 1.0), name))
    }
}

/// A look at a running render, as it is shown.
#[derive(Clone, Copy, Debug)]
struct Snapshot {
    progress: Progress,
    spp_max: u32,
    /// Samples there were when the noise was measured last.
    measured_at: u64,
}

impl Snapshot {
    /// Share of the samples that the noise asked for will take: those that are foreseen or, where none are, as many as if the
    /// squared error fell as 1/n from where it was measured last.
    fn noise_share(&self) -> Option<f64> {
        let Progress { noise, samples, foreseen_samples, .. } = self.progress;
        let NoiseProgress { asked, measured, .. } = noise?;
        if let Some(foreseen) = foreseen_samples {
            return Some(samples as f64 / foreseen.max(1.0));
        }
        let squared = (asked / measured?.reached).powi(2);
        Some(squared * samples as f64 / self.measured_at.max(1) as f64)
    }
}

/// A way to show progress.
trait Show: Send {
    /// Shows how far it is. Called ten times a second with what is newest.
    fn progress(&mut self, snapshot: &Snapshot);
    /// Shows words.
    fn words(&mut self, kind: Kind, text: &str);
    /// Nothing comes any more.
    fn close(&mut self);
}

/// What waits to be shown.
#[derive(Default)]
struct Inbox {
    state: Mutex<Waiting>,
    bell: Condvar,
}

#[derive(Default)]
struct Waiting {
    newest: Option<Snapshot>,
    words: Vec<(Kind, String)>,
    dropped: usize,
    is_over: bool,
}

impl Inbox {
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        // Every change is a single step.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for words, the end, or the interval; returns what there is.
    fn receive(&self) -> Waiting {
        let idle = |waiting: &mut Waiting| waiting.words.is_empty() && !waiting.is_over;
        let waited = self.bell.wait_timeout_while(self.lock(), INTERVAL, idle);
        let (mut waiting, _) = waited.unwrap_or_else(PoisonError::into_inner);
        std::mem::take(&mut *waiting)
    }

    fn serve(&self, show: &mut dyn Show) {
        loop {
            let Waiting { newest, words, dropped, is_over } = self.receive();
            words.iter().for_each(|(kind, text)| show.words(*kind, text));
            if dropped > 0 {
                show.words(Kind::Warning, &format!("{dropped} further messages are left out"));
            }
            if let Some(snapshot) = newest {
                show.progress(&snapshot);
            }
            if is_over {
                return show.close();
            }
        }
    }
}

impl say::Screen for Inbox {
    fn take(&self, kind: Kind, text: String) {
        let mut waiting = self.lock();
        if waiting.words.len() < MOST_WAITING {
            waiting.words.push((kind, text));
        } else {
            waiting.dropped += 1;
        }
        drop(waiting);
        self.bell.notify_one();
    }
}

/// Shows progress until it is dropped.
pub(crate) struct Reporter {
    display: Option<Display>,
    spp_max: u32,
    next_look: Option<Instant>,
    /// The noise measured last, and the samples there were.
    measured: (Option<Noise>, u64),
}

struct Display {
    inbox: Arc<Inbox>,
    thread: JoinHandle<()>,
    through: say::Through,
}

impl Reporter {
    /// Starts to show what `asked` asks for.
    pub(crate) fn new(asked: ProgressArg, measure: Measure) -> Self {
        let show: Option<Box<dyn Show>> = match choose(asked) {
            ProgressArg::Json => Some(Box::new(json::Json::new(measure))),
            _ if say::is_quiet() => None,
            ProgressArg::None => None,
            ProgressArg::Bar => Some(Box::new(bar::Bar::new(measure))),
            ProgressArg::Plain | ProgressArg::Auto => Some(Box::new(lines::Lines::new(measure))),
        };
        Self { display: show.and_then(Display::start), spp_max: 0, next_look: None, measured: (None, 0) }
    }

    /// Takes in how far the render is.
    pub(crate) fn update(&mut self, watched: &Watched<'_>) {
        let Some(display) = &self.display else { return };
        let now = Instant::now();
        if self.next_look.is_none_or(|next| next <= now) {
            self.spp_max = most_samples(watched.sampling);
            self.next_look = Some(now + REST_AFTER_LOOK * now.elapsed());
        }
        // The mean is newer.
        let spp_max = self.spp_max.max(watched.progress.spp_mean.ceil() as u32);
        let progress = watched.progress;
        let noise = progress.noise.and_then(|noise| noise.measured);
        if noise != self.measured.0 {
            self.measured = (noise, progress.samples);
        }
        display.inbox.lock().newest = Some(Snapshot { progress, spp_max, measured_at: self.measured.1 });
    }
}

impl Drop for Reporter {
    fn drop(&mut self) {
        let Some(Display { inbox, thread, through }) = self.display.take() else { return };
        // What is said from here on goes to stderr itself.
        drop(through);
        inbox.lock().is_over = true;
        inbox.bell.notify_one();
        // A panic there was reported by its hook.
        let _ = thread.join();
    }
}

impl Display {
    /// `None` where no thread can be started: the render does without.
    fn start(mut show: Box<dyn Show>) -> Option<Self> {
        let inbox = Arc::new(Inbox::default());
        let served = Arc::clone(&inbox);
        let builder = std::thread::Builder::new().name("progress".to_owned());
        match builder.spawn(move || served.serve(&mut *show)) {
            Ok(thread) => {
                let through = say::through(Arc::clone(&inbox) as Arc<dyn say::Screen>);
                Some(Self { inbox, thread, through })
            }
            Err(error) => {
                say::warning(format_args!("no progress is shown: cannot start a thread: {error}"));
                None
            }
        }
    }
}

fn choose(asked: ProgressArg) -> ProgressArg {
    let is_dumb = std::env::var_os("TERM").is_some_and(|term| term == "dumb");
    match asked {
        ProgressArg::Auto if std::io::stderr().is_terminal() && !is_dumb => ProgressArg::Bar,
        ProgressArg::Auto => ProgressArg::Plain,
        other => other,
    }
}

/// The largest number of samples that a pixel has.
fn most_samples(sampling: &AdaptiveSampling) -> u32 {
    let (counts, tiles) = (sampling.counts(), sampling.grid().tiles());
    let pixels = (0..tiles).flat_map(|tile| (0..quietus::TILE_PIXELS as u8).map(move |pixel| (tile, pixel)));
    pixels.map(|(tile, pixel)| counts.pixel(tile, pixel)).max().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::say::Screen;

    /// Writes down what it is to show.
    struct Recorder(Arc<Mutex<Vec<String>>>);

    impl Show for Recorder {
        fn progress(&mut self, snapshot: &Snapshot) {
            self.0.lock().unwrap().push(format!("{} samples", snapshot.progress.samples));
        }
        fn words(&mut self, _: Kind, text: &str) {
            self.0.lock().unwrap().push(text.to_owned());
        }
        fn close(&mut self) {
            self.0.lock().unwrap().push("closed".to_owned());
        }
    }

    #[test]
    fn words_come_in_order_and_before_the_end() {
        let shown = Arc::new(Mutex::new(Vec::new()));
        let inbox = Inbox::default();
        inbox.take(Kind::Warning, "one".to_owned());
        inbox.take(Kind::Note, "two".to_owned());
        inbox.lock().newest =
            Some(Snapshot { progress: words::tests::progress(), spp_max: 3, measured_at: 0 });
        inbox.lock().is_over = true;
        inbox.serve(&mut Recorder(Arc::clone(&shown)));
        assert_eq!(*shown.lock().unwrap(), ["one", "two", "10 samples", "closed"]);
    }

    #[test]
    fn a_flood_of_words_is_bounded() {
        let shown = Arc::new(Mutex::new(Vec::new()));
        let inbox = Inbox::default();
        (0..MOST_WAITING + 5).for_each(|i| inbox.take(Kind::Note, i.to_string()));
        inbox.lock().is_over = true;
        inbox.serve(&mut Recorder(Arc::clone(&shown)));
        let shown = shown.lock().unwrap();
        assert_eq!(shown.len(), MOST_WAITING + 2);
        assert_eq!(shown[MOST_WAITING], "5 further messages are left out");
    }
}
