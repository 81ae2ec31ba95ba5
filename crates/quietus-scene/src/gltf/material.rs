//! Materials and the textures they use.

use std::collections::HashMap;

use glam::{Affine2, Mat2, Vec2, Vec3};
use quietus_trace::desc::{
    Alpha, ColorParam, ImageTexture, Mapping, Material, MaterialId, MetalRough, ScalarParam, Surface,
    TexelFilter, Texture, TextureId, Wrap,
};

use super::document::Document;
use super::image::{Encoding, ImageCache};
use super::schema::{self, TextureInfo};
use crate::error::SceneError;

/// Texture, encoding, set of coordinates, and the transform's bits.
type TextureKey = (usize, Encoding, u8, [u32; 6]);

/// Collects the materials that are used, and only those.
pub(super) struct Materials<'d, 'f> {
    document: &'d Document<'f>,
    pub materials: Vec<Material>,
    pub textures: Vec<Texture>,
    ids: HashMap<Option<usize>, MaterialId>,
    texture_ids: HashMap<TextureKey, TextureId>,
    images: ImageCache,
}

impl<'d, 'f> Materials<'d, 'f> {
    pub(super) fn new(document: &'d Document<'f>) -> Self {
        Self {
            document,
            materials: Vec::new(),
            textures: Vec::new(),
            ids: HashMap::new(),
            texture_ids: HashMap::new(),
            images: ImageCache::default(),
        }
    }

    /// Material `index`, referred to from `place`; glTF's default material where there is none.
    pub(super) fn get(&mut self, index: Option<usize>, place: &str) -> Result<MaterialId, SceneError> {
        if let Some(&id) = self.ids.get(&index) {
            return Ok(id);
        }
        let material = match index {
            Some(index) => {
                let source = self.document.get(&self.document.root.materials, index, "materials", place)?;
                self.convert(source, index)?
            }
            None => default_material(),
        };
        let id = MaterialId(self.materials.len() as u32);
        self.materials.push(material);
        self.ids.insert(index, id);
        Ok(id)
    }

    fn convert(&mut self, source: &schema::Material, index: usize) -> Result<Material, SceneError> {
        let own = format!("materials[{index}]");
        let metal_rough = self.metal_rough(source, &own)?;
        let alpha = self.alpha(source, &metal_rough, &own)?;
        let emission =
            if metal_rough.unlit { ColorParam::constant(Vec3::ZERO) } else { self.emission(source, &own)? };
        Ok(Material {
            name: if source.name.is_empty() { own.clone() } else { source.name.clone() },
            surface: Surface::MetalRough(Box::new(metal_rough)),
            emission,
            emission_two_sided: source.double_sided,
            normal_map: self.normal_map(source.normal_texture.as_ref(), &format!("{own}.normalTexture"))?,
            bump: None,
            alpha,
        })
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
            roughness: ScalarParam {
                factor: self.unit(pbr.roughness_factor, &at("roughnessFactor")),
                texture: metallic_roughness.map(|texture| (texture, 1)),
            },
            unlit: source.extensions.unlit.is_some(),
            ..MetalRough::default()
        };
        self.extend(base, source, own)
    }

    /// Adds the KHR extensions to `base`.
    fn extend(
        &mut self,
        base: MetalRough,
        source: &schema::Material,
        own: &str,
    ) -> Result<MetalRough, SceneError> {
        let at = |name: &str| format!("{own}.extensions.KHR_materials_{name}");
        let schema::MaterialExtensions { transmission, ior, specular, clearcoat, .. } = &source.extensions;
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
            ..base
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

    /// The texture that `info` at `place` refers to; none, with a warning, where it cannot be shown.
    fn texture(
        &mut self,
        info: Option<&TextureInfo>,
        encoding: Encoding,
        place: &str,
    ) -> Result<Option<TextureId>, SceneError> {
        let Some(info) = info else { return Ok(None) };
        let document = self.document;
        let source =
            document.get(&document.root.textures, info.index, "textures", &format!("{place}.index"))?;
        let own = format!("textures[{}]", info.index);
        let Some(image) = source.source else {
            document.warn(&own, "has no PNG or JPEG source: materials are drawn without it");
            return Ok(None);
        };
        let transform = info.extensions.transform.as_ref();
        let uv_set = transform.and_then(|transform| transform.tex_coord).unwrap_or(info.tex_coord);
        if uv_set > 1 {
            let message = format!("uses TEXCOORD_{uv_set}, but only 0 and 1 are supported: it is left out");
            document.warn(place, message);
            return Ok(None);
        }
        let matrix = transform.map_or(Affine2::IDENTITY, affine);
        if !matrix.is_finite() {
            let place = format!("{place}.extensions.KHR_texture_transform");
            return Err(document.invalid(&place, "expected finite numbers"));
        }
        let key = (info.index, encoding, uv_set as u8, matrix.to_cols_array().map(f32::to_bits));
        if let Some(&id) = self.texture_ids.get(&key) {
            return Ok(Some(id));
        }
        let image = self.images.get(document, image, encoding, &format!("{own}.source"))?;
        let (wrap, filter) = sampler(document, source.sampler, &own)?;
        let id = TextureId(self.textures.len() as u32);
        let mapping = Mapping::Uv { set: uv_set as u8, transform: matrix };
        self.textures.push(Texture::Image(ImageTexture { image, wrap, filter, mapping, invert: false }));
        self.texture_ids.insert(key, id);
        Ok(Some(id))
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

/// The material of primitives without one.
fn default_material() -> Material {
    Material {
        name: "default".to_owned(),
        surface: Surface::MetalRough(Box::default()),
        emission: ColorParam::constant(Vec3::ZERO),
        emission_two_sided: false,
        normal_map: None,
        bump: None,
        alpha: Alpha::Opaque,
    }
}

/// Translation after rotation after scale, as KHR_texture_transform says; the rotation is counter-clockwise as
/// seen, with v pointing down.
fn affine(transform: &schema::TextureTransform) -> Affine2 {
    let rotation = Mat2::from_angle(-transform.rotation);
    let scale = Mat2::from_diagonal(Vec2::from_array(transform.scale));
    Affine2::from_mat2_translation(rotation * scale, Vec2::from_array(transform.offset))
}

fn sampler(
    document: &Document<'_>,
    index: Option<usize>,
    place: &str,
) -> Result<([Wrap; 2], TexelFilter), SceneError> {
    let Some(index) = index else { return Ok(Default::default()) };
    let sampler = document.get(&document.root.samplers, index, "samplers", &format!("{place}.sampler"))?;
    let wrap = |code: Option<u32>, name: &str| match code {
        None | Some(10497) => Ok(Wrap::Repeat),
        Some(33071) => Ok(Wrap::Clamp),
        Some(33648) => Ok(Wrap::Mirror),
        Some(code) => {
            let message = format!("is {code}, expected 10497, 33071 or 33648");
            Err(document.invalid(&format!("samplers[{index}].{name}"), message))
        }
    };
    let filter = match sampler.mag_filter {
        None | Some(9729) => TexelFilter::Linear,
        Some(9728) => TexelFilter::Nearest,
        Some(code) => {
            let message = format!("is {code}, expected 9728 or 9729");
            return Err(document.invalid(&format!("samplers[{index}].magFilter"), message));
        }
    };
    Ok(([wrap(sampler.wrap_s, "wrapS")?, wrap(sampler.wrap_t, "wrapT")?], filter))
}
