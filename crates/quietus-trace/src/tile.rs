//! The door to the tracer: pixels to sample go in, samples come out.

use glam::Vec3;

use crate::integrator;
use crate::isa::{Isa, Job};
use crate::scene::Scene;
use crate::view::View;

/// A run of consecutive samples of one replicate of one pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelWork {
    /// Column in the full frame (not the crop): sample values depend on it.
    pub x: u32,
    /// Row in the full frame, 0 at the top.
    pub y: u32,
    /// Place in the 8x8 tile, row by row: 0..64. The tracer only passes it on.
    pub pixel: u8,
    /// Which replicate of the pixel.
    pub replicate: u8,
    /// First sample index of the run.
    pub first: u32,
    /// Length of the run; `first + count` is at most `u32::MAX`.
    pub count: u32,
}

/// What one path found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Radiance, linear Rec.709; may be non-finite where a bug or a scene made it so: the film decides.
    pub radiance: Vec3,
    /// 1 where the camera ray hit a surface, else 0; environments seen directly count as 0.
    pub alpha: f32,
    /// Albedo of the first surface that is not a perfect mirror or glass; the environment's or emitter's
    /// radiance clamped to 1 where there is none.
    pub albedo: Vec3,
    /// World-space shading normal of that surface, 0 where there is none.
    pub normal: Vec3,
    /// Distance along the camera's viewing axis to the first hit; 0 where there is none.
    pub depth: f32,
}

/// Takes samples as they come, in index order within one [`PixelWork`].
pub trait SampleSink {
    /// One sample of `work`, with its index in `work.first..work.first + work.count`.
    fn add(&mut self, work: &PixelWork, index: u32, sample: &Sample);
}

/// What a call to [`render_tile`] has done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TileCounts {
    /// Camera paths, which is samples.
    pub paths: u64,
    /// Rays traced: camera, bounce and shadow rays.
    pub rays: u64,
}

impl std::ops::AddAssign for TileCounts {
    fn add_assign(&mut self, other: Self) {
        self.paths += other.paths;
        self.rays += other.rays;
    }
}

/// Draws every sample of `work`, pixel after pixel, and hands each to `sink`.
///
/// A sample depends on the scene, the view and its (pixel, replicate, index) alone: neither on what else is in
/// `work` nor on the thread. Same binary and same instruction set, same bits.
///
/// # Panics
/// Where `first + count` of a run exceeds `u32::MAX`: sample indices would start again.
pub fn render_tile(scene: &Scene, view: &View, work: &[PixelWork], sink: &mut impl SampleSink) -> TileCounts {
    view.level.run(TileJob { scene, view, work, sink })
}

struct TileJob<'a, S> {
    scene: &'a Scene,
    view: &'a View,
    work: &'a [PixelWork],
    sink: &'a mut S,
}

impl<S: SampleSink> Job for TileJob<'_, S> {
    type Output = TileCounts;

    #[inline(always)] // into the function that carries the target features
    fn run<I: Isa>(self, isa: I) -> TileCounts {
        let mut counts = TileCounts::default();
        for run in self.work {
            let end = run.first.checked_add(run.count).expect("sample indices fit into 32 bits");
            for index in run.first..end {
                let sample = integrator::sample(isa, self.scene, self.view, run, index, &mut counts);
                self.sink.add(run, index, &sample);
            }
        }
        counts
    }
}
