//! A base under a dielectric coat with a medium between, after pbrt-v4's coated materials.
//!
//! Light that enters the coat scatters between base and coat (and in the medium, where there is one) until it leaves or
//! has done so [`LayeredParams::max_depth`] times. Nothing moves sideways: it leaves where it came in.
//!
//! Over a diffuse base without scattering in the medium that has a closed form, [`CoatedDiffuse`]. All else,
//! [`Layered`], is a random walk from `wo` that is connected to `wi` wherever it can be (Guo, Hasan and Zhao 2018,
//! "Position-Free Monte Carlo Simulation for Arbitrary Layered BSDFs"): its value is an unbiased random estimate. The
//! walk's random numbers are hashed from both directions and a key of the path, so that the value of a pair of
//! directions does not depend on who asks or how often. Directions are drawn from a mixture of lobes with a density of
//! their own, which is therefore exact: multiple importance sampling stays right, and so do weights on average.

pub(super) mod coat_table;
mod coated_diffuse;
mod walk;

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

pub use coat_table::CoatTable;
pub use coated_diffuse::CoatedDiffuse;

use super::{BsdfSample, Conductor, Dielectric, Diffuse, fresnel, ggx::Ggx};
use crate::warp;

/// A coat, its base, and what lies between, at one point.
#[derive(Clone, Copy, Debug)]
pub struct LayeredParams {
    /// The coat; +z points out of it.
    pub coat: Dielectric,
    /// What it covers, seen from inside the coat.
    pub base: Base,
    /// Depth of the medium between, in mean free paths, at least 0.
    pub thickness: f32,
    /// Single-scattering albedo of that medium, in 0..1.
    pub albedo: Vec3,
    /// Its Henyey-Greenstein asymmetry, between -1 and 1.
    pub g: f32,
    /// How many times light that has entered may pass the medium or scatter in it.
    pub max_depth: u32,
    /// Seeds the random walks: different for different paths.
    pub key: u64,
}

/// What lies below a coat.
#[derive(Clone, Copy, Debug)]
pub enum Base {
    /// Lambert.
    Diffuse(Diffuse),
    /// GGX metal.
    Conductor(Conductor),
}

/// A coated surface, the same from both sides, evaluated by random walks.
#[derive(Clone, Copy, Debug)]
pub struct Layered {
    p: LayeredParams,
    /// The lobe of the base as it is seen from outside: a guess that directions are drawn from.
    seen_base: Option<Ggx>,
}

/// The parts that directions are drawn from, each by its own strategy.
#[derive(Clone, Copy, PartialEq)]
enum Lobe {
    /// Reflection by the coat.
    Coat,
    /// The base's highlight seen through the coat.
    Base,
    /// All that has lost its direction.
    Cosine,
}

const LOBES: [Lobe; 3] = [Lobe::Coat, Lobe::Base, Lobe::Cosine];

impl Base {
    #[inline]
    fn is_delta(&self) -> bool {
        matches!(self, Self::Conductor(c) if c.is_delta())
    }

    #[inline]
    fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        match self {
            Self::Diffuse(b) => b.eval_pdf(wo, wi),
            Self::Conductor(b) => b.eval_pdf(wo, wi),
        }
    }

    #[inline]
    fn sample(&self, wo: Vec3, u: Vec2) -> Option<BsdfSample> {
        match self {
            Self::Diffuse(b) => b.sample(wo, u),
            Self::Conductor(b) => b.sample(wo, u),
        }
    }

    /// About how much it reflects at cosine `cos`.
    #[inline]
    fn reflectance(&self, cos: f32) -> Vec3 {
        match self {
            Self::Diffuse(b) => b.reflectance,
            Self::Conductor(b) => b.fresnel(cos),
        }
    }
}

impl Layered {
    /// From the parameters at a point.
    pub fn new(p: LayeredParams) -> Self {
        let seen_base = match p.base {
            Base::Conductor(base) if !(p.coat.is_delta() && base.is_delta()) => {
                Ggx::new(seen_alpha(&p.coat, &base).max(Vec2::splat(super::ggx::MIN_ALPHA)))
            }
            _ => None,
        };
        Self { p, seen_base }
    }

    #[inline]
    fn scatters_between(&self) -> bool {
        self.p.albedo != Vec3::ZERO
    }

    pub(super) fn is_delta(&self) -> bool {
        self.p.coat.is_delta() && self.p.base.is_delta() && !self.scatters_between()
    }

    /// Reflectance at normal incidence, as if the base were all there is below the coat.
    pub(super) fn albedo(&self) -> Vec3 {
        let (f, _) = fresnel::dielectric(1.0, self.p.coat.ior());
        let base = self.p.base.reflectance(1.0);
        f + (1.0 - f) * (1.0 - f) * base / (1.0 - f * base)
    }

    /// Probability of each lobe, in [`Lobe`]'s order: about what it reflects. Not for `wo` at the horizon.
    fn choice(&self, wo: Vec3) -> [f32; 3] {
        let (f, cos_t) = fresnel::dielectric(wo.z.abs(), self.p.coat.ior());
        let through = 1.0 - f;
        let below = through * self.p.base.reflectance(cos_t).max_element();
        let lost_direction = match self.p.base {
            Base::Diffuse(_) => 1.0,
            // What the coat throws back, and the wide tails of a rough base.
            Base::Conductor(b) => 0.1 + 0.4 * b.alpha().max_element(),
        };
        let medium = through * self.p.albedo.max_element() * (1.0 - (-2.0 * self.p.thickness / cos_t).exp());
        let delta_base = self.p.coat.is_delta() && self.p.base.is_delta();
        let weights = if delta_base {
            // The coat's lobe stands for the base's, which is the same direction.
            [f + below, 0.0, medium]
        } else {
            [f, below * (1.0 - lost_direction), below * lost_direction + medium]
        };
        let sum: f32 = weights.iter().sum();
        weights.map(|w| w / sum.max(f32::MIN_POSITIVE))
    }

    /// Not inlined: it is long, and rare beside the plain models.
    #[inline(never)]
    pub(super) fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        if wo.z * wi.z <= 0.0 || self.is_delta() {
            return (Vec3::ZERO, 0.0);
        }
        let side = 1f32.copysign(wo.z);
        self.eval_pdf_with(self.choice(wo), wo * side, wi * side)
    }

    /// Both directions on +z's side.
    fn eval_pdf_with(&self, [p_coat, p_base, p_cosine]: [f32; 3], wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        let (reflected, coat_pdf) = self.p.coat.eval_part(wo, wi);
        let base_pdf = self.seen_base.map_or(0.0, |ggx| reflection_pdf(ggx, wo, wi));
        let pdf = p_coat * coat_pdf + p_base * base_pdf + p_cosine * wi.z * FRAC_1_PI;
        (reflected + walk::estimate(&self.p, wo, wi), pdf)
    }

    #[inline(never)]
    pub(super) fn sample(&self, wo: Vec3, mut u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z == 0.0 {
            return None;
        }
        let side = 1f32.copysign(wo.z);
        let choice = self.choice(wo);
        let wo = wo * side;
        let mut lobe = Lobe::Cosine;
        for (candidate, p) in LOBES.into_iter().zip(choice) {
            if p > 0.0 {
                lobe = candidate;
                if u_lobe < p {
                    break;
                }
                u_lobe -= p;
            }
        }
        let wi = match (lobe, self.seen_base) {
            (Lobe::Coat, _) if self.p.coat.is_delta() => return self.mirrored(wo, choice[0], side),
            (Lobe::Coat, _) => self.p.coat.sample_part(wo, false, u)?.0,
            (Lobe::Base, Some(ggx)) => {
                let h = ggx.sample_visible(wo, u);
                (2.0 * wo.dot(h) * h - wo).normalize()
            }
            _ => warp::cosine_hemisphere(u),
        };
        if wi.z <= 0.0 {
            return None;
        }
        let (value, pdf) = self.eval_pdf_with(choice, wo, wi);
        (pdf > 0.0).then(|| BsdfSample::reflection(wi * side, value / pdf, pdf))
    }

    /// What a perfectly smooth coat mirrors, and the base with it where that is perfectly smooth too.
    fn mirrored(&self, wo: Vec3, p: f32, side: f32) -> Option<BsdfSample> {
        let (f, cos_t) = fresnel::dielectric(wo.z, self.p.coat.ior());
        let mut value = Vec3::splat(f);
        if self.p.base.is_delta() {
            let pass = (-self.p.thickness / cos_t).exp();
            let base = self.p.base.reflectance(cos_t) * (pass * pass);
            value += (1.0 - f) * (1.0 - f) * base * bounces(base * f, self.p.max_depth);
        }
        let wi = Vec3::new(-wo.x, -wo.y, wo.z) * side;
        let sample = BsdfSample::reflection(wi, value / p, p);
        Some(BsdfSample { delta: true, ..sample })
    }
}

/// The base's lobe as it is seen from outside, as the width of a reflection: refraction on the way out magnifies its
/// slopes by the index, and either passage through the coat's facets bends light by their slope times the index's
/// distance from 1, which is half of what reflection would.
fn seen_alpha(coat: &Dielectric, base: &Conductor) -> Vec2 {
    let bend = (coat.ior() - 1.0) * coat.alpha();
    let base = coat.ior() * base.alpha();
    (base * base + 0.5 * bend * bend).map(f32::sqrt)
}

/// Sum of the first powers of `ratio`: light that returns from the base `n + 1` times has been thrown back by the coat
/// `n` times. The walk's even steps end at the base.
fn bounces(ratio: Vec3, max_depth: u32) -> Vec3 {
    let n = max_depth.div_ceil(2);
    let sum = |r: f32| if r < 1.0 { (1.0 - r.powi(n as i32)) / (1.0 - r) } else { n as f32 };
    ratio.map(sum)
}

/// Density of mirroring at facets visible from `wo`, for directions on +z's side.
#[inline]
fn reflection_pdf(ggx: Ggx, wo: Vec3, wi: Vec3) -> f32 {
    let h = (wo + wi).normalize();
    ggx.g1(wo) * ggx.d(h) / (4.0 * wo.z)
}

#[cfg(test)]
mod tests;
