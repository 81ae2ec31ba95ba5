//! The camera: a place on the film and a place on the lens become a ray.

use glam::{Affine3A, Vec2, Vec3};
use thiserror::Error;

use crate::desc;

/// Why a camera cannot be used.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CameraError {
    /// Nothing to see.
    #[error("the frame is {0}x{1} pixels; both sides must be at least 1")]
    EmptyFrame(u32, u32),
    /// `fov_y` outside of 0..pi.
    #[error(
        "camera \"{name}\": the vertical field of view is {fov_y} radians; expected more than 0 and less than pi"
    )]
    FieldOfView {
        /// The camera's name.
        name: String,
        /// What it said.
        fov_y: f32,
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
    /// `to_world` scales, shears or is not finite.
    #[error("camera \"{name}\": its transform is not a rotation with translation")]
    Transform {
        /// The camera's name.
        name: String,
    },
}

/// A perspective camera with a thin lens, ready for one frame size.
#[derive(Clone, Debug)]
pub struct Camera {
    to_world: Affine3A,
    /// Viewing axis in the world, of unit length.
    forward: Vec3,
    /// From pixels right of and below the frame's centre to camera space at distance 1.
    pixel_size: f32,
    half_frame: Vec2,
    lens_radius: f32,
    focus_distance: f32,
}

/// A ray that leaves the camera.
#[derive(Clone, Copy, Debug)]
pub struct CameraRay {
    /// A point on the lens, in the world.
    pub origin: Vec3,
    /// Of unit length, in the world.
    pub direction: Vec3,
    /// Cosine between the direction and the viewing axis: distance times this is depth.
    pub axis_cosine: f32,
}

impl Camera {
    /// Prepares `camera` for a frame of `width` x `height` square pixels.
    ///
    /// # Errors
    /// A frame without pixels, a field of view outside of 0..pi, a lens without a positive focus distance, a
    /// transform that is not orthonormal.
    pub fn new(camera: &desc::Camera, width: u32, height: u32) -> Result<Self, CameraError> {
        let name = || camera.name.clone();
        if width == 0 || height == 0 {
            return Err(CameraError::EmptyFrame(width, height));
        }
        if !(camera.fov_y > 0.0 && camera.fov_y < std::f32::consts::PI) {
            return Err(CameraError::FieldOfView { name: name(), fov_y: camera.fov_y });
        }
        let (lens_radius, focus_distance) = (camera.lens_radius, camera.focus_distance);
        let sharp = focus_distance > 0.0 && focus_distance.is_finite();
        if !(lens_radius == 0.0 || lens_radius > 0.0 && lens_radius.is_finite() && sharp) {
            return Err(CameraError::Lens { name: name(), lens_radius, focus_distance });
        }
        if !is_rigid(&camera.to_world) {
            return Err(CameraError::Transform { name: name() });
        }
        Ok(Self {
            to_world: camera.to_world,
            forward: -Vec3::from(camera.to_world.matrix3.z_axis),
            pixel_size: 2.0 * (0.5 * camera.fov_y).tan() / height as f32,
            half_frame: 0.5 * Vec2::new(width as f32, height as f32),
            lens_radius,
            // A pinhole may come without a distance; any one gives the same ray.
            focus_distance: if lens_radius > 0.0 { focus_distance } else { 1.0 },
        })
    }

    /// Whether the lens has an extent.
    #[inline]
    pub(crate) fn has_lens(&self) -> bool {
        self.lens_radius > 0.0
    }

    /// The ray through `film`, in pixels from the frame's top left corner, and through the point of the lens that
    /// `lens`, in the unit disk, stands for.
    #[inline]
    pub fn ray(&self, film: Vec2, lens: Vec2) -> CameraRay {
        let offset = (film - self.half_frame) * self.pixel_size;
        let focus = Vec3::new(offset.x, -offset.y, -1.0) * self.focus_distance;
        let start = (lens * self.lens_radius).extend(0.0);
        let direction = self.to_world.transform_vector3(focus - start).normalize();
        CameraRay {
            origin: self.to_world.transform_point3(start),
            direction,
            axis_cosine: direction.dot(self.forward),
        }
    }
}

/// How far `M^T M` may be from the identity, per entry: room for matrices that went through text or f32 products.
const RIGID_TOLERANCE: f32 = 1e-3;

fn is_rigid(transform: &Affine3A) -> bool {
    let m = transform.matrix3;
    let gram = m.transpose() * m - glam::Mat3A::IDENTITY;
    transform.is_finite() && gram.to_cols_array().iter().all(|entry| entry.abs() < RIGID_TOLERANCE)
}
