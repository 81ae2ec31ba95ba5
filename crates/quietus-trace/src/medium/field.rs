//! Media that vary from place to place: what they are somewhere, and how light flies through them.
//!
//! A box is divided into cells, each with a majorant: a number that the extinction of no channel exceeds anywhere in
//! it. Distances are drawn from the majorants; where such a flight ends light meets the medium with the probability that
//! extinction and majorant have, and else nothing at all (Woodcock et al. 1965; Novak et al. 2018, "Monte Carlo Methods
//! for Volumetric Light Transport Simulation", section 5). One majorant for all channels makes distances that are right
//! for each; colours are weights of the decision. What passes on the way to a light is estimated by the product of what
//! such encounters would have left (ratio tracking: Novak et al. 2014, "Residual Ratio Tracking").
//!
//! The heuristic that weights two ways to a light needs the same number on both, which no random estimate is: it gets
//! the extinction's means over cells, with which a flight through the box would have been as long.

mod grid;

use std::sync::Arc;

use glam::{Affine3A, Vec3};
use rayon::prelude::*;

use super::Medium;
use super::flight::{Flight, Scattered};
use crate::desc::{self, Density, Glow, Grid, Variation};
use crate::noise::{noise, noise_gradient};
use crate::sampler::mix64;

/// How many voxels of a grid become one cell along each axis, and how many cells there are at most.
const VOXELS_PER_CELL: u32 = 4;
const MOST_CELLS: u32 = 64;
/// Cells along each axis of what is no grid.
const CELLS_OF_CLOUDS: u32 = 16;
/// Encounters with nothing that a flight survives. Far more than any sound medium has; what is beyond is lost, so that
/// a path always ends.
const MOST_ENCOUNTERS: u32 = 1 << 18;

/// A medium that varies, ready to be flown through.
#[derive(Debug)]
pub(crate) struct Field {
    variation: Arc<Variation>,
    size: [u32; 3],
    cells: Vec<Cell>,
}

/// What is known of a part of the box.
#[derive(Clone, Copy, Debug)]
struct Cell {
    /// At least the extinction of every channel everywhere in it, per metre.
    majorant: f32,
    /// The mean extinction.
    mean: Vec3,
}

impl Cell {
    /// How far a flight with this optical depth goes.
    fn free(&self, depth: f32) -> f32 {
        if self.majorant > 0.0 { depth / self.majorant } else { f32::INFINITY }
    }
}

/// A straight way: from where, in which direction (of unit length), how far.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Way {
    pub(crate) origin: Vec3,
    pub(crate) direction: Vec3,
    pub(crate) length: f32,
}

/// Random numbers of which nobody knows beforehand how many will be needed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chance(u64);

impl Chance {
    /// The numbers that belong to `seed`.
    pub(crate) fn new(seed: u64) -> Self {
        Self(mix64(seed))
    }

    /// Uniform in `[0, 1)`.
    pub(crate) fn number(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        (mix64(self.0) >> 40) as f32 / (1_u32 << 24) as f32
    }

    /// Distributed with the density `exp(-x)`.
    fn exponential(&mut self) -> f32 {
        -(-self.number()).ln_1p()
    }
}

/// What a medium is at some place, per metre.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Local {
    absorption: Vec3,
    scattering: Vec3,
}

impl Field {
    /// Compiles the variation of a medium whose numbers have been checked.
    pub(crate) fn new(medium: &desc::Medium) -> Option<Self> {
        let variation = Arc::clone(medium.variation.as_ref()?);
        let cells_along = |voxels: u32| voxels.div_ceil(VOXELS_PER_CELL).min(MOST_CELLS);
        let size = match &variation.density {
            Density::Grid(grid) => grid.size.map(cells_along),
            Density::Colors { absorption, scattering } => {
                let grid = absorption.as_ref().or(scattering.as_ref());
                grid.map_or([1; 3], |grid| grid.size.map(cells_along))
            }
            Density::Cloud { .. } => [CELLS_OF_CLOUDS; 3],
        };
        let mut field = Self { variation, size, cells: Vec::new() };
        let count: usize = size.map(|n| n as usize).iter().product();
        let uniform = match &field.variation.density {
            Density::Grid(grid) => grid.uniform_bricks(),
            _ => Vec::new(),
        };
        field.cells = (0..count).into_par_iter().map(|i| field.cell(medium, i, &uniform)).collect();
        Some(field)
    }

    /// Looks at cell number `index`; of a grid's bricks it is known which are the same everywhere.
    fn cell(&self, medium: &desc::Medium, index: usize, uniform: &[Option<f32>]) -> Cell {
        let [nx, ny, nz] = self.size;
        let index = index as u32;
        let at = [index % nx, index / nx % ny, index / nx / ny];
        let span = |axis: usize, n: u32| [at[axis], at[axis] + 1].map(|edge| edge as f32 / n as f32);
        let part = [span(0, nx), span(1, ny), span(2, nz)];
        match &self.variation.density {
            Density::Grid(grid) => {
                let extinction = medium.absorption + medium.scattering;
                let (most, mean) = grid.over(part, uniform, 0.0, f32::max);
                Cell { majorant: most * extinction.max_element(), mean: mean * extinction }
            }
            Density::Colors { absorption, scattering } => {
                let over = |grid: &Option<Grid<Vec3>>| match grid {
                    None => (Vec3::ONE, Vec3::ONE),
                    Some(grid) => grid.over(part, &[], Vec3::ZERO, Vec3::max),
                };
                let ((most_a, mean_a), (most_s, mean_s)) = (over(absorption), over(scattering));
                let of = |a: Vec3, s: Vec3| medium.absorption * a + medium.scattering * s;
                Cell { majorant: of(most_a, most_s).max_element(), mean: of(mean_a, mean_s) }
            }
            Density::Cloud { .. } => {
                /// Places along each axis at which a cell is looked at.
                const PLACES: u32 = 4;
                let extinction = medium.absorption + medium.scattering;
                let place =
                    |i: u32, [low, high]: [f32; 2]| low + (high - low) * (i as f32 + 0.5) / PLACES as f32;
                let densities = (0..PLACES.pow(3)).map(|i| {
                    let at = [i % PLACES, i / PLACES % PLACES, i / PLACES / PLACES];
                    let p = Vec3::from_array(std::array::from_fn(|axis| place(at[axis], part[axis])));
                    self.cloud(p)
                });
                let mean = densities.sum::<f32>() / PLACES.pow(3) as f32;
                // Clouds are no denser than 1.
                Cell { majorant: extinction.max_element(), mean: mean * extinction }
            }
        }
    }

    /// What the medium is at `p` in the unit cube.
    #[inline]
    fn at(&self, medium: &Medium, p: Vec3) -> Local {
        let absorption = medium.extinction - medium.scattering;
        match &self.variation.density {
            Density::Grid(grid) => {
                let density = grid.at(p);
                Local { absorption: density * absorption, scattering: density * medium.scattering }
            }
            Density::Colors { absorption: a, scattering: s } => {
                let color = |grid: &Option<Grid<Vec3>>| grid.as_ref().map_or(Vec3::ONE, |grid| grid.at(p));
                Local { absorption: color(a) * absorption, scattering: color(s) * medium.scattering }
            }
            Density::Cloud { .. } => {
                let density = self.cloud(p);
                Local { absorption: density * absorption, scattering: density * medium.scattering }
            }
        }
    }

    /// The density of a cloud: Pharr, Jakob, Humphreys 2023, "Physically Based Rendering", 4th edition, section 11.4.6.
    fn cloud(&self, p: Vec3) -> f32 {
        let Density::Cloud { density, wispiness, frequency, to_cloud } = &self.variation.density else {
            return 0.0;
        };
        let p = to_cloud.transform_point3(p);
        let mut place = frequency * p;
        if *wispiness > 0.0 {
            place += 0.05 * wispiness * noise_gradient(10.0 * place);
            place += 0.025 * wispiness * noise_gradient(19.9 * place);
        }
        let octave = |i| 0.5_f32.powi(i + 1) * noise(1.99_f32.powi(i) * place);
        let sum: f32 = (0..5).map(octave).sum();
        let thin = ((1.0 - p.y) * 4.5 * density * sum).clamp(0.0, 1.0);
        (thin + 2.0 * (0.5 - p.y).max(0.0)).clamp(0.0, 1.0)
    }

    /// What multiplies the medium's emission at `p` in the unit cube.
    fn glow(&self, p: Vec3) -> Vec3 {
        match &self.variation.glow {
            None => Vec3::ONE,
            Some(Glow::Grid(grid)) => Vec3::splat(grid.at(p)),
            Some(Glow::Colors(grid)) => grid.at(p),
            Some(Glow::Heat { temperature, scale, colors, hottest }) => {
                let last = colors.len() - 1;
                let place = (temperature.at(p) / hottest).clamp(0.0, 1.0) * last as f32;
                let first = (place as usize).min(last - 1);
                let color = colors[first].lerp(colors[first + 1], place - first as f32);
                color * scale.as_ref().map_or(1.0, |grid| grid.at(p))
            }
        }
    }

    /// Flies along `way` unless light scatters before. `emitted` is told of radiance that the medium adds on the way,
    /// as a factor of what the flight carried at its start.
    pub(crate) fn fly(
        &self,
        medium: &Medium,
        flight: &mut Flight,
        way: &Way,
        chance: &mut Chance,
        mut emitted: impl FnMut(Vec3),
    ) -> Option<Scattered> {
        let (mut march, mut thickness) = (March::new(self, way)?, Vec3::ZERO);
        let mut encounters = 0;
        while let Some((from, to, cell)) = march.next(self) {
            let mut t = from;
            loop {
                let free = cell.free(flight.depth);
                if t + free >= to {
                    flight.depth -= cell.majorant * (to - t);
                    flight.depth = flight.depth.max(0.0);
                    break;
                }
                t += free;
                flight.depth = chance.exponential();
                encounters += 1;
                if encounters > MOST_ENCOUNTERS {
                    return Some(Scattered { distance: t, weight: Vec3::ZERO });
                }
                let p = march.place(t);
                let local = self.at(medium, p);
                let inverse = 1.0 / cell.majorant;
                if medium.emits {
                    let light = medium.glow * local.absorption * self.glow(p) * inverse;
                    emitted(flight.passage.weight() * light);
                }
                let extinction = ((local.absorption + local.scattering) * inverse).min(Vec3::ONE);
                let meets = if medium.scatters { flight.passage.share().dot(extinction) } else { 0.0 };
                if chance.number() < meets {
                    let weight = flight.passage.weight() * local.scattering * inverse / meets;
                    return Some(Scattered { distance: t, weight });
                }
                flight.passage.encounter((1.0 - extinction) / (1.0 - meets));
                if flight.passage.is_dark() {
                    return Some(Scattered { distance: t, weight: Vec3::ZERO });
                }
            }
            thickness += cell.mean * (to - from);
        }
        flight.passage.expect(medium, thickness);
        None
    }

    /// Lets `passage` pass all of `way`.
    pub(crate) fn pass(&self, medium: &Medium, passage: &mut super::Passage, way: &Way, chance: &mut Chance) {
        /// Below this much light the toss of a coin decides whether it is followed on.
        const FAINT: f32 = 0.1;
        let Some(mut march) = March::new(self, way) else { return };
        let (mut depth, mut thickness, mut encounters) = (chance.exponential(), Vec3::ZERO, 0);
        while let Some((from, to, cell)) = march.next(self) {
            let mut t = from;
            loop {
                let free = cell.free(depth);
                if t + free >= to {
                    depth = (depth - cell.majorant * (to - t)).max(0.0);
                    break;
                }
                t += free;
                depth = chance.exponential();
                encounters += 1;
                let Local { absorption, scattering } = self.at(medium, march.place(t));
                let left = (1.0 - (absorption + scattering) / cell.majorant).max(Vec3::ZERO);
                passage.encounter(left);
                if passage.transmittance().max_element() < FAINT {
                    let followed = chance.number() < 0.5 && encounters <= MOST_ENCOUNTERS;
                    passage.encounter(Vec3::splat(if followed { 2.0 } else { 0.0 }));
                    if !followed || passage.is_dark() {
                        return;
                    }
                }
            }
            thickness += cell.mean * (to - from);
        }
        passage.expect(medium, thickness);
    }
}

/// A way through the cells of a box, one after the other (Amanatides and Woo 1987, "A Fast Voxel Traversal Algorithm
/// for Ray Tracing").
struct March {
    /// In the unit cube.
    origin: Vec3,
    direction: Vec3,
    t: f32,
    end: f32,
    cell: [i32; 3],
    /// Where the cell is left along each axis, and how far it is from there to the next border.
    next: Vec3,
    delta: Vec3,
}

impl March {
    /// None where the way misses the box.
    fn new(field: &Field, way: &Way) -> Option<Self> {
        let from_world: &Affine3A = &field.variation.from_world;
        let (origin, direction) =
            (from_world.transform_point3(way.origin), from_world.transform_vector3(way.direction));
        let inverse = direction.recip();
        let (a, b) = (-origin * inverse, (Vec3::ONE - origin) * inverse);
        // Along an axis on which it does not move the way is inside all the time or never.
        let [mut start, mut end] = [0.0_f32, way.length];
        for axis in 0..3 {
            if direction[axis] == 0.0 {
                if !(0.0..=1.0).contains(&origin[axis]) {
                    return None;
                }
                continue;
            }
            start = start.max(a[axis].min(b[axis]));
            end = end.min(a[axis].max(b[axis]));
        }
        if !(start < end && end.is_finite()) {
            return None;
        }
        let size = Vec3::from_array(field.size.map(|n| n as f32));
        let at = (origin + start * direction) * size;
        let mut march = Self {
            origin,
            direction,
            t: start,
            end,
            cell: std::array::from_fn(|axis| (at[axis] as i32).clamp(0, field.size[axis] as i32 - 1)),
            next: Vec3::INFINITY,
            delta: (inverse / size).abs(),
        };
        for axis in 0..3 {
            if direction[axis] != 0.0 {
                let border = march.cell[axis] + i32::from(direction[axis] > 0.0);
                march.next[axis] = (border as f32 / size[axis] - origin[axis]) * inverse[axis];
            }
        }
        Some(march)
    }

    /// The next part of the way, and the cell it is in.
    fn next(&mut self, field: &Field) -> Option<(f32, f32, Cell)> {
        if self.t >= self.end {
            return None;
        }
        let [nx, ny, _] = field.size.map(|n| n as i32);
        let [x, y, z] = self.cell;
        let cell = *field.cells.get(((z * ny + y) * nx + x) as usize)?;
        let (from, axis) = (self.t, self.next.min_position());
        let to = self.next[axis].clamp(from, self.end);
        self.t = to;
        if to < self.end {
            self.cell[axis] += if self.direction[axis] > 0.0 { 1 } else { -1 };
            self.next[axis] += self.delta[axis];
            if !(0..field.size[axis] as i32).contains(&self.cell[axis]) {
                self.t = self.end;
            }
        }
        Some((from, to, cell))
    }

    /// The place in the unit cube after so far.
    fn place(&self, t: f32) -> Vec3 {
        self.origin + t * self.direction
    }
}

#[cfg(test)]
mod tests;
