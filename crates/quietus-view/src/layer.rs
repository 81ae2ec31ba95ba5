//! What can be seen of a pixel, and its bytes for the browser.

use half::f16;
use half::slice::HalfFloatSliceExt;
use quietus_film::{Replicate, TILE, TILE_PIXELS, TileCopy};
use quietus_render::shown_error;
use serde::{Deserialize, Serialize};

/// Everything that comes tile by tile. The browser knows them by number, in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Layer {
    /// Linear red, green, blue and alpha, four half floats.
    Beauty,
    /// Samples drawn, an unsigned integer.
    Samples,
    /// Remaining error in the units of Dammertz's metric, a float.
    Error,
    /// Whether sampling goes on there: one bit per pixel, `8 y + x` of 64.
    Active,
    /// Red, green, blue of the surface, three half floats.
    Albedo,
    /// Its normal in the world, three half floats.
    Normal,
    /// Distance along the viewing axis, a float; 0 where nothing was hit.
    Depth,
}

/// How many layers there are.
pub(crate) const LAYERS: usize = 7;

impl Layer {
    /// All of them, in order.
    pub(crate) const ALL: [Self; LAYERS] =
        [Self::Beauty, Self::Samples, Self::Error, Self::Active, Self::Albedo, Self::Normal, Self::Depth];

    /// Bytes of a tile of 64 pixels.
    pub(crate) fn tile_bytes(self) -> usize {
        match self {
            Self::Beauty => TILE_PIXELS * 8,
            Self::Albedo | Self::Normal => TILE_PIXELS * 6,
            Self::Samples | Self::Error | Self::Depth => TILE_PIXELS * 4,
            Self::Active => TILE_PIXELS / 8,
        }
    }

    /// Writes a tile, row by row. [`Self::Active`] is not of the film and is left alone.
    pub(crate) fn encode(self, tile: &TileCopy, bytes: &mut [u8]) {
        match self {
            Self::Beauty => halves(bytes, 4, |pixel, out| out.copy_from_slice(&color(tile, pixel))),
            Self::Albedo => halves(bytes, 3, |pixel, out| {
                out.copy_from_slice(&aovs(tile, pixel).albedo(count(tile, pixel)));
            }),
            Self::Normal => halves(bytes, 3, |pixel, out| {
                out.copy_from_slice(&aovs(tile, pixel).normal(count(tile, pixel)));
            }),
            Self::Samples => words(bytes, |pixel| count(tile, pixel).to_le_bytes()),
            Self::Error => words(bytes, |pixel| error(replicates(tile, pixel)).to_le_bytes()),
            Self::Depth => words(bytes, |pixel| aovs(tile, pixel).depth().to_le_bytes()),
            Self::Active => (),
        }
    }
}

/// Of every pixel of a tile `channels` floats, as halves; what they cannot hold becomes their largest.
fn halves(bytes: &mut [u8], channels: usize, mut pixel: impl FnMut(u32, &mut [f32])) {
    let (mut floats, mut halves) = ([0.0; 4 * TILE_PIXELS], [f16::ZERO; 4 * TILE_PIXELS]);
    let (floats, halves) = (&mut floats[..channels * TILE_PIXELS], &mut halves[..channels * TILE_PIXELS]);
    floats.chunks_exact_mut(channels).enumerate().for_each(|(i, out)| pixel(i as u32, out));
    let most = f16::MAX.to_f32();
    floats.iter_mut().for_each(|value| *value = value.clamp(-most, most));
    halves.convert_from_f32_slice(floats);
    bytes.chunks_exact_mut(2).zip(halves).for_each(|(to, half)| to.copy_from_slice(&half.to_le_bytes()));
}

fn words(bytes: &mut [u8], mut pixel: impl FnMut(u32) -> [u8; 4]) {
    bytes.chunks_exact_mut(4).enumerate().for_each(|(i, to)| to.copy_from_slice(&pixel(i as u32)));
}

fn replicates(tile: &TileCopy, pixel: u32) -> &[Replicate] {
    tile.replicates(pixel % TILE, pixel / TILE)
}

fn aovs(tile: &TileCopy, pixel: u32) -> &quietus_film::Aovs {
    tile.aovs(pixel % TILE, pixel / TILE)
}

/// Accepted samples of a pixel.
fn count(tile: &TileCopy, pixel: u32) -> u32 {
    replicates(tile, pixel).iter().fold(0, |sum: u32, replicate| sum.saturating_add(replicate.count))
}

/// Mean of the samples; in single precision, as it is only looked at.
fn color(tile: &TileCopy, pixel: u32) -> [f32; 4] {
    let share = 1.0 / count(tile, pixel).max(1) as f32;
    let replicates = replicates(tile, pixel);
    [0, 1, 2, 3].map(|channel| share * replicates.iter().map(|replicate| replicate.sum[channel]).sum::<f32>())
}

/// The remaining error, 0 where there is no sample to speak of one.
fn error(replicates: &[Replicate]) -> f32 {
    if replicates.iter().all(|replicate| replicate.count == 0) { 0.0 } else { shown_error(replicates) }
}

/// Everything about one pixel, exactly as the film has it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct PixelValues {
    x: u32,
    y: u32,
    color: [f32; 4],
    samples: u32,
    error: f32,
    albedo: [f32; 3],
    normal: [f32; 3],
    depth: f32,
    active: bool,
}

impl PixelValues {
    /// Those of the pixel (`x`, `y`) of the frame, in `tile` with the mask `active`.
    pub(crate) fn new(tile: &TileCopy, [x, y]: [u32; 2], active: u64) -> Self {
        let pixel = (y - tile.window.y0) * TILE + x - tile.window.x0;
        let samples = count(tile, pixel);
        Self {
            x,
            y,
            color: color(tile, pixel),
            samples,
            error: error(replicates(tile, pixel)),
            albedo: aovs(tile, pixel).albedo(samples),
            normal: aovs(tile, pixel).normal(samples),
            depth: aovs(tile, pixel).depth(),
            active: active >> pixel & 1 == 1,
        }
    }
}
