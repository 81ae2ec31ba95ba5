//! What draws samples: the path tracer, or a stand-in in tests.

use quietus_trace::scene::Scene;
use quietus_trace::tile::{self, PixelWork, SampleSink, TileCounts};
use quietus_trace::view::View;

/// Draws samples on demand. Called by many threads at once.
pub trait Tracer: Sync {
    /// Draws every sample of `work` in order and hands each to `sink`. A sample may depend on its pixel, replicate
    /// and index alone.
    fn render_tile(&self, work: &[PixelWork], sink: &mut impl SampleSink) -> TileCounts;
}

/// The path tracer on a scene seen through a view.
#[derive(Clone, Copy, Debug)]
pub struct PathTracer<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Camera, filter, path length and seed.
    pub view: &'a View,
}

impl Tracer for PathTracer<'_> {
    fn render_tile(&self, work: &[PixelWork], sink: &mut impl SampleSink) -> TileCounts {
        tile::render_tile(self.scene, self.view, work, sink)
    }
}
