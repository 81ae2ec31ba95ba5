//! The phase function of Henyey and Greenstein 1941, "Diffuse radiation in the Galaxy".

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3};

use crate::frame::Frame;

/// How a medium scatters: the density per steradian of the new direction. It is sampled perfectly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HenyeyGreenstein {
    /// Mean cosine between old and new direction.
    g: f32,
}

/// Below this magnitude the asymmetry is too small for the inverse of the distribution, and to matter.
const EVEN: f32 = 1e-3;

/// The asymmetry is kept this far from -1 and 1, where the density is no longer finite.
const SHARPEST: f32 = 0.9999;

impl HenyeyGreenstein {
    /// With the mean cosine `g` in -1..=1 between the directions light travels in before and after; above 0 it goes
    /// on forwards.
    pub fn new(g: f32) -> Self {
        Self { g: g.clamp(-SHARPEST, SHARPEST) }
    }

    /// The density of turning from direction `from` to `to`, both of unit length and in the sense of travel.
    #[inline]
    pub fn density(&self, from: Vec3, to: Vec3) -> f32 {
        let g = self.g;
        let denominator = 1.0 + g * g - 2.0 * g * from.dot(to);
        // (1 - |g|)^2 at least, but for rounding.
        let denominator = denominator.max((1.0 - g.abs()) * (1.0 - g.abs()));
        (1.0 - g * g) / (2.0 * TAU * denominator * denominator.sqrt())
    }

    /// A direction for light that travelled in direction `from`, and its density; the value of the phase function is
    /// the same number. For random numbers in `[0, 1)`.
    #[inline]
    pub fn sample(&self, from: Vec3, u: Vec2) -> (Vec3, f32) {
        let cosine = self.cosine(u.x);
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        let (sin, cos) = (2.0 * PI * u.y).sin_cos();
        let to = Frame::from_normal(from).to_world(Vec3::new(sine * cos, sine * sin, cosine)).normalize();
        (to, self.density(from, to))
    }

    /// The cosine with an axis of light that has turned, given that before and two random numbers in `[0, 1)`.
    pub(crate) fn turn(&self, before: f32, u: f32, azimuth: f32) -> f32 {
        let cosine = self.cosine(u);
        let sines = ((1.0 - before * before) * (1.0 - cosine * cosine)).max(0.0).sqrt();
        (before * cosine + sines * (2.0 * PI * azimuth).cos()).clamp(-1.0, 1.0)
    }

    /// The cosine of the angle by which light turns, for a random number in `[0, 1)`.
    #[inline(always)]
    fn cosine(&self, u: f32) -> f32 {
        let g = self.g;
        let cosine = if g.abs() < EVEN {
            // To first order: the density 1 / 2 (1 + 3 g c) of the cosine, inverted to the same order.
            let c = 1.0 - 2.0 * u;
            c + 1.5 * g * (1.0 - c * c)
        } else {
            let root = (1.0 - g * g) / (1.0 + g - 2.0 * g * u);
            (1.0 + g * g - root * root) / (2.0 * g)
        };
        cosine.clamp(-1.0, 1.0)
    }
}
