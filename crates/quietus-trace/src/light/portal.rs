//! A rectangular opening through which alone light from infinitely far away comes in, and drawing directions through
//! it (Bitterli, Novák and Jarosz 2015, "Portal-Masked Environment Map Sampling").
//!
//! Directions ahead are laid out by the angles at which they run against both edges of the opening. Whatever point looks
//! at it, the opening is a rectangle there, over which sums of the light's luminance tell what is in any part of it.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Mat3, Vec2, Vec3};
use rayon::prelude::*;

use crate::desc;

/// Most cells per side that luminance is summed over.
const MOST_CELLS: usize = 512;
/// Share of the mean that every cell has at least: light may hide between the places at which it is looked up.
const LEAST: f32 = 1e-3;

/// A portal, and the light behind it.
#[derive(Debug)]
pub(super) struct Portal {
    /// Opposite ones.
    corners: [Vec3; 2],
    /// From the world to the edges and the direction in which light is seen.
    to_local: Mat3,
    light: Sums,
    /// Mean luminance of the light ahead.
    mean: f32,
}

/// A rectangle in the unit square of directions.
type Window = [Vec2; 2];

impl Portal {
    /// Compiles `portal`, whose edges are perpendicular. `luminance` is that of the light from a direction, of which
    /// `detail` texels go over half a turn.
    pub(super) fn new(portal: &desc::Portal, detail: usize, luminance: impl Fn(Vec3) -> f32 + Sync) -> Self {
        let [x, y] = portal.edges.map(Vec3::normalize);
        let to_local = Mat3::from_cols(x, y, x.cross(y)).transpose();
        let cells = (detail / 2).next_power_of_two().clamp(32, MOST_CELLS);
        let looks = (detail / cells).clamp(1, 4);
        let side = cells * looks;
        let weight = |x: usize, y: usize| {
            let place = (Vec2::new(x as f32, y as f32) + 0.5) / side as f32;
            let (direction, stretch) = direction(place);
            f64::from(luminance(to_local.transpose() * direction).max(0.0) * stretch)
        };
        let cell = |i: usize| -> f64 {
            let (x, y) = (i % cells * looks, i / cells * looks);
            (0..looks * looks).map(|k| weight(x + k % looks, y + k / looks)).sum()
        };
        let mut weights: Vec<f64> = (0..cells * cells).into_par_iter().map(cell).collect();
        let least = f64::from(LEAST) * weights.iter().sum::<f64>() / weights.len() as f64;
        // A light that is black nearly everywhere may be so wherever it was looked up.
        weights.iter_mut().for_each(|weight| *weight += least.max(f64::MIN_POSITIVE));
        let sum = weights.iter().sum::<f64>() / (side * side) as f64;
        let mean = (sum / f64::from(2.0 * PI)) as f32;
        let corners = [portal.corner, portal.corner + portal.edges[0] + portal.edges[1]];
        Self { corners, to_local, light: Sums::new(cells, &weights), mean }
    }

    /// Mean luminance of the light, over all directions ahead.
    pub(super) fn mean(&self) -> f32 {
        self.mean
    }

    /// Whether `direction` leads from `from` through the portal.
    pub(super) fn shows(&self, from: Vec3, direction: Vec3) -> bool {
        let Some(window) = self.window(from) else { return false };
        self.place(direction).is_some_and(|place| contains(window, place))
    }

    /// A direction through the portal, and its density per steradian.
    pub(super) fn sample(&self, from: Vec3, u: Vec2) -> Option<(Vec3, f32)> {
        let (place, density) = self.light.sample(u, self.window(from)?)?;
        let (direction, stretch) = direction(place);
        (stretch.is_finite()).then(|| (self.to_local.transpose() * direction, density / stretch))
    }

    /// The density per steradian with which [`Self::sample`] draws `direction`.
    pub(super) fn pdf(&self, from: Vec3, direction: Vec3) -> f32 {
        let (Some(window), Some(place)) = (self.window(from), self.place(direction)) else { return 0.0 };
        if !contains(window, place) {
            return 0.0;
        }
        let stretch = stretch(self.to_local * direction);
        if stretch.is_finite() { self.light.density(place, window) / stretch } else { 0.0 }
    }

    /// Where the portal is for a point before it.
    fn window(&self, from: Vec3) -> Option<Window> {
        let [a, b] = self.corners.map(|corner| self.place(corner - from));
        let [a, b] = [a?, b?];
        let window = [a.min(b), a.max(b)];
        (window[0].cmplt(window[1]).all()).then_some(window)
    }

    /// The place of a direction ahead, of any length.
    fn place(&self, direction: Vec3) -> Option<Vec2> {
        let w = self.to_local * direction;
        (w.z > 0.0).then(|| Vec2::new(w.x.atan2(w.z), w.y.atan2(w.z)) / PI + 0.5)
    }
}

fn contains([low, high]: Window, place: Vec2) -> bool {
    place.cmpge(low).all() && place.cmple(high).all()
}

/// The direction at a place, along the edges and ahead, and its [`stretch`].
fn direction(place: Vec2) -> (Vec3, f32) {
    let angles = place * PI - FRAC_PI_2;
    let direction = Vec3::new(angles.x.tan(), angles.y.tan(), 1.0).normalize();
    (direction, stretch(direction))
}

/// Steradians per unit of area of the square.
fn stretch(w: Vec3) -> f32 {
    PI * PI * (1.0 - w.x * w.x) * (1.0 - w.y * w.y) / w.z
}

/// A density over the unit square, the same all over each cell, to be drawn from in any window.
#[derive(Debug)]
struct Sums {
    cells: usize,
    /// Over all cells before a column and a row, `cells + 1` to a row (Crow 1984).
    sums: Vec<f64>,
}

impl Sums {
    fn new(cells: usize, weights: &[f64]) -> Self {
        let side = cells + 1;
        let mut sums = vec![0.0; side * side];
        for y in 0..cells {
            let mut row = 0.0;
            for x in 0..cells {
                row += weights[y * cells + x];
                sums[(y + 1) * side + x + 1] = sums[y * side + x + 1] + row;
            }
        }
        Self { cells, sums }
    }

    /// Sum up to a column and a row, and the parts of both that come after their whole numbers.
    fn up_to(&self, x: f64, y: f64) -> f64 {
        let last = self.cells - 1;
        let [column, row] = [x, y].map(|at| (at as usize).min(last));
        let (s, t) = (x - column as f64, y - row as f64);
        let at = |x: usize, y: usize| self.sums[y * (self.cells + 1) + x];
        let upper = at(column, row) * (1.0 - s) + at(column + 1, row) * s;
        let lower = at(column, row + 1) * (1.0 - s) + at(column + 1, row + 1) * s;
        upper * (1.0 - t) + lower * t
    }

    /// Sum over columns and rows.
    fn over(&self, [left, right]: [f64; 2], [top, bottom]: [f64; 2]) -> f64 {
        self.up_to(right, bottom) - self.up_to(left, bottom) - self.up_to(right, top) + self.up_to(left, top)
    }

    /// Columns and rows of a window.
    fn extent(&self, [low, high]: Window) -> [[f64; 2]; 2] {
        let [low, high] = [low, high].map(|at| at.as_dvec2() * self.cells as f64);
        [[low.x, high.x], [low.y, high.y]]
    }

    /// Density at a place of the window.
    fn density(&self, place: Vec2, window: Window) -> f32 {
        let [columns, rows] = self.extent(window);
        let total = self.over(columns, rows);
        let [x, y] = [place.x, place.y].map(|at| self.cell(f64::from(at) * self.cells as f64));
        let cell = self.over(x, y);
        if total > 0.0 { (cell / total * (self.cells * self.cells) as f64) as f32 } else { 0.0 }
    }

    /// From where to where the cell at `at` goes.
    fn cell(&self, at: f64) -> [f64; 2] {
        let first = (at as usize).min(self.cells - 1) as f64;
        [first, first + 1.0]
    }

    /// A place in the window and its density there.
    fn sample(&self, u: Vec2, window: Window) -> Option<(Vec2, f32)> {
        let [columns, rows] = self.extent(window);
        let total = self.over(columns, rows);
        if total <= 0.0 {
            return None;
        }
        let x = inverted(columns, f64::from(u.x) * total, |x| self.over([columns[0], x], rows));
        let column = self.cell(x);
        let all = self.over(column, rows);
        let y = inverted(rows, f64::from(u.y) * all, |y| self.over(column, [rows[0], y]));
        let place = (Vec2::new(x as f32, y as f32) / self.cells as f32).clamp(window[0], window[1]);
        Some((place, self.density(place, window)))
    }
}

/// Where `sum`, which grows from 0 and is linear between whole numbers, reaches `wanted`.
fn inverted([start, end]: [f64; 2], wanted: f64, sum: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (start, end);
    // Down to one cell or the part of it in the window.
    while high.ceil() - low.floor() > 1.0 {
        let middle = (0.5 * (low + high)).round().clamp(low.floor() + 1.0, high.ceil() - 1.0);
        if sum(middle) <= wanted { low = middle } else { high = middle }
    }
    let (first, last) = (sum(low), sum(high));
    let part = if last > first { (wanted - first) / (last - first) } else { 0.5 };
    low + part.clamp(0.0, 1.0) * (high - low)
}
