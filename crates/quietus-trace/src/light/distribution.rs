//! Discrete distributions to draw from: an alias table for many lights, rows of distribution functions for maps.

use glam::Vec2;

/// Draws an index in proportion to its weight in constant time (Walker 1974; built as in Vose 1991).
#[derive(Clone, Debug, Default)]
pub(crate) struct AliasTable {
    bins: Vec<Bin>,
}

#[derive(Clone, Copy, Debug)]
struct Bin {
    /// The share of this bin that keeps its own index; the rest is `alias`'s.
    keep: f32,
    alias: u32,
    /// Probability of this index, over all bins.
    probability: f32,
}

impl AliasTable {
    /// A table over `weights`, each finite and at least 0. Where all are 0 the table is empty.
    pub(crate) fn new(weights: &[f64]) -> Self {
        let total: f64 = weights.iter().sum();
        if total <= 0.0 {
            return Self::default();
        }
        let scale = weights.len() as f64 / total;
        let mut rest: Vec<f64> = weights.iter().map(|w| w * scale).collect();
        let mut bins: Vec<Bin> = (0u32..)
            .zip(weights)
            .map(|(alias, w)| Bin { keep: 1.0, alias, probability: (w / total) as f32 })
            .collect();
        let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..rest.len()).partition(|&i| rest[i] < 1.0);
        while let (Some(&s), Some(&l)) = (small.last(), large.last()) {
            small.pop();
            bins[s].keep = rest[s] as f32;
            bins[s].alias = l as u32;
            rest[l] -= 1.0 - rest[s];
            if rest[l] < 1.0 {
                large.pop();
                small.push(l);
            }
        }
        // Rounding may leave a bin of weight 0 without a partner; it must not come up all the same.
        let heaviest = (0..weights.len()).max_by(|&a, &b| weights[a].total_cmp(&weights[b])).unwrap_or(0);
        for i in small.into_iter().filter(|&i| weights[i] == 0.0) {
            bins[i].keep = 0.0;
            bins[i].alias = heaviest as u32;
        }
        Self { bins }
    }

    /// An index and its probability, for `u` in `[0, 1)`; none from an empty table.
    #[inline]
    pub(crate) fn sample(&self, u: f32) -> Option<(u32, f32)> {
        let scaled = u * self.bins.len() as f32;
        let slot = (scaled as usize).min(self.bins.len().checked_sub(1)?);
        let bin = &self.bins[slot];
        let index = if scaled - (slot as f32) < bin.keep { slot as u32 } else { bin.alias };
        Some((index, self.bins[index as usize].probability))
    }

    /// Probability of `index`; 0 beyond the end.
    #[inline]
    pub(crate) fn probability(&self, index: u32) -> f32 {
        self.bins.get(index as usize).map_or(0.0, |bin| bin.probability)
    }
}

/// A grid of cells to draw from, by rows: first the row, then the column in it.
#[derive(Clone, Debug)]
pub(crate) struct Cells {
    width: usize,
    /// `height + 1` values, 0 to 1.
    rows: Vec<f32>,
    row_guide: Vec<u32>,
    /// `width + 1` values per row, 0 to 1.
    columns: Vec<f32>,
    /// A guide for each row, one after the other.
    column_guides: Vec<u32>,
}

impl Cells {
    /// Cells of these `weights`, `width` per row, each finite and at least 0; none where all are 0.
    pub(crate) fn new(width: usize, weights: &[f32]) -> Option<Self> {
        let height = weights.len() / width;
        let mut columns = Vec::with_capacity((width + 1) * height);
        let mut row_sums = Vec::with_capacity(height);
        for row in weights.chunks_exact(width) {
            row_sums.push(row.iter().map(|&w| f64::from(w)).sum());
            push_distribution(&mut columns, row.iter().map(|&w| f64::from(w)));
        }
        let mut rows = Vec::with_capacity(height + 1);
        push_distribution(&mut rows, row_sums.iter().copied());
        let (mut row_guide, mut column_guides) = (Vec::new(), Vec::new());
        push_guide(&mut row_guide, &rows);
        columns.chunks_exact(width + 1).for_each(|row| push_guide(&mut column_guides, row));
        let whole = Self { width, rows, row_guide, columns, column_guides };
        (row_sums.iter().sum::<f64>() > 0.0).then_some(whole)
    }

    /// Column and row of a cell, in proportion to its weight, and what is left of the random numbers: as good as new.
    #[inline]
    pub(crate) fn sample(&self, u: Vec2) -> ([usize; 2], Vec2) {
        let (row, y) = invert(&self.rows, &self.row_guide, u.y);
        let guide = parts(self.width) + 1;
        let guide = &self.column_guides[row * guide..][..guide];
        let (column, x) = invert(self.row(row), guide, u.x);
        ([column, row], Vec2::new(x, y))
    }

    #[inline]
    fn row(&self, row: usize) -> &[f32] {
        &self.columns[row * (self.width + 1)..][..self.width + 1]
    }
}

/// Appends the distribution function of `weights`, from 0 to 1; all 0 where the weights are.
fn push_distribution(cdf: &mut Vec<f32>, weights: impl Iterator<Item = f64> + Clone) {
    let total: f64 = weights.clone().sum();
    let scale = if total > 0.0 { 1.0 / total } else { 0.0 };
    let mut sum = 0.0;
    cdf.push(0.0);
    cdf.extend(weights.map(|w| {
        sum += w;
        ((sum * scale) as f32).min(1.0)
    }));
    if total > 0.0 {
        // Sums may end a little off 1; cells of weight 0 at the end must keep their mass of 0.
        let last = *cdf.last().unwrap_or(&1.0);
        for value in cdf.iter_mut().rev().take_while(|value| **value == last) {
            *value = 1.0;
        }
    }
}

/// Cells that a part of a guide stands for, on average: a cache line of a distribution function.
const GUIDED: usize = 16;

/// Parts of the guide for so many cells: a power of two, so that products with it are exact.
fn parts(cells: usize) -> usize {
    cells.div_ceil(GUIDED).next_power_of_two()
}

/// Appends, for each of equal parts of 0..1 and for the end, how many values of `cdf` are not above its start: what a
/// search has to look at (Chen and Asau 1974, the cutpoint method).
fn push_guide(guide: &mut Vec<u32>, cdf: &[f32]) {
    let parts = parts(cdf.len() - 1);
    let mut below = 0;
    guide.extend((0..=parts).map(|part| {
        let start = part as f32 / parts as f32;
        below += cdf[below..].partition_point(|&c| c <= start);
        below as u32
    }));
}

/// The cell of `cdf` that holds `u`, and the place in it (0..1).
#[inline]
fn invert(cdf: &[f32], guide: &[u32], u: f32) -> (usize, f32) {
    let parts = guide.len() - 1;
    let part = ((u * parts as f32) as usize).min(parts - 1);
    let (first, last) = (guide[part] as usize, guide[part + 1] as usize);
    let below = first + cdf[first..last].partition_point(|&c| c <= u);
    let cell = below.saturating_sub(1).min(cdf.len() - 2);
    let mass = cdf[cell + 1] - cdf[cell];
    let place = if mass > 0.0 { ((u - cdf[cell]) / mass).clamp(0.0, ONE_BELOW) } else { 0.5 };
    (cell, place)
}

/// The largest number below 1.
const ONE_BELOW: f32 = 1.0 - f32::EPSILON / 2.0;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Rng;

    /// The guide only narrows the search: it finds what a search of the whole row finds.
    #[test]
    fn guided_searches_find_what_plain_ones_find() {
        let mut rng = Rng::new(3);
        for cells in [1, 2, 15, 16, 17, 1000] {
            for emptiness in [0.0, 0.5, 0.99, 1.0] {
                let weight =
                    |rng: &mut Rng| if rng.next_1d() < emptiness { 0.0 } else { f64::from(rng.next_1d()) };
                let weights: Vec<f64> = (0..cells).map(|_| weight(&mut rng)).collect();
                let (mut cdf, mut guide) = (Vec::new(), Vec::new());
                push_distribution(&mut cdf, weights.iter().copied());
                push_guide(&mut guide, &cdf);
                let edges = cdf.iter().copied().filter(|&c| c < 1.0).chain([0.0, ONE_BELOW]);
                let numbers: Vec<f32> = edges.chain((0..1000).map(|_| rng.next_1d())).collect();
                for u in numbers {
                    let plain = cdf.partition_point(|&c| c <= u).saturating_sub(1).min(cells - 1);
                    assert_eq!(invert(&cdf, &guide, u).0, plain, "{cells} cells, {u}");
                }
            }
        }
    }
}
