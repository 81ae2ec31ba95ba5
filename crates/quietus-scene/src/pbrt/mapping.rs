//! Where on surfaces textures lie.

use glam::{Affine2, Affine3A, DAffine3, DVec3, Vec2, Vec3};
use quietus_trace::desc::{Mapping, Wrap};

use super::draft::TextureEntity;
use super::fault::{Fault, Result};
use super::params::{Kind, Params};
use super::transform::single;

pub(super) fn wrap(params: &Params) -> Result<Wrap> {
    Ok(match params.choice("wrap", &["repeat", "black", "clamp", "octahedralsphere"])? {
        "black" => Wrap::Black,
        "clamp" => Wrap::Clamp,
        "octahedralsphere" => Wrap::Octahedral,
        _ => Wrap::Repeat,
    })
}

/// From coordinates that grow upwards to those of pictures, whose rows go downwards.
pub(super) fn upwards(transform: Affine2) -> Affine2 {
    Affine2::from_scale_angle_translation(Vec2::new(1.0, -1.0), 0.0, Vec2::Y) * transform
}

/// From the world to the space in which the texture was defined.
pub(super) fn from_world(texture: &TextureEntity) -> DAffine3 {
    texture.to_world.0[0].inverse()
}

fn uv_transform(params: &Params) -> Result<Affine2> {
    let scale = Vec2::new(params.float("uscale", 1.0)?, params.float("vscale", 1.0)?);
    let offset = Vec2::new(params.float("udelta", 0.0)?, params.float("vdelta", 0.0)?);
    Ok(Affine2::from_scale_angle_translation(scale, 0.0, offset))
}

/// Where the squares of a checkerboard lie.
pub(super) fn board_mapping(texture: &TextureEntity) -> Result<Mapping> {
    let params = &texture.entity.params;
    match params.integer_option("dimension")?.unwrap_or(2) {
        2 => mapping(texture),
        3 => Ok(Mapping::Solid { from_world: single(from_world(texture)) }),
        other => {
            let message = format!("\"dimension\" of a checkerboard is {other}, expected 2 or 3");
            Err(Fault::invalid(params.place_of("dimension"), message))
        }
    }
}

pub(super) fn mapping(texture: &TextureEntity) -> Result<Mapping> {
    let params = &texture.entity.params;
    let from_world = from_world(texture);
    Ok(match params.choice("mapping", &["uv", "spherical", "cylindrical", "planar"])? {
        "uv" => Mapping::Uv { set: 0, transform: uv_transform(params)? },
        "spherical" => Mapping::Spherical { from_world: single(from_world) },
        // pbrt-v4 counts the angle from -x here.
        "cylindrical" => {
            let turned = DAffine3::from_scale(DVec3::new(-1.0, -1.0, 1.0)) * from_world;
            Mapping::Cylindrical { from_world: single(turned) }
        }
        _ => Mapping::Planar {
            from_world: single(from_world),
            axes: [params.vec3("v1", Kind::Vector3, Vec3::X)?, params.vec3("v2", Kind::Vector3, Vec3::Y)?],
            offset: Vec2::new(params.float("udelta", 0.0)?, params.float("vdelta", 0.0)?),
        },
    })
}

/// Where texels lie: as [`mapping`], with the second coordinate going downwards.
pub(super) fn picture_mapping(texture: &TextureEntity) -> Result<Mapping> {
    let then = |first: Affine3A, scale: Vec3, offset: Vec3| {
        Affine3A::from_scale_rotation_translation(scale, glam::Quat::IDENTITY, offset) * first
    };
    Ok(match mapping(texture)? {
        Mapping::Uv { set, transform } => Mapping::Uv { set, transform: upwards(transform) },
        Mapping::Planar { from_world, axes: [u, v], offset } => {
            Mapping::Planar { from_world, axes: [u, -v], offset: Vec2::new(offset.x, 1.0 - offset.y) }
        }
        // A mirrored angle goes the other way round.
        Mapping::Spherical { from_world } => {
            Mapping::Spherical { from_world: then(from_world, Vec3::new(1.0, -1.0, 1.0), Vec3::ZERO) }
        }
        Mapping::Cylindrical { from_world } => {
            Mapping::Cylindrical { from_world: then(from_world, Vec3::new(1.0, 1.0, -1.0), Vec3::Z) }
        }
        solid @ Mapping::Solid { .. } => solid,
    })
}
