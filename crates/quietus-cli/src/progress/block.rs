//! Lines at the bottom of a terminal that are drawn anew in place, also after its size has changed.
//!
//! Where a terminal becomes narrower, it may break the lines that stand on it into several rows. How many there
//! are now follows from the widths of the lines and the new width, so that all of them are erased.

use console::{measure_text_width, truncate_str};

/// What stands at the bottom of the terminal. The cursor is at the end of the last line.
#[derive(Debug, Default)]
pub(super) struct Block {
    /// Columns of each line.
    widths: Vec<usize>,
}

/// Columns left free at the right: where what is typed is echoed without breaking the line.
const FREE_COLUMNS: usize = 3;

impl Block {
    /// Puts `lines`, cut to fit, in the place of what stands on a terminal of so many rows and columns. Returns what
    /// to write.
    pub(super) fn redraw(&mut self, lines: &[String], [rows, columns]: [usize; 2]) -> String {
        let widest = columns.saturating_sub(FREE_COLUMNS).max(1);
        let fitted: Vec<_> = lines.iter().take(rows).map(|line| truncate_str(line, widest, "…")).collect();
        let up = self.rows(columns).saturating_sub(1).min(rows.saturating_sub(1));
        let up = if up > 0 { format!("\x1b[{up}A") } else { String::new() };
        self.widths = fitted.iter().map(|line| measure_text_width(line)).collect();
        // J erases from the cursor to the end of the screen.
        format!("\r{up}\x1b[J{}", fitted.join("\r\n"))
    }

    /// Rows that the lines take on a terminal of so many columns.
    fn rows(&self, columns: usize) -> usize {
        self.widths.iter().map(|width| width.div_ceil(columns.max(1)).max(1)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(widths: &[usize]) -> Vec<String> {
        widths.iter().map(|&width| "x".repeat(width)).collect()
    }

    #[test]
    fn lines_are_drawn_over_in_place() {
        let mut block = Block::default();
        assert_eq!(block.redraw(&lines(&[2, 3]), [24, 80]), "\r\x1b[Jxx\r\nxxx");
        assert_eq!(block.redraw(&lines(&[1]), [24, 80]), "\r\x1b[1A\x1b[Jx");
        assert_eq!(block.redraw(&[], [24, 80]), "\r\x1b[J");
    }

    #[test]
    fn lines_that_a_narrower_terminal_broke_are_erased_in_all_their_rows() {
        let mut block = Block::default();
        block.redraw(&lines(&[70, 20, 41]), [24, 80]);
        // On 20 columns: 4 + 1 + 3 rows.
        assert_eq!(block.redraw(&[], [24, 20]), "\r\x1b[7A\x1b[J");
    }

    #[test]
    fn lines_never_fill_the_terminal() {
        let mut block = Block::default();
        assert_eq!(block.redraw(&lines(&[100, 100, 100]), [2, 10]), "\r\x1b[Jxxxxxx…\r\nxxxxxx…");
        assert_eq!(block.rows(10), 2);
    }
}
