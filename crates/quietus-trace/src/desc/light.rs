//! Lights without a surface, the environment, and media.

use std::sync::Arc;

use glam::{Mat3, Vec2, Vec3};

use super::{Image, Variation};

/// A light without a surface.
#[derive(Clone, Debug)]
pub enum Light {
    /// Shines to all sides.
    Point {
        /// Where it stands.
        position: Vec3,
        /// Radiant intensity, per steradian.
        intensity: Vec3,
    },
    /// A cone of light, fading between the inner and the outer angle.
    Spot {
        /// Where it stands.
        position: Vec3,
        /// Where it looks, of unit length.
        direction: Vec3,
        /// Radiant intensity inside the inner cone.
        intensity: Vec3,
        /// Half angle of the full cone.
        inner_angle: f32,
        /// Half angle at which it has fallen to 0.
        outer_angle: f32,
        /// How it fades in between.
        falloff: SpotFalloff,
    },
    /// Parallel light.
    Directional {
        /// Where it shines to, of unit length.
        direction: Vec3,
        /// Irradiance on a surface facing it.
        irradiance: Vec3,
    },
    /// A picture that shines from a point.
    Picture {
        /// Where it stands.
        position: Vec3,
        /// From directions in the world to those of the picture's space.
        from_world: Mat3,
        /// Multiplies the picture, which is radiant intensity.
        intensity: Vec3,
        /// The picture, looked up texel by texel.
        image: Arc<Image>,
        /// Where it goes.
        spread: PictureSpread,
    },
}

/// Which directions the texels of [`Light::Picture`] belong to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PictureSpread {
    /// All of them, laid out as [`EnvironmentLayout::EqualArea`].
    AllAround,
    /// Those through a window at z = 1 around the z axis. Columns go towards +x, rows towards +y.
    Window {
        /// Half its width and height.
        half: Vec2,
    },
}

/// How a spot light fades from its inner to its outer angle, over `t` from 1 to 0, linear in the cosine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SpotFalloff {
    /// `t^2`: KHR_lights_punctual.
    #[default]
    Square,
    /// `t^2 (3 - 2 t)`: pbrt-v4.
    Smooth,
}

/// Layout of an environment map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EnvironmentLayout {
    /// Row 0 looks up, +y; the middle column looks along -z, columns run towards +x.
    #[default]
    LatLong,
    /// The equal-area octahedral square of pbrt-v4 (Clarberg 2008), pole +z.
    EqualArea,
}

/// Light from infinitely far away, all around.
#[derive(Clone, Debug)]
pub struct Environment {
    /// A map of all directions; a constant where absent.
    pub image: Option<Arc<Image>>,
    /// How the map is laid out.
    pub layout: EnvironmentLayout,
    /// Multiplies the map, or is the constant radiance.
    pub scale: Vec3,
    /// Rotation from the map's space to the world.
    pub to_world: Mat3,
    /// The only opening through which its light is seen; everywhere it is not hidden where absent.
    pub portal: Option<Portal>,
}

/// A rectangle in the world. Light is seen through it in directions that have a part along the cross product of its
/// edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Portal {
    /// One of its corners.
    pub corner: Vec3,
    /// From there to those next to it: perpendicular to each other, with a length above 0.
    pub edges: [Vec3; 2],
}

/// A medium, the same everywhere unless it varies. Coefficients are per metre.
#[derive(Clone, Debug, PartialEq)]
pub struct Medium {
    /// For messages and `quietus info`.
    pub name: String,
    /// Absorption coefficient, at least 0.
    pub absorption: Vec3,
    /// Scattering coefficient, at least 0.
    pub scattering: Vec3,
    /// Emitted radiance times the absorption coefficient is the emission per metre, at least 0.
    pub emission: Vec3,
    /// Henyey-Greenstein asymmetry, in -1..1.
    pub g: f32,
    /// How it differs from place to place, if it does.
    pub variation: Option<Arc<Variation>>,
}
