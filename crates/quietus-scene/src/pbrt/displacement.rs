//! Displacement: triangles are halved until their edges are short, and vertices moved along their normals by what a texture
//! says there (Cook 1984, "Shade Trees", section 5).

use std::collections::HashMap;

use glam::{DAffine3, Vec2, Vec3};
use quietus_trace::desc::Mesh;
use quietus_trace::texture::SurfacePoint;
use rayon::prelude::*;

use super::fault::Place;

/// Most triangles of a mesh that has been divided.
pub(super) const MAX_TRIANGLES: usize = 1 << 24;

/// What a shape says of it.
#[derive(Debug)]
pub(super) struct Displacement {
    /// The texture, and where it is named.
    pub texture: Box<str>,
    pub place: Place,
    /// The longest edge that is left, in the world.
    pub edge: f32,
}

/// `mesh` divided until no edge is longer than `edge` in the world, its vertices moved along their normals by `height` in
/// the mesh's own space; none where that takes more than `most` triangles.
pub(super) fn displaced(
    mesh: &Mesh,
    to_world: &DAffine3,
    (edge, most): (f32, usize),
    height: impl Fn(&SurfacePoint) -> f32 + Sync,
) -> Option<Mesh> {
    let mut mesh = mesh.clone();
    if mesh.normals.is_empty() {
        mesh.normals = normals(&mesh);
    }
    let mut mesh = Division { mesh, middles: HashMap::new() }.run(to_world, edge, most)?;
    let uv = |i: usize| mesh.uvs[0].get(i).copied().unwrap_or_default();
    let moved = |(i, position): (usize, &Vec3)| {
        let world = to_world.transform_point3(position.as_dvec3()).as_vec3();
        let point = SurfacePoint { uv: [uv(i), Vec2::ZERO], position: world, ..SurfacePoint::default() };
        *position + mesh.normals[i] * height(&point)
    };
    mesh.positions = mesh.positions.par_iter().enumerate().map(moved).collect();
    mesh.normals = normals(&mesh);
    Some(mesh)
}

/// A mesh that is being divided.
struct Division {
    mesh: Mesh,
    /// Vertices in the middles of edges, by their ends: neighbours share them.
    middles: HashMap<[u32; 2], u32>,
}

impl Division {
    /// Halves triangles at their longest edges (Rivara 1984). An edge that is too long is halved by all its triangles in
    /// the end, so that there are no gaps.
    fn run(mut self, to_world: &DAffine3, edge: f32, most: usize) -> Option<Mesh> {
        let mut open = std::mem::take(&mut self.mesh.triangles);
        let mut done = Vec::with_capacity(open.len());
        while let Some(triangle) = open.pop() {
            let place = |i: u32| self.mesh.positions[i as usize].as_dvec3();
            let length = |k: usize| {
                let step = place(triangle[(k + 1) % 3]) - place(triangle[k]);
                to_world.transform_vector3(step).length() as f32
            };
            let lengths = [length(0), length(1), length(2)];
            let longest = (0..3).fold(0, |best, k| if lengths[k] > lengths[best] { k } else { best });
            if lengths[longest] > edge {
                let [a, b, c] = [0, 1, 2].map(|k| triangle[(longest + k) % 3]);
                let middle = self.middle(a, b);
                open.extend([[a, middle, c], [middle, b, c]]);
            } else {
                done.push(triangle);
            }
            if open.len() + done.len() > most {
                return None;
            }
        }
        self.mesh.triangles = done;
        Some(self.mesh)
    }

    /// The vertex in the middle of an edge.
    fn middle(&mut self, a: u32, b: u32) -> u32 {
        let Self { mesh, middles } = self;
        *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
            let (a, b) = (a as usize, b as usize);
            let vertex = mesh.positions.len() as u32;
            mesh.positions.push(0.5 * (mesh.positions[a] + mesh.positions[b]));
            mesh.normals.push((mesh.normals[a] + mesh.normals[b]).normalize_or_zero());
            for uvs in mesh.uvs.iter_mut().filter(|uvs| !uvs.is_empty()) {
                uvs.push(0.5 * (uvs[a] + uvs[b]));
            }
            if !mesh.colors.is_empty() {
                mesh.colors.push(0.5 * (mesh.colors[a] + mesh.colors[b]));
            }
            vertex
        })
    }
}

/// Normals at vertices: the means of those of the triangles around them, as in pbrt.
fn normals(mesh: &Mesh) -> Vec<Vec3> {
    let mut sums = vec![Vec3::ZERO; mesh.positions.len()];
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        triangle.iter().for_each(|&i| sums[i as usize] += normal);
    }
    sums.into_iter().map(Vec3::normalize_or_zero).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square with uneven halves, without normals.
    fn square() -> Mesh {
        let corners = [Vec2::ZERO, Vec2::new(2.0, 0.0), Vec2::new(2.0, 1.0), Vec2::new(0.0, 1.0)];
        Mesh {
            positions: corners.map(|corner| corner.extend(0.0)).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            uvs: [corners.to_vec(), Vec::new()],
            ..Mesh::default()
        }
    }

    #[test]
    fn edges_become_short_without_gaps() {
        let to_world = DAffine3::from_scale(glam::DVec3::splat(3.0));
        let mesh = displaced(&square(), &to_world, (0.4, 10_000), |_| 0.0).expect("few triangles");
        let mut edges: HashMap<[u32; 2], i32> = HashMap::new();
        for triangle in &mesh.triangles {
            for k in 0..3 {
                let [a, b] = [triangle[k], triangle[(k + 1) % 3]];
                let [from, to] = [a, b].map(|i| mesh.positions[i as usize]);
                assert!(3.0 * from.distance(to) <= 0.4);
                *edges.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
            }
        }
        // Edges that have one triangle lie on the border.
        for ([a, b], _) in edges.into_iter().filter(|(_, sides)| *sides != 0) {
            let [a, b] = [a, b].map(|i| mesh.positions[i as usize]);
            assert!((a.x == b.x && (a.x == 0.0 || a.x == 2.0)) || (a.y == b.y && (a.y == 0.0 || a.y == 1.0)));
        }
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
            0.5 * (b - a).cross(c - a).z
        };
        let sum: f32 = mesh.triangles.iter().map(area).sum();
        assert!((sum - 2.0).abs() < 1e-4, "{sum}");
        assert_eq!(mesh.positions.len(), mesh.uvs[0].len());
    }

    /// A texture that grows with u tilts the plane, and its normals with it.
    #[test]
    fn vertices_move_along_normals_by_the_texture() {
        let mesh =
            displaced(&square(), &DAffine3::IDENTITY, (0.5, 10_000), |point| point.uv[0].x).expect("few");
        for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
            assert!((position.z - position.x).abs() < 1e-6, "{position}");
            assert!(normal.distance(Vec3::new(-1.0, 0.0, 1.0).normalize()) < 1e-5, "{normal}");
        }
        let whole = displaced(&square(), &DAffine3::IDENTITY, (9.0, 2), |_| 0.5).expect("two triangles");
        assert_eq!(whole.triangles.len(), 2);
        assert!(whole.positions.iter().all(|position| position.z == 0.5));
    }

    #[test]
    fn too_many_triangles_are_refused() {
        assert!(displaced(&square(), &DAffine3::IDENTITY, (0.1, 100), |_| 0.0).is_none());
    }
}
