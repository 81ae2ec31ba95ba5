//! A whole file, read: everything that all moments of it share, from which any of them can be made.

use std::cell::Cell;
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

use glam::{Affine3A, Mat3, Vec3};
use quietus_trace::desc::{
    Camera, Geometry, Instance, Light, Material, MaterialId, Medium, MediumInterface, Mesh, Object, ObjectId,
    SceneDesc, Shape, Texture,
};

use super::animation::Clip;
use super::changes::{Changed, Originals};
use super::deform::{self, Bend, Vertices, deform};
use super::document::MAX_GEOMETRY_BYTES;
use super::hierarchy::Hierarchy;
use super::mesh::{Figure, Part};
use super::skin::Skin;
use crate::error::{ErrorKind, SceneError, Warnings};

/// Most memory that a vertex of a mesh takes, with all that a mesh can say of it.
const VERTEX_BYTES: u64 = 96;

/// A file, ready to be looked at. Slots are those of the hierarchy; figures and skins go by their index in the file.
#[derive(Clone, Debug)]
pub(crate) struct Stage {
    pub(super) file: PathBuf,
    pub(super) hierarchy: Hierarchy,
    pub(super) clips: Vec<Clip>,
    /// Names of the file's scenes.
    pub(super) scenes: Vec<String>,
    /// Names of the file's variants of materials.
    pub(super) variants: Vec<String>,
    pub(super) figures: HashMap<usize, Figure>,
    pub(super) skins: HashMap<usize, Skin>,
    pub(super) models: Vec<Model>,
    /// Slot, and the camera as if its node stood in the origin.
    pub(super) cameras: Vec<(usize, Camera)>,
    /// Slot, and the light as if its node stood in the origin.
    pub(super) lights: Vec<(usize, Light)>,
    pub(super) materials: Vec<Material>,
    pub(super) textures: Vec<Texture>,
    pub(super) media: Vec<Medium>,
    /// Where animations change materials, lights or cameras.
    pub(super) originals: Option<Originals>,
    pub(super) geometry_bytes: u64,
    pub(super) warnings: Warnings,
}

/// A node that shows a mesh.
#[derive(Clone, Debug)]
pub(super) struct Model {
    pub slot: usize,
    pub mesh: usize,
    pub skin: Option<usize>,
    /// Weights of its morph targets in the rest pose.
    pub weights: Vec<f32>,
    /// Where it stands, seen from its node: once, or many times.
    pub copies: Vec<Affine3A>,
}

/// When a picture is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Moment {
    /// In no animation: the pose that the file stores.
    Rest,
    /// While the animation `clip` runs from one time to another, in seconds.
    Clip {
        /// Its index, in range.
        clip: usize,
        /// When the shutter opens and closes.
        shutter: [f32; 2],
    },
}

impl Stage {
    /// Names and lengths of the animations.
    pub(crate) fn clips(&self) -> impl ExactSizeIterator<Item = (&str, f32)> {
        self.clips.iter().map(|clip| (clip.name.as_str(), clip.seconds))
    }

    /// Names of the file's scenes.
    pub(crate) fn scenes(&self) -> &[String] {
        &self.scenes
    }

    /// Names of the file's variants of materials.
    pub(crate) fn variants(&self) -> &[String] {
        &self.variants
    }

    /// The scene at `moment`, without anything that the file lacks, and what is to be said of it.
    pub(crate) fn scene(&self, moment: Moment) -> Result<(SceneDesc, Warnings), SceneError> {
        let (clip, [opens, closes]) = match moment {
            Moment::Rest => (None, [0.0; 2]),
            Moment::Clip { clip, shutter } => (Some(&self.clips[clip]), shutter),
        };
        let open = self.pose(clip.map(|clip| (clip, opens)))?;
        let close = if closes > opens { Some(self.pose(clip.map(|clip| (clip, closes)))?) } else { None };
        let visible = self.hierarchy.visible(clip.map(|clip| (clip, opens)));
        let mut changed = Changed {
            materials: self.materials.clone(),
            textures: self.textures.clone(),
            media: self.media.clone(),
            ..Changed::default()
        };
        if let (Some(originals), Some(clip)) = (&self.originals, clip) {
            changed = originals.apply(&clip.changes, opens, &self.file, changed)?;
        }
        let Changed { materials, textures, media, instead, cameras, lights } = changed;
        let scene = SceneDesc { materials, textures, media, ..SceneDesc::default() };
        let geometry_bytes = Cell::new(self.geometry_bytes);
        let warnings = self.warnings.clone();
        let objects = HashMap::new();
        let mut take = Take { stage: self, open, close, scene, objects, instead, geometry_bytes, warnings };
        for (index, model) in self.models.iter().enumerate().filter(|(_, model)| visible[model.slot]) {
            take.add_model(index, model)?;
        }
        for (i, (slot, camera)) in self.cameras.iter().enumerate() {
            let changed =
                cameras.get(&i).map(|changed| Camera { name: camera.name.clone(), ..changed.clone() });
            take.add_camera(*slot, changed.as_ref().unwrap_or(camera));
        }
        for (i, (slot, light)) in self.lights.iter().enumerate().filter(|(_, light)| visible[light.0]) {
            take.add_light(*slot, lights.get(&i).unwrap_or(light));
        }
        Ok((take.scene, take.warnings))
    }

    /// From nodes to the world in the rest pose, by slot.
    pub(super) fn rest_worlds(&self) -> Result<Vec<Affine3A>, SceneError> {
        Ok(self.pose(None)?.worlds)
    }

    fn pose(&self, at: Option<(&Clip, f32)>) -> Result<Pose, SceneError> {
        let worlds = self.hierarchy.worlds(at).map_err(|index| {
            let when = at.map_or_else(String::new, |(clip, time)| format!(" at {time} s of {}", clip.name));
            let message = format!("its transform to the world is not finite{when}");
            SceneError::new(ErrorKind::Invalid, &self.file, format!("nodes[{index}]"), message)
        })?;
        let weights = self.models.iter().map(|model| {
            let changed = at.and_then(|(clip, time)| clip.weights(model.slot, time));
            changed.unwrap_or_else(|| model.weights.clone())
        });
        Ok(Pose { weights: weights.collect(), worlds })
    }
}

/// Where everything is at one time.
struct Pose {
    /// From nodes to the world, by slot.
    worlds: Vec<Affine3A>,
    /// Weights of morph targets, by model.
    weights: Vec<Vec<f32>>,
}

/// What decides the form of an object: its mesh, its skin, and the weights of its targets (as bits) when the shutter
/// opens and closes.
type Form = (usize, Option<usize>, [Vec<u32>; 2]);

/// A scene in the making.
struct Take<'a> {
    stage: &'a Stage,
    /// When the shutter opens.
    open: Pose,
    /// When it closes, if it does not do so at once.
    close: Option<Pose>,
    scene: SceneDesc,
    objects: HashMap<Form, ObjectId>,
    /// What stands in for materials, and what is inside of them.
    instead: HashMap<MaterialId, (MaterialId, Option<MediumInterface>)>,
    geometry_bytes: Cell<u64>,
    warnings: Warnings,
}

impl Take<'_> {
    fn add_model(&mut self, index: usize, model: &Model) -> Result<(), SceneError> {
        // The transform of a skinned mesh's own node does not count (specification, section 3.7.3.3).
        let (to_world, end_to_world) = match model.skin {
            Some(_) => (Affine3A::IDENTITY, None),
            None => self.motion(model.slot),
        };
        let object = self.object(index, model)?;
        if self.scene.objects[object.0 as usize].shapes.is_empty() {
            return Ok(());
        }
        for copy in &model.copies {
            let end_to_world = end_to_world.map(|end| end * *copy);
            self.add_instance(model.slot, object, to_world * *copy, end_to_world);
        }
        Ok(())
    }

    fn add_instance(&mut self, slot: usize, object: ObjectId, to_world: Affine3A, end: Option<Affine3A>) {
        if !to_world.inverse().is_finite() {
            return self.warn_flat(slot);
        }
        let end_to_world = end.filter(|end| {
            let mirrors = [end, &to_world].map(|transform| deform::mirror(&transform.matrix3));
            let sound = end.inverse().is_finite() && mirrors[0] == mirrors[1];
            if !sound {
                let message = "is turned inside out or flattened while the shutter is open: it stands still";
                self.warn(slot, message);
            }
            sound
        });
        self.scene.instances.push(Instance { object, to_world, end_to_world });
    }

    /// The object that `model` shows; models of the same form share theirs.
    fn object(&mut self, index: usize, model: &Model) -> Result<ObjectId, SceneError> {
        let weights =
            [Some(&self.open), self.close.as_ref()].map(|pose| pose.map(|pose| &pose.weights[index]));
        let bits = weights.map(|weights| weights.into_iter().flatten().map(|w| w.to_bits()).collect());
        let form = (model.mesh, model.skin, bits);
        if let Some(&id) = self.objects.get(&form) {
            return Ok(id);
        }
        let stage = self.stage;
        let figure = &stage.figures[&model.mesh];
        let mut shapes = Vec::with_capacity(figure.parts.len());
        for part in &figure.parts {
            shapes.push(self.shape(index, model, part)?);
        }
        let id = ObjectId(self.scene.objects.len() as u32);
        self.scene.objects.push(Object { name: figure.name.clone(), shapes });
        self.objects.insert(form, id);
        Ok(id)
    }

    /// A part of the model `index`, bent as it is when the shutter opens and closes.
    fn shape(&self, index: usize, model: &Model, part: &Part) -> Result<Shape, SceneError> {
        let unchanged = (part.material, part.media);
        let (material, media) = self.instead.get(&part.material).copied().unwrap_or(unchanged);
        let joints = |pose: &Pose| match model.skin {
            Some(skin) => self.stage.skins[&skin].matrices(&pose.worlds),
            None => Vec::new(),
        };
        let opening = joints(&self.open);
        let weights = &self.open.weights[index];
        let closing = self.close.as_ref().map(|pose| (joints(pose), &pose.weights[index]));
        let closing =
            closing.filter(|(joints, weights)| *joints != opening || *weights != &self.open.weights[index]);
        if closing.is_none() && model.skin.is_none() && weights.iter().all(|&weight| weight == 0.0) {
            return Ok(Shape { media, ..Shape::new(Geometry::Mesh(Arc::clone(&part.mesh)), material) });
        }
        self.claim(part, index)?;
        let bent = |weights: &[f32], joints: &[Affine3A]| {
            deform(&part.mesh, &part.targets, &part.influences, Bend { weights, joints })
        };
        let start = bent(weights, &opening);
        let end = closing.map(|(joints, weights)| bent(weights, &joints)).unwrap_or_default();
        self.check_finite(index, &start)?;
        self.check_finite(index, &end)?;
        let mesh = Mesh {
            positions: start.positions,
            normals: start.normals,
            tangents: start.tangents,
            end_positions: end.positions,
            end_normals: end.normals,
            triangles: part.mesh.triangles.clone(),
            uvs: part.mesh.uvs.clone(),
            colors: part.mesh.colors.clone(),
        };
        // Triangles of mirrored joints come out clockwise.
        let flipped = opening.first().is_some_and(|joint| deform::mirror(&joint.matrix3) < 0.0);
        Ok(Shape { flipped, media, ..Shape::new(Geometry::Mesh(Arc::new(mesh)), material) })
    }

    fn check_finite(&self, index: usize, vertices: &Vertices) -> Result<(), SceneError> {
        let Some(at) = vertices.positions.iter().position(|position| !position.is_finite()) else {
            return Ok(());
        };
        let message = format!("morph targets or joints move vertex {at} beyond all numbers");
        Err(self.error(ErrorKind::Invalid, index, message))
    }

    fn add_camera(&mut self, slot: usize, camera: &Camera) {
        let (to_world, end_to_world) = self.motion(slot);
        let Some(to_world) = rigid(to_world) else { return self.warn_flat(slot) };
        let end_to_world = end_to_world.and_then(rigid);
        self.scene.cameras.push(Camera { to_world, end_to_world, ..camera.clone() });
    }

    fn add_light(&mut self, slot: usize, light: &Light) {
        let (to_world, end_to_world) = self.motion(slot);
        if end_to_world.is_some() {
            let message = "moves while the shutter is open: its light comes from where it was at the opening";
            self.warn(slot, message);
        }
        let Some(pose) = rigid(to_world) else { return self.warn_flat(slot) };
        let (at, to) = (Vec3::from(pose.translation), -Vec3::from(pose.matrix3.z_axis));
        let mut light = light.clone();
        match &mut light {
            Light::Point { position, .. } => *position = at,
            Light::Directional { direction, .. } => *direction = to,
            Light::Spot { position, direction, .. } => (*position, *direction) = (at, to),
            Light::Picture { position, .. } => *position = at,
        }
        self.scene.lights.push(light);
    }

    /// From the node to the world when the shutter opens, and when it closes if that differs.
    fn motion(&self, slot: usize) -> (Affine3A, Option<Affine3A>) {
        let open = self.open.worlds[slot];
        let close = self.close.as_ref().map(|pose| pose.worlds[slot]);
        (open, close.filter(|&close| close != open))
    }

    fn place(&self, slot: usize) -> String {
        format!("nodes[{}]", self.stage.hierarchy.index(slot))
    }

    fn warn_flat(&mut self, slot: usize) {
        self.warn(slot, "is scaled to nothing: what it holds is left out");
    }

    /// Says `message` about the node in `slot`, once.
    fn warn(&mut self, slot: usize, message: &str) {
        self.warnings.say(&self.place(slot), message);
    }

    /// Counts another copy of `part`, for model `index`, against the limit.
    fn claim(&self, part: &Part, index: usize) -> Result<(), SceneError> {
        let (vertices, triangles) = (part.mesh.positions.len() as u64, part.mesh.triangles.len() as u64);
        let bytes = vertices * VERTEX_BYTES + triangles * size_of::<[u32; 3]>() as u64;
        self.geometry_bytes.set(self.geometry_bytes.get().saturating_add(bytes));
        if self.geometry_bytes.get() <= MAX_GEOMETRY_BYTES {
            return Ok(());
        }
        let message = format!("the scene's vertices and indices take over {MAX_GEOMETRY_BYTES} bytes");
        Err(self.error(ErrorKind::Unsupported, index, message))
    }

    /// An error of the node that shows model `index`.
    fn error(&self, kind: ErrorKind, index: usize, message: String) -> SceneError {
        SceneError::new(kind, &self.stage.file, self.place(self.stage.models[index].slot), message)
    }
}

/// The pose of `transform` without scale, shear and mirroring: -z and +y are kept as far as they are at right
/// angles. `None` where they have no directions.
fn rigid(transform: Affine3A) -> Option<Affine3A> {
    let back = Vec3::from(transform.matrix3.z_axis).try_normalize()?;
    let right = Vec3::from(transform.matrix3.y_axis).cross(back).try_normalize()?;
    let axes = Mat3::from_cols(right, back.cross(right), back);
    Some(Affine3A::from_mat3_translation(axes, Vec3::from(transform.translation)))
}
