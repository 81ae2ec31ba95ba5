//! Cameras, and what a scene file wishes for its picture.

use std::sync::Arc;

use glam::{Affine3A, Vec2, Vec3};

use super::MediumId;
use crate::filter::Filter;

/// A camera.
#[derive(Clone, Debug)]
pub struct Camera {
    /// What `--camera` calls it.
    pub name: String,
    /// From camera space (looks along -z, +y up, +x right) to the world when the shutter opens; orthonormal with
    /// translation. It may mirror.
    pub to_world: Affine3A,
    /// The same when the shutter closes, if the camera moves.
    pub end_to_world: Option<Affine3A>,
    /// How directions fall on the film.
    pub projection: Projection,
    /// Where the middle of the frame lies beside the optical axis, to the right and upwards, in widths and heights of the
    /// frame; for perspective and orthographic cameras.
    pub shift: Vec2,
    /// Width of a pixel over its height on the film, for the same cameras.
    pub pixel_aspect: f32,
    /// What stands before the film in place of one thin lens. `projection`, `lens_radius` and `focus_distance` then say
    /// roughly what it shows, and `to_world` where the middle of the film is.
    pub lenses: Option<Arc<Lenses>>,
    /// Width over height it was made for; a hint for the default picture size.
    pub aspect: Option<f32>,
    /// Radius of the lens; 0 is a pinhole.
    pub lens_radius: f32,
    /// Distance along the optical axis at which things are sharp.
    pub focus_distance: f32,
    /// The medium it stands in; `None` is vacuum.
    pub medium: Option<MediumId>,
}

impl Camera {
    /// A pinhole camera that stands still in a vacuum, with a vertical angle of view.
    pub fn perspective(name: impl Into<String>, to_world: Affine3A, fov_y: f32) -> Self {
        Self {
            name: name.into(),
            to_world,
            end_to_world: None,
            projection: Projection::Perspective { fov: fov_y, axis: FrameAxis::Vertical },
            shift: Vec2::ZERO,
            pixel_aspect: 1.0,
            lenses: None,
            aspect: None,
            lens_radius: 0.0,
            focus_distance: 1.0,
            medium: None,
        }
    }
}

/// Lenses of glass before a film, all of them round and around one axis. Lengths are in world units. The weight of a ray
/// is the irradiance of the film for a radiance of 1 (Kolb, Mitchell and Hanrahan 1995, "A Realistic Camera Model for
/// Computer Graphics").
#[derive(Clone, Debug, PartialEq)]
pub struct Lenses {
    /// From the front to the film.
    pub surfaces: Vec<LensSurface>,
    /// Height of the film.
    pub film_height: f32,
    /// Half the diagonal of the film: points further off see as much as those there.
    pub film_radius: f32,
    /// What the stop lets through, over the square around its opening; it is round otherwise.
    pub aperture: Option<Aperture>,
}

/// One surface of a lens, or the stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensSurface {
    /// Where it crosses the axis: how far before the film.
    pub place: f32,
    /// Radius of its sphere: above 0 where the middle lies towards the film, below 0 where it lies towards what is
    /// seen, 0 for the stop.
    pub curvature: f32,
    /// Radius of its rim.
    pub rim: f32,
    /// Index of refraction between it and the next one, towards the film.
    pub index: f32,
}

/// A picture of what an opening lets through.
#[derive(Clone, Debug, PartialEq)]
pub struct Aperture {
    /// Columns and rows.
    pub size: [u32; 2],
    /// Factors of light, row by row from the top; columns to the right.
    pub weights: Vec<f32>,
}

/// How directions fall on the film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Straight lines stay straight.
    Perspective {
        /// Angle of view of the whole frame along `axis`, in 0..pi.
        fov: f32,
        /// What the angle spans.
        axis: FrameAxis,
    },
    /// Parallel rays.
    Orthographic {
        /// Extent of the frame along `axis`, in world units.
        extent: f32,
        /// What the extent spans.
        axis: FrameAxis,
    },
    /// A whole sphere of directions, columns along longitude: the frame's middle looks along -z, the top to +y.
    Spherical,
    /// A whole sphere of directions, every pixel as much of it as any other: the octahedral square of Clarberg 2008, whose
    /// middle looks to +y; columns run towards +x, rows towards -z.
    EqualArea,
}

/// Which side of the frame an angle or extent spans.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FrameAxis {
    /// The height.
    #[default]
    Vertical,
    /// The shorter of width and height.
    Shorter,
}

/// What a scene file says of its picture. The command line wins.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PictureDefaults {
    /// Width and height in pixels.
    pub size: Option<[u32; 2]>,
    /// Part to draw, `[x0, x1, y0, y1]` in 0..1 of the frame, y downwards.
    pub crop: Option<[f32; 4]>,
    /// What pixel values are multiplied by: exposure of the film; 1 by default.
    pub exposure: Option<Vec3>,
    /// Samples per pixel.
    pub samples: Option<u32>,
    /// Path segments from the camera: 1 shows emitters seen directly.
    pub max_depth: Option<u32>,
    /// Reconstruction filter.
    pub filter: Option<Filter>,
    /// Largest value of a sample's component before it enters the film.
    pub max_component: Option<f32>,
}
