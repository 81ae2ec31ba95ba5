//! Sheen of fibres that stand up from cloth: KHR_materials_sheen, after Estevez and Kulla 2017, "Production Friendly
//! Microfacet Sheen BRDF".
//!
//! Departure: the published lobe reflects up to four times the light that arrives at grazing angles where it is narrow.
//! It is divided by that excess, in both directions.

use std::f32::consts::{FRAC_1_PI, PI};
use std::sync::OnceLock;

use glam::Vec3;

/// Narrower lobes than of this roughness are widened to it: below, all the lobe lies within a few degrees of the
/// horizon, where it cannot be told from its border.
const MIN_ROUGHNESS: f32 = 0.07;
/// Cosines below this count as this: the fitted visibility says nothing there, and diverges.
const MIN_COS: f32 = 1e-3;
/// Cells along each axis of the table: the roughness, and the fourth root of the cosine, since the fitted Lambda changes
/// with its fifth.
const CELLS: usize = 48;
/// Quadrature points in azimuth (half a turn) and height.
const QUADRATURE: [u32; 2] = [48, 128];
/// Interpolation is off by less than this (the tests hold it to it), and rounded to the safe side by it.
const MAX_ERROR: f32 = 0.01;

/// A sheen lobe.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sheen {
    color: Vec3,
    /// Of the lobe: the square of the perceptual roughness.
    alpha: f32,
    row: u32,
    /// Place between this row and the next.
    between: f32,
}

impl Sheen {
    /// Of a colour and a perceptual roughness in 0..1; `None` for black.
    pub(super) fn new(color: Vec3, roughness: f32) -> Option<Self> {
        if color == Vec3::ZERO {
            return None;
        }
        let roughness = roughness.max(MIN_ROUGHNESS);
        let place = (roughness - MIN_ROUGHNESS) / (1.0 - MIN_ROUGHNESS) * CELLS as f32;
        let row = (place as u32).min(CELLS as u32 - 1);
        Some(Self { color, alpha: roughness * roughness, row, between: place - row as f32 })
    }

    /// Albedo of a white lobe before it is cut to what arrives, at cosine `cos >= 0`.
    #[inline]
    fn albedo(&self, cos: f32) -> f32 {
        let x = cos.sqrt().sqrt() * CELLS as f32;
        let i = (x as usize).min(CELLS - 1);
        let at = |row: u32| {
            let row = row_of(row as usize);
            row[i] + (row[i + 1] - row[i]) * (x - i as f32)
        };
        at(self.row) + (at(self.row + 1) - at(self.row)) * self.between + MAX_ERROR
    }

    /// Share of light that it leaves to the layers below, at cosine `cos >= 0`: its largest channel counts.
    #[inline]
    pub(super) fn left(&self, cos: f32) -> f32 {
        1.0 - self.color.max_element() * self.albedo(cos).min(1.0)
    }

    /// BRDF times cosine for two directions on +z's side.
    #[inline]
    pub(super) fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let excess = self.albedo(wo.z).max(self.albedo(wi.z)).max(1.0);
        self.color * (lobe(self.alpha, wo, wi) / excess)
    }
}

/// BRDF times cosine of the lobe of colour 1: the extension's "Charlie" distribution and its fitted visibility.
fn lobe(alpha: f32, wo: Vec3, wi: Vec3) -> f32 {
    let h = wo + wi;
    let sin2 = ((h.x * h.x + h.y * h.y) / h.length_squared()).min(1.0);
    let d = (2.0 + 1.0 / alpha) * sin2.powf(0.5 / alpha) * (0.5 * FRAC_1_PI);
    let (cos_o, cos_i) = (wo.z.max(MIN_COS), wi.z.max(MIN_COS));
    d * (wi.z / cos_i) / ((1.0 + lambda(alpha, cos_o) + lambda(alpha, cos_i)) * 4.0 * cos_o)
}

/// Smith's Lambda of the distribution, fitted (Estevez and Kulla 2017, section 3).
fn lambda(alpha: f32, cos: f32) -> f32 {
    let t = (1.0 - alpha) * (1.0 - alpha);
    let mix = |rough: f32, smooth: f32| rough + (smooth - rough) * t;
    let [a, b, c, d, e] = [
        mix(21.5473, 25.3245),
        mix(3.82987, 3.32435),
        mix(0.19823, 0.16801),
        mix(-1.97760, -1.27393),
        mix(-4.32054, -4.85967),
    ];
    let fit = |x: f32| a / (1.0 + b * x.powf(c)) + d * x + e;
    let cos = cos.min(1.0);
    if cos < 0.5 { fit(cos).exp() } else { (2.0 * fit(0.5) - fit(1.0 - cos)).exp() }
}

/// Filled row by row as scenes ask, like the table of GGX.
static TABLE: [OnceLock<[f32; CELLS + 1]>; CELLS + 1] = [const { OnceLock::new() }; CELLS + 1];

#[inline(always)]
fn row_of(j: usize) -> &'static [f32; CELLS + 1] {
    TABLE[j].get_or_init(|| row(j))
}

#[cold]
fn row(j: usize) -> [f32; CELLS + 1] {
    let roughness = MIN_ROUGHNESS + (1.0 - MIN_ROUGHNESS) * j as f32 / CELLS as f32;
    std::array::from_fn(|i| {
        let root = i as f32 / CELLS as f32;
        integrate(roughness * roughness, root.powi(4), QUADRATURE)
    })
}

/// Albedo by quadrature, points lying closer together towards the horizon.
fn integrate(alpha: f32, cos: f32, [columns, rows]: [u32; 2]) -> f32 {
    let wo = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
    let mut sum = 0.0;
    for i in 0..columns {
        let (y, x) = (PI * (i as f32 + 0.5) / columns as f32).sin_cos();
        for j in 0..rows {
            let root = (j as f32 + 0.5) / rows as f32;
            let z = root * root;
            let radius = (1.0 - z * z).sqrt();
            sum += f64::from(lobe(alpha, wo, Vec3::new(radius * x, radius * y, z)) * 2.0 * root);
        }
    }
    (sum * f64::from(2.0 * PI) / f64::from(columns * rows)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Rng;

    #[test]
    fn interpolation_keeps_its_promise() {
        let mut rng = Rng::new(1);
        for _ in 0..200 {
            let (roughness, cos) = (MIN_ROUGHNESS.max(rng.next_1d()), rng.next_1d().powi(3));
            let sheen = Sheen::new(Vec3::ONE, roughness).expect("not black");
            let expected = integrate(sheen.alpha, cos, [100, 400]);
            let error = sheen.albedo(cos) - MAX_ERROR - expected;
            // Where more than all is reflected, the excess is what counts: relative.
            assert!(error.abs() < MAX_ERROR * expected.max(1.0), "{roughness}, {cos}: {error} of {expected}");
        }
    }
}
