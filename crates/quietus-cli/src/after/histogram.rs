//! Percentiles, and histograms for the terminal.

use std::fmt::Write;

/// Values in order.
pub(super) struct Sorted(Vec<f64>);

impl Sorted {
    /// Without what is not a number.
    pub(super) fn new(values: impl Iterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.filter(|value| !value.is_nan()).collect();
        values.sort_by(f64::total_cmp);
        Self(values)
    }

    /// The mean; 0 without values.
    pub(super) fn mean(&self) -> f64 {
        self.0.iter().sum::<f64>() / self.0.len().max(1) as f64
    }

    /// By nearest rank: the smallest value that at least that share of all does not exceed; 0 without values.
    pub(super) fn percentile(&self, percent: f64) -> f64 {
        let rank = (percent / 100.0 * self.0.len() as f64).ceil() as usize;
        self.0.get(rank.clamp(1, self.0.len().max(1)) - 1).copied().unwrap_or(0.0)
    }

    /// Share of the sum that the largest tenth of the values has; 0 without a sum.
    pub(super) fn share_of_largest_tenth(&self) -> f64 {
        let sum: f64 = self.0.iter().sum();
        let largest = &self.0[self.0.len() - self.0.len().div_ceil(10)..];
        if sum > 0.0 { largest.iter().sum::<f64>() / sum } else { 0.0 }
    }

    /// Counts between powers of two: the lower end of each and the share of values in it. What is 0 comes first.
    pub(super) fn octaves(&self) -> Vec<(f64, f64)> {
        let lower = |value: f64| if value > 0.0 { value.log2().floor().exp2() } else { 0.0 };
        let mut octaves: Vec<(f64, usize)> = Vec::new();
        for &value in &self.0 {
            match octaves.last_mut() {
                Some((end, count)) if *end == lower(value) => *count += 1,
                _ => {
                    // None is left out between two that are not empty.
                    while let Some(&(end, _)) =
                        octaves.last().filter(|(end, _)| *end > 0.0 && 2.0 * end < lower(value))
                    {
                        octaves.push((2.0 * end, 0));
                    }
                    octaves.push((lower(value), 1));
                }
            }
        }
        octaves.into_iter().map(|(end, count)| (end, count as f64 / self.0.len() as f64)).collect()
    }
}

/// Columns of the longest bar.
const LONGEST: f64 = 40.0;
/// Most lines: rare values at both ends would fill the screen.
const MOST_LINES: usize = 24;

/// One line for each octave, `name` its lower end.
pub(super) fn bars(octaves: &[(f64, f64)], name: impl Fn(f64) -> String) -> String {
    let largest = octaves.iter().map(|(_, share)| *share).fold(0.0, f64::max);
    let from = octaves.len().saturating_sub(MOST_LINES);
    let mut text = String::new();
    for (end, share) in &octaves[from..] {
        let length = (LONGEST * share / largest).round() as usize;
        let bar = "█".repeat(length.max(usize::from(*share > 0.0)));
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{:>14} {bar} {:.1} %", name(*end), 100.0 * share);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_of_known_values() {
        let sorted = Sorted::new((1..=200).rev().map(f64::from));
        assert_eq!((sorted.mean(), sorted.percentile(50.0), sorted.percentile(99.0)), (100.5, 100.0, 198.0));
        assert_eq!((sorted.percentile(0.0), sorted.percentile(100.0)), (1.0, 200.0));
        let largest: f64 = (181..=200).map(f64::from).sum();
        assert!((sorted.share_of_largest_tenth() - largest / 20_100.0).abs() < 1e-12);
        let empty = Sorted::new(std::iter::once(f64::NAN));
        assert_eq!((empty.mean(), empty.percentile(50.0), empty.share_of_largest_tenth()), (0.0, 0.0, 0.0));
    }

    #[test]
    fn octaves_hold_every_value_and_leave_none_out() {
        let sorted = Sorted::new([0.0, 16.0, 17.0, 31.0, 128.0].into_iter());
        assert_eq!(sorted.octaves(), [(0.0, 0.2), (16.0, 0.6), (32.0, 0.0), (64.0, 0.0), (128.0, 0.2)]);
        let text = bars(&sorted.octaves(), |end| format!("{end}"));
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines[1], format!("{:>14} {} 60.0 %", 16, "█".repeat(40)));
        assert_eq!(lines[2], format!("{:>14}  0.0 %", 32));
    }
}
