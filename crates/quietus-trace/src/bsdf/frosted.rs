//! Rough glass that keeps its light.
//!
//! A rough dielectric (Walter et al. 2007) follows light to one facet and forgets what a second one would have met: more than a
//! third of it where glass is rough and dense. Here that comes back on both sides, as one lobe to each after Kulla and Conty 2017
//! ("Revisiting Physically Based Shading at Imageworks"): `lost(wo) lost(wi) / mean(lost)`, which is reciprocal, times shares
//! for reflection and refraction that keep the whole so.

mod blind;

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use super::ggx::Ggx;
use super::layered::coat_table::{alpha_of, lerp, mean, over_facets, place, place_of};
use super::{BsdfSample, Dielectric, fresnel};
use crate::warp;
use blind::{BlindAt, BlindFacets};

/// Cells along the axis of angles.
const CELLS: usize = 96;
/// Cells along the axis of roughness where that is textured.
const ALPHA_CELLS: usize = 24;
/// Quadrature points in azimuth (half a period, hence few) and along the cap of visible normals.
const QUADRATURE: [u32; 2] = [21, 144];
/// Points of means over angles.
const MEAN_POINTS: u32 = 1024;
/// Interpolation is off by less than this (the tests hold it to it): what is lost is rounded down by as much, so that no light
/// is gained.
pub(super) const MAX_ERROR: f32 = 4e-3;

/// The largest random number.
const ALMOST_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

/// What rough glass of a given index loses by single scattering.
#[derive(Clone, Debug)]
pub struct FrostedTable {
    /// Mean reflectance of its facets under light from all directions, from outside and from inside.
    reflectance: [f32; 2],
    /// One for glass that is equally rough everywhere, else the fourth root of alpha in even steps.
    rows: Vec<[Row; 2]>,
    /// Those seen from the denser side, of that roughness or between each two of them.
    blind: Vec<BlindFacets>,
}

/// One roughness, seen from one side.
#[derive(Clone, Debug)]
struct Row {
    /// By angle, see [`axis`].
    lost: [f32; CELLS + 1],
    /// Cosine-weighted.
    mean: f32,
}

/// Glass with its losses brought back.
#[derive(Clone, Copy, Debug)]
pub struct FrostedGlass<'a> {
    surface: Dielectric,
    rows: (&'a [Row; 2], &'a [Row; 2], f32),
    blind: &'a BlindFacets,
    /// Mean losses on both sides.
    mean: [f32; 2],
    /// Share that goes through of what is lost on each side.
    through: [f32; 2],
}

impl FrostedTable {
    /// For an index inside over outside, and one alpha, or all where it varies (`None`).
    pub fn new(ior: f32, alpha: Option<f32>) -> Self {
        let rows = |alpha: f32| {
            let surface = Dielectric::new(ior, Ggx::new(Vec2::splat(alpha)), Vec3::ONE);
            [1.0, -1.0].map(|side| Row::new(&surface, alpha, side))
        };
        let alphas: Vec<_> = match alpha {
            Some(alpha) => vec![alpha],
            None => (0..=ALPHA_CELLS).map(|i| alpha_of(i as f32 / ALPHA_CELLS as f32)).collect(),
        };
        let blind = match &alphas[..] {
            &[only] => vec![BlindFacets::new(ior, [only, only])],
            all => all.windows(2).map(|pair| BlindFacets::new(ior, [pair[0], pair[1]])).collect(),
        };
        let rows = alphas.into_iter().map(rows).collect();
        let reflectance =
            [ior, 1.0 / ior].map(|eta| mean(MEAN_POINTS, |cos| fresnel::dielectric(cos, eta).0));
        Self { reflectance, rows, blind }
    }

    /// Glass with the facets of `surface`, which is rough and has this table's index.
    #[inline]
    pub fn glass(&self, surface: Dielectric) -> FrostedGlass<'_> {
        let (rows, blind) = match &self.rows[..] {
            [only] => ((only, only, 0.0), &self.blind[0]),
            rows => {
                let (i, between) = place(place_of(surface.alpha().x), ALPHA_CELLS);
                ((&rows[i], &rows[i + 1], between), &self.blind[i])
            }
        };
        let mean = [0, 1].map(|side| lerp(rows.0[side].mean, rows.1[side].mean, rows.2));
        // As much goes through as facets let pass on average, if both sides can have that and stay reciprocal: light that is
        // refracted either way carries the square of the index.
        let square = surface.ior() * surface.ior();
        let [outside, inside] = self.reflectance.map(|reflectance| 1.0 - reflectance);
        let common = (outside / (square * mean[1])).min(inside / mean[0]);
        let through = if mean[0] > 0.0 && mean[1] > 0.0 {
            [common * square * mean[1], common * mean[0]]
        } else {
            [0.0; 2]
        };
        FrostedGlass { surface, rows, blind, mean, through }
    }
}

impl Row {
    fn new(surface: &Dielectric, alpha: f32, side: f32) -> Self {
        let lost = std::array::from_fn(|i| {
            let kept = kept(surface, cosine(i as f32 / CELLS as f32, alpha), side, QUADRATURE);
            (1.0 - kept - MAX_ERROR).max(0.0)
        });
        let mut row = Self { lost, mean: 0.0 };
        row.mean = mean(MEAN_POINTS, |cos| row.lost(axis(cos, alpha)));
        row
    }

    #[inline]
    fn lost(&self, axis: f32) -> f32 {
        let (i, t) = place(axis, CELLS);
        lerp(self.lost[i], self.lost[i + 1], t)
    }
}

/// The place of an angle in 0..1: losses change where the angle to the horizon is about alpha.
#[inline]
fn axis(cos: f32, alpha: f32) -> f32 {
    (cos * (1.0 + alpha) / (cos + alpha)).sqrt().min(1.0)
}

/// Its inverse.
fn cosine(axis: f32, alpha: f32) -> f32 {
    let x = axis * axis;
    x * alpha / (1.0 + alpha - x)
}

/// Share of light from one side that single scattering keeps.
fn kept(surface: &Dielectric, cos: f32, side: f32, points: [u32; 2]) -> f32 {
    over_facets(points, cos, |w, u| {
        let parts = [false, true].map(|through| surface.sample_part(w * side, through, u));
        Some(parts.into_iter().flatten().map(|(_, share, _)| share).sum())
    })
}

/// What depends on `wo` alone.
struct Outgoing<'a> {
    /// Share of light that single scattering loses.
    lost: f32,
    /// Facets that are not drawn, where there are such.
    blind: Option<BlindAt<'a>>,
    /// Probability that what comes back is drawn without a look at facets.
    direct: f32,
    /// And with the draws that would find blind facets.
    again: f32,
}

impl FrostedGlass<'_> {
    /// Share of light that single scattering loses, in a direction on either side.
    #[inline]
    fn lost(&self, w: Vec3) -> f32 {
        self.lost_at(self.axis(w), side(w))
    }

    #[inline]
    fn axis(&self, w: Vec3) -> f32 {
        axis(w.z.abs().min(1.0), self.surface.alpha().x)
    }

    #[inline]
    fn lost_at(&self, axis: f32, side: usize) -> f32 {
        let (low, high, between) = self.rows;
        lerp(low[side].lost(axis), high[side].lost(axis), between)
    }

    /// Each lobe is drawn as often as it has light, and blind facets never.
    #[inline]
    fn outgoing(&self, wo: Vec3) -> Outgoing<'_> {
        let axis = self.axis(wo);
        let lost = self.lost_at(axis, side(wo));
        let blind = (self.surface.relative_eta(wo) < 1.0).then(|| self.blind.at(axis));
        let share = blind.map_or(0.0, |blind| blind.share());
        let direct = ((lost - share) / (1.0 - share)).max(0.0);
        Outgoing { lost, blind, direct, again: direct + (1.0 - direct) * share }
    }

    /// Value and density of what comes back, given what is lost at `wo`.
    #[inline]
    fn eval_pdf_lost(&self, wo: Vec3, wi: Vec3, lost: f32) -> (Vec3, f32) {
        let (from, to) = (side(wo), side(wi));
        let cosine = wi.z.abs() * FRAC_1_PI;
        let energy = if self.mean[to] > 0.0 { lost * self.lost(wi) / self.mean[to] * cosine } else { 0.0 };
        if from == to {
            let share = 1.0 - self.through[from];
            return (Vec3::splat(share * energy), share * cosine);
        }
        let (share, eta) = (self.through[from], self.surface.relative_eta(wo));
        (self.surface.tint() * (share * energy / (eta * eta)), share * cosine)
    }

    #[inline]
    pub(super) fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        if wo.z == 0.0 || wi.z == 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        self.with_again(&self.outgoing(wo), wo, wi, self.surface.eval_pdf_open(wo, wi))
    }

    /// Value and density of all, given those of single scattering.
    #[inline]
    fn with_again(&self, out: &Outgoing, wo: Vec3, wi: Vec3, (once, once_pdf): (Vec3, f32)) -> (Vec3, f32) {
        let (again, again_pdf) = self.eval_pdf_lost(wo, wi, out.lost);
        (once + again, (1.0 - out.direct) * once_pdf + out.again * again_pdf)
    }

    #[inline]
    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z == 0.0 {
            return None;
        }
        let out = self.outgoing(wo);
        let (wi, once) = self.draw(&out, wo, u_lobe, u)?;
        let (value, pdf) = self.with_again(&out, wo, wi, once);
        let transmission = side(wi) != side(wo);
        let eta = if transmission { self.surface.relative_eta(wo) } else { 1.0 };
        (pdf > 0.0 && wi.z != 0.0).then(|| BsdfSample {
            wi,
            weight: value / pdf,
            pdf,
            delta: false,
            transmission,
            eta,
        })
    }

    /// A direction, with value and density of single scattering there.
    #[inline]
    fn draw(&self, out: &Outgoing, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<(Vec3, (Vec3, f32))> {
        let (passes, u) = if u_lobe < out.direct {
            (self.passes(wo, u_lobe / out.direct).0, u)
        } else {
            let u_lobe = ((u_lobe - out.direct) / (1.0 - out.direct)).min(ALMOST_ONE);
            let Some(beyond) = out.blind.and_then(|blind| blind.beyond(u)) else {
                // Azimuths of facets count from that of `wo`.
                let sin = wo.truncate().length();
                let axis = if sin > 0.0 { wo.truncate() / sin } else { Vec2::X };
                let (wi, value, pdf) = self.surface.sample_open(Vec3::new(sin, 0.0, wo.z), u_lobe, u)?;
                return Some((axis.rotate(wi.truncate()).extend(wi.z), (value, pdf)));
            };
            let (passes, rest) = self.passes(wo, u_lobe);
            (passes, Vec2::new(rest, beyond))
        };
        let same_side = warp::cosine_hemisphere(u) * 1f32.copysign(wo.z);
        let wi = if passes { -same_side } else { same_side };
        Some((wi, self.surface.eval_pdf_open(wo, wi)))
    }

    /// Whether what comes back passes through, and a random number that is left of `u`.
    #[inline]
    fn passes(&self, wo: Vec3, u: f32) -> (bool, f32) {
        let through = self.through[side(wo)];
        let passes = u < through;
        let rest = if passes { u / through } else { (u - through) / (1.0 - through) };
        (passes, rest.min(ALMOST_ONE))
    }

    pub(super) fn albedo(&self) -> Vec3 {
        self.surface.albedo()
    }
}

/// 0 outside, 1 inside.
#[inline]
fn side(w: Vec3) -> usize {
    usize::from(w.z < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Rng;

    /// For the roughness a table is made for, and between those of the table for all.
    #[test]
    fn interpolation_keeps_its_promise() {
        let mut rng = Rng::new(1);
        for _ in 0..6 {
            let ior = 0.5 + 2.0 * rng.next_1d();
            let all = FrostedTable::new(ior, None);
            for _ in 0..3 {
                let alpha = 0.01f32.powf(rng.next_1d());
                let surface = Dielectric::new(ior, Ggx::new(Vec2::splat(alpha)), Vec3::ONE);
                let own = FrostedTable::new(ior, Some(alpha));
                for _ in 0..20 {
                    let (cos, side) = (rng.next_1d().powi(2), 1f32.copysign(rng.next_1d() - 0.5));
                    let w = Vec3::new(0.0, (1.0 - cos * cos).sqrt(), side * cos);
                    let expected = (1.0 - kept(&surface, cos, side, [55, 500]) - MAX_ERROR).max(0.0);
                    for found in [&own, &all].map(|table| table.glass(surface).lost(w)) {
                        assert!(
                            (found - expected).abs() < MAX_ERROR,
                            "{found} of {expected}, index {ior}, alpha {alpha}, cosine {cos}, side {side}"
                        );
                    }
                }
            }
        }
    }
}
