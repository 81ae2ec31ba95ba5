//! The pictures that a scene asks for: noted while it is read, decoded side by side afterwards, each once.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

use quietus_trace::desc::{Image, Texels};
use quietus_trace::texture::srgb_to_linear;
use rayon::prelude::*;

use crate::error::SceneError;
use crate::image::{self, Encoding};

/// A picture that has been asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct ImageId(usize);

/// What a picture is for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Use {
    pub encoding: Encoding,
    pub channels: Channels,
    /// Where given, `1 - factor * value` is wanted, 0 where that is below.
    pub inverted: Option<f32>,
}

/// What is wanted of a texel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Channels {
    /// Its colour.
    Color,
    /// The mean of red, green and blue.
    Mean,
    /// The same, but alpha of a picture that has it and is not opaque everywhere: so pbrt-v4 reads textures of numbers.
    Number,
}

impl Use {
    /// A picture of colours.
    pub(super) const COLOR: Self =
        Self { encoding: Encoding::Srgb, channels: Channels::Color, inverted: None };
}

/// All pictures, in the order in which they were asked for.
#[derive(Debug, Default)]
pub(super) struct Requests {
    files: image::Images,
    list: Vec<(image::ImageId, Use)>,
    by_file: HashMap<usize, Vec<usize>>,
}

impl Requests {
    /// Asks for the picture at `path`; `place` is where the scene names it, for messages.
    pub(super) fn ask(&mut self, path: PathBuf, wanted: Use, place: &str) -> ImageId {
        let file = self.files.request(path, wanted.encoding, place);
        let of_file = self.by_file.entry(file.0).or_default();
        if let Some(&known) = of_file.iter().find(|&&i| self.list[i].1 == wanted) {
            return ImageId(known);
        }
        of_file.push(self.list.len());
        self.list.push((file, wanted));
        ImageId(self.list.len() - 1)
    }

    /// Reads all.
    pub(super) fn load(self) -> Result<Images, SceneError> {
        let files = self.files.load()?;
        let image = |(file, wanted): (image::ImageId, Use)| wanted.applied_to(&files[file.0]);
        Ok(Images(self.list.into_par_iter().map(image).collect()))
    }
}

/// Pictures in memory.
#[derive(Debug)]
pub(super) struct Images(Vec<Arc<Image>>);

impl Images {
    /// The picture asked for.
    pub(super) fn get(&self, id: ImageId) -> &Arc<Image> {
        &self.0[id.0]
    }
}

impl Use {
    fn applied_to(self, image: &Arc<Image>) -> Arc<Image> {
        if self.channels == Channels::Color && self.inverted.is_none() {
            return Arc::clone(image);
        }
        let mut texels = image.texels.clone();
        if self.channels != Channels::Color {
            texels = numbers(texels, self.channels == Channels::Number);
        }
        if let Some(factor) = self.inverted {
            let invert = |[r, g, b, a]: [f32; 4]| {
                let [r, g, b] = [r, g, b].map(|value| (1.0 - factor * value).max(0.0));
                [r, g, b, a]
            };
            texels = Texels::Float(linear(texels).into_iter().map(invert).collect());
        }
        Arc::new(Image { name: image.name.clone(), width: image.width, height: image.height, texels })
    }
}

/// The mean of red, green and blue in all channels; alpha instead, decoded as they are, where it is wanted `over` them and not
/// 1 everywhere.
fn numbers(texels: Texels, over: bool) -> Texels {
    if let Texels::Srgb8(all) | Texels::Linear8(all) = &texels
        && all.iter().all(|[r, g, b, a]| r == g && g == b && *a == 255)
    {
        return texels;
    }
    let curved = matches!(texels, Texels::Srgb8(_));
    let linear = linear(texels);
    let masks = over && linear.iter().any(|texel| texel[3] != 1.0);
    let number = |[r, g, b, a]: [f32; 4]| match masks {
        true if curved => srgb_to_linear(a),
        true => a,
        false => (r + g + b) / 3.0,
    };
    Texels::Float(linear.into_iter().map(|texel| [number(texel); 4]).collect())
}

/// Texels as linear floats.
pub(super) fn linear(texels: Texels) -> Vec<[f32; 4]> {
    let decode = |texels: Vec<[u8; 4]>, curve: fn(f32) -> f32| {
        let table: [f32; 256] = std::array::from_fn(|code| curve(code as f32 / 255.0));
        let texel = |[r, g, b, a]: [u8; 4]| {
            let [r, g, b] = [r, g, b].map(|code| table[usize::from(code)]);
            [r, g, b, f32::from(a) / 255.0]
        };
        texels.into_iter().map(texel).collect()
    };
    match texels {
        Texels::Float(texels) => texels,
        Texels::Srgb8(texels) => decode(texels, srgb_to_linear),
        Texels::Linear8(texels) => decode(texels, |value| value),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_means_of_light_or_alpha() {
        let numbers = |texels: Texels, over: bool| match numbers(texels, over) {
            Texels::Float(texels) => texels.iter().map(|texel| texel[0]).collect::<Vec<_>>(),
            other => panic!("expected floats: {other:?}"),
        };
        let red = vec![[255, 0, 0, 255]];
        assert_eq!(numbers(Texels::Srgb8(red.clone()), true), [1.0 / 3.0]);
        let masked = [red, vec![[0, 255, 255, 51]]].concat();
        assert_eq!(numbers(Texels::Linear8(masked.clone()), true), [1.0, 0.2]);
        assert_eq!(numbers(Texels::Srgb8(masked.clone()), true), [1.0, srgb_to_linear(0.2)]);
        assert_eq!(numbers(Texels::Linear8(masked), false), [1.0 / 3.0, 2.0 / 3.0]);
        let grey = self::numbers(Texels::Srgb8(vec![[7, 7, 7, 255]]), true);
        assert!(matches!(grey, Texels::Srgb8(texels) if texels == [[7, 7, 7, 255]]));
    }
}
