//! Hair fibres: Chiang, Bitterli, Tappan and Burley 2016, "A Practical and Controllable Hair and Fur Model for
//! Production Path Tracing" (with the parameters of Pharr's implementation in pbrt).
//!
//! A fibre is a rough dielectric cylinder with tilted scales. Light is reflected (R), passes through (TT), is reflected
//! once inside (TRT), or more often; each of these is a product of a longitudinal lobe, an azimuthal lobe and an
//! attenuation. The x axis of the local frame runs along the fibre. A fibre is one surface here, front and back: light
//! may leave to any side.
//!
//! The model is not reciprocal: attenuation and the tilt of the scales go by `wo` alone.

use std::f32::consts::{FRAC_1_PI, PI, TAU};

use glam::{Vec2, Vec3};

use super::{BsdfSample, fresnel};
use crate::warp::sin_cos_turns;

/// Lobes that are told apart: R, TT, TRT; one more has all the rest.
const LOBES: usize = 3;
/// Below this roughness lobes become too narrow for directions in `f32`.
const MIN_BETA: f32 = 0.01;
/// Cosines of inclination below this divide rounding by rounding.
const MIN_COS: f32 = 1e-4;

/// Absorption of pigments at concentration 1, per fibre radius, for Rec.709 (d'Eon, Francois, Hill, Letteri and Aubry
/// 2011, "An Energy-Conserving Hair Reflectance Model").
const EUMELANIN: Vec3 = Vec3::new(0.419, 0.697, 1.37);
const PHEOMELANIN: Vec3 = Vec3::new(0.187, 0.4, 1.05);

/// A fibre at one point.
#[derive(Clone, Copy, Debug)]
pub struct HairParams {
    /// Where the ray meets the fibre across its width, in -1..1.
    pub h: f32,
    /// Index of refraction, at least 1.
    pub ior: f32,
    /// Absorption per fibre radius, at least 0.
    pub absorption: Vec3,
    /// Longitudinal roughness, in 0..1.
    pub beta_m: f32,
    /// Azimuthal roughness, in 0..1.
    pub beta_n: f32,
    /// Tilt of the scales, in radians.
    pub tilt: f32,
}

/// A fibre at one point, ready to be evaluated.
#[derive(Clone, Copy, Debug)]
pub struct Hair {
    h: f32,
    ior: f32,
    absorption: Vec3,
    /// Longitudinal variance of each lobe.
    v: [f32; LOBES + 1],
    /// Scale of the azimuthal logistic distribution.
    s: f32,
    /// Sine and cosine by which the scales turn each lobe.
    tilts: [Vec2; LOBES],
    /// What a head of this hair looks like.
    albedo: Vec3,
}

/// What depends on `wo` alone.
struct Outgoing {
    sin_theta: f32,
    cos_theta: f32,
    phi: f32,
    gamma_o: f32,
    gamma_t: f32,
    /// Attenuation of each lobe.
    a: [Vec3; LOBES + 1],
    /// Probability of each lobe.
    p: [f32; LOBES + 1],
}

/// Absorption that gives a thick head of hair the colour `reflectance` (Chiang et al. 2016, equation 9).
pub fn absorption_of_reflectance(reflectance: Vec3, beta_n: f32) -> Vec3 {
    // Black would absorb infinitely.
    let root = reflectance.clamp(Vec3::splat(1e-5), Vec3::ONE).map(f32::ln) / reflectance_fit(beta_n);
    root * root
}

/// Absorption of the two pigments at the given concentrations.
pub fn absorption_of_pigments(eumelanin: f32, pheomelanin: f32) -> Vec3 {
    eumelanin.max(0.0) * EUMELANIN + pheomelanin.max(0.0) * PHEOMELANIN
}

/// The denominator of Chiang et al. 2016, equation 9.
fn reflectance_fit(b: f32) -> f32 {
    5.969 + b * (-0.215 + b * (2.532 + b * (-10.73 + b * (5.574 + b * 0.245))))
}

impl Hair {
    /// From the parameters at a point.
    pub fn new(p: &HairParams) -> Self {
        let (m, n) = (p.beta_m.clamp(MIN_BETA, 1.0), p.beta_n.clamp(MIN_BETA, 1.0));
        // Equations 7 and 8: the lobes' widths grow evenly with the roughness.
        let root_v = 0.726 * m + 0.812 * m * m + 3.7 * m.powi(20);
        let v = root_v * root_v;
        let s = (PI / 8.0).sqrt() * (0.265 * n + 1.194 * n * n + 5.372 * n.powi(22));
        // R is turned by twice the tilt, TT back by one, TRT back by four (section 4.1).
        let tilts = [2.0, -1.0, -4.0].map(|k| Vec2::from(f32::sin_cos(k * p.tilt)));
        let root = p.absorption.max(Vec3::ZERO).map(f32::sqrt);
        Self {
            h: p.h.clamp(-1.0, 1.0),
            ior: p.ior,
            absorption: p.absorption.max(Vec3::ZERO),
            v: [v, 0.25 * v, 4.0 * v, 4.0 * v],
            s,
            tilts,
            albedo: (-root * reflectance_fit(n)).map(f32::exp),
        }
    }

    pub(super) fn albedo(&self) -> Vec3 {
        self.albedo
    }

    fn outgoing(&self, wo: Vec3) -> Outgoing {
        let sin_theta = wo.x.clamp(-1.0, 1.0);
        let cos_theta = (1.0 - sin_theta * sin_theta).max(MIN_COS * MIN_COS).sqrt();
        let cos_gamma_o = (1.0 - self.h * self.h).max(0.0).sqrt();
        // The refracted ray: inclination, and Bravais' index for its projection.
        let sin_t = sin_theta / self.ior;
        let cos_t = (1.0 - sin_t * sin_t).sqrt();
        let projected_ior = (self.ior * self.ior - sin_theta * sin_theta).sqrt() / cos_theta;
        let sin_gamma_t = self.h / projected_ior;
        let cos_gamma_t = (1.0 - sin_gamma_t * sin_gamma_t).max(0.0).sqrt();
        let transmitted = (-self.absorption * (2.0 * cos_gamma_t / cos_t)).map(f32::exp);
        let (f, _) = fresnel::dielectric(cos_theta * cos_gamma_o, self.ior);
        let tt = (1.0 - f) * (1.0 - f) * transmitted;
        let trt = tt * transmitted * f;
        // At the very edge all is reflected, and nothing is left for the series.
        let again = f * transmitted / (Vec3::ONE - f * transmitted).max(Vec3::splat(f32::MIN_POSITIVE));
        let a = [Vec3::splat(f), tt, trt, trt * again];
        let sum: f32 = a.iter().map(|a| a.element_sum()).sum();
        Outgoing {
            sin_theta,
            cos_theta,
            phi: wo.z.atan2(wo.y),
            gamma_o: self.h.asin(),
            gamma_t: sin_gamma_t.asin(),
            a,
            p: a.map(|a| a.element_sum() / sum),
        }
    }

    /// Sine and cosine of `wo`'s inclination as lobe `p` sees it.
    fn tilted(&self, out: &Outgoing, p: usize) -> (f32, f32) {
        let Some(&Vec2 { x: sin, y: cos }) = self.tilts.get(p) else { return (out.sin_theta, out.cos_theta) };
        let sin_theta = out.sin_theta * cos - out.cos_theta * sin;
        let cos_theta = out.cos_theta * cos + out.sin_theta * sin;
        (sin_theta, cos_theta.abs())
    }

    #[inline(never)]
    pub(super) fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        self.eval_pdf_with(&self.outgoing(wo), wi)
    }

    fn eval_pdf_with(&self, out: &Outgoing, wi: Vec3) -> (Vec3, f32) {
        let sin_theta = wi.x.clamp(-1.0, 1.0);
        let cos_theta = (1.0 - sin_theta * sin_theta).sqrt();
        let phi = wi.z.atan2(wi.y) - out.phi;
        let (mut value, mut pdf) = (Vec3::ZERO, 0.0);
        for p in 0..=LOBES {
            let along = longitudinal(self.tilted(out, p), (sin_theta, cos_theta), self.v[p]);
            let across = if p < LOBES { self.azimuthal(out, p, phi) } else { 0.5 * FRAC_1_PI };
            value += out.a[p] * (along * across);
            pdf += out.p[p] * (along * across);
        }
        (value, pdf)
    }

    /// Density of turning by `phi` in lobe `p` (section 4.3): around the way of a smooth fibre.
    fn azimuthal(&self, out: &Outgoing, p: usize, phi: f32) -> f32 {
        let off = phi - exit_azimuth(out, p);
        trimmed_logistic(off - TAU * (off / TAU).round(), self.s)
    }

    #[inline(never)]
    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let out = self.outgoing(wo);
        let (mut p, mut u_lobe) = (0, u_lobe);
        while p < LOBES && u_lobe >= out.p[p] {
            u_lobe -= out.p[p];
            p += 1;
        }
        // What is left of the number decides the azimuth.
        let u_azimuth = (u_lobe / out.p[p]).clamp(0.0, 1.0);
        let (sin_theta, cos_theta) = sample_longitudinal(self.tilted(&out, p), self.v[p], u);
        let turn = if p < LOBES {
            exit_azimuth(&out, p) + sample_trimmed_logistic(self.s, u_azimuth)
        } else {
            TAU * u_azimuth
        };
        let (sin_phi, cos_phi) = (out.phi + turn).sin_cos();
        let wi = Vec3::new(sin_theta, cos_theta * cos_phi, cos_theta * sin_phi).normalize();
        let (value, pdf) = self.eval_pdf_with(&out, wi);
        if pdf <= 0.0 {
            return None;
        }
        let transmission = wi.z * wo.z < 0.0;
        Some(BsdfSample { wi, weight: value / pdf, pdf, delta: false, transmission, eta: 1.0 })
    }
}

/// By how much a smooth fibre turns light of lobe `p` (Marschner et al. 2003, "Light Scattering from Human Hair
/// Fibers", section 5.1).
fn exit_azimuth(out: &Outgoing, p: usize) -> f32 {
    2.0 * p as f32 * out.gamma_t - 2.0 * out.gamma_o + p as f32 * PI
}

/// The longitudinal lobe of d'Eon et al. 2011, equation 7: density per cosine-weighted inclination, with variance `v`.
/// In the form `exp(-d^2 / 2v) I0(a) exp(-a) / (v (1 - exp(-2 / v)))`, `d` being the chord between the inclination and
/// its mirror image: no exponential is ever large.
fn longitudinal((sin_o, cos_o): (f32, f32), (sin_i, cos_i): (f32, f32), v: f32) -> f32 {
    let (across, along) = (cos_i - cos_o, sin_i + sin_o);
    let chord2 = across * across + along * along;
    let normalization = v * -(-2.0 / v).exp_m1();
    (-0.5 * chord2 / v).exp() * bessel_i0_scaled(cos_i * cos_o / v) / normalization
}

/// Sine and cosine of an inclination drawn from [`longitudinal`] (d'Eon, Marschner and Hanika 2013, "Importance
/// Sampling for Physically-Based Hair Fiber Models").
fn sample_longitudinal((sin_o, cos_o): (f32, f32), v: f32, u: Vec2) -> (f32, f32) {
    let u_cos = 1.0 - u.x;
    // 1 - cos of the angle to the mirrored inclination.
    let height = (-v * (u_cos + (1.0 - u_cos) * (-2.0 / v).exp()).ln()).clamp(0.0, 2.0);
    let (cos, sin) = (1.0 - height, (height * (2.0 - height)).sqrt());
    let (_, cos_phi) = sin_cos_turns(u.y);
    let sin_theta = (-cos * sin_o + sin * cos_phi * cos_o).clamp(-1.0, 1.0);
    (sin_theta, (1.0 - sin_theta * sin_theta).sqrt())
}

/// `I0(x) exp(-x)` for the modified Bessel function of order 0, `x >= 0`, to 2e-7 (Abramowitz and Stegun 1964, 9.8.1
/// and 9.8.2).
fn bessel_i0_scaled(x: f32) -> f32 {
    const NEAR: [f32; 7] =
        [1.0, 3.515_622_9, 3.089_942_4, 1.206_749_2, 0.265_973_2, 0.036_076_8, 0.004_581_3];
    const FAR: [f32; 9] = [
        0.398_942_3,
        0.013_285_92,
        0.002_253_19,
        -0.001_575_65,
        0.009_162_81,
        -0.020_577_06,
        0.026_355_37,
        -0.016_476_33,
        0.003_923_77,
    ];
    let polynomial = |c: &[f32], t: f32| c.iter().rev().fold(0.0, |sum, c| sum * t + c);
    let t = x / 3.75;
    if t < 1.0 { polynomial(&NEAR, t * t) * (-x).exp() } else { polynomial(&FAR, 1.0 / t) / x.sqrt() }
}

/// The logistic distribution of scale `s`, cut off at -pi and pi.
fn trimmed_logistic(x: f32, s: f32) -> f32 {
    let e = (-x.abs() / s).exp();
    let density = e / (s * (1.0 + e) * (1.0 + e));
    // 1 / (1 + exp(-pi / s)) - 1 / (1 + exp(pi / s)).
    density / (0.5 * PI / s).tanh()
}

/// Drawn from [`trimmed_logistic`].
fn sample_trimmed_logistic(s: f32, u: f32) -> f32 {
    let inside = (0.5 * PI / s).tanh();
    let below = 0.5 - 0.5 * inside;
    let cdf = below + u * inside;
    let x = s * (cdf / (1.0 - cdf)).ln();
    if x.is_nan() { 0.0 } else { x.clamp(-PI, PI) }
}

#[cfg(test)]
mod tests {
    use std::f64::consts;

    use super::*;
    use crate::bsdf::Bsdf;
    use crate::testing::{Mean, Rng, Suite, chi_square_directions};

    fn params(h: f32, beta_m: f32, beta_n: f32, absorption: Vec3) -> HairParams {
        HairParams { h, ior: 1.55, absorption, beta_m, beta_n, tilt: 2f32.to_radians() }
    }

    fn hair(p: HairParams) -> Bsdf<'static> {
        Bsdf::Hair(Hair::new(&p))
    }

    fn random(rng: &mut Rng, absorption: Vec3) -> HairParams {
        let tilt = 0.3 * (rng.next_1d() - 0.5);
        let [m, n] = [(); 2].map(|()| 0.1 + 0.9 * rng.next_1d());
        HairParams { tilt, ior: 1.0 + rng.next_1d(), ..params(2.0 * rng.next_1d() - 1.0, m, n, absorption) }
    }

    #[test]
    fn samples_follow_the_density() {
        let mut rng = Rng::new(31);
        let cases = 24;
        let mut suite = Suite::new(cases);
        for seed in 0..cases {
            let p = random(&mut rng, Vec3::new(0.1, 0.5, 2.0));
            let wo = rng.next_direction();
            let bsdf = hair(p);
            let sample = |rng: &mut Rng| Some(bsdf.sample(wo, rng.next_1d(), rng.next_2d())?.wi);
            let found = chi_square_directions(seed as u64, 100_000, sample, |wi| bsdf.pdf(wo, wi));
            suite.judge(found, format!("{p:?}, wo = {wo}"));
        }
    }

    /// Without absorption every fibre scatters all light, wherever and from wherever it is hit.
    #[test]
    fn white_furnace() {
        let mut rng = Rng::new(32);
        let cases = 40;
        let mut suite = Suite::new(2 * cases);
        for _ in 0..cases {
            let p = random(&mut rng, Vec3::ZERO);
            let (bsdf, wo) = (hair(p), rng.next_direction());
            let sampled = Mean::of(5_000, || {
                let s = bsdf.sample(wo, rng.next_1d(), rng.next_2d());
                s.map_or(0.0, |s| f64::from(s.weight.y))
            });
            let uniform =
                Mean::of(100_000, || 4.0 * consts::PI * f64::from(bsdf.eval(wo, rng.next_direction()).y));
            suite.judge(sampled.p_within(&Mean::exact(1.0), ROUNDING), format!("{p:?}, wo = {wo}: sampled"));
            suite.judge(uniform.p_equals(1.0), format!("{p:?}, wo = {wo}: {}", uniform.mean()));
        }
    }

    /// Weights are sums of four quotients of polynomials and exponentials in `f32`.
    const ROUNDING: f64 = 64.0 * f32::EPSILON as f64;

    #[test]
    fn sample_eval_and_pdf_agree() {
        let mut rng = Rng::new(33);
        for _ in 0..20_000 {
            let absorption = Vec3::new(rng.next_1d(), rng.next_1d(), 4.0 * rng.next_1d());
            let (bsdf, wo) = (hair(random(&mut rng, absorption)), rng.next_direction());
            let Some(s) = bsdf.sample(wo, rng.next_1d(), rng.next_2d()) else { continue };
            let (value, pdf) = bsdf.eval_pdf(wo, s.wi);
            assert!(value / pdf == s.weight && pdf == s.pdf);
            assert_eq!(s.transmission, wo.z * s.wi.z < 0.0);
        }
    }

    #[test]
    fn nothing_is_ever_non_finite_or_negative() {
        let mut rng = Rng::new(34);
        let edges = [0.0f32, 1.0, -1.0, 1e-7, 0.5];
        let mut edge = || edges[rng.next_u64() as usize % edges.len()];
        let mut cases = vec![];
        for _ in 0..2000 {
            let p = HairParams {
                tilt: 0.1 * edge(),
                ..params(edge(), edge(), edge(), 1e3 * Vec3::splat(edge()))
            };
            let (z, y) = (edge(), edge());
            let w = Vec3::new(edge(), y, z).normalize_or(Vec3::X);
            cases.push((p, w, [edge(), edge(), edge()].map(|u| u.abs().min(1.0 - f32::EPSILON / 2.0))));
        }
        for (p, wo, [a, b, c]) in cases {
            let bsdf = hair(p);
            for wi in [wo, -wo, Vec3::X, Vec3::Y, rng.next_direction()] {
                let (value, pdf) = bsdf.eval_pdf(wo, wi);
                let sound = value.is_finite() && value.min_element() >= 0.0 && pdf.is_finite() && pdf >= 0.0;
                assert!(sound, "{p:?}: {wo} -> {wi}: {value}, {pdf}");
            }
            if let Some(s) = bsdf.sample(wo, a, Vec2::new(b, c)) {
                assert!(s.weight.is_finite() && s.pdf > 0.0 && s.pdf.is_finite(), "{p:?}: {wo}: {s:?}");
                assert!((s.wi.length() - 1.0).abs() < 1e-5, "{p:?}: {wo}: {s:?}");
            }
        }
    }

    /// The lobes' own integrals: over inclinations weighted by the cosine, and over azimuths.
    #[test]
    fn lobes_are_normalized() {
        let points = 200_000;
        let step = consts::PI / f64::from(points);
        for v in [2e-4, 0.01, 0.099, 0.5, 4.0, 100.0] {
            for theta_o in [0.0f32, 0.5, -1.2, 1.57] {
                let sum: f64 = (0..points)
                    .map(|i| {
                        let theta = (-0.5 * consts::PI + (f64::from(i) + 0.5) * step) as f32;
                        let (o, (sin, cos)) = (theta_o.sin_cos(), theta.sin_cos());
                        f64::from(longitudinal(o, (sin, cos), v) * cos)
                    })
                    .sum();
                assert!((sum * step - 1.0).abs() < 1e-4, "v = {v}, theta = {theta_o}: {}", sum * step);
            }
        }
        for s in [0.002, 0.1, 1.0, 4.0] {
            let density = |i: i32| {
                f64::from(trimmed_logistic((-consts::PI + (f64::from(i) + 0.5) * 2.0 * step) as f32, s))
            };
            let sum = (0..points).map(density).sum::<f64>() * 2.0 * step;
            assert!((sum - 1.0).abs() < 1e-4, "s = {s}: {sum}");
        }
    }

    #[test]
    fn absorption_and_colour_are_inverse() {
        let color = Vec3::new(0.8, 0.3, 0.05);
        let p = params(0.0, 0.3, 0.4, absorption_of_reflectance(color, 0.4));
        assert!((Hair::new(&p).albedo() - color).abs().max_element() < 1e-5);
        assert_eq!(absorption_of_pigments(2.0, 0.0), 2.0 * EUMELANIN);
    }

    /// Seen across the middle of the fibre, R goes straight back and TT straight on, each turned along the fibre by the
    /// tilt of the scales.
    #[test]
    fn scales_turn_the_highlights() {
        let tilt = 0.1f32;
        let p = HairParams { tilt, ..params(0.0, 0.05, 0.1, Vec3::ZERO) };
        let (bsdf, wo) = (hair(p), Vec3::Z);
        let theta_of_peak = |turn: f32| {
            let at = |i: i32| direction_along(i as f32 * 1e-3, turn);
            let peak = (-500..500).max_by(|&a, &b| bsdf.pdf(wo, at(a)).total_cmp(&bsdf.pdf(wo, at(b))));
            peak.expect("not empty") as f32 * 1e-3
        };
        // R mirrors at scales turned by the tilt: by twice that.
        assert!((theta_of_peak(0.0) - 2.0 * tilt).abs() < 5e-3, "{}", theta_of_peak(0.0));
        assert!((theta_of_peak(PI) + tilt).abs() < 5e-3, "{}", theta_of_peak(PI));
    }

    /// At inclination `theta` towards +x, turned around the fibre from +z.
    fn direction_along(theta: f32, turn: f32) -> Vec3 {
        Vec3::new(theta.sin(), theta.cos() * turn.sin(), theta.cos() * turn.cos())
    }

    /// The scaled Bessel function by its integral, `1 / pi` times that of `exp(x (cos t - 1))` over 0..pi.
    #[test]
    fn bessel_function_is_its_integral() {
        let points = 20_000;
        for x in [0.0, 0.3, 3.7, 3.8, 20.0, 600.0] {
            let at = |i: i32| {
                (f64::from(x) * (((f64::from(i) + 0.5) * consts::PI / f64::from(points)).cos() - 1.0)).exp()
            };
            let integral = (0..points).map(at).sum::<f64>() / f64::from(points);
            // 2e-7 of I0 exp(-x) sqrt(x), and rounding.
            let error = (f64::from(bessel_i0_scaled(x)) - integral).abs();
            assert!(error < 1e-6, "{x}: {error}");
        }
    }
}
