//! Scenes by name.

use std::path::Path;

use anyhow::{Context, Result};
use glam::{Affine3A, Mat3, Vec3};
use quietus_trace::desc::{
    Alpha, Camera, ColorParam, Environment, EnvironmentLayout, Geometry, Instance, Material, MaterialId,
    Mesh, Object, ObjectId, SceneDesc, Shape, Surface,
};

use crate::common;

/// The scene built in, the bench's lump, or a file.
pub(crate) fn load(name: &str) -> Result<SceneDesc> {
    match name {
        "embedded" => Ok(quietus_scene::embedded()),
        "lump" => Ok(lump()),
        file => {
            Ok(quietus_scene::load(Path::new(file)).with_context(|| format!("cannot read {file}"))?.scene)
        }
    }
}

/// The kernel bench's bumpy sphere of 1.31 million triangles under a constant sky and one square lamp.
fn lump() -> SceneDesc {
    let lump = common::Scene::lump();
    let [eye, target] = lump.camera;
    let back = (eye - target).normalize();
    let right = Vec3::Y.cross(back).normalize();
    let turn = Mat3::from_cols(right, back.cross(right), back);
    let [corner, u, v] = lump.light;
    let lamp = Mesh {
        // Facing down.
        positions: vec![corner, corner + u, corner + u + v, corner + v],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    let shapes = vec![
        Shape::new(Geometry::Mesh(lump.mesh), MaterialId(0)),
        Shape::new(Geometry::Mesh(lamp.into()), MaterialId(1)),
    ];
    SceneDesc {
        materials: vec![material("plaster", 0.6, 0.0), material("lamp", 0.0, 20.0)],
        objects: vec![Object { name: "lump".into(), shapes }],
        instances: vec![Instance::still(ObjectId(0), Affine3A::IDENTITY)],
        environment: Some(Environment {
            image: None,
            layout: EnvironmentLayout::LatLong,
            scale: Vec3::new(0.4, 0.5, 0.7),
            to_world: Mat3::IDENTITY,
            portal: None,
        }),
        cameras: vec![Camera::perspective(
            "main",
            Affine3A::from_mat3_translation(turn, eye),
            55f32.to_radians(),
        )],
        ..SceneDesc::default()
    }
}

fn material(name: &str, albedo: f32, emission: f32) -> Material {
    Material {
        name: name.into(),
        surface: Surface::Diffuse { reflectance: ColorParam::constant(Vec3::splat(albedo)) },
        emission: ColorParam::constant(Vec3::splat(emission)),
        emission_two_sided: false,
        normal_map: None,
        bump: None,
        alpha: Alpha::Opaque,
    }
}
