//! The nodes of the scene to show, and where they stand at any time.

use std::collections::HashMap;

use glam::{Affine3A, Mat4, Quat, Vec3, Vec4};

use super::animation::Clip;
use super::document::Document;
use super::schema::Node;
use crate::error::SceneError;

/// Where a node stands relative to its parent.
#[derive(Clone, Copy, Debug)]
pub(super) enum Local {
    /// A matrix; animations leave it alone.
    Matrix(Affine3A),
    /// What animations change.
    Parts(Parts),
}

/// Scaled first, then turned, then moved.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parts {
    pub translation: Vec3,
    pub rotation: Quat,
    pub scale: Vec3,
}

/// A node of the scene.
#[derive(Clone, Copy, Debug)]
struct Placed {
    /// Index in the file.
    index: usize,
    /// Slot of its parent.
    parent: Option<usize>,
    /// In the rest pose.
    local: Local,
    /// Whether what it and nodes below it hold, cameras aside, is to be seen (KHR_node_visibility).
    visible: bool,
}

/// Nodes of the scene, parents before children. A node's place among them is its slot.
#[derive(Clone, Debug)]
pub(super) struct Hierarchy {
    nodes: Vec<Placed>,
    slots: HashMap<usize, usize>,
}

impl Hierarchy {
    /// Finds the nodes of the scene that the document says is to be shown.
    pub(super) fn read(document: &Document<'_>) -> Result<Self, SceneError> {
        let mut hierarchy = Self { nodes: Vec::new(), slots: HashMap::new() };
        let mut waiting: Vec<_> =
            roots(document)?.into_iter().rev().map(|(index, at)| (index, None, at)).collect();
        while let Some((index, parent, place)) = waiting.pop() {
            let node = document.get(&document.root.nodes, index, "nodes", &place)?;
            let slot = hierarchy.nodes.len();
            if hierarchy.slots.insert(index, slot).is_some() {
                let message =
                    format!("refers to nodes[{index}] a second time, expected a hierarchy without cycles");
                return Err(document.invalid(&place, message));
            }
            let own = format!("nodes[{index}]");
            let local = local(document, node, &own)?;
            let visible = node.extensions.visibility.visible;
            hierarchy.nodes.push(Placed { index, parent, local, visible });
            for (i, &child) in node.children.iter().enumerate().rev() {
                waiting.push((child, Some(slot), format!("{own}.children[{i}]")));
            }
        }
        Ok(hierarchy)
    }

    /// Indices in the file of the nodes, by slot.
    pub(super) fn indices(&self) -> impl ExactSizeIterator<Item = usize> {
        self.nodes.iter().map(|node| node.index)
    }

    /// Index in the file of the node in `slot`.
    pub(super) fn index(&self, slot: usize) -> usize {
        self.nodes[slot].index
    }

    /// Slot of node `index` of the file, if it is part of the scene.
    pub(super) fn slot(&self, index: usize) -> Option<usize> {
        self.slots.get(&index).copied()
    }

    /// Whether what nodes hold, cameras aside, is to be seen, by slot: at a time of `clip` in seconds, or in the rest pose.
    pub(super) fn visible(&self, clip: Option<(&Clip, f32)>) -> Vec<bool> {
        let mut visible: Vec<bool> = Vec::with_capacity(self.nodes.len());
        for (slot, node) in self.nodes.iter().enumerate() {
            let own = clip.and_then(|(clip, time)| clip.visible(slot, time)).unwrap_or(node.visible);
            visible.push(own && node.parent.is_none_or(|parent| visible[parent]));
        }
        visible
    }

    /// Whether animations may move the node in `slot`.
    pub(super) fn has_parts(&self, slot: usize) -> bool {
        matches!(self.nodes[slot].local, Local::Parts(_))
    }

    /// From each node to the world, by slot: at a time of `clip` in seconds, or in the rest pose.
    ///
    /// # Errors
    /// The index in the file of the first node whose transform is not finite.
    pub(super) fn worlds(&self, clip: Option<(&Clip, f32)>) -> Result<Vec<Affine3A>, usize> {
        let mut locals: Vec<_> = self.nodes.iter().map(|node| node.local).collect();
        if let Some((clip, time)) = clip {
            clip.pose(time, &mut locals);
        }
        let mut worlds: Vec<Affine3A> = Vec::with_capacity(locals.len());
        for (node, local) in self.nodes.iter().zip(locals) {
            let local = match local {
                Local::Matrix(matrix) => matrix,
                Local::Parts(Parts { translation, rotation, scale }) => {
                    Affine3A::from_scale_rotation_translation(scale, rotation, translation)
                }
            };
            let to_world = node.parent.map_or(local, |parent| worlds[parent] * local);
            if !to_world.is_finite() {
                return Err(node.index);
            }
            worlds.push(to_world);
        }
        Ok(worlds)
    }
}

/// Root nodes of the scene to show, with the place that names them.
fn roots(document: &Document<'_>) -> Result<Vec<(usize, String)>, SceneError> {
    let root = &document.root;
    let chosen = root.scene.unwrap_or(0);
    if root.scenes.is_empty() && root.scene.is_none() {
        document.warn("scenes", "the file has no scene: all of its nodes are drawn");
        let mut child = vec![false; root.nodes.len()];
        for &index in root.nodes.iter().flat_map(|node| &node.children) {
            if let Some(child) = child.get_mut(index) {
                *child = true;
            }
        }
        let is_root = |&index: &usize| !child[index];
        return Ok((0..root.nodes.len()).filter(is_root).map(|i| (i, format!("nodes[{i}]"))).collect());
    }
    let scene = document.get(&root.scenes, chosen, "scenes", "scene")?;
    let place = |(i, &node): (usize, &usize)| (node, format!("scenes[{chosen}].nodes[{i}]"));
    Ok(scene.nodes.iter().enumerate().map(place).collect())
}

fn local(document: &Document<'_>, node: &Node, own: &str) -> Result<Local, SceneError> {
    let Some(matrix) = &node.matrix else {
        let rotation = Quat::from_array(node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]));
        if !(rotation.length_squared() > 0.0 && rotation.is_finite()) {
            let message = format!("is {:?}, expected a unit quaternion", rotation.to_array());
            return Err(document.invalid(&format!("{own}.rotation"), message));
        }
        let scale = Vec3::from_array(node.scale.unwrap_or([1.0; 3]));
        let translation = Vec3::from_array(node.translation.unwrap_or([0.0; 3]));
        return Ok(Local::Parts(Parts { translation, rotation: rotation.normalize(), scale }));
    };
    if node.translation.is_some() || node.rotation.is_some() || node.scale.is_some() {
        let message = "has a matrix beside translation, rotation or scale, expected one or the other";
        return Err(document.invalid(own, message));
    }
    let matrix = affine(matrix).ok_or_else(|| {
        let message = "expected an affine matrix: its last row 0, 0, 0, 1";
        document.invalid(&format!("{own}.matrix"), message)
    })?;
    Ok(Local::Matrix(matrix))
}

/// A column-major matrix as an affine transform; `None` where it is projective.
pub(super) fn affine(matrix: &[f32; 16]) -> Option<Affine3A> {
    let matrix = Mat4::from_cols_array(matrix);
    (matrix.row(3) == Vec4::W).then(|| Affine3A::from_mat4(matrix))
}
