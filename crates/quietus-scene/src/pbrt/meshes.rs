//! Meshes: PLY files are loaded and vertices brought into the world side by side.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec3};
use quietus_trace::desc::{Mesh, PatchMesh};
use rayon::prelude::*;

use super::draft::{Form, Group};
use super::fault::{Context, Place, Result};
use super::transform::mirrors;
use crate::error::SceneError;
use crate::ply;

/// Meshes of more triangles than this stay as they are in their files when several shapes use them: below, a copy in
/// the world costs little memory, and saves every ray a way through an instance.
const MAX_COPIED: usize = 1 << 16;

/// A mesh as the scene gets it.
#[derive(Clone, Debug)]
pub(super) struct Made {
    pub mesh: Arc<Mesh>,
    /// Whether it is in the space that its group is in, and not in the shape's own.
    pub baked: bool,
    /// Its triangles' mean area in the world, and whether they are all as large.
    pub area: (f32, bool),
}

/// A mesh to be made.
struct Task {
    source: Source,
    to_world: DAffine3,
    /// Whether vertices are to be brought into the world.
    bake: bool,
    /// Whether areas are asked for.
    areas: bool,
}

enum Source {
    Inline(Mesh),
    /// Of a file that only this shape uses.
    File(PathBuf),
    /// Of [`Tasks::files`].
    Shared(usize),
}

/// All meshes of a scene, in the order of its groups and shapes.
pub(super) struct Tasks {
    tasks: Vec<(Task, Place)>,
    /// Files that several shapes use.
    files: Vec<(PathBuf, Place)>,
}

/// What [`Tasks::run`] gives.
pub(super) struct Results(Vec<(std::result::Result<Made, SceneError>, Place)>);

impl Tasks {
    /// Takes the meshes out of `groups`; `files` are those that they refer to.
    pub(super) fn new(groups: &mut [Group], files: &[(PathBuf, Place)]) -> Self {
        let mut uses = vec![0_u32; files.len()];
        for shape in groups.iter().flat_map(|group| &group.shapes) {
            if let Form::Ply(file) = shape.form {
                uses[file] += 1;
            }
        }
        let mut shared = Vec::new();
        let numbers: Vec<Option<usize>> = (0..files.len())
            .map(|file| {
                (uses[file] > 1).then(|| {
                    shared.push(files[file].clone());
                    shared.len() - 1
                })
            })
            .collect();
        let mut tasks = Vec::new();
        for shape in groups.iter_mut().flat_map(|group| &mut group.shapes) {
            let source = match &mut shape.form {
                Form::Mesh(mesh) => Source::Inline(std::mem::take(mesh)),
                Form::Ply(file) => match numbers[*file] {
                    Some(number) => Source::Shared(number),
                    None => Source::File(files[*file].0.clone()),
                },
                _ => continue,
            };
            let light = shape.style.light.as_ref();
            let task = Task {
                source,
                to_world: shape.to_world.0[0],
                // What is displaced is so in its own space.
                bake: shape.to_world.is_still() && shape.displacement.is_none(),
                areas: light.is_some_and(|light| light.power.is_some()),
            };
            tasks.push((task, shape.place));
        }
        Self { tasks, files: shared }
    }

    /// Loads and makes all meshes.
    pub(super) fn run(self) -> Results {
        let load = |(path, _): &(PathBuf, Place)| ply::read(path).map(|mesh| Arc::new(fronted(mesh)));
        let shared: Vec<_> = self.files.par_iter().map(load).collect();
        let make = |(task, place): (Task, Place)| (task.run(&shared), place);
        Results(self.tasks.into_par_iter().map(make).collect())
    }
}

impl Results {
    /// The meshes, or the first error.
    pub(super) fn check(self, context: &Context) -> Result<Vec<Made>> {
        let made = self.0.into_iter();
        made.map(|(made, place)| made.map_err(|error| context.blame(place, error))).collect()
    }
}

impl Task {
    fn run(
        self,
        shared: &[std::result::Result<Arc<Mesh>, SceneError>],
    ) -> std::result::Result<Made, SceneError> {
        let shared = match &self.source {
            Source::Shared(number) => Some(shared[*number].clone()?),
            _ => None,
        };
        let keep = shared.as_ref().is_some_and(|mesh| mesh.triangles.len() > MAX_COPIED);
        let baked = self.bake && !keep;
        let mut mesh = match (self.source, shared) {
            (_, Some(mesh)) if !baked => {
                let area = area(self.areas, &mesh, &self.to_world);
                return Ok(Made { mesh, baked, area });
            }
            (Source::Inline(mesh), _) => fronted(mesh),
            (Source::File(path), _) => fronted(ply::read(&path)?),
            (Source::Shared(_), mesh) => mesh.map(|mesh| Mesh::clone(&mesh)).unwrap_or_default(),
        };
        if baked {
            bake(&mut mesh, &self.to_world);
        }
        let area = area(self.areas, &mesh, if baked { &DAffine3::IDENTITY } else { &self.to_world });
        Ok(Made { mesh: Arc::new(mesh), baked, area })
    }
}

impl Made {
    /// A `mesh` that has been displaced in its own space, brought into the world where `bake` says so, with its areas if
    /// they are `wanted`.
    pub(super) fn displaced(mut mesh: Mesh, to_world: &DAffine3, bake: bool, wanted: bool) -> Self {
        if bake {
            self::bake(&mut mesh, to_world);
        }
        let area = area(wanted, &mesh, if bake { &DAffine3::IDENTITY } else { to_world });
        Self { mesh: Arc::new(mesh), baked: bake, area }
    }
}

/// Brings a mesh into the world.
fn bake(mesh: &mut Mesh, to_world: &DAffine3) {
    if *to_world != DAffine3::IDENTITY {
        points(&mut mesh.positions, to_world);
        normals(&mut mesh.normals, to_world);
        if mirrors(to_world) {
            mesh.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
    }
}

/// Brings patches into the world. A mirror exchanges their sides, which the caller has to undo.
pub(super) fn bake_patches(patches: &mut PatchMesh, to_world: &DAffine3) {
    points(&mut patches.positions, to_world);
    normals(&mut patches.normals, to_world);
}

fn points(points: &mut [Vec3], to_world: &DAffine3) {
    for point in points {
        *point = to_world.transform_point3(point.as_dvec3()).as_vec3();
    }
}

fn normals(normals: &mut [Vec3], to_world: &DAffine3) {
    let matrix = to_world.matrix3.inverse().transpose();
    for normal in normals {
        *normal = (matrix * normal.as_dvec3()).normalize_or_zero().as_vec3();
    }
}

/// Turns the triangles of `mesh` so that their front is the side its normals point to, as pbrt-v4 decides it.
fn fronted(mut mesh: Mesh) -> Mesh {
    if mesh.normals.is_empty() {
        return mesh;
    }
    let Mesh { positions, normals, triangles, .. } = &mut mesh;
    for triangle in triangles {
        let [a, b, c] = triangle.map(|i| positions[i as usize]);
        let normal: Vec3 = triangle.iter().map(|&i| normals[i as usize]).sum();
        if (b - a).cross(c - a).dot(normal) < 0.0 {
            triangle.swap(1, 2);
        }
    }
    mesh
}

/// The mean area of the triangles of `mesh` in the world, and whether they are all as large; only if it is `wanted`.
fn area(wanted: bool, mesh: &Mesh, to_world: &DAffine3) -> (f32, bool) {
    if !wanted {
        return (0.0, true);
    }
    /// Coordinates in text have about as many digits.
    const TOLERANCE: f64 = 1e-3;
    let area = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|i| mesh.positions[i as usize].as_dvec3());
        let edge = |from: DVec3, to: DVec3| to_world.transform_vector3(to - from);
        0.5 * edge(a, b).cross(edge(a, c)).length()
    };
    let mean = mesh.triangles.iter().map(area).sum::<f64>() / mesh.triangles.len().max(1) as f64;
    let equal = mesh.triangles.iter().all(|triangle| (area(triangle) - mean).abs() <= TOLERANCE * mean);
    (mean as f32, equal)
}
