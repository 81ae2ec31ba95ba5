//! Glass that disperses light, has a film on it, or keeps the light that its facets throw at each other.

use std::{collections::BTreeMap, sync::Arc};

use glam::Vec3;
use rayon::prelude::*;

use super::{MaterialTable, SurfacePoint};
use crate::{
    bsdf::{Bsdf, Dielectric, FrostedTable},
    desc::{self, Glass, MaterialId, Surface},
};

impl MaterialTable {
    /// How the surface scatters the light of one colour channel at `point`.
    pub(super) fn glass(
        &self,
        id: MaterialId,
        glass: &Glass,
        point: &SurfacePoint,
        channel: usize,
    ) -> Bsdf<'_> {
        let tint = glass.tint.at(point, &self.textures).clamp(Vec3::ZERO, Vec3::ONE);
        let plain = Dielectric::new(glass.ior[channel], self.facets(&glass.roughness, point), tint);
        match &self.compiled(id).frosted {
            Some(tables) if !plain.is_delta() => Bsdf::FrostedGlass(tables[channel].glass(plain)),
            _ => Bsdf::Dielectric(plain.with_film(self.film(&glass.film, point))),
        }
    }
}

/// For each material of glass that keeps its light what it would lose, by channel. Equal ones share tables.
pub(super) fn frosted(materials: &[desc::Material]) -> Vec<Option<[Arc<FrostedTable>; 3]>> {
    let keys: Vec<_> = materials.iter().map(keys).collect();
    let mut distinct: Vec<Key> = keys.iter().flatten().flatten().copied().collect();
    distinct.sort_unstable();
    distinct.dedup();
    let table = |(ior, alpha): Key| FrostedTable::new(f32::from_bits(ior), alpha.map(f32::from_bits));
    let tables: BTreeMap<Key, _> = distinct.into_par_iter().map(|key| (key, Arc::new(table(key)))).collect();
    keys.iter().map(|keys| keys.map(|keys| keys.map(|key| tables[&key].clone()))).collect()
}

/// Bits of an index, and of alpha unless that varies.
type Key = (u32, Option<u32>);

/// Those of all channels.
fn keys(material: &desc::Material) -> Option<[Key; 3]> {
    let Surface::Glass(glass) = &material.surface else { return None };
    let desc::Roughness { u, v, scale } = glass.roughness;
    let alpha = u.texture.is_none().then(|| scale.alpha(u.factor));
    let rough = alpha.is_none_or(|alpha| alpha > 0.0);
    // A film reflects otherwise than tables are made for.
    let plain = glass.film.strength.factor == 0.0;
    (glass.keeps_light && rough && plain && u == v)
        .then(|| glass.ior.to_array().map(|ior| (ior.to_bits(), alpha.map(f32::to_bits))))
}
