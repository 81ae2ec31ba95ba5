//! Light from infinitely far away: a map of all directions, or the same radiance from everywhere.

use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use glam::{Mat3, Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::distribution::PiecewiseConstant2d;
use super::{LightSample, luminance};
use crate::desc::{self, EnvironmentLayout, Image};
use crate::warp;

/// An environment with its way of being sampled: by luminance times the solid angle of a texel, texel by texel.
#[derive(Debug)]
pub(crate) struct Environment {
    scale: Vec3,
    to_world: Mat3,
    to_local: Mat3,
    map: Option<Map>,
    /// Mean over all directions of the radiance's luminance.
    mean_luminance: f32,
}

#[derive(Debug)]
struct Map {
    image: Arc<Image>,
    layout: EnvironmentLayout,
    /// None for a black map.
    density: Option<PiecewiseConstant2d>,
}

impl desc::Environment {
    /// What it shows: the radiance that arrives from a direction of unit length in the world.
    ///
    /// # Panics
    /// If its image has not as many texels as its size says.
    pub fn view(&self) -> impl Fn(Vec3) -> Vec3 + Sync + use<> {
        let compiled = Environment::new(self);
        move |direction| compiled.radiance(direction)
    }
}

impl Environment {
    /// Compiles `environment`, whose rotation is orthonormal and whose image, if any, has the right length.
    pub(crate) fn new(environment: &desc::Environment) -> Self {
        let mut compiled = Self {
            scale: environment.scale,
            to_world: environment.to_world,
            to_local: environment.to_world.transpose(),
            map: None,
            mean_luminance: luminance(environment.scale),
        };
        if let Some(image) = &environment.image {
            let layout = environment.layout;
            let weights = compiled.weights(image, layout);
            let mean = weights.iter().map(|&w| f64::from(w)).sum::<f64>() / weights.len() as f64;
            compiled.mean_luminance = match layout {
                // The sines of the rows average 2 / pi over the map; undo that for the mean over directions.
                EnvironmentLayout::LatLong => (mean * std::f64::consts::FRAC_PI_2) as f32,
                EnvironmentLayout::EqualArea => mean as f32,
            };
            let density = PiecewiseConstant2d::new(image.width as usize, &weights);
            compiled.map = Some(Map { image: image.clone(), layout, density });
        }
        compiled
    }

    /// Luminance times a measure of the solid angle for every texel.
    ///
    /// Look-ups interpolate, so a texel's cell also shows its neighbours: its mean is the (1, 6, 1)/8 filter of the
    /// texels in both axes. Without that a black texel beside a sun would never be chosen though it is bright.
    fn weights(&self, image: &Image, layout: EnvironmentLayout) -> Vec<f32> {
        let (width, height) = (image.width as usize, image.height as usize);
        let value = |x: i32, y: i32| luminance(self.scale * texel(image, layout, x, y).truncate());
        let tent = |before: f32, here: f32, after: f32| 0.125 * (before + 6.0 * here + after);
        let mut weights = vec![0.0; width * height];
        weights.par_chunks_exact_mut(width).enumerate().for_each(|(y, row)| {
            let size = match layout {
                EnvironmentLayout::LatLong => (PI * (y as f32 + 0.5) / height as f32).sin(),
                EnvironmentLayout::EqualArea => 1.0,
            };
            let y = y as i32;
            let column = |x: i32| size * tent(value(x, y - 1), value(x, y), value(x, y + 1));
            for (x, weight) in (0..).zip(row) {
                *weight = tent(column(x - 1), column(x), column(x + 1));
            }
        });
        weights
    }

    /// Mean irradiance on a surface, over the ways it can face: what directional lights are compared with.
    pub(crate) fn mean_irradiance(&self) -> f32 {
        PI * self.mean_luminance
    }

    /// Radiance that arrives from `direction` (unit length, away from the scene).
    #[inline]
    pub(crate) fn radiance(&self, direction: Vec3) -> Vec3 {
        match &self.map {
            None => self.scale,
            Some(map) => self.scale * map.radiance(map.place(self.to_local * direction)),
        }
    }

    /// A direction to where the light comes from.
    #[inline]
    pub(crate) fn sample(&self, u: Vec2) -> Option<LightSample> {
        let Some(map) = &self.map else {
            let direction = self.to_world * warp::uniform_sphere(u);
            return Some(LightSample::from_infinity(direction, self.scale, 1.0 / (2.0 * TAU)));
        };
        let (point, density) = map.density.as_ref()?.sample(u);
        let (local, stretch) = map.direction(point);
        let radiance = self.scale * map.radiance(point);
        (stretch > 0.0)
            .then(|| LightSample::from_infinity(self.to_world * local, radiance, density / stretch))
    }

    /// Density per steradian with which [`Self::sample`] chooses `direction`.
    #[inline]
    pub(crate) fn pdf(&self, direction: Vec3) -> f32 {
        let Some(map) = &self.map else { return 1.0 / (2.0 * TAU) };
        let Some(density) = &map.density else { return 0.0 };
        let local = self.to_local * direction;
        let stretch = map.stretch(local);
        if stretch > 0.0 { density.density(map.place(local)) / stretch } else { 0.0 }
    }
}

impl Map {
    /// Place on the map of a direction in its space.
    #[inline]
    fn place(&self, direction: Vec3) -> Vec2 {
        match self.layout {
            EnvironmentLayout::LatLong => lat_long_place(direction),
            EnvironmentLayout::EqualArea => equal_area_place(direction),
        }
    }

    /// Direction in the map's space of a place on it, and the solid angle there per area of the unit square.
    #[inline]
    fn direction(&self, place: Vec2) -> (Vec3, f32) {
        match self.layout {
            EnvironmentLayout::LatLong => {
                let (direction, sine) = lat_long_direction(place);
                (direction, TAU * PI * sine)
            }
            EnvironmentLayout::EqualArea => (equal_area_direction(place), 2.0 * TAU),
        }
    }

    /// Solid angle per area of the unit square at a direction in the map's space.
    #[inline]
    fn stretch(&self, direction: Vec3) -> f32 {
        match self.layout {
            EnvironmentLayout::LatLong => TAU * PI * direction.x.hypot(direction.z),
            EnvironmentLayout::EqualArea => 2.0 * TAU,
        }
    }

    /// RGB at a place, between texels.
    #[inline]
    fn radiance(&self, place: Vec2) -> Vec3 {
        let place = place * Vec2::new(self.image.width as f32, self.image.height as f32) - 0.5;
        let corner = place.floor();
        let f = place - corner;
        let (x, y) = (corner.x as i32, corner.y as i32);
        let at = |x: i32, y: i32| texel(&self.image, self.layout, x, y);
        let blend = |y: i32| at(x, y).lerp(at(x + 1, y), f.x);
        blend(y).lerp(blend(y + 1), f.y).truncate()
    }
}

/// Place on the map of a direction in its space: row 0 is +y, the middle column -z, columns run towards +x.
#[inline]
fn lat_long_place(direction: Vec3) -> Vec2 {
    // atan2 keeps its digits near the poles, where the arc cosine loses them.
    let polar = direction.x.hypot(direction.z).atan2(direction.y);
    let azimuth = direction.x.atan2(-direction.z);
    Vec2::new((0.5 + azimuth / TAU).clamp(0.0, 1.0), polar / PI)
}

/// Direction in the map's space of a place on it, and the sine of its polar angle.
#[inline]
fn lat_long_direction(point: Vec2) -> (Vec3, f32) {
    let (sine, cosine) = (PI * point.y).sin_cos();
    let (x, z) = (TAU * (point.x - 0.5)).sin_cos();
    (Vec3::new(sine * x, cosine, -sine * z), sine)
}

/// Place in the unit square of a direction: Clarberg 2008, "Fast Equal-Area Mapping of the (Hemi)Sphere using SIMD".
///
/// The octahedron |x| + |y| + |z| = 1 unfolded around +z, with radii stretched so that areas stay equal.
#[inline]
pub(super) fn equal_area_place(direction: Vec3) -> Vec2 {
    let [x, y] = [direction.x.abs(), direction.y.abs()];
    // sqrt(1 - |z|), without cancellation near the poles.
    let planar2 = x * x + y * y;
    let radius = (planar2 / (1.0 + direction.z.abs())).sqrt().min(1.0);
    let turn = y.atan2(x) * (2.0 / PI);
    let (mut u, mut v) = (radius - turn * radius, turn * radius);
    if direction.z < 0.0 {
        (u, v) = (1.0 - v, 1.0 - u);
    }
    let signed = Vec2::new(u.copysign(direction.x), v.copysign(direction.y));
    ((signed + 1.0) * 0.5).clamp(Vec2::ZERO, Vec2::ONE)
}

/// The inverse of [`equal_area_place`].
#[inline]
fn equal_area_direction(place: Vec2) -> Vec3 {
    let signed = 2.0 * place - 1.0;
    let [u, v] = [signed.x.abs(), signed.y.abs()];
    let from_edge = 1.0 - (u + v);
    let radius = 1.0 - from_edge.abs();
    let turn = if radius > 0.0 { (v - u) / radius + 1.0 } else { 1.0 };
    let (sin, cos) = (turn * (PI / 4.0)).sin_cos();
    let z = (1.0 - radius * radius).copysign(from_edge);
    let planar = radius * (2.0 - radius * radius).max(0.0).sqrt();
    Vec3::new((planar * cos).copysign(signed.x), (planar * sin).copysign(signed.y), z)
}

/// The texel in column `x` and row `y`, which may lie beyond the border by less than the map's size: there the map
/// goes on with what is next to it on the sphere.
#[inline]
fn texel(image: &Image, layout: EnvironmentLayout, x: i32, y: i32) -> Vec4 {
    let (width, height) = (image.width as i32, image.height as i32);
    let (x, y) = match layout {
        // Columns wrap around, rows end at the poles.
        EnvironmentLayout::LatLong => {
            let x = if x < 0 { x + width } else { x };
            (if x < width { x } else { x - width }, y.clamp(0, height - 1))
        }
        // Every edge is folded onto itself around its middle.
        EnvironmentLayout::EqualArea => {
            let (x, y) = if x < 0 || x >= width { (x.clamp(0, width - 1), height - 1 - y) } else { (x, y) };
            if y < 0 || y >= height { (width - 1 - x, y.clamp(0, height - 1)) } else { (x, y) }
        }
    };
    image.texel(x as u32, y as u32)
}
