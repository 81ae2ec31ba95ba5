//! Metal: a GGX mirror with complex Fresnel reflectance.

use glam::{Vec2, Vec3};

use super::{BsdfSample, fresnel, ggx::Ggx};

/// A GGX conductor, the same from both sides.
#[derive(Clone, Copy, Debug)]
pub struct Conductor {
    eta: Vec3,
    k: Vec3,
    /// `None` where perfectly smooth.
    ggx: Option<Ggx>,
}

impl Conductor {
    /// With the complex index of refraction `eta + i k` and the distribution of its facets, `None` where it is
    /// smooth.
    #[inline]
    pub fn new(eta: Vec3, k: Vec3, ggx: Option<Ggx>) -> Self {
        Self { eta, k, ggx }
    }

    #[inline]
    pub(super) fn is_delta(&self) -> bool {
        self.ggx.is_none()
    }

    pub(super) fn albedo(&self) -> Vec3 {
        self.fresnel(1.0)
    }

    /// Reflectance of a facet at cosine `cos >= 0`.
    #[inline]
    pub(super) fn fresnel(&self, cos: f32) -> Vec3 {
        fresnel::conductor(cos, self.eta, self.k)
    }

    /// The widths of its facets along x and y; 0 where smooth.
    #[inline]
    pub(super) fn alpha(&self) -> Vec2 {
        self.ggx.map_or(Vec2::ZERO, |g| g.alpha())
    }

    #[inline]
    pub(super) fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        let Some(ggx) = self.ggx else { return (Vec3::ZERO, 0.0) };
        if wo.z * wi.z <= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let h = wo + wi;
        let h = h.normalize() * 1f32.copysign(h.z);
        let wo = if wo.z < 0.0 { -wo } else { wo };
        let wi = if wi.z < 0.0 { -wi } else { wi };
        // Twice flipped or not at all: h, wo and wi lie on +z's side.
        let common = ggx.d(h) / (4.0 * wo.z);
        let f = self.fresnel(wo.dot(h).abs());
        (f * (common * ggx.g2(wo, wi)), common * ggx.g1(wo))
    }

    #[inline]
    pub(super) fn sample(&self, wo: Vec3, u: Vec2) -> Option<BsdfSample> {
        if wo.z == 0.0 {
            return None;
        }
        let Some(ggx) = self.ggx else {
            let wi = Vec3::new(-wo.x, -wo.y, wo.z);
            let weight = self.fresnel(wo.z.abs());
            return Some(BsdfSample { wi, weight, pdf: 1.0, delta: true, transmission: false, eta: 1.0 });
        };
        let side = 1f32.copysign(wo.z);
        let wo = wo * side;
        let h = ggx.sample_visible(wo, u);
        let cos = wo.dot(h);
        let wi = 2.0 * cos * h - wo;
        if wi.z <= 0.0 {
            return None;
        }
        let pdf = ggx.g1(wo) * ggx.d(h) / (4.0 * wo.z);
        // Underflows at directions within rounding of the horizon.
        if pdf <= 0.0 {
            return None;
        }
        let weight = self.fresnel(cos.abs()) * (ggx.g2(wo, wi) / ggx.g1(wo));
        Some(BsdfSample::reflection(wi * side, weight, pdf))
    }
}
