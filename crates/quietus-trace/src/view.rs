//! What to draw of a scene: frame, camera, filter, exposure, path length and seed.

use glam::Vec3;
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
    /// An exposure that makes no picture.
    #[error("the exposure is {0}; expected finite numbers of at least 0")]
    Exposure(Vec3),
    /// A largest component that lets nothing through.
    #[error("samples are limited to {0}; expected a number above 0")]
    MaxComponent(f32),
    /// A limit that lets no indirect light through.
    #[error("indirect light is limited to {0}; expected a number above 0")]
    IndirectLimit(f32),
}

/// Settings of one picture, checked and prepared.
#[derive(Clone, Debug)]
pub struct View {
    pub(crate) camera: Camera,
    pub(crate) filter: FilterSampler,
    pub(crate) exposure: Vec3,
    pub(crate) max_component: f32,
    /// See [`Self::with_indirect_limit`].
    pub(crate) indirect_limit: f32,
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
            exposure: Vec3::ONE,
            max_component: f32::INFINITY,
            indirect_limit: f32::INFINITY,
            max_depth,
            seed,
            medium: Inside::new(camera.medium),
            level: Level::detect(),
        })
    }

    /// The same view whose samples are multiplied by `exposure` and then darkened until no component is above
    /// `max_component`, which keeps their hue and loses energy; infinity lets all through.
    ///
    /// # Errors
    /// An exposure that is negative or not finite, a limit that is not above 0.
    pub fn with_exposure(self, exposure: Vec3, max_component: f32) -> Result<Self, ViewError> {
        if !(exposure.is_finite() && exposure.min_element() >= 0.0) {
            return Err(ViewError::Exposure(exposure));
        }
        if max_component.is_nan() || max_component <= 0.0 {
            return Err(ViewError::MaxComponent(max_component));
        }
        Ok(Self { exposure, max_component, ..self })
    }

    /// The same view in which every contribution of light that was scattered twice or more on its way, mirrors and
    /// glass included, is darkened until none of its components, exposed, is above `limit`. That loses energy, caustics
    /// above all, and with them the bright specks of paths that are rarely found; infinity lets all through.
    ///
    /// # Errors
    /// A limit that is not above 0.
    pub fn with_indirect_limit(self, limit: f32) -> Result<Self, ViewError> {
        if limit.is_nan() || limit <= 0.0 {
            return Err(ViewError::IndirectLimit(limit));
        }
        Ok(Self { indirect_limit: limit, ..self })
    }

    /// What is left of light that was scattered `scatterings` times.
    #[inline(always)]
    pub(crate) fn limit_indirect(&self, radiance: Vec3, scatterings: u32) -> Vec3 {
        if self.indirect_limit == f32::INFINITY || scatterings < 2 {
            return radiance;
        }
        let most = (radiance * self.exposure).max_element();
        if most > self.indirect_limit { radiance * (self.indirect_limit / most) } else { radiance }
    }

    /// What a sample of `radiance` puts on the film.
    #[inline(always)]
    pub(crate) fn expose(&self, radiance: Vec3) -> Vec3 {
        let exposed = radiance * self.exposure;
        let most = exposed.max_element();
        if most > self.max_component { exposed * (self.max_component / most) } else { exposed }
    }

    /// The same view drawn with other instructions than the widest there are.
    pub fn with_level(self, level: Level) -> Self {
        Self { level, ..self }
    }
}

#[cfg(test)]
mod tests {
    use glam::Affine3A;

    use super::*;

    #[test]
    fn samples_are_exposed_and_then_limited() {
        let camera = desc::Camera::perspective("", Affine3A::IDENTITY, 1.0);
        let view = View::new(&camera, [4, 4], Filter::BOX, 1, 0).expect("a sound view");
        assert_eq!(view.expose(Vec3::new(1.0, 2.0, 1e30)), Vec3::new(1.0, 2.0, 1e30));
        assert!(view.expose(Vec3::new(f32::NAN, 0.0, 0.0)).is_nan());
        for bad in [f32::NAN, -1.0, f32::INFINITY] {
            assert!(view.clone().with_exposure(Vec3::new(1.0, bad, 1.0), 1.0).is_err());
        }
        for bad in [f32::NAN, -1.0, 0.0] {
            assert!(view.clone().with_exposure(Vec3::ONE, bad).is_err());
        }
        let view = view.with_exposure(Vec3::new(0.5, 1.0, 2.0), 8.0).expect("a sound exposure");
        assert_eq!(view.expose(Vec3::splat(2.0)), Vec3::new(1.0, 2.0, 4.0));
        assert_eq!(view.expose(Vec3::splat(16.0)), Vec3::new(2.0, 4.0, 8.0));
    }

    /// Only what was scattered twice is limited, by how bright it is on the film, and keeps its hue.
    #[test]
    fn indirect_light_is_limited_on_demand() {
        let camera = desc::Camera::perspective("", Affine3A::IDENTITY, 1.0);
        let view = View::new(&camera, [4, 4], Filter::BOX, 1, 0).expect("a sound view");
        let bright = Vec3::new(1.0, 2.0, 1e30);
        assert_eq!(view.limit_indirect(bright, 9), bright);
        for bad in [f32::NAN, -1.0, 0.0] {
            assert!(view.clone().with_indirect_limit(bad).is_err());
        }
        let view = view.with_exposure(Vec3::splat(2.0), f32::INFINITY).expect("a sound exposure");
        let view = view.with_indirect_limit(8.0).expect("a sound limit");
        assert_eq!(view.limit_indirect(bright, 1), bright);
        assert_eq!(view.limit_indirect(Vec3::new(1.0, 2.0, 4.0), 2), Vec3::new(1.0, 2.0, 4.0));
        assert_eq!(view.limit_indirect(Vec3::new(1.0, 2.0, 16.0), 2), Vec3::new(0.25, 0.5, 4.0));
    }
}
