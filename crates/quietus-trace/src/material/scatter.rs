//! From a material and a point to the BSDF there.

use std::{collections::BTreeMap, sync::Arc};

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::{MaterialTable, SurfacePoint};
use crate::{
    bsdf::{
        Bsdf, CoatedDiffuse, Conductor, Dielectric, Diffuse, DiffuseTransmission, FilmParams, Hair,
        HairParams, Layered, Measured, MetalRough, MetalRoughParams, ThinDielectric,
        ggx::Ggx,
        hair::{absorption_of_pigments, absorption_of_reflectance},
        layered::{Base, CoatTable, LayeredParams},
    },
    desc::{
        self, Coat, ColorParam, HairColor, MaterialId, Metal, Roughness, RoughnessScale, ScalarParam, Surface,
    },
};

/// A metal that is nowhere darker would reflect everything, with an infinite index of refraction.
const MAX_METAL_REFLECTANCE: Vec3 = Vec3::splat(0.9999);
/// The phase function has a direction left.
const MAX_ASYMMETRY: f32 = 0.999;

impl MaterialTable {
    /// How the surface scatters at `point`; [`Bsdf::Black`] where it is unlit, or a mixture that has not been
    /// [resolved](Self::resolve). `key` seeds the random walks of coats: different for different paths.
    #[inline(always)]
    pub fn bsdf(&self, id: MaterialId, point: &SurfacePoint, key: u64) -> Bsdf<'_> {
        let color = |p: &ColorParam| p.at(point, &self.textures);
        let unit_color = |p: &ColorParam| color(p).clamp(Vec3::ZERO, Vec3::ONE);
        let unit = |p: &ScalarParam| p.at(point, &self.textures).clamp(0.0, 1.0);
        match &self.material(id).surface {
            Surface::Diffuse { reflectance } => {
                Bsdf::Diffuse(Diffuse { reflectance: unit_color(reflectance) })
            }
            Surface::Conductor { metal, roughness } => {
                let (eta, k) = self.index(metal, point);
                Bsdf::Conductor(Conductor::new(eta, k, self.facets(roughness, point)))
            }
            Surface::Dielectric { ior, roughness, tint } => {
                Bsdf::Dielectric(Dielectric::new(*ior, self.facets(roughness, point), unit_color(tint)))
            }
            Surface::ThinDielectric { ior } => Bsdf::ThinDielectric(ThinDielectric { ior: *ior }),
            Surface::DiffuseTransmission { reflectance, transmittance } => {
                Bsdf::DiffuseTransmission(DiffuseTransmission {
                    reflectance: unit_color(reflectance),
                    transmittance: unit_color(transmittance),
                })
            }
            Surface::MetalRough(m) if m.unlit => Bsdf::Black,
            Surface::MetalRough(m) => Bsdf::MetalRough(MetalRough::new(&MetalRoughParams {
                base_color: (color(&m.base_color) * point.color.truncate()).clamp(Vec3::ZERO, Vec3::ONE),
                metallic: unit(&m.metallic),
                roughness: unit(&m.roughness),
                ior: m.ior,
                specular: unit(&m.specular),
                specular_color: color(&m.specular_color),
                transmission: unit(&m.transmission),
                diffuse_transmission: unit(&m.diffuse_transmission),
                diffuse_transmission_color: unit_color(&m.diffuse_transmission_color),
                film: self.film(&m.film, point),
                clearcoat: unit(&m.clearcoat),
                clearcoat_roughness: unit(&m.clearcoat_roughness),
                clearcoat_normal: self.clearcoat_normal(self.material(id), m, point),
                anisotropy: self.anisotropy(m, point).0,
                sheen_color: unit_color(&m.sheen_color),
                sheen_roughness: unit(&m.sheen_roughness),
            })),
            surface => self.rare_bsdf(id, surface, point, key),
        }
    }

    /// How a surface that [disperses](Self::disperses) light scatters that of one colour channel.
    #[inline(never)]
    pub fn bsdf_of_channel(&self, id: MaterialId, point: &SurfacePoint, channel: usize) -> Bsdf<'_> {
        match &self.material(id).surface {
            Surface::Glass(glass) => self.glass(id, glass, point, channel),
            surface => self.rare_bsdf(id, surface, point, 0),
        }
    }

    /// Models with a price, out of the way of the others.
    #[inline(never)]
    fn rare_bsdf(&self, id: MaterialId, surface: &Surface, point: &SurfacePoint, key: u64) -> Bsdf<'_> {
        let unit_color = |p: &ColorParam| p.at(point, &self.textures).clamp(Vec3::ZERO, Vec3::ONE);
        match surface {
            Surface::CoatedDiffuse { reflectance, coat } => {
                let reflectance = unit_color(reflectance);
                match &self.compiled(id).coat {
                    Some(table) => {
                        let facets = self.facets(&coat.roughness, point);
                        let dielectric = Dielectric::new(coat.ior, facets, Vec3::ONE);
                        Bsdf::CoatedDiffuse(CoatedDiffuse::new(
                            dielectric,
                            table,
                            reflectance,
                            coat.max_depth,
                        ))
                    }
                    None => self.layered(coat, Base::Diffuse(Diffuse { reflectance }), point, key),
                }
            }
            Surface::CoatedConductor { metal, roughness, coat } => {
                let (eta, k) = self.index(metal, point);
                // The metal borders on the coat's medium.
                let metal = Conductor::new(eta / coat.ior, k / coat.ior, self.facets(roughness, point));
                self.layered(coat, Base::Conductor(metal), point, key)
            }
            Surface::Glass(glass) => self.glass(id, glass, point, 1),
            Surface::Hair(hair) => Bsdf::Hair(self.hair(hair, point)),
            Surface::Subsurface(s) => self.subsurface(id, s, point),
            Surface::Measured(_) => match &self.compiled(id).measured {
                Some(table) => Bsdf::Measured(Measured::new(table)),
                None => Bsdf::Black,
            },
            _ => Bsdf::Black,
        }
    }

    /// A thin film at a point.
    #[inline]
    pub(super) fn film(&self, film: &desc::ThinFilm, point: &SurfacePoint) -> FilmParams {
        let strength = film.strength.at(point, &self.textures).clamp(0.0, 1.0);
        let [least, most] = film.thickness;
        let place = film.place.at(point, &self.textures).clamp(0.0, 1.0);
        FilmParams { strength, ior: film.ior, thickness: least + (most - least) * place }
    }

    fn hair(&self, hair: &desc::Hair, point: &SurfacePoint) -> Hair {
        let scalar = |p: &ScalarParam| p.at(point, &self.textures);
        let color = |p: &ColorParam| p.at(point, &self.textures);
        let beta_n = scalar(&hair.beta_n);
        let absorption = match &hair.color {
            HairColor::Absorption(absorption) => color(absorption),
            HairColor::Reflectance(reflectance) => {
                absorption_of_reflectance(color(reflectance), beta_n.clamp(0.0, 1.0))
            }
            HairColor::Pigments { eumelanin, pheomelanin } => {
                absorption_of_pigments(scalar(eumelanin), scalar(pheomelanin))
            }
        };
        // Across a curve v runs from 0 to 1.
        let h = 2.0 * point.uv[0].y - 1.0;
        let (beta_m, ior, tilt) = (scalar(&hair.beta_m), hair.ior, hair.alpha);
        Hair::new(&HairParams { h, ior, absorption, beta_m, beta_n, tilt })
    }

    fn layered(&self, coat: &Coat, base: Base, point: &SurfacePoint, key: u64) -> Bsdf<'_> {
        let facets = self.facets(&coat.roughness, point);
        Bsdf::Layered(Layered::new(LayeredParams {
            coat: Dielectric::new(coat.ior, facets, Vec3::ONE),
            base,
            thickness: coat.thickness.at(point, &self.textures).max(0.0),
            albedo: coat.albedo.at(point, &self.textures).clamp(Vec3::ZERO, Vec3::ONE),
            g: coat.g.at(point, &self.textures).clamp(-MAX_ASYMMETRY, MAX_ASYMMETRY),
            max_depth: coat.max_depth,
            key,
        }))
    }

    /// The complex index of refraction of a metal.
    #[inline]
    fn index(&self, metal: &Metal, point: &SurfacePoint) -> (Vec3, Vec3) {
        match metal {
            Metal::Index { eta, k } => (*eta, *k),
            Metal::Reflectance(reflectance) => {
                let r = reflectance.at(point, &self.textures).clamp(Vec3::ZERO, MAX_METAL_REFLECTANCE);
                (Vec3::ONE, 2.0 * (r / (1.0 - r)).map(f32::sqrt))
            }
        }
    }

    /// The microfacets of a rough surface; `None` where it is smooth.
    #[inline]
    pub(super) fn facets(&self, Roughness { u, v, scale }: &Roughness, point: &SurfacePoint) -> Option<Ggx> {
        let alpha = |p: &ScalarParam| scale.alpha(p.at(point, &self.textures));
        let along = alpha(u);
        let across = if u == v { along } else { alpha(v) };
        Ggx::new(Vec2::new(along, across))
    }

    /// The base colour of an unlit surface, to be shown where the camera sees it directly (or through perfect
    /// mirrors and glass); `None` for lit ones.
    #[inline(always)]
    pub fn unlit_color(&self, id: MaterialId, point: &SurfacePoint) -> Option<Vec3> {
        match &self.material(id).surface {
            Surface::MetalRough(m) if m.unlit => {
                Some(m.base_color.at(point, &self.textures) * point.color.truncate())
            }
            _ => None,
        }
    }
}

impl RoughnessScale {
    /// The GGX alpha of a roughness; of one below 0 that of 0.
    #[inline]
    pub(super) fn alpha(self, roughness: f32) -> f32 {
        let roughness = roughness.max(0.0);
        match self {
            Self::Squared => roughness * roughness,
            Self::SquareRoot => roughness.sqrt(),
            Self::Alpha => roughness,
        }
    }
}

/// For each material the passage through its coat, if it has one and light does not scatter below it before it reaches
/// a diffuse base. Equal coats share a table.
pub(super) fn coats(materials: &[desc::Material]) -> Vec<Option<Arc<CoatTable>>> {
    let keys: Vec<_> = materials.iter().map(coat_key).collect();
    let mut distinct: Vec<_> = keys.iter().flatten().copied().collect();
    distinct.sort_unstable();
    distinct.dedup();
    let tables: BTreeMap<_, _> =
        distinct.into_par_iter().map(|key| (key, Arc::new(coat_table(key)))).collect();
    keys.iter().map(|key| tables.get(key.as_ref()?).cloned()).collect()
}

/// Bits of a coat's index, its thickness, and its alpha unless that varies.
type CoatKey = (u32, u32, Option<u32>);

fn coat_key(material: &desc::Material) -> Option<CoatKey> {
    let Surface::CoatedDiffuse { coat, .. } = &material.surface else { return None };
    let Coat { ior, roughness: Roughness { u, v, scale }, thickness, albedo, .. } = coat;
    let closed = albedo.factor == Vec3::ZERO && thickness.texture.is_none() && u == v;
    let alpha = u.texture.is_none().then(|| scale.alpha(u.factor).to_bits());
    closed.then_some((ior.to_bits(), thickness.factor.to_bits(), alpha))
}

fn coat_table((ior, thickness, alpha): CoatKey) -> CoatTable {
    CoatTable::new(f32::from_bits(ior), f32::from_bits(thickness), alpha.map(f32::from_bits))
}
