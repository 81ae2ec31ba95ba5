//! A diffuse base under a dielectric coat, in closed form.
//!
//! A Lambertian base forgets where light came from. So what enters at `wo`, comes back from the base `n + 1` times and
//! leaves towards `wi` is a product: `passed(wo) / eta^2 * rho (rho returned)^n / pi * passed(wi)`. The sum over `n` is
//! geometric. The only thing left to know is how much the coat lets pass at an angle and how much it throws back,
//! which is tabulated once for each material; for a smooth coat even the former is a formula.

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use super::{CoatTable, bounces, coat_table::Passage};
use crate::{
    bsdf::{BsdfSample, Dielectric, fresnel},
    warp,
};

/// A diffuse base under a coat, without scattering between them; the same from both sides.
#[derive(Clone, Copy, Debug)]
pub struct CoatedDiffuse<'a> {
    coat: Dielectric,
    passage: Passage<'a>,
    /// The base seen through the coat, but for the passage of either direction: times that of both it is the BRDF times
    /// pi.
    base: Vec3,
}

impl<'a> CoatedDiffuse<'a> {
    /// From the coat, its table, the albedo of the base, and the number of passages of the medium after which light is
    /// given up.
    #[inline]
    pub fn new(coat: Dielectric, table: &'a CoatTable, reflectance: Vec3, max_depth: u32) -> Self {
        let passage = table.passage(&coat);
        let compression = 1.0 / (coat.ior() * coat.ior());
        let base = reflectance * bounces(reflectance * passage.returned, max_depth) * compression;
        Self { coat, passage, base }
    }

    /// Near enough: what enters is `1 - f` of the light, of which a share returns.
    pub(crate) fn albedo(&self) -> Vec3 {
        let (f, _) = fresnel::dielectric(1.0, self.coat.ior());
        f + self.diffuse(self.passage.passed(1.0))
    }

    /// Albedo of the base at an angle with the given passage. Diffuse light passes outwards what the coat does not throw
    /// back, and is widened by the square of the index as it does.
    #[inline]
    fn diffuse(&self, passed: f32) -> Vec3 {
        let ior2 = self.coat.ior() * self.coat.ior();
        self.base * (passed * ior2 * (1.0 - self.passage.returned))
    }

    /// Probability of the coat's reflection.
    #[inline]
    fn choice(&self, cos: f32, passed: f32) -> f32 {
        let (f, _) = fresnel::dielectric(cos, self.coat.ior());
        let diffuse = self.diffuse(passed).max_element();
        if f + diffuse > 0.0 { f / (f + diffuse) } else { 1.0 }
    }

    #[inline]
    pub(crate) fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        if wo.z * wi.z <= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let side = 1f32.copysign(wo.z);
        let passed = self.passage.passed(wo.z.abs());
        self.eval_pdf_with(self.choice(wo.z.abs(), passed), passed, wo * side, wi * side)
    }

    /// Both directions on +z's side.
    #[inline]
    fn eval_pdf_with(&self, p_coat: f32, passed: f32, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        let cosine = wi.z * FRAC_1_PI;
        let diffuse = self.base * (passed * self.passage.passed(wi.z) * cosine);
        let (reflected, coat_pdf) = self.coat.eval_part(wo, wi);
        (diffuse + reflected, p_coat * coat_pdf + (1.0 - p_coat) * cosine)
    }

    #[inline]
    pub(crate) fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z == 0.0 {
            return None;
        }
        let side = 1f32.copysign(wo.z);
        let wo = wo * side;
        let passed = self.passage.passed(wo.z);
        let p_coat = self.choice(wo.z, passed);
        let wi = if u_lobe < p_coat {
            let (wi, share, _) = self.coat.sample_part(wo, false, u)?;
            if self.coat.is_delta() {
                let sample = BsdfSample::reflection(wi * side, Vec3::splat(share / p_coat), p_coat);
                return Some(BsdfSample { delta: true, ..sample });
            }
            wi
        } else {
            warp::cosine_hemisphere(u)
        };
        if wi.z <= 0.0 {
            return None;
        }
        let (value, pdf) = self.eval_pdf_with(p_coat, passed, wo, wi);
        (pdf > 0.0).then(|| BsdfSample::reflection(wi * side, value / pdf, pdf))
    }
}
