//! A picture of all directions, and drawing directions from it.
//!
//! Look-ups interpolate between the centres of four texels: within such a patch radiance is bilinear. What directions are
//! drawn by is bilinear, too: how much brighter the texels are than the mean of all, times the sine that the layout asks
//! for. So the density of a direction is known from the four texels which say its radiance, and nothing else needs to be
//! read.
//!
//! What is darker than the mean is left to paths that scatter there by chance, which do that better: "MIS
//! Compensation" (Karlik, Sik, Vevoda, Skrivan and Krivanek 2019).

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::distribution::Cells;
use super::shared_exponent::SharedExponent;
use crate::desc::{EnvironmentLayout, Image};

/// Directions are drawn by what is this much above the mean: by so much more than 1 that rounding leaves nothing of a
/// map that is the same everywhere.
const ABOVE_MEAN: f32 = 1.0 + 1.0 / 1024.0;

/// A map of all directions, ready to be looked up and sampled.
#[derive(Debug)]
pub(super) struct Map {
    layout: EnvironmentLayout,
    /// Columns and rows.
    size: [i32; 2],
    /// Row by row.
    texels: Vec<SharedExponent>,
    /// Share of the sphere that belongs to a texel of each row, up to a factor: from row -1 to one beyond the last.
    sines: Vec<f32>,
    /// Weights of the channels in a luminance.
    luminance: Vec3,
    /// Directions are drawn by the luminance above this.
    floor: f32,
    /// Mean over the unit square of what directions are drawn by.
    mean: f32,
    /// The patches by what they weigh: one more column and row than texels, since the outer ones are halves. None for a
    /// map that is the same everywhere.
    patches: Option<Cells>,
}

/// Four texels next to each other and the place between them.
struct Patch {
    /// Two in the upper row, two in the lower.
    texels: [[Vec3; 2]; 2],
    /// Of both rows, see [`Map::sines`].
    sines: [f32; 2],
}

/// A direction in the map's space.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drawn {
    pub(super) direction: Vec3,
    pub(super) radiance: Vec3,
    /// Density per steradian.
    pub(super) pdf: f32,
}

impl Map {
    /// A map of `image`, which has the right number of texels, with these weights of its channels in a luminance.
    pub(super) fn new(image: &Image, layout: EnvironmentLayout, luminance: Vec3) -> Self {
        let (width, height) = (image.width as usize, image.height as usize);
        let mut texels = vec![SharedExponent::new(Vec3::ZERO); width * height];
        texels.par_chunks_exact_mut(width).enumerate().for_each(|(y, row)| {
            let y = y as u32;
            (0..).zip(row).for_each(|(x, texel)| *texel = SharedExponent::new(image.texel(x, y).truncate()));
        });
        let sine = |row: i32| match layout {
            // Below 0 beyond the poles, so that it is 0 at them.
            EnvironmentLayout::LatLong => {
                (std::f64::consts::PI * (f64::from(row) + 0.5) / height as f64).sin() as f32
            }
            EnvironmentLayout::EqualArea => 1.0,
        };
        let size = [width as i32, height as i32];
        let sines = (-1..=size[1]).map(sine).collect();
        let mut map = Self { layout, size, texels, sines, luminance, floor: 0.0, mean: 0.0, patches: None };
        let mean =
            |masses: &[f32]| masses.iter().map(|&m| f64::from(m)).sum::<f64>() / (width * height) as f64;
        map.mean = mean(&map.masses()) as f32;
        map.floor = ABOVE_MEAN * map.mean_weight();
        let masses = map.masses();
        map.mean = mean(&masses) as f32;
        map.patches = Cells::new(width + 1, &masses);
        map
    }

    /// What every patch weighs, in texels of weight 1.
    fn masses(&self) -> Vec<f32> {
        let columns = self.size[0] as usize + 1;
        let mut masses = vec![0.0; columns * (self.size[1] as usize + 1)];
        masses.par_chunks_exact_mut(columns).enumerate().for_each(|(y, row)| {
            let y = y as i32;
            for (x, mass) in (0..).zip(row) {
                let [[left, right], [top, bottom]] = [extent(x, self.size[0]), extent(y, self.size[1])];
                let middle = Vec2::new(left + right, top + bottom) / 2.0;
                *mass = (right - left) * (bottom - top) * self.patch(x, y).weight(middle, self);
            }
        });
        masses
    }

    /// Mean over the sphere of the luminance that directions are drawn by.
    pub(super) fn mean_weight(&self) -> f32 {
        let height = self.size[1];
        // As rows are weighed by masses.
        let sine = |row: i32| {
            let [top, bottom] = extent(row, height);
            let row = row as usize;
            (bottom - top) * lerp(self.sines[row], self.sines[row + 1], 0.5 * (top + bottom))
        };
        self.mean * height as f32 / (0..=height).map(sine).sum::<f32>()
    }

    /// RGB in a direction (of unit length) of the map's space.
    #[inline]
    pub(super) fn radiance(&self, direction: Vec3) -> Vec3 {
        let (patch, at) = self.at(direction);
        patch.radiance(at)
    }

    /// The same, and the density per steradian with which [`Self::sample`] draws the direction.
    #[inline]
    pub(super) fn radiance_pdf(&self, direction: Vec3) -> (Vec3, f32) {
        let (patch, at) = self.at(direction);
        (patch.radiance(at), self.pdf(&patch, at, self.layout.stretch(direction)))
    }

    /// A direction, in proportion to the luminance there, as far as it is above the mean; none from a map without such.
    #[inline]
    pub(super) fn sample(&self, u: Vec2) -> Option<Drawn> {
        let ([x, y], u) = self.patches.as_ref()?.sample(u);
        let patch = self.patch(x as i32, y as i32);
        let at = patch.sample(u, [extent(x as i32, self.size[0]), extent(y as i32, self.size[1])], self);
        let place = (Vec2::new(x as f32, y as f32) - 0.5 + at) / self.extents();
        let (direction, stretch) = self.layout.direction(place.clamp(Vec2::ZERO, Vec2::ONE));
        let pdf = self.pdf(&patch, at, stretch);
        (pdf > 0.0).then(|| Drawn { direction, radiance: patch.radiance(at), pdf })
    }

    #[inline]
    fn pdf(&self, patch: &Patch, at: Vec2, stretch: f32) -> f32 {
        // At the poles both are 0; in the dark the weight is.
        let weight = patch.weight(at, self);
        if weight > 0.0 && stretch > 0.0 { weight / (self.mean * stretch) } else { 0.0 }
    }

    /// The patch that holds a direction, and where in it.
    #[inline]
    fn at(&self, direction: Vec3) -> (Patch, Vec2) {
        let place = self.layout.place(direction) * self.extents() + 0.5;
        let corner = place.floor().min(self.extents());
        (self.patch(corner.x as i32, corner.y as i32), place - corner)
    }

    #[inline]
    fn extents(&self) -> Vec2 {
        Vec2::new(self.size[0] as f32, self.size[1] as f32)
    }

    /// The patch whose last texel is in column `x` and row `y`, one beyond the last at most.
    #[inline]
    fn patch(&self, x: i32, y: i32) -> Patch {
        let [width, height] = self.size;
        let sines = [self.sines[y as usize], self.sines[y as usize + 1]];
        let texels = if x > 0 && y > 0 && x < width && y < height {
            let lower = (y * width + x) as usize;
            let upper = lower - width as usize;
            let pair = |at: usize| [self.texels[at - 1].rgb(), self.texels[at].rgb()];
            [pair(upper), pair(lower)]
        } else {
            let pair = |y: i32| [self.beyond(x - 1, y), self.beyond(x, y)];
            [pair(y - 1), pair(y)]
        };
        Patch { texels, sines }
    }

    /// A texel that may lie beyond the border by one.
    #[cold]
    fn beyond(&self, x: i32, y: i32) -> Vec3 {
        let [x, y] = self.layout.wrap([x, y], self.size);
        self.texels[(y * self.size[0] + x) as usize].rgb()
    }
}

impl Patch {
    #[inline]
    fn radiance(&self, at: Vec2) -> Vec3 {
        let [upper, lower] = &self.texels;
        upper[0].lerp(upper[1], at.x).lerp(lower[0].lerp(lower[1], at.x), at.y)
    }

    /// What directions are drawn by: bilinear, too.
    #[inline]
    fn weight(&self, at: Vec2, map: &Map) -> f32 {
        let [upper, lower] = self.weights(map);
        lerp(lerp(upper[0], upper[1], at.x), lerp(lower[0], lower[1], at.x), at.y)
    }

    /// What the texels of both rows contribute to [`Self::weight`].
    #[inline]
    fn weights(&self, map: &Map) -> [[f32; 2]; 2] {
        let [upper, lower] = &self.texels;
        let weight = |texel: Vec3, sine: f32| (texel.dot(map.luminance) - map.floor).max(0.0) * sine;
        let [above, below] = self.sines;
        [
            [weight(upper[0], above), weight(upper[1], above)],
            [weight(lower[0], below), weight(lower[1], below)],
        ]
    }

    /// A place in the part of the patch between these columns and rows, in proportion to [`Self::weight`].
    #[inline]
    fn sample(&self, u: Vec2, [[left, right], [top, bottom]]: [[f32; 2]; 2], map: &Map) -> Vec2 {
        let [upper, lower] = self.weights(map);
        // The mean of a row is what it has in its middle.
        let middle = 0.5 * (left + right);
        let (first, last) = (lerp(upper[0], upper[1], middle), lerp(lower[0], lower[1], middle));
        let y = lerp(top, bottom, linear(u.y, lerp(first, last, top), lerp(first, last, bottom)));
        let (first, last) = (lerp(upper[0], lower[0], y), lerp(upper[1], lower[1], y));
        let x = lerp(left, right, linear(u.x, lerp(first, last, left), lerp(first, last, right)));
        Vec2::new(x, y)
    }
}

/// Which part of a patch is on the map, from 0 to 1: a half of the first and of the last.
#[inline]
fn extent(index: i32, last: i32) -> [f32; 2] {
    [if index == 0 { 0.5 } else { 0.0 }, if index == last { 0.5 } else { 1.0 }]
}

#[inline]
fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

/// A number in 0..=1 whose density runs linearly from `a` to `b` (Pharr, Jakob and Humphreys 2023, section A.4.1).
#[inline]
fn linear(u: f32, a: f32, b: f32) -> f32 {
    let [a, b] = [a.max(0.0), b.max(0.0)];
    if a + b <= 0.0 {
        return u;
    }
    (u * (a + b) / (a + lerp(a * a, b * b, u).sqrt())).min(1.0)
}
