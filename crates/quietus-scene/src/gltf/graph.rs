//! Collects what the nodes of the scene hold: meshes, cameras and lights.

use std::collections::{HashMap, HashSet};

use glam::{Affine3A, Quat, Vec3};
use quietus_trace::desc::{Camera, FrameAxis, Instance, Light, Projection, SpotFalloff};

use super::animation::{self, Clip};
use super::changes::Originals;
use super::choice;
use super::document::Document;
use super::hierarchy::Hierarchy;
use super::material::Materials;
use super::mesh::{self, Figure};
use super::schema::{self, Node};
use super::skin::Skin;
use super::stage::{Model, Stage};
use super::strokes;
use super::variants;
use crate::error::{SceneError, Warnings};

/// Reads everything that the scene to be shown refers to.
pub(super) fn read(document: Document<'_>) -> Result<Stage, SceneError> {
    let hierarchy = Hierarchy::read(&document)?;
    let clips = animation::clips(&document, &hierarchy)?;
    // Where animations show and hide nodes, all may be seen some time.
    let mut seen = hierarchy.visible(None);
    if clips.iter().any(Clip::changes_visibility) {
        seen.fill(true);
    }
    let mut reader = Reader::new(&document, &hierarchy, seen);
    for (slot, index) in hierarchy.indices().enumerate() {
        reader.read_node(slot, index)?;
    }
    let pictures = reader.materials.load_pictures()?;
    let Reader { materials, figures, skins, models, cameras, lights, .. } = reader;
    let originals = document.originals.as_ref().map(|originals| Originals {
        materials: materials.ids.clone(),
        textures: materials.texture_ids.clone(),
        pictures,
        cameras: reader.camera_sources,
        lights: reader.light_sources,
        ..originals.clone()
    });
    let Materials { materials, textures, media, .. } = materials;
    let scenes = choice::scene_names(&document.root);
    let variants = variants::names(&document.root);
    let mut stage = Stage {
        file: document.file().to_path_buf(),
        hierarchy,
        clips,
        scenes,
        variants,
        figures,
        skins,
        models,
        cameras,
        lights,
        materials,
        textures,
        media,
        originals,
        geometry_bytes: 0,
        warnings: Warnings::default(),
    };
    strokes::thicken(&mut stage, &document)?;
    stage.geometry_bytes = document.geometry_bytes();
    stage.warnings = document.into_warnings();
    Ok(stage)
}

struct Reader<'d, 'f> {
    document: &'d Document<'f>,
    hierarchy: &'d Hierarchy,
    materials: Materials<'d, 'f>,
    figures: HashMap<usize, Figure>,
    /// Meshes that some node of the scene hangs on a skin.
    skinned: HashSet<usize>,
    skins: HashMap<usize, Skin>,
    models: Vec<Model>,
    cameras: Vec<(usize, Camera)>,
    /// Names of cameras, and the number that the next of the same name gets.
    names: HashMap<String, usize>,
    lights: Vec<(usize, Light)>,
    /// Their indices in the file.
    camera_sources: Vec<usize>,
    light_sources: Vec<usize>,
    /// Whether what nodes hold, cameras aside, may be seen, by slot.
    seen: Vec<bool>,
}

impl<'d, 'f> Reader<'d, 'f> {
    /// One that has read nothing yet.
    fn new(document: &'d Document<'f>, hierarchy: &'d Hierarchy, seen: Vec<bool>) -> Self {
        let nodes = hierarchy.indices().map(|index| &document.root.nodes[index]);
        Self {
            document,
            hierarchy,
            materials: Materials::new(document),
            figures: HashMap::new(),
            skinned: nodes.filter(|node| node.skin.is_some()).filter_map(|node| node.mesh).collect(),
            skins: HashMap::new(),
            models: Vec::new(),
            cameras: Vec::new(),
            names: HashMap::new(),
            lights: Vec::new(),
            camera_sources: Vec::new(),
            light_sources: Vec::new(),
            seen,
        }
    }

    fn read_node(&mut self, slot: usize, index: usize) -> Result<(), SceneError> {
        let document = self.document;
        let node = &document.root.nodes[index];
        let own = format!("nodes[{index}]");
        let seen = self.seen[slot];
        if let Some(mesh) = node.mesh.filter(|_| seen) {
            self.read_model(slot, node, mesh, &own)?;
        }
        if let Some(index) = node.camera {
            let camera = camera(document, index, &format!("{own}.camera"))?;
            let source = &document.root.cameras[index];
            let name = self.camera_name([&source.name, &node.name, &format!("cameras[{index}]")]);
            self.cameras.push((slot, Camera { name, ..camera }));
            self.camera_sources.push(index);
        }
        if let Some(source) = node.extensions.light.as_ref().filter(|_| seen) {
            self.lights.push((slot, light(document, source.light, &own)?));
            self.light_sources.push(source.light);
        }
        Ok(())
    }

    fn read_model(&mut self, slot: usize, node: &Node, mesh: usize, own: &str) -> Result<(), SceneError> {
        let document = self.document;
        if !self.figures.contains_key(&mesh) {
            let skinned = self.skinned.contains(&mesh);
            let figure = mesh::figure(document, &mut self.materials, mesh, skinned, &format!("{own}.mesh"))?;
            self.figures.insert(mesh, figure);
        }
        let figure = &self.figures[&mesh];
        if let Some(skin) = node.skin {
            if !self.skins.contains_key(&skin) {
                let read = Skin::read(document, self.hierarchy, skin, &format!("{own}.skin"))?;
                self.skins.insert(skin, read);
            }
            let joints = self.skins[&skin].len();
            let last = figure.parts.iter().map(|part| part.influences.last_joint()).max().unwrap_or(0);
            if last >= joints {
                let message = format!("has {joints} joints, but meshes[{mesh}] hangs on joint {last}");
                return Err(document.invalid(&format!("skins[{skin}].joints"), message));
            }
        }
        let weights = match &node.weights {
            Some(weights) => mesh::check_weights(document, weights.clone(), figure.weights.len(), own)?,
            None => figure.weights.clone(),
        };
        let copies = match &node.extensions.instancing {
            None => vec![Affine3A::IDENTITY],
            Some(_) if node.skin.is_some() => {
                document.warn(own, "has instances of a skinned mesh: only one is drawn");
                vec![Affine3A::IDENTITY]
            }
            Some(source) => copies(document, source, own)?,
        };
        self.models.push(Model { slot, mesh, skin: node.skin, weights, copies });
        Ok(())
    }

    /// The first name that is not empty, made unique by a number.
    fn camera_name(&mut self, names: [&str; 3]) -> String {
        let name = names.into_iter().find(|name| !name.is_empty()).unwrap_or_default();
        let mut unique = name.to_owned();
        while self.names.contains_key(&unique) {
            let number = self.names.entry(name.to_owned()).or_insert(2);
            unique = format!("{name} {number}");
            *number += 1;
        }
        self.names.insert(unique.clone(), 2);
        unique
    }
}

/// Where EXT_mesh_gpu_instancing places the mesh of the node `own`, seen from that node.
fn copies(
    document: &Document<'_>,
    source: &schema::Instancing,
    own: &str,
) -> Result<Vec<Affine3A>, SceneError> {
    let own = format!("{own}.extensions.EXT_mesh_gpu_instancing.attributes");
    let at = |name: &str| Some((*source.attributes.get(name)?, format!("{own}.{name}")));
    let (moves, turns, scales) = (at("TRANSLATION"), at("ROTATION"), at("SCALE"));
    let mut counts = Vec::new();
    for (index, place) in [&moves, &turns, &scales].into_iter().flatten() {
        counts.push(document.accessor_count(*index, place)?);
    }
    let Some(&count) = counts.first() else {
        let message = "has neither TRANSLATION nor ROTATION nor SCALE, expected at least one of them";
        return Err(document.invalid(&own, message));
    };
    if counts.iter().any(|&other| other != count) {
        return Err(document.invalid(&own, format!("have {counts:?} elements, expected equal numbers")));
    }
    document.claim_geometry(&own, count.saturating_mul(size_of::<(Affine3A, Instance)>() as u64))?;
    let vectors = |at: Option<(usize, String)>| {
        at.map(|(index, place)| document.read_floats(index, &place, &["VEC3"], [0.0; 3])).transpose()
    };
    let (moves, scales) = (vectors(moves)?, vectors(scales)?);
    let turns = turns.map(|(index, place)| animation::rotations(document, index, &place)).transpose()?;
    let copy = |i: usize| {
        let scale = scales.as_ref().map_or(Vec3::ONE, |scales| Vec3::from_array(scales[i]));
        let rotation = turns.as_ref().map_or(Quat::IDENTITY, |turns| Quat::from_array(turns[i]));
        let translation = moves.as_ref().map_or(Vec3::ZERO, |moves| Vec3::from_array(moves[i]));
        Affine3A::from_scale_rotation_translation(scale, rotation, translation)
    };
    Ok((0..count as usize).map(copy).collect())
}

/// Camera `index`, referred to from `place`, in the origin and without a name.
pub(super) fn camera(document: &Document<'_>, index: usize, place: &str) -> Result<Camera, SceneError> {
    let camera = document.get(&document.root.cameras, index, "cameras", place)?;
    let place = format!("cameras[{index}]");
    let still = Camera::perspective("", Affine3A::IDENTITY, 1.0);
    let invalid = |name: &str, message: String| document.invalid(&format!("{place}.{name}"), message);
    let above_0 = |value: f32| value > 0.0 && value.is_finite();
    match (camera.kind.as_str(), &camera.perspective, &camera.orthographic) {
        ("perspective", Some(source), _) => {
            let (fov, aspect) = (source.yfov, source.aspect_ratio);
            if !(fov > 0.0 && fov < std::f32::consts::PI) {
                let message = format!("is {fov}, expected an angle between 0 and pi");
                return Err(invalid("perspective.yfov", message));
            }
            if let Some(aspect) = aspect.filter(|&aspect| !above_0(aspect)) {
                let message = format!("is {aspect}, expected a number above 0");
                return Err(invalid("perspective.aspectRatio", message));
            }
            Ok(Camera {
                projection: Projection::Perspective { fov, axis: FrameAxis::Vertical },
                aspect,
                ..still
            })
        }
        ("orthographic", _, Some(source)) => {
            // Negative magnifications are allowed, and discouraged: they would turn the picture around.
            let (width, height) = (source.xmag.abs(), source.ymag.abs());
            if !(above_0(width) && above_0(height) && above_0(width / height)) {
                let message =
                    format!("is {} by {}, expected numbers that are not 0", source.xmag, source.ymag);
                return Err(invalid("orthographic", message));
            }
            let projection = Projection::Orthographic { extent: 2.0 * height, axis: FrameAxis::Vertical };
            Ok(Camera { projection, aspect: Some(width / height), ..still })
        }
        (kind @ ("perspective" | "orthographic"), ..) => {
            Err(document.invalid(&place, format!("has no \"{kind}\"")))
        }
        (kind, ..) => Err(invalid("type", format!("is \"{kind}\", expected perspective or orthographic"))),
    }
}

/// Light `index`, held by the node `own`, in the origin and shining to -z.
pub(super) fn light(document: &Document<'_>, index: usize, own: &str) -> Result<Light, SceneError> {
    let lights = document.root.extensions.lights.as_ref().map_or(&[][..], |lights| &lights.lights);
    let name = "extensions.KHR_lights_punctual.lights";
    let source = document.get(lights, index, name, &format!("{own}.{name}"))?;
    let place = format!("{name}[{index}]");
    let color = Vec3::from_array(source.color.unwrap_or([1.0; 3]));
    let strength = color * source.intensity.unwrap_or(1.0);
    if !(strength.is_finite() && strength.min_element() >= 0.0) {
        let message = format!("color times intensity is {strength}, expected finite numbers of at least 0");
        return Err(document.invalid(&place, message));
    }
    if source.range.is_some() {
        let message = "is not supported: light falls off with the distance's square";
        document.warn(&format!("{place}.range"), message);
    }
    let (position, direction) = (Vec3::ZERO, Vec3::NEG_Z);
    match source.kind.as_str() {
        "point" => Ok(Light::Point { position, intensity: strength }),
        "directional" => Ok(Light::Directional { direction, irradiance: strength }),
        "spot" => {
            let (inner_angle, outer_angle) = cone(document, &source.spot, &place)?;
            let falloff = SpotFalloff::Square;
            Ok(Light::Spot { position, direction, intensity: strength, inner_angle, outer_angle, falloff })
        }
        kind => {
            let message = format!("is \"{kind}\", expected point, spot or directional");
            Err(document.invalid(&format!("{place}.type"), message))
        }
    }
}

fn cone(document: &Document<'_>, spot: &schema::Spot, place: &str) -> Result<(f32, f32), SceneError> {
    let (inner, outer) = (spot.inner_cone_angle, spot.outer_cone_angle);
    if inner >= 0.0 && inner < outer && outer <= std::f32::consts::FRAC_PI_2 {
        return Ok((inner, outer));
    }
    let message = format!("cone angles {inner} and {outer}, expected 0 <= inner < outer <= pi/2");
    Err(document.invalid(&format!("{place}.spot"), message))
}
