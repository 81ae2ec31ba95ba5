//! Light from infinitely far away: a lat-long map, or the same radiance from everywhere.

use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use glam::{Mat3, Vec2, Vec3};
use rayon::prelude::*;

use super::distribution::PiecewiseConstant2d;
use super::{LightSample, luminance};
use crate::desc::{self, Image};
use crate::warp;

/// An environment with its way of being sampled: by luminance times the sine of the polar angle, texel by texel.
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
    /// None for a black map.
    density: Option<PiecewiseConstant2d>,
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
            let weights = compiled.weights(image);
            // The sines of the rows average 2 / pi over the map; undo that for the mean over directions.
            let mean = weights.iter().map(|&w| f64::from(w)).sum::<f64>() / weights.len() as f64;
            compiled.mean_luminance = (mean * std::f64::consts::FRAC_PI_2) as f32;
            let density = PiecewiseConstant2d::new(image.width as usize, &weights);
            compiled.map = Some(Map { image: image.clone(), density });
        }
        compiled
    }

    /// Luminance times sine for every texel.
    ///
    /// Look-ups interpolate, so a texel's cell also shows its neighbours: its mean is the (1, 6, 1)/8 filter of the
    /// texels in both axes. Without that a black texel beside a sun would never be chosen though it is bright.
    fn weights(&self, image: &Image) -> Vec<f32> {
        let (width, height) = (image.width as usize, image.height as usize);
        let value = |x: usize, y: usize| luminance(self.scale * image.texel(x as u32, y as u32).truncate());
        let tent = |before: f32, here: f32, after: f32| 0.125 * (before + 6.0 * here + after);
        let mut weights = vec![0.0; width * height];
        weights.par_chunks_exact_mut(width).enumerate().for_each(|(y, row)| {
            let sine = (PI * (y as f32 + 0.5) / height as f32).sin();
            let column = |x: usize| {
                let (above, below) = (y.saturating_sub(1), (y + 1).min(height - 1));
                sine * tent(value(x, above), value(x, y), value(x, below))
            };
            for (x, weight) in row.iter_mut().enumerate() {
                *weight = tent(column((x + width - 1) % width), column(x), column((x + 1) % width));
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
            Some(map) => self.scale * bilinear(&map.image, to_square(self.to_local * direction)),
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
        let (local, sine) = from_square(point);
        let direction = self.to_world * local;
        let radiance = self.scale * bilinear(&map.image, point);
        (sine > 0.0).then(|| LightSample::from_infinity(direction, radiance, density / (TAU * PI * sine)))
    }

    /// Density per steradian with which [`Self::sample`] chooses `direction`.
    #[inline]
    pub(crate) fn pdf(&self, direction: Vec3) -> f32 {
        let Some(map) = &self.map else { return 1.0 / (2.0 * TAU) };
        let Some(density) = &map.density else { return 0.0 };
        let local = self.to_local * direction;
        let sine = local.x.hypot(local.z);
        if sine > 0.0 { density.density(to_square(local)) / (TAU * PI * sine) } else { 0.0 }
    }
}

/// Place on the map of a direction in its space: row 0 is +y, the middle column -z, columns run towards +x.
#[inline]
fn to_square(direction: Vec3) -> Vec2 {
    // atan2 keeps its digits near the poles, where the arc cosine loses them.
    let polar = direction.x.hypot(direction.z).atan2(direction.y);
    let azimuth = direction.x.atan2(-direction.z);
    Vec2::new((0.5 + azimuth / TAU).clamp(0.0, 1.0), polar / PI)
}

/// Direction in the map's space of a place on it, and the sine of its polar angle.
#[inline]
fn from_square(point: Vec2) -> (Vec3, f32) {
    let (sine, cosine) = (PI * point.y).sin_cos();
    let (x, z) = (TAU * (point.x - 0.5)).sin_cos();
    (Vec3::new(sine * x, cosine, -sine * z), sine)
}

/// RGB at a place on the map: columns wrap around, rows end at the poles.
#[inline]
fn bilinear(image: &Image, point: Vec2) -> Vec3 {
    let (width, height) = (image.width as i32, image.height as i32);
    let place = point * Vec2::new(width as f32, height as f32) - 0.5;
    let corner = place.floor();
    let f = place - corner;
    let column = |x: i32| {
        (if x < 0 {
            x + width
        } else if x < width {
            x
        } else {
            x - width
        }) as u32
    };
    let row = |y: i32| y.clamp(0, height - 1) as u32;
    let (x, y) = (corner.x as i32, corner.y as i32);
    let blend = |y: u32| image.texel(column(x), y).lerp(image.texel(column(x + 1), y), f.x);
    blend(row(y)).lerp(blend(row(y + 1)), f.y).truncate()
}
