//! Scenes of pbrt written in place, each for one thing that its reader has to get right.

mod cameras;
mod lights;
mod materials;
mod shapes;

use std::f32::consts::PI;
use std::path::Path;

use glam::{Vec2, Vec3};
use quietus_scene::{Loaded, load, load_bytes};
use quietus_trace::desc::{
    Alpha, Camera, CurveKind, Density, EnvironmentLayout, FrameAxis, Geometry, Glow, HairColor, Interior,
    Light, Mapping, Material, Mesh, Metal, NoisePattern, PictureSpread, Portal, Projection, Quadric,
    RoughnessScale, SceneDesc, Shape, Surface, Texels, Texture, Wrap,
};
use quietus_trace::filter::FilterShape;

fn read(text: &str) -> Loaded {
    load_bytes(Path::new("test.pbrt"), text.as_bytes()).unwrap_or_else(|error| panic!("{error}"))
}

/// What stands after `WorldBegin`.
fn world(text: &str) -> SceneDesc {
    read(&format!("WorldBegin\n{text}")).scene
}

/// What stands before it.
fn header(text: &str) -> SceneDesc {
    read(&format!("{text}\nWorldBegin")).scene
}

fn camera(text: &str) -> Camera {
    header(text).cameras.remove(0)
}

fn material(text: &str) -> Material {
    let scene = world(&format!("{text}\nShape \"sphere\""));
    scene.materials[shapes(&scene)[0].material.0 as usize].clone()
}

fn shapes(scene: &SceneDesc) -> Vec<&Shape> {
    scene.objects.iter().flat_map(|object| &object.shapes).collect()
}

fn mesh(shape: &Shape) -> &Mesh {
    let Geometry::Mesh(mesh) = &shape.geometry else { panic!("expected a mesh, found {:?}", shape.geometry) };
    mesh
}

fn close(a: Vec3, b: Vec3) -> bool {
    a.abs_diff_eq(b, 1e-5)
}

const TRIANGLE: &str = "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]";

/// The direction at (u, v) of a picture with latitude and longitude, as `EnvironmentLayout` and `Projection` define it.
fn lat_long(u: f32, v: f32) -> Vec3 {
    let (longitude, polar) = (2.0 * PI * (u - 0.5), PI * v);
    Vec3::new(polar.sin() * longitude.sin(), polar.cos(), -polar.sin() * longitude.cos())
}

/// A float map of one row of `values` over another.
fn float_map(path: &Path, width: usize, values: &[f32]) {
    let mut bytes = format!("Pf\n{width} {}\n-1\n", values.len() / width).into_bytes();
    for row in values.chunks(width).rev() {
        bytes.extend(row.iter().flat_map(|value| value.to_le_bytes()));
    }
    std::fs::write(path, bytes).expect("a writable folder");
}
