//! Structure: does the error know where tiles are? Each figure compares the 8x8 grid with the same grid
//! displaced by 4 pixels, so that it is 1 where the error does not.

use std::ops::AddAssign;

use serde::{Deserialize, Serialize};

use super::display;
use crate::{Picture, Reference};

/// Sums over pictures, on the tile grid (first) and on the displaced grid (second).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Structure {
    /// Mean over blocks of the square of the block's mean error.
    pub block_energy: [f64; 2],
    /// Mean square of the step of the error across block edges.
    pub edge_steps: [f64; 2],
    /// Mean square error of the pixels along block edges.
    pub edge_error: [f64; 2],
}

impl Structure {
    /// Ratios of on-grid to displaced: block energy, edge steps, edge error.
    pub fn ratios(&self) -> [f64; 3] {
        [self.block_energy, self.edge_steps, self.edge_error].map(|[on, off]| on / off)
    }
}

impl AddAssign<&Structure> for Structure {
    fn add_assign(&mut self, other: &Self) {
        for i in 0..2 {
            self.block_energy[i] += other.block_energy[i];
            self.edge_steps[i] += other.edge_steps[i];
            self.edge_error[i] += other.edge_error[i];
        }
    }
}

/// Measures a picture. Both grids are looked at over the same area, whose border of 4 pixels is left out as
/// far as blocks do not fit.
pub fn structure(picture: &Picture, reference: &Reference) -> Structure {
    let pixels = picture.rgb.iter().zip(&reference.mean.rgb);
    let error = pixels.map(|(x, r)| (0..3).map(|c| display(x[c]) - display(r[c])).sum::<f64>() / 3.0);
    let error = ErrorImage { width: picture.width as usize, values: error.collect() };
    Structure {
        block_energy: [0, 4].map(|shift| error.block_energy(shift)),
        edge_steps: [0, 4].map(|shift| error.edge_steps(shift)),
        edge_error: [0, 4].map(|shift| error.edge_error(shift)),
    }
}

/// Signed display errors, mean of the channels.
struct ErrorImage {
    width: usize,
    values: Vec<f64>,
}

impl ErrorImage {
    fn height(&self) -> usize {
        self.values.len() / self.width
    }

    fn at(&self, x: usize, y: usize) -> f64 {
        self.values[y * self.width + x]
    }

    fn block_energy(&self, shift: usize) -> f64 {
        let starts = |length: usize| (shift..).step_by(8).take_while(move |s| s + 8 <= length);
        let blocks = starts(self.height()).flat_map(|y| starts(self.width).map(move |x| (x, y)));
        mean(blocks.map(|(x0, y0)| {
            let pixels = (0..64).map(|i| self.at(x0 + i % 8, y0 + i / 8));
            (pixels.sum::<f64>() / 64.0).powi(2)
        }))
    }

    fn edge_steps(&self, shift: usize) -> f64 {
        let (w, h) = (self.width, self.height());
        let across = (1..w).filter(|x| x % 8 == shift).flat_map(|x| (0..h).map(move |y| (x, y)));
        let down = (1..h).filter(|y| y % 8 == shift).flat_map(|y| (0..w).map(move |x| (x, y)));
        let steps = across.map(|(x, y)| (self.at(x, y) - self.at(x - 1, y)).powi(2));
        mean(steps.chain(down.map(|(x, y)| (self.at(x, y) - self.at(x, y - 1)).powi(2))))
    }

    /// Inside the border of 4 pixels both grids have (nearly) as many edge pixels.
    fn edge_error(&self, shift: usize) -> f64 {
        let on_edge = |v: usize| matches!((v + shift) % 8, 0 | 7);
        let inside = |length: usize| 4..length.saturating_sub(4);
        let pixels = inside(self.height()).flat_map(|y| inside(self.width).map(move |x| (x, y)));
        mean(pixels.filter(|&(x, y)| on_edge(x) || on_edge(y)).map(|(x, y)| self.at(x, y).powi(2)))
    }
}

/// 0 where there is nothing, as in a picture smaller than a block.
fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), v| (sum + v, count + 1.0));
    if count > 0.0 { sum / count } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{measure::errors::tests::flat, runs::Random};

    fn noisy(offset: impl Fn(usize, usize) -> f64) -> Structure {
        let reference = flat(128, 128, 0.25, 0.0);
        let mut picture = reference.mean.clone();
        let mut random = Random::new(1, 2);
        for (i, pixel) in picture.rgb.iter_mut().enumerate() {
            let noise = random.below(1 << 20) as f64 / f64::from(1 << 20) - 0.5;
            *pixel = [(0.5 + 0.02 * noise + offset(i % 128, i / 128)).powi(2) as f32; 3];
        }
        structure(&picture, &reference)
    }

    /// White noise: 15^2 and 16^2 blocks, each a sum of 64 values: the ratio's standard deviation is about
    /// sqrt(2 / 225 + 2 / 256) = 0.13 for block energies, 0.02 for the others. Five of them are allowed.
    #[test]
    fn white_noise_does_not_know_tiles() {
        let [blocks, steps, edges] = noisy(|_, _| 0.0).ratios();
        assert!((blocks - 1.0).abs() < 0.65, "{blocks}");
        assert!((steps - 1.0).abs() < 0.1 && (edges - 1.0).abs() < 0.1, "{steps} {edges}");
    }

    #[test]
    fn box_artefacts_stand_out() {
        // Tiles of a checkerboard too bright or too dark by half the noise's range: on the grid, blocks have
        // it as their mean, steps of twice the offset lie on edges; displaced, it cancels in every block.
        let offset = |x: usize, y: usize| if (x / 8 + y / 8).is_multiple_of(2) { 0.01 } else { -0.01 };
        let [blocks, steps, _] = noisy(offset).ratios();
        assert!(blocks > 50.0 && steps > 3.0, "{blocks} {steps}");
        // Noisier pixels along the edges of tiles.
        let edge = |v: usize| matches!(v % 8, 0 | 7);
        let [_, _, edges] =
            noisy(|x, y| if (edge(x) || edge(y)) && (x + y).is_multiple_of(2) { 0.02 } else { 0.0 }).ratios();
        assert!(edges > 1.5, "{edges}");
    }
}
