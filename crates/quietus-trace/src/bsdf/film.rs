//! Reflectance of a surface under a thin film, whose two borders reflect light that interferes: soap bubbles, oil on
//! water, tempered steel.
//!
//! After Belcour and Barla 2017, "A Practical Extension to Microfacet Theory for the Modeling of Varying Iridescence",
//! section 3, in the form of KHR_materials_iridescence: Airy's summation as a Fourier series in the optical path
//! difference, cut off after two terms, seen through eyes whose sensitivity is known in closed form in that domain.
//! Borders reflect by Schlick's approximation, the base has a real index of refraction per channel.
//!
//! The colour is clamped to what interference can do at any wavelength, from all reflected waves against each other to
//! all of them together: colours outside of the gamut of RGB would else be below 0, or above what arrives.

use std::f32::consts::PI;

use glam::{Mat3, Vec3};

use super::{albedo_table::SplitAlbedo, fresnel::schlick_weight};

/// Highest reflectance of a border: that of 1 would need an infinite index of refraction.
const MAX_REFLECTANCE: f32 = 0.9999;
/// Thickness, in nanometres, from which on the film has its own index: below it fades to none at all.
const FULL_THICKNESS: f32 = 0.03;

/// A film between air and a base.
#[derive(Clone, Copy, Debug)]
pub struct Film {
    /// Share of the surface it covers, in 0..1.
    strength: f32,
    /// Index of refraction.
    ior: f32,
    /// Difference of the optical paths at normal incidence, in nanometres.
    path: f32,
    /// Reflectance of the upper border at normal incidence.
    upper: f32,
    /// Reflectance of the lower one at normal incidence, per channel.
    lower: Vec3,
    /// What both reflections add to the phase.
    shift: Vec3,
}

/// Properties of a film that do not depend on what is below it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmParams {
    /// Share of the surface it covers, in 0..1.
    pub strength: f32,
    /// Index of refraction, at least 1.
    pub ior: f32,
    /// In nanometres, at least 0.
    pub thickness: f32,
}

impl Film {
    /// Over a base that reflects `base` (0..1) in air at normal incidence; `None` where there is no film.
    pub fn new(params: FilmParams, base: Vec3) -> Option<Self> {
        let FilmParams { strength, ior, thickness } = params;
        if strength <= 0.0 || thickness <= 0.0 {
            return None;
        }
        let t = (thickness / FULL_THICKNESS).min(1.0);
        let ior = 1.0 + (ior.max(1.0) - 1.0) * (t * t * (3.0 - 2.0 * t));
        let root = base.clamp(Vec3::ZERO, Vec3::splat(MAX_REFLECTANCE)).map(f32::sqrt);
        let below = (1.0 + root) / (1.0 - root);
        // The upper border turns the wave that it lets pass and reflects from within; the lower one where it is denser.
        let shift = PI + Vec3::select(below.cmplt(Vec3::splat(ior)), Vec3::splat(PI), Vec3::ZERO);
        let amplitude = (below - ior) / (below + ior);
        let upper = ((ior - 1.0) / (ior + 1.0)).powi(2);
        Some(Self { strength, ior, path: 2.0 * ior * thickness, upper, lower: amplitude * amplitude, shift })
    }

    /// Share of the surface it covers.
    #[inline]
    pub(super) fn strength(&self) -> f32 {
        self.strength
    }

    /// Reflectance at cosine `cos >= 0` in air.
    pub(super) fn reflectance(&self, cos: f32) -> Vec3 {
        let within = self.cosine_within(cos);
        let upper = schlick(Vec3::splat(self.upper), cos).min(Vec3::splat(MAX_REFLECTANCE));
        let lower = schlick(self.lower, within).min(Vec3::splat(MAX_REFLECTANCE));
        let terms = [1.0, 2.0].map(|m| sensitivity(m * self.path * within, m * self.shift));
        let (a, b) = (upper.map(f32::sqrt), lower.map(f32::sqrt));
        let (least, most) = ((a - b) / (1.0 - a * b), (a + b) / (1.0 + a * b));
        airy(upper, lower, terms).clamp(least * least, most * most)
    }

    /// `plain` where there is no film, its reflectance where there is.
    #[inline]
    pub(super) fn over(&self, plain: Vec3, cos: f32) -> Vec3 {
        plain.lerp(self.reflectance(cos), self.strength)
    }

    /// At least the albedo of a lobe of facets under the film, in any channel.
    ///
    /// Let all waves work together: `r = ((sqrt(x) + b) / (1 + b sqrt(x)))^2`, where the upper border reflects
    /// `x`, linear in Schlick's weight, and the lower one at most `b^2`. That is concave in `x`, and by Jensen's
    /// inequality its mean over the facets is at most what it is at their mean weight.
    #[inline]
    pub(super) fn albedo_bound(&self, e: SplitAlbedo) -> f32 {
        let total = e.a + e.b;
        total * self.bound(if total > 0.0 { e.b / total } else { 0.0 })
    }

    /// At most the mean of [`albedo_bound`](Self::albedo_bound) over angles, of which `mean` is the mean of albedos: the
    /// chord of a concave function.
    #[inline]
    pub(super) fn mean_bound(&self, mean: SplitAlbedo) -> f32 {
        mean.a * self.bound(0.0) + mean.b * self.bound(1.0)
    }

    /// The highest reflectance at any angle with Schlick's weight `weight`.
    #[inline]
    fn bound(&self, weight: f32) -> f32 {
        let grazing = schlick(self.lower, self.cosine_within(0.0)).max_element();
        let (a, b) = ((self.upper + (1.0 - self.upper) * weight).sqrt(), grazing.min(1.0).sqrt());
        let amplitude = (a + b) / (1.0 + a * b);
        amplitude * amplitude
    }

    /// Cosine inside the film.
    #[inline]
    fn cosine_within(&self, cos: f32) -> f32 {
        (1.0 - (1.0 - cos * cos).max(0.0) / (self.ior * self.ior)).max(0.0).sqrt()
    }
}

#[inline]
fn schlick(f0: Vec3, cos: f32) -> Vec3 {
    f0 + (1.0 - f0) * schlick_weight(cos)
}

/// Airy's sum for borders that reflect `upper` and `lower` of the light; `terms[m - 1]` stands for the cosine of `m` times
/// the phase.
#[inline]
fn airy(upper: Vec3, lower: Vec3, terms: [Vec3; 2]) -> Vec3 {
    let both = upper * lower;
    let root = both.map(f32::sqrt);
    let pass = 1.0 - upper;
    let returned = pass * pass * lower / (1.0 - both);
    let mut sum = upper + returned;
    let mut amplitude = returned - pass;
    for term in terms {
        amplitude *= root;
        sum += 2.0 * amplitude * term;
    }
    sum
}

/// The eye's mean of the cosine of `2 pi path / wavelength + shift` over wavelengths, as linear RGB: Gaussians fitted to the
/// Fourier transform of the CIE's matching functions. `path` is in nanometres. The numbers are those of Belcour and
/// Barla's supplemental code, which the extension gives too.
fn sensitivity(path: f32, shift: Vec3) -> Vec3 {
    const HEIGHT: [f32; 4] = [5.4856e-13, 4.4201e-13, 5.2481e-13, 9.7470e-14];
    const CENTER: [f32; 4] = [1.6810e6, 1.7953e6, 2.2084e6, 2.2399e6];
    const VARIANCE: [f32; 4] = [4.3278e9, 9.3046e9, 6.6121e9, 4.5282e9];
    const NORM: f32 = 1.0685e-7;
    const XYZ_TO_RGB: Mat3 = Mat3::from_cols_array(&[
        3.240_454_2,
        -0.969_266,
        0.055_643_4,
        -1.537_138_5,
        1.876_010_8,
        -0.204_025_9,
        -0.498_531_4,
        0.041_556_0,
        1.057_225_2,
    ]);
    let phase = 2.0 * PI * path * 1e-9;
    // X has a second hump in the blue.
    let shifts = [shift.x, shift.y, shift.z, shift.x];
    let lobe = |i: usize| {
        let width = (2.0 * PI * VARIANCE[i]).sqrt() * (-VARIANCE[i] * phase * phase).exp();
        HEIGHT[i] * width * (CENTER[i] * phase + shifts[i]).cos() / NORM
    };
    XYZ_TO_RGB * Vec3::new(lobe(0) + lobe(3), lobe(1), lobe(2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Rng;

    fn random_film(rng: &mut Rng) -> Film {
        let params = FilmParams {
            strength: 1.0,
            ior: 1.0 + 1.5 * rng.next_1d(),
            thickness: 1200.0 * rng.next_1d() + 1.0,
        };
        let base = Vec3::new(rng.next_1d(), rng.next_1d().powi(3), rng.next_1d());
        Film::new(params, base).expect("a film")
    }

    /// For one wavelength the series is the textbook's `|(r1 + r2 e^ip) / (1 + r1 r2 e^ip)|^2`, but for the terms that are
    /// cut off, a geometric series.
    #[test]
    fn the_series_is_airys_formula() {
        let mut rng = Rng::new(31);
        for _ in 0..2000 {
            let (r1, r2) = (rng.next_1d() * 0.9, rng.next_1d() * 0.9);
            let phase = 2.0 * PI * rng.next_1d();
            // Both borders turn the wave, and the upper one from within does not: the shift is pi.
            let terms = [1.0, 2.0].map(|m| Vec3::splat((m * (phase + PI)).cos()));
            let found = airy(Vec3::splat(r1 * r1), Vec3::splat(r2 * r2), terms).x;
            let (re, im) = (phase.cos(), phase.sin());
            let over = (r1 + r2 * re).powi(2) + (r2 * im).powi(2);
            let under = (1.0 + r1 * r2 * re).powi(2) + (r1 * r2 * im).powi(2);
            let root = r1 * r2;
            let pass = 1.0 - r1 * r1;
            let first = (pass * pass * r2 * r2 / (1.0 - root * root) - pass).abs();
            let rest = 2.0 * first * root.powi(3) / (1.0 - root);
            assert!((found - over / under).abs() <= rest + 64.0 * f32::EPSILON, "{r1}, {r2}, {phase}");
        }
    }

    /// In a thick film colours average out: what is left is the sum of what the borders send back on their own.
    #[test]
    fn thick_films_are_two_borders() {
        let film = Film::new(FilmParams { strength: 1.0, ior: 1.4, thickness: 1e6 }, Vec3::splat(0.04));
        let film = film.expect("a film");
        let (upper, lower) = (film.upper, film.lower.x);
        let expected = upper + (1.0 - upper) * (1.0 - upper) * lower / (1.0 - upper * lower);
        assert!((film.reflectance(1.0) - expected).abs().max_element() < 8.0 * f32::EPSILON);
    }

    /// A film that is hardly there shows its base.
    #[test]
    fn vanishing_films_leave_the_base() {
        let base = Vec3::new(0.04, 0.3, 0.8);
        let none = FilmParams { strength: 1.0, ior: 1.7, thickness: 0.0 };
        assert!(
            Film::new(none, base).is_none()
                && Film::new(FilmParams { strength: 0.0, ..none }, base).is_none()
        );
        // The fading index is that of air to within rounding, of which the root of the upper border's reflectance sees
        // the root; that border's wave interferes with the base's.
        let film = Film::new(FilmParams { thickness: 1e-6, ..none }, base).expect("a film");
        let off = (film.reflectance(1.0) - base).abs().max_element();
        assert!(off <= 4.0 * f32::EPSILON.sqrt(), "{off}");
    }

    #[test]
    fn reflectance_stays_between_nothing_and_the_bound() {
        let mut rng = Rng::new(32);
        for _ in 0..20_000 {
            let film = random_film(&mut rng);
            let cos = rng.next_1d();
            let found = film.reflectance(cos);
            let bound = film.bound(schlick_weight(cos));
            let most = found.max_element();
            assert!(
                found.min_element() >= 0.0 && most <= bound + 8.0 * f32::EPSILON,
                "{film:?}, {cos}: {found}"
            );
        }
    }

    /// Concave, as both bounds of albedos need.
    #[test]
    fn the_bound_is_concave() {
        let mut rng = Rng::new(33);
        for _ in 0..20_000 {
            let film = random_film(&mut rng);
            let (v, w, t) = (rng.next_1d(), rng.next_1d(), rng.next_1d());
            let chord = film.bound(v) + (film.bound(w) - film.bound(v)) * t;
            assert!(film.bound(v + (w - v) * t) >= chord - 16.0 * f32::EPSILON, "{film:?}");
        }
    }
}
