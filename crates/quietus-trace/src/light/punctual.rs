//! Lights without extent: point, spot, directional, and pictures. Only next-event estimation can find them.

use glam::Vec3;

use super::bounds::LightBounds;
use super::picture::PictureLight;
use super::{LightSample, luminance};
use crate::bvh::Bounds;
use crate::desc::{self, SpotFalloff};

/// Widens a spot's bounds, in radians: more than cosines are rounded by.
const SPOT_MARGIN: f32 = 1e-3;

/// A light without extent, ready to be sampled.
#[derive(Clone, Debug)]
pub(crate) enum PunctualLight {
    Point {
        position: Vec3,
        intensity: Vec3,
    },
    Spot {
        position: Vec3,
        direction: Vec3,
        intensity: Vec3,
        cos_outer: f32,
        inverse_range: f32,
        falloff: SpotFalloff,
    },
    Directional {
        to_light: Vec3,
        irradiance: Vec3,
    },
    Picture(Box<PictureLight>),
}

impl PunctualLight {
    /// Compiles a light whose numbers have been checked.
    pub(crate) fn new(light: &desc::Light) -> Self {
        match *light {
            desc::Light::Point { position, intensity } => Self::Point { position, intensity },
            desc::Light::Spot { position, direction, intensity, inner_angle, outer_angle, falloff } => {
                Self::Spot {
                    position,
                    direction,
                    intensity,
                    cos_outer: outer_angle.cos(),
                    // The lower bound is KHR_lights_punctual's own, for cones without a soft edge.
                    inverse_range: 1.0 / (inner_angle.cos() - outer_angle.cos()).max(1e-3),
                    falloff,
                }
            }
            desc::Light::Directional { direction, irradiance } => {
                Self::Directional { to_light: -direction, irradiance }
            }
            desc::Light::Picture { position, from_world, intensity, ref image, spread } => {
                Self::Picture(Box::new(PictureLight::new(position, from_world, intensity, image, spread)))
            }
        }
    }

    /// Whether it shines from infinitely far away.
    pub(crate) fn is_infinite(&self) -> bool {
        matches!(self, Self::Directional { .. })
    }

    /// Luminance of the power it sends out; of the irradiance for a directional light.
    pub(crate) fn power(&self) -> f32 {
        use std::f32::consts::TAU;
        match *self {
            Self::Point { intensity, .. } => 2.0 * TAU * luminance(intensity),
            Self::Spot { intensity, cos_outer, inverse_range, falloff, .. } => {
                // Mean of what is missing over the soft edge.
                let missing = match falloff {
                    SpotFalloff::Square => 2.0 / 3.0,
                    SpotFalloff::Smooth => 0.5,
                };
                TAU * luminance(intensity) * (1.0 - cos_outer - missing / inverse_range).max(0.0)
            }
            Self::Directional { irradiance, .. } => luminance(irradiance),
            Self::Picture(ref picture) => picture.power,
        }
    }

    /// Where it stands and shines to; not for directional lights.
    pub(super) fn bounds(&self) -> LightBounds {
        let power = self.power();
        match *self {
            Self::Spot { position, direction, cos_outer, .. } => {
                let bounds = Bounds { min: position, max: position };
                // All of the cone as if it were even: what the light sends must never be thought impossible.
                LightBounds {
                    axis: direction,
                    theta_o: cos_outer.acos(),
                    theta_e: SPOT_MARGIN,
                    ..LightBounds::omnidirectional(bounds, power)
                }
            }
            Self::Point { position, .. } | Self::Directional { to_light: position, .. } => {
                LightBounds::omnidirectional(Bounds { min: position, max: position }, power)
            }
            Self::Picture(ref picture) => picture.bounds(),
        }
    }

    /// The direction to the light and the irradiance it causes on a surface that faces it.
    #[inline]
    pub(crate) fn sample(&self, from: Vec3) -> Option<LightSample> {
        let (position, intensity) = match *self {
            Self::Directional { to_light, irradiance } => {
                return Some(LightSample {
                    delta: true,
                    ..LightSample::from_infinity(to_light, irradiance, 1.0)
                });
            }
            Self::Point { position, intensity } => (position, intensity),
            Self::Spot { position, direction, intensity, cos_outer, inverse_range, falloff } => {
                let cosine = (from - position).normalize_or_zero().dot(direction);
                let ramp = ((cosine - cos_outer) * inverse_range).clamp(0.0, 1.0);
                let share = match falloff {
                    SpotFalloff::Square => ramp * ramp,
                    SpotFalloff::Smooth => ramp * ramp * (3.0 - 2.0 * ramp),
                };
                (position, intensity * share)
            }
            Self::Picture(ref picture) => (picture.position, picture.intensity(from - picture.position)),
        };
        let to_light = position - from;
        let distance2 = to_light.length_squared();
        (distance2 > 0.0 && intensity != Vec3::ZERO).then(|| LightSample {
            direction: to_light / distance2.sqrt(),
            target: Some(super::Target { position, error: Vec3::ZERO, normal: Vec3::ZERO }),
            radiance: intensity / distance2,
            pdf: 1.0,
            delta: true,
        })
    }
}
