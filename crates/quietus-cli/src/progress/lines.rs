//! Progress as plain lines, for logs and pipes.

use std::time::Duration;

use super::words::{share, status};
use super::{Measure, Show, Snapshot};
use crate::say::{self, Kind};

/// The first line; shorter renders need none.
const FIRST: Duration = Duration::from_secs(5);
/// The longest silence.
const LONGEST: Duration = Duration::from_secs(60);

/// A line now and then, at intervals that double.
pub(super) struct Lines {
    measure: Measure,
    /// When the next line is due, and how long after it the one that follows.
    next: Duration,
    interval: Duration,
}

impl Lines {
    pub(super) fn new(measure: Measure) -> Self {
        Self { measure, next: FIRST, interval: FIRST }
    }

    /// The line, where one is due.
    fn line(&mut self, snapshot: &Snapshot) -> Option<String> {
        let elapsed = snapshot.progress.elapsed;
        if elapsed < self.next {
            return None;
        }
        self.next = elapsed + self.interval;
        self.interval = (2 * self.interval).min(LONGEST);
        Some(format!("{}, {}", share(self.measure, snapshot), status(snapshot)))
    }
}

impl Show for Lines {
    fn progress(&mut self, snapshot: &Snapshot) {
        if let Some(line) = self.line(snapshot) {
            say::directly(Kind::Log, &line);
        }
    }

    fn words(&mut self, kind: Kind, text: &str) {
        say::directly(kind, text);
    }

    fn close(&mut self) {}
}

#[cfg(test)]
mod tests {
    use quietus_render::Progress;

    use super::*;
    use crate::progress::words::tests::progress;

    #[test]
    fn intervals_double_up_to_a_minute() {
        let mut lines = Lines::new(Measure::Converged);
        let at = |second| Progress { elapsed: Duration::from_secs(second), ..progress() };
        let due = |second: &u64| {
            lines.line(&Snapshot { progress: at(*second), spp_max: 1, measured_at: 0 }).is_some()
        };
        let said: Vec<u64> = (0..300).filter(due).collect();
        assert_eq!(said, [5, 10, 20, 40, 80, 140, 200, 260]);
    }
}
