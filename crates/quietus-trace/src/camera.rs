//! The camera: a place on the film and a place on the lens become a ray.

mod lenses;

use std::f32::consts::PI;

use glam::{Affine3A, Vec2, Vec3};
use thiserror::Error;

use self::lenses::LensSystem;
use crate::desc::{self, FrameAxis};
use crate::geometry::motion::Motion;
use crate::light::{equal_area_direction, fold_square};

/// Why a camera cannot be used.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CameraError {
    /// Nothing to see.
    #[error("the frame is {0}x{1} pixels; both sides must be at least 1")]
    EmptyFrame(u32, u32),
    /// An angle of view outside of 0..pi.
    #[error("camera \"{name}\": the field of view is {fov} radians; expected more than 0 and less than pi")]
    FieldOfView {
        /// The camera's name.
        name: String,
        /// What it said.
        fov: f32,
    },
    /// An orthographic camera that sees nothing.
    #[error("camera \"{name}\": the frame's extent is {extent}; expected a finite number above 0")]
    Extent {
        /// The camera's name.
        name: String,
        /// What it said.
        extent: f32,
    },
    /// A lens that makes no sense.
    #[error(
        "camera \"{name}\": lens radius {lens_radius} with focus distance {focus_distance}; expected a radius of 0, \
         or a positive radius and a positive distance"
    )]
    Lens {
        /// The camera's name.
        name: String,
        /// What it said.
        lens_radius: f32,
        /// What it said.
        focus_distance: f32,
    },
    /// A lens before a whole sphere of directions.
    #[error(
        "camera \"{name}\": a spherical camera has no lens; expected a lens radius of 0, found {lens_radius}"
    )]
    SphericalLens {
        /// The camera's name.
        name: String,
        /// What it said.
        lens_radius: f32,
    },
    /// Lenses of which nothing is made.
    #[error(
        "camera \"{name}\": expected lenses with places that grow towards the front, sizes and indices above 0 and a \
         film, through which light finds its way"
    )]
    Lenses {
        /// The camera's name.
        name: String,
    },
    /// A frame beside the axis by no finite number, or pixels without a width.
    #[error(
        "camera \"{name}\": the frame is shifted by {shift} with pixels {pixel_aspect} times as wide as high; expected \
         finite numbers, the latter above 0"
    )]
    Frame {
        /// The camera's name.
        name: String,
        /// What it said.
        shift: Vec2,
        /// What it said.
        pixel_aspect: f32,
    },
    /// A transform that scales, shears or is not finite, at either end of the shutter's time.
    #[error("camera \"{name}\": its transform is not a rotation with translation")]
    Transform {
        /// The camera's name.
        name: String,
    },
    /// It mirrors when the shutter opens, and does not when it closes, or the other way round.
    #[error("camera \"{name}\": it is mirrored at one end of its motion alone; expected both or neither")]
    Motion {
        /// The camera's name.
        name: String,
    },
}

/// A camera, ready for one frame size.
#[derive(Clone, Debug)]
pub struct Camera {
    /// When the shutter opens.
    to_world: Affine3A,
    motion: Option<Motion>,
    projection: Projection,
    /// Where the optical axis meets the film, in pixels.
    center: Vec2,
    lens_radius: f32,
    focus_distance: f32,
    lenses: Option<LensSystem>,
}

/// How places on the film become directions, with the sizes of pixels.
#[derive(Clone, Copy, Debug)]
enum Projection {
    /// Size of a pixel at distance 1 along the axis.
    Perspective(Vec2),
    /// Size of a pixel.
    Orthographic(Vec2),
    /// Angles across one pixel: longitude and latitude.
    Spherical(Vec2),
    /// Size of the frame.
    EqualArea(Vec2),
}

/// A ray that leaves the camera.
#[derive(Clone, Copy, Debug)]
pub struct CameraRay {
    /// A point on the lens, in the world.
    pub origin: Vec3,
    /// Of unit length, in the world.
    pub direction: Vec3,
    /// Cosine between the direction and the viewing axis: distance times this is depth. 1 for spherical cameras, whose
    /// depth is distance.
    pub axis_cosine: f32,
    /// The cone that the pixel sees around the ray.
    pub cone: Cone,
    /// Factor of the light that it brings: 1 but behind lenses, of which rims take some; 0 where there is no ray at all.
    pub weight: f32,
}

/// A cone around a ray: how much of the world it stands for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cone {
    /// Its radius where the ray starts.
    pub radius: f32,
    /// What the radius grows by per unit of distance.
    pub spread: f32,
}

impl Camera {
    /// Prepares `camera` for a frame of `width` x `height` square pixels.
    ///
    /// # Errors
    /// A frame without pixels, a field of view outside of 0..pi, a lens without a positive focus distance, a
    /// transform that is not orthonormal, a motion into a mirror.
    pub fn new(camera: &desc::Camera, width: u32, height: u32) -> Result<Self, CameraError> {
        let name = || camera.name.clone();
        if width == 0 || height == 0 {
            return Err(CameraError::EmptyFrame(width, height));
        }
        let frame = Vec2::new(width as f32, height as f32);
        let projection = projection(camera, frame)?;
        check_lens(camera)?;
        let &desc::Camera { shift, pixel_aspect, .. } = camera;
        if !(shift.is_finite() && pixel_aspect > 0.0 && pixel_aspect.is_finite()) {
            return Err(CameraError::Frame { name: name(), shift, pixel_aspect });
        }
        let lenses = camera.lenses.as_ref().map(|lenses| {
            LensSystem::new(lenses, frame.y).ok_or_else(|| CameraError::Lenses { name: name() })
        });
        if !is_rigid(&camera.to_world) || !camera.end_to_world.as_ref().is_none_or(is_rigid) {
            return Err(CameraError::Transform { name: name() });
        }
        let end = camera.end_to_world.filter(|end| *end != camera.to_world);
        let motion = end.map(|end| Motion::new(&camera.to_world, &end));
        if motion.is_some_and(|motion| motion.is_none()) {
            return Err(CameraError::Motion { name: name() });
        }
        Ok(Self {
            to_world: camera.to_world,
            motion: motion.flatten(),
            projection,
            center: (0.5 - shift * Vec2::new(1.0, -1.0)) * frame,
            lens_radius: camera.lens_radius,
            // A pinhole may come without a distance; any one gives the same ray.
            focus_distance: if camera.lens_radius > 0.0 { camera.focus_distance } else { 1.0 },
            lenses: lenses.transpose()?,
        })
    }

    /// Whether the lens has an extent.
    #[inline]
    pub(crate) fn has_lens(&self) -> bool {
        self.lens_radius > 0.0 || self.lenses.is_some()
    }

    /// Whether rays depend on the time.
    #[inline]
    pub(crate) fn moves(&self) -> bool {
        self.motion.is_some()
    }

    /// The ray through `film`, in pixels from the frame's top left corner, and through the point of the lens that
    /// `lens`, in the unit disk, stands for, at `time` in 0..=1 of the shutter's time.
    #[inline(always)] // into the tile's function: left to the compiler it stays outside, for up to 4 % of a picture's time
    pub fn ray(&self, film: Vec2, lens: Vec2, time: f32) -> CameraRay {
        let to_world = self.motion.as_ref().map_or(self.to_world, |motion| motion.at(time));
        let offset = (film - self.center) * Vec2::new(1.0, -1.0);
        let ray = match &self.lenses {
            None => self.plain_ray(film, offset, lens),
            Some(lenses) => self.ray_through(lenses, offset, lens),
        };
        CameraRay {
            origin: to_world.transform_point3(ray.origin),
            direction: to_world.transform_vector3(ray.direction).normalize(),
            ..ray
        }
    }

    /// The ray of a camera without lenses but a thin one, in the camera's space.
    #[inline(always)]
    fn plain_ray(&self, film: Vec2, offset: Vec2, lens: Vec2) -> CameraRay {
        let start = (lens * self.lens_radius).extend(0.0);
        // A cone's radius is half a pixel across the ray, narrowed for all that samples of the pixel see of it.
        match self.projection {
            Projection::Perspective(pixel) => {
                let focus = (offset * pixel).extend(-1.0) * self.focus_distance;
                let direction = (focus - start).normalize();
                let spread = NARROWED * 0.5 * pixel.min_element() * -direction.z;
                CameraRay::new(start, direction, -direction.z, Cone { radius: 0.0, spread })
            }
            Projection::Orthographic(pixel) => {
                let place = (offset * pixel).extend(0.0);
                let direction = (Vec3::new(0.0, 0.0, -self.focus_distance) - start).normalize();
                let cone = Cone { radius: NARROWED * 0.5 * pixel.min_element(), spread: 0.0 };
                CameraRay::new(place + start, direction, -direction.z, cone)
            }
            Projection::Spherical(pixel) => {
                let (longitude, latitude) = (offset.x * pixel.x, offset.y * pixel.y);
                let (around, up) = (longitude.sin_cos(), latitude.sin_cos());
                let direction = Vec3::new(around.0 * up.1, up.0, -around.1 * up.1);
                let spread = NARROWED * 0.5 * pixel.min_element() * up.1.abs();
                CameraRay::new(Vec3::ZERO, direction, 1.0, Cone { radius: 0.0, spread })
            }
            Projection::EqualArea(frame) => {
                let map = equal_area_direction(fold_square(film / frame));
                let direction = Vec3::new(map.x, map.z, -map.y);
                let spread = NARROWED * 0.5 * (4.0 * PI / (frame.x * frame.y)).sqrt();
                CameraRay::new(Vec3::ZERO, direction, 1.0, Cone { radius: 0.0, spread })
            }
        }
    }

    /// The ray from the film through lenses, in the camera's space.
    #[inline(never)]
    fn ray_through(&self, lenses: &LensSystem, offset: Vec2, lens: Vec2) -> CameraRay {
        let Some((origin, direction, weight)) = lenses.ray(offset, lens) else {
            return CameraRay {
                weight: 0.0,
                ..CameraRay::new(Vec3::ZERO, Vec3::NEG_Z, 1.0, Cone::default())
            };
        };
        // As of the thin lens in their place.
        let pixel = match self.projection {
            Projection::Perspective(pixel) => pixel.min_element(),
            _ => 0.0,
        };
        let cone = Cone { radius: 0.0, spread: NARROWED * 0.5 * pixel * -direction.z };
        CameraRay { weight, ..CameraRay::new(origin, direction, -direction.z, cone) }
    }
}

impl CameraRay {
    #[inline(always)]
    fn new(origin: Vec3, direction: Vec3, axis_cosine: f32, cone: Cone) -> Self {
        Self { origin, direction, axis_cosine, cone, weight: 1.0 }
    }
}

/// Share of a pixel that a ray's cone covers. A pixel's own samples see all of it: filtering textures over it once
/// more would blur them for nothing. A quarter leaves a picture as sharp as without any filtering, and look-ups no
/// finer than 16 places in the pixel.
const NARROWED: f32 = 0.25;

fn projection(camera: &desc::Camera, frame: Vec2) -> Result<Projection, CameraError> {
    let side = |axis| match axis {
        FrameAxis::Vertical => frame.y,
        FrameAxis::Shorter => frame.min_element(),
    };
    let name = || camera.name.clone();
    // The axis that an angle spans is measured in heights of pixels.
    let pixel = Vec2::new(camera.pixel_aspect, 1.0);
    match camera.projection {
        desc::Projection::Perspective { fov, axis } if fov > 0.0 && fov < PI => {
            Ok(Projection::Perspective(2.0 * (0.5 * fov).tan() / side(axis) * pixel))
        }
        desc::Projection::Perspective { fov, .. } => Err(CameraError::FieldOfView { name: name(), fov }),
        desc::Projection::Orthographic { extent, axis } if extent > 0.0 && extent.is_finite() => {
            Ok(Projection::Orthographic(extent / side(axis) * pixel))
        }
        desc::Projection::Orthographic { extent, .. } => Err(CameraError::Extent { name: name(), extent }),
        desc::Projection::Spherical => Ok(Projection::Spherical(Vec2::new(2.0 * PI, PI) / frame)),
        desc::Projection::EqualArea => Ok(Projection::EqualArea(frame)),
    }
}

fn check_lens(camera: &desc::Camera) -> Result<(), CameraError> {
    let &desc::Camera { lens_radius, focus_distance, .. } = camera;
    let name = camera.name.clone();
    let sharp = focus_distance > 0.0 && focus_distance.is_finite();
    if !(lens_radius == 0.0 || lens_radius > 0.0 && lens_radius.is_finite() && sharp) {
        return Err(CameraError::Lens { name, lens_radius, focus_distance });
    }
    let all_around = matches!(camera.projection, desc::Projection::Spherical | desc::Projection::EqualArea);
    if lens_radius > 0.0 && all_around {
        return Err(CameraError::SphericalLens { name, lens_radius });
    }
    Ok(())
}

/// How far `M^T M` may be from the identity, per entry: room for matrices that went through text or f32 products.
const RIGID_TOLERANCE: f32 = 1e-3;

/// Whether it keeps lengths; it may mirror.
fn is_rigid(transform: &Affine3A) -> bool {
    let m = transform.matrix3;
    let gram = m.transpose() * m - glam::Mat3A::IDENTITY;
    transform.is_finite() && gram.to_cols_array().iter().all(|entry| entry.abs() < RIGID_TOLERANCE)
}

#[cfg(test)]
mod tests;
