//! Materials. What they scatter comes from `Material`; their light and their coverage come from the shapes that wear
//! them, so that one of pbrt's materials can become several of ours, and equal ones become one.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

use glam::Vec3;
use quietus_trace::desc::{
    self, Coat, ColorParam, Glass, Hair, HairColor, MaterialId, Metal, Roughness, RoughnessScale,
    ScalarParam, Surface, TextureId, ThinFilm,
};

use super::draft::{Alpha, AreaLight, Draft, MaterialRef};
use super::fault::{Context, Fault, Place, Result, unknown};
use super::images::Use;
use super::params::{Kind, Params};
use super::spectrum::{Spectrum, metal_index};
use super::texture::Textures;
use crate::image::Encoding;

/// Every type of material.
const KINDS: [&str; 13] = [
    "coatedconductor",
    "coateddiffuse",
    "conductor",
    "dielectric",
    "diffuse",
    "diffusetransmission",
    "hair",
    "interface",
    "measured",
    "mix",
    "none",
    "subsurface",
    "thindielectric",
];

/// The part of a material that is the same for all shapes.
#[derive(Clone, Debug)]
struct Base {
    name: String,
    surface: Surface,
    normal_map: Option<(TextureId, f32)>,
    bump: Option<ScalarParam>,
    /// See [`Materials::is_textured`].
    textured: bool,
}

/// What a shape adds to its material.
#[derive(Clone, Debug)]
pub(super) struct Worn<'a> {
    pub light: Option<&'a AreaLight>,
    /// The area that its power is spread over, times the mean luminance of the light's picture if it has one.
    pub area: f32,
    pub alpha: Option<&'a Alpha>,
}

/// The materials of a scene.
#[derive(Debug)]
pub(super) struct Materials<'a, 'c> {
    pub(super) context: &'c Context,
    draft: &'a Draft,
    pub textures: Textures<'c>,
    pub list: Vec<desc::Material>,
    textured: Vec<bool>,
    bases: HashMap<usize, Base>,
    /// By all they are but their names.
    known: HashMap<String, MaterialId>,
    /// What was measured, by its file.
    measured: HashMap<PathBuf, Arc<desc::Measured>>,
    /// Materials being made, to find mixes that lead back to themselves.
    open: Vec<usize>,
}

impl<'a, 'c> Materials<'a, 'c> {
    pub(super) fn new(context: &'c Context, draft: &'a Draft, textures: Textures<'c>) -> Self {
        let (bases, known) = (HashMap::new(), HashMap::new());
        Self {
            context,
            draft,
            textures,
            list: Vec::new(),
            textured: Vec::new(),
            bases,
            known,
            measured: HashMap::new(),
            open: Vec::new(),
        }
    }

    /// The number of a material in the draft.
    pub(super) fn resolve(&self, material: &MaterialRef) -> Result<usize> {
        match material {
            MaterialRef::Index(index) => Ok(*index),
            MaterialRef::Named(name, place) => self.named(name, *place),
        }
    }

    fn named(&self, name: &str, place: Place) -> Result<usize> {
        self.draft.named_materials.get(name).copied().ok_or_else(|| {
            let known: Vec<&str> = self.draft.named_materials.keys().map(|name| &**name).collect();
            Fault::invalid(place, unknown("material", name, &known))
        })
    }

    /// Reads all materials, so that their pictures can be loaded and their errors are found even where nothing wears
    /// them.
    pub(super) fn make_all(&mut self) -> Result<()> {
        (0..self.draft.materials.len()).try_for_each(|index| self.base(index).map(|_| ()))
    }

    /// Whether a material looks different from place to place, or depends on the direction in which u grows.
    pub(super) fn is_textured(&self, id: MaterialId) -> bool {
        self.textured[id.0 as usize]
    }

    /// Whether a material is but a border between media.
    pub(super) fn is_interface(&self, index: usize) -> bool {
        matches!(&*self.draft.materials[index].kind, "" | "none" | "interface")
    }

    /// Whether a material bends normals by a picture of them.
    pub(super) fn has_normal_map(&self, id: MaterialId) -> bool {
        self.list[id.0 as usize].normal_map.is_some()
    }

    /// Material `index` as a shape wears it.
    pub(super) fn worn(&mut self, index: usize, worn: &Worn<'_>) -> Result<MaterialId> {
        let uses = self.textures.uses();
        let Base { name, surface, normal_map, bump, textured } = self.base(index)?;
        let emission = match worn.light {
            Some(light) => self.emission(light, worn.area),
            None => ColorParam::constant(Vec3::ZERO),
        };
        let alpha = match worn.alpha {
            None => desc::Alpha::Opaque,
            Some(Alpha::Constant(0.0)) if worn.light.is_some() => desc::Alpha::Unseen,
            Some(Alpha::Constant(value)) => desc::Alpha::Blend { value: ScalarParam::constant(*value) },
            Some(Alpha::Texture(name, place)) => {
                desc::Alpha::Blend { value: self.textures.number_texture(name, *place)? }
            }
        };
        let textured = textured || self.textures.uses() > uses || emission.texture.is_some();
        let material = desc::Material {
            name,
            surface,
            emission,
            emission_two_sided: worn.light.is_some_and(|light| light.two_sided),
            normal_map,
            bump,
            alpha,
        };
        Ok(self.push(material, textured))
    }

    /// Adds a material, unless there is its equal.
    fn push(&mut self, material: desc::Material, textured: bool) -> MaterialId {
        let desc::Material { surface, emission, emission_two_sided, normal_map, bump, alpha, .. } = &material;
        // All of these print their numbers with all their digits.
        let surface_key = match surface {
            // Read once from each file: the place tells it from others.
            Surface::Measured(m) => format!("measured {:p}", Arc::as_ptr(m)),
            surface => format!("{surface:?}"),
        };
        let key =
            format!("{surface_key} {emission:?} {emission_two_sided} {normal_map:?} {bump:?} {alpha:?}");
        *self.known.entry(key).or_insert_with(|| {
            self.list.push(material);
            self.textured.push(textured);
            MaterialId(self.list.len() as u32 - 1)
        })
    }

    /// Radiance of an area light on a shape of this area.
    fn emission(&mut self, light: &AreaLight, area: f32) -> ColorParam {
        let texture = light.image.map(|image| self.textures.plain_image(image));
        let factor = match light.power {
            Some(power) if area > 0.0 => {
                let sides = if light.two_sided { 2.0 } else { 1.0 };
                light.radiance * power / (sides * area * std::f32::consts::PI)
            }
            _ => light.radiance,
        };
        ColorParam { factor, texture }
    }

    fn base(&mut self, index: usize) -> Result<Base> {
        if let Some(base) = self.bases.get(&index) {
            return Ok(base.clone());
        }
        let draft = self.draft;
        let entity = &draft.materials[index];
        let params = &entity.params;
        if self.open.contains(&index) {
            return Err(Fault::invalid(params.place, format!("{} is mixed from itself", params.owner)));
        }
        self.open.push(index);
        let uses = self.textures.uses();
        let surface = self.surface(&entity.kind, params)?;
        self.open.pop();
        let normal_map = self.normal_map(params)?;
        let bump = self.textures.number_option(params, "displacement")?;
        let textured = self.textures.uses() > uses || normal_map.is_some() || bump.is_some();
        let base = Base { name: params.owner.clone(), surface, normal_map, bump, textured };
        params.ignore(&["type"]);
        params.finish()?;
        self.bases.insert(index, base.clone());
        Ok(base)
    }

    fn normal_map(&mut self, params: &Params) -> Result<Option<(TextureId, f32)>> {
        let Some(name) = params.string("normalmap")? else { return Ok(None) };
        let path = self.context.resolve(name);
        let wanted = Use { encoding: Encoding::Linear, ..Use::COLOR };
        let place = self.context.full_words(params.place_of("normalmap"));
        let image = self.textures.images.ask(path, wanted, &place);
        Ok(Some((self.textures.plain_image(image), 1.0)))
    }

    fn surface(&mut self, kind: &str, params: &Params) -> Result<Surface> {
        let textures = &self.textures;
        match kind {
            "" | "none" | "interface" => Ok(Surface::Interface),
            "diffuse" => {
                Ok(Surface::Diffuse { reflectance: textures.color(params, "reflectance", HALF, 1.0)? })
            }
            "coateddiffuse" => Ok(Surface::CoatedDiffuse {
                reflectance: textures.color(params, "reflectance", HALF, 1.0)?,
                coat: self.coat(params, "eta", ["roughness", "uroughness", "vroughness"])?,
            }),
            "conductor" => Ok(Surface::Conductor {
                metal: self.metal(params, "eta", "k")?,
                roughness: self.roughness(params, ["roughness", "uroughness", "vroughness"])?,
            }),
            "coatedconductor" => Ok(Surface::CoatedConductor {
                metal: self.metal(params, "conductor.eta", "conductor.k")?,
                roughness: self.roughness(
                    params,
                    ["conductor.roughness", "conductor.uroughness", "conductor.vroughness"],
                )?,
                coat: self.coat(
                    params,
                    "interface.eta",
                    ["interface.roughness", "interface.uroughness", "interface.vroughness"],
                )?,
            }),
            "dielectric" => self.dielectric(params),
            "thindielectric" => Ok(Surface::ThinDielectric { ior: self.ior(params, "eta", 1.5)? }),
            "diffusetransmission" => self.diffuse_transmission(params),
            "hair" => self.hair(params),
            "mix" => self.mix(params),
            "subsurface" => self.subsurface(params),
            "measured" => self.measured(params),
            _ => Err(Fault::invalid(params.place, unknown("material", kind, &KINDS))),
        }
    }

    fn dielectric(&self, params: &Params) -> Result<Surface> {
        let ior = self.ior(params, "eta", 1.5)?;
        let roughness = self.roughness(params, ["roughness", "uroughness", "vroughness"])?;
        let tint = ColorParam::constant(Vec3::ONE);
        let spectrum = match params.find("eta", &[Kind::Float, Kind::Spectrum, Kind::Rgb])? {
            Some(param) if param.kind != Kind::Float => Spectrum::read(param, self.context)?,
            _ => return Ok(Surface::Dielectric { ior, roughness, tint }),
        };
        if spectrum.is_flat() {
            return Ok(Surface::Dielectric { ior, roughness, tint });
        }
        let ior = spectrum.index();
        if ior.min_element() > 0.0 {
            let film = ThinFilm::NONE;
            return Ok(Surface::Glass(Box::new(Glass { ior, roughness, tint, film, keeps_light: false })));
        }
        let message =
            format!("\"eta\" of {} is {ior} for red, green and blue, expected above 0", params.owner);
        Err(Fault::invalid(params.place_of("eta"), message))
    }

    /// One index of refraction, for all wavelengths: of a spectrum its mean, where light is not split visibly.
    pub(super) fn ior(&self, params: &Params, name: &'static str, default: f32) -> Result<f32> {
        let Some(param) = params.find(name, &[Kind::Float, Kind::Spectrum, Kind::Rgb])? else {
            return Ok(default);
        };
        let ior = if param.kind == Kind::Float {
            params.float(name, default)?
        } else {
            Spectrum::read(param, self.context)?.mean()
        };
        if ior > 0.0 {
            return Ok(ior);
        }
        Err(Fault::invalid(param.place, format!("\"{name}\" of {} is {ior}, expected above 0", params.owner)))
    }

    /// Roughness from the parameters for both axes, and for each.
    pub(super) fn roughness(&self, params: &Params, [both, u, v]: [&'static str; 3]) -> Result<Roughness> {
        let both = self.textures.number(params, both, 0.0)?;
        let remap = params.boolean("remaproughness", true)?;
        let u = self.textures.number_option(params, u)?.unwrap_or(both);
        let v = self.textures.number_option(params, v)?.unwrap_or(both);
        if u != v {
            self.textures.count_use();
        }
        Ok(Roughness { u, v, scale: if remap { RoughnessScale::SquareRoot } else { RoughnessScale::Alpha } })
    }

    fn metal(&self, params: &Params, eta: &'static str, k: &'static str) -> Result<Metal> {
        if params.has("reflectance") {
            for name in [eta, k] {
                if params.has(name) {
                    let message = format!(
                        "{} has both \"reflectance\" and \"{name}\", expected one of them",
                        params.owner
                    );
                    return Err(Fault::invalid(params.place_of(name), message));
                }
            }
            return Ok(Metal::Reflectance(self.textures.color(params, "reflectance", HALF, 1.0)?));
        }
        let part = |name: &'static str, default: &str| -> Result<Spectrum> {
            let default = || Spectrum::known(default);
            if matches!(params.find(name, &METAL_KINDS)?, Some(param) if param.kind == Kind::Texture) {
                let message = format!("\"texture {name}\" is not drawn; copper stands in");
                self.context.warn(params.place_of(name), message);
                return Ok(default());
            }
            Ok(params.spectrum(name, self.context)?.unwrap_or_else(default))
        };
        let [eta, k] = metal_index(&part(eta, "metal-Cu-eta")?, &part(k, "metal-Cu-k")?);
        Ok(Metal::Index { eta, k })
    }

    fn coat(&self, params: &Params, eta: &'static str, roughness: [&'static str; 3]) -> Result<Coat> {
        let max_depth = params.integer_from("maxdepth", 1)?.unwrap_or(10);
        // How often one look-up of the coat's light is estimated: ours is drawn once per path.
        params.ignore(&["nsamples"]);
        Ok(Coat {
            ior: self.ior(params, eta, 1.5)?,
            roughness: self.roughness(params, roughness)?,
            thickness: self.textures.number(params, "thickness", 0.01)?,
            albedo: self.textures.color(params, "albedo", Vec3::ZERO, 1.0)?,
            g: self.textures.number(params, "g", 0.0)?,
            max_depth,
        })
    }

    fn diffuse_transmission(&self, params: &Params) -> Result<Surface> {
        let scale = params.float_where("scale", 1.0, |scale| scale >= 0.0, "at least 0")?;
        let color = |name| -> Result<ColorParam> {
            let color = self.textures.color(params, name, Vec3::splat(0.25), 1.0)?;
            Ok(ColorParam { factor: color.factor * scale, ..color })
        };
        Ok(Surface::DiffuseTransmission {
            reflectance: color("reflectance")?,
            transmittance: color("transmittance")?,
        })
    }

    fn hair(&self, params: &Params) -> Result<Surface> {
        let textures = &self.textures;
        let absorption = textures.color_option(params, "sigma_a", f32::INFINITY)?;
        let reflectance = match textures.color_option(params, "reflectance", 1.0)? {
            None => textures.color_option(params, "color", 1.0)?,
            given => given,
        };
        let pigments =
            [textures.number_option(params, "eumelanin")?, textures.number_option(params, "pheomelanin")?];
        let nothing = ScalarParam::constant(0.0);
        let color = match (absorption, reflectance, pigments) {
            (Some(color), _, _) => HairColor::Absorption(color),
            (None, Some(color), _) => HairColor::Reflectance(color),
            // pbrt's default: brown.
            (None, None, [None, None]) => {
                HairColor::Pigments { eumelanin: ScalarParam::constant(1.3), pheomelanin: nothing }
            }
            (None, None, [eumelanin, pheomelanin]) => HairColor::Pigments {
                eumelanin: eumelanin.unwrap_or(nothing),
                pheomelanin: pheomelanin.unwrap_or(nothing),
            },
        };
        Ok(Surface::Hair(Box::new(Hair {
            color,
            ior: self.even(params, "eta", 1.55)?,
            beta_m: textures.number(params, "beta_m", 0.3)?,
            beta_n: textures.number(params, "beta_n", 0.3)?,
            alpha: self.even(params, "alpha", 2.0)?.to_radians(),
        })))
    }

    /// A number that is the same all over a surface.
    fn even(&self, params: &Params, name: &'static str, default: f32) -> Result<f32> {
        let number = self.textures.number(params, name, default)?;
        if number.texture.is_none() {
            return Ok(number.factor);
        }
        let message = format!("\"texture {name}\" of {} is not drawn; {default} stands in", params.owner);
        self.context.warn(params.place_of(name), message);
        Ok(default)
    }

    fn measured(&mut self, params: &Params) -> Result<Surface> {
        let Some(name) = params.string("filename")? else {
            return Err(Fault::invalid(params.place, format!("{} has no \"string filename\"", params.owner)));
        };
        let path = self.context.resolve(name);
        if let Some(known) = self.measured.get(&path) {
            return Ok(Surface::Measured(Arc::clone(known)));
        }
        let read = || crate::read_measured_bytes(&path, &crate::file::read(&path)?);
        let measured = read().map_err(|error| self.context.blame(params.place_of("filename"), error))?;
        let measured = Arc::new(measured);
        self.measured.insert(path, Arc::clone(&measured));
        Ok(Surface::Measured(measured))
    }

    fn mix(&mut self, params: &Params) -> Result<Surface> {
        let place = params.place_of("materials");
        let [first, second] = params.strings("materials")? else {
            return Err(Fault::invalid(place, format!("{} expects 2 names as \"materials\"", params.owner)));
        };
        let amount = self.textures.number(params, "amount", 0.5)?;
        let indices = [self.named(first, place)?, self.named(second, place)?];
        let mut materials = [MaterialId(0); 2];
        for (material, index) in materials.iter_mut().zip(indices) {
            *material = self.worn(index, &Worn { light: None, area: 0.0, alpha: None })?;
        }
        Ok(Surface::Mix { materials, amount })
    }
}

/// pbrt's usual reflectance.
const HALF: Vec3 = Vec3::splat(0.5);

/// What indices of metals may be given as.
const METAL_KINDS: [Kind; 4] = [Kind::Rgb, Kind::Spectrum, Kind::Blackbody, Kind::Texture];
