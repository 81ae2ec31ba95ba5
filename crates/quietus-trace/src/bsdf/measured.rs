//! Surfaces that were measured: Dupuy and Jakob 2018, "An Adaptive Parameterization for Efficient Material Acquisition and
//! Rendering".
//!
//! For each direction of view that was measured there is a map from the unit square to microfacets that are seen from there
//! (`visible`), and on that square what the surface shows (`colors`) and how bright that is (`luminance`). A direction
//! is drawn by luminance, then taken through the map; both are bilinear between their samples, and directions of view in between
//! are mixed.

mod sheet;

use std::f32::consts::{FRAC_2_PI, FRAC_PI_2, PI, TAU};
use std::sync::Arc;

use glam::{Vec2, Vec3};

use super::BsdfSample;
use crate::desc;
use crate::sampler::mix64;
use sheet::{Distribution, Mix, look_up};

/// A measured surface, ready to be evaluated.
#[derive(Debug)]
pub(crate) struct MeasuredTable {
    desc: Arc<desc::Measured>,
    visible: Distribution,
    luminance: Distribution,
    albedo: Vec3,
}

/// One point of a measured surface, on both sides.
#[derive(Clone, Copy, Debug)]
pub struct Measured<'a> {
    table: &'a MeasuredTable,
}

/// Angles of a direction as coordinates of the maps.
fn place_of(w: Vec3, turned_by: f32) -> Vec2 {
    let (polar, azimuth) = angles(w);
    let around = (azimuth - turned_by) / TAU + 0.5;
    Vec2::new((polar * FRAC_2_PI).sqrt(), around - around.floor())
}

/// Polar angle and azimuth.
fn angles(w: Vec3) -> (f32, f32) {
    (w.x.hypot(w.y).atan2(w.z), w.y.atan2(w.x))
}

impl MeasuredTable {
    /// For tables that have been checked.
    pub(crate) fn new(desc: &Arc<desc::Measured>) -> Self {
        let mut table = Self {
            desc: Arc::clone(desc),
            visible: Distribution::new(&desc.visible),
            luminance: Distribution::new(&desc.luminance),
            albedo: Vec3::ZERO,
        };
        table.albedo = table.mean_albedo();
        table
    }

    /// What it reflects of light from everywhere to a slanted view, about.
    fn mean_albedo(&self) -> Vec3 {
        const SAMPLES: u64 = 256;
        let number = |i: u64| (mix64(i) >> 40) as f32 / (1_u32 << 24) as f32;
        let surface = Measured { table: self };
        let weight = |i: u64| {
            let u = Vec2::new(number(2 * i), number(2 * i + 1));
            surface.sample(Vec3::new(0.6, 0.0, 0.8), u).map_or(Vec3::ZERO, |sample| sample.weight)
        };
        (0..SAMPLES).map(weight).sum::<Vec3>() / SAMPLES as f32
    }

    fn is_isotropic(&self) -> bool {
        self.desc.is_isotropic()
    }
}

impl<'a> Measured<'a> {
    pub(crate) fn new(table: &'a MeasuredTable) -> Self {
        Self { table }
    }

    pub(super) fn albedo(&self) -> Vec3 {
        self.table.albedo
    }

    pub(super) fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        if wo.z * wi.z <= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let view = View::new(self.table, wo);
        let h = (wo + wi).normalize() * 1f32.copysign(wo.z);
        let place = place_of(h, view.turned_by);
        let (u, density) = self.table.visible.invert(place, &view.mix);
        let pdf = density * self.table.luminance.density(u, &view.mix) / view.stretch(h, place);
        (view.value(u, place), pdf)
    }

    pub(super) fn sample(&self, wo: Vec3, u: Vec2) -> Option<BsdfSample> {
        let view = View::new(self.table, wo);
        let (u, by_luminance) = self.table.luminance.sample(u, &view.mix);
        let (place, by_facet) = self.table.visible.sample(u, &view.mix);
        let (polar, azimuth) = (place.x * place.x * FRAC_PI_2, (2.0 * place.y - 1.0) * PI + view.turned_by);
        let (sine, cosine) = polar.sin_cos();
        let h = Vec3::new(sine * azimuth.cos(), sine * azimuth.sin(), cosine);
        let wi = 2.0 * view.wo.dot(h) * h - view.wo;
        let pdf = by_luminance * by_facet / view.stretch(h, place);
        if !(wi.z > 0.0 && pdf > 0.0 && pdf.is_finite()) {
            return None;
        }
        let weight = view.value(u, place) / pdf;
        Some(BsdfSample::reflection(wi.normalize() * 1f32.copysign(wo.z), weight, pdf))
    }
}

/// A measured surface as it is seen from somewhere.
struct View<'a> {
    table: &'a MeasuredTable,
    /// On the front.
    wo: Vec3,
    mix: Mix,
    /// The azimuth that those of facets count from.
    turned_by: f32,
    /// Projected area of the facets.
    area: f32,
}

impl<'a> View<'a> {
    fn new(table: &'a MeasuredTable, wo: Vec3) -> Self {
        let wo = wo * 1f32.copysign(wo.z);
        let (polar, azimuth) = angles(wo);
        let turned_by = if table.is_isotropic() { azimuth } else { 0.0 };
        let mix = Mix::new([&table.desc.azimuths, &table.desc.polar_angles], [azimuth, polar]);
        let area = look_up(&table.desc.area, place_of(wo, 0.0), &Mix::ALONE);
        Self { table, wo, mix, turned_by, area }
    }

    /// BSDF times cosine, for what is at `u` of the square that facets at `place` come from.
    fn value(&self, u: Vec2, place: Vec2) -> Vec3 {
        let desc = &self.table.desc;
        let color = look_up(&desc.colors, u, &self.mix).max(Vec3::ZERO);
        let facets = look_up(&desc.facets, place, &Mix::ALONE);
        let value = color * (facets / (4.0 * self.area));
        if value.is_finite() { value.max(Vec3::ZERO) } else { Vec3::ZERO }
    }

    /// Steradians of reflected directions per area of the facets' map.
    fn stretch(&self, h: Vec3, place: Vec2) -> f32 {
        /// Where the map shrinks to the pole.
        const LEAST: f32 = 1e-6;
        let sine = h.x.hypot(h.y);
        4.0 * self.wo.dot(h) * (2.0 * PI * PI * place.x * sine).max(LEAST)
    }
}

#[cfg(test)]
pub(crate) mod tests;
