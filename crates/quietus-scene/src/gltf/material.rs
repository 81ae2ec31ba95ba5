//! Materials.

use std::collections::HashMap;
use std::sync::Arc;

use glam::Vec3;
use quietus_trace::desc::{
    Alpha, Anisotropy, ColorParam, Glass, Image, Material, MaterialId, Medium, MediumId, MediumInterface,
    MetalRough, Roughness, ScalarParam, Surface, Texels, Texture, TextureId, ThinFilm,
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

    /// KHR_materials_dispersion: 20 over Abbe's number.
    fn dispersion(&self, value: f32, own: &str) -> Result<f32, SceneError> {
        let place = format!("{own}.extensions.KHR_materials_dispersion.dispersion");
        Ok(self.positive([value; 3], &place)?.x)
    }

    /// A thing with an inside (KHR_materials_volume): where light is transmitted it refracts.
    fn solid(&mut self, base: Material, surface: MetalRough, dispersion: f32) -> MaterialId {
        let MetalRough { ior, base_color: tint, film, .. } = surface;
        let roughness = Roughness::perceptual(surface.roughness);
        let smooth = surface.roughness.factor == 0.0;
        let glass = if dispersion > 0.0 || film.strength.factor > 0.0 || !smooth {
            // The extension's own measure: Abbe's number compares these two differences.
            let spread = 0.025 * dispersion * (ior - 1.0);
            let ior = Vec3::new((ior - spread).max(1.0), ior, ior + spread);
            Surface::Glass(Box::new(Glass { ior, roughness, tint, film, keeps_light: true }))
        } else {
            Surface::Dielectric { ior, roughness, tint }
        };
        let (share, metallic) = (surface.transmission, surface.metallic);
        let rest = MetalRough { transmission: ScalarParam::constant(0.0), ..surface };
        self.mix(base, rest, glass, share, metallic)
    }

    /// `base` with a share of `share * (1 - metallic)` of `other`, and `surface` for the rest.
    fn mix(
        &mut self,
        base: Material,
        surface: MetalRough,
        other: Surface,
        share: ScalarParam,
        metallic: ScalarParam,
    ) -> MaterialId {
        if share == ScalarParam::constant(1.0) && metallic.factor == 0.0 {
            return self.push(Material { surface: other, ..base });
        }
        let amount = match metallic {
            ScalarParam { factor: 0.0, .. } => share,
            ScalarParam { factor, texture: None } => {
                ScalarParam { factor: share.factor * (1.0 - factor), ..share }
            }
            _ => {
                let shades = [Vec3::ONE, Vec3::ZERO].map(ColorParam::constant);
                let rest = self.push_texture(Texture::Mix { colors: shades, amount: metallic });
                let color = ColorParam { factor: Vec3::ONE, texture: Some(rest) };
                ScalarParam {
                    factor: 1.0,
                    texture: Some((self.push_texture(Texture::Scale { color, scale: share }), 0)),
                }
            }
        };
        // What both have in common stays with the whole; each of them is a surface and nothing else.
        let part = |surface: Surface| Material {
            surface,
            emission: ColorParam::constant(Vec3::ZERO),
            emission_two_sided: false,
            alpha: Alpha::Opaque,
            ..base.clone()
        };
        let parts = [part(Surface::MetalRough(Box::new(surface))), part(other)];
        let materials = parts.map(|part| self.push(part));
        self.push(Material { surface: Surface::Mix { materials, amount }, ..base })
    }

    /// The medium inside of a thing called `name`; `None` where it lets everything through. After the attenuation
    /// distance the attenuation colour is left of white light that goes straight; some of what is missing is scattered.
    fn interior(
        &mut self,
        extensions: &schema::MaterialExtensions,
        name: &str,
        own: &str,
    ) -> Result<Option<MediumId>, SceneError> {
        /// What a colour of 0 stands for: a finite coefficient must say that nothing is left.
        const DARKEST: f32 = 1e-6;
        let schema::MaterialExtensions { volume, volume_scatter: scatter, .. } = extensions;
        let at = |name: &str| format!("{own}.extensions.KHR_materials_volume.{name}");
        let color = self.unit_color(volume.attenuation_color, &at("attenuationColor"));
        let Some(distance) = volume.attenuation_distance else { return Ok(None) };
        if distance.is_nan() || distance <= 0.0 {
            let message = format!("is {distance}, expected a number above 0");
            return Err(self.document.invalid(&at("attenuationDistance"), message));
        }
        let attenuation = color.max(Vec3::splat(DARKEST)).map(|value| -value.ln() / distance).max(Vec3::ZERO);
        if attenuation == Vec3::ZERO {
            return Ok(None);
        }
        let at = |name: &str| format!("{own}.extensions.KHR_materials_volume_scatter.{name}");
        let seen = self.unit_color(scatter.multiscatter_color, &at("multiscatterColor"));
        let g = scatter.scatter_anisotropy;
        if !(-1.0..=1.0).contains(&g) {
            let message = format!("is {g}, expected a number from -1 to 1");
            return Err(self.document.invalid(&at("scatterAnisotropy"), message));
        }
        let g = g.clamp(-MAX_ANISOTROPY, MAX_ANISOTROPY);
        let scattering = attenuation * seen.map(|albedo| single_scattering(albedo, g));
        let absorption = attenuation - scattering;
        let (emission, variation) = (Vec3::ZERO, None);
        self.media.push(Medium { name: name.to_owned(), absorption, scattering, emission, g, variation });
        Ok(Some(MediumId(self.media.len() as u32 - 1)))
    }

    fn metal_rough(&mut self, source: &schema::Material, own: &str) -> Result<MetalRough, SceneError> {
        let pbr = &source.pbr_metallic_roughness;
        let at = |name: &str| format!("{own}.pbrMetallicRoughness.{name}");
        let [r, g, b, _] = pbr.base_color_factor;
        let metallic_roughness = self.texture(
            pbr.metallic_roughness_texture.as_ref(),
            Encoding::Linear,
            &at("metallicRoughnessTexture"),
        )?;
        let roughness = match &source.extensions.glossiness_texture {
            Some(info) => self.roughness_of_gloss(info, pbr.roughness_factor, own)?,
            None => ScalarParam {
                factor: self.unit(pbr.roughness_factor, &at("roughnessFactor")),
                texture: metallic_roughness.map(|texture| (texture, 1)),
            },
        };
        let base = MetalRough {
            base_color: ColorParam {
                factor: self.unit_color([r, g, b], &at("baseColorFactor")),
                texture: self.texture(
                    pbr.base_color_texture.as_ref(),
                    Encoding::Srgb,
                    &at("baseColorTexture"),
                )?,
            },
            metallic: ScalarParam {
                factor: self.unit(pbr.metallic_factor, &at("metallicFactor")),
                texture: metallic_roughness.map(|texture| (texture, 2)),
            },
            roughness,
            unlit: source.extensions.unlit.is_some(),
            ..MetalRough::default()
        };
        self.extend(base, source, own)
    }

    /// `1 - glossiness * alpha` of the texture `info`; `least` is that of an alpha of 1.
    fn roughness_of_gloss(
        &mut self,
        info: &TextureInfo,
        least: f32,
        own: &str,
    ) -> Result<ScalarParam, SceneError> {
        let place = format!("{own}.extensions.KHR_materials_pbrSpecularGlossiness.specularGlossinessTexture");
        let least = self.unit(least, &place);
        let Some(gloss) = self.texture(Some(info), Encoding::Srgb, &place)? else {
            return Ok(ScalarParam::constant(least));
        };
        let colors = [Vec3::ONE, Vec3::splat(least)].map(ColorParam::constant);
        let amount = ScalarParam { factor: 1.0, texture: Some((gloss, 3)) };
        let mix = self.push_texture(Texture::Mix { colors, amount });
        Ok(ScalarParam { factor: 1.0, texture: Some((mix, 0)) })
    }

    /// Adds the KHR extensions to `base`.
    fn extend(
        &mut self,
        base: MetalRough,
        source: &schema::Material,
        own: &str,
    ) -> Result<MetalRough, SceneError> {
        let at = |name: &str| format!("{own}.extensions.KHR_materials_{name}");
        let schema::MaterialExtensions {
            transmission,
            diffuse_transmission: through,
            iridescence,
            ior,
            specular,
            clearcoat,
            anisotropy,
            sheen,
            ..
        } = &source.extensions;
        let color_place = at("specular.specularColorTexture");
        let coat_normal = clearcoat.clearcoat_normal_texture.as_ref();
        Ok(MetalRough {
            ior: self.ior(ior.ior, &at("ior.ior"))?,
            specular: self.scalar(
                (specular.specular_factor, &at("specular.specularFactor")),
                (specular.specular_texture.as_ref(), &at("specular.specularTexture")),
                3,
            )?,
            specular_color: ColorParam {
                factor: self.positive(specular.specular_color_factor, &at("specular.specularColorFactor"))?,
                texture: self.texture(
                    specular.specular_color_texture.as_ref(),
                    Encoding::Srgb,
                    &color_place,
                )?,
            },
            transmission: self.scalar(
                (transmission.transmission_factor, &at("transmission.transmissionFactor")),
                (transmission.transmission_texture.as_ref(), &at("transmission.transmissionTexture")),
                0,
            )?,
            diffuse_transmission: self.scalar(
                (through.diffuse_transmission_factor, &at("diffuse_transmission.diffuseTransmissionFactor")),
                (
                    through.diffuse_transmission_texture.as_ref(),
                    &at("diffuse_transmission.diffuseTransmissionTexture"),
                ),
                3,
            )?,
            diffuse_transmission_color: ColorParam {
                factor: self.unit_color(
                    through.diffuse_transmission_color_factor,
                    &at("diffuse_transmission.diffuseTransmissionColorFactor"),
                ),
                texture: self.texture(
                    through.diffuse_transmission_color_texture.as_ref(),
                    Encoding::Srgb,
                    &at("diffuse_transmission.diffuseTransmissionColorTexture"),
                )?,
            },
            film: self.film(iridescence, &at("iridescence"))?,
            clearcoat: self.scalar(
                (clearcoat.clearcoat_factor, &at("clearcoat.clearcoatFactor")),
                (clearcoat.clearcoat_texture.as_ref(), &at("clearcoat.clearcoatTexture")),
                0,
            )?,
            clearcoat_roughness: self.scalar(
                (clearcoat.clearcoat_roughness_factor, &at("clearcoat.clearcoatRoughnessFactor")),
                (clearcoat.clearcoat_roughness_texture.as_ref(), &at("clearcoat.clearcoatRoughnessTexture")),
                1,
            )?,
            clearcoat_normal: self.normal_map(coat_normal, &at("clearcoat.clearcoatNormalTexture"))?,
            anisotropy: self.anisotropy(anisotropy, &at("anisotropy"))?,
            sheen_color: ColorParam {
                factor: self.unit_color(sheen.sheen_color_factor, &at("sheen.sheenColorFactor")),
                texture: self.texture(
                    sheen.sheen_color_texture.as_ref(),
                    Encoding::Srgb,
                    &at("sheen.sheenColorTexture"),
                )?,
            },
            sheen_roughness: self.scalar(
                (sheen.sheen_roughness_factor, &at("sheen.sheenRoughnessFactor")),
                (sheen.sheen_roughness_texture.as_ref(), &at("sheen.sheenRoughnessTexture")),
                3,
            )?,
            ..base
        })
    }

    fn anisotropy(&mut self, source: &schema::Anisotropy, place: &str) -> Result<Anisotropy, SceneError> {
        let rotation = source.anisotropy_rotation;
        if !rotation.is_finite() {
            let place = format!("{place}.anisotropyRotation");
            return Err(self.document.invalid(&place, "expected a finite angle"));
        }
        let texture = source.anisotropy_texture.as_ref();
        Ok(Anisotropy {
            strength: self.unit(source.anisotropy_strength, &format!("{place}.anisotropyStrength")),
            rotation,
            texture: self.texture(texture, Encoding::Linear, &format!("{place}.anisotropyTexture"))?,
        })
    }

    fn film(&mut self, source: &schema::Iridescence, place: &str) -> Result<ThinFilm, SceneError> {
        let at = |name: &str| format!("{place}.iridescence{name}");
        let ior = source.iridescence_ior;
        if !(ior.is_finite() && ior >= 1.0) {
            return Err(self
                .document
                .invalid(&at("Ior"), format!("is {ior}, expected a number of at least 1")));
        }
        let [least, most] = [
            (source.iridescence_thickness_minimum, "ThicknessMinimum"),
            (source.iridescence_thickness_maximum, "ThicknessMaximum"),
        ]
        .map(|(value, name)| self.positive([value; 3], &at(name)));
        Ok(ThinFilm {
            strength: self.scalar(
                (source.iridescence_factor, &at("Factor")),
                (source.iridescence_texture.as_ref(), &at("Texture")),
                0,
            )?,
            ior,
            thickness: [least?.x, most?.x],
            place: self.scalar(
                (1.0, ""),
                (source.iridescence_thickness_texture.as_ref(), &at("ThicknessTexture")),
                1,
            )?,
        })
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

    fn scalar(
        &mut self,
        (factor, factor_place): (f32, &str),
        (texture, texture_place): (Option<&TextureInfo>, &str),
        channel: u8,
    ) -> Result<ScalarParam, SceneError> {
        let texture = self.texture(texture, Encoding::Linear, texture_place)?;
        let factor = self.unit(factor, factor_place);
        Ok(ScalarParam { factor, texture: texture.map(|texture| (texture, channel)) })
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

    fn ior(&self, ior: f32, place: &str) -> Result<f32, SceneError> {
        // The extension gives 0 the meaning of a Fresnel term of 1 everywhere, which a huge index has too.
        const ALWAYS_REFLECTS: f32 = 1e6;
        match ior {
            0.0 => Ok(ALWAYS_REFLECTS),
            ior if (1.0..=ALWAYS_REFLECTS).contains(&ior) => Ok(ior),
            _ => Err(self.document.invalid(place, format!("is {ior}, expected 0 or at least 1"))),
        }
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

/// Largest asymmetry of scattering: light that goes straight on, or straight back, has no phase function.
const MAX_ANISOTROPY: f32 = 0.99;

/// Albedo of single scattering of asymmetry `g` in a medium of which a thick piece shows the albedo `seen` (van de Hulst's
/// similarity relation, fitted by Kulla and Conty 2017, "Revisiting Physically Based Shading at Imageworks").
fn single_scattering(seen: f32, g: f32) -> f32 {
    // The fit is not quite 0 there.
    if seen == 0.0 {
        return 0.0;
    }
    let s = 4.097_12 + 4.208_63 * seen - (9.592_17 + 41.6808 * seen + 17.7126 * seen * seen).sqrt();
    ((1.0 - s * s) / (1.0 - g * s * s)).clamp(0.0, 1.0)
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
