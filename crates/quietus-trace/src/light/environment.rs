//! Light from infinitely far away: a map of all directions, or the same radiance from everywhere.
//!
//! Light sampling asks for what stands out in it. The rest, and so all of an even sky, is found by paths that
//! scatter to it: they know the cosine and the BSDF, and their ray is traced anyway.

use std::f32::consts::PI;

use glam::{Mat3, Vec2, Vec3};

use super::map::Map;
use super::portal::Portal;
use super::{LUMINANCE, LightSample, luminance};
use crate::desc;

/// An environment with its way of being sampled.
#[derive(Debug)]
pub(crate) struct Environment {
    scale: Vec3,
    to_world: Mat3,
    to_local: Mat3,
    map: Option<Map>,
    /// What alone lets its light in, if it is not seen from everywhere.
    portal: Option<Portal>,
}

impl desc::Environment {
    /// What it shows: the radiance that arrives from a direction of unit length in the world, where no portal hides it.
    ///
    /// # Panics
    /// If its image has not as many texels as its size says.
    pub fn view(&self) -> impl Fn(Vec3) -> Vec3 + Sync + use<> {
        let compiled = Environment::new(self);
        move |direction| compiled.light(direction)
    }
}

impl Environment {
    /// Compiles `environment`, whose rotation is orthonormal and whose image, if any, has the right length.
    pub(crate) fn new(environment: &desc::Environment) -> Self {
        let map = environment
            .image
            .as_ref()
            .map(|image| Map::new(image, environment.layout, environment.scale * LUMINANCE));
        let mut compiled = Self {
            scale: environment.scale,
            to_world: environment.to_world,
            to_local: environment.to_world.transpose(),
            map,
            portal: None,
        };
        compiled.portal = environment.portal.as_ref().map(|portal| {
            let detail = environment.image.as_ref().map_or(1, |image| image.height as usize);
            Portal::new(portal, detail, |direction| luminance(compiled.light(direction)))
        });
        compiled
    }

    /// Mean irradiance on a surface, over the ways it can face, by what [`Self::sample`] is for: what other lights are
    /// compared with. 0 where nothing stands out.
    pub(crate) fn mean_irradiance(&self) -> f32 {
        PI * match &self.portal {
            Some(portal) => portal.mean(),
            None => self.map.as_ref().map_or(0.0, Map::mean_weight),
        }
    }

    /// Radiance from `direction` where nothing hides it.
    #[inline]
    fn light(&self, direction: Vec3) -> Vec3 {
        self.map.as_ref().map_or(self.scale, |map| self.scale * map.radiance(self.to_local * direction))
    }

    /// Radiance that arrives at `from` from `direction` (unit length, away from the scene).
    #[inline]
    pub(crate) fn radiance(&self, from: Vec3, direction: Vec3) -> Vec3 {
        match &self.portal {
            Some(portal) if !portal.shows(from, direction) => Vec3::ZERO,
            _ => self.light(direction),
        }
    }

    /// The same, and the density per steradian with which [`Self::sample`] chooses `direction`.
    #[inline]
    pub(crate) fn radiance_pdf(&self, from: Vec3, direction: Vec3) -> (Vec3, f32) {
        if let Some(portal) = &self.portal {
            let pdf = portal.pdf(from, direction);
            return (if pdf > 0.0 { self.light(direction) } else { Vec3::ZERO }, pdf);
        }
        let Some(map) = &self.map else { return (self.scale, 0.0) };
        let (radiance, pdf) = map.radiance_pdf(self.to_local * direction);
        (self.scale * radiance, pdf)
    }

    /// A direction to where the sky, as it is seen from `from`, is brighter than on average, or anywhere through its
    /// portal; none for an even sky without one.
    #[inline]
    pub(crate) fn sample(&self, from: Vec3, u: Vec2) -> Option<LightSample> {
        if let Some(portal) = &self.portal {
            let (direction, pdf) = portal.sample(from, u)?;
            return Some(LightSample::from_infinity(direction, self.light(direction), pdf));
        }
        let drawn = self.map.as_ref()?.sample(u)?;
        let direction = self.to_world * drawn.direction;
        Some(LightSample::from_infinity(direction, self.scale * drawn.radiance, drawn.pdf))
    }
}
