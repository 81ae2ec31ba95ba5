//! Vertices under morph targets and skins, on all cores.

use glam::{Affine3A, Mat3A, Vec3, Vec3A, Vec4};
use quietus_trace::desc::Mesh;
use rayon::prelude::*;

use super::skin::Influences;

/// What a morph target adds at a weight of 1; vectors are empty, or as long as the mesh's.
#[derive(Clone, Debug, Default)]
pub(super) struct Target {
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    pub tangents: Vec<Vec3>,
}

/// What bends a mesh at one moment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bend<'a> {
    /// One per target.
    pub weights: &'a [f32],
    /// From the mesh to the world by each joint; empty without a skin.
    pub joints: &'a [Affine3A],
}

/// The vertices of a mesh at one moment, as in [`Mesh`].
#[derive(Clone, Debug, Default)]
pub(super) struct Vertices {
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    pub tangents: Vec<Vec4>,
}

/// Adds the targets to `mesh` and hangs it on its joints, which are all in range.
pub(super) fn deform(mesh: &Mesh, targets: &[Target], influences: &Influences, bend: Bend<'_>) -> Vertices {
    let morphs: Vec<_> = targets
        .iter()
        .zip(bend.weights)
        .filter(|(_, weight)| **weight != 0.0)
        .map(|(t, &w)| (t, w))
        .collect();
    let vertex = |i: usize| {
        let position = added(mesh.positions[i], &morphs, i, |target| &target.positions);
        let normal = mesh.normals.get(i).map(|&n| added(n, &morphs, i, |target| &target.normals));
        let tangent = mesh.tangents.get(i).map(|&t| {
            added(t.truncate(), &morphs, i, |target| &target.tangents).normalize_or(t.truncate()).extend(t.w)
        });
        let (normal, tangent) = (normal.unwrap_or_default(), tangent.unwrap_or_default());
        if influences.is_empty() || bend.joints.is_empty() {
            return (position, (normal, tangent));
        }
        let hung = influences.blend(i, bend.joints);
        (hung.transform_point3(position), (turn_normal(&hung.matrix3, normal), turn(&hung.matrix3, tangent)))
    };
    let (positions, (mut normals, mut tangents)): (Vec<_>, (Vec<Vec3>, Vec<_>)) =
        (0..mesh.positions.len()).into_par_iter().map(vertex).collect();
    normals.truncate(mesh.normals.len());
    normals.shrink_to_fit();
    tangents.truncate(mesh.tangents.len());
    tangents.shrink_to_fit();
    for (normal, &rest) in normals.iter_mut().zip(&mesh.normals) {
        *normal = normal.normalize_or(rest);
    }
    Vertices { positions, normals, tangents }
}

/// `value` and what the targets add to it at vertex `i`.
fn added<'a>(
    value: Vec3,
    morphs: &[(&'a Target, f32)],
    i: usize,
    of: impl Fn(&'a Target) -> &'a Vec<Vec3>,
) -> Vec3 {
    morphs.iter().filter_map(|&(target, weight)| Some(weight * *of(target).get(i)?)).fold(value, |a, b| a + b)
}

/// A normal under the inverse transpose, but for its length. Cofactors have that direction, too, and exist where
/// there is no inverse; their sign is that of the determinant.
fn turn_normal(matrix: &Mat3A, normal: Vec3) -> Vec3 {
    let [x, y, z] = [matrix.x_axis, matrix.y_axis, matrix.z_axis];
    let turned = y.cross(z) * normal.x + z.cross(x) * normal.y + x.cross(y) * normal.z;
    Vec3::from(turned * mirror(matrix))
}

/// A tangent, whose bitangent changes sides where space is mirrored.
fn turn(matrix: &Mat3A, tangent: Vec4) -> Vec4 {
    let turned = (*matrix * Vec3A::from_vec4(tangent)).normalize_or(Vec3A::from_vec4(tangent));
    turned.extend(tangent.w * mirror(matrix))
}

/// -1 where the transform mirrors, else 1.
pub(super) fn mirror(matrix: &Mat3A) -> f32 {
    if matrix.determinant() < 0.0 { -1.0 } else { 1.0 }
}
