//! Measured materials of the RGL database: Dupuy and Jakob 2018, "An Adaptive Parameterization for Efficient Material
//! Acquisition and Rendering". Spectra become what white light shows of them.

use std::f32::consts::TAU;
use std::path::Path;

use glam::Vec3;
use quietus_trace::desc::{Measured, Sheets};

use crate::error::{ErrorKind, SceneError};
use crate::tensor::{Tensor, Tensors};

/// Wavelengths of a spectrum.
const MAX_WAVELENGTHS: usize = 4096;

/// Reads the material in the file whose content is `bytes`; `weights` says how much of each channel a wavelength is that
/// stands among others.
///
/// # Errors
/// Where the file is malformed, or measures a part of all azimuths only.
pub(crate) fn read(
    path: &Path,
    bytes: &[u8],
    weights: impl Fn(&[f32]) -> Vec<Vec3>,
) -> Result<Measured, SceneError> {
    let file = Tensors::read(path, bytes)?;
    let list = |name| -> Result<Vec<f32>, SceneError> {
        let numbers = file.floats(name, 1)?.numbers;
        if numbers.is_sorted() { Ok(numbers) } else { Err(file.fault(name, "is expected to ascend")) }
    };
    let (polar_angles, azimuths, wavelengths) = (list("theta_i")?, list("phi_i")?, list("wavelengths")?);
    if wavelengths.len() > MAX_WAVELENGTHS {
        return Err(file.fault("wavelengths", format!("more than {MAX_WAVELENGTHS} are not read")));
    }
    let views = [azimuths.len(), polar_angles.len()];
    let around = azimuths[azimuths.len() - 1] - azimuths[0];
    if azimuths.len() > 2 && (TAU / around).round() > 1.0 {
        let message = "surfaces of which only a part of all azimuths was measured are not read";
        return Err(SceneError::new(ErrorKind::Unsupported, path, "field \"phi_i\"", message));
    }
    let numbers = |name, before: &[usize]| -> Result<Sheets<f32>, SceneError> {
        let tensor = file.floats(name, before.len() + 2)?;
        let size = sheet_size(&file, name, &tensor, before)?;
        if tensor.numbers.iter().any(|&number| number < 0.0) {
            return Err(file.fault(name, "holds a number below 0"));
        }
        Ok(Sheets { size, values: tensor.numbers })
    };
    let spectra = file.floats("spectra", 5)?;
    let size = sheet_size(&file, "spectra", &spectra, &[views[0], views[1], wavelengths.len()])?;
    let measured = Measured {
        facets: numbers("ndf", &[])?,
        area: numbers("sigma", &[])?,
        visible: numbers("vndf", &views)?,
        luminance: numbers("luminance", &views)?,
        colors: Sheets { size, values: colors(&spectra.numbers, size, &weights(&wavelengths)) },
        azimuths,
        polar_angles,
    };
    for (name, sheets) in [("vndf", &measured.visible), ("luminance", &measured.luminance)] {
        let cells = sheets.size[0] as usize * sheets.size[1] as usize;
        if sheets.values.chunks_exact(cells).any(|sheet| sheet.iter().all(|&v| v <= f32::MIN_POSITIVE)) {
            return Err(file.fault(name, "is 0 everywhere for a direction of view"));
        }
    }
    Ok(measured)
}

/// Columns and rows of a tensor whose other dimensions must be these.
fn sheet_size(
    file: &Tensors<'_>,
    name: &str,
    tensor: &Tensor,
    before: &[usize],
) -> Result<[u32; 2], SceneError> {
    let (found, sheet) = tensor.shape.split_at(before.len());
    let sound = sheet.iter().all(|n| (2..1 << 16).contains(n));
    match *sheet {
        [height, width] if sound && found == before => Ok([width as u32, height as u32]),
        _ => {
            let message = format!(
                "has the dimensions {:?}, expected {before:?} and 2 or more along two others",
                tensor.shape
            );
            Err(file.fault(name, message))
        }
    }
}

/// Sums spectra, sheets of one wavelength after the other for each direction of view, up to colours.
fn colors(spectra: &[f32], size: [u32; 2], weights: &[Vec3]) -> Vec<Vec3> {
    let sheet = size[0] as usize * size[1] as usize;
    let of_view = |spectrum: &[f32]| -> Vec<Vec3> {
        let mut sums = vec![Vec3::ZERO; sheet];
        for (values, weight) in spectrum.chunks_exact(sheet).zip(weights) {
            sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += *weight * *value);
        }
        sums
    };
    spectra.chunks_exact(sheet * weights.len()).flat_map(of_view).collect()
}

#[cfg(test)]
mod tests;
