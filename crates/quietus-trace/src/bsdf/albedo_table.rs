//! Directional albedo of the GGX reflection lobe, each roughness tabulated at its first use.
//!
//! With Schlick's Fresnel term a lobe reflects `F0 * a + F90 * b` of the light that arrives, where `a` and `b`
//! depend on the angle and on alpha alone (Karis 2013, "Real Shading in Unreal Engine 4", the split sum). Layers
//! are scaled by it so that no light is gained, and `1 - (a + b)` is what single scattering loses.
//!
//! Kept are two smooth functions: the total `a + b`, which changes where the angle to the horizon is about alpha,
//! and the share of `b` in it, which changes as Schlick's term does. Each has an axis that suits it.

use std::sync::OnceLock;

use glam::{Vec2, Vec3};

use super::{
    fresnel,
    ggx::{Ggx, MIN_ALPHA},
};

/// Cells along each axis.
const CELLS: usize = 40;
/// Quadrature points in azimuth (half a period, hence few) and along the cap of visible normals.
const QUADRATURE: [u32; 2] = [21, 96];
/// Points of the mean over angles, uniform in the squared cosine.
const MEAN_POINTS: u32 = 4096;
/// Interpolation is off by less than this (the tests hold it to it): what is derived from the table is rounded
/// down by as much, so that no light is gained.
pub(super) const MAX_ERROR: f32 = 2e-3;

/// The pair `(a, b)`: albedo is `F0 * a + F90 * b`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SplitAlbedo {
    pub(super) a: f32,
    pub(super) b: f32,
    /// Bound of the error of `a + b`, and of any mixture below it.
    error: f32,
}

impl SplitAlbedo {
    /// The albedo of a lobe with the given Fresnel terms.
    #[inline]
    pub(super) fn with(self, f0: Vec3, f90: Vec3) -> Vec3 {
        f0 * self.a + f90 * self.b
    }

    /// What single scattering loses of a lobe with reflectance 1, rounded down.
    #[inline]
    pub(super) fn lost(self) -> f32 {
        (1.0 - (self.a + self.b) - self.error).max(0.0)
    }

    /// What a lobe with the given Fresnel terms leaves to the layer below, rounded down; `recovered` is the share
    /// of [`lost`](Self::lost) that is reflected after all.
    #[inline]
    pub(super) fn left(self, f0: f32, f90: f32, recovered: f32) -> f32 {
        self.left_by(f0 * self.a + f90 * self.b, recovered)
    }

    /// The same for a lobe that reflects `reflected` of the light.
    #[inline]
    pub(super) fn left_by(self, reflected: f32, recovered: f32) -> f32 {
        (1.0 - (reflected + recovered * self.lost()) - self.error).max(0.0)
    }
}

/// All of a lobe's albedo that does not depend on the angle: where its rows are.
///
/// An anisotropic lobe is bounded by the isotropic ones of its two widths: the narrow one loses less to masking, the
/// wide one has more of Fresnel's edge. What is derived from the bounds still gains no light.
#[derive(Clone, Copy, Debug)]
pub(super) struct LobeAlbedo {
    /// Of the narrower width; `None` for a perfect mirror.
    rows: Option<Rows>,
    /// Of the wider one, where they differ.
    wider: Option<Rows>,
}

#[derive(Clone, Copy, Debug)]
struct Rows {
    alpha: f32,
    low: u32,
    /// Place between row `low` and the next.
    between: f32,
}

/// One row: one roughness.
struct Row {
    total: [f32; CELLS + 1],
    share: [f32; CELLS + 1],
    /// Cosine-weighted means over the hemisphere of `a + b` and of `b`.
    mean: [f32; 2],
}

/// Filled row by row as scenes ask: most of them know a few roughnesses only, and a row takes milliseconds.
static TABLE: [OnceLock<Row>; CELLS + 1] = [const { OnceLock::new() }; CELLS + 1];

/// Row `j` and the next.
#[inline(always)]
fn rows(j: usize) -> [&'static Row; 2] {
    [j, j + 1].map(|j| TABLE[j].get_or_init(|| row(j)))
}

impl LobeAlbedo {
    /// Of a rough lobe or a perfect mirror.
    #[inline]
    pub(super) fn new(ggx: Option<Ggx>) -> Self {
        let Some(alpha) = ggx.map(|g| g.alpha()) else { return Self { rows: None, wider: None } };
        let (narrow, wide) = (alpha.min_element(), alpha.max_element());
        Self { rows: Some(Rows::new(narrow)), wider: (wide > narrow).then(|| Rows::new(wide)) }
    }

    /// The albedo at cosine `cos`, either sign.
    #[inline]
    pub(super) fn at(&self, cos: f32) -> SplitAlbedo {
        let cos = cos.abs().min(1.0);
        let Some(rows) = self.rows else {
            let b = fresnel::schlick_weight(cos);
            return SplitAlbedo { a: 1.0 - b, b, error: 0.0 };
        };
        self.bounded(rows.at(cos), |wider| wider.at(cos))
    }

    /// The cosine-weighted mean over the hemisphere; not rounded down, see [`SplitAlbedo::lost`].
    #[inline]
    pub(super) fn mean(&self) -> SplitAlbedo {
        let Some(rows) = self.rows else {
            return SplitAlbedo { a: 20.0 / 21.0, b: 1.0 / 21.0, error: 0.0 };
        };
        self.bounded(rows.mean(), Rows::mean)
    }

    /// The bound of `narrow` and, where there is one, the albedo of the wider lobe: the total of the one and the larger
    /// `b` of both.
    #[inline]
    fn bounded(&self, narrow: SplitAlbedo, wide: impl FnOnce(&Rows) -> SplitAlbedo) -> SplitAlbedo {
        let Some(wider) = &self.wider else { return narrow };
        let b = narrow.b.max(wide(wider).b);
        SplitAlbedo { a: narrow.a + narrow.b - b, b, ..narrow }
    }
}

impl Rows {
    #[inline]
    fn new(alpha: f32) -> Self {
        let (low, between) =
            place((fourth_root(alpha) - fourth_root(MIN_ALPHA)) / (1.0 - fourth_root(MIN_ALPHA)));
        Self { alpha, low: low as u32, between }
    }

    #[inline]
    fn at(&self, cos: f32) -> SplitAlbedo {
        let [row, next] = rows(self.low as usize);
        let places = Places::new(cos, self.alpha);
        let total = lerp(row.total(&places), next.total(&places), self.between);
        let share = lerp(row.share(&places), next.share(&places), self.between);
        SplitAlbedo { a: total * (1.0 - share), b: total * share, error: MAX_ERROR }
    }

    #[inline]
    fn mean(&self) -> SplitAlbedo {
        let [row, next] = rows(self.low as usize);
        let [total, b] = [0, 1].map(|i| lerp(row.mean[i], next.mean[i], self.between));
        SplitAlbedo { a: total - b, b, error: 0.0 }
    }
}

/// Where an angle lies on both axes.
struct Places {
    total: (usize, f32),
    share: (usize, f32),
}

impl Places {
    #[inline]
    fn new(cos: f32, alpha: f32) -> Self {
        Self { total: place((cos * (1.0 + alpha) / (cos + alpha)).sqrt()), share: place(fourth_root(cos)) }
    }
}

impl Row {
    #[inline]
    fn total(&self, places: &Places) -> f32 {
        let (i, t) = places.total;
        lerp(self.total[i], self.total[i + 1], t)
    }

    #[inline]
    fn share(&self, places: &Places) -> f32 {
        let (i, t) = places.share;
        lerp(self.share[i], self.share[i + 1], t)
    }
}

#[inline]
fn fourth_root(x: f32) -> f32 {
    x.sqrt().sqrt()
}

#[inline]
fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

/// The cell of `x` in 0..1, and the place in it.
#[inline]
fn place(x: f32) -> (usize, f32) {
    let x = x * CELLS as f32;
    let i = (x as usize).min(CELLS - 1);
    (i, x - i as f32)
}

#[cold]
fn row(j: usize) -> Row {
    let alpha = lerp(fourth_root(MIN_ALPHA), 1.0, j as f32 / CELLS as f32).powi(4).max(MIN_ALPHA);
    let ggx = Ggx::new(Vec2::splat(alpha)).expect("not smooth");
    let total = |i: usize| {
        let root = i as f32 / CELLS as f32;
        let x = root * root;
        // The inverse of x = cos (1 + alpha) / (cos + alpha).
        let (total, _) = integrate(ggx, x * alpha / (1.0 + alpha - x), QUADRATURE);
        total as f32
    };
    let share = |i: usize| {
        let root = i as f32 / CELLS as f32;
        let (total, b) = integrate(ggx, root.powi(4), QUADRATURE);
        (b / total) as f32
    };
    let mut row =
        Row { total: std::array::from_fn(total), share: std::array::from_fn(share), mean: [0.0; 2] };
    for i in 0..MEAN_POINTS {
        let square = (f64::from(i) + 0.5) / f64::from(MEAN_POINTS);
        let places = Places::new(square.sqrt() as f32, alpha);
        let total = row.total(&places);
        row.mean[0] += total / MEAN_POINTS as f32;
        row.mean[1] += total * row.share(&places) / MEAN_POINTS as f32;
    }
    row
}

/// `a + b` and `b` by quadrature over visible normals: their density cancels all but `G2 / G1`.
fn integrate(ggx: Ggx, cos: f32, [columns, rows]: [u32; 2]) -> (f64, f64) {
    // At cos = 0 the limit of the albedo is wanted, not 0 / 0.
    let cos = cos.clamp(1e-5, 1.0);
    let wo = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
    let (mut total, mut b) = (0.0, 0.0);
    for i in 0..columns {
        // Columns are shifted against each other: where the horizon cuts them all, their errors cancel.
        let shift = (i as f32 + 0.5) * 0.618_034 % 1.0;
        for j in 0..rows {
            let u = Vec2::new((i as f32 + 0.5) * 0.5 / columns as f32, (j as f32 + shift) / rows as f32);
            let h = ggx.sample_visible(wo, u);
            let wi = 2.0 * wo.dot(h) * h - wo;
            if wi.z > 0.0 {
                let weight = f64::from(ggx.g2(wo, wi) / ggx.g1(wo));
                total += weight;
                b += weight * f64::from(fresnel::schlick_weight(wo.dot(h)));
            }
        }
    }
    let n = f64::from(columns) * f64::from(rows);
    (total / n, b / n)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Rng;

    /// All mixtures `f0 * a + f90 * b` with factors up to 1 lie between these three.
    #[test]
    fn interpolation_keeps_its_promise() {
        let mut rng = Rng::new(1);
        for _ in 0..1000 {
            let alpha = MIN_ALPHA.powf(rng.next_1d()).max(MIN_ALPHA);
            let cos = rng.next_1d().powi(3);
            let ggx = Ggx::new(Vec2::splat(alpha)).expect("not smooth");
            let e = LobeAlbedo::new(Some(ggx)).at(cos);
            let (total, b) = integrate(ggx, cos, [34, 400]);
            for (name, found, true_value) in
                [("a", e.a, total - b), ("b", e.b, b), ("a + b", e.a + e.b, total)]
            {
                let error = (f64::from(found) - true_value).abs() as f32;
                assert!(error < MAX_ERROR, "{name} at alpha {alpha}, cosine {cos} is off by {error}");
            }
        }
    }

    #[test]
    fn mirrors_are_the_limit_of_narrow_lobes() {
        let narrow = LobeAlbedo::new(Ggx::new(Vec2::splat(MIN_ALPHA)));
        for cos in [0.1, 0.4, 0.8, 1.0] {
            let (mirror, narrow) = (LobeAlbedo::new(None).at(cos), narrow.at(cos));
            assert!((mirror.a - narrow.a).abs() < MAX_ERROR && (mirror.b - narrow.b).abs() < MAX_ERROR);
        }
        let (mirror, narrow) = (LobeAlbedo::new(None).mean(), narrow.mean());
        assert!((mirror.a - narrow.a).abs() < MAX_ERROR && (mirror.b - narrow.b).abs() < MAX_ERROR);
    }
}
