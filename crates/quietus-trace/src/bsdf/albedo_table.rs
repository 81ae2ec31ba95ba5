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
/// Cells along the axis of anisotropy.
const BRUSHED_CELLS: usize = 16;
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
#[derive(Clone, Copy, Debug)]
pub(super) struct LobeAlbedo {
    /// Of the narrower width; `None` for a perfect mirror.
    rows: Option<Rows>,
    /// Where the other width is another.
    brushed: Option<Brushed>,
}

/// What an anisotropic lobe takes from isotropic ones.
///
/// It loses about what the lobe of the root mean square of its widths loses where masking is the same, and never less than
/// [`BRUSHED_SHARE`] of that (the tests hold it to it): at normal incidence both see slopes of the same variance. Of Fresnel's
/// edge it has no more than the lobes of its two widths.
#[derive(Clone, Copy, Debug)]
struct Brushed {
    /// Of the wider width.
    wider: Rows,
    /// Of the root mean square.
    even: Rows,
    /// Squares of the widths along x and y over their mean.
    squares: Vec2,
}

/// The share of the isotropic lobe's loss that an anisotropic one is sure to lose.
const BRUSHED_SHARE: f32 = 0.9;

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
    /// That of `a + b` where the widths differ, by [`Brushed::evenness`].
    brushed_mean: [f32; BRUSHED_CELLS + 1],
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
        let Some(alpha) = ggx.map(|g| g.alpha()) else { return Self { rows: None, brushed: None } };
        let (narrow, wide) = (alpha.min_element(), alpha.max_element());
        Self { rows: Some(Rows::new(narrow)), brushed: (wide > narrow).then(|| Brushed::new(alpha)) }
    }

    /// The albedo in a direction on either side.
    #[inline]
    pub(super) fn at(&self, w: Vec3) -> SplitAlbedo {
        let cos = w.z.abs().min(1.0);
        let Some(rows) = self.rows else {
            let b = fresnel::schlick_weight(cos);
            return SplitAlbedo { a: 1.0 - b, b, error: 0.0 };
        };
        match &self.brushed {
            None => rows.at(cos),
            Some(brushed) => brushed.at(w, rows.at(cos)),
        }
    }

    /// The cosine-weighted mean over the hemisphere; not rounded down, see [`SplitAlbedo::lost`].
    #[inline]
    pub(super) fn mean(&self) -> SplitAlbedo {
        let Some(rows) = self.rows else {
            return SplitAlbedo { a: 20.0 / 21.0, b: 1.0 / 21.0, error: 0.0 };
        };
        match &self.brushed {
            None => rows.mean(),
            Some(brushed) => brushed.mean(rows.mean()),
        }
    }
}

impl Brushed {
    #[inline]
    fn new(alpha: Vec2) -> Self {
        let mean_square = 0.5 * alpha.length_squared();
        Self {
            wider: Rows::new(alpha.max_element()),
            even: Rows::new(mean_square.sqrt()),
            squares: alpha * alpha / mean_square,
        }
    }

    /// Given that of the narrower width.
    #[inline]
    fn at(&self, w: Vec3, narrow: SplitAlbedo) -> SplitAlbedo {
        // Masking is the same where the slope of `w` in widths is.
        let cos2 = w.z * w.z;
        let sin2 = (w.truncate() * w.truncate()).dot(self.squares);
        let even = self.even.at((cos2 / (cos2 + sin2)).sqrt().min(1.0));
        self.bound(even.a + even.b, narrow, self.wider.at(w.z.abs().min(1.0)))
    }

    #[inline]
    fn mean(&self, narrow: SplitAlbedo) -> SplitAlbedo {
        self.bound(self.even.brushed_mean(self.evenness()), narrow, self.wider.mean())
    }

    /// Twice the product of both widths over the sum of their squares, in 0..1.
    #[inline]
    fn evenness(&self) -> f32 {
        (self.squares.x * self.squares.y).sqrt()
    }

    #[inline]
    fn bound(&self, even: f32, narrow: SplitAlbedo, wide: SplitAlbedo) -> SplitAlbedo {
        let total = 1.0 - BRUSHED_SHARE * (1.0 - even);
        let b = narrow.b.max(wide.b).min(total);
        SplitAlbedo { a: total - b, b, ..narrow }
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

    /// Mean of `a + b` of a lobe with this root mean square of widths.
    #[inline]
    fn brushed_mean(&self, evenness: f32) -> f32 {
        let (i, t) = place_in(evenness, BRUSHED_CELLS);
        let [low, high] =
            rows(self.low as usize).map(|row| lerp(row.brushed_mean[i], row.brushed_mean[i + 1], t));
        lerp(low, high, self.between)
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
    place_in(x, CELLS)
}

#[inline]
fn place_in(x: f32, cells: usize) -> (usize, f32) {
    let x = x * cells as f32;
    let i = (x as usize).min(cells - 1);
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
        let (total, _) = integrate(ggx, above_x(x * alpha / (1.0 + alpha - x)), 0.5, QUADRATURE);
        total as f32
    };
    let share = |i: usize| {
        let root = i as f32 / CELLS as f32;
        let (total, b) = integrate(ggx, above_x(root.powi(4)), 0.5, QUADRATURE);
        (b / total) as f32
    };
    let mut row = Row {
        total: std::array::from_fn(total),
        share: std::array::from_fn(share),
        mean: [0.0; 2],
        brushed_mean: [0.0; BRUSHED_CELLS + 1],
    };
    for i in 0..MEAN_POINTS {
        let square = (f64::from(i) + 0.5) / f64::from(MEAN_POINTS);
        let places = Places::new(square.sqrt() as f32, alpha);
        let total = row.total(&places);
        row.mean[0] += total / MEAN_POINTS as f32;
        row.mean[1] += total * row.share(&places) / MEAN_POINTS as f32;
    }
    row.brushed_mean = std::array::from_fn(|i| brushed_mean(&row, alpha, i as f32 / BRUSHED_CELLS as f32));
    row
}

/// Mean of the total over the hemisphere, where widths differ: over squared cosines `x` of the direction that is masked as much,
/// whose density, azimuths averaged, is `(1 - e^2 x) / (1 - e^2 x^2)^(3/2)` with `e^2 = 1 - evenness^2`.
fn brushed_mean(row: &Row, alpha: f32, evenness: f32) -> f32 {
    let e2 = f64::from(1.0 - evenness * evenness);
    let (mut sum, mut weights) = (0.0, 0.0);
    for i in 0..MEAN_POINTS {
        // The density may have a pole at x = 1: points crowd there.
        let v = (f64::from(i) + 0.5) / f64::from(MEAN_POINTS);
        let x = 1.0 - v * v;
        let weight = v * (1.0 - e2 * x) / (1.0 - e2 * x * x).powf(1.5);
        sum += weight * f64::from(row.total(&Places::new(x.sqrt() as f32, alpha)));
        weights += weight;
    }
    (sum / weights) as f32
}

/// The direction at cosine `cos` above the x axis. At 0 the limit of the albedo is wanted, not 0 / 0.
fn above_x(cos: f32) -> Vec3 {
    let cos = cos.clamp(1e-5, 1.0);
    Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos)
}

/// `a + b` and `b` by quadrature over visible normals, whose azimuths go through `turns`: their density cancels all but `G2 / G1`.
fn integrate(ggx: Ggx, wo: Vec3, turns: f32, [columns, rows]: [u32; 2]) -> (f64, f64) {
    let (mut total, mut b) = (0.0, 0.0);
    for i in 0..columns {
        // Columns are shifted against each other: where the horizon cuts them all, their errors cancel.
        let shift = (i as f32 + 0.5) * 0.618_034 % 1.0;
        for j in 0..rows {
            let u = Vec2::new((i as f32 + 0.5) * turns / columns as f32, (j as f32 + shift) / rows as f32);
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
            let e = LobeAlbedo::new(Some(ggx)).at(above_x(cos));
            let (total, b) = integrate(ggx, above_x(cos), 0.5, [34, 400]);
            for (name, found, true_value) in
                [("a", e.a, total - b), ("b", e.b, b), ("a + b", e.a + e.b, total)]
            {
                let error = (f64::from(found) - true_value).abs() as f32;
                assert!(error < MAX_ERROR, "{name} at alpha {alpha}, cosine {cos} is off by {error}");
            }
        }
    }

    /// No more is said to be lost than is, and no less than two thirds of it.
    #[test]
    fn brushed_lobes_lose_what_is_said() {
        let mut rng = Rng::new(2);
        for _ in 0..3000 {
            let across = MIN_ALPHA.powf(rng.next_1d()).max(MIN_ALPHA);
            let along = across + (1.0 - across) * rng.next_1d().powi(2);
            let (cos, azimuth) = (rng.next_1d(), rng.next_1d() * std::f32::consts::TAU);
            let wo = Vec2::from_angle(azimuth) * (1.0 - cos * cos).sqrt();
            let ggx = Ggx::new(Vec2::new(along, across)).expect("not smooth");
            let lost = LobeAlbedo::new(Some(ggx)).at(wo.extend(cos)).lost();
            let (total, _) = integrate(ggx, wo.extend(cos.max(1e-5)), 1.0, [64, 96]);
            let truly = (1.0 - total) as f32;
            let what =
                format!("{lost} of {truly} at alpha {along}, {across}, cosine {cos}, azimuth {azimuth}");
            assert!(lost <= truly && lost >= 2.0 / 3.0 * truly - 2.0 * MAX_ERROR, "{what}");
        }
    }

    /// By plain integration over the hemisphere.
    #[test]
    fn brushed_means_are_means() {
        for alpha in [Vec2::new(0.8, 0.01), Vec2::new(0.1, 0.5), Vec2::new(0.3, 0.25)] {
            let lobe = LobeAlbedo::new(Ggx::new(alpha));
            let side = 200;
            let mut sum = 0.0;
            for (i, j) in (0..side * side).map(|k| (k / side, k % side)) {
                let square = (i as f32 + 0.5) / side as f32;
                let around = Vec2::from_angle(0.5 * std::f32::consts::PI * (j as f32 + 0.5) / side as f32);
                let e = lobe.at((around * (1.0 - square).sqrt()).extend(square.sqrt()));
                sum += f64::from(e.a + e.b);
            }
            let (mean, e) = (sum / f64::from(side * side), lobe.mean());
            assert!((mean as f32 - e.a - e.b).abs() < MAX_ERROR, "{alpha}: {mean}, {}", e.a + e.b);
        }
    }

    #[test]
    fn mirrors_are_the_limit_of_narrow_lobes() {
        let narrow = LobeAlbedo::new(Ggx::new(Vec2::splat(MIN_ALPHA)));
        for cos in [0.1, 0.4, 0.8, 1.0] {
            let (mirror, narrow) = (LobeAlbedo::new(None).at(above_x(cos)), narrow.at(above_x(cos)));
            assert!((mirror.a - narrow.a).abs() < MAX_ERROR && (mirror.b - narrow.b).abs() < MAX_ERROR);
        }
        let (mirror, narrow) = (LobeAlbedo::new(None).mean(), narrow.mean());
        assert!((mirror.a - narrow.a).abs() < MAX_ERROR && (mirror.b - narrow.b).abs() < MAX_ERROR);
    }
}
