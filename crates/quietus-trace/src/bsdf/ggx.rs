//! The GGX microfacet distribution with Smith's masking and shadowing.
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

/// A GGX distribution of microfacet normals, anisotropic along the axes of the local frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ggx {
    /// Width along x and along y: root-mean-square-like slopes of the microsurface, in [`MIN_ALPHA`]..1.
    alpha: Vec2,
}

impl Ggx {
    /// The distribution of the given widths along x and y; `None` where both count as smooth. One alone that does is
    /// widened to [`MIN_ALPHA`].
    #[inline]
    pub fn new(alpha: Vec2) -> Option<Self> {
        (alpha.max_element() >= MIN_ALPHA)
            .then(|| Self { alpha: alpha.clamp(Vec2::splat(MIN_ALPHA), Vec2::ONE) })
    }

    /// The isotropic distribution for a perceptual roughness in 0..1 (`alpha = roughness^2`); `None` where it is
    /// smooth.
    #[inline]
    pub fn from_roughness(roughness: f32) -> Option<Self> {
        Self::new(Vec2::splat(roughness * roughness))
    }

    /// The widths along x and y.
    #[inline]
    pub fn alpha(&self) -> Vec2 {
        self.alpha
    }

    /// Density of microfacet normals `h`, `h.z >= 0` (Walter 2007, equation 33; Heitz 2014, equation 85).
    #[inline]
    pub fn d(&self, h: Vec3) -> f32 {
        // x^2 + y^2 instead of 1 - z^2: keeps its digits near the pole, where narrow lobes live.
        let s = (h.truncate() / self.alpha).length_squared() + h.z * h.z;
        FRAC_1_PI / (self.alpha.x * self.alpha.y * s * s)
    }

    /// Smith's Lambda (Heitz 2014, equations 72 and 86).
    #[inline]
    pub fn lambda(&self, w: Vec3) -> f32 {
        let t = (w.truncate() * self.alpha).length_squared() / (w.z * w.z);
        // The same as (sqrt(1 + t) - 1) / 2 without its cancellation.
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
        let stretched = (wo.truncate() * self.alpha).extend(wo.z).normalize();
        let (sin_phi, cos_phi) = sin_cos_turns(u.x);
        let z = (1.0 - u.y) * (1.0 + stretched.z) - stretched.z;
        let radius = (1.0 - z * z).max(0.0).sqrt();
        let h = Vec3::new(radius * cos_phi, radius * sin_phi, z) + stretched;
        (h.truncate() * self.alpha).extend(h.z.max(0.0)).normalize_or(Vec3::Z)
    }

    /// Density per steradian of [`sample_visible`](Self::sample_visible) (Heitz 2014, equation 16).
    #[inline]
    pub fn pdf_visible(&self, wo: Vec3, h: Vec3) -> f32 {
        self.g1(wo) * wo.dot(h).max(0.0) * self.d(h) / wo.z
    }
}
