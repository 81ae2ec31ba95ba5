//! Sheets of values over the unit square, bilinear between their samples, for several parameters: looking them up,
//! and drawing places by them.

use glam::{Vec2, Vec3};

use crate::desc::Sheets;

/// Which sheets count how much.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mix {
    sheets: [u32; 4],
    weights: [f32; 4],
}

impl Mix {
    /// The only sheet.
    pub(super) const ALONE: Self = Self { sheets: [0; 4], weights: [1.0, 0.0, 0.0, 0.0] };

    /// Between the ascending places of two parameters, the second of which runs faster.
    pub(super) fn new(places: [&[f32]; 2], at: [f32; 2]) -> Self {
        let [(slow, share_slow), (fast, share_fast)] = [0, 1].map(|i| {
            let high =
                places[i].partition_point(|&place| place <= at[i]).clamp(1, places[i].len().max(2) - 1);
            let [a, b] = [high - 1, high.min(places[i].len() - 1)];
            let width = places[i][b] - places[i][a];
            let share = if width > 0.0 { ((at[i] - places[i][a]) / width).clamp(0.0, 1.0) } else { 0.0 };
            ([a as u32, b as u32], share)
        });
        let count = places[1].len() as u32;
        let sheet = |i: usize| slow[i / 2] * count + fast[i % 2];
        let part = |share: f32, upper: bool| if upper { share } else { 1.0 - share };
        let weight = |i: usize| part(share_slow, i / 2 == 1) * part(share_fast, i % 2 == 1);
        Self { sheets: [0, 1, 2, 3].map(sheet), weights: [0, 1, 2, 3].map(weight) }
    }

    /// The mean of value `index` of the sheets, which have `stride` values each.
    fn of<T: Value>(&self, values: &[T], stride: usize, index: usize) -> T {
        let mut sum = T::default();
        for (&sheet, &weight) in self.sheets.iter().zip(&self.weights) {
            if weight != 0.0 {
                sum = sum + values[sheet as usize * stride + index] * weight;
            }
        }
        sum
    }
}

/// What can be mixed.
pub(super) trait Value:
    Copy + Default + std::ops::Add<Output = Self> + std::ops::Mul<f32, Output = Self>
{
}
impl Value for f32 {}
impl Value for Vec3 {}

/// A cell of a sheet and a place in it.
struct Cell {
    column: usize,
    row: usize,
    at: Vec2,
}

impl Cell {
    fn new(size: [u32; 2], place: Vec2) -> Self {
        let cells = Vec2::new(size[0] as f32 - 1.0, size[1] as f32 - 1.0);
        let scaled = place.clamp(Vec2::ZERO, Vec2::ONE) * cells;
        let column = (scaled.x as usize).min(size[0] as usize - 2);
        let row = (scaled.y as usize).min(size[1] as usize - 2);
        Self { column, row, at: scaled - Vec2::new(column as f32, row as f32) }
    }
}

/// The value of mixed sheets at a place of the unit square.
pub(super) fn look_up<T: Value>(sheets: &Sheets<T>, place: Vec2, mix: &Mix) -> T {
    let [width, height] = sheets.size.map(|n| n as usize);
    let Cell { column, row, at } = Cell::new(sheets.size, place);
    let value = |x: usize, y: usize| mix.of(&sheets.values, width * height, (row + y) * width + column + x);
    (value(0, 0) * (1.0 - at.x) + value(1, 0) * at.x) * (1.0 - at.y)
        + (value(0, 1) * (1.0 - at.x) + value(1, 1) * at.x) * at.y
}

/// Draws places of the unit square by the values of sheets.
#[derive(Debug)]
pub(super) struct Distribution {
    size: [u32; 2],
    /// Values that have the mean 1 over each sheet, by cells.
    values: Vec<f32>,
    /// For each row of samples what lies left of each column, in cells.
    columns: Vec<f32>,
    /// What lies above each row of samples.
    rows: Vec<f32>,
}

impl Distribution {
    /// By sheets that are nowhere negative, and not 0 everywhere.
    pub(super) fn new(sheets: &Sheets<f32>) -> Self {
        let [width, height] = sheets.size.map(|n| n as usize);
        let mut made =
            Self { size: sheets.size, values: sheets.values.clone(), columns: vec![], rows: vec![] };
        for sheet in made.values.chunks_exact_mut(width * height) {
            let mut columns = Vec::with_capacity(width * height);
            for row in sheet.chunks_exact(width) {
                let mut sum = 0.0_f64;
                columns.push(0.0);
                columns.extend(row.windows(2).map(|pair| {
                    sum += 0.5 * f64::from(pair[0] + pair[1]);
                    sum
                }));
            }
            let whole = |row: usize| columns[(row + 1) * width - 1];
            let mut rows = vec![0.0];
            rows.extend((1..height).scan(0.0, |sum, row| {
                *sum += 0.5 * (whole(row - 1) + whole(row));
                Some(*sum)
            }));
            let all: f64 = rows[height - 1];
            made.columns.extend(columns.iter().map(|value| (value / all) as f32));
            made.rows.extend(rows.iter().map(|value| (value / all) as f32));
            sheet.iter_mut().for_each(|value| *value = (f64::from(*value) / all) as f32);
        }
        made
    }

    fn stride(&self) -> usize {
        self.size[0] as usize * self.size[1] as usize
    }

    /// Cells of a sheet.
    fn cells(&self) -> f32 {
        (self.size[0] as f32 - 1.0) * (self.size[1] as f32 - 1.0)
    }

    fn row_start(&self, row: usize, mix: &Mix) -> f32 {
        mix.of(&self.rows, self.size[1] as usize, row)
    }

    /// What a row of samples holds.
    fn row(&self, row: usize, mix: &Mix) -> f32 {
        mix.of(&self.columns, self.stride(), (row + 1) * self.size[0] as usize - 1)
    }

    /// What lies left of a column, so far from a row to the next.
    fn column_start(&self, column: usize, row: usize, y: f32, mix: &Mix) -> f32 {
        let at = |row: usize| mix.of(&self.columns, self.stride(), row * self.size[0] as usize + column);
        lerp(at(row), at(row + 1), y)
    }

    fn column(&self, column: usize, row: usize, y: f32, mix: &Mix) -> f32 {
        let at = |row: usize| mix.of(&self.values, self.stride(), row * self.size[0] as usize + column);
        lerp(at(row), at(row + 1), y)
    }

    /// Density per area of the unit square.
    pub(super) fn density(&self, place: Vec2, mix: &Mix) -> f32 {
        let Cell { column, row, at } = Cell::new(self.size, place);
        let edge = |column| self.column(column, row, at.y, mix);
        lerp(edge(column), edge(column + 1), at.x) * self.cells()
    }

    /// A place for random numbers in `[0, 1)`, and its density.
    pub(super) fn sample(&self, u: Vec2, mix: &Mix) -> (Vec2, f32) {
        let [width, height] = self.size.map(|n| n as usize);
        let row = last_below(height - 1, |row| self.row_start(row, mix) <= u.y);
        let edges = [self.row(row, mix), self.row(row + 1, mix)];
        let y = along(u.y - self.row_start(row, mix), edges);
        let x = u.x * lerp(edges[0], edges[1], y);
        let column = last_below(width - 1, |column| self.column_start(column, row, y, mix) <= x);
        let edges = [self.column(column, row, y, mix), self.column(column + 1, row, y, mix)];
        let x = along(x - self.column_start(column, row, y, mix), edges);
        let cells = Vec2::new(width as f32 - 1.0, height as f32 - 1.0);
        let place = Vec2::new(column as f32 + x, row as f32 + y) / cells;
        (place, lerp(edges[0], edges[1], x) * self.cells())
    }

    /// The numbers from which [`sample`](Self::sample) makes a place, and its density.
    pub(super) fn invert(&self, place: Vec2, mix: &Mix) -> (Vec2, f32) {
        let Cell { column, row, at } = Cell::new(self.size, place);
        let edges = [self.column(column, row, at.y, mix), self.column(column + 1, row, at.y, mix)];
        let x = self.column_start(column, row, at.y, mix) + up_to(at.x, edges);
        let rows = [self.row(row, mix), self.row(row + 1, mix)];
        let whole = lerp(rows[0], rows[1], at.y);
        let x = if whole > 0.0 { x / whole } else { 0.0 };
        let y = self.row_start(row, mix) + up_to(at.y, rows);
        let u = Vec2::new(x, y).clamp(Vec2::ZERO, Vec2::ONE);
        (u, lerp(edges[0], edges[1], at.x) * self.cells())
    }
}

fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a + t * (b - a)
}

/// The integral up to `x` of what is linear between two values at 0 and 1.
fn up_to(x: f32, [a, b]: [f32; 2]) -> f32 {
    x * (a + 0.5 * x * (b - a))
}

/// The inverse of [`up_to`].
fn along(integral: f32, [a, b]: [f32; 2]) -> f32 {
    let root = (a * a + 2.0 * integral * (b - a)).max(0.0).sqrt();
    let x = 2.0 * integral / (a + root);
    if x.is_nan() { 0.5 } else { x.clamp(0.0, 1.0) }
}

/// The last number below `count` of which `below`, which is true up to somewhere, is true; 0 if none is.
fn last_below(count: usize, below: impl Fn(usize) -> bool) -> usize {
    let (mut low, mut high) = (0, count);
    while high - low > 1 {
        let middle = usize::midpoint(low, high);
        if below(middle) { low = middle } else { high = middle }
    }
    low
}
