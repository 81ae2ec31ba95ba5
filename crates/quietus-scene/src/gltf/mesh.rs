//! Meshes: one object each, one shape per primitive.

use std::sync::Arc;

use glam::{Vec2, Vec3, Vec4};
use quietus_trace::desc::{Geometry, Mesh, Object, Shape};

use super::document::Document;
use super::material::Materials;
use super::schema::Primitive;
use crate::error::SceneError;

/// Mesh `index`, referred to from `place`, as an object; its shapes are the primitives that have triangles.
pub(super) fn object(
    document: &Document<'_>,
    materials: &mut Materials<'_, '_>,
    index: usize,
    place: &str,
) -> Result<Object, SceneError> {
    let mesh = document.get(&document.root.meshes, index, "meshes", place)?;
    let own = format!("meshes[{index}]");
    let mut shapes = Vec::new();
    for (i, primitive) in mesh.primitives.iter().enumerate() {
        let place = format!("{own}.primitives[{i}]");
        let Some(mesh) = read_primitive(document, primitive, &place)? else { continue };
        let material = materials.get(primitive.material, &format!("{place}.material"))?;
        shapes.push(Shape::new(Geometry::Mesh(Arc::new(mesh)), material));
    }
    let name = if mesh.name.is_empty() { own } else { mesh.name.clone() };
    Ok(Object { name, shapes })
}

/// Reads a primitive; `None`, with a warning, where it has no triangles.
fn read_primitive(
    document: &Document<'_>,
    primitive: &Primitive,
    place: &str,
) -> Result<Option<Mesh>, SceneError> {
    let topology = match primitive.mode {
        4 => Topology::Triangles,
        5 => Topology::Strip,
        6 => Topology::Fan,
        0..=3 => {
            document.warn(place, "points and lines are not supported: the primitive is left out");
            return Ok(None);
        }
        mode => return Err(document.invalid(&format!("{place}.mode"), format!("is {mode}, expected 0 to 6"))),
    };
    let attributes = &primitive.attributes;
    let Some(&position) = attributes.get("POSITION") else {
        document.warn(&format!("{place}.attributes"), "has no POSITION: the primitive is left out");
        return Ok(None);
    };
    if !primitive.targets.is_empty() {
        document.warn(place, "morph targets are not supported: the base shape is drawn");
    }
    let at = |name: &str| format!("{place}.attributes.{name}");
    let positions = document.read_floats(position, &at("POSITION"), &["VEC3"], [0.0; 3])?;
    let count = positions.len();
    let read = Attributes { document, primitive, place, count };
    let mut mesh = Mesh {
        positions: positions.into_iter().map(Vec3::from_array).collect(),
        triangles: triangles(document, primitive, topology, count, place)?,
        normals: read.vectors("NORMAL", &["VEC3"], [0.0; 3], Vec3::from_array)?,
        tangents: Vec::new(),
        uvs: [
            read.vectors("TEXCOORD_0", &["VEC2"], [0.0; 2], Vec2::from_array)?,
            read.vectors("TEXCOORD_1", &["VEC2"], [0.0; 2], Vec2::from_array)?,
        ],
        colors: read.vectors("COLOR_0", &["VEC3", "VEC4"], [1.0; 4], |color| {
            Vec4::from_array(color).clamp(Vec4::ZERO, Vec4::ONE)
        })?,
        ..Mesh::default()
    };
    // Flat normals are what the tracer takes where there are none; tangents are then to be ignored
    // (specification, section 3.7.2.1).
    if !mesh.normals.is_empty() {
        mesh.tangents = read.vectors("TANGENT", &["VEC4"], [0.0; 4], Vec4::from_array)?;
        repair_normals(document, &mut mesh, &at("NORMAL"));
        repair_tangents(document, &mut mesh, &at("TANGENT"));
    }
    Ok((!mesh.triangles.is_empty()).then_some(mesh))
}

/// Reads the attributes of one primitive.
struct Attributes<'a, 'f> {
    document: &'a Document<'f>,
    primitive: &'a Primitive,
    place: &'a str,
    /// Number of vertices.
    count: usize,
}

impl Attributes<'_, '_> {
    /// Attribute `name`, empty where the primitive has none.
    fn vectors<const N: usize, T>(
        &self,
        name: &str,
        kinds: &[&str],
        fill: [f32; N],
        convert: impl Fn([f32; N]) -> T,
    ) -> Result<Vec<T>, SceneError> {
        let Some(&index) = self.primitive.attributes.get(name) else { return Ok(Vec::new()) };
        let place = format!("{}.attributes.{name}", self.place);
        let count = self.document.accessor_count(index, &place)?;
        if count != self.count as u64 {
            let message = format!("has {count} elements, expected {}, as many as POSITION has", self.count);
            return Err(self.document.invalid(&place, message));
        }
        Ok(self.document.read_floats(index, &place, kinds, fill)?.into_iter().map(convert).collect())
    }
}

/// How indices make triangles (specification, section 3.7.2.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Topology {
    Triangles,
    Strip,
    Fan,
}

fn triangles(
    document: &Document<'_>,
    primitive: &Primitive,
    topology: Topology,
    vertices: usize,
    place: &str,
) -> Result<Vec<[u32; 3]>, SceneError> {
    let (indices, place) = match primitive.indices {
        Some(index) => {
            let place = format!("{place}.indices");
            let indices = document.read_indices(index, &place)?;
            if let Some(at) = indices.iter().position(|&index| index as usize >= vertices) {
                let message = format!("index {at} is {}, but there are {vertices} vertices", indices[at]);
                return Err(document.invalid(&place, message));
            }
            (indices, place)
        }
        None => {
            let count =
                u32::try_from(vertices).map_err(|_| document.invalid(place, "has over 2^32 vertices"))?;
            ((0..count).collect(), format!("{place}.attributes.POSITION"))
        }
    };
    let count = indices.len();
    if topology == Topology::Triangles && count % 3 != 0 {
        return Err(document.invalid(&place, format!("{count} corners, expected a multiple of 3")));
    }
    document.claim_geometry(&place, count as u64 * size_of::<[u32; 3]>() as u64)?;
    let corners = indices.windows(3).enumerate();
    Ok(match topology {
        Topology::Triangles => indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
        // Every other triangle of a strip is turned, so that all face the same side.
        Topology::Strip => {
            corners.map(|(i, t)| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[0], t[2], t[1]] }).collect()
        }
        Topology::Fan => indices.windows(2).skip(1).map(|t| [t[0], t[1], indices[0]]).collect(),
    })
}

/// Brings normals to unit length; those that have no direction become the mean of their triangles' normals.
fn repair_normals(document: &Document<'_>, mesh: &mut Mesh, place: &str) {
    let units: Vec<_> = mesh.normals.iter().map(|normal| normal.try_normalize()).collect();
    let broken = units.iter().filter(|unit| unit.is_none()).count();
    if broken > 0 {
        let message = format!("{broken} normals have no direction: the triangles' own are taken there");
        document.warn(place, message);
    }
    let smooth = if broken > 0 { vertex_normals(mesh) } else { Vec::new() };
    mesh.normals = units.into_iter().enumerate().map(|(i, unit)| unit.unwrap_or_else(|| smooth[i])).collect();
}

/// Means of the adjacent triangles' normals weighted by area; +y at vertices without any area.
fn vertex_normals(mesh: &Mesh) -> Vec<Vec3> {
    let mut sums = vec![Vec3::ZERO; mesh.positions.len()];
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
        let normal = (b - a).cross(c - a);
        triangle.iter().for_each(|&i| sums[i as usize] += normal);
    }
    sums.into_iter().map(|sum| sum.try_normalize().unwrap_or(Vec3::Y)).collect()
}

/// Brings tangents to unit length and signs to 1 or -1; drops them, to be computed, where one has no direction.
fn repair_tangents(document: &Document<'_>, mesh: &mut Mesh, place: &str) {
    let unit = |tangent: &Vec4| {
        let direction = tangent.truncate().try_normalize()?;
        Some(direction.extend(if tangent.w < 0.0 { -1.0 } else { 1.0 }))
    };
    let units: Option<Vec<_>> = mesh.tangents.iter().map(unit).collect();
    if units.is_none() {
        document.warn(place, "some tangents have no direction: all are computed from TEXCOORD_0");
    }
    mesh.tangents = units.unwrap_or_default();
}
