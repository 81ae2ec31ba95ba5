//! Intel Open Image Denoise, where it is installed: a picture without noise from one with noise, its albedo and its
//! normals.
//!
//! The library is loaded when it is asked for, by its C interface of version 2; nothing is linked, and a program that
//! never asks does not need it. All `unsafe` code is in [`library`].

mod library;

use std::path::Path;

use library::{Device, Image, Library};

/// Why nothing was denoised.
#[derive(Debug, thiserror::Error)]
pub enum DenoiseError {
    /// No library was found where systems keep them.
    #[error("Open Image Denoise is not here: {0}")]
    Absent(String),
    /// The file that was named cannot be loaded.
    #[error("{path}: cannot load it: {reason}")]
    Unloadable {
        /// The file.
        path: String,
        /// What the system said.
        reason: String,
    },
    /// It is something else, or too old.
    #[error("{path}: not Open Image Denoise 2: {reason}")]
    NotVersion2 {
        /// The file.
        path: String,
        /// What is missing.
        reason: String,
    },
    /// The library says no.
    #[error("Open Image Denoise: {0}")]
    Refused(String),
    /// A picture that cannot be denoised.
    #[error("{0}")]
    Unusable(String),
}

/// A picture to denoise: row by row from the top, all slices `width * height` long.
#[derive(Clone, Copy, Debug)]
pub struct Noisy<'a> {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Linear light, of any range from 0.
    pub color: &'a [[f32; 3]],
    /// Albedo, 0..=1, where it is known.
    pub albedo: Option<&'a [[f32; 3]]>,
    /// Normals, of length 1 at most, where they are known. They are used with albedo only.
    pub normal: Option<&'a [[f32; 3]]>,
}

/// The library, loaded.
pub struct Denoiser {
    library: Library,
}

impl Denoiser {
    /// Loads the library from `path`, or from where the system keeps libraries.
    ///
    /// # Errors
    /// When it is not there, cannot be loaded, or is not of version 2.
    pub fn load(path: Option<&Path>) -> Result<Self, DenoiseError> {
        Ok(Self { library: Library::load(path)? })
    }

    /// Version of the library, as 20501 for 2.5.1.
    ///
    /// # Errors
    /// When no device can be had.
    pub fn version(&self) -> Result<i32, DenoiseError> {
        Ok(Device::new(&self.library)?.version())
    }

    /// The picture without its noise. Albedo and normals are denoised first: they have noise of their own, where
    /// motion or lenses blur them.
    ///
    /// # Errors
    /// When sizes do not agree, a value is not finite, or the library says no.
    pub fn denoise(&self, noisy: &Noisy<'_>) -> Result<Vec<[f32; 3]>, DenoiseError> {
        let &Noisy { width, height, color, albedo, normal } = noisy;
        let size = [width, height];
        let image = |name, pixels| Image { name, pixels };
        let color = image(c"color", color);
        let albedo = albedo.map(|pixels| image(c"albedo", pixels));
        // The library has no use for normals alone.
        let normal = normal.filter(|_| albedo.is_some()).map(|pixels| image(c"normal", pixels));
        for image in [Some(&color), albedo.as_ref(), normal.as_ref()].into_iter().flatten() {
            check(image, size)?;
        }
        let device = Device::new(&self.library)?;
        let clean = |image: Option<Image<'_>>| {
            let cleaned =
                image.map(|noisy| device.filter(size, &[noisy], &[]).map(|pixels| (noisy.name, pixels)));
            cleaned.transpose()
        };
        let guides = [clean(albedo)?, clean(normal)?];
        let guides = guides.iter().flatten().map(|(name, pixels)| image(name, pixels));
        let images: Vec<_> = std::iter::once(color).chain(guides).collect();
        device.filter(size, &images, &[(c"hdr", true), (c"cleanAux", images.len() > 1)])
    }
}

fn check(image: &Image<'_>, [width, height]: [usize; 2]) -> Result<(), DenoiseError> {
    let (name, pixels) = (image.name.to_string_lossy(), image.pixels);
    let unusable = |reason: String| Err(DenoiseError::Unusable(reason));
    if width == 0 || height == 0 || width.checked_mul(height) != Some(pixels.len()) {
        return unusable(format!("{name} has {} pixels instead of {width}x{height}", pixels.len()));
    }
    match pixels.iter().position(|pixel| pixel.iter().any(|value| !value.is_finite())) {
        Some(at) => unusable(format!("{name} is not finite at ({}, {})", at % width, at / width)),
        None => Ok(()),
    }
}
