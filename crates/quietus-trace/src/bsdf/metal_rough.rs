//! The metallic-roughness model of glTF 2.0 (specification, appendix B) with KHR extensions.
//!
//! Departures from the appendix, all for energy: it mixes layers by the Fresnel term at the half vector, which
//! reflects up to twice the light that arrives at grazing angles, and loses what scatters more than once.
//! - The layer below the dielectric is scaled by what its reflection leaves over in both directions (Kelemen and
//!   Szirmay-Kalos 2001, "A Microfacet Based Coupled Specular-Matte BRDF Model", section 2.2), those below the
//!   coat by the share that passes in the direction in which less does, so that what the coat throws back is not lost.
//! - Light that single scattering loses comes back as a separate lobe (Kulla and Conty 2017, "Revisiting
//!   Physically Based Shading at Imageworks").
//! - Masking and shadowing are height-correlated.
//!
//! - What a thin film lets pass to the layer below is bounded from below, see [`film`](super::film).
//! - The sheen is cut where it would reflect more than arrives, see [`sheen`](super::sheen).
//!
//! The whole reflects at most what arrives, and is reciprocal unless the coat has a normal of its own (which breaks
//! the symmetry of cosines as every shading normal does: Veach 1997, section 5.3).

mod layers;

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use super::{
    BsdfSample,
    albedo_table::{LobeAlbedo, SplitAlbedo},
    film::{Film, FilmParams},
    fresnel::schlick_weight,
    ggx::Ggx,
    sheen::Sheen,
};
use crate::warp;
use layers::{Coat, DielectricLayer, MEAN_COSINE};

/// The model's parameters at one point, textures looked up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MetalRoughParams {
    /// Base colour, in 0..1.
    pub base_color: Vec3,
    /// 0 dielectric .. 1 metal.
    pub metallic: f32,
    /// Perceptual roughness, in 0..1.
    pub roughness: f32,
    /// KHR_materials_anisotropy: how much wider the specular lobe is along x, in 0..1.
    pub anisotropy: f32,
    /// Index of refraction of the dielectric: at least 1, or 0 for one that reflects everything.
    pub ior: f32,
    /// KHR_materials_specular: strength, in 0..1.
    pub specular: f32,
    /// KHR_materials_specular: colour of F0, at least 0.
    pub specular_color: Vec3,
    /// Share of the light entering the dielectric that passes a thin wall, in 0..1.
    pub transmission: f32,
    /// Share of the light that would be scattered below the dielectric which is scattered to the other side, in 0..1.
    pub diffuse_transmission: f32,
    /// Colour of that light, in 0..1.
    pub diffuse_transmission_color: Vec3,
    /// Between air and both dielectric and metal; none where its strength is 0.
    pub film: FilmParams,
    /// Strength of the clear coat, in 0..1.
    pub clearcoat: f32,
    /// Perceptual roughness of the clear coat, in 0..1.
    pub clearcoat_roughness: f32,
    /// Normal of the clear coat, of unit length, in the frame of the base's normal.
    pub clearcoat_normal: Vec3,
    /// KHR_materials_sheen: colour, in 0..1.
    pub sheen_color: Vec3,
    /// KHR_materials_sheen: perceptual roughness, in 0..1.
    pub sheen_roughness: f32,
}

impl Default for MetalRoughParams {
    /// glTF's own defaults.
    fn default() -> Self {
        Self {
            base_color: Vec3::ONE,
            metallic: 1.0,
            roughness: 1.0,
            anisotropy: 0.0,
            ior: 1.5,
            specular: 1.0,
            specular_color: Vec3::ONE,
            transmission: 0.0,
            diffuse_transmission: 0.0,
            diffuse_transmission_color: Vec3::ONE,
            film: FilmParams { strength: 0.0, ior: 1.3, thickness: 400.0 },
            clearcoat: 0.0,
            clearcoat_roughness: 0.0,
            clearcoat_normal: Vec3::Z,
            sheen_color: Vec3::ZERO,
            sheen_roughness: 0.0,
        }
    }
}

/// A GGX lobe with Schlick's Fresnel term or a thin film's, a diffuse lobe to either side and a thin-walled transmission
/// lobe below it, sheen and a GGX coat above, the same from both sides.
#[derive(Clone, Copy, Debug)]
pub struct MetalRough {
    /// Fresnel terms of the specular lobe, dielectric and metal mixed.
    f0: Vec3,
    f90: Vec3,
    /// The dielectric alone: what it reflects does not reach the layer below.
    dielectric: DielectricLayer,
    /// The film over the metal, and the metal's share.
    metal_film: Option<(Film, f32)>,
    /// Albedo of the diffuse lobe below the dielectric.
    diffuse: Vec3,
    /// What that lobe scatters to the other side.
    diffuse_through: Vec3,
    /// Share of what single scattering loses that leaves after further scattering.
    recovered: Vec3,
    /// Colour of the transmitted lobe.
    transmitted: Vec3,
    /// Specular lobe, `None` where perfectly smooth; also the width of the transmitted one.
    ggx: Option<Ggx>,
    /// The albedo of the specular lobe for reflectance 1, by angle.
    lobe_albedo: LobeAlbedo,
    /// Cosine-weighted means over the hemisphere: what passes the dielectric, what single scattering loses.
    mean_pass: f32,
    mean_lost: f32,
    /// The layer above these.
    sheen: Option<Sheen>,
    /// The layer on top.
    coat: Option<Coat>,
}

/// What depends on `wo` alone.
struct Outgoing {
    /// `wo`, turned to +z's side.
    wo: Vec3,
    /// Albedo of the specular lobe.
    albedo: SplitAlbedo,
    /// Share of light that passes the coat.
    below_coat: f32,
    /// Share of that which passes the sheen.
    below_sheen: f32,
    /// Probability of each lobe, in [`Lobe`]'s order.
    p: [f32; 6],
}

/// The parts that are sampled each by its own strategy.
#[derive(Clone, Copy, PartialEq)]
enum Lobe {
    /// Diffuse and recovered light, by the cosine.
    Cosine,
    Specular,
    Transmitted,
    Coat,
    /// Sheen, uniformly: it is brightest at the horizon.
    Sheen,
    /// Diffuse light on the other side, by the cosine.
    Through,
}

const LOBES: [Lobe; 6] =
    [Lobe::Cosine, Lobe::Specular, Lobe::Transmitted, Lobe::Coat, Lobe::Sheen, Lobe::Through];

impl MetalRough {
    /// From the parameters at a point.
    pub fn new(p: &MetalRoughParams) -> Self {
        let alpha = p.roughness * p.roughness;
        let along = alpha + (1.0 - alpha) * p.anisotropy * p.anisotropy;
        let ggx = Ggx::new(Vec2::new(along, alpha));
        let lobe_albedo = LobeAlbedo::new(ggx);
        let mean = lobe_albedo.mean();
        let r = (p.ior - 1.0) / (p.ior + 1.0);
        let dielectric_f0 = (r * r * p.specular_color).min(Vec3::ONE) * p.specular;
        let dielectric = DielectricLayer::new(dielectric_f0, p.specular, p.film, mean);
        let metal_film = Film::new(p.film, p.base_color).filter(|_| p.metallic > 0.0);
        let below = 1.0 - p.metallic;
        let diffuse = below * (1.0 - p.transmission);
        let mut whole = Self {
            f0: dielectric.f0.lerp(p.base_color, p.metallic),
            f90: Vec3::splat(p.specular + (1.0 - p.specular) * p.metallic),
            dielectric,
            metal_film: metal_film.map(|film| (film, p.metallic)),
            diffuse: p.base_color * (diffuse * (1.0 - p.diffuse_transmission)),
            diffuse_through: p.diffuse_transmission_color * (diffuse * p.diffuse_transmission),
            recovered: Vec3::ZERO,
            transmitted: p.base_color * (below * p.transmission),
            ggx,
            lobe_albedo,
            mean_pass: dielectric.mean_pass(mean),
            mean_lost: mean.lost(),
            sheen: Sheen::new(p.sheen_color, p.sheen_roughness),
            coat: Coat::new(p),
        };
        whole.recovered = recovered(whole.filmed(mean_schlick(whole.f0, whole.f90), MEAN_COSINE), mean);
        whole
    }

    /// Whether all lobes are delta.
    pub(super) fn is_delta(&self) -> bool {
        self.ggx.is_none()
            && self.diffuse == Vec3::ZERO
            && self.diffuse_through == Vec3::ZERO
            && self.sheen.is_none()
            && self.coat.is_none_or(|c| c.ggx.is_none())
    }

    /// Whether nothing passes through.
    #[inline]
    pub(super) fn reflects_only(&self) -> bool {
        self.transmitted == Vec3::ZERO && self.diffuse_through == Vec3::ZERO
    }

    /// Whether the coat has a normal of its own.
    #[cfg(test)]
    pub(super) fn has_tilted_coat(&self) -> bool {
        self.coat.is_some_and(|c| c.frame.is_some())
    }

    /// Reflectance under light from all sides, transmission included, without the coat.
    pub(super) fn albedo(&self) -> Vec3 {
        let mean = self.lobe_albedo.mean();
        let specular =
            self.filmed(mean.with(self.f0, self.f90), MEAN_COSINE) + self.recovered * self.mean_lost;
        specular + (self.diffuse + self.diffuse_through + self.transmitted) * self.mean_pass
    }

    /// Reflectance of a facet seen at cosine `cos`.
    #[inline]
    fn fresnel(&self, cos: f32) -> Vec3 {
        self.filmed(self.f0.lerp(self.f90, schlick_weight(cos)), cos)
    }

    /// `plain`, the reflectance without the film, with the film.
    #[inline]
    fn filmed(&self, plain: Vec3, cos: f32) -> Vec3 {
        let Some(film) = &self.dielectric.film else { return plain };
        let metal = self.metal_film.map_or(Vec3::ZERO, |(film, share)| share * film.reflectance(cos));
        let share = 1.0 - self.metal_film.map_or(0.0, |(_, share)| share);
        plain.lerp(share * film.reflectance(cos) + metal, film.strength())
    }

    /// At least the albedo of the specular lobe's largest channel.
    #[inline]
    fn specular_bound(&self, e: SplitAlbedo) -> f32 {
        let plain = e.with(self.f0, self.f90).max_element();
        let Some(film) = &self.dielectric.film else { return plain };
        let metal = self.metal_film.map_or(0.0, |(film, share)| share * film.albedo_bound(e));
        let share = 1.0 - self.metal_film.map_or(0.0, |(_, share)| share);
        plain + (share * film.albedo_bound(e) + metal - plain) * film.strength()
    }

    #[inline]
    fn outgoing(&self, wo: Vec3) -> Outgoing {
        let wo = wo * 1f32.copysign(wo.z);
        let albedo = self.lobe_albedo.at(wo);
        let below_coat = self.coat.map_or(1.0, |c| c.pass(wo));
        let below_sheen = self.sheen.map_or(1.0, |s| s.left(wo.z));
        let below = below_coat * below_sheen;
        let pass = self.dielectric.pass(albedo);
        let cosine = self.diffuse * pass + self.recovered * albedo.lost();
        let weights = [
            below * cosine.max_element(),
            below * self.specular_bound(albedo),
            below * pass * self.transmitted.max_element(),
            1.0 - below_coat,
            below_coat * (1.0 - below_sheen),
            below * pass * self.diffuse_through.max_element(),
        ];
        let sum: f32 = weights.iter().sum();
        Outgoing { wo, albedo, below_coat, below_sheen, p: weights.map(|w| w / sum.max(f32::MIN_POSITIVE)) }
    }

    #[inline]
    pub(super) fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        if wo.z == 0.0 || wi.z == 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        self.eval_pdf_with(&self.outgoing(wo), wi * 1f32.copysign(wo.z))
    }

    /// Value and density for `wi` turned the way `out.wo` is.
    #[inline]
    fn eval_pdf_with(&self, out: &Outgoing, wi: Vec3) -> (Vec3, f32) {
        let [p_cosine, p_specular, _, p_coat, p_sheen, _] = out.p;
        let wo = out.wo;
        let through_coat = self.through_coat(out, wi);
        let through_sheen = self.through_sheen(out, wi);
        if wi.z < 0.0 {
            let (value, pdf) = self.eval_pdf_behind(out, wi);
            return (value * (through_coat * through_sheen), pdf);
        }
        let albedo = self.lobe_albedo.at(wi);
        let cosine = wi.z * FRAC_1_PI;
        let mut value = self.diffuse
            * two_way(self.dielectric.pass(out.albedo), self.dielectric.pass(albedo), self.mean_pass);
        value += self.recovered * two_way(out.albedo.lost(), albedo.lost(), self.mean_lost);
        value *= cosine;
        let mut pdf = p_cosine * cosine;
        if let Some(ggx) = self.ggx {
            let (cos, f, lobe_pdf) = reflect_lobe(ggx, wo, wi);
            value += self.fresnel(cos) * f;
            pdf += p_specular * lobe_pdf;
        }
        value *= through_sheen;
        if let Some(sheen) = &self.sheen {
            value += sheen.eval(wo, wi);
            pdf += p_sheen * (0.5 * FRAC_1_PI);
        }
        value *= through_coat;
        if let Some((f, lobe_pdf)) = self.coat.and_then(|c| c.eval_pdf(wo, wi)) {
            value += f;
            pdf += p_coat * lobe_pdf;
        }
        (value, pdf)
    }

    /// Value and density for `wi` on the other side, without sheen and coat.
    #[inline]
    fn eval_pdf_behind(&self, out: &Outgoing, wi: Vec3) -> (Vec3, f32) {
        let [_, _, p_transmitted, _, _, p_through] = out.p;
        let (mut value, mut pdf) = (Vec3::ZERO, 0.0);
        if self.diffuse_through != Vec3::ZERO {
            let pass = self.dielectric.pass(self.lobe_albedo.at(wi));
            let cosine = -wi.z * FRAC_1_PI;
            let through = two_way(self.dielectric.pass(out.albedo), pass, self.mean_pass);
            value = self.diffuse_through * (through * cosine);
            pdf = p_through * cosine;
        }
        if let Some(ggx) = self.ggx.filter(|_| self.transmitted != Vec3::ZERO) {
            // A thin wall: the reflected lobe, mirrored.
            let (cos, f, lobe_pdf) = reflect_lobe(ggx, out.wo, mirror(wi));
            value += self.transmittance(cos) * f;
            pdf += p_transmitted * lobe_pdf;
        }
        (value, pdf)
    }

    #[inline]
    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z == 0.0 {
            return None;
        }
        let side = 1f32.copysign(wo.z);
        let out = self.outgoing(wo);
        let (lobe, p) = out.pick(u_lobe)?;
        let up = out.wo;
        let wi = match (lobe, self.ggx, self.coat) {
            (Lobe::Cosine, ..) => warp::cosine_hemisphere(u),
            (Lobe::Sheen, ..) => warp::uniform_hemisphere(u),
            (Lobe::Through, ..) => mirror(warp::cosine_hemisphere(u)),
            (Lobe::Specular, Some(ggx), _) => reflect(up, ggx.sample_visible(up, u)),
            (Lobe::Transmitted, Some(ggx), _) => {
                let wi = reflect(up, ggx.sample_visible(up, u));
                // Lost below the horizon before it is mirrored, not after.
                if wi.z <= 0.0 {
                    return None;
                }
                mirror(wi)
            }
            (Lobe::Coat, _, Some(coat @ Coat { ggx: Some(ggx), .. })) => coat.sample(ggx, up, u)?,
            _ => return self.sample_delta(&out, lobe, p, side),
        };
        let transmission = matches!(lobe, Lobe::Transmitted | Lobe::Through);
        if wi.z == 0.0 || (wi.z < 0.0) != transmission {
            return None;
        }
        let (value, pdf) = self.eval_pdf_with(&out, wi);
        let sample =
            BsdfSample { wi: wi * side, weight: value / pdf, pdf, delta: false, transmission, eta: 1.0 };
        (pdf > 0.0).then_some(sample)
    }

    /// The direction of a perfectly smooth `lobe`, chosen with probability `p`.
    fn sample_delta(&self, out: &Outgoing, lobe: Lobe, p: f32, side: f32) -> Option<BsdfSample> {
        let cos = out.wo.z;
        let reflected = mirror(-out.wo);
        let (wi, value) = match (lobe, self.coat) {
            (Lobe::Specular, _) => (reflected, self.fresnel(cos)),
            (Lobe::Transmitted, _) => (-out.wo, self.transmittance(cos)),
            (_, Some(coat)) => (coat.mirrored(out.wo)?, Vec3::splat(coat.reflectance(out.wo))),
            (_, None) => return None,
        };
        // A coat's own light does not pass it, all other does.
        let through_coat = match lobe {
            Lobe::Specular | Lobe::Transmitted => self.through_coat(out, wi),
            _ => 1.0,
        };
        let through_sheen = if lobe == Lobe::Coat { 1.0 } else { self.through_sheen(out, wi) };
        let transmission = lobe == Lobe::Transmitted;
        if wi.z == 0.0 || (wi.z < 0.0) != transmission {
            return None;
        }
        let weight = value * (through_coat * through_sheen / p);
        Some(BsdfSample { wi: wi * side, weight, pdf: p, delta: true, transmission, eta: 1.0 })
    }

    /// Share of light that reaches the layers below the coat and leaves them again: the smaller share of both directions, for what
    /// a coat throws back from below reaches the layers below once more.
    #[inline]
    fn through_coat(&self, out: &Outgoing, wi: Vec3) -> f32 {
        self.coat.map_or(1.0, |coat| out.below_coat.min(coat.pass(wi)))
    }

    /// Share of light that reaches the layers below the sheen and leaves them again, as the extension has it: the
    /// smaller share of both directions.
    #[inline]
    fn through_sheen(&self, out: &Outgoing, wi: Vec3) -> f32 {
        self.sheen.map_or(1.0, |s| out.below_sheen.min(s.left(wi.z.abs())))
    }

    /// Share of light that passes a thin wall whose facet is seen at cosine `cos`.
    #[inline]
    fn transmittance(&self, cos: f32) -> Vec3 {
        self.transmitted * (Vec3::ONE - self.dielectric.fresnel(cos))
    }
}

impl Outgoing {
    /// A lobe and its probability.
    #[inline]
    fn pick(&self, mut u: f32) -> Option<(Lobe, f32)> {
        let mut last = None;
        for (lobe, p) in LOBES.into_iter().zip(self.p) {
            if p > 0.0 {
                last = Some((lobe, p));
                if u < p {
                    break;
                }
                u -= p;
            }
        }
        last
    }
}

/// Share of the light lost by single scattering that leaves in the end, where facets reflect `f` of it on the mean (Kulla
/// and Conty 2017, with the power series of Hill's "A Multi-Faceted Exploration", part 3).
fn recovered(f: Vec3, mean: SplitAlbedo) -> Vec3 {
    let kept = 1.0 - mean.lost();
    f * f * kept / (Vec3::ONE - f * mean.lost())
}

/// Cosine-weighted mean of Schlick's approximation.
fn mean_schlick(f0: Vec3, f90: Vec3) -> Vec3 {
    f0 + (f90 - f0) / 21.0
}

/// A diffuse lobe's factor that reflects `out` of the light in direction `wo` and is reciprocal, given the
/// factors of both directions and their mean.
#[inline]
fn two_way(out: f32, incoming: f32, mean: f32) -> f32 {
    if mean > 0.0 { out * incoming / mean } else { 0.0 }
}

/// `w` on the other side of the surface.
#[inline]
fn mirror(w: Vec3) -> Vec3 {
    Vec3::new(w.x, w.y, -w.z)
}

/// `wo` mirrored at `h`.
#[inline]
fn reflect(wo: Vec3, h: Vec3) -> Vec3 {
    (2.0 * wo.dot(h) * h - wo).normalize()
}

/// The GGX reflection lobe for directions on +z's side: cosine with the facet, BRDF times cosine for a reflectance of
/// 1, and density by visible normals.
#[inline]
fn reflect_lobe(ggx: Ggx, wo: Vec3, wi: Vec3) -> (f32, f32, f32) {
    let h = (wo + wi).normalize();
    let common = ggx.d(h) / (4.0 * wo.z);
    (wo.dot(h), common * ggx.g2(wo, wi), common * ggx.g1(wo))
}
