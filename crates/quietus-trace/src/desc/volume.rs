//! What media are made of from place to place.

use std::sync::Arc;

use glam::{Affine3A, Vec3};

/// Values at the middles of the cells of a unit cube, linear in between, and 0 from half a cell outside of it on.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid<T> {
    /// Cells along x, y and z, each at least 1.
    pub size: [u32; 3],
    /// One value per cell, x fastest, then y, then z; finite and at least 0. Where there are bricks, so for each brick,
    /// one after the other.
    pub values: Vec<T>,
    /// Where much of it is empty: for each block of [`BRICK`](Self::BRICK) cells along each axis, in the same order, which
    /// of the bricks in `values` it is, or [`NOTHING`](Self::NOTHING) where all of it is 0. Blocks may share bricks.
    pub bricks: Option<Vec<u32>>,
}

impl<T> Grid<T> {
    /// Cells of a brick along each axis.
    pub const BRICK: u32 = 8;
    /// Cells of a brick.
    pub const BRICK_CELLS: usize = (Self::BRICK * Self::BRICK * Self::BRICK) as usize;
    /// Stands for "all 0" in `bricks`.
    pub const NOTHING: u32 = u32::MAX;

    /// One value for every cell.
    pub fn dense(size: [u32; 3], values: Vec<T>) -> Self {
        Self { size, values, bricks: None }
    }

    /// How many blocks there are along each axis.
    pub fn blocks(&self) -> [u32; 3] {
        self.size.map(|n| n.div_ceil(Self::BRICK))
    }
}

/// How a [`Medium`](super::Medium) differs from place to place, in a box; outside of it there is nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct Variation {
    /// From the world to the unit cube that is the box.
    pub from_world: Affine3A,
    /// What multiplies its coefficients.
    pub density: Density,
    /// What multiplies its emission; 1 where absent.
    pub glow: Option<Glow>,
}

/// What multiplies a medium's absorption and scattering.
#[derive(Clone, Debug, PartialEq)]
pub enum Density {
    /// A number for both.
    Grid(Grid<f32>),
    /// Colours for each; 1 where there is no grid.
    Colors {
        /// For the absorption.
        absorption: Option<Grid<Vec3>>,
        /// For the scattering.
        scattering: Option<Grid<Vec3>>,
    },
    /// The cloud that pbrt-v4 makes of noise, in a space of its own where it lies between y = 0 and y = 1.
    Cloud {
        /// How dense it is before it is limited to 1.
        density: f32,
        /// How much it is frayed.
        wispiness: f32,
        /// How fine it is.
        frequency: f32,
        /// From the unit cube to that space.
        to_cloud: Affine3A,
    },
}

/// What multiplies a medium's emission.
#[derive(Clone, Debug, PartialEq)]
pub enum Glow {
    /// A number.
    Grid(Grid<f32>),
    /// A colour.
    Colors(Grid<Vec3>),
    /// The colour that belongs to a temperature.
    Heat {
        /// Temperatures, in any unit.
        temperature: Grid<f32>,
        /// Multiplies the colours where present.
        scale: Option<Grid<f32>>,
        /// The colours of evenly spaced temperatures from 0 to `hottest`, at least 2.
        colors: Arc<[Vec3]>,
        /// The temperature of the last colour, above 0; hotter places look alike.
        hottest: f32,
    },
}
