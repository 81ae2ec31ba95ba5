//! Things with an inside (KHR_materials_volume and what goes with it): glass that refracts, and the media in it.

use glam::Vec3;
use quietus_trace::desc::{
    Alpha, ColorParam, Glass, Material, MaterialId, Medium, MediumId, MetalRough, Roughness, ScalarParam,
    Surface, Texture,
};

use super::Materials;
use crate::error::SceneError;
use crate::gltf::schema;

/// Largest asymmetry of scattering: light that goes straight on, or straight back, has no phase function.
const MAX_ANISOTROPY: f32 = 0.99;

impl Materials<'_, '_> {
    /// KHR_materials_dispersion: 20 over Abbe's number.
    pub(super) fn dispersion(&self, value: f32, own: &str) -> Result<f32, SceneError> {
        let place = format!("{own}.extensions.KHR_materials_dispersion.dispersion");
        Ok(self.positive([value; 3], &place)?.x)
    }

    /// A thing with an inside (KHR_materials_volume): where light is transmitted it refracts.
    pub(super) fn solid(&mut self, base: Material, surface: MetalRough, dispersion: f32) -> MaterialId {
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
    pub(super) fn interior(
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
}

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
