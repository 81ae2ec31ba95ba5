//! The assembled picture: plain vectors, row by row over the window.

use crate::film::{Aovs, Replicate};
use crate::layout::Window;

/// A picture as it is written: linear Rec.709, all vectors `window.pixels()` long, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Width and height of the full frame.
    pub frame: [u32; 2],
    /// The part of it that was rendered.
    pub window: Window,
    /// Red, green, blue (associated) and alpha: the replicates' means weighted by their counts, 0 without samples.
    pub beauty: Vec<[f32; 4]>,
    /// Accepted samples of all replicates.
    pub samples: Vec<u32>,
    /// Remaining error in the units of the metric it was made with.
    pub error: Vec<f32>,
    /// Albedo of the first surface that is not a perfect mirror or glass.
    pub albedo: Vec<[f32; 3]>,
    /// World-space normal of that surface, averaged but not normalised.
    pub normal: Vec<[f32; 3]>,
    /// Distance along the viewing axis, averaged over the samples that hit something.
    pub depth: Vec<f32>,
}

impl Picture {
    /// A black picture without samples.
    pub fn empty(frame: [u32; 2], window: Window) -> Self {
        let pixels = window.pixels();
        Self {
            frame,
            window,
            beauty: vec![[0.0; 4]; pixels],
            samples: vec![0; pixels],
            error: vec![0.0; pixels],
            albedo: vec![[0.0; 3]; pixels],
            normal: vec![[0.0; 3]; pixels],
            depth: vec![0.0; pixels],
        }
    }

    /// Where the vectors hold the pixel at (`x`, `y`) of the full frame.
    ///
    /// # Panics
    /// When the pixel is outside of the window.
    pub fn index(&self, x: u32, y: u32) -> usize {
        let Window { x0, y0, x1, y1 } = self.window;
        assert!((x0..x1).contains(&x) && (y0..y1).contains(&y), "pixel ({x}, {y}) is outside of the window");
        (y - y0) as usize * self.window.width() as usize + (x - x0) as usize
    }

    pub(crate) fn set(&mut self, x: u32, y: u32, replicates: &[Replicate], aovs: &Aovs, error: f32) {
        let index = self.index(x, y);
        let count = replicates.iter().fold(0_u32, |sum, replicate| sum.saturating_add(replicate.count));
        self.samples[index] = count;
        self.error[index] = error;
        self.albedo[index] = aovs.albedo(count);
        self.normal[index] = aovs.normal(count);
        self.depth[index] = aovs.depth();
        if count > 0 {
            self.beauty[index] = std::array::from_fn(|channel| {
                let sum: f64 = replicates.iter().map(|r| f64::from(r.sum[channel])).sum();
                (sum / f64::from(count)) as f32
            });
        }
    }
}
