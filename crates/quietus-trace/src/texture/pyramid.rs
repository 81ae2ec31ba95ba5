//! Images filtered down, level by level, to half their size (Williams 1983, "Pyramidal Parametrics").

use std::sync::{Arc, LazyLock};

use glam::Vec4;
use rayon::prelude::*;

use super::image::srgb_to_linear;
use crate::desc::{Image, Texels};

/// An image and what it is filtered down to, until a single texel is left. A third more memory than the image alone:
/// levels keep its kind of texels; while it is built, 4 bytes more per texel of the image. All levels have the same mean, but for the rounding to 8 bits.
#[derive(Debug)]
pub(super) struct Pyramid {
    /// The image itself first.
    pub(super) levels: Vec<Arc<Image>>,
}

impl Pyramid {
    /// The pyramid over `image`; only the image itself where it is not to be `filtered`.
    pub(super) fn new(image: &Arc<Image>, filtered: bool) -> Self {
        let mut levels = vec![Arc::clone(image)];
        if !filtered {
            return Self { levels };
        }
        let mut size = [image.width, image.height];
        // Each level is made of the one above it before that is rounded.
        let mut above: Option<Vec<Vec4>> = None;
        while size != [1, 1] {
            let half = size.map(|side| (side / 2).max(1));
            let texels = match &above {
                None => halve(size, half, |x, y| image.texel(x, y)),
                Some(texels) => halve(size, half, |x, y| texels[y as usize * size[0] as usize + x as usize]),
            };
            let name = format!("{}, {}x{}", image.name, half[0], half[1]);
            let encoded = encode(&texels, &image.texels);
            levels.push(Arc::new(Image { name, width: half[0], height: half[1], texels: encoded }));
            (above, size) = (Some(texels), half);
        }
        Self { levels }
    }

    /// Where the image is in memory.
    pub(super) fn base(&self) -> *const Image {
        Arc::as_ptr(&self.levels[0])
    }

    /// Bytes of all texels.
    pub(super) fn bytes(&self) -> usize {
        let bytes = |level: &Arc<Image>| match &level.texels {
            Texels::Srgb8(texels) | Texels::Linear8(texels) => size_of_val(&**texels),
            Texels::Float(texels) => size_of_val(&**texels),
        };
        self.levels.iter().map(bytes).sum()
    }
}

/// The mean of the texels of a picture of `size` under each texel of one of size `half`, weighted by how much of them
/// lies under it: sides may be odd, and all texels have the same share in the whole.
fn halve(size: [u32; 2], half: [u32; 2], texel: impl Fn(u32, u32) -> Vec4 + Sync) -> Vec<Vec4> {
    let columns = shares(size[0], half[0]);
    let rows = shares(size[1], half[1]);
    let row = |rows: &Vec<(u32, f32)>| {
        let texel = |x| {
            let mut sum = Vec4::ZERO;
            for &(y, height) in rows {
                for &(x, width) in x {
                    sum += texel(x, y) * (width * height);
                }
            }
            sum
        };
        columns.iter().map(texel).collect::<Vec<_>>()
    };
    // Rows of small pictures are not worth a thread each.
    rows.par_iter().with_min_len((1 << 14) / half[0] as usize + 1).flat_map_iter(row).collect()
}

/// Which of `from` texels in a row lie under each of `to`, and with what share.
fn shares(from: u32, to: u32) -> Vec<Vec<(u32, f32)>> {
    let scale = f64::from(from) / f64::from(to);
    let under = |i: u32| {
        let (start, end) = (f64::from(i) * scale, f64::from(i + 1) * scale);
        let last = (end.ceil() as u32).min(from);
        let share = |x: u32| {
            let covered = (f64::from(x) + 1.0).min(end) - f64::from(x).max(start);
            (x, (covered / scale) as f32)
        };
        (start as u32..last).map(share).filter(|(_, share)| *share > 0.0).collect()
    };
    (0..to).map(under).collect()
}

/// Linear texels in the manner of `like`.
fn encode(texels: &[Vec4], like: &Texels) -> Texels {
    let byte = |value: f32| (value * 255.0).round() as u8;
    match like {
        Texels::Srgb8(_) => {
            let texel = |t: &Vec4| [srgb_code(t.x), srgb_code(t.y), srgb_code(t.z), byte(t.w)];
            Texels::Srgb8(texels.iter().map(texel).collect())
        }
        Texels::Linear8(_) => Texels::Linear8(texels.iter().map(|t| t.to_array().map(byte)).collect()),
        Texels::Float(_) => Texels::Float(texels.iter().map(|t| t.to_array()).collect()),
    }
}

/// Linear values half-way between codes of the sRGB curve.
static SRGB_BORDERS: LazyLock<[f32; 255]> = LazyLock::new(|| {
    std::array::from_fn(|code| {
        let linear = |code: usize| srgb_to_linear(code as f32 / 255.0);
        0.5 * (linear(code) + linear(code + 1))
    })
});

/// The sRGB code whose linear value is nearest: means are rounded where they are taken.
fn srgb_code(linear: f32) -> u8 {
    SRGB_BORDERS.partition_point(|&border| border <= linear) as u8
}
