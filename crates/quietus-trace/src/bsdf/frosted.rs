//! Rough glass that keeps its light.
//!
//! A rough dielectric (Walter et al. 2007) follows light to one facet and forgets what a second one would have met: more than a
//! third of it where glass is rough and dense. Here that comes back on both sides, as one lobe to each after Kulla and Conty 2017
//! ("Revisiting Physically Based Shading at Imageworks"): `lost(wo) lost(wi) / mean(lost)`, which is reciprocal, times shares
//! for reflection and refraction that keep the whole so.

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use super::ggx::Ggx;
use super::layered::coat_table::{alpha_of, lerp, mean, over_facets, place, place_of};
use super::{BsdfSample, Dielectric, fresnel};
use crate::warp;

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

/// What rough glass of a given index loses by single scattering.
#[derive(Clone, Debug)]
pub struct FrostedTable {
    /// Mean reflectance of its facets under light from all directions, from outside and from inside.
    reflectance: [f32; 2],
    /// One for glass that is equally rough everywhere, else the fourth root of alpha in even steps.
    rows: Vec<[Row; 2]>,
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
        let rows = match alpha {
            Some(alpha) => vec![rows(alpha)],
            None => (0..=ALPHA_CELLS).map(|i| rows(alpha_of(i as f32 / ALPHA_CELLS as f32))).collect(),
        };
        let reflectance =
            [ior, 1.0 / ior].map(|eta| mean(MEAN_POINTS, |cos| fresnel::dielectric(cos, eta).0));
        Self { reflectance, rows }
    }

    /// Glass with the facets of `surface`, which is rough and has this table's index.
    #[inline]
    pub fn glass(&self, surface: Dielectric) -> FrostedGlass<'_> {
        let rows = match &self.rows[..] {
            [only] => (only, only, 0.0),
            rows => {
                let (i, between) = place(place_of(surface.alpha().x), ALPHA_CELLS);
                (&rows[i], &rows[i + 1], between)
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
        FrostedGlass { surface, rows, mean, through }
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

impl FrostedGlass<'_> {
    /// Share of light that single scattering loses, in a direction on either side.
    #[inline]
    fn lost(&self, w: Vec3) -> f32 {
        let side = side(w);
        let axis = axis(w.z.abs().min(1.0), self.surface.alpha().x);
        let (low, high, between) = self.rows;
        lerp(low[side].lost(axis), high[side].lost(axis), between)
    }

    /// Value and density of what comes back, given what is lost at `wo`.
    #[inline]
    fn eval_pdf_lost(&self, wo: Vec3, wi: Vec3, lost: f32) -> (Vec3, f32) {
        let (from, to) = (side(wo), side(wi));
        if lost <= 0.0 || self.mean[to] <= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let cosine = wi.z.abs() * FRAC_1_PI;
        let energy = lost * self.lost(wi) / self.mean[to] * cosine;
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
        let lost = self.lost(wo);
        let (once, once_pdf) = self.surface.eval_pdf(wo, wi);
        let (again, again_pdf) = self.eval_pdf_lost(wo, wi, lost);
        (once + again, once_pdf + lost * (again_pdf - once_pdf))
    }

    #[inline]
    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z == 0.0 {
            return None;
        }
        let lost = self.lost(wo);
        let wi = if u_lobe < lost {
            let passes = u_lobe < lost * self.through[side(wo)];
            let same_side = warp::cosine_hemisphere(u) * 1f32.copysign(wo.z);
            if passes { -same_side } else { same_side }
        } else {
            self.surface.sample(wo, ((u_lobe - lost) / (1.0 - lost)).min(1.0 - f32::EPSILON / 2.0), u)?.wi
        };
        let (value, pdf) = self.eval_pdf(wo, wi);
        let transmission = side(wi) != side(wo);
        let eta = if transmission { self.surface.relative_eta(wo) } else { 1.0 };
        (pdf > 0.0).then(|| BsdfSample { wi, weight: value / pdf, pdf, delta: false, transmission, eta })
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
