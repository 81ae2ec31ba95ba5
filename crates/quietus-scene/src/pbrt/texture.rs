//! Textures, and parameters that may be driven by them.
//!
//! Every texture of numbers holds the same number in red, green and blue, so that it can stand where a colour does.

use std::cell::Cell;
use std::collections::HashMap;
use std::sync::Arc;

use glam::{Affine2, Vec3};
use quietus_trace::desc::{
    ColorParam, Image, ImageTexture, Mapping, NoisePattern, ScalarParam, TexelFilter, Texels, Texture,
    TextureId, Wrap,
};
use quietus_trace::texture::{TextureError, TextureTable};

use super::draft::TextureEntity;
use super::fault::{Context, Fault, Place, Result, unknown};
use super::images::{Channels, ImageId, Images, Requests, Use};
use super::mapping::{board_mapping, from_world, mapping, picture_mapping, upwards, wrap};
use super::params::{Kind, Param, Params, Values};
use super::spectrum::{self, Spectrum};
use super::transform::single;
use crate::image::Encoding;

/// Every type of texture.
const KINDS: [&str; 13] = [
    "bilerp",
    "checkerboard",
    "constant",
    "directionmix",
    "dots",
    "fbm",
    "imagemap",
    "marble",
    "mix",
    "ptex",
    "scale",
    "windy",
    "wrinkled",
];

/// The textures of a scene, under their names.
#[derive(Debug)]
pub(super) struct Textures<'c> {
    context: &'c Context,
    /// As the scene gets them, their pictures still missing.
    pub list: Vec<Texture>,
    pub images: Requests,
    /// Which textures wait for which pictures.
    waiting: Vec<(TextureId, ImageId)>,
    numbers: HashMap<Box<str>, ScalarParam>,
    colors: HashMap<Box<str>, ColorParam>,
    missing: Arc<Image>,
    /// Textures of pictures that lie over whole surfaces.
    plain: HashMap<ImageId, TextureId>,
    uses: Cell<u32>,
}

impl<'c> Textures<'c> {
    /// Makes the textures of `entities`, which may use those before them.
    pub(super) fn new(context: &'c Context, images: Requests, entities: &[TextureEntity]) -> Result<Self> {
        let missing =
            Image { name: String::new(), width: 1, height: 1, texels: Texels::Float(vec![[0.0; 4]]) };
        let mut textures = Self {
            context,
            list: Vec::new(),
            images,
            waiting: Vec::new(),
            numbers: HashMap::new(),
            colors: HashMap::new(),
            missing: Arc::new(missing),
            plain: HashMap::new(),
            uses: Cell::new(0),
        };
        for texture in entities {
            if texture.color {
                let color = textures.make_color(texture)?;
                textures.colors.insert(texture.name.clone(), color);
            } else {
                let number = textures.make_number(texture)?;
                textures.numbers.insert(texture.name.clone(), number);
            }
            texture.entity.params.finish()?;
        }
        Ok(textures)
    }

    /// Puts the pictures in their places.
    pub(super) fn finish(self, images: &Images) -> Vec<Texture> {
        fill(self.list, &self.waiting, images)
    }

    /// The textures as they will be, to be looked up before the scene is done.
    pub(super) fn table(&self, images: &Images) -> std::result::Result<TextureTable, TextureError> {
        TextureTable::compile(&fill(self.list.clone(), &self.waiting, images), |_| true)
    }

    fn push(&mut self, texture: Texture) -> TextureId {
        self.list.push(texture);
        TextureId(self.list.len() as u32 - 1)
    }

    /// How often textures have been asked for by their names.
    pub(super) fn uses(&self) -> u32 {
        self.uses.get()
    }

    /// Counts a use, as if a texture had been asked for.
    pub(super) fn count_use(&self) {
        self.uses.set(self.uses.get() + 1);
    }

    fn push_image(&mut self, image: ImageId, texture: ImageTexture) -> TextureId {
        let id = self.push(Texture::Image(texture));
        self.waiting.push((id, image));
        id
    }

    /// A picture over the whole surface, v growing upwards.
    pub(super) fn plain_image(&mut self, image: ImageId) -> TextureId {
        if let Some(&known) = self.plain.get(&image) {
            return known;
        }
        let texture = ImageTexture {
            image: Arc::clone(&self.missing),
            wrap: [Wrap::Repeat; 2],
            filter: TexelFilter::Linear,
            mapping: Mapping::Uv { set: 0, transform: upwards(Affine2::IDENTITY) },
            invert: false,
        };
        let id = self.push_image(image, texture);
        self.plain.insert(image, id);
        id
    }

    /// A number or a texture of numbers.
    pub(super) fn number(&self, params: &Params, name: &'static str, default: f32) -> Result<ScalarParam> {
        Ok(self.number_option(params, name)?.unwrap_or(ScalarParam::constant(default)))
    }

    /// A number or a texture of numbers, if it is given.
    pub(super) fn number_option(&self, params: &Params, name: &'static str) -> Result<Option<ScalarParam>> {
        match params.find(name, &[Kind::Float, Kind::Texture])? {
            None => Ok(None),
            Some(param) if param.kind == Kind::Texture => {
                let texture = texture_name(param)?;
                self.number_texture(texture, param.place).map(Some)
            }
            Some(_) => Ok(params.float_option(name)?.map(ScalarParam::constant)),
        }
    }

    /// The texture of numbers called `name`.
    pub(super) fn number_texture(&self, name: &str, place: Place) -> Result<ScalarParam> {
        self.named(["float texture", "spectrum texture"], &self.numbers, &self.colors, name, place)
    }

    /// A colour or a texture of colours; `most` is the largest component that a colour may have.
    pub(super) fn color(
        &self,
        params: &Params,
        name: &'static str,
        default: Vec3,
        most: f32,
    ) -> Result<ColorParam> {
        Ok(self.color_option(params, name, most)?.unwrap_or(ColorParam::constant(default)))
    }

    /// A colour or a texture of colours, if it is given.
    pub(super) fn color_option(
        &self,
        params: &Params,
        name: &'static str,
        most: f32,
    ) -> Result<Option<ColorParam>> {
        let [rgb, spectrum, blackbody] = spectrum::KINDS;
        let Some(param) = params.find(name, &[rgb, spectrum, blackbody, Kind::Texture])? else {
            return Ok(None);
        };
        if param.kind == Kind::Texture {
            return self.color_texture(texture_name(param)?, param.place).map(Some);
        }
        let spectrum = Spectrum::read(param, self.context)?;
        if let Spectrum::Rgb(_, rgb) = spectrum
            && rgb.max_element() > most
        {
            let message = format!("\"rgb {name}\" has a component above {most}");
            return Err(Fault::invalid(param.place, message));
        }
        Ok(Some(ColorParam::constant(spectrum.factor().min(Vec3::splat(most)))))
    }

    fn color_texture(&self, name: &str, place: Place) -> Result<ColorParam> {
        self.named(["spectrum texture", "float texture"], &self.colors, &self.numbers, name, place)
    }

    /// Of `all` that one called `name`; `others` are of the other of the two `kinds`.
    fn named<T: Copy, U>(
        &self,
        [kind, other]: [&str; 2],
        all: &HashMap<Box<str>, T>,
        others: &HashMap<Box<str>, U>,
        name: &str,
        place: Place,
    ) -> Result<T> {
        self.count_use();
        all.get(name).copied().ok_or_else(|| {
            let known: Vec<&str> = all.keys().map(|name| &**name).collect();
            let hint =
                if others.contains_key(name) { format!(" (there is a {other})") } else { String::new() };
            Fault::invalid(place, unknown(&format!("{kind}{hint}"), name, &known))
        })
    }

    fn make_number(&mut self, texture: &TextureEntity) -> Result<ScalarParam> {
        let params = &texture.entity.params;
        match &*texture.entity.kind {
            "constant" => Ok(ScalarParam::constant(params.float("value", 1.0)?)),
            "scale" => {
                let (tex, scale) = (self.number(params, "tex", 1.0)?, self.number(params, "scale", 1.0)?);
                Ok(match (tex.texture, scale.texture) {
                    (_, None) => ScalarParam { factor: tex.factor * scale.factor, ..tex },
                    (None, _) => ScalarParam { factor: tex.factor * scale.factor, ..scale },
                    _ => self.scalar(Texture::Scale { color: as_color(tex), scale }),
                })
            }
            "mix" => {
                let colors = [self.number(params, "tex1", 0.0)?, self.number(params, "tex2", 1.0)?];
                let amount = self.number(params, "amount", 0.5)?;
                Ok(self.scalar(Texture::Mix { colors: colors.map(as_color), amount }))
            }
            "checkerboard" => {
                let colors = [self.number(params, "tex1", 1.0)?, self.number(params, "tex2", 0.0)?];
                let mapping = board_mapping(texture)?;
                Ok(self.scalar(Texture::Checkerboard { mapping, colors: colors.map(as_color) }))
            }
            "imagemap" => {
                let (id, factor) = self.image_map(texture)?;
                Ok(ScalarParam { factor, texture: Some((id, 0)) })
            }
            "bilerp" | "directionmix" | "dots" | "fbm" | "marble" | "windy" | "wrinkled" => {
                let pattern = self.pattern(texture)?;
                Ok(self.scalar(pattern))
            }
            _ => self.stand_in(texture).map(|color| ScalarParam::constant(color.x)),
        }
    }

    fn scalar(&mut self, texture: Texture) -> ScalarParam {
        ScalarParam { factor: 1.0, texture: Some((self.push(texture), 0)) }
    }

    fn make_color(&mut self, texture: &TextureEntity) -> Result<ColorParam> {
        let params = &texture.entity.params;
        let any = f32::INFINITY;
        match &*texture.entity.kind {
            "constant" => self.color(params, "value", Vec3::ONE, any),
            "scale" => {
                let color = self.color(params, "tex", Vec3::ONE, any)?;
                let scale = self.number(params, "scale", 1.0)?;
                Ok(match scale.texture {
                    None => ColorParam { factor: color.factor * scale.factor, ..color },
                    Some(_) => self.colored(Texture::Scale { color, scale }),
                })
            }
            "mix" => {
                let colors = [
                    self.color(params, "tex1", Vec3::ZERO, any)?,
                    self.color(params, "tex2", Vec3::ONE, any)?,
                ];
                let amount = self.number(params, "amount", 0.5)?;
                Ok(self.colored(Texture::Mix { colors, amount }))
            }
            "checkerboard" => {
                let colors = [
                    self.color(params, "tex1", Vec3::ONE, any)?,
                    self.color(params, "tex2", Vec3::ZERO, any)?,
                ];
                let mapping = board_mapping(texture)?;
                Ok(self.colored(Texture::Checkerboard { mapping, colors }))
            }
            "imagemap" => {
                let (id, factor) = self.image_map(texture)?;
                Ok(ColorParam { factor: Vec3::splat(factor), texture: Some(id) })
            }
            "bilerp" | "directionmix" | "dots" | "fbm" | "marble" | "windy" | "wrinkled" => {
                let pattern = self.pattern(texture)?;
                Ok(self.colored(pattern))
            }
            _ => self.stand_in(texture).map(ColorParam::constant),
        }
    }

    fn colored(&mut self, texture: Texture) -> ColorParam {
        ColorParam { factor: Vec3::ONE, texture: Some(self.push(texture)) }
    }

    /// A picture, and the factor that multiplies it.
    fn image_map(&mut self, texture: &TextureEntity) -> Result<(TextureId, f32)> {
        let params = &texture.entity.params;
        let Some(name) = params.string("filename")? else {
            return Err(Fault::invalid(params.place, "texture \"imagemap\" has no \"string filename\""));
        };
        let scale = params.float("scale", 1.0)?;
        let invert = params.boolean("invert", false)?;
        // An inverted picture with a factor is inverted beforehand, as the factor counts first.
        let inverted = (invert && scale != 1.0).then_some(scale);
        let encoding = encoding(params)?;
        let path = self.context.resolve(name);
        let channels = if texture.color { Channels::Color } else { Channels::Number };
        let wanted = Use { encoding, channels, inverted };
        let place = self.context.full_words(params.place_of("filename"));
        let image = self.images.ask(path, wanted, &place);
        params.ignore(&["maxanisotropy"]);
        let drawn = ImageTexture {
            image: Arc::clone(&self.missing),
            wrap: [wrap(params)?; 2],
            filter: match params.choice("filter", &["bilinear", "ewa", "point", "trilinear"])? {
                "point" => TexelFilter::Nearest,
                _ => TexelFilter::Linear,
            },
            mapping: picture_mapping(texture)?,
            invert: invert && inverted.is_none(),
        };
        let factor = if inverted.is_some() { 1.0 } else { scale };
        Ok((self.push_image(image, drawn), factor))
    }

    /// A pattern without a picture.
    fn pattern(&self, texture: &TextureEntity) -> Result<Texture> {
        match &*texture.entity.kind {
            "bilerp" => self.corners(texture),
            "dots" => {
                let colors = self.pair(texture, ["inside", "outside"], [1.0, 0.0])?;
                Ok(Texture::Dots { mapping: mapping(texture)?, colors })
            }
            "directionmix" => self.facing(texture),
            kind => {
                let pattern = noise(&texture.entity.params, kind)?;
                Ok(Texture::Noise { from_world: single(from_world(texture)), pattern })
            }
        }
    }

    /// Two colours or numbers of a texture.
    fn pair(
        &self,
        texture: &TextureEntity,
        names: [&'static str; 2],
        defaults: [f32; 2],
    ) -> Result<[ColorParam; 2]> {
        let params = &texture.entity.params;
        let read = |name, default| match texture.color {
            true => self.color(params, name, Vec3::splat(default), f32::INFINITY),
            false => self.number(params, name, default).map(as_color),
        };
        Ok([read(names[0], defaults[0])?, read(names[1], defaults[1])?])
    }

    fn corners(&self, texture: &TextureEntity) -> Result<Texture> {
        let params = &texture.entity.params;
        let corner = |name, default: f32| -> Result<Vec3> {
            if texture.color {
                let spectrum = params.spectrum(name, self.context)?;
                return Ok(spectrum.map_or(Vec3::splat(default), |spectrum| spectrum.factor()));
            }
            params.float(name, default).map(Vec3::splat)
        };
        let colors = [corner("v00", 0.0)?, corner("v10", 0.0)?, corner("v01", 1.0)?, corner("v11", 1.0)?];
        Ok(Texture::Corners { mapping: mapping(texture)?, colors })
    }

    fn facing(&self, texture: &TextureEntity) -> Result<Texture> {
        let params = &texture.entity.params;
        let direction = params.vec3("dir", Kind::Vector3, Vec3::Y)?.as_dvec3();
        let direction = texture.to_world.0[0].transform_vector3(direction).try_normalize();
        let direction = direction.ok_or_else(|| {
            Fault::invalid(params.place_of("dir"), "\"dir\" of texture \"directionmix\" has length 0")
        })?;
        let colors = self.pair(texture, ["tex1", "tex2"], [0.0, 1.0])?;
        Ok(Texture::Facing { direction: direction.as_vec3(), colors })
    }

    /// A constant for textures that are not drawn.
    fn stand_in(&self, texture: &TextureEntity) -> Result<Vec3> {
        let params = &texture.entity.params;
        let kind = &*texture.entity.kind;
        if kind != "ptex" {
            return Err(Fault::invalid(params.place, unknown("texture", kind, &KINDS)));
        }
        self.context.warn(params.place, "texture \"ptex\" is not drawn; a grey stands in");
        params.ignore(&["encoding", "filename", "scale"]);
        Ok(Vec3::splat(0.5))
    }
}

/// The noise of a texture of type `kind`.
fn noise(params: &Params, kind: &str) -> Result<NoisePattern> {
    if kind == "windy" {
        return Ok(NoisePattern::Windy);
    }
    let octaves = params.integer_from("octaves", 0)?.unwrap_or(8);
    let roughness = params.float("roughness", 0.5)?;
    Ok(match kind {
        "fbm" => NoisePattern::Brownian { octaves, roughness },
        "wrinkled" => NoisePattern::Wrinkled { octaves, roughness },
        _ => {
            let (scale, variation) = (params.float("scale", 1.0)?, params.float("variation", 0.2)?);
            NoisePattern::Marble { octaves, roughness, scale, variation }
        }
    })
}

/// Textures with the pictures that they wait for.
fn fill(mut list: Vec<Texture>, waiting: &[(TextureId, ImageId)], images: &Images) -> Vec<Texture> {
    for (texture, image) in waiting {
        if let Texture::Image(texture) = &mut list[texture.0 as usize] {
            texture.image = Arc::clone(images.get(*image));
        }
    }
    list
}

/// The name that a parameter of type texture gives.
fn texture_name(param: &Param) -> Result<&str> {
    match &param.values {
        Values::Strings(names) if names.len() == 1 => Ok(&names[0]),
        _ => Err(Fault::invalid(param.place, format!("\"texture {}\" expects 1 name", param.name))),
    }
}

/// A number as a grey.
fn as_color(number: ScalarParam) -> ColorParam {
    ColorParam { factor: Vec3::splat(number.factor), texture: number.texture.map(|(texture, _)| texture) }
}

fn encoding(params: &Params) -> Result<Encoding> {
    let Some(text) = params.string("encoding")? else { return Ok(Encoding::Srgb) };
    let gamma = text.strip_prefix("gamma").and_then(|rest| rest.trim().parse().ok());
    match (text, gamma) {
        ("sRGB", _) => Ok(Encoding::Srgb),
        ("linear", _) => Ok(Encoding::Linear),
        (_, Some(gamma)) if gamma > 0.0 && f32::is_finite(gamma) => Ok(Encoding::Gamma(gamma)),
        _ => {
            let message = unknown("encoding", text, &["sRGB", "linear", "gamma 2.2"]);
            Err(Fault::invalid(params.place_of("encoding"), message))
        }
    }
}
