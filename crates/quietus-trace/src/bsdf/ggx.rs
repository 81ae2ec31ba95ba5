//! The GGX microfacet distribution with Smith's masking and shadowing, isotropic.
//!
//! Walter et al. 2007 ("Microfacet Models for Refraction through Rough Surfaces"), Heitz 2014 ("Understanding the
//! Masking-Shadowing Function in Microfacet-Based BRDFs"); visible normals by Dupuy and Benyoub 2023 ("Sampling
//! Visible GGX Normals with Spherical Caps").

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use crate::warp::sin_cos_turns;

/// Below this `alpha` a surface counts as perfectly smooth. The lobe is then less than a tenth of a degree wide,
/// and the density at its peak, `1 / (pi alpha^2)`, beyond 3e5: rounding of directions to `f32` (1e-7) begins to
/// show in it, and light sampling has long stopped being of use.
pub const MIN_ALPHA: f32 = 1e-3;

/// A GGX distribution of microfacet normals.
#[derive(Clone, Copy, Debug)]
pub struct Ggx {
    /// Width: root-mean-square-like slope of the microsurface; at least [`MIN_ALPHA`].
    pub alpha: f32,
}

impl Ggx {
    /// The distribution for a perceptual roughness in 0..1 (`alpha = roughness^2`); `None` where it is smooth.
    #[inline]
    pub fn from_roughness(roughness: f32) -> Option<Self> {
        let alpha = roughness * roughness;
        (alpha >= MIN_ALPHA).then_some(Self { alpha: alpha.min(1.0) })
    }

    /// Density of microfacet normals `h`, `h.z >= 0` (Walter 2007, equation 33).
    #[inline]
    pub fn d(&self, h: Vec3) -> f32 {
        // x^2 + y^2 instead of 1 - z^2: keeps its digits near the pole, where narrow lobes live.
        let a2 = self.alpha * self.alpha;
        let s = (h.x * h.x + h.y * h.y) / a2 + h.z * h.z;
        FRAC_1_PI / (a2 * s * s)
    }

    /// Smith's Lambda (Heitz 2014, equation 72).
    #[inline]
    pub fn lambda(&self, w: Vec3) -> f32 {
        let tan2 = (w.x * w.x + w.y * w.y) / (w.z * w.z);
        // The same as (sqrt(1 + t) - 1) / 2 without its cancellation.
        let t = self.alpha * self.alpha * tan2;
        if t.is_finite() { 0.5 * t / (1.0 + (1.0 + t).sqrt()) } else { f32::MAX }
    }

    /// Share of the microsurface seen from `w` (Heitz 2014, equation 43).
    #[inline]
    pub fn g1(&self, w: Vec3) -> f32 {
        1.0 / (1.0 + self.lambda(w))
    }

    /// Height-correlated masking and shadowing (Heitz 2014, equation 99).
    #[inline]
    pub fn g2(&self, wo: Vec3, wi: Vec3) -> f32 {
        1.0 / (1.0 + self.lambda(wo) + self.lambda(wi))
    }

    /// A microfacet normal out of those visible from `wo`, `wo.z > 0`.
    #[inline]
    pub fn sample_visible(&self, wo: Vec3, u: Vec2) -> Vec3 {
        let stretched = Vec3::new(wo.x * self.alpha, wo.y * self.alpha, wo.z).normalize();
        let (sin_phi, cos_phi) = sin_cos_turns(u.x);
        let z = (1.0 - u.y) * (1.0 + stretched.z) - stretched.z;
        let radius = (1.0 - z * z).max(0.0).sqrt();
        let h = Vec3::new(radius * cos_phi, radius * sin_phi, z) + stretched;
        Vec3::new(h.x * self.alpha, h.y * self.alpha, h.z.max(0.0)).normalize_or(Vec3::Z)
    }

    /// Density per steradian of [`sample_visible`](Self::sample_visible) (Heitz 2014, equation 16).
    #[inline]
    pub fn pdf_visible(&self, wo: Vec3, h: Vec3) -> f32 {
        self.g1(wo) * wo.dot(h).max(0.0) * self.d(h) / wo.z
    }
}
