//! Geometry: objects, their shapes, and where they are placed.

use std::sync::Arc;

use glam::{Affine3A, Vec2, Vec3, Vec4};

use super::{MaterialId, MediumId, ObjectId};

/// Shapes that move together.
#[derive(Clone, Debug, Default)]
pub struct Object {
    /// For messages and `quietus info`.
    pub name: String,
    /// Its parts.
    pub shapes: Vec<Shape>,
}

/// One part of an object.
#[derive(Clone, Debug)]
pub struct Shape {
    /// Its form.
    pub geometry: Geometry,
    /// Its material.
    pub material: MaterialId,
    /// The media on its sides, where it is the border between them.
    pub media: Option<MediumInterface>,
    /// Whether front and back are exchanged: the geometric normal points to the other side.
    pub flipped: bool,
}

impl Shape {
    /// A shape that is no border between media, its front where its geometry says.
    pub const fn new(geometry: Geometry, material: MaterialId) -> Self {
        Self { geometry, material, media: None, flipped: false }
    }
}

/// The media on the two sides of a surface; `None` is vacuum.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MediumInterface {
    /// Behind the surface, where its geometric normal does not point.
    pub inside: Option<MediumId>,
    /// In front of it.
    pub outside: Option<MediumId>,
}

/// The form of a shape, in object space.
#[derive(Clone, Debug)]
pub enum Geometry {
    /// Triangles.
    Mesh(Arc<Mesh>),
    /// A sphere, its normal pointing outwards.
    Sphere {
        /// Its centre.
        center: Vec3,
        /// Its radius, above 0.
        radius: f32,
    },
    /// A part of a sphere, disk or cylinder around the z axis.
    Quadric(Quadric),
    /// Bilinear patches.
    Patches(Arc<PatchMesh>),
    /// Thin tubes or ribbons along cubic curves.
    Curves(Arc<Curves>),
}

/// Surfaces of revolution around the z axis, swept from the angle 0 (+x) to `phi_max` (towards +y), with
/// texture coordinates as in pbrt-v4: u along phi, v along the profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quadric {
    /// The part of a sphere around the origin between two heights.
    PartialSphere {
        /// Radius.
        radius: f32,
        /// Lowest z.
        z_min: f32,
        /// Highest z.
        z_max: f32,
        /// Swept angle, in radians, up to 2 pi.
        phi_max: f32,
    },
    /// A disk or ring, its normal +z.
    Disk {
        /// Its z.
        height: f32,
        /// Outer radius.
        radius: f32,
        /// Inner radius; 0 for none.
        inner_radius: f32,
        /// Swept angle, in radians, up to 2 pi.
        phi_max: f32,
    },
    /// An open cylinder, its normal pointing outwards.
    Cylinder {
        /// Radius.
        radius: f32,
        /// Lowest z.
        z_min: f32,
        /// Highest z.
        z_max: f32,
        /// Swept angle, in radians, up to 2 pi.
        phi_max: f32,
    },
}

/// Bilinear patches that share vertices. Vectors of vertex data are either empty or as long as `positions`.
#[derive(Clone, Debug, Default)]
pub struct PatchMesh {
    /// Vertices.
    pub positions: Vec<Vec3>,
    /// Four corners each: p(0,0), p(1,0), p(0,1), p(1,1) of p(u, v). The geometric normal points along dp/du x dp/dv.
    pub patches: Vec<[u32; 4]>,
    /// Shading normals, of unit length.
    pub normals: Vec<Vec3>,
    /// Texture coordinates.
    pub uvs: Vec<Vec2>,
}

/// Cubic Bezier segments of one kind.
#[derive(Clone, Debug, Default)]
pub struct Curves {
    /// How they look.
    pub kind: CurveKind,
    /// The segments.
    pub segments: Vec<CurveSegment>,
}

/// How a curve looks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CurveKind {
    /// A strip that faces every ray.
    #[default]
    Flat,
    /// A strip shaded as a round tube.
    Cylinder,
    /// A strip that faces along its normals.
    Ribbon,
}

/// One segment. The texture coordinate u runs along it, v across.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurveSegment {
    /// Control points of the cubic Bezier curve.
    pub points: [Vec3; 4],
    /// Width (not radius) at both ends, linear between.
    pub widths: [f32; 2],
    /// u at both ends, for curves cut into several segments.
    pub u_range: [f32; 2],
    /// Normals at both ends, of unit length; only looked at for ribbons.
    pub normals: [Vec3; 2],
}

/// Indexed triangles. Vectors of vertex data are either empty or as long as `positions`.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Vertices.
    pub positions: Vec<Vec3>,
    /// Three vertices each; counter-clockwise seen from the front (the side the geometric normal points to).
    pub triangles: Vec<[u32; 3]>,
    /// Shading normals, of unit length.
    pub normals: Vec<Vec3>,
    /// Tangents, w is the sign of the bitangent; computed from `uvs[0]` when needed and absent.
    pub tangents: Vec<Vec4>,
    /// Two sets of texture coordinates.
    pub uvs: [Vec<Vec2>; 2],
    /// Linear vertex colours with alpha.
    pub colors: Vec<Vec4>,
    /// Where the vertices are when the shutter closes; `positions` is where they are when it opens. Vertices move
    /// along straight lines. Empty for a mesh that keeps its form.
    pub end_positions: Vec<Vec3>,
    /// Shading normals when the shutter closes; as long as `normals` where `end_positions` is there.
    pub end_normals: Vec<Vec3>,
}

/// An object placed in the world. Mirroring transforms keep the surface's front its front.
#[derive(Clone, Copy, Debug)]
pub struct Instance {
    /// What.
    pub object: ObjectId,
    /// Where, when the shutter opens; invertible.
    pub to_world: Affine3A,
    /// Where, when the shutter closes, if it moves: translation and scale change linearly, rotation along the
    /// shortest arc.
    pub end_to_world: Option<Affine3A>,
}

impl Instance {
    /// An object that stands still.
    pub const fn still(object: ObjectId, to_world: Affine3A) -> Self {
        Self { object, to_world, end_to_world: None }
    }

    /// Where it is when the shutter closes, if that is somewhere else.
    pub fn motion(&self) -> Option<&Affine3A> {
        self.end_to_world.as_ref().filter(|&end| *end != self.to_world)
    }
}
