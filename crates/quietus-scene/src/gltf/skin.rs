//! Skins: the joints that a mesh hangs on, and how much each vertex hangs on which (specification, section 3.7.3).

use glam::Affine3A;

use super::document::Document;
use super::hierarchy::{Hierarchy, affine};
use super::schema;
use crate::error::SceneError;

/// The joints of a skin.
#[derive(Clone, Debug)]
pub(super) struct Skin {
    /// Slot of each joint, and from the mesh to the joint's own space in the pose it was bound in.
    joints: Vec<(Option<usize>, Affine3A)>,
}

impl Skin {
    /// Reads skin `index`, referred to from `place`.
    pub(super) fn read(
        document: &Document<'_>,
        hierarchy: &Hierarchy,
        index: usize,
        place: &str,
    ) -> Result<Self, SceneError> {
        let source = document.get(&document.root.skins, index, "skins", place)?;
        let own = format!("skins[{index}]");
        if source.joints.is_empty() {
            return Err(document.invalid(&format!("{own}.joints"), "is empty, expected at least one joint"));
        }
        let inverses = inverse_binds(document, source, &own)?;
        let joints = source.joints.iter().zip(inverses).enumerate();
        let joints = joints.map(|(i, (&node, inverse))| {
            let place = format!("{own}.joints[{i}]");
            document.get(&document.root.nodes, node, "nodes", &place)?;
            let slot = hierarchy.slot(node);
            if slot.is_none() {
                document.warn(&place, "is not part of the scene: it stands in the origin");
            }
            Ok((slot, inverse))
        });
        Ok(Self { joints: joints.collect::<Result<_, SceneError>>()? })
    }

    /// Number of joints.
    pub(super) fn len(&self) -> usize {
        self.joints.len()
    }

    /// From the mesh to the world by each joint, where nodes stand as `worlds` says by slot.
    pub(super) fn matrices(&self, worlds: &[Affine3A]) -> Vec<Affine3A> {
        let matrix = |&(slot, inverse): &(Option<usize>, Affine3A)| match slot {
            Some(slot) => worlds[slot] * inverse,
            None => inverse,
        };
        self.joints.iter().map(matrix).collect()
    }
}

fn inverse_binds(
    document: &Document<'_>,
    source: &schema::Skin,
    own: &str,
) -> Result<Vec<Affine3A>, SceneError> {
    let count = source.joints.len();
    let Some(index) = source.inverse_bind_matrices else { return Ok(vec![Affine3A::IDENTITY; count]) };
    let place = format!("{own}.inverseBindMatrices");
    let matrices = document.read_floats(index, &place, &["MAT4"], [0.0; 16])?;
    if matrices.len() < count {
        let message = format!("has {} matrices, expected one for each of {count} joints", matrices.len());
        return Err(document.invalid(&place, message));
    }
    let matrices = matrices.iter().take(count).enumerate().map(|(i, matrix)| {
        let message = || format!("matrix {i} is not affine: its last row is not 0, 0, 0, 1");
        affine(matrix).ok_or_else(|| document.invalid(&place, message()))
    });
    matrices.collect()
}

/// Four joints of each vertex, and how much it hangs on them.
pub(super) type Set = (Vec<[f32; 4]>, Vec<[f32; 4]>);

/// Which joints move which vertex, and how much: the same number of entries for every vertex.
#[derive(Clone, Debug, Default)]
pub(super) struct Influences {
    /// Entries per vertex: 4 or 8; 0 where there are none.
    per_vertex: usize,
    /// Joint and weight; the weights of a vertex add up to 1.
    entries: Vec<(u16, f32)>,
}

impl Influences {
    /// Puts one or two sets together. Weights are brought to a sum
    /// of 1; vertices without any weight hang on their first joint. Gives the number of those, too.
    pub(super) fn new(sets: &[Set]) -> (Self, usize) {
        let count = sets.first().map_or(0, |(joints, _)| joints.len());
        let per_vertex = 4 * sets.len();
        let mut entries = Vec::with_capacity(count * per_vertex);
        let mut weightless = 0;
        for vertex in 0..count {
            let start = entries.len();
            for (joints, weights) in sets {
                let pairs = joints[vertex].iter().zip(weights[vertex]);
                // The joint of an entry without weight means nothing.
                entries.extend(
                    pairs.map(|(&joint, weight)| (if weight > 0.0 { joint as u16 } else { 0 }, weight)),
                );
            }
            let sum: f32 = entries[start..].iter().map(|entry| entry.1).sum();
            if sum > 0.0 {
                entries[start..].iter_mut().for_each(|entry| entry.1 /= sum);
            } else {
                weightless += 1;
                entries[start] = (sets[0].0[vertex][0] as u16, 1.0);
            }
        }
        (Self { per_vertex, entries }, weightless)
    }

    /// Those of vertices that are copies of the vertices `sources`.
    pub(super) fn gather(&self, sources: &[u32]) -> Self {
        let of = |&vertex: &u32| &self.entries[vertex as usize * self.per_vertex..][..self.per_vertex];
        Self { per_vertex: self.per_vertex, entries: sources.iter().flat_map(of).copied().collect() }
    }

    /// Whether vertices hang on no joints at all.
    pub(super) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// The largest number of a joint.
    pub(super) fn last_joint(&self) -> usize {
        self.entries.iter().map(|entry| usize::from(entry.0)).max().unwrap_or(0)
    }

    /// The mean of `matrices`, weighted for `vertex`.
    pub(super) fn blend(&self, vertex: usize, matrices: &[Affine3A]) -> Affine3A {
        let entries = &self.entries[vertex * self.per_vertex..(vertex + 1) * self.per_vertex];
        let mut sum = Affine3A::ZERO;
        for &(joint, weight) in entries {
            let matrix = &matrices[usize::from(joint)];
            sum.matrix3 += matrix.matrix3 * weight;
            sum.translation += matrix.translation * weight;
        }
        sum
    }
}
