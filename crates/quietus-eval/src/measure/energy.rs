//! Energy: how bright pictures are, in total, where it is dark, and tile by tile. Its mean over many runs,
//! less that of uniform sampling, is the bias of a policy.

use crate::{Picture, Reference};

/// Mean luminance of parts of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Energy {
    /// Of all pixels.
    pub picture: f64,
    /// Of the fifth of the pixels that is darkest in the reference.
    pub darkest_fifth: f64,
    /// Of each 8x8 tile, row by row.
    pub tiles: Vec<f64>,
}

/// Measures energies over the same pixels of many pictures.
#[derive(Clone, Debug)]
pub struct EnergyMeter {
    darkest: Vec<usize>,
    /// The reference's own energies.
    pub reference: Energy,
}

impl EnergyMeter {
    /// A meter for pictures of `reference`.
    pub fn new(reference: &Reference) -> Self {
        let luminances: Vec<f64> = reference.mean.rgb.iter().copied().map(luminance).collect();
        let mut order: Vec<usize> = (0..luminances.len()).collect();
        order.sort_by(|&a, &b| luminances[a].total_cmp(&luminances[b]));
        order.truncate(luminances.len().div_ceil(5));
        let reference = energy(&reference.mean, &order);
        Self { darkest: order, reference }
    }

    /// The energies of a picture.
    pub fn measure(&self, picture: &Picture) -> Energy {
        energy(picture, &self.darkest)
    }
}

fn energy(picture: &Picture, darkest: &[usize]) -> Energy {
    let luminances: Vec<f64> = picture.rgb.iter().copied().map(luminance).collect();
    Energy {
        picture: luminances.iter().sum::<f64>() / luminances.len() as f64,
        darkest_fifth: darkest.iter().map(|&i| luminances[i]).sum::<f64>() / darkest.len() as f64,
        tiles: super::errors::tile_means(&luminances, picture.width),
    }
}

/// What `difference` is of `whole`; no difference is none, also from darkness.
pub(crate) fn relative(difference: f64, whole: f64) -> f64 {
    if difference == 0.0 { 0.0 } else { difference / whole }
}

/// Luminance of linear Rec.709.
pub(crate) fn luminance(rgb: [f32; 3]) -> f64 {
    0.2126 * f64::from(rgb[0]) + 0.7152 * f64::from(rgb[1]) + 0.0722 * f64::from(rgb[2])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::errors::tests::flat;

    #[test]
    fn the_darkest_fifth_is_that_of_the_reference() {
        let mut reference = flat(10, 8, 0.5, 0.0);
        (0..16).for_each(|i| reference.mean.rgb[5 * i] = [0.1; 3]);
        let meter = EnergyMeter::new(&reference);
        assert!((meter.reference.darkest_fifth - 0.1).abs() < 1e-7);
        assert!((meter.reference.picture - 0.42).abs() < 1e-7);
        let mut picture = reference.mean.clone();
        picture.rgb[0] = [0.0; 3];
        picture.rgb[1] = [0.0; 3];
        let energy = meter.measure(&picture);
        assert!((energy.darkest_fifth - 0.1 * 15.0 / 16.0).abs() < 1e-7);
        assert!((energy.tiles[0] - (meter.reference.tiles[0] - 0.6 / 64.0)).abs() < 1e-7);
        assert_eq!(energy.tiles[1], meter.reference.tiles[1]);
    }
}
