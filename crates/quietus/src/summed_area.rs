//! Sums of errors, or of samples, over rectangles: plainly, as the talk's renderer does, and by a summed-area table.
//!
//! Rebuilding a tree asks two questions of each node: the sum of its errors, and the column (row) in which half
//! of that sum is reached. [`Resummed`] answers both by adding pixels, at every level of the tree anew.
//! [`SummedArea`] (Crow 1984, *Summed-Area Tables for Texture Mapping*) answers the first in constant, the
//! second in logarithmic time. Errors are integers, so both give the same answers exactly.

use crate::{
    Axis, ErrorPlane, PixelRect,
    error_plane::{samples, steps},
    sync::AtomicU32,
};

/// Where the running sum of marginal errors reaches half of the total.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HalfWay {
    /// The column (row) in which it happens.
    pub index: u32,
    /// Sum of all columns before it; below half of the total.
    pub before: u64,
    /// Sum of the column itself; above 0.
    pub within: u64,
}

/// Exact sums of pixel errors over rectangles.
pub trait ErrorSums {
    /// The pixels it knows.
    fn bounds(&self) -> PixelRect;

    /// Sum over `rect`, which lies inside the bounds.
    fn sum(&self, rect: &PixelRect) -> u64;

    /// The first column (row) of `rect` at whose end the running sum is at least half of `total`, the sum over
    /// `rect`; `None` where that is 0.
    fn half_way(&self, rect: &PixelRect, axis: Axis, total: u64) -> Option<HalfWay>;
}

/// Errors of a rectangle, row by row, summed pixel by pixel at every question: the plain form.
#[derive(Clone, Debug, Default)]
pub struct Resummed {
    bounds: Option<PixelRect>,
    errors: Vec<u32>,
}

impl Resummed {
    /// Takes the errors of `rect`; memory of an earlier use is kept.
    pub fn load(&mut self, plane: &ErrorPlane, rect: PixelRect) {
        plane.copy_rect(&rect, &mut self.errors);
        self.bounds = Some(rect);
    }

    /// Takes the numbers of samples of `rect` in place of the errors.
    pub fn load_samples(&mut self, plane: &ErrorPlane, rect: PixelRect) {
        plane.copy_samples(&rect, &mut self.errors);
        self.bounds = Some(rect);
    }

    fn row(&self, rect: &PixelRect, y: u32) -> &[u32] {
        let bounds = self.bounds();
        let start = (y - bounds.y0) as usize * bounds.width() as usize + (rect.x0 - bounds.x0) as usize;
        &self.errors[start..start + rect.width() as usize]
    }

    /// Sum of one column (row) of `rect`.
    fn marginal(&self, rect: &PixelRect, axis: Axis, index: u32) -> u64 {
        match axis {
            Axis::X => self.sum(&PixelRect { x0: index, x1: index + 1, ..*rect }),
            Axis::Y => self.sum(&PixelRect { y0: index, y1: index + 1, ..*rect }),
        }
    }
}

impl ErrorSums for Resummed {
    fn bounds(&self) -> PixelRect {
        self.bounds.unwrap_or(PixelRect::new(0, 0, 0, 0))
    }

    fn sum(&self, rect: &PixelRect) -> u64 {
        (rect.y0..rect.y1).map(|y| self.row(rect, y).iter().map(|&e| u64::from(e)).sum::<u64>()).sum()
    }

    fn half_way(&self, rect: &PixelRect, axis: Axis, total: u64) -> Option<HalfWay> {
        let range = match axis {
            Axis::X => rect.x0..rect.x1,
            Axis::Y => rect.y0..rect.y1,
        };
        let mut before = 0;
        for index in range {
            let within = self.marginal(rect, axis, index);
            if within > 0 && 2 * (before + within) >= total {
                return Some(HalfWay { index, before, within });
            }
            before += within;
        }
        None
    }
}

/// A summed-area table of the errors of a rectangle: the fast form.
///
/// Entry (x, y) is the sum of all errors above and to the left of pixel corner (x, y). Sums of 2^32 pixels of
/// the largest error fit `u64`.
#[derive(Clone, Debug, Default)]
pub struct SummedArea {
    bounds: Option<PixelRect>,
    table: Vec<u64>,
}

impl SummedArea {
    /// Takes the errors of `rect`; memory of an earlier use is kept.
    pub fn load(&mut self, plane: &ErrorPlane, rect: PixelRect) {
        self.fill(rect, |y| plane.row(y, rect.x0, rect.x1), steps);
    }

    /// Takes the numbers of samples of `rect` in place of the errors.
    pub fn load_samples(&mut self, plane: &ErrorPlane, rect: PixelRect) {
        self.fill(rect, |y| plane.samples_row(y, rect.x0, rect.x1), samples);
    }

    /// Sums `value` of the slots of `rect`, whose rows come in spans with their first columns.
    fn fill<'a, Row: Iterator<Item = (u32, &'a [AtomicU32])>>(
        &mut self,
        rect: PixelRect,
        row: impl Fn(u32) -> Row,
        value: impl Fn(&AtomicU32) -> u32,
    ) {
        self.bounds = Some(rect);
        let stride = rect.width() as usize + 1;
        self.table.resize(stride * (rect.height() as usize + 1), 0);
        self.table[..stride].fill(0);
        for y in rect.y0..rect.y1 {
            let start = (y - rect.y0) as usize * stride;
            let (above, here) = self.table[start..][..2 * stride].split_at_mut(stride);
            here[0] = 0;
            let mut sum = 0;
            for (x, span) in row(y) {
                let first = (x - rect.x0) as usize + 1;
                let (above, here) = (&above[first..][..span.len()], &mut here[first..][..span.len()]);
                for ((entry, above), error) in here.iter_mut().zip(above).zip(span) {
                    sum += u64::from(value(error));
                    *entry = above + sum;
                }
            }
        }
    }

    /// The table's entry at a pixel corner.
    fn corner(&self, x: u32, y: u32) -> u64 {
        let bounds = self.bounds();
        let stride = bounds.width() as usize + 1;
        self.table[(y - bounds.y0) as usize * stride + (x - bounds.x0) as usize]
    }
}

impl ErrorSums for SummedArea {
    fn bounds(&self) -> PixelRect {
        self.bounds.unwrap_or(PixelRect::new(0, 0, 0, 0))
    }

    fn sum(&self, rect: &PixelRect) -> u64 {
        (self.corner(rect.x1, rect.y1) - self.corner(rect.x0, rect.y1))
            - (self.corner(rect.x1, rect.y0) - self.corner(rect.x0, rect.y0))
    }

    fn half_way(&self, rect: &PixelRect, axis: Axis, total: u64) -> Option<HalfWay> {
        if total == 0 {
            return None;
        }
        let (start, end) = match axis {
            Axis::X => (rect.x0, rect.x1),
            Axis::Y => (rect.y0, rect.y1),
        };
        // Sum of the columns (rows) before `index`; the corners at the start are looked up once.
        let base = match axis {
            Axis::X => self.corner(start, rect.y1) - self.corner(start, rect.y0),
            Axis::Y => self.corner(rect.x1, start) - self.corner(rect.x0, start),
        };
        let up_to = |index| match axis {
            Axis::X => self.corner(index, rect.y1) - self.corner(index, rect.y0) - base,
            Axis::Y => self.corner(rect.x1, index) - self.corner(rect.x0, index) - base,
        };
        // The lowest index with 2 * up_to(index + 1) >= total lies in low..=high; `below` and `above` are the sums
        // at the ends, up_to(low) and up_to(high + 1). It is looked for where it would be if the errors between
        // were even, and every other time in the middle, so that the worst case stays logarithmic.
        let (mut low, mut high, mut below, mut above) = (start, end - 1, 0, total);
        let mut interpolates = true;
        while low < high {
            let span = u64::from(high - low);
            let step = match interpolates {
                // In floating point: it is but a guess, and whatever it is, the answer is the same.
                true => ((total / 2 - below) as f64 / (above - below) as f64 * (span + 1) as f64) as u64,
                false => span / 2,
            };
            let index = low + step.min(span - 1) as u32;
            let sum = up_to(index + 1);
            if 2 * sum >= total {
                (high, above) = (index, sum)
            } else {
                (low, below) = (index + 1, sum)
            }
            interpolates = !interpolates;
        }
        let before = below;
        Some(HalfWay { index: low, before, within: above - before })
    }
}
