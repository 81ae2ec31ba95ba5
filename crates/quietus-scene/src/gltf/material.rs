//! Materials: which of them are used, and what they are made of.

mod surface;
mod volume;

use std::collections::HashMap;
use std::sync::Arc;

use glam::Vec3;
use quietus_trace::desc::{
    Alpha, ColorParam, Image, Material, MaterialId, Medium, MediumId, MediumInterface, MetalRough,
    ScalarParam, Surface, Texels, Texture, TextureId,
};

use super::changes::Originals;
use super::document::Document;
use super::image::{Encoding, Pictures};
use super::schema::{self, TextureInfo};
use crate::error::SceneError;

/// Texture, encoding, set of coordinates, and the transform's bits.
pub(super) type TextureKey = (usize, Encoding, u8, [u32; 6]);

/// Collects the materials that are used, and only those.
pub(super) struct Materials<'d, 'f> {
    pub(super) document: &'d Document<'f>,
    pub materials: Vec<Material>,
    pub textures: Vec<Texture>,
    pub media: Vec<Medium>,
    /// What is inside of things of a material.
    interiors: HashMap<MaterialId, MediumId>,
    /// By their index in the file, and whether they are for points and lines that are not lit.
    pub(super) ids: HashMap<(Option<usize>, bool), MaterialId>,
    /// Which sets of texture coordinates of a mesh a material looks at, where they are not the first two.
    uv_sets: HashMap<MaterialId, [usize; 2]>,
    /// Those of the material at work, as far as it was read.
    pub(super) slots: [Option<usize>; 2],
    pub(super) texture_ids: HashMap<TextureKey, TextureId>,
    pub(super) pictures: Pictures<'d>,
    /// Stands in textures whose picture is still to come.
    pub(super) to_come: Arc<Image>,
}

impl<'d, 'f> Materials<'d, 'f> {
    pub(super) fn new(document: &'d Document<'f>) -> Self {
        Self {
            document,
            materials: Vec::new(),
            textures: Vec::new(),
            media: Vec::new(),
            interiors: HashMap::new(),
            ids: HashMap::new(),
            uv_sets: HashMap::new(),
            slots: [None; 2],
            texture_ids: HashMap::new(),
            pictures: Pictures::new(HashMap::new()),
            to_come: Arc::new(Image {
                name: String::new(),
                width: 1,
                height: 1,
                texels: Texels::Linear8(vec![[0; 4]]),
            }),
        }
    }

    /// A reader that goes on where another one had come to `materials`, textures and media, to read materials of `originals`
    /// again.
    pub(super) fn resume(
        document: &'d Document<'f>,
        originals: &Originals,
        (materials, textures, media): (Vec<Material>, Vec<Texture>, Vec<Medium>),
    ) -> Self {
        let texture_ids = originals.textures.clone();
        let pictures = Pictures::new(originals.pictures.clone());
        Self { materials, textures, media, texture_ids, pictures, ..Self::new(document) }
    }

    /// Material `index`, referred to from `place`; glTF's default material where there is none. Where it is to be `flat` it
    /// is not lit, and shows the sum of base colour and emission.
    pub(super) fn get(
        &mut self,
        index: Option<usize>,
        flat: bool,
        place: &str,
    ) -> Result<MaterialId, SceneError> {
        if let Some(&id) = self.ids.get(&(index, flat)) {
            return Ok(id);
        }
        self.slots = [None; 2];
        let id = match index {
            Some(index) => {
                let source = self.document.get(&self.document.root.materials, index, "materials", place)?;
                match flat {
                    false => self.convert(source, index)?,
                    true => self.convert(&flattened(source), index)?,
                }
            }
            None => self.push(default_material(flat)),
        };
        self.ids.insert((index, flat), id);
        self.uv_sets.insert(id, [0, 1].map(|slot| self.slots[slot].unwrap_or(slot)));
        Ok(id)
    }

    /// The two sets of texture coordinates that the material `id` looks at.
    pub(super) fn uv_sets(&self, id: MaterialId) -> [usize; 2] {
        self.uv_sets.get(&id).copied().unwrap_or([0, 1])
    }

    /// Where the material at work looks for the set `set` of texture coordinates: at the first or the second of those
    /// that meshes keep for it. `None` where both are taken.
    pub(super) fn slot(&mut self, set: usize) -> Option<u8> {
        let order = if set == 0 { [0, 1] } else { [1, 0] };
        let taken = order.into_iter().find(|&slot| self.slots[slot] == Some(set));
        let slot = taken.or_else(|| order.into_iter().find(|&slot| self.slots[slot].is_none()))?;
        self.slots[slot] = Some(set);
        Some(slot as u8)
    }

    /// The media on the sides of things of the material `id`.
    pub(super) fn media_of(&self, id: MaterialId) -> Option<MediumInterface> {
        let inside = self.interiors.get(&id).copied();
        inside.map(|inside| MediumInterface { inside: Some(inside), outside: None })
    }

    fn push(&mut self, material: Material) -> MaterialId {
        self.materials.push(material);
        MaterialId(self.materials.len() as u32 - 1)
    }

    fn convert(&mut self, source: &schema::Material, index: usize) -> Result<MaterialId, SceneError> {
        let own = format!("materials[{index}]");
        let metal_rough = self.metal_rough(source, &own)?;
        let alpha = self.alpha(source, &metal_rough, &own)?;
        let emission =
            if metal_rough.unlit { ColorParam::constant(Vec3::ZERO) } else { self.emission(source, &own)? };
        let base = Material {
            name: if source.name.is_empty() { own.clone() } else { source.name.clone() },
            surface: Surface::Interface,
            emission,
            emission_two_sided: source.double_sided,
            normal_map: self.normal_map(source.normal_texture.as_ref(), &format!("{own}.normalTexture"))?,
            bump: None,
            alpha,
        };
        let volume = &source.extensions.volume;
        let (glass, through) = (metal_rough.transmission, metal_rough.diffuse_transmission);
        let lets_pass = [glass, through].iter().any(|share| share.factor > 0.0);
        if volume.thickness_factor <= 0.0 || !lets_pass || metal_rough.unlit {
            return Ok(self.push(Material { surface: Surface::MetalRough(Box::new(metal_rough)), ..base }));
        }
        let medium = self.interior(&source.extensions, &base.name, &own)?;
        let dispersion = self.dispersion(source.extensions.dispersion.dispersion, &own)?;
        let id = if glass.factor > 0.0 {
            self.solid(base, metal_rough, dispersion)
        } else {
            self.push(Material { surface: Surface::MetalRough(Box::new(metal_rough)), ..base })
        };
        self.interiors.extend(medium.map(|medium| (id, medium)));
        Ok(id)
    }

    fn emission(&mut self, source: &schema::Material, own: &str) -> Result<ColorParam, SceneError> {
        let factor = self.positive(source.emissive_factor, &format!("{own}.emissiveFactor"))?;
        let strength = source.extensions.emissive_strength.emissive_strength;
        let place = format!("{own}.extensions.KHR_materials_emissive_strength.emissiveStrength");
        let strength = self.positive([strength; 3], &place)?;
        let texture = self.texture(
            source.emissive_texture.as_ref(),
            Encoding::Srgb,
            &format!("{own}.emissiveTexture"),
        )?;
        Ok(ColorParam { factor: factor * strength, texture })
    }

    fn alpha(&self, source: &schema::Material, surface: &MetalRough, own: &str) -> Result<Alpha, SceneError> {
        let place = format!("{own}.pbrMetallicRoughness.baseColorFactor[3]");
        let factor = self.unit(source.pbr_metallic_roughness.base_color_factor[3], &place);
        let value = ScalarParam { factor, texture: surface.base_color.texture.map(|texture| (texture, 3)) };
        match source.alpha_mode.as_deref() {
            None | Some("OPAQUE") => Ok(Alpha::Opaque),
            Some("MASK") => Ok(Alpha::Mask { value, cutoff: source.alpha_cutoff.unwrap_or(0.5) }),
            Some("BLEND") => Ok(Alpha::Blend { value }),
            Some(other) => {
                let message = format!("is \"{other}\", expected OPAQUE, MASK or BLEND");
                Err(self.document.invalid(&format!("{own}.alphaMode"), message))
            }
        }
    }

    fn normal_map(
        &mut self,
        info: Option<&TextureInfo>,
        place: &str,
    ) -> Result<Option<(TextureId, f32)>, SceneError> {
        let scale = info.and_then(|info| info.scale).unwrap_or(1.0);
        if !scale.is_finite() {
            return Err(self.document.invalid(&format!("{place}.scale"), "expected a finite number"));
        }
        Ok(self.texture(info, Encoding::Linear, place)?.map(|texture| (texture, scale)))
    }

    /// `value` in 0..1; what is outside is clamped, with a warning.
    fn unit(&self, value: f32, place: &str) -> f32 {
        if !(0.0..=1.0).contains(&value) {
            self.document.warn(place, format!("is {value}, expected 0 to 1: it is clamped"));
        }
        value.clamp(0.0, 1.0)
    }

    fn unit_color(&self, color: [f32; 3], place: &str) -> Vec3 {
        Vec3::from_array(color.map(|value| self.unit(value, place)))
    }

    fn positive(&self, color: [f32; 3], place: &str) -> Result<Vec3, SceneError> {
        match color.iter().find(|&&value| !(value >= 0.0 && value.is_finite())) {
            None => Ok(Vec3::from_array(color)),
            Some(value) => {
                let message = format!("is {value}, expected a finite number of at least 0");
                Err(self.document.invalid(place, message))
            }
        }
    }
}

/// `source` as it is without being lit. Of textures that of the base colour alone is kept.
fn flattened(source: &schema::Material) -> schema::Material {
    let [r, g, b, a] = source.pbr_metallic_roughness.base_color_factor;
    let strength = source.extensions.emissive_strength.emissive_strength;
    let [red, green, blue] = match source.emissive_texture {
        None => source.emissive_factor.map(|factor| factor * strength),
        Some(_) => [0.0; 3],
    };
    schema::Material {
        name: source.name.clone(),
        pbr_metallic_roughness: schema::MetallicRoughness {
            base_color_factor: [(r + red).min(1.0), (g + green).min(1.0), (b + blue).min(1.0), a],
            base_color_texture: source.pbr_metallic_roughness.base_color_texture.clone(),
            ..schema::MetallicRoughness::default()
        },
        alpha_mode: source.alpha_mode.clone(),
        alpha_cutoff: source.alpha_cutoff,
        extensions: schema::MaterialExtensions {
            unlit: Some(serde::de::IgnoredAny),
            ..schema::MaterialExtensions::default()
        },
        ..schema::Material::default()
    }
}

/// The material of primitives without one, lit or `flat`.
fn default_material(flat: bool) -> Material {
    Material {
        name: "default".to_owned(),
        surface: Surface::MetalRough(Box::new(MetalRough { unlit: flat, ..MetalRough::default() })),
        emission: ColorParam::constant(Vec3::ZERO),
        emission_two_sided: false,
        normal_map: None,
        bump: None,
        alpha: Alpha::Opaque,
    }
}
