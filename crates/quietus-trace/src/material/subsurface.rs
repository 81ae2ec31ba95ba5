//! Materials that light wanders below.

use std::{collections::BTreeMap, sync::Arc};

use glam::Vec3;
use rayon::prelude::*;

use super::{MaterialTable, SurfacePoint};
use crate::{
    bsdf::{
        Bsdf, Dielectric, Subsurface,
        subsurface::{Below, SubsurfaceTable},
    },
    desc::{self, Interior, MaterialId, Surface},
    medium::Medium,
};

impl MaterialTable {
    /// Whether light wanders below any of the materials.
    pub(crate) fn any_subsurface(&self) -> bool {
        self.materials.iter().any(|material| material.below.is_some())
    }

    /// The index of refraction of what light wanders in below a material, if it does.
    #[inline]
    pub(crate) fn subsurface_ior(&self, id: MaterialId) -> Option<f32> {
        match &self.material(id).surface {
            Surface::Subsurface(s) => Some(s.ior),
            _ => None,
        }
    }

    /// What light wanders in that enters at `point`.
    #[inline(never)]
    pub(crate) fn medium_below(&self, id: MaterialId, point: &SurfacePoint) -> Option<Medium> {
        let Surface::Subsurface(s) = &self.material(id).surface else { return None };
        Some(Medium::below(self.coefficients(id, s, point)?, s.g))
    }

    /// Absorption and scattering below `point`.
    fn coefficients(&self, id: MaterialId, s: &desc::Subsurface, point: &SurfacePoint) -> Option<[Vec3; 2]> {
        let table = self.compiled(id).below.as_ref()?;
        Some(match &s.interior {
            Interior::Coefficients { absorption, scattering } => {
                [absorption, scattering].map(|p| p.at(point, &self.textures).max(Vec3::ZERO))
            }
            Interior::Reflectance { reflectance, mean_free_path } => {
                let albedo = reflectance.at(point, &self.textures).map(|r| table.albedo(r));
                let free = mean_free_path.at(point, &self.textures).max(Vec3::splat(f32::MIN_POSITIVE));
                let extinction = free.recip().min(Vec3::splat(f32::MAX));
                [(1.0 - albedo) * extinction, albedo * extinction]
            }
        })
    }

    /// The surface as it is seen from outside.
    pub(super) fn subsurface(&self, id: MaterialId, s: &desc::Subsurface, point: &SurfacePoint) -> Bsdf<'_> {
        let (Some(table), Some([absorption, scattering])) =
            (&self.compiled(id).below, self.coefficients(id, s, point))
        else {
            return Bsdf::Black;
        };
        let albedo = scattering / (absorption + scattering).max(Vec3::splat(f32::MIN_POSITIVE));
        let surface = Dielectric::new(s.ior, self.facets(&s.roughness, point), Vec3::ONE);
        let color = albedo.map(|albedo| table.reflectance(albedo));
        Bsdf::Subsurface(Subsurface::new(surface, table.entering, color).seen_from(Below::No))
    }
}

/// For each material that light wanders below what its medium gives back. Equal ones share a table.
pub(super) fn tables(materials: &[desc::Material]) -> Vec<Option<Arc<SubsurfaceTable>>> {
    let key = |material: &desc::Material| match &material.surface {
        Surface::Subsurface(s) => Some((s.ior.to_bits(), s.g.to_bits())),
        _ => None,
    };
    let mut distinct: Vec<_> = materials.iter().filter_map(key).collect();
    distinct.sort_unstable();
    distinct.dedup();
    let table = |(ior, g)| SubsurfaceTable::new(f32::from_bits(ior), f32::from_bits(g));
    let tables: BTreeMap<_, _> = distinct.into_par_iter().map(|key| (key, Arc::new(table(key)))).collect();
    materials.iter().map(|material| tables.get(&key(material)?).cloned()).collect()
}
