//! PNG: 8 bits with the sRGB curve, opaque.

use std::path::Path;

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};

use crate::output::{OutputError, write_atomically};
use crate::picture::Picture;

/// Linear light to an 8-bit sRGB code (IEC 61966-2-1), rounded to the nearest code; below 0 and NaN become 0.
pub fn srgb8(linear: f32) -> u8 {
    let linear = if linear > 0.0 { f64::from(linear.min(1.0)) } else { 0.0 };
    let encoded = if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    (encoded * 255.0).round() as u8
}

/// Writes the window of `picture` as an opaque 8-bit sRGB PNG. Colours are associated with their alpha, so what is
/// written is the picture over black; values above 1 are clipped.
///
/// # Errors
/// When the file cannot be written; `path` is then as it was.
pub fn write_png(path: &Path, picture: &Picture) -> Result<(), OutputError> {
    let pixels: Vec<[u8; 3]> = picture.beauty.iter().map(|&[r, g, b, _]| [r, g, b].map(srgb8)).collect();
    write_rgb_png(path, [picture.window.width(), picture.window.height()], &pixels)
}

/// Writes pixels, row by row from the top, as they are.
///
/// # Errors
/// When the file cannot be written; `path` is then as it was.
///
/// # Panics
/// When there are not `size[0] * size[1]` pixels.
pub fn write_rgb_png(path: &Path, size: [u32; 2], pixels: &[[u8; 3]]) -> Result<(), OutputError> {
    write_atomically(path, |writer| {
        PngEncoder::new(writer)
            .write_image(pixels.as_flattened(), size[0], size[1], ExtendedColorType::Rgb8)
            .map_err(|error| OutputError::Format { path: path.to_owned(), message: error.to_string() })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Window;

    /// The decoding curve, written out again so that the encoder is not tested against itself.
    fn decode(code: u8) -> f64 {
        let v = f64::from(code) / 255.0;
        if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
    }

    #[test]
    fn every_code_is_the_nearest_one() {
        for code in 0..=255_u8 {
            assert_eq!(srgb8(decode(code) as f32), code);
            if code < 255 {
                // Half-way in display space: just below goes down, just above goes up.
                let v = (f64::from(code) + 0.5) / 255.0;
                let middle = if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) };
                assert_eq!(srgb8((middle * 0.9999) as f32), code);
                assert_eq!(srgb8((middle * 1.0001) as f32), code + 1);
            }
        }
    }

    #[test]
    fn what_is_out_of_range_is_clipped() {
        let codes = [-1.0, f32::NAN, f32::NEG_INFINITY, 1.0, 7.5, f32::INFINITY].map(srgb8);
        assert_eq!(codes, [0, 0, 0, 255, 255, 255]);
    }

    #[test]
    fn a_png_holds_the_window() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        let mut picture = Picture::empty([20, 10], Window { x0: 3, y0: 4, x1: 6, y1: 6 });
        picture.beauty[4] = [0.214, 1.0, 0.0, 0.0];
        write_png(&path, &picture).unwrap();
        let read = image::open(&path).unwrap().to_rgb8();
        assert_eq!(read.dimensions(), (3, 2));
        assert_eq!(read.get_pixel(1, 1).0, [127, 255, 0]);
    }
}
