//! What animations change of materials, lights and cameras (KHR_animation_pointer): values are written into the JSON that the
//! file has of them, and what they belong to is then read again as it was at first, but for its pictures.

use std::collections::{BTreeSet, HashMap};
use std::path::Path;
use std::sync::Arc;

use quietus_trace::desc::{Camera, Image, Light, Material, MaterialId, Medium, MediumInterface, Texture};
use serde_json::{Map, Value};

use super::document::Document;
use super::glossiness;
use super::graph;
use super::image::Encoding;
use super::keys::Keys;
use super::material::{Materials, TextureKey};
use super::schema::Root;
use crate::error::{ErrorKind, SceneError};

/// A property that an animation changes.
#[derive(Clone, Debug)]
pub(super) struct Change {
    pub pointer: String,
    /// Where the file says so, for messages.
    pub place: String,
    pub keys: Keys,
}

/// What a pointer may lead to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Part {
    Material(usize),
    Camera(usize),
    Light(usize),
}

impl Part {
    /// The part of a file in which `pointer` leads to a property.
    pub(super) fn of(pointer: &str) -> Option<Self> {
        let rest = pointer.strip_prefix('/')?;
        let (kind, rest) =
            rest.strip_prefix("extensions/KHR_lights_punctual/").unwrap_or(rest).split_once('/')?;
        let (index, property) = rest.split_once('/')?;
        let index = index.parse().ok().filter(|_| !property.is_empty())?;
        match kind {
            "materials" => Some(Self::Material(index)),
            "cameras" => Some(Self::Camera(index)),
            "lights" => Some(Self::Light(index)),
            _ => None,
        }
    }
}

/// All that is needed to read materials, lights and cameras again.
#[derive(Clone, Debug)]
pub(super) struct Originals {
    /// Their JSON.
    pub json: Value,
    /// By index in the file, and whether they are not lit.
    pub materials: HashMap<(Option<usize>, bool), MaterialId>,
    pub textures: HashMap<TextureKey, quietus_trace::desc::TextureId>,
    pub pictures: HashMap<(usize, Encoding), Arc<Image>>,
    /// Index in the file of each camera and each light of the stage.
    pub cameras: Vec<usize>,
    pub lights: Vec<usize>,
}

/// What is different at one moment.
#[derive(Default)]
pub(super) struct Changed {
    /// All that there is then, more than at first.
    pub materials: Vec<Material>,
    pub textures: Vec<Texture>,
    pub media: Vec<Medium>,
    /// What stands in for materials, and what is inside of them.
    pub instead: HashMap<MaterialId, (MaterialId, Option<MediumInterface>)>,
    /// By their number among those of the stage; cameras have no name.
    pub cameras: HashMap<usize, Camera>,
    pub lights: HashMap<usize, Light>,
}

impl Originals {
    /// What the glTF file `json` says of them; it is known to be JSON.
    pub(super) fn new(json: &[u8]) -> Self {
        let mut all: Value = serde_json::from_slice(json).unwrap_or_default();
        let names = ["asset", "materials", "textures", "samplers", "images", "cameras", "extensions"];
        let kept = names.into_iter().filter_map(|name| Some((name.to_owned(), all.get_mut(name)?.take())));
        Self {
            json: Value::Object(kept.collect::<Map<_, _>>()),
            materials: HashMap::new(),
            textures: HashMap::new(),
            pictures: HashMap::new(),
            cameras: Vec::new(),
            lights: Vec::new(),
        }
    }

    /// The file's JSON after `changes` at `time`.
    pub(super) fn at(&self, changes: &[Change], time: f32, file: &Path) -> Result<Root, SceneError> {
        let mut json = self.json.clone();
        for change in changes {
            let fail =
                |message: String| SceneError::new(ErrorKind::Invalid, file, change.place.as_str(), message);
            let value = change.keys.at(time);
            let slot = slot(&mut json, &change.pointer)
                .ok_or_else(|| fail(format!("\"{}\" leads nowhere in the file", change.pointer)))?;
            *slot = match value.as_slice() {
                [number] => Value::from(*number),
                numbers => Value::from(numbers),
            };
        }
        let mut root: Root = serde_path_to_error::deserialize(json).map_err(|error| {
            let message = format!("an animation that changes it makes it invalid: {}", error.inner());
            SceneError::new(ErrorKind::Invalid, file, error.path().to_string(), message)
        })?;
        root.materials.iter_mut().for_each(glossiness::rewrite);
        Ok(root)
    }

    /// What `changes` make of the parts that they belong to, at `time`; `changed` holds what there is without them.
    pub(super) fn apply(
        &self,
        changes: &[Change],
        time: f32,
        file: &Path,
        changed: Changed,
    ) -> Result<Changed, SceneError> {
        let document = Document::of_parts(file, self.at(changes, time, file)?);
        let parts: BTreeSet<_> = changes.iter().filter_map(|change| Part::of(&change.pointer)).collect();
        let Changed { materials, textures, media, mut instead, mut cameras, mut lights } = changed;
        let mut reader = Materials::resume(&document, self, (materials, textures, media));
        for part in parts {
            match part {
                Part::Material(index) => {
                    for flat in [false, true] {
                        let Some(&old) = self.materials.get(&(Some(index), flat)) else { continue };
                        let new = reader.get(Some(index), flat, "materials")?;
                        instead.insert(old, (new, reader.media_of(new)));
                    }
                }
                Part::Camera(index) => {
                    for (i, _) in self.cameras.iter().enumerate().filter(|(_, camera)| **camera == index) {
                        cameras.insert(i, graph::camera(&document, index, "cameras")?);
                    }
                }
                Part::Light(index) => {
                    for (i, _) in self.lights.iter().enumerate().filter(|(_, light)| **light == index) {
                        lights.insert(i, graph::light(&document, index, "lights")?);
                    }
                }
            }
        }
        let Materials { materials, textures, media, .. } = reader;
        Ok(Changed { materials, textures, media, instead, cameras, lights })
    }
}

/// The place in `json` that `pointer` leads to (RFC 6901). What lies on the way and is not there is made, but for elements of
/// arrays; `None` where that cannot be.
fn slot<'a>(json: &'a mut Value, pointer: &str) -> Option<&'a mut Value> {
    pointer.strip_prefix('/')?.split('/').try_fold(json, |at, name| match at {
        Value::Array(items) => items.get_mut(name.parse::<usize>().ok()?),
        Value::Null | Value::Object(_) => {
            if at.is_null() {
                *at = Value::Object(Map::new());
            }
            let name = name.replace("~1", "/").replace("~0", "~");
            Some(at.as_object_mut()?.entry(name).or_insert(Value::Null))
        }
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn pointers_lead_to_what_is_there_and_what_could_be() {
        let mut json = json!({"materials": [{"emissiveFactor": [1, 0, 0]}], "name": "x"});
        for pointer in ["/materials/0/emissiveFactor", "/materials/0/extensions/KHR_materials_ior/ior"] {
            *slot(&mut json, pointer).expect(pointer) = json!(2.0);
            assert_eq!(json.pointer(pointer), Some(&json!(2.0)));
        }
        for pointer in ["/materials/1/emissiveFactor", "/materials/x/ior", "/name/first", "materials"] {
            assert!(slot(&mut json, pointer).is_none(), "{pointer}");
        }
        assert_eq!(Part::of("/materials/3/emissiveFactor"), Some(Part::Material(3)));
        assert_eq!(Part::of("/extensions/KHR_lights_punctual/lights/2/color"), Some(Part::Light(2)));
        assert!(
            ["/materials/3", "/materials/x/y", "/nodes/1/translation"].iter().all(|p| Part::of(p).is_none())
        );
    }
}
