//! What each thread does when, as events of `tracing`.
//!
//! An event with the target [`TIMELINE`] is a stretch of time on the thread it comes from: it took `nanoseconds` and
//! ended `ago` nanoseconds before the event. Its message is what was done. A stretch is told when it is over, so that
//! thousands of visits make one event per pass, and only waits that are worth a look make one at all. Where nobody
//! listens, a render pays a test of a pointer per visit.

use std::time::{Duration, Instant};

use quietus::RebuildRecord;
use tracing::Level;

/// Target of the events.
pub const TIMELINE: &str = "quietus::timeline";

/// Shorter waits are part of the work.
const LEAST_WAIT: Duration = Duration::from_micros(20);

/// Whether somebody listens.
pub(crate) fn is_wanted() -> bool {
    tracing::enabled!(target: TIMELINE, Level::TRACE)
}

/// One thread's passes and waits.
pub(crate) struct Timeline {
    /// Time slept before the visit that comes next.
    slept: Duration,
    pass: Option<Pass>,
}

/// Visits of one pass, as far as this thread has come.
struct Pass {
    number: u64,
    start: Instant,
    end: Instant,
    visits: u64,
    samples: u64,
}

impl Timeline {
    /// `None` where nobody listens.
    pub(crate) fn new() -> Option<Self> {
        is_wanted().then_some(Self { slept: Duration::ZERO, pass: None })
    }

    /// A visit was dealt just now. The thread has slept for so long in all its life.
    pub(crate) fn begin(&mut self, pass: u64, slept: Duration) {
        let waited = slept.saturating_sub(self.slept);
        self.slept = slept;
        if waited >= LEAST_WAIT {
            let nanoseconds = nanoseconds(waited);
            tracing::event!(target: TIMELINE, Level::TRACE, nanoseconds, "wait");
        }
        if self.pass.as_ref().is_none_or(|current| current.number != pass) {
            self.end_pass();
            let now = Instant::now();
            self.pass = Some(Pass { number: pass, start: now, end: now, visits: 0, samples: 0 });
        }
    }

    /// The visit is finished.
    pub(crate) fn finish(&mut self, samples: u64) {
        if let Some(pass) = &mut self.pass {
            pass.end = Instant::now();
            pass.visits += 1;
            pass.samples += samples;
        }
    }

    fn end_pass(&mut self) {
        if let Some(Pass { number, start, end, visits, samples }) = self.pass.take() {
            let (nanoseconds, ago) = (nanoseconds(end - start), nanoseconds(end.elapsed()));
            tracing::event!(target: TIMELINE, Level::TRACE, nanoseconds, ago, visits, samples, "pass {number}");
        }
    }
}

impl Drop for Timeline {
    fn drop(&mut self) {
        self.end_pass();
    }
}

/// A tree was rebuilt by this thread just now.
pub(crate) fn rebuilt(record: &RebuildRecord) {
    let &RebuildRecord { region, generation, nanoseconds, nodes, active_pixels, .. } = record;
    tracing::event!(
        target: TIMELINE, Level::TRACE, nanoseconds, region, generation, nodes, active_pixels, "rebuild"
    );
}

fn nanoseconds(time: Duration) -> u64 {
    // 584 years.
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}
