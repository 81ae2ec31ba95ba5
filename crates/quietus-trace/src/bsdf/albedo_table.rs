//! Directional albedo of the GGX reflection lobe, tabulated at first use.
//!
//! With Schlick's Fresnel term a lobe reflects `F0 * a + F90 * b` of the light that arrives, where `a` and `b`
//! depend on the angle and on alpha alone (Karis 2013, "Real Shading in Unreal Engine 4", the split sum). Layers
//! are scaled by it so that no light is gained, and `1 - (a + b)` is what single scattering loses.

use std::sync::LazyLock;

use glam::{Vec2, Vec3};

use super::{fresnel, ggx::Ggx, ggx::MIN_ALPHA};

/// Cells per axis. Roughness and the root of the cosine are the axes: the albedo bends most at grazing angles.
const CELLS: usize = 32;
/// Quadrature points per axis for each entry.
const QUADRATURE: usize = 32;

/// The pair `(a, b)`: albedo is `F0 * a + F90 * b`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SplitAlbedo {
    pub(super) a: f32,
    pub(super) b: f32,
}

impl SplitAlbedo {
    /// The albedo of a lobe with the given Fresnel terms.
    #[inline]
    pub(super) fn with(self, f0: Vec3, f90: Vec3) -> Vec3 {
        f0 * self.a + f90 * self.b
    }

    #[inline]
    fn lerp(self, other: Self, t: f32) -> Self {
        Self { a: self.a + (other.a - self.a) * t, b: self.b + (other.b - self.b) * t }
    }
}

/// One row per roughness: the albedo over the cosine and its cosine-weighted mean.
struct Row {
    by_angle: [SplitAlbedo; CELLS + 1],
    mean: SplitAlbedo,
}

static TABLE: LazyLock<Vec<Row>> = LazyLock::new(|| (0..=CELLS).map(row).collect());

/// Directional albedo at cosine `cos` (either sign) for a lobe of width `alpha`, 0 for a perfect mirror.
#[inline]
pub(super) fn directional(cos: f32, alpha: f32) -> SplitAlbedo {
    let x = cos.abs().min(1.0).sqrt() * CELLS as f32;
    let i = (x as usize).min(CELLS - 1);
    let t = x - i as f32;
    let (low, high, s) = rows(alpha);
    let at = |row: &Row| row.by_angle[i].lerp(row.by_angle[i + 1], t);
    at(low).lerp(at(high), s)
}

/// Cosine-weighted mean of [`directional`] over the hemisphere.
#[inline]
pub(super) fn mean(alpha: f32) -> SplitAlbedo {
    let (low, high, s) = rows(alpha);
    low.mean.lerp(high.mean, s)
}

#[inline]
fn rows(alpha: f32) -> (&'static Row, &'static Row, f32) {
    let y = alpha.clamp(0.0, 1.0).sqrt() * CELLS as f32;
    let j = (y as usize).min(CELLS - 1);
    let table = &*TABLE;
    (&table[j], &table[j + 1], y - j as f32)
}

fn row(j: usize) -> Row {
    let roughness = j as f32 / CELLS as f32;
    let ggx = Ggx { alpha: (roughness * roughness).max(MIN_ALPHA) };
    let by_angle = std::array::from_fn(|i| {
        let root = i as f32 / CELLS as f32;
        integrate(ggx, root * root)
    });
    // Mean of 2 cos d(cos) with cos = x^2 is 4 x^3 dx; by Simpson's rule exact enough over 32 cells.
    let mut mean = SplitAlbedo::default();
    for (i, e) in by_angle.iter().enumerate() {
        let x = i as f32 / CELLS as f32;
        let simpson = if i == 0 || i == CELLS {
            1.0
        } else if i % 2 == 1 {
            4.0
        } else {
            2.0
        };
        let weight = simpson / (3.0 * CELLS as f32) * 4.0 * x * x * x;
        mean = SplitAlbedo { a: mean.a + weight * e.a, b: mean.b + weight * e.b };
    }
    Row { by_angle, mean }
}

/// Quadrature over visible normals: their density cancels all but `G2 / G1`.
fn integrate(ggx: Ggx, cos: f32) -> SplitAlbedo {
    // At cos = 0 the limit of the albedo is wanted, not 0 / 0.
    let cos = cos.max(1e-4);
    let wo = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
    let (mut a, mut b) = (0.0f64, 0.0f64);
    for i in 0..QUADRATURE {
        for j in 0..QUADRATURE {
            let u = (Vec2::new(i as f32, j as f32) + 0.5) / QUADRATURE as f32;
            let h = ggx.sample_visible(wo, u);
            let wi = 2.0 * wo.dot(h) * h - wo;
            if wi.z > 0.0 {
                let weight = f64::from(ggx.g2(wo, wi) / ggx.g1(wo));
                let schlick = f64::from(fresnel::schlick_weight(wo.dot(h)));
                a += weight * (1.0 - schlick);
                b += weight * schlick;
            }
        }
    }
    let n = (QUADRATURE * QUADRATURE) as f64;
    SplitAlbedo { a: (a / n) as f32, b: (b / n) as f32 }
}
