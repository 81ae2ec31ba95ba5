//! Glass: a GGX surface that reflects and refracts (Walter et al. 2007).

use glam::{Vec2, Vec3};

use super::{BsdfSample, fresnel, ggx::Ggx};

/// A GGX dielectric; +z points out of the medium.
#[derive(Clone, Copy, Debug)]
pub struct Dielectric {
    /// Index inside over outside.
    ior: f32,
    /// Multiplies what is transmitted.
    tint: Vec3,
    /// `None` where perfectly smooth.
    ggx: Option<Ggx>,
}

/// Below this product of `alpha` and `|ior - 1|`, which is about the width of the transmitted lobe, the surface
/// counts as smooth: the half vector of a refracted pair is the difference of two nearly equal vectors, and
/// their rounding (1e-7) must stay far below the lobe's width.
const MIN_REFRACTED_WIDTH: f32 = 1e-4;

impl Dielectric {
    /// With the index inside over outside, the distribution of its facets (`None` where it is smooth), and a factor
    /// on what is transmitted.
    #[inline]
    pub fn new(ior: f32, ggx: Option<Ggx>, tint: Vec3) -> Self {
        let least = Vec2::splat(MIN_REFRACTED_WIDTH / (ior - 1.0).abs());
        let ggx =
            ggx.filter(|g| g.alpha().max_element() >= least.x).and_then(|g| Ggx::new(g.alpha().max(least)));
        Self { ior, tint, ggx }
    }

    #[inline]
    pub(super) fn is_delta(&self) -> bool {
        self.ggx.is_none()
    }

    pub(super) fn albedo(&self) -> Vec3 {
        let (f, _) = fresnel::dielectric(1.0, self.ior);
        Vec3::splat(f) + (1.0 - f) * self.tint
    }

    /// Index on the far side of the surface over the one on `wo`'s side.
    #[inline]
    fn relative_eta(&self, wo: Vec3) -> f32 {
        if wo.z > 0.0 { self.ior } else { 1.0 / self.ior }
    }

    #[inline]
    pub(super) fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        let Some(ggx) = self.ggx else { return (Vec3::ZERO, 0.0) };
        if wo.z == 0.0 || wi.z == 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let eta = self.relative_eta(wo);
        let side = 1f32.copysign(wo.z);
        let (wo, wi) = (wo * side, wi * side);
        let reflected = wi.z > 0.0;
        // Walter 2007, equations 13 and 16.
        let h = if reflected { wo + wi } else { wo + eta * wi };
        let length = h.length();
        let h = h * (1f32.copysign(h.z) / length);
        let (cos_o, cos_i) = (wo.dot(h), wi.dot(h));
        // A facet seen from behind contributes nothing.
        if length == 0.0 || cos_o <= 0.0 || (cos_i > 0.0) != reflected {
            return (Vec3::ZERO, 0.0);
        }
        let (f, _) = fresnel::dielectric(cos_o, eta);
        let (g1, g2) = (ggx.g1(wo), ggx.g2(wo, wi));
        if reflected {
            let common = f * ggx.d(h) / (4.0 * wo.z);
            (Vec3::splat(common * g2), common * g1)
        } else {
            // Equations 17 and 21; `length` is their denominator's root.
            let jacobian = eta * eta * -cos_i / (length * length);
            let common = (1.0 - f) * ggx.d(h) * cos_o / wo.z * jacobian;
            (self.tint * (common * g2 / (eta * eta)), common * g1)
        }
    }

    #[inline]
    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z == 0.0 {
            return None;
        }
        let eta = self.relative_eta(wo);
        let side = 1f32.copysign(wo.z);
        let wo = wo * side;
        let h = self.ggx.map_or(Vec3::Z, |g| g.sample_visible(wo, u));
        let cos_o = wo.dot(h);
        if cos_o <= 0.0 {
            return None;
        }
        let (f, cos_t) = fresnel::dielectric(cos_o, eta);
        let transmission = u_lobe >= f;
        let wi = if transmission { (cos_o / eta - cos_t) * h - wo / eta } else { 2.0 * cos_o * h - wo };
        if (wi.z < 0.0) != transmission || wi.z == 0.0 {
            return None;
        }
        let (choice, color, eta) =
            if transmission { (1.0 - f, self.tint / (eta * eta), eta) } else { (f, Vec3::ONE, 1.0) };
        let delta = self.ggx.is_none();
        let (pdf, shadowing) = self.ggx.map_or((choice, 1.0), |ggx| {
            let g1 = ggx.g1(wo);
            let density = g1 * ggx.d(h) * cos_o / wo.z;
            let jacobian = if transmission {
                let sqrt_denominator = cos_o - eta * cos_t;
                eta * eta * cos_t / (sqrt_denominator * sqrt_denominator)
            } else {
                0.25 / cos_o
            };
            (choice * density * jacobian, ggx.g2(wo, wi) / g1)
        });
        // Underflows at directions within rounding of the horizon.
        if pdf <= 0.0 {
            return None;
        }
        let wi = wi.normalize() * side;
        Some(BsdfSample { wi, weight: color * shadowing, pdf, delta, transmission, eta })
    }
}
