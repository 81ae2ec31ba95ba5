//! Meshes: one figure each, one part per primitive, with all that may bend it.

use std::sync::Arc;

use glam::{Vec2, Vec3, Vec4};
use quietus_trace::desc::{MaterialId, MediumInterface, Mesh};

use super::deform::Target;
use super::document::Document;
use super::draco::Compressed;
use super::material::Materials;
use super::schema::{self, Primitive};
use super::skin::Influences;
use super::strokes::Strokes;
use crate::error::SceneError;

/// A mesh of the file.
#[derive(Clone, Debug)]
pub(super) struct Figure {
    pub name: String,
    /// The primitives that have triangles, points or lines.
    pub parts: Vec<Part>,
    /// Weights of its morph targets where nothing else is said.
    pub weights: Vec<f32>,
}

/// A primitive.
#[derive(Clone, Debug)]
pub(super) struct Part {
    /// Its rest shape.
    pub mesh: Arc<Mesh>,
    pub material: MaterialId,
    /// What is inside of it.
    pub media: Option<MediumInterface>,
    /// Morph targets, as many as the figure has weights.
    pub targets: Vec<Target>,
    /// How it hangs on joints; empty where it does not.
    pub influences: Influences,
    /// Points or lines, until they have triangles around them.
    pub strokes: Option<Strokes>,
}

/// A primitive as it was read, without its morph targets.
struct Rest {
    mesh: Mesh,
    material: MaterialId,
    influences: Influences,
    strokes: Option<Strokes>,
}

/// Reads mesh `index`, referred to from `place`; how it hangs on joints only where it is `skinned`.
pub(super) fn figure(
    document: &Document<'_>,
    materials: &mut Materials<'_, '_>,
    index: usize,
    skinned: bool,
    place: &str,
) -> Result<Figure, SceneError> {
    let mesh = document.get(&document.root.meshes, index, "meshes", place)?;
    let own = format!("meshes[{index}]");
    let weights = rest_weights(document, mesh, &own)?;
    let mut parts = Vec::new();
    for (i, primitive) in mesh.primitives.iter().enumerate() {
        let place = format!("{own}.primitives[{i}]");
        if primitive.targets.len() != weights.len() {
            let (found, expected) = (primitive.targets.len(), weights.len());
            let message = format!("has {found} morph targets, expected {expected} as in the first primitive");
            return Err(document.invalid(&place, message));
        }
        let rest = read_primitive(document, materials, primitive, skinned, &place)?;
        let Some(Rest { mesh, material, influences, strokes }) = rest else { continue };
        let targets = targets(document, primitive, &mesh, &place)?;
        let media = materials.media_of(material);
        parts.push(Part { mesh: Arc::new(mesh), material, media, targets, influences, strokes });
    }
    let name = if mesh.name.is_empty() { own } else { mesh.name.clone() };
    Ok(Figure { name, parts, weights })
}

/// The mesh's own weights, one per target of its first primitive; 0 where it does not say.
fn rest_weights(document: &Document<'_>, mesh: &schema::Mesh, own: &str) -> Result<Vec<f32>, SceneError> {
    let count = mesh.primitives.first().map_or(0, |primitive| primitive.targets.len());
    match mesh.weights.is_empty() {
        true => Ok(vec![0.0; count]),
        false => check_weights(document, mesh.weights.clone(), count, own),
    }
}

/// `weights`, which stand in `own`, if they are as many as there are targets and finite.
pub(super) fn check_weights(
    document: &Document<'_>,
    weights: Vec<f32>,
    targets: usize,
    own: &str,
) -> Result<Vec<f32>, SceneError> {
    let place = format!("{own}.weights");
    if weights.len() != targets {
        let message = format!("has {} numbers, but the mesh has {targets} morph targets", weights.len());
        return Err(document.invalid(&place, message));
    }
    match weights.iter().all(|weight| weight.is_finite()) {
        true => Ok(weights),
        false => Err(document.invalid(&place, "expected finite numbers")),
    }
}

fn targets(
    document: &Document<'_>,
    primitive: &Primitive,
    mesh: &Mesh,
    place: &str,
) -> Result<Vec<Target>, SceneError> {
    let targets = primitive.targets.iter().enumerate().map(|(i, attributes)| {
        let place = format!("{place}.targets[{i}]");
        let others =
            attributes.keys().filter(|name| !["POSITION", "NORMAL", "TANGENT"].contains(&name.as_str()));
        if others.count() > 0 {
            document.warn(&place, "changes more than positions, normals and tangents: only those are drawn");
        }
        let count = mesh.positions.len();
        let read = Attributes { document, attributes, place: &place, count, compressed: None };
        let vectors = |name| read.vectors(name, &["VEC3"], [0.0; 3], Vec3::from_array);
        // What the mesh itself lacks is not drawn either.
        Ok(Target {
            positions: vectors("POSITION")?,
            normals: if mesh.normals.is_empty() { Vec::new() } else { vectors("NORMAL")? },
            tangents: if mesh.tangents.is_empty() { Vec::new() } else { vectors("TANGENT")? },
        })
    });
    targets.collect()
}

/// Reads how the vertices hang on joints, from up to two sets of four.
fn influences(read: &Attributes<'_, '_>) -> Result<Influences, SceneError> {
    let document = read.document;
    let at = |name: &str| format!("{}.{name}", read.place);
    let mut sets = Vec::new();
    for set in 0..2 {
        let (joints, weights) = (format!("JOINTS_{set}"), format!("WEIGHTS_{set}"));
        let Some(&index) = read.attributes.get(&joints) else { break };
        document.expect_components(index, &at(&joints), &[5121, 5123])?;
        let joints = read.vectors(&joints, &["VEC4"], [0.0; 4], |joints| joints)?;
        let values = read.vectors(&weights, &["VEC4"], [0.0; 4], |weights| weights)?;
        if values.len() != joints.len() {
            return Err(document.invalid(read.place, format!("has JOINTS_{set} without {weights}")));
        }
        if let Some(vertex) = values.iter().position(|weights| weights.iter().any(|&weight| weight < 0.0)) {
            let message = format!("element {vertex} is {:?}, expected weights of at least 0", values[vertex]);
            return Err(document.invalid(&at(&weights), message));
        }
        sets.push((joints, values));
    }
    if sets.is_empty() {
        let message = "has no JOINTS_0, but a node hangs it on a skin";
        return Err(document.invalid(read.place, message));
    }
    if read.attributes.contains_key("JOINTS_2") {
        document.warn(read.place, "has more than two sets of joints: only the first two are drawn");
    }
    let (influences, weightless) = Influences::new(&sets);
    if weightless > 0 {
        let message =
            format!("{weightless} vertices have no weight on any joint: they follow their first one");
        document.warn(read.place, message);
    }
    Ok(influences)
}

/// Reads a primitive, and how it hangs on joints where it is `skinned`; `None`, with a warning, where it has nothing
/// to draw.
fn read_primitive(
    document: &Document<'_>,
    materials: &mut Materials<'_, '_>,
    primitive: &Primitive,
    skinned: bool,
    place: &str,
) -> Result<Option<Rest>, SceneError> {
    let topology = match primitive.mode {
        0..=3 => Topology::Strokes,
        4 => Topology::Triangles,
        5 => Topology::Strip,
        6 => Topology::Fan,
        mode => return Err(document.invalid(&format!("{place}.mode"), format!("is {mode}, expected 0 to 6"))),
    };
    let attributes = &primitive.attributes;
    let Some(&position) = attributes.get("POSITION") else {
        document.warn(&format!("{place}.attributes"), "has no POSITION: the primitive is left out");
        return Ok(None);
    };
    let draco = primitive.extensions.draco.as_ref();
    let compressed = draco.map(|source| Compressed::decode(document, source, place)).transpose()?;
    let own = format!("{place}.attributes");
    let count = match &compressed {
        Some(compressed) => compressed.vertices(),
        None => document.accessor_count(position, &format!("{own}.POSITION"))? as usize,
    };
    let read = Attributes { document, attributes, place: &own, count, compressed: compressed.as_ref() };
    let mut mesh = read.rest_shape()?;
    // Points and lines without normals are not lit (specification, section 3.7.2.1).
    let flat = topology == Topology::Strokes && !attributes.contains_key("NORMAL");
    let material = materials.get(primitive.material, flat, &format!("{place}.material"))?;
    mesh.uvs = read.uvs(materials.uv_sets(material))?;
    let (corners, topology) = match &compressed {
        Some(compressed) => (Some(compressed.corners()), Topology::Triangles),
        None => (None, topology),
    };
    let indices = indices(document, primitive, corners, count, place)?;
    let strokes = (topology == Topology::Strokes).then(|| Strokes::new(primitive.mode, indices.clone()));
    mesh.triangles = triangles(document, &indices, topology, place)?;
    read.add_directions(&mut mesh)?;
    let influences = if skinned { influences(&read)? } else { Influences::default() };
    Ok((!indices.is_empty()).then_some(Rest { mesh, material, influences, strokes }))
}

/// Reads attributes of one primitive, or of one of its morph targets.
struct Attributes<'a, 'f> {
    document: &'a Document<'f>,
    attributes: &'a schema::Attributes,
    place: &'a str,
    /// Number of vertices.
    count: usize,
    /// Where Draco compressed some of them.
    compressed: Option<&'a Compressed>,
}

impl Attributes<'_, '_> {
    /// All that does not depend on triangles.
    fn rest_shape(&self) -> Result<Mesh, SceneError> {
        Ok(Mesh {
            positions: self.vectors("POSITION", &["VEC3"], [0.0; 3], Vec3::from_array)?,
            colors: self.vectors("COLOR_0", &["VEC3", "VEC4"], [1.0; 4], |color| {
                Vec4::from_array(color).clamp(Vec4::ZERO, Vec4::ONE)
            })?,
            ..Mesh::default()
        })
    }

    /// Two sets of texture coordinates.
    fn uvs(&self, [first, second]: [usize; 2]) -> Result<[Vec<Vec2>; 2], SceneError> {
        let set =
            |set: usize| self.vectors(&format!("TEXCOORD_{set}"), &["VEC2"], [0.0; 2], Vec2::from_array);
        Ok([set(first)?, set(second)?])
    }

    /// Adds normals and tangents to `mesh`, which has its triangles. Flat normals are what the tracer takes where there
    /// are none; tangents are then to be ignored (specification, section 3.7.2.1).
    fn add_directions(&self, mesh: &mut Mesh) -> Result<(), SceneError> {
        mesh.normals = self.vectors("NORMAL", &["VEC3"], [0.0; 3], Vec3::from_array)?;
        if !mesh.normals.is_empty() {
            mesh.tangents = self.vectors("TANGENT", &["VEC4"], [0.0; 4], Vec4::from_array)?;
            repair_normals(self.document, mesh, &format!("{}.NORMAL", self.place));
            repair_tangents(self.document, mesh, &format!("{}.TANGENT", self.place));
        }
        Ok(())
    }

    /// Attribute `name`, empty where the primitive has none.
    fn vectors<const N: usize, T>(
        &self,
        name: &str,
        kinds: &[&str],
        fill: [f32; N],
        convert: impl Fn([f32; N]) -> T,
    ) -> Result<Vec<T>, SceneError> {
        let Some(&index) = self.attributes.get(name) else { return Ok(Vec::new()) };
        let place = format!("{}.{name}", self.place);
        let count = self.document.accessor_count(index, &place)?;
        if count != self.count as u64 {
            let message = format!("has {count} elements, expected {}, as many as POSITION has", self.count);
            return Err(self.document.invalid(&place, message));
        }
        let compressed =
            self.compressed.map(|mesh| mesh.read(self.document, name, index, fill)).transpose()?;
        let elements = match compressed.flatten() {
            Some(elements) => elements,
            None if name == "POSITION" => self.document.read_floats(index, &place, kinds, fill)?,
            None => {
                let mut elements = self.document.read_any_floats(index, &place, kinds, fill)?;
                self.mend(&mut elements, &place);
                elements
            }
        };
        Ok(elements.into_iter().map(convert).collect())
    }

    /// Sets to 0 what is infinite or no number, as exporters write it where a triangle has no area: a direction of length 0
    /// is then taken for missing, and elsewhere one vertex does not cost the file.
    fn mend<const N: usize>(&self, elements: &mut [[f32; N]], place: &str) {
        let broken = elements.iter_mut().filter(|element| element.iter().any(|value| !value.is_finite()));
        let count = broken.map(|element| *element = [0.0; N]).count();
        if count > 0 {
            let message = format!("{count} elements are infinite or no numbers: 0 is taken there");
            self.document.warn(place, message);
        }
    }
}

/// How indices make triangles (specification, section 3.7.2.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Topology {
    /// They make points or lines.
    Strokes,
    Triangles,
    Strip,
    Fan,
}

/// Indices of `vertices` vertices that were `decoded`, or are listed by the primitive at `place`.
fn indices(
    document: &Document<'_>,
    primitive: &Primitive,
    decoded: Option<Vec<u32>>,
    vertices: usize,
    place: &str,
) -> Result<Vec<u32>, SceneError> {
    let (indices, place) = match (decoded, primitive.indices) {
        (Some(corners), _) => (corners, place.to_owned()),
        (None, Some(index)) => {
            let place = format!("{place}.indices");
            (document.read_indices(index, &place)?, place)
        }
        (None, None) => {
            let count =
                u32::try_from(vertices).map_err(|_| document.invalid(place, "has over 2^32 vertices"))?;
            ((0..count).collect(), format!("{place}.attributes.POSITION"))
        }
    };
    if let Some(at) = indices.iter().position(|&index| index as usize >= vertices) {
        let message = format!("index {at} is {}, but there are {vertices} vertices", indices[at]);
        return Err(document.invalid(&place, message));
    }
    Ok(indices)
}

/// The triangles that `indices` make.
fn triangles(
    document: &Document<'_>,
    indices: &[u32],
    topology: Topology,
    place: &str,
) -> Result<Vec<[u32; 3]>, SceneError> {
    let count = indices.len();
    if topology == Topology::Triangles && !count.is_multiple_of(3) {
        return Err(document.invalid(place, format!("{count} corners, expected a multiple of 3")));
    }
    document.claim_geometry(place, count as u64 * size_of::<[u32; 3]>() as u64)?;
    let corners = indices.windows(3).enumerate();
    Ok(match topology {
        Topology::Strokes => Vec::new(),
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
