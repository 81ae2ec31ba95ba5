//! Progress as a bar on the terminal, with what went wrong below it.

use console::{Term, style};

use super::block::Block;
use super::words::{share, status};
use super::{Measure, Show, Snapshot};
use crate::say::{self, Kind};

/// Columns of the bar itself, at most.
const WIDEST: usize = 60;
/// Below this many columns there is no room for a bar beside its words.
const NARROWEST: usize = 10;
/// Most notes and warnings that stand below the bar at once, the newest.
const MOST_NOTES: usize = 4;

/// A bar, a line of figures, and the newest notes and warnings.
pub(super) struct Bar {
    term: Term,
    block: Block,
    measure: Measure,
    newest: Option<Snapshot>,
    notes: Vec<String>,
}

impl Bar {
    pub(super) fn new(measure: Measure) -> Self {
        Self { term: Term::stderr(), block: Block::default(), measure, newest: None, notes: Vec::new() }
    }

    fn draw(&mut self) {
        let [rows, columns] = size(&self.term);
        let lines = lines(self.measure, self.newest.as_ref(), &self.notes, columns);
        let text = self.block.redraw(&lines, [rows, columns]);
        self.write(&text);
    }

    fn write(&self, text: &str) {
        // A terminal that is gone is no reason to fail.
        let _ = self.term.write_str(text);
        let _ = self.term.flush();
    }

    fn clear(&mut self) {
        let text = self.block.redraw(&[], size(&self.term));
        self.write(&text);
    }
}

/// Rows and columns, as far as the terminal tells.
fn size(term: &Term) -> [usize; 2] {
    let (rows, columns) = term.size();
    [usize::from(rows.max(1)), usize::from(columns.max(1))]
}

impl Show for Bar {
    fn progress(&mut self, snapshot: &Snapshot) {
        self.newest = Some(*snapshot);
        self.draw();
    }

    fn words(&mut self, kind: Kind, text: &str) {
        if kind == Kind::Log {
            self.clear();
            self.write(&format!("{text}\n"));
        } else {
            self.notes.extend(say::worded(kind, text).lines().map(str::to_owned));
        }
        self.draw();
    }

    /// The bar goes, what was said stays.
    fn close(&mut self) {
        self.clear();
        let notes = std::mem::take(&mut self.notes);
        notes.iter().for_each(|note| self.write(&format!("{note}\n")));
    }
}

fn lines(measure: Measure, newest: Option<&Snapshot>, notes: &[String], columns: usize) -> Vec<String> {
    let mut lines = Vec::new();
    if let Some(snapshot) = newest {
        let words = share(measure, snapshot);
        let room = columns.saturating_sub(words.len() + 6).min(WIDEST);
        let done = measure.share(snapshot).map_or(0.0, |(share, _)| share);
        lines.push(match room {
            NARROWEST.. => format!("{} {words}", bar(done, room)),
            _ => words,
        });
        lines.push(status(snapshot));
    }
    let earlier = notes.len().saturating_sub(MOST_NOTES);
    if earlier > 0 {
        lines.push(
            style(format!("{earlier} earlier messages, shown at the end")).dim().for_stderr().to_string(),
        );
    }
    lines.extend(notes[earlier..].iter().map(|note| style(note).yellow().for_stderr().to_string()));
    lines
}

/// A bar of so many columns, in eighths of a column.
fn bar(share: f64, columns: usize) -> String {
    const PARTS: [&str; 8] = ["", "▏", "▎", "▍", "▌", "▋", "▊", "▉"];
    let eighths = (share * columns as f64 * 8.0) as usize;
    let full = format!("{}{}", "█".repeat(eighths / 8), PARTS[eighths % 8]);
    let empty = " ".repeat(columns - eighths.div_ceil(8));
    format!("▕{}{empty}▏", style(full).cyan().for_stderr())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::words::tests::progress;

    #[test]
    fn a_bar_fills_all_of_its_columns() {
        for step in 0..=1000 {
            let text = bar(f64::from(step) / 1000.0, 20);
            assert_eq!(console::measure_text_width(&text), 22, "{text}");
        }
        assert_eq!(console::strip_ansi_codes(&bar(0.5, 4)), "▕██  ▏");
        assert_eq!(console::strip_ansi_codes(&bar(0.54, 4)), "▕██▏ ▏");
    }

    #[test]
    fn only_the_newest_warnings_stand_below_the_bar() {
        let snapshot = Snapshot { progress: progress(), spp_max: 5, measured_at: 0 };
        let notes: Vec<String> = (0..7).map(|i| format!("warning: {i}")).collect();
        let lines = lines(Measure::Converged, Some(&snapshot), &notes, 80);
        assert_eq!(lines.len(), 2 + 1 + MOST_NOTES);
        assert!(lines[0].contains("█") && lines[0].ends_with("50.0 % converged, 1:02:03 left"));
        assert!(lines[2].contains("3 earlier"));
        assert!(lines[3].contains("warning: 3") && lines[6].contains("warning: 6"));
        let narrow = super::lines(Measure::Converged, Some(&snapshot), &[], 40);
        assert_eq!(narrow[0], "50.0 % converged, 1:02:03 left");
    }
}
