//! The surface of a material: metalness, roughness, and the layers that extensions add.

use glam::Vec3;
use quietus_trace::desc::{Anisotropy, ColorParam, MetalRough, ScalarParam, Texture, ThinFilm};

use super::Materials;
use crate::error::SceneError;
use crate::gltf::image::Encoding;
use crate::gltf::schema::{self, TextureInfo};

impl Materials<'_, '_> {
    /// What `source`, whose JSON is at `own`, says of the surface.
    pub(super) fn metal_rough(
        &mut self,
        source: &schema::Material,
        own: &str,
    ) -> Result<MetalRough, SceneError> {
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
            base_color: self.color(&at("baseColor"), [r, g, b], &pbr.base_color_texture)?,
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
        let own = format!("{own}.extensions.KHR_materials");
        let extensions = &source.extensions;
        let base = MetalRough { ior: self.ior(extensions.ior.ior, &format!("{own}_ior.ior"))?, ..base };
        let base = self.specular(base, &extensions.specular, &format!("{own}_specular.specular"))?;
        let base = self.transmission(base, extensions, &own)?;
        let film = self.film(&extensions.iridescence, &format!("{own}_iridescence.iridescence"))?;
        let base = self.coat(base, &extensions.clearcoat, &format!("{own}_clearcoat.clearcoat"))?;
        let anisotropy = self.anisotropy(&extensions.anisotropy, &format!("{own}_anisotropy.anisotropy"))?;
        let base = self.sheen(base, &extensions.sheen, &format!("{own}_sheen.sheen"))?;
        Ok(MetalRough { film, anisotropy, ..base })
    }

    /// KHR_materials_specular. Here and below `at` is where the extension's properties begin, names included.
    fn specular(
        &mut self,
        base: MetalRough,
        source: &schema::Specular,
        at: &str,
    ) -> Result<MetalRough, SceneError> {
        let schema::Specular { specular_factor, specular_texture, .. } = source;
        let specular = self.scalar(at, *specular_factor, specular_texture, 3)?;
        // May be more than 1.
        let factor = self.positive(source.specular_color_factor, &format!("{at}ColorFactor"))?;
        let texture = source.specular_color_texture.as_ref();
        let texture = self.texture(texture, Encoding::Srgb, &format!("{at}ColorTexture"))?;
        Ok(MetalRough { specular, specular_color: ColorParam { factor, texture }, ..base })
    }

    /// KHR_materials_transmission and KHR_materials_diffuse_transmission.
    fn transmission(
        &mut self,
        base: MetalRough,
        source: &schema::MaterialExtensions,
        own: &str,
    ) -> Result<MetalRough, SceneError> {
        let schema::Transmission { transmission_factor, transmission_texture } = &source.transmission;
        let at = format!("{own}_transmission.transmission");
        let transmission = self.scalar(&at, *transmission_factor, transmission_texture, 0)?;
        let schema::DiffuseTransmission {
            diffuse_transmission_factor,
            diffuse_transmission_texture,
            diffuse_transmission_color_factor,
            diffuse_transmission_color_texture,
        } = &source.diffuse_transmission;
        let at = format!("{own}_diffuse_transmission.diffuseTransmission");
        Ok(MetalRough {
            transmission,
            diffuse_transmission: self.scalar(
                &at,
                *diffuse_transmission_factor,
                diffuse_transmission_texture,
                3,
            )?,
            diffuse_transmission_color: self.color(
                &format!("{at}Color"),
                *diffuse_transmission_color_factor,
                diffuse_transmission_color_texture,
            )?,
            ..base
        })
    }

    /// KHR_materials_clearcoat.
    fn coat(
        &mut self,
        base: MetalRough,
        source: &schema::Clearcoat,
        at: &str,
    ) -> Result<MetalRough, SceneError> {
        let schema::Clearcoat {
            clearcoat_factor,
            clearcoat_texture,
            clearcoat_roughness_factor: roughness,
            clearcoat_roughness_texture: roughness_texture,
            clearcoat_normal_texture: normal,
        } = source;
        Ok(MetalRough {
            clearcoat: self.scalar(at, *clearcoat_factor, clearcoat_texture, 0)?,
            clearcoat_roughness: self.scalar(&format!("{at}Roughness"), *roughness, roughness_texture, 1)?,
            clearcoat_normal: self.normal_map(normal.as_ref(), &format!("{at}NormalTexture"))?,
            ..base
        })
    }

    /// KHR_materials_sheen.
    fn sheen(
        &mut self,
        base: MetalRough,
        source: &schema::Sheen,
        at: &str,
    ) -> Result<MetalRough, SceneError> {
        let schema::Sheen { sheen_color_factor: color, sheen_color_texture, .. } = source;
        let schema::Sheen { sheen_roughness_factor: roughness, sheen_roughness_texture, .. } = source;
        Ok(MetalRough {
            sheen_color: self.color(&format!("{at}Color"), *color, sheen_color_texture)?,
            sheen_roughness: self.scalar(
                &format!("{at}Roughness"),
                *roughness,
                sheen_roughness_texture,
                3,
            )?,
            ..base
        })
    }

    /// KHR_materials_anisotropy.
    fn anisotropy(&mut self, source: &schema::Anisotropy, at: &str) -> Result<Anisotropy, SceneError> {
        let rotation = source.anisotropy_rotation;
        if !rotation.is_finite() {
            return Err(self.document.invalid(&format!("{at}Rotation"), "expected a finite angle"));
        }
        let texture = source.anisotropy_texture.as_ref();
        Ok(Anisotropy {
            strength: self.unit(source.anisotropy_strength, &format!("{at}Strength")),
            rotation,
            texture: self.texture(texture, Encoding::Linear, &format!("{at}Texture"))?,
        })
    }

    /// KHR_materials_iridescence.
    fn film(&mut self, source: &schema::Iridescence, at: &str) -> Result<ThinFilm, SceneError> {
        let ior = source.iridescence_ior;
        if !(ior.is_finite() && ior >= 1.0) {
            let message = format!("is {ior}, expected a number of at least 1");
            return Err(self.document.invalid(&format!("{at}Ior"), message));
        }
        let thickness = |value: f32, end: &str| self.positive([value; 3], &format!("{at}Thickness{end}"));
        let least = thickness(source.iridescence_thickness_minimum, "Minimum")?.x;
        let most = thickness(source.iridescence_thickness_maximum, "Maximum")?.x;
        let place = &source.iridescence_thickness_texture;
        Ok(ThinFilm {
            strength: self.scalar(at, source.iridescence_factor, &source.iridescence_texture, 0)?,
            ior,
            thickness: [least, most],
            place: self.scalar(&format!("{at}Thickness"), 1.0, place, 1)?,
        })
    }

    /// A share times a channel of a texture, which the file has under `{at}Factor` and `{at}Texture`.
    fn scalar(
        &mut self,
        at: &str,
        factor: f32,
        texture: &Option<TextureInfo>,
        channel: u8,
    ) -> Result<ScalarParam, SceneError> {
        let texture = self.texture(texture.as_ref(), Encoding::Linear, &format!("{at}Texture"))?;
        let factor = self.unit(factor, &format!("{at}Factor"));
        Ok(ScalarParam { factor, texture: texture.map(|texture| (texture, channel)) })
    }

    /// A colour times a texture, likewise.
    fn color(
        &mut self,
        at: &str,
        factor: [f32; 3],
        texture: &Option<TextureInfo>,
    ) -> Result<ColorParam, SceneError> {
        let factor = self.unit_color(factor, &format!("{at}Factor"));
        let texture = self.texture(texture.as_ref(), Encoding::Srgb, &format!("{at}Texture"))?;
        Ok(ColorParam { factor, texture })
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
}
