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
    /// Something the description can say and the renderer does not draw.
    #[error("camera \"{name}\": only perspective cameras that stand still outside of media are supported")]
    Unsupported {
        /// The camera's name.
        name: String,
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
        let desc::Projection::Perspective { fov: fov_y, axis: desc::FrameAxis::Vertical } = camera.projection
        else {
            return Err(CameraError::Unsupported { name: name() });
        };
        if camera.end_to_world.is_some() || camera.medium.is_some() {
            return Err(CameraError::Unsupported { name: name() });
        }
        if !(fov_y > 0.0 && fov_y < std::f32::consts::PI) {
            return Err(CameraError::FieldOfView { name: name(), fov_y });
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
            pixel_size: 2.0 * (0.5 * fov_y).tan() / height as f32,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Rng;
    use crate::warp;
    use glam::{Mat3, Quat};

    fn described(lens_radius: f32) -> desc::Camera {
        let turn = Quat::from_euler(glam::EulerRot::XYZ, 0.3, -1.2, 0.5);
        let to_world = Affine3A::from_mat3_translation(Mat3::from_quat(turn), Vec3::new(1.0, 2.0, 3.0));
        desc::Camera { lens_radius, focus_distance: 2.5, ..desc::Camera::perspective("test", to_world, 0.8) }
    }

    /// The corners of the frame lie at the tangent of half the angle of view, right is right and up is up.
    #[test]
    fn pinhole_rays_span_the_angle_of_view() {
        let described = described(0.0);
        let camera = Camera::new(&described, 300, 200).expect("a sound camera");
        let to_camera = described.to_world.inverse();
        let tangent = 0.4_f32.tan();
        for (film, expected) in [
            (Vec2::ZERO, Vec2::new(-1.5 * tangent, tangent)),
            (Vec2::new(300.0, 0.0), Vec2::new(1.5 * tangent, tangent)),
            (Vec2::new(150.0, 200.0), Vec2::new(0.0, -tangent)),
        ] {
            let ray = camera.ray(film, Vec2::ZERO);
            assert_eq!(ray.origin, Vec3::new(1.0, 2.0, 3.0));
            let local = to_camera.transform_vector3(ray.direction);
            assert!((local.truncate() / -local.z - expected).length() < 1e-5, "{film}: {local}");
            assert!((ray.axis_cosine + local.z).abs() < 1e-6);
        }
    }

    /// Whatever part of the lens a ray leaves from, it passes the same point of the plane in focus.
    #[test]
    fn lens_rays_meet_in_the_plane_of_focus() {
        let pinhole = Camera::new(&described(0.0), 300, 200).expect("a sound camera");
        let lens = Camera::new(&described(0.2), 300, 200).expect("a sound camera");
        let mut rng = Rng::new(1);
        for _ in 0..1000 {
            let film = rng.next_2d() * Vec2::new(300.0, 200.0);
            let at_focus =
                |ray: CameraRay, start: f32| ray.origin + ray.direction * (start / ray.axis_cosine);
            let sharp = at_focus(pinhole.ray(film, Vec2::ZERO), 2.5);
            let ray = lens.ray(film, warp::disk(rng.next_2d()));
            assert!(ray.origin.distance(Vec3::new(1.0, 2.0, 3.0)) <= 0.2 * 1.0001);
            assert!(at_focus(ray, 2.5).distance(sharp) < 1e-5, "{film}");
        }
    }

    #[test]
    fn cameras_that_make_no_sense_are_refused() {
        let sound = described(0.0);
        let refuse = |camera: &desc::Camera| Camera::new(camera, 4, 4).expect_err("must be refused");
        assert_eq!(Camera::new(&sound, 0, 4).expect_err("no pixels"), CameraError::EmptyFrame(0, 4));
        for fov_y in [0.0, -1.0, f32::NAN, 3.2] {
            let error = refuse(&desc::Camera {
                projection: desc::Projection::Perspective { fov: fov_y, axis: desc::FrameAxis::Vertical },
                ..sound.clone()
            });
            assert!(matches!(error, CameraError::FieldOfView { .. }), "{error}");
        }
        for (lens_radius, focus_distance) in [(-1.0, 1.0), (0.1, 0.0), (f32::NAN, 1.0), (0.1, f32::INFINITY)]
        {
            let error = refuse(&desc::Camera { lens_radius, focus_distance, ..sound.clone() });
            assert!(matches!(error, CameraError::Lens { .. }), "{error}");
        }
        let scaled = desc::Camera { to_world: Affine3A::from_scale(Vec3::splat(2.0)), ..sound };
        assert!(matches!(refuse(&scaled), CameraError::Transform { .. }));
    }
}
