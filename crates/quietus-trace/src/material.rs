//! Materials of a scene, ready to be evaluated at surface points.
//!
//! A hit asks in this order: is it a hit at all ([`MaterialTable::alpha`]), which part of a mixture is it
//! ([`MaterialTable::resolve`]), and of that part, how is its frame tilted and how does it scatter. Emission and
//! coverage belong to the mixture as a whole.

mod check;
mod glass;
mod normal;
mod params;
mod scatter;
mod subsurface;

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use glam::Vec3;

use self::params::each_param;
use crate::{
    bsdf::{FrostedTable, layered::CoatTable, measured::MeasuredTable, subsurface::SubsurfaceTable},
    desc::{self, Alpha, ColorParam, MaterialId, Roughness, ScalarParam, Surface, Texture, TextureId},
    texture::{TextureError, TextureTable},
};

pub use crate::texture::SurfacePoint;

/// A scene's materials and textures, every index checked.
#[derive(Clone, Debug, Default)]
pub struct MaterialTable {
    textures: TextureTable,
    materials: Vec<Compiled>,
}

/// A material and what follows from it.
#[derive(Clone, Debug)]
struct Compiled {
    desc: desc::Material,
    /// Whether every hit counts.
    opaque: bool,
    /// Whether the directions of the texture coordinates matter.
    needs_tangent: bool,
    /// Whether colour channels are refracted apart.
    disperses: bool,
    /// What its coat lets pass, where there is one and a closed form for it.
    coat: Option<Arc<CoatTable>>,
    /// What glass loses that keeps its light, by channel.
    frosted: Option<[Arc<FrostedTable>; 3]>,
    /// Which medium gives back how much light, where light wanders below it.
    below: Option<Arc<SubsurfaceTable>>,
    /// What was measured of it, if it was.
    measured: Option<Arc<MeasuredTable>>,
}

/// What is wrong with a scene's materials or textures.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MaterialError {
    /// A material names a texture that is not there.
    #[error("material {material:?}: {field} names texture {texture}, but there are {count}")]
    NoSuchTexture {
        /// The material's name.
        material: String,
        /// Which of its parameters.
        field: &'static str,
        /// The index it gives.
        texture: u32,
        /// How many textures there are.
        count: usize,
    },
    /// A mixture names a material that is not there.
    #[error("material {material:?}: it mixes material {part}, but there are {count}")]
    NoSuchMaterial {
        /// The mixture's name.
        material: String,
        /// The index it gives.
        part: u32,
        /// How many materials there are.
        count: usize,
    },
    /// A value out of its range.
    #[error("material {material:?}: {field} must be {expected}, but is {value}")]
    OutOfRange {
        /// The material's name.
        material: String,
        /// Which of its parameters.
        field: &'static str,
        /// What was expected.
        expected: &'static str,
        /// What was found.
        value: String,
    },
    /// A texture that cannot be looked up.
    #[error(transparent)]
    Texture(#[from] TextureError),
}

impl MaterialTable {
    /// Checks the textures and materials of a scene and keeps copies (images stay shared).
    ///
    /// # Errors
    /// Names the first texture or material that cannot be used, and why.
    pub fn compile(textures: &[Texture], materials: &[desc::Material]) -> Result<Self, MaterialError> {
        check::materials(materials, textures.len())?;
        let exact: HashSet<TextureId> = materials.iter().flat_map(exact_textures).collect();
        let textures = TextureTable::compile(textures, |id| exact.contains(&id))?;
        let mut table = Self { textures, materials: vec![] };
        let (coats, below) = (scatter::coats(materials), subsurface::tables(materials));
        let (measured, frosted) = (measured(materials), glass::frosted(materials));
        table.materials = materials
            .iter()
            .zip(coats.into_iter().zip(below).zip(frosted))
            .map(|(desc, ((coat, below), frosted))| Compiled {
                desc: desc.clone(),
                opaque: is_opaque(desc, materials),
                needs_tangent: needs_tangent(desc, materials),
                disperses: disperses(desc),
                coat,
                frosted,
                below,
                measured: match &desc.surface {
                    Surface::Measured(m) => measured.get(&Arc::as_ptr(m)).cloned(),
                    _ => None,
                },
            })
            .collect();
        Ok(table)
    }

    /// The textures.
    pub fn textures(&self) -> &TextureTable {
        &self.textures
    }

    /// How many materials there are: ids below this are valid for every method here, others panic.
    pub fn len(&self) -> usize {
        self.materials.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.materials.is_empty()
    }

    /// Whether anything but coverage may differ with the texture coordinates of a point.
    pub(crate) fn is_textured(&self, id: MaterialId) -> bool {
        let material = self.material(id);
        let mut textured = false;
        each_param(material, |_, param| textured |= param.is_textured());
        match &material.surface {
            // Where a ray meets the fibre is a coordinate too.
            Surface::Hair(_) => true,
            Surface::Mix { materials, .. } => textured || materials.iter().any(|&id| self.is_textured(id)),
            _ => textured,
        }
    }

    /// Whether nothing is there but the border between two media.
    #[inline]
    pub fn is_interface(&self, id: MaterialId) -> bool {
        matches!(self.material(id).surface, Surface::Interface)
    }

    /// Which part of a mixture a hit is, by its own random `bits`, which must not decide about coverage too; `id` itself
    /// where that is no mixture. Of the parts, those with less coverage are chosen less often.
    #[inline(always)]
    pub fn resolve(&self, id: MaterialId, point: &SurfacePoint, bits: impl FnOnce() -> u64) -> MaterialId {
        if matches!(self.material(id).surface, Surface::Mix { .. }) {
            self.resolve_mix(id, point, bits())
        } else {
            id
        }
    }

    #[inline(never)]
    fn resolve_mix(&self, mut id: MaterialId, point: &SurfacePoint, bits: u64) -> MaterialId {
        let mut u = (bits >> 11) as f64 / (1u64 << 53) as f64;
        while let Surface::Mix { materials: [first, second], amount } = &self.material(id).surface {
            let amount = amount.at(point, &self.textures).clamp(0.0, 1.0);
            let weights = [(1.0 - amount) * self.alpha(*first, point), amount * self.alpha(*second, point)];
            let share = f64::from(weights[1]) / f64::from(weights[0] + weights[1]).max(f64::MIN_POSITIVE);
            // What is left of the number is as random as it was.
            (id, u) = if u < share { (*second, u / share) } else { (*first, (u - share) / (1.0 - share)) };
        }
        id
    }

    /// Emitted radiance at `point`, seen from the front (the side the geometric normal points to) or the back.
    #[inline]
    pub fn emission(&self, id: MaterialId, point: &SurfacePoint, front: bool) -> Vec3 {
        let material = self.material(id);
        if material.emission.factor == Vec3::ZERO || !(front || material.emission_two_sided) {
            return Vec3::ZERO;
        }
        material.emission.at(point, &self.textures)
    }

    /// Whether anything of the material can emit: whether its shapes are lights.
    #[inline]
    pub fn emits(&self, id: MaterialId) -> bool {
        self.material(id).emission.factor != Vec3::ZERO
    }

    /// Whether emission differs from place to place.
    pub fn emission_is_textured(&self, id: MaterialId) -> bool {
        self.material(id).emission.texture.is_some()
    }

    /// Whether the back side emits too.
    #[inline]
    pub fn emits_two_sided(&self, id: MaterialId) -> bool {
        self.material(id).emission_two_sided
    }

    /// Mean emitted radiance over the texture's image, to weigh lights against each other before any point on
    /// them is known. Costs a pass over the image: not for the hot path.
    pub fn mean_emission(&self, id: MaterialId) -> Vec3 {
        let ColorParam { factor, texture } = self.material(id).emission;
        texture.map_or(factor, |texture| factor * self.textures.mean(texture).truncate())
    }

    /// Whether every hit counts: [`alpha`](Self::alpha) is 1 everywhere.
    #[inline]
    pub fn is_opaque(&self, id: MaterialId) -> bool {
        self.compiled(id).opaque
    }

    /// Whether it is never hit, though its light shines.
    pub fn is_unseen(&self, id: MaterialId) -> bool {
        self.material(id).alpha == Alpha::Unseen
    }

    /// Coverage at `point`: the probability of being hit, in 0..1.
    pub fn alpha(&self, id: MaterialId, point: &SurfacePoint) -> f32 {
        let value = |v: &ScalarParam| v.at(point, &self.textures) * point.color.w;
        let material = self.material(id);
        let own = match &material.alpha {
            Alpha::Opaque => 1.0,
            Alpha::Unseen => 0.0,
            Alpha::Mask { value: v, cutoff } => f32::from(u8::from(value(v) >= *cutoff)),
            Alpha::Blend { value: v } => value(v).clamp(0.0, 1.0),
        };
        match &material.surface {
            Surface::Interface => 0.0,
            Surface::Mix { materials: [first, second], amount } if !self.is_opaque(id) => {
                let amount = amount.at(point, &self.textures).clamp(0.0, 1.0);
                own * ((1.0 - amount) * self.alpha(*first, point) + amount * self.alpha(*second, point))
            }
            _ => own,
        }
    }

    /// Whether the directions of the texture coordinates matter: for normal and bump maps, that of a clear coat too,
    /// and anisotropic roughness.
    #[inline]
    pub fn needs_tangent(&self, id: MaterialId) -> bool {
        self.compiled(id).needs_tangent
    }

    /// Whether it refracts each colour channel in another direction: a path has to go on with one of them, see
    /// [`bsdf_of_channel`](Self::bsdf_of_channel). Of mixtures, the part that was [resolved](Self::resolve) counts.
    #[inline]
    pub fn disperses(&self, id: MaterialId) -> bool {
        self.compiled(id).disperses
    }

    #[inline]
    fn material(&self, id: MaterialId) -> &desc::Material {
        &self.compiled(id).desc
    }

    #[inline]
    fn compiled(&self, MaterialId(id): MaterialId) -> &Compiled {
        &self.materials[id as usize]
    }
}

/// The tables of what was measured, each once.
fn measured(materials: &[desc::Material]) -> HashMap<*const desc::Measured, Arc<MeasuredTable>> {
    let mut tables = HashMap::new();
    for material in materials {
        if let Surface::Measured(m) = &material.surface {
            tables.entry(Arc::as_ptr(m)).or_insert_with(|| Arc::new(MeasuredTable::new(m)));
        }
    }
    tables
}

/// Whether every hit of a checked material counts.
fn is_opaque(material: &desc::Material, materials: &[desc::Material]) -> bool {
    material.alpha == Alpha::Opaque
        && match &material.surface {
            Surface::Interface => false,
            Surface::Mix { materials: parts, .. } => {
                parts.iter().all(|part| is_opaque(&materials[part.0 as usize], materials))
            }
            _ => true,
        }
}

fn disperses(material: &desc::Material) -> bool {
    matches!(&material.surface, Surface::Glass(glass) if glass.ior != Vec3::splat(glass.ior.x))
}

/// Whether a checked material looks at the directions of texture coordinates.
fn needs_tangent(material: &desc::Material, materials: &[desc::Material]) -> bool {
    let anisotropic = |r: &Roughness| r.u != r.v;
    material.normal_map.is_some()
        || material.bump.is_some()
        || match &material.surface {
            Surface::MetalRough(m) => m.clearcoat_normal.is_some() || m.anisotropy.strength != 0.0,
            Surface::Conductor { roughness, .. } | Surface::Dielectric { roughness, .. } => {
                anisotropic(roughness)
            }
            Surface::Glass(glass) => anisotropic(&glass.roughness),
            Surface::Subsurface(s) => anisotropic(&s.roughness),
            Surface::Measured(m) => !m.is_isotropic(),
            Surface::CoatedDiffuse { coat, .. } => anisotropic(&coat.roughness),
            Surface::CoatedConductor { roughness, coat, .. } => {
                anisotropic(roughness) || anisotropic(&coat.roughness)
            }
            Surface::Hair(_) => true,
            Surface::Mix { materials: parts, .. } => {
                parts.iter().any(|part| needs_tangent(&materials[part.0 as usize], materials))
            }
            _ => false,
        }
}

/// The textures of a material that filtering would falsify: what they hold is not averaged, or others look at it
/// unfiltered and must see the same.
fn exact_textures(material: &desc::Material) -> impl Iterator<Item = TextureId> {
    let desc::Material { surface, emission, normal_map, bump, alpha, .. } = material;
    let (coat, amount) = match surface {
        Surface::MetalRough(m) => (m.clearcoat_normal, None),
        Surface::Mix { amount, .. } => (None, amount.texture),
        _ => (None, None),
    };
    let coverage = match alpha {
        Alpha::Opaque | Alpha::Unseen => None,
        Alpha::Mask { value, .. } | Alpha::Blend { value } => value.texture,
    };
    let normals = [*normal_map, coat].map(|map| map.map(|(texture, _)| texture));
    let scalars =
        [bump.and_then(|bump| bump.texture), coverage, amount].map(|map| map.map(|(texture, _)| texture));
    // Of emission, light sampling sees the texels themselves; of colours beside coverage, only what is covered counts.
    normals.into_iter().chain(scalars).chain([emission.texture]).flatten()
}

#[cfg(test)]
mod tests;
