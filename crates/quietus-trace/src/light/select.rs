//! Which light to ask.
//!
//! The interface takes the point that asks, so that a hierarchy over the lights can take the place of the table.

use glam::Vec3;

use super::distribution::AliasTable;

/// Chooses among lights by their power, whoever asks.
#[derive(Clone, Debug, Default)]
pub(crate) struct LightSelector {
    table: AliasTable,
}

impl LightSelector {
    /// A selector over `local` lights, given their power, followed by `infinite` ones, given the irradiance they
    /// cause; numbers that are negative or not finite count as 0.
    ///
    /// The two cannot be compared without knowing how much of the scene is in view, so where both are, each kind
    /// gets one half.
    pub(crate) fn new(local: &[f32], infinite: &[f32]) -> Self {
        let share = |weights: &[f32]| -> Vec<f64> {
            let clean = |&w: &f32| if w.is_finite() { f64::from(w.max(0.0)) } else { 0.0 };
            let total: f64 = weights.iter().map(clean).sum();
            weights.iter().map(|w| if total > 0.0 { clean(w) / total } else { 0.0 }).collect()
        };
        Self { table: AliasTable::new(&[share(local), share(infinite)].concat()) }
    }

    /// A light and the probability of choosing it, for `u` in `[0, 1)`; none where none shines.
    #[inline]
    pub(crate) fn sample(&self, _from: Vec3, u: f32) -> Option<(u32, f32)> {
        self.table.sample(u)
    }

    /// The probability with which [`Self::sample`] chooses `light`.
    #[inline]
    pub(crate) fn probability(&self, _from: Vec3, light: u32) -> f32 {
        self.table.probability(light)
    }
}
