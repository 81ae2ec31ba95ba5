//! What to draw of a scene: frame, camera, filter, path length and seed.

use thiserror::Error;

use crate::camera::{Camera, CameraError};
use crate::desc;
use crate::filter::{Filter, FilterError, FilterSampler};
use crate::isa::Level;
use crate::medium::Inside;

/// Why there is no such view.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ViewError {
    /// An empty frame, or a camera that makes no sense.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// A filter that makes no sense.
    #[error(transparent)]
    Filter(#[from] FilterError),
}

/// Settings of one picture, checked and prepared.
#[derive(Clone, Debug)]
pub struct View {
    pub(crate) camera: Camera,
    pub(crate) filter: FilterSampler,
    pub(crate) max_depth: u32,
    pub(crate) seed: u64,
    /// The medium the camera stands in.
    pub(crate) medium: Inside,
    pub(crate) level: Level,
}

impl View {
    /// A view of `size` = `[width, height]` pixels through `camera`, each pixel weighted by `filter`.
    ///
    /// `max_depth` counts path segments from the camera: 1 shows emitters seen directly, 2 adds direct light, and
    /// 0 is black. `seed` picks the random numbers; everything else equal, equal seeds give equal bits.
    ///
    /// # Errors
    /// An empty frame, a camera or a filter that makes no sense.
    pub fn new(
        camera: &desc::Camera,
        size: [u32; 2],
        filter: Filter,
        max_depth: u32,
        seed: u64,
    ) -> Result<Self, ViewError> {
        Ok(Self {
            camera: Camera::new(camera, size[0], size[1])?,
            filter: FilterSampler::new(filter)?,
            max_depth,
            seed,
            medium: Inside::new(camera.medium),
            level: Level::detect(),
        })
    }

    /// The same view drawn with other instructions than the widest there are.
    pub fn with_level(self, level: Level) -> Self {
        Self { level, ..self }
    }
}
