//! Glass: a GGX surface that reflects and refracts (Walter et al. 2007).

use glam::{Vec2, Vec3};

use super::{
    BsdfSample,
    film::{Film, FilmParams},
    fresnel,
    ggx::Ggx,
};

/// A GGX dielectric; +z points out of the medium.
#[derive(Clone, Copy, Debug)]
pub struct Dielectric {
    /// Index inside over outside.
    ior: f32,
    /// Multiplies what is transmitted.
    tint: Vec3,
    /// `None` where perfectly smooth.
    ggx: Option<Ggx>,
    /// A film on it, if there is one.
    film: Option<Film>,
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
        Self { ior, tint, ggx, film: None }
    }

    /// The same with a thin film on it.
    pub fn with_film(self, film: FilmParams) -> Self {
        let (f0, _) = fresnel::dielectric(1.0, self.ior);
        Self { film: Film::new(film, Vec3::splat(f0)), ..self }
    }

    /// Whether it is perfectly smooth, or as good as that.
    #[inline]
    pub fn is_delta(&self) -> bool {
        self.ggx.is_none()
    }

    /// Index inside over outside.
    #[inline]
    pub(super) fn ior(&self) -> f32 {
        self.ior
    }

    /// Multiplies what is transmitted.
    #[inline]
    pub(super) fn tint(&self) -> Vec3 {
        self.tint
    }

    /// The widths of its facets along x and y; 0 where smooth.
    #[inline]
    pub(super) fn alpha(&self) -> Vec2 {
        self.ggx.map_or(Vec2::ZERO, |g| g.alpha())
    }

    pub(super) fn albedo(&self) -> Vec3 {
        let (f, _) = fresnel::dielectric(1.0, self.ior);
        Vec3::splat(f) + (1.0 - f) * self.tint
    }

    /// Index on the far side of the surface over the one on `wo`'s side.
    #[inline]
    pub(super) fn relative_eta(&self, wo: Vec3) -> f32 {
        if wo.z > 0.0 { self.ior } else { 1.0 / self.ior }
    }

    #[inline]
    pub(super) fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        let Some(Pair { reflected, f, eta, cos_o, value, pdf, .. }) = self.pair(wo, wi) else {
            return (Vec3::ZERO, 0.0);
        };
        let color = self.color(cos_o, eta, !reflected);
        if reflected {
            (color * (f * value), f * pdf)
        } else {
            (color * self.tint * ((1.0 - f) * value / (eta * eta)), (1.0 - f) * pdf)
        }
    }

    /// Reflectance of a facet that light meets at cosine `cos_o`, under a film the mean over channels, and the cosine
    /// of the refracted direction.
    #[inline]
    fn reflectance(&self, cos_o: f32, eta: f32) -> (f32, f32) {
        let (f, cos_t) = fresnel::dielectric(cos_o, eta);
        match &self.film {
            Some(film) if cos_t > 0.0 => (mean(self.filmed(film, f, cos_o, cos_t, eta)), cos_t),
            _ => (f, cos_t),
        }
    }

    /// The colour of what is reflected or transmitted, as a factor on what [`reflectance`](Self::reflectance) says.
    #[inline]
    fn color(&self, cos_o: f32, eta: f32, transmission: bool) -> Vec3 {
        let Some(film) = &self.film else { return Vec3::ONE };
        let (f, cos_t) = fresnel::dielectric(cos_o, eta);
        if cos_t <= 0.0 {
            return Vec3::ONE;
        }
        let reflected = self.filmed(film, f, cos_o, cos_t, eta);
        let share = if transmission { 1.0 - reflected } else { reflected };
        share / mean(share).max(f32::MIN_POSITIVE)
    }

    /// The reflectance `f` with the film; light takes the same way back, so that the cosine in air counts for both ways.
    #[inline(never)]
    fn filmed(&self, film: &Film, f: f32, cos_o: f32, cos_t: f32, eta: f32) -> Vec3 {
        let in_air = if (eta > 1.0) == (self.ior > 1.0) { cos_o } else { cos_t };
        film.over(Vec3::splat(f), in_air)
    }

    /// What a rough surface does between two directions; `None` where it is smooth or they see different facets.
    #[inline]
    fn pair(&self, wo: Vec3, wi: Vec3) -> Option<Pair> {
        let ggx = self.ggx?;
        if wo.z == 0.0 || wi.z == 0.0 {
            return None;
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
            return None;
        }
        let (f, cos_t) = self.reflectance(cos_o, eta);
        let density = if reflected {
            ggx.d(h) / (4.0 * wo.z)
        } else {
            // Equations 17 and 21; `length` is their denominator's root.
            let jacobian = eta * eta * -cos_i / (length * length);
            ggx.d(h) * cos_o / wo.z * jacobian
        };
        let (value, pdf) = (density * ggx.g2(wo, wi), density * ggx.g1(wo));
        Some(Pair { reflected, f, eta, cos_o, cos_t, h_z: h.z, value, pdf })
    }

    #[inline]
    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let facet = self.facet(wo, u)?;
        let transmission = u_lobe >= facet.f;
        let Part { wi, shadowing, pdf } = self.part(&facet, transmission)?;
        let (choice, color, eta) = if transmission {
            (1.0 - facet.f, self.tint / (facet.eta * facet.eta), facet.eta)
        } else {
            (facet.f, Vec3::ONE, 1.0)
        };
        let color = color * self.color(facet.cos_o, facet.eta, transmission);
        let pdf = choice * pdf;
        // Underflows at directions within rounding of the horizon.
        if pdf <= 0.0 {
            return None;
        }
        Some(BsdfSample { wi, weight: color * shadowing, pdf, delta: self.is_delta(), transmission, eta })
    }

    /// A facet that `wo` sees.
    #[inline]
    fn facet(&self, wo: Vec3, u: Vec2) -> Option<Facet> {
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
        let (f, cos_t) = self.reflectance(cos_o, eta);
        Some(Facet { side, wo, h, cos_o, cos_t, f, eta })
    }

    /// Where a facet reflects or refracts to; `None` where the microsurface is in the way.
    #[inline]
    fn part(&self, facet: &Facet, transmission: bool) -> Option<Part> {
        let &Facet { side, wo, h, cos_o, cos_t, eta, .. } = facet;
        let wi = if transmission { (cos_o / eta - cos_t) * h - wo / eta } else { 2.0 * cos_o * h - wo };
        if (wi.z < 0.0) != transmission || wi.z == 0.0 {
            return None;
        }
        let (shadowing, pdf) = self.ggx.map_or((1.0, 1.0), |ggx| {
            let g1 = ggx.g1(wo);
            let density = g1 * ggx.d(h) * cos_o / wo.z;
            let jacobian = if transmission {
                let sqrt_denominator = cos_o - eta * cos_t;
                eta * eta * cos_t / (sqrt_denominator * sqrt_denominator)
            } else {
                0.25 / cos_o
            };
            (ggx.g2(wo, wi) / g1, density * jacobian)
        });
        Some(Part { wi: wi.normalize() * side, shadowing, pdf })
    }
}

/// The mean of the channels.
#[inline]
fn mean(color: Vec3) -> f32 {
    color.element_sum() * (1.0 / 3.0)
}

/// The two sides on their own, as layers on top of each other want them: as shares of energy, without the compression
/// of radiance and without the tint.
impl Dielectric {
    /// A direction in which light is reflected (or refracted, if `transmission`), the share of light that goes there,
    /// and the density of the direction given that choice (1 where smooth).
    #[inline]
    pub(super) fn sample_part(&self, wo: Vec3, transmission: bool, u: Vec2) -> Option<(Vec3, f32, f32)> {
        let facet = self.facet(wo, u)?;
        let share = if transmission { 1.0 - facet.f } else { facet.f };
        let Part { wi, shadowing, pdf } = self.part(&facet, transmission)?;
        (share > 0.0 && pdf > 0.0).then_some((wi, share * shadowing, pdf))
    }

    /// The share of light per steradian around `wi`, cosine included, and the density of
    /// [`sample_part`](Self::sample_part) there; both 0 where smooth.
    #[inline]
    pub(super) fn eval_part(&self, wo: Vec3, wi: Vec3) -> (f32, f32) {
        let Some(pair) = self.pair(wo, wi) else { return (0.0, 0.0) };
        let share = if pair.reflected { pair.f } else { 1.0 - pair.f };
        (share * pair.value, pair.pdf)
    }
}

/// For a surface where no draw shall be lost: facets send light only where it leaves.
impl Dielectric {
    /// [`eval_pdf`](Self::eval_pdf), with the density of [`sample_open`](Self::sample_open).
    #[inline]
    pub(super) fn eval_pdf_open(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        let Some(pair) = self.pair(wo, wi) else { return (Vec3::ZERO, 0.0) };
        let Pair { reflected, f, eta, cos_o, cos_t, h_z, value, pdf } = pair;
        let [reflects, refracts] = ways(cos_o, cos_t, eta, h_z, wo.z.abs());
        if reflected {
            let odds = if refracts { f } else { 1.0 };
            (Vec3::splat(f * value), odds * pdf)
        } else {
            let odds = if reflects { 1.0 - f } else { 1.0 };
            (self.tint * ((1.0 - f) * value / (eta * eta)), odds * pdf)
        }
    }

    /// A direction with [`eval_pdf_open`](Self::eval_pdf_open); `None` where the facet sends light nowhere.
    #[inline]
    pub(super) fn sample_open(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<(Vec3, Vec3, f32)> {
        let facet = self.facet(wo, u)?;
        let (share, odds, transmission) = match facet.ways() {
            [true, true] if u_lobe < facet.f => (facet.f, facet.f, false),
            [true, true] => (1.0 - facet.f, 1.0 - facet.f, true),
            [true, false] => (facet.f, 1.0, false),
            [false, true] => (1.0 - facet.f, 1.0, true),
            [false, false] => return None,
        };
        let Part { wi, shadowing, pdf } = self.part(&facet, transmission)?;
        let color = if transmission { self.tint / (facet.eta * facet.eta) } else { Vec3::ONE };
        Some((wi, color * (share * shadowing * pdf), odds * pdf))
    }

    /// Whether the facet of these random numbers sends light anywhere.
    pub(super) fn opens(&self, wo: Vec3, u: Vec2) -> bool {
        self.facet(wo, u).is_some_and(|facet| facet.ways().contains(&true))
    }
}

/// Whether what a facet reflects, and what it refracts, leaves the surface on the side where it belongs.
#[inline]
fn ways(cos_o: f32, cos_t: f32, eta: f32, h_z: f32, wo_z: f32) -> [bool; 2] {
    [2.0 * cos_o * h_z > wo_z, cos_t > 0.0 && (cos_o - eta * cos_t) * h_z < wo_z]
}

impl Facet {
    #[inline]
    fn ways(&self) -> [bool; 2] {
        ways(self.cos_o, self.cos_t, self.eta, self.h.z, self.wo.z)
    }
}

/// Two directions of a rough surface.
struct Pair {
    reflected: bool,
    /// Fresnel reflectance of the facet between them.
    f: f32,
    /// Index on `wi`'s far side over the one on `wo`'s.
    eta: f32,
    /// Cosine between the facet and `wo`.
    cos_o: f32,
    /// Of the refracted direction.
    cos_t: f32,
    /// Cosine between the facet and the surface.
    h_z: f32,
    /// BSDF times cosine if all light took this way, as energy.
    value: f32,
    /// Density per steradian given that light takes this way.
    pdf: f32,
}

/// A facet seen from `wo`.
struct Facet {
    /// Sign of the original `wo.z`; the rest is turned to +z.
    side: f32,
    wo: Vec3,
    h: Vec3,
    cos_o: f32,
    /// Of the refracted direction.
    cos_t: f32,
    f: f32,
    eta: f32,
}

/// A direction in which a facet sends light.
struct Part {
    wi: Vec3,
    /// Share of it that the microsurface lets pass.
    shadowing: f32,
    /// Density given the choice of the part; 1 where smooth.
    pdf: f32,
}
