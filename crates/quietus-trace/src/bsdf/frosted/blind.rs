//! Facets that light sees but that send it nowhere.
//!
//! Light that comes from the denser side finds facets so steep that what they reflect and what they refract runs into the
//! surface. A draw of one would end the path. Along each azimuth these facets lie beyond a height of the cap that visible
//! normals are drawn from; a bound of it is tabulated, and since the bound is linear between azimuths, so is known exactly
//! how many draws lie beyond: the density of a sampler that sends those elsewhere needs no approximation.

use glam::{Vec2, Vec3};

use super::{ALMOST_ONE, cosine};
use crate::bsdf::{
    Dielectric,
    ggx::Ggx,
    layered::coat_table::{lerp, place},
};

/// Cells along the axis of angles.
const ROWS: usize = 64;
/// Cells along half a turn of azimuth.
const COLUMNS: usize = 32;
/// Nodes bound what is found at places this many to a cell, in the cells around them.
const PLACES: usize = 2;
/// Narrower lobes have too few of these facets for a table.
const LEAST_ALPHA: f32 = 0.05;
/// Heights that are tried, from the horizon of the cap on, before the edge is narrowed down.
const HEIGHTS: u32 = 64;
const HALVINGS: u32 = 6;

/// For all roughnesses of an interval.
#[derive(Clone, Debug)]
pub(super) struct BlindFacets {
    rows: Vec<Row>,
}

/// One angle.
#[derive(Clone, Copy, Debug)]
struct Row {
    /// Height in 0..1, as [`Ggx::sample_visible`] takes it, beyond which all facets are blind; by azimuth
    /// where light comes from above the x axis.
    edge: [f32; COLUMNS + 1],
    /// Share of draws beyond.
    share: f32,
}

/// At one angle.
#[derive(Clone, Copy, Debug)]
pub(super) struct BlindAt<'a> {
    rows: (&'a Row, &'a Row, f32),
}

impl BlindFacets {
    /// For an index inside over outside and a range of alphas.
    pub(super) fn new(ior: f32, alphas: [f32; 2]) -> Self {
        let side = if ior > 1.0 { -1.0 } else { 1.0 };
        let mut alphas = vec![alphas[0], 0.5 * (alphas[0] + alphas[1]), alphas[1]];
        alphas.dedup();
        let surface = |alpha| Dielectric::new(ior, Ggx::new(Vec2::splat(alpha)), Vec3::ONE);
        let edges: Vec<_> = alphas.iter().map(|&alpha| edges(&surface(alpha), alpha, side)).collect();
        let around = |node: usize, places: usize| {
            (node * PLACES).saturating_sub(PLACES)..((node + 1) * PLACES + 1).min(places)
        };
        let edge = |i: usize, j: usize| {
            if alphas[0] < LEAST_ALPHA {
                return 1.0;
            }
            let rows = edges.iter().flat_map(|edges| &edges[around(i, edges.len())]);
            rows.flat_map(|row| &row[around(j, row.len())]).fold(0f32, |most, &edge| most.max(edge))
        };
        Self { rows: (0..=ROWS).map(|i| Row::new(std::array::from_fn(|j| edge(i, j)))).collect() }
    }

    /// Where the angle is at `axis`, see [`super::axis`].
    #[inline]
    pub(super) fn at(&self, axis: f32) -> BlindAt<'_> {
        let (i, t) = place(axis, ROWS);
        BlindAt { rows: (&self.rows[i], &self.rows[i + 1], t) }
    }
}

impl Row {
    fn new(edge: [f32; COLUMNS + 1]) -> Self {
        let open: f32 = edge.windows(2).map(|ends| 0.5 * (ends[0] + ends[1])).sum();
        Self { edge, share: 1.0 - open / COLUMNS as f32 }
    }
}

impl BlindAt<'_> {
    /// Share of draws that [`beyond`](Self::beyond) finds beyond the edge.
    #[inline]
    pub(super) fn share(&self) -> f32 {
        let (low, high, t) = self.rows;
        lerp(low.share, high.share, t)
    }

    /// How far random numbers that draw a facet lie beyond the edge, in 0..1: for light from above the x axis.
    #[inline]
    pub(super) fn beyond(&self, u: Vec2) -> Option<f32> {
        let (low, high, t) = self.rows;
        let (j, s) = place(1.0 - (2.0 * u.x - 1.0).abs(), COLUMNS);
        let edge = |row: &Row| lerp(row.edge[j], row.edge[j + 1], s);
        let edge = lerp(edge(low), edge(high), t);
        (u.y >= edge).then(|| ((u.y - edge) / (1.0 - edge)).min(ALMOST_ONE))
    }
}

/// Edges for one roughness, by angle and azimuth.
fn edges(surface: &Dielectric, alpha: f32, side: f32) -> Vec<[f32; COLUMNS * PLACES + 1]> {
    let row = |i: usize| {
        // At cos = 0 the limit is wanted, not 0 / 0.
        let cos = cosine(i as f32 / (ROWS * PLACES) as f32, alpha).clamp(1e-5, 1.0);
        let wo = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, side * cos);
        std::array::from_fn(|j| edge(surface, wo, 0.5 * j as f32 / (COLUMNS * PLACES) as f32))
    };
    (0..=ROWS * PLACES).map(row).collect()
}

/// The least height that has only blind facets above it.
fn edge(surface: &Dielectric, wo: Vec3, azimuth: f32) -> f32 {
    let open = |height: f32| surface.opens(wo, Vec2::new(azimuth, height));
    // Facets on edge are close together.
    let height = |i: u32| ALMOST_ONE - (i as f32 / HEIGHTS as f32).powi(3);
    let Some(i) = (0..HEIGHTS).find(|&i| open(height(i))) else { return 0.0 };
    let (mut low, mut high) = (height(i), height(i.max(1) - 1));
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if open(middle) { low = middle } else { high = middle }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{bsdf::frosted::axis, testing::Rng};

    /// No facet beyond the edge sends light anywhere.
    #[test]
    fn what_lies_beyond_is_blind() {
        let mut rng = Rng::new(2);
        let mut beyond = 0;
        for _ in 0..30 {
            let ior = 0.5 + 2.0 * rng.next_1d();
            let alphas = [rng.next_1d().powi(2), rng.next_1d().powi(2)].map(|alpha| alpha.max(0.01));
            let alphas = [alphas[0], alphas[0] + 0.1 * (alphas[1] - alphas[0])];
            let facets = BlindFacets::new(ior, alphas);
            for _ in 0..400 {
                let alpha = lerp(alphas[0], alphas[1], rng.next_1d());
                let surface = Dielectric::new(ior, Ggx::new(Vec2::splat(alpha)), Vec3::ONE);
                let cos = rng.next_1d().max(1e-3) * if ior > 1.0 { -1.0 } else { 1.0 };
                let wo = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
                let at = facets.at(axis(cos.abs(), alpha));
                for _ in 0..50 {
                    let u = rng.next_2d();
                    if at.beyond(u).is_some() {
                        beyond += 1;
                        assert!(!surface.opens(wo, u), "index {ior}, alpha {alpha}, cosine {cos}, {u}");
                    }
                }
            }
        }
        assert!(beyond > 5_000, "{beyond}");
    }
}
