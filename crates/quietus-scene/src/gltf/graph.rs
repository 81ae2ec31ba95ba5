//! The hierarchy of nodes: places objects, lights and cameras in the world.

use std::collections::HashMap;

use glam::{Affine3A, Mat3, Mat4, Quat, Vec3, Vec4};
use quietus_trace::desc::{Camera, Instance, Light, ObjectId, SceneDesc, SpotFalloff};

use super::document::Document;
use super::material::Materials;
use super::mesh;
use super::schema::{self, Node};
use crate::error::SceneError;

/// Builds the scene that the document says is to be shown.
pub(super) fn build(document: &Document<'_>) -> Result<SceneDesc, SceneError> {
    if !document.root.animations.is_empty() {
        document.warn("animations", "animations are not supported: the rest pose is drawn");
    }
    let placed = place_nodes(document)?;
    let mut builder = Builder {
        document,
        worlds: placed.iter().copied().collect(),
        scene: SceneDesc::default(),
        materials: Materials::new(document),
        objects: HashMap::new(),
    };
    for (index, to_world) in placed {
        builder.add_node(index, to_world)?;
    }
    let Materials { materials, textures, .. } = builder.materials;
    Ok(SceneDesc { materials, textures, ..builder.scene })
}

/// Nodes of the scene, each with its transform to the world, parents before children.
fn place_nodes(document: &Document<'_>) -> Result<Vec<(usize, Affine3A)>, SceneError> {
    let nodes = &document.root.nodes;
    let mut visited = vec![false; nodes.len()];
    let mut placed = Vec::new();
    let mut waiting: Vec<_> =
        roots(document)?.into_iter().rev().map(|(i, at)| (i, Affine3A::IDENTITY, at)).collect();
    while let Some((index, parent, place)) = waiting.pop() {
        let node = document.get(nodes, index, "nodes", &place)?;
        if std::mem::replace(&mut visited[index], true) {
            let message =
                format!("refers to nodes[{index}] a second time, expected a hierarchy without cycles");
            return Err(document.invalid(&place, message));
        }
        let own = format!("nodes[{index}]");
        let to_world = parent * local_transform(document, node, &own)?;
        if !to_world.is_finite() {
            return Err(document.invalid(&own, "its transform to the world is not finite"));
        }
        placed.push((index, to_world));
        for (i, &child) in node.children.iter().enumerate().rev() {
            waiting.push((child, to_world, format!("{own}.children[{i}]")));
        }
    }
    Ok(placed)
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
    if root.scenes.len() > 1 {
        let message = format!("the file has {} scenes: only scenes[{chosen}] is drawn", root.scenes.len());
        document.warn("scenes", message);
    }
    let place = |(i, &node): (usize, &usize)| (node, format!("scenes[{chosen}].nodes[{i}]"));
    Ok(scene.nodes.iter().enumerate().map(place).collect())
}

fn local_transform(document: &Document<'_>, node: &Node, own: &str) -> Result<Affine3A, SceneError> {
    let Some(matrix) = &node.matrix else {
        let rotation = Quat::from_array(node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]));
        if !(rotation.length_squared() > 0.0 && rotation.is_finite()) {
            let message = format!("is {:?}, expected a unit quaternion", rotation.to_array());
            return Err(document.invalid(&format!("{own}.rotation"), message));
        }
        let scale = Vec3::from_array(node.scale.unwrap_or([1.0; 3]));
        let translation = Vec3::from_array(node.translation.unwrap_or([0.0; 3]));
        return Ok(Affine3A::from_scale_rotation_translation(scale, rotation.normalize(), translation));
    };
    if node.translation.is_some() || node.rotation.is_some() || node.scale.is_some() {
        let message = "has a matrix beside translation, rotation or scale, expected one or the other";
        return Err(document.invalid(own, message));
    }
    affine(matrix).ok_or_else(|| {
        let message = "expected an affine matrix: its last row 0, 0, 0, 1";
        document.invalid(&format!("{own}.matrix"), message)
    })
}

/// A column-major matrix as an affine transform; `None` where it is projective.
fn affine(matrix: &[f32; 16]) -> Option<Affine3A> {
    let matrix = Mat4::from_cols_array(matrix);
    (matrix.row(3) == Vec4::W).then(|| Affine3A::from_mat4(matrix))
}

struct Builder<'d, 'f> {
    document: &'d Document<'f>,
    /// Transforms of the scene's nodes.
    worlds: HashMap<usize, Affine3A>,
    scene: SceneDesc,
    materials: Materials<'d, 'f>,
    /// Objects by index of their mesh.
    objects: HashMap<usize, ObjectId>,
}

impl Builder<'_, '_> {
    fn add_node(&mut self, index: usize, to_world: Affine3A) -> Result<(), SceneError> {
        let document = self.document;
        let node = &document.root.nodes[index];
        let own = format!("nodes[{index}]");
        if let Some(mesh) = node.mesh {
            let to_world = match node.skin {
                Some(skin) => self.bind_pose(skin, &own)?,
                None => to_world,
            };
            self.add_instance(mesh, to_world, &own)?;
        }
        if let Some(camera) = node.camera {
            self.add_camera(camera, node, to_world, &own)?;
        }
        if let Some(light) = &node.extensions.light {
            self.add_light(light.light, to_world, &own)?;
        }
        Ok(())
    }

    fn add_instance(&mut self, mesh: usize, to_world: Affine3A, own: &str) -> Result<(), SceneError> {
        if !to_world.inverse().is_finite() {
            warn_flat(self.document, own);
            return Ok(());
        }
        let object = match self.objects.get(&mesh) {
            Some(&object) => object,
            None => {
                let object = mesh::object(self.document, &mut self.materials, mesh, &format!("{own}.mesh"))?;
                let id = ObjectId(self.scene.objects.len() as u32);
                self.scene.objects.push(object);
                self.objects.insert(mesh, id);
                id
            }
        };
        if !self.scene.objects[object.0 as usize].shapes.is_empty() {
            self.scene.instances.push(Instance::still(object, to_world));
        }
        Ok(())
    }

    /// Where a skinned mesh stands while its joints are where they were bound: the node's own transform does not
    /// count (specification, section 3.7.3.3), any joint's transform after its inverse bind matrix does.
    fn bind_pose(&self, skin: usize, own: &str) -> Result<Affine3A, SceneError> {
        let document = self.document;
        document.warn(own, "skins are not supported: the mesh is drawn in its bind pose");
        let place = format!("skins[{skin}]");
        let source = document.get(&document.root.skins, skin, "skins", &format!("{own}.skin"))?;
        let Some(joint) = source.joints.first() else {
            return Err(document.invalid(&format!("{place}.joints"), "is empty, expected at least one joint"));
        };
        document.get(&document.root.nodes, *joint, "nodes", &format!("{place}.joints[0]"))?;
        let joint = self.worlds.get(joint).copied().unwrap_or(Affine3A::IDENTITY);
        let Some(index) = source.inverse_bind_matrices else { return Ok(joint) };
        let place = format!("{place}.inverseBindMatrices");
        let matrices = document.read_floats(index, &place, &["MAT4"], [0.0; 16])?;
        let inverse = matrices.first().and_then(affine).filter(|inverse| (joint * *inverse).is_finite());
        let inverse =
            inverse.ok_or_else(|| document.invalid(&place, "expected an affine matrix per joint"))?;
        Ok(joint * inverse)
    }

    fn add_camera(
        &mut self,
        index: usize,
        node: &Node,
        to_world: Affine3A,
        own: &str,
    ) -> Result<(), SceneError> {
        let document = self.document;
        let camera = document.get(&document.root.cameras, index, "cameras", &format!("{own}.camera"))?;
        let place = format!("cameras[{index}]");
        let perspective = match (camera.kind.as_str(), &camera.perspective) {
            ("perspective", Some(perspective)) => perspective,
            ("perspective", None) => return Err(document.invalid(&place, "has no \"perspective\"")),
            ("orthographic", _) => {
                document.warn(&place, "orthographic cameras are not supported: it is left out");
                return Ok(());
            }
            (kind, _) => {
                let message = format!("is \"{kind}\", expected perspective or orthographic");
                return Err(document.invalid(&format!("{place}.type"), message));
            }
        };
        let Some(to_world) = rigid(to_world) else {
            warn_flat(document, own);
            return Ok(());
        };
        let (fov_y, aspect) = (perspective.yfov, perspective.aspect_ratio);
        if !(fov_y > 0.0 && fov_y < std::f32::consts::PI) {
            let message = format!("is {fov_y}, expected an angle between 0 and pi");
            return Err(document.invalid(&format!("{place}.perspective.yfov"), message));
        }
        if aspect.is_some_and(|aspect| !(aspect > 0.0 && aspect.is_finite())) {
            let message = format!("is {}, expected a number above 0", aspect.unwrap_or_default());
            return Err(document.invalid(&format!("{place}.perspective.aspectRatio"), message));
        }
        let name = self.camera_name([&camera.name, &node.name, &place]);
        self.scene.cameras.push(Camera { aspect, ..Camera::perspective(name, to_world, fov_y) });
        Ok(())
    }

    /// The first name that is not empty, made unique by a number.
    fn camera_name(&self, names: [&str; 3]) -> String {
        let name = names.into_iter().find(|name| !name.is_empty()).unwrap_or_default();
        let taken = |name: &str| self.scene.cameras.iter().any(|camera| camera.name == name);
        if !taken(name) {
            return name.to_owned();
        }
        let mut numbered = (2..).map(|number| format!("{name} {number}"));
        numbered.find(|name| !taken(name)).unwrap_or_default()
    }

    fn add_light(&mut self, index: usize, to_world: Affine3A, own: &str) -> Result<(), SceneError> {
        let document = self.document;
        let lights = document.root.extensions.lights.as_ref().map_or(&[][..], |lights| &lights.lights);
        let name = "extensions.KHR_lights_punctual.lights";
        let source = document.get(lights, index, name, &format!("{own}.{name}"))?;
        let place = format!("{name}[{index}]");
        let color = Vec3::from_array(source.color.unwrap_or([1.0; 3]));
        let strength = color * source.intensity.unwrap_or(1.0);
        if !(strength.is_finite() && strength.min_element() >= 0.0) {
            let message =
                format!("color times intensity is {strength}, expected finite numbers of at least 0");
            return Err(document.invalid(&place, message));
        }
        if source.range.is_some() {
            document.warn(
                &format!("{place}.range"),
                "is not supported: light falls off with the distance's square",
            );
        }
        let Some(pose) = rigid(to_world) else {
            warn_flat(document, own);
            return Ok(());
        };
        let (position, direction) = (Vec3::from(pose.translation), -Vec3::from(pose.matrix3.z_axis));
        let light = match source.kind.as_str() {
            "point" => Light::Point { position, intensity: strength },
            "directional" => Light::Directional { direction, irradiance: strength },
            "spot" => {
                let (inner_angle, outer_angle) = self.cone(&source.spot, &place)?;
                Light::Spot {
                    position,
                    direction,
                    intensity: strength,
                    inner_angle,
                    outer_angle,
                    falloff: SpotFalloff::Square,
                }
            }
            kind => {
                let message = format!("is \"{kind}\", expected point, spot or directional");
                return Err(document.invalid(&format!("{place}.type"), message));
            }
        };
        self.scene.lights.push(light);
        Ok(())
    }

    fn cone(&self, spot: &schema::Spot, place: &str) -> Result<(f32, f32), SceneError> {
        let (inner, outer) = (spot.inner_cone_angle, spot.outer_cone_angle);
        if inner >= 0.0 && inner < outer && outer <= std::f32::consts::FRAC_PI_2 {
            return Ok((inner, outer));
        }
        let message = format!("cone angles {inner} and {outer}, expected 0 <= inner < outer <= pi/2");
        Err(self.document.invalid(&format!("{place}.spot"), message))
    }
}

fn warn_flat(document: &Document<'_>, own: &str) {
    document.warn(own, "is scaled to nothing: what it holds is left out");
}

/// The pose of `transform` without scale, shear and mirroring: -z and +y are kept as far as they are at right
/// angles. `None` where they have no directions.
fn rigid(transform: Affine3A) -> Option<Affine3A> {
    let back = Vec3::from(transform.matrix3.z_axis).try_normalize()?;
    let right = Vec3::from(transform.matrix3.y_axis).cross(back).try_normalize()?;
    let axes = Mat3::from_cols(right, back.cross(right), back);
    Some(Affine3A::from_mat3_translation(axes, Vec3::from(transform.translation)))
}
