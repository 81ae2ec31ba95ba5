//! What media are made of from place to place.

use std::sync::Arc;

use glam::{Affine3A, Vec3};

/// Values at the middles of the cells of a unit cube, linear in between, and 0 from half a cell outside of it on.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid<T> {
    /// Cells along x, y and z, each at least 1.
    pub size: [u32; 3],
    /// One value per cell, x fastest, then y, then z; finite and at least 0.
    pub values: Vec<T>,
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
