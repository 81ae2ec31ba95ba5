//! How much light a dielectric coat lets pass, by angle and roughness.

use glam::{Vec2, Vec3};

use crate::bsdf::{
    Dielectric, fresnel,
    ggx::{Ggx, MIN_ALPHA},
};

/// Cells along the axis of angles, the root of the cosine: near the horizon the passage grows with the cosine, and a
/// narrow lobe's masking lies there.
const CELLS: usize = 48;
/// Cells along the axis of roughness where that is textured.
const ALPHA_CELLS: usize = 24;
/// Quadrature points in azimuth (half a period, hence few) and along the cap of visible normals.
const QUADRATURE: [u32; 2] = [13, 48];
/// Points of the mean over angles, uniform in the squared cosine.
const MEAN_POINTS: u32 = 64;
/// The same for smooth coats, where a point costs next to nothing.
const SMOOTH_MEAN_POINTS: u32 = 4096;
/// Interpolation and quadrature are off by less than this (the tests hold them to it).
#[cfg(test)]
pub(super) const MAX_ERROR: f32 = 2e-3;

/// The passage through a coat of a given index, over a medium of a given depth that only absorbs.
#[derive(Clone, Debug)]
pub struct CoatTable {
    ior: f32,
    thickness: f32,
    /// Of the perfectly smooth coat.
    smooth_return: f32,
    /// By roughness: none for a coat that is smooth everywhere, one for one that is equally rough everywhere, else the
    /// fourth root of alpha in even steps.
    rows: Vec<Row>,
}

/// One roughness.
#[derive(Clone, Debug)]
struct Row {
    /// Share of light that reaches the base, by the root of the cosine.
    passed: [f32; CELLS + 1],
    /// Share of diffuse light from the base that the coat throws back to it.
    returned: f32,
}

/// A coat's passage at one roughness.
#[derive(Clone, Copy, Debug)]
pub(super) struct Passage<'a> {
    ior: f32,
    thickness: f32,
    /// `None` where smooth: then it has a closed form.
    rows: Option<(&'a Row, &'a Row, f32)>,
    /// Share of diffuse light from the base that the coat throws back to it, what the medium absorbs taken off.
    pub(super) returned: f32,
}

impl CoatTable {
    /// For index `ior`, a medium `thickness` mean free paths deep, and one alpha, or all where it varies (`None`).
    pub fn new(ior: f32, thickness: f32, alpha: Option<f32>) -> Self {
        let rough = |alpha: f32| {
            let ggx = Ggx::new(Vec2::splat(alpha));
            Row::new(&Dielectric::new(ior, ggx, Vec3::ONE), thickness)
        };
        let rows = match alpha {
            Some(alpha) if Dielectric::new(ior, Ggx::new(Vec2::splat(alpha)), Vec3::ONE).is_delta() => vec![],
            Some(alpha) => vec![rough(alpha)],
            None => (0..=ALPHA_CELLS).map(|i| rough(alpha_of(i as f32 / ALPHA_CELLS as f32))).collect(),
        };
        Self { ior, thickness, smooth_return: smooth_return(ior, thickness), rows }
    }

    /// The passage through a coat with the facets of `coat`, which has this table's index.
    #[inline]
    pub(super) fn passage(&self, coat: &Dielectric) -> Passage<'_> {
        let rows = match &self.rows[..] {
            [] => None,
            _ if coat.is_delta() => None,
            [only] => Some((only, only, 0.0)),
            rows => {
                let (i, between) = place(place_of(coat.alpha().x), ALPHA_CELLS);
                Some((&rows[i], &rows[i + 1], between))
            }
        };
        let returned = rows.map_or(self.smooth_return, |(a, b, t)| lerp(a.returned, b.returned, t));
        Passage { ior: self.ior, thickness: self.thickness, rows, returned }
    }
}

impl Passage<'_> {
    /// Share of light at cosine `cos >= 0` that reaches the base.
    #[inline]
    pub(super) fn passed(&self, cos: f32) -> f32 {
        let Some((low, high, between)) = self.rows else {
            return smooth_passed(self.ior, self.thickness, cos);
        };
        let (i, t) = place(cos.sqrt(), CELLS);
        let at = |row: &Row| lerp(row.passed[i], row.passed[i + 1], t);
        if between == 0.0 { at(low) } else { lerp(at(low), at(high), between) }
    }
}

impl Row {
    fn new(coat: &Dielectric, thickness: f32) -> Self {
        let passed = std::array::from_fn(|i| {
            let root = i as f32 / CELLS as f32;
            passed(coat, thickness, root * root, QUADRATURE)
        });
        let returned = mean(MEAN_POINTS, |cos| returned(coat, thickness, cos, QUADRATURE));
        Self { passed, returned }
    }
}

#[inline]
fn smooth_passed(ior: f32, thickness: f32, cos: f32) -> f32 {
    let (f, cos_t) = fresnel::dielectric(cos, ior);
    (1.0 - f) * if thickness > 0.0 { (-thickness / cos_t).exp() } else { 1.0 }
}

fn smooth_return(ior: f32, thickness: f32) -> f32 {
    mean(SMOOTH_MEAN_POINTS, |cos| fresnel::dielectric(cos, 1.0 / ior).0 * (-2.0 * thickness / cos).exp())
}

/// Mean over the hemisphere, weighted by the cosine.
pub(in crate::bsdf) fn mean(points: u32, f: impl Fn(f32) -> f32) -> f32 {
    let at = |i: u32| f64::from(f(((i as f32 + 0.5) / points as f32).sqrt()));
    ((0..points).map(at).sum::<f64>() / f64::from(points)) as f32
}

/// By quadrature over visible facets.
fn passed(coat: &Dielectric, thickness: f32, cos: f32, points: [u32; 2]) -> f32 {
    over_facets(points, cos, |w, u| {
        let (w, share, _) = coat.sample_part(w, true, u)?;
        Some(share * (-thickness / w.z.abs()).exp())
    })
}

/// Light at cosine `cos` below the coat that is thrown back, from base to base.
fn returned(coat: &Dielectric, thickness: f32, cos: f32, points: [u32; 2]) -> f32 {
    over_facets(points, cos, |w, u| {
        let (w, share, _) = coat.sample_part(-w, false, u)?;
        Some(share * (-thickness / cos - thickness / w.z.abs()).exp())
    })
}

/// Mean of `f` over the random numbers that draw facets, for the direction at cosine `cos`.
pub(in crate::bsdf) fn over_facets(
    [columns, rows]: [u32; 2],
    cos: f32,
    f: impl Fn(Vec3, Vec2) -> Option<f32>,
) -> f32 {
    // At cos = 0 the limit is wanted, not 0 / 0.
    let cos = cos.clamp(1e-5, 1.0);
    let w = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
    let mut sum = 0.0;
    for i in 0..columns {
        // Columns are shifted against each other: where the horizon cuts them all, their errors cancel.
        let shift = (i as f32 + 0.5) * 0.618_034 % 1.0;
        for j in 0..rows {
            let u = Vec2::new((i as f32 + 0.5) * 0.5 / columns as f32, (j as f32 + shift) / rows as f32);
            sum += f64::from(f(w, u).unwrap_or(0.0));
        }
    }
    (sum / f64::from(columns * rows)) as f32
}

/// The place of `alpha` on the axis of roughness, in 0..1.
#[inline]
pub(in crate::bsdf) fn place_of(alpha: f32) -> f32 {
    let root = |x: f32| x.sqrt().sqrt();
    (root(alpha) - root(MIN_ALPHA)) / (1.0 - root(MIN_ALPHA))
}

/// Its inverse.
pub(in crate::bsdf) fn alpha_of(place: f32) -> f32 {
    lerp(MIN_ALPHA.sqrt().sqrt(), 1.0, place).powi(4).clamp(MIN_ALPHA, 1.0)
}

#[inline]
pub(in crate::bsdf) fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

/// The cell of `x` in 0..1 out of `cells`, and the place in it.
#[inline]
pub(in crate::bsdf) fn place(x: f32, cells: usize) -> (usize, f32) {
    let x = x * cells as f32;
    let i = (x as usize).min(cells - 1);
    (i, x - i as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Rng;

    /// A coat and its passage by quadrature with many more points, against the table of its own roughness and that of
    /// all.
    #[test]
    fn interpolation_keeps_its_promise() {
        let mut rng = Rng::new(1);
        for _ in 0..12 {
            let (ior, thickness) = (1.2 + rng.next_1d(), rng.next_1d());
            let alpha = MIN_ALPHA.powf(rng.next_1d()).max(MIN_ALPHA);
            let coat = Dielectric::new(ior, Ggx::new(Vec2::splat(alpha)), Vec3::ONE);
            let all = CoatTable::new(ior, thickness, None);
            let own = CoatTable::new(ior, thickness, Some(alpha));
            let fine = [21, 200];
            let true_return = mean(200, |cos| returned(&coat, thickness, cos, fine));
            for (name, table) in [("all", &all), ("own", &own)] {
                let passage = table.passage(&coat);
                let error = (passage.returned - true_return).abs();
                assert!(
                    error < MAX_ERROR,
                    "{name}: {error} of {true_return} returned, {ior}, {alpha}, {thickness}"
                );
                for _ in 0..20 {
                    let cos = rng.next_1d().powi(3);
                    let expected = passed(&coat, thickness, cos, fine);
                    let error = (passage.passed(cos) - expected).abs();
                    assert!(
                        error < MAX_ERROR,
                        "{name}: {error} of {expected}, {ior}, {alpha}, {thickness}, {cos}"
                    );
                }
            }
        }
    }
}
