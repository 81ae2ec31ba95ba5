//! Values that vary over surfaces: images, patterns, and what is made of them.

mod image;
mod mapping;
mod pattern;
mod pyramid;
#[cfg(test)]
mod tests;

use std::collections::HashMap;
use std::sync::Arc;

use glam::{Affine3A, Vec2, Vec3, Vec4};
use rayon::prelude::*;
use thiserror::Error;

use crate::desc::{
    ColorParam, Image, Mapping, NoisePattern, ScalarParam, TexelFilter, Texels, Texture, TextureId,
};
use image::FilteredImage;
pub use image::srgb_to_linear;
use pyramid::Pyramid;

/// What texture look-ups need to know of a surface point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// The mesh's two sets of texture coordinates; 0 where it has none.
    pub uv: [Vec2; 2],
    /// Linear vertex colour with alpha; 1 where the mesh has none.
    pub color: Vec4,
    /// Where it is in the world.
    pub position: Vec3,
    /// How much of the surface around it the look-up stands for.
    pub footprint: Footprint,
}

impl Default for SurfacePoint {
    fn default() -> Self {
        Self { uv: [Vec2::ZERO; 2], color: Vec4::ONE, position: Vec3::ZERO, footprint: Footprint::POINT }
    }
}

/// The ellipse on the surface that a look-up stands for, given by two half axes. Where it is not known it is a
/// point, which costs noise and never gives a wrong mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// Its half axes in the world, in the tangent plane.
    pub axes: [Vec3; 2],
    /// What the sets of texture coordinates change by along each of them: `uv[set][axis]`.
    pub uv: [[Vec2; 2]; 2],
}

impl Footprint {
    /// Nothing but the point itself.
    pub const POINT: Self = Self { axes: [Vec3::ZERO; 2], uv: [[Vec2::ZERO; 2]; 2] };
}

/// What is wrong with a texture.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("texture {index}{name}: {problem}")]
pub struct TextureError {
    /// Its index.
    pub index: usize,
    /// Its image's name in quotes, after a blank; empty where it has none.
    pub name: String,
    /// What is wrong.
    pub problem: String,
}

/// A scene's textures, checked and ready to be looked up.
#[derive(Clone, Debug, Default)]
pub struct TextureTable {
    nodes: Vec<Node>,
    /// Bytes of all images with what they were filtered down to.
    bytes: usize,
}

/// A texture, ready to be looked up.
#[derive(Clone, Debug)]
enum Node {
    Constant(Vec4),
    Image(FilteredImage),
    Checkerboard {
        mapping: Mapping,
        colors: [ColorParam; 2],
    },
    Scale {
        color: ColorParam,
        scale: ScalarParam,
    },
    Mix {
        colors: [ColorParam; 2],
        amount: ScalarParam,
    },
    Corners {
        mapping: Mapping,
        colors: [Vec3; 4],
    },
    Dots {
        mapping: Mapping,
        colors: [ColorParam; 2],
    },
    /// The last says whether footprints count.
    Noise {
        from_world: Affine3A,
        pattern: NoisePattern,
        filtered: bool,
    },
    Facing {
        direction: Vec3,
        colors: [ColorParam; 2],
    },
}

/// Most textures that one look-up may come to: a texture that mixes the one before it with itself doubles their
/// number.
const MOST_LOOKUPS: u64 = 256;

impl TextureTable {
    /// Checks `textures` and prepares them. Images are filtered down to pyramids, with all threads of rayon's pool,
    /// but for textures that `exact` says are looked at as they are: those whose values are not averaged by whoever
    /// uses them, as normals and coverage.
    ///
    /// # Errors
    /// Names the first texture that cannot be used, and why.
    pub fn compile(textures: &[Texture], exact: impl Fn(TextureId) -> bool) -> Result<Self, TextureError> {
        let mut lookups = Vec::with_capacity(textures.len());
        for (index, texture) in textures.iter().enumerate() {
            let problem = |problem| {
                let name = match texture {
                    Texture::Image(image) => format!(" {:?}", image.image.name),
                    _ => String::new(),
                };
                TextureError { index, name, problem }
            };
            check(texture, index).map_err(problem)?;
            let count = 1 + children(texture).iter().map(|child| lookups[child.0 as usize]).sum::<u64>();
            if count > MOST_LOOKUPS {
                let message = format!("it looks up over {MOST_LOOKUPS} others, one through another");
                return Err(problem(message));
            }
            lookups.push(count);
        }
        let exact = exact_through(textures, exact);
        let pyramids = pyramids(textures, &exact);
        let bytes = pyramids.values().map(|pyramid| pyramid.bytes()).sum();
        let nodes =
            textures.iter().zip(&exact).map(|(texture, &exact)| node(texture, exact, &pyramids)).collect();
        Ok(Self { nodes, bytes })
    }

    /// How many textures there are.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Bytes of memory that the images take, with what they were filtered down to.
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// Linear RGBA of texture `id` at `point`. Products and mixtures have the alpha of what they are made of.
    ///
    /// # Panics
    /// If there is no such texture.
    #[inline]
    pub fn lookup(&self, TextureId(id): TextureId, point: &SurfacePoint) -> Vec4 {
        match &self.nodes[id as usize] {
            Node::Constant(value) => *value,
            Node::Image(image) => image.lookup(point),
            node => self.evaluate(node, point),
        }
    }

    /// A texture that is made of others.
    fn evaluate(&self, node: &Node, point: &SurfacePoint) -> Vec4 {
        match node {
            Node::Constant(value) => *value,
            Node::Image(image) => image.lookup(point),
            Node::Checkerboard { mapping, colors } => {
                self.color(&colors[usize::from(mapping.is_odd_cell(point))], point)
            }
            Node::Scale { color, scale } => {
                let factor = scale.at(point, self);
                self.color(color, point) * Vec3::splat(factor).extend(1.0)
            }
            Node::Mix { colors, amount } => {
                let amount = amount.at(point, self).clamp(0.0, 1.0);
                self.color(&colors[0], point).lerp(self.color(&colors[1], point), amount)
            }
            Node::Corners { mapping, colors } => pattern::between_corners(*colors, mapping, point),
            Node::Dots { mapping, colors } => {
                self.color(&colors[usize::from(!pattern::is_in_dot(mapping, point))], point)
            }
            Node::Noise { from_world, pattern, filtered } => pattern.at(from_world, point, *filtered),
            Node::Facing { direction, colors } => {
                let share = pattern::facing(*direction, point);
                self.color(&colors[1], point).lerp(self.color(&colors[0], point), share)
            }
        }
    }

    /// A colour with alpha.
    fn color(&self, param: &ColorParam, point: &SurfacePoint) -> Vec4 {
        let factor = param.factor.extend(1.0);
        param.texture.map_or(factor, |id| factor * self.lookup(id, point))
    }

    /// The mean of texture `id` over its image, or of what it is made of, weighted by chance where they depend on
    /// each other. Costs a pass over images: not for the hot path.
    ///
    /// # Panics
    /// If there is no such texture.
    pub fn mean(&self, TextureId(id): TextureId) -> Vec4 {
        let color = |param: &ColorParam| {
            param.factor.extend(1.0) * param.texture.map_or(Vec4::ONE, |texture| self.mean(texture))
        };
        let scalar = |param: &ScalarParam| {
            param.factor
                * param.texture.map_or(1.0, |(texture, channel)| self.mean(texture)[usize::from(channel)])
        };
        match &self.nodes[id as usize] {
            Node::Constant(value) => *value,
            Node::Image(image) => image.mean(),
            Node::Checkerboard { colors, .. } => 0.5 * (color(&colors[0]) + color(&colors[1])),
            Node::Scale { color: c, scale } => color(c) * Vec3::splat(scalar(scale)).extend(1.0),
            Node::Mix { colors, amount } => {
                color(&colors[0]).lerp(color(&colors[1]), scalar(amount).clamp(0.0, 1.0))
            }
            Node::Corners { colors, .. } => (colors.iter().sum::<Vec3>() / 4.0).extend(1.0),
            Node::Dots { colors, .. } => color(&colors[1]).lerp(color(&colors[0]), pattern::SHARE_OF_DOTS),
            Node::Noise { pattern, .. } => pattern.mean(),
            // The mean of the cosine's magnitude over all directions.
            Node::Facing { colors, .. } => 0.5 * (color(&colors[0]) + color(&colors[1])),
        }
    }
}

/// The textures that `texture` itself names.
fn children(texture: &Texture) -> Vec<TextureId> {
    let colors = |colors: &[ColorParam]| colors.iter().filter_map(|color| color.texture).collect::<Vec<_>>();
    let scalar = |scalar: &ScalarParam| scalar.texture.map(|(id, _)| id);
    match texture {
        Texture::Image(_) | Texture::Constant(_) | Texture::Corners { .. } | Texture::Noise { .. } => {
            Vec::new()
        }
        Texture::Checkerboard { colors: c, .. }
        | Texture::Dots { colors: c, .. }
        | Texture::Facing { colors: c, .. } => colors(c),
        Texture::Scale { color, scale } => colors(&[*color]).into_iter().chain(scalar(scale)).collect(),
        Texture::Mix { colors: c, amount } => colors(c).into_iter().chain(scalar(amount)).collect(),
    }
}

/// Which textures are looked at as they are: those `exact` names, and all they are made of.
fn exact_through(textures: &[Texture], exact: impl Fn(TextureId) -> bool) -> Vec<bool> {
    let mut all: Vec<bool> = (0..textures.len() as u32).map(|id| exact(TextureId(id))).collect();
    // Textures only name earlier ones.
    for index in (0..textures.len()).rev() {
        if all[index] {
            children(&textures[index]).into_iter().for_each(|child| all[child.0 as usize] = true);
        }
    }
    all
}

/// The images of all textures, each once, filtered down where a texture wants that.
fn pyramids(textures: &[Texture], exact: &[bool]) -> HashMap<*const Image, Arc<Pyramid>> {
    let mut images: HashMap<*const Image, (&Arc<Image>, bool)> = HashMap::new();
    for (texture, &exact) in textures.iter().zip(exact) {
        if let Texture::Image(texture) = texture {
            let filtered =
                &mut images.entry(Arc::as_ptr(&texture.image)).or_insert((&texture.image, false)).1;
            *filtered |= !exact && texture.filter == TexelFilter::Linear;
        }
    }
    // Pointers are only compared; a collected map of them would not be `Send`.
    let images: Vec<_> = images.into_values().collect();
    let built: Vec<_> =
        images.into_par_iter().map(|(image, filtered)| Pyramid::new(image, filtered)).collect();
    built.into_iter().map(|pyramid| (pyramid.base(), Arc::new(pyramid))).collect()
}

fn node(texture: &Texture, exact: bool, pyramids: &HashMap<*const Image, Arc<Pyramid>>) -> Node {
    match texture {
        Texture::Constant(value) => Node::Constant(*value),
        Texture::Image(t) => {
            let pyramid = &pyramids[&Arc::as_ptr(&t.image)];
            Node::Image(FilteredImage::new(t, Arc::clone(pyramid), exact))
        }
        &Texture::Checkerboard { mapping, colors } => Node::Checkerboard { mapping, colors },
        &Texture::Scale { color, scale } => Node::Scale { color, scale },
        &Texture::Mix { colors, amount } => Node::Mix { colors, amount },
        &Texture::Corners { mapping, colors } => Node::Corners { mapping, colors },
        &Texture::Dots { mapping, colors } => Node::Dots { mapping, colors },
        &Texture::Noise { from_world, pattern } => Node::Noise { from_world, pattern, filtered: !exact },
        &Texture::Facing { direction, colors } => Node::Facing { direction, colors },
    }
}

/// Finds what cannot be looked up in texture `index`.
fn check(texture: &Texture, index: usize) -> Result<(), String> {
    for child in children(texture) {
        if child.0 as usize >= index {
            return Err(format!("it names texture {}, expected an earlier one", child.0));
        }
    }
    match texture {
        Texture::Image(texture) => check_image(&texture.image).and(check_mapping(&texture.mapping, false)),
        Texture::Constant(value) if !value.is_finite() => {
            Err(format!("it is {value}, expected finite numbers"))
        }
        Texture::Constant(_) => Ok(()),
        Texture::Checkerboard { mapping, colors } => {
            check_mapping(mapping, true)?;
            colors.iter().try_for_each(check_color)
        }
        Texture::Scale { color, scale } => check_color(color).and(check_scalar(scale)),
        Texture::Mix { colors, amount } => {
            colors.iter().try_for_each(check_color)?;
            check_scalar(amount)
        }
        Texture::Corners { mapping, colors } => {
            check_mapping(mapping, false)?;
            colors.iter().try_for_each(|color| check_color(&ColorParam::constant(*color)))
        }
        Texture::Dots { mapping, colors } => {
            check_mapping(mapping, false)?;
            colors.iter().try_for_each(check_color)
        }
        Texture::Noise { from_world, pattern } => {
            check_mapping(&Mapping::Solid { from_world: *from_world }, true)?;
            check_noise(pattern)
        }
        Texture::Facing { direction, colors } => {
            if !direction.is_normalized() {
                return Err(format!("its direction is {direction}, expected one of unit length"));
            }
            colors.iter().try_for_each(check_color)
        }
    }
}

fn check_noise(pattern: &NoisePattern) -> Result<(), String> {
    /// Beyond these noise is finer than numbers are.
    const MOST_OCTAVES: u32 = 64;
    let (count, numbers) = match *pattern {
        NoisePattern::Brownian { octaves, roughness } | NoisePattern::Wrinkled { octaves, roughness } => {
            (octaves, [roughness, 0.0, 0.0])
        }
        NoisePattern::Windy => (0, [0.0; 3]),
        NoisePattern::Marble { octaves, roughness, scale, variation } => {
            (octaves, [roughness, scale, variation])
        }
    };
    if count > MOST_OCTAVES {
        return Err(format!("it has {count} octaves, expected {MOST_OCTAVES} at most"));
    }
    match numbers.iter().find(|number| !number.is_finite()) {
        Some(number) => Err(format!("its noise has a parameter of {number}, expected a finite number")),
        None => Ok(()),
    }
}

fn check_image(image: &Image) -> Result<(), String> {
    let texels = match &image.texels {
        Texels::Srgb8(t) | Texels::Linear8(t) => t.len(),
        Texels::Float(t) => t.len(),
    };
    let Image { width, height, .. } = image;
    if *width == 0 || *height == 0 {
        return Err(format!("it is {width}x{height} texels, at least 1x1 is needed"));
    }
    if u64::from(*width) * u64::from(*height) != texels as u64 {
        return Err(format!("{width}x{height} texels were announced, but there are {texels}"));
    }
    if *width.max(height) > 1 << 24 {
        return Err(format!("{width}x{height} texels are more than 2^24 along one side"));
    }
    Ok(())
}

fn check_mapping(mapping: &Mapping, solid: bool) -> Result<(), String> {
    let finite = match mapping {
        Mapping::Uv { set, .. } if *set > 1 => {
            return Err(format!("it uses set {set} of texture coordinates, 0 or 1 was expected"));
        }
        Mapping::Solid { .. } if !solid => {
            return Err("images have two coordinates, the mapping of solid textures has three".to_owned());
        }
        Mapping::Uv { transform, .. } => transform.is_finite(),
        Mapping::Planar { from_world, axes, offset } => {
            from_world.is_finite() && axes.iter().all(|axis| axis.is_finite()) && offset.is_finite()
        }
        Mapping::Spherical { from_world }
        | Mapping::Cylindrical { from_world }
        | Mapping::Solid { from_world } => from_world.is_finite(),
    };
    if finite { Ok(()) } else { Err("its mapping is not finite".to_owned()) }
}

fn check_color(color: &ColorParam) -> Result<(), String> {
    match color.factor.is_finite() {
        true => Ok(()),
        false => Err(format!("a colour is {}, expected finite numbers", color.factor)),
    }
}

fn check_scalar(scalar: &ScalarParam) -> Result<(), String> {
    let channel = scalar.texture.map_or(0, |(_, channel)| channel);
    if channel > 3 {
        return Err(format!("it reads channel {channel} of a texture, expected 0 to 3"));
    }
    match scalar.factor.is_finite() {
        true => Ok(()),
        false => Err(format!("a factor is {}, expected a finite number", scalar.factor)),
    }
}

impl ColorParam {
    /// Its value at `point`.
    #[inline]
    pub fn at(&self, point: &SurfacePoint, textures: &TextureTable) -> Vec3 {
        match self.texture {
            None => self.factor,
            Some(id) => self.factor * textures.lookup(id, point).truncate(),
        }
    }
}

impl ScalarParam {
    /// Its value at `point`.
    #[inline]
    pub fn at(&self, point: &SurfacePoint, textures: &TextureTable) -> f32 {
        match self.texture {
            None => self.factor,
            Some((id, channel)) => self.factor * textures.lookup(id, point)[usize::from(channel)],
        }
    }
}
