//! Lights without extent: point, spot and directional. Only next-event estimation can find them.

use glam::Vec3;

use super::{LightSample, luminance};
use crate::desc;

/// A light without extent, ready to be sampled.
#[derive(Clone, Copy, Debug)]
pub(crate) enum PunctualLight {
    Point { position: Vec3, intensity: Vec3 },
    Spot { position: Vec3, direction: Vec3, intensity: Vec3, cos_outer: f32, inverse_range: f32 },
    Directional { to_light: Vec3, irradiance: Vec3 },
}

impl PunctualLight {
    /// Compiles a light whose numbers have been checked.
    pub(crate) fn new(light: &desc::Light) -> Self {
        match *light {
            desc::Light::Point { position, intensity } => Self::Point { position, intensity },
            desc::Light::Spot { position, direction, intensity, inner_angle, outer_angle, .. } => {
                Self::Spot {
                    position,
                    direction,
                    intensity,
                    cos_outer: outer_angle.cos(),
                    // The lower bound is KHR_lights_punctual's own, for cones without a soft edge.
                    inverse_range: 1.0 / (inner_angle.cos() - outer_angle.cos()).max(1e-3),
                }
            }
            desc::Light::Directional { direction, irradiance } => {
                Self::Directional { to_light: -direction, irradiance }
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
            Self::Spot { intensity, cos_outer, inverse_range, .. } => {
                // The square of a ramp from 0 to 1 over the soft edge has the mean 1/3.
                let edge = 1.0 / inverse_range;
                TAU * luminance(intensity) * (1.0 - cos_outer - edge * (2.0 / 3.0)).max(0.0)
            }
            Self::Directional { irradiance, .. } => luminance(irradiance),
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
            Self::Spot { position, direction, intensity, cos_outer, inverse_range } => {
                let cosine = (from - position).normalize_or_zero().dot(direction);
                let ramp = ((cosine - cos_outer) * inverse_range).clamp(0.0, 1.0);
                (position, intensity * (ramp * ramp))
            }
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
