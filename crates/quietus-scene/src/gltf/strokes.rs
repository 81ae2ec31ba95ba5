//! Points and lines (specification, section 3.7.2.1), which have no extent of their own: drawn as octahedra and prisms, lines
//! about as wide as a pixel of a picture that shows the whole scene, points as three.

use std::sync::Arc;

use glam::{Affine3A, Vec3};
use quietus_trace::desc::Mesh;

use super::deform::Target;
use super::document::Document;
use super::mesh::{Figure, Part};
use super::skin::Influences;
use super::stage::Stage;
use crate::error::SceneError;

/// What is drawn of a primitive without triangles, by the indices of its vertices.
#[derive(Clone, Debug)]
pub(super) enum Strokes {
    Points(Vec<u32>),
    Lines(Vec<[u32; 2]>),
}

/// Width of lines over the diagonal of the scene's box.
const LINE_WIDTH: f32 = 1e-3;

/// The same of points: of a single pixel that an octahedron covers but partly nothing could be seen.
const POINT_WIDTH: f32 = 3e-3;

/// Most memory that what is drawn of one point or line takes: eight vertices and triangles.
const STROKE_BYTES: u64 = 8 * (96 + size_of::<[u32; 3]>() as u64);

impl Strokes {
    /// Those of a primitive with this `mode` below 4 and these `indices`.
    pub(super) fn new(mode: u32, indices: Vec<u32>) -> Self {
        let pairs =
            |pairs: &mut dyn Iterator<Item = [u32; 2]>| Self::Lines(pairs.filter(|[a, b]| a != b).collect());
        let mut next = indices.windows(2).map(|pair| [pair[0], pair[1]]);
        match mode {
            0 => Self::Points(indices),
            1 => pairs(&mut indices.as_chunks::<2>().0.iter().copied()),
            2 => {
                let ends = indices.last().zip(indices.first()).map(|(&last, &first)| [last, first]);
                pairs(&mut next.chain(ends))
            }
            _ => pairs(&mut next),
        }
    }

    /// Their width over the diagonal of the scene's box.
    fn width(&self) -> f32 {
        match self {
            Self::Points(_) => POINT_WIDTH,
            Self::Lines(_) => LINE_WIDTH,
        }
    }

    /// Number of them.
    fn len(&self) -> usize {
        match self {
            Self::Points(points) => points.len(),
            Self::Lines(lines) => lines.len(),
        }
    }
}

/// Gives all strokes of `stage` the same width, but for what their nodes' scales do to those of a mesh that is shown
/// more than once.
pub(super) fn thicken(stage: &mut Stage, document: &Document<'_>) -> Result<(), SceneError> {
    let has_strokes = |figure: &Figure| figure.parts.iter().any(|part| part.strokes.is_some());
    if !stage.figures.values().any(has_strokes) {
        return Ok(());
    }
    let worlds = stage.rest_worlds()?;
    let diagonal = diagonal(stage, &worlds);
    for model in &stage.models {
        let scale = match model.skin {
            Some(_) => 1.0,
            None => worlds[model.slot].matrix3.determinant().abs().cbrt(),
        };
        let half = if scale > 0.0 { 0.5 * diagonal / scale } else { 0.5 * diagonal };
        let Some(figure) = stage.figures.get_mut(&model.mesh) else { continue };
        for part in &mut figure.parts {
            let Some(strokes) = part.strokes.take() else { continue };
            let place = format!("meshes[{}]", model.mesh);
            document.claim_geometry(&place, STROKE_BYTES.saturating_mul(strokes.len() as u64))?;
            *part = solid(part, &strokes, half * strokes.width());
        }
    }
    Ok(())
}

/// That of the box around all vertices in the rest pose; 1 where there is only one place.
fn diagonal(stage: &Stage, worlds: &[Affine3A]) -> f32 {
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for model in &stage.models {
        let to_world = if model.skin.is_some() { Affine3A::IDENTITY } else { worlds[model.slot] };
        for position in stage.figures[&model.mesh].parts.iter().flat_map(|part| &part.mesh.positions) {
            let position = to_world.transform_point3(*position);
            (low, high) = (low.min(position), high.max(position));
        }
    }
    let diagonal = low.distance(high);
    if diagonal > 0.0 && diagonal.is_finite() { diagonal } else { 1.0 }
}

/// What the vertices of a solid come from: which vertex, and how far they are from it.
#[derive(Default)]
struct Outline {
    sources: Vec<u32>,
    offsets: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

/// `part` with triangles around its `strokes`.
fn solid(part: &Part, strokes: &Strokes, radius: f32) -> Part {
    let mut outline = Outline::default();
    match strokes {
        Strokes::Points(points) => points.iter().for_each(|&point| outline.add_point(point, radius)),
        Strokes::Lines(lines) => {
            for &[a, b] in lines {
                let ends = [a, b].map(|i| part.mesh.positions[i as usize]);
                if let Some(along) = (ends[1] - ends[0]).try_normalize() {
                    outline.add_line([a, b], along, radius);
                }
            }
        }
    }
    let mesh = &part.mesh;
    let sources = &outline.sources;
    let positions =
        gather(&mesh.positions, sources).into_iter().zip(&outline.offsets).map(|(p, &offset)| p + offset);
    let mesh = Mesh {
        positions: positions.collect(),
        normals: gather(&mesh.normals, sources),
        tangents: gather(&mesh.tangents, sources),
        uvs: [0, 1].map(|set| gather(&mesh.uvs[set], sources)),
        colors: gather(&mesh.colors, sources),
        triangles: outline.triangles,
        ..Mesh::default()
    };
    let target = |target: &Target| Target {
        positions: gather(&target.positions, sources),
        normals: gather(&target.normals, sources),
        tangents: gather(&target.tangents, sources),
    };
    Part {
        mesh: Arc::new(mesh),
        targets: part.targets.iter().map(target).collect(),
        influences: if part.influences.is_empty() {
            Influences::default()
        } else {
            part.influences.gather(sources)
        },
        strokes: None,
        ..part.clone()
    }
}

/// The elements of `values` at `sources`; nothing where there is nothing.
fn gather<T: Copy>(values: &[T], sources: &[u32]) -> Vec<T> {
    if values.is_empty() { Vec::new() } else { sources.iter().map(|&i| values[i as usize]).collect() }
}

impl Outline {
    fn push(&mut self, source: u32, offsets: impl IntoIterator<Item = Vec3>) {
        for offset in offsets {
            self.sources.push(source);
            self.offsets.push(offset);
        }
    }

    /// An octahedron.
    fn add_point(&mut self, point: u32, radius: f32) {
        let first = self.sources.len() as u32;
        self.push(point, Vec3::AXES.into_iter().flat_map(|axis| [radius * axis, -radius * axis]));
        for corner in 0..8_u32 {
            let [x, y, z] = [0, 1, 2].map(|axis| first + 2 * axis + (corner >> axis & 1));
            // Counter-clockwise from outside, which every mirroring turns around.
            self.triangles.push(if corner.count_ones() % 2 == 0 { [x, y, z] } else { [x, z, y] });
        }
    }

    /// A prism over a square around the line between two vertices, in the direction `along`.
    fn add_line(&mut self, [a, b]: [u32; 2], along: Vec3, radius: f32) {
        let first = self.sources.len() as u32;
        let (u, v) = along.any_orthonormal_pair();
        let corners = [u, v, -u, -v].map(|corner| radius * corner);
        self.push(a, corners);
        self.push(b, corners);
        for i in 0..4 {
            let [near, next] = [first + i, first + (i + 1) % 4];
            self.triangles.extend([[near, next, next + 4], [near, next + 4, near + 4]]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(positions: Vec<Vec3>) -> Part {
        Part {
            mesh: Arc::new(Mesh { positions, ..Mesh::default() }),
            material: quietus_trace::desc::MaterialId(0),
            media: None,
            targets: Vec::new(),
            influences: Influences::default(),
            strokes: None,
        }
    }

    #[test]
    fn modes_join_vertices() {
        let pairs = |mode| match Strokes::new(mode, vec![4, 5, 6, 7, 7]) {
            Strokes::Points(_) => panic!("expected lines"),
            Strokes::Lines(lines) => lines,
        };
        assert_eq!(pairs(1), [[4, 5], [6, 7]]);
        assert_eq!(pairs(2), [[4, 5], [5, 6], [6, 7], [7, 4]]);
        assert_eq!(pairs(3), [[4, 5], [5, 6], [6, 7]]);
        assert!(matches!(Strokes::new(2, Vec::new()), Strokes::Lines(lines) if lines.is_empty()));
    }

    /// All triangles face away from what they surround.
    #[test]
    fn solids_face_outwards() {
        let (a, b) = (Vec3::new(1.0, 2.0, 3.0), Vec3::new(-2.0, 0.5, 4.0));
        let cases = [(Strokes::Points(vec![0]), 6, 8), (Strokes::Lines(vec![[0, 1]]), 8, 8)];
        for (strokes, vertices, triangles) in cases {
            let solid = solid(&part(vec![a, b]), &strokes, 0.1);
            let mesh = &solid.mesh;
            assert_eq!((mesh.positions.len(), mesh.triangles.len()), (vertices, triangles));
            let middle = mesh.positions.iter().sum::<Vec3>() / vertices as f32;
            for corners in &mesh.triangles {
                let [p, q, r] = corners.map(|i| mesh.positions[i as usize]);
                assert!((q - p).cross(r - p).dot(p - middle) > 0.0, "{strokes:?}: {corners:?}");
            }
        }
    }
}
