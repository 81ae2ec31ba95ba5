//! The metallic-roughness model of glTF 2.0 (specification, appendix B) with KHR extensions.

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use super::{
    BsdfSample,
    albedo_table::{self, SplitAlbedo},
    fresnel::schlick_weight,
    ggx::Ggx,
};
use crate::warp;

/// F0 of the clear coat: an index of 1.5, as KHR_materials_clearcoat says.
const COAT_F0: f32 = 0.04;

/// The model's parameters at one point, textures looked up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MetalRoughParams {
    /// Base colour, in 0..1.
    pub base_color: Vec3,
    /// 0 dielectric .. 1 metal.
    pub metallic: f32,
    /// Perceptual roughness, in 0..1.
    pub roughness: f32,
    /// Index of refraction of the dielectric, at least 1.
    pub ior: f32,
    /// KHR_materials_specular: strength, in 0..1.
    pub specular: f32,
    /// KHR_materials_specular: colour of F0.
    pub specular_color: Vec3,
    /// Share of the light entering the dielectric that passes a thin wall, in 0..1.
    pub transmission: f32,
    /// Strength of the clear coat, in 0..1.
    pub clearcoat: f32,
    /// Perceptual roughness of the clear coat, in 0..1.
    pub clearcoat_roughness: f32,
}

impl Default for MetalRoughParams {
    /// glTF's own defaults.
    fn default() -> Self {
        Self {
            base_color: Vec3::ONE,
            metallic: 1.0,
            roughness: 1.0,
            ior: 1.5,
            specular: 1.0,
            specular_color: Vec3::ONE,
            transmission: 0.0,
            clearcoat: 0.0,
            clearcoat_roughness: 0.0,
        }
    }
}

/// A GGX lobe with Schlick's Fresnel term, a diffuse and a thin-walled transmission lobe below it, and a GGX coat
/// above, the same from both sides.
#[derive(Clone, Copy, Debug)]
pub struct MetalRough {
    /// Fresnel terms of the specular lobe, dielectric and metal mixed.
    f0: Vec3,
    f90: Vec3,
    /// Fresnel terms of the dielectric alone: what it reflects does not reach the layer below.
    dielectric_f0: Vec3,
    dielectric_f90: f32,
    /// Albedo of the diffuse lobe, before the dielectric's reflection is taken off.
    diffuse: Vec3,
    /// Colour of the transmitted lobe, likewise.
    transmitted: Vec3,
    /// Specular lobe, `None` where perfectly smooth; also the width of the transmitted one.
    ggx: Option<Ggx>,
    /// Strength of the coat.
    coat: f32,
    /// The coat's lobe, `None` where perfectly smooth.
    coat_ggx: Option<Ggx>,
}

/// What depends on `wo` alone.
struct Outgoing {
    /// Share of light the coat lets pass.
    below_coat: f32,
    /// Probabilities of the lobes.
    p_specular: f32,
    p_diffuse: f32,
    p_transmitted: f32,
    p_coat: f32,
}

fn alpha(ggx: Option<Ggx>) -> f32 {
    ggx.map_or(0.0, |g| g.alpha)
}

impl MetalRough {
    /// From the parameters at a point.
    pub fn new(p: &MetalRoughParams) -> Self {
        let r = (p.ior - 1.0) / (p.ior + 1.0);
        let dielectric_f0 = (r * r * p.specular_color).min(Vec3::ONE) * p.specular;
        let below = p.base_color * (1.0 - p.metallic);
        Self {
            f0: dielectric_f0.lerp(p.base_color, p.metallic),
            f90: Vec3::splat(p.specular + (1.0 - p.specular) * p.metallic),
            dielectric_f0,
            dielectric_f90: p.specular,
            diffuse: below * (1.0 - p.transmission),
            transmitted: below * p.transmission,
            ggx: Ggx::from_roughness(p.roughness),
            coat: p.clearcoat,
            coat_ggx: Ggx::from_roughness(p.clearcoat_roughness),
        }
    }

    pub(super) fn is_delta(&self) -> bool {
        self.ggx.is_none() && self.diffuse == Vec3::ZERO && (self.coat == 0.0 || self.coat_ggx.is_none())
    }

    pub(super) fn albedo(&self) -> Vec3 {
        (self.f0 + self.diffuse + self.transmitted).min(Vec3::ONE)
    }

    /// Share of light at cosine `cos` that passes the coat.
    #[inline]
    fn below_coat(&self, cos: f32) -> f32 {
        if self.coat == 0.0 {
            return 1.0;
        }
        let e = albedo_table::directional(cos, alpha(self.coat_ggx));
        1.0 - self.coat * (COAT_F0 * e.a + e.b)
    }

    /// Albedo of the dielectric's reflection, largest channel: one number keeps the layer below its hue.
    #[inline]
    fn dielectric_albedo(&self, e: SplitAlbedo) -> f32 {
        self.dielectric_f0.max_element() * e.a + self.dielectric_f90 * e.b
    }

    #[inline]
    fn outgoing(&self, wo: Vec3) -> Outgoing {
        let e = albedo_table::directional(wo.z, alpha(self.ggx));
        let below_coat = self.below_coat(wo.z);
        let specular = below_coat * e.with(self.f0, self.f90).max_element();
        let below = below_coat * (1.0 - self.dielectric_albedo(e));
        let diffuse = below * self.diffuse.max_element();
        let transmitted = below * self.transmitted.max_element();
        let coat = 1.0 - below_coat;
        let sum = specular + diffuse + transmitted + coat;
        let norm = if sum > 0.0 { 1.0 / sum } else { 0.0 };
        Outgoing {
            below_coat,
            p_specular: specular * norm,
            p_diffuse: diffuse * norm,
            p_transmitted: transmitted * norm,
            p_coat: coat * norm,
        }
    }

    #[inline]
    pub(super) fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        if wo.z == 0.0 || wi.z == 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        self.eval_pdf_with(&self.outgoing(wo), wo, wi)
    }

    fn eval_pdf_with(&self, out: &Outgoing, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        let side = 1f32.copysign(wo.z);
        let (wo, wi) = (wo * side, wi * side);
        let through_coat = out.below_coat * self.below_coat(wi.z);
        if wi.z < 0.0 {
            // A thin wall: the reflected lobe, mirrored.
            let Some(ggx) = self.ggx else { return (Vec3::ZERO, 0.0) };
            let wi = Vec3::new(wi.x, wi.y, -wi.z);
            let (schlick, f, pdf) = reflect_lobe(ggx, wo, wi);
            let fresnel = self.dielectric_f0.lerp(Vec3::splat(self.dielectric_f90), schlick);
            let value = self.transmitted * (Vec3::ONE - fresnel) * (f * through_coat);
            return (value, out.p_transmitted * pdf);
        }
        let alpha = alpha(self.ggx);
        let pass = |cos| 1.0 - self.dielectric_albedo(albedo_table::directional(cos, alpha));
        let pass_mean = 1.0 - self.dielectric_albedo(albedo_table::mean(alpha));
        let cosine = wi.z * FRAC_1_PI;
        let mut value = if pass_mean > 0.0 && self.diffuse != Vec3::ZERO {
            self.diffuse * (cosine * pass(wo.z) * pass(wi.z) / pass_mean)
        } else {
            Vec3::ZERO
        };
        let mut pdf = out.p_diffuse * cosine;
        if let Some(ggx) = self.ggx {
            let (schlick, f, lobe_pdf) = reflect_lobe(ggx, wo, wi);
            value += self.f0.lerp(self.f90, schlick) * f;
            pdf += out.p_specular * lobe_pdf;
        }
        value *= through_coat;
        if let (true, Some(ggx)) = (self.coat > 0.0, self.coat_ggx) {
            let (schlick, f, lobe_pdf) = reflect_lobe(ggx, wo, wi);
            value += self.coat * (COAT_F0 + (1.0 - COAT_F0) * schlick) * f;
            pdf += out.p_coat * lobe_pdf;
        }
        (value, pdf)
    }

    #[inline]
    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z == 0.0 {
            return None;
        }
        let out = self.outgoing(wo);
        let side = 1f32.copysign(wo.z);
        let wo_up = wo * side;
        let mirrored = Vec3::new(-wo_up.x, -wo_up.y, wo_up.z);
        let schlick = schlick_weight(wo_up.z);
        let through_coat = out.below_coat * out.below_coat;
        let mut u_lobe = u_lobe;
        let mut chosen = |p: f32| {
            u_lobe -= p;
            p > 0.0 && u_lobe < 0.0
        };
        let delta = |wi: Vec3, value: Vec3, pdf: f32, transmission: bool| {
            Some(BsdfSample { wi: wi * side, weight: value / pdf, pdf, delta: true, transmission, eta: 1.0 })
        };
        let wi = if chosen(out.p_diffuse) {
            warp::cosine_hemisphere(u)
        } else if chosen(out.p_specular) {
            match self.ggx {
                Some(ggx) => reflect(wo_up, ggx.sample_visible(wo_up, u)),
                None => {
                    let value = self.f0.lerp(self.f90, schlick) * through_coat;
                    return delta(mirrored, value, out.p_specular, false);
                }
            }
        } else if chosen(out.p_coat) {
            match self.coat_ggx {
                Some(ggx) => reflect(wo_up, ggx.sample_visible(wo_up, u)),
                None => {
                    let value = self.coat * (COAT_F0 + (1.0 - COAT_F0) * schlick);
                    return delta(mirrored, Vec3::splat(value), out.p_coat, false);
                }
            }
        } else if out.p_transmitted > 0.0 {
            match self.ggx {
                Some(ggx) => {
                    let wi = reflect(wo_up, ggx.sample_visible(wo_up, u));
                    // Lost below the horizon before it is mirrored, not after.
                    if wi.z <= 0.0 {
                        return None;
                    }
                    let wi = Vec3::new(wi.x, wi.y, -wi.z) * side;
                    let (value, pdf) = self.eval_pdf_with(&out, wo, wi);
                    let sample = BsdfSample::reflection(wi, value / pdf, pdf);
                    return (pdf > 0.0).then_some(BsdfSample { transmission: true, ..sample });
                }
                None => {
                    let fresnel = self.dielectric_f0.lerp(Vec3::splat(self.dielectric_f90), schlick);
                    let value = self.transmitted * (Vec3::ONE - fresnel) * through_coat;
                    return delta(-wo_up, value, out.p_transmitted, true);
                }
            }
        } else {
            return None;
        };
        if wi.z <= 0.0 {
            return None;
        }
        let wi = wi * side;
        let (value, pdf) = self.eval_pdf_with(&out, wo, wi);
        (pdf > 0.0).then(|| BsdfSample::reflection(wi, value / pdf, pdf))
    }
}

/// `wo` mirrored at `h`.
#[inline]
fn reflect(wo: Vec3, h: Vec3) -> Vec3 {
    (2.0 * wo.dot(h) * h - wo).normalize()
}

/// The GGX reflection lobe for directions on +z's side: Schlick's weight, BRDF times cosine for a reflectance of
/// 1, and density by visible normals.
#[inline]
fn reflect_lobe(ggx: Ggx, wo: Vec3, wi: Vec3) -> (f32, f32, f32) {
    let h = (wo + wi).normalize();
    let common = ggx.d(h) / (4.0 * wo.z);
    (schlick_weight(wo.dot(h)), common * ggx.g2(wo, wi), common * ggx.g1(wo))
}
