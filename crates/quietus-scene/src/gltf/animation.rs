//! Animations: which properties of which nodes change with time (specification, section 3.11).

use std::collections::{HashMap, HashSet};

use glam::Vec3;

use super::changes::{Change, Part};
use super::document::Document;
use super::hierarchy::{Hierarchy, Local};
use super::keys::{Interpolation, Keys};
use super::pointer;
use super::schema::{Animation, AnimationSampler, Channel};
use crate::error::SceneError;

/// An animation, as far as it concerns nodes of the scene.
#[derive(Clone, Debug)]
pub(super) struct Clip {
    pub name: String,
    /// Time of its last key.
    pub seconds: f32,
    tracks: Vec<Track>,
    /// Which of the tracks has the weights of the node in a slot.
    weights: HashMap<usize, usize>,
    /// The same for whether it is seen.
    visible: HashMap<usize, usize>,
    /// What else it changes.
    pub changes: Vec<Change>,
}

/// One property of the node in `slot`.
#[derive(Clone, Debug)]
struct Track {
    slot: usize,
    property: Property,
    keys: Keys,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Property {
    Translation,
    Rotation,
    Scale,
    Weights,
    Visible,
}

impl Clip {
    /// Sets what the clip changes in `locals`, by slot, to where it is at `time`.
    pub(super) fn pose(&self, time: f32, locals: &mut [Local]) {
        for track in &self.tracks {
            let Local::Parts(parts) = &mut locals[track.slot] else { continue };
            match track.property {
                Property::Translation => parts.translation = Vec3::from_array(track.keys.vector(time)),
                Property::Scale => parts.scale = Vec3::from_array(track.keys.vector(time)),
                Property::Rotation => parts.rotation = track.keys.rotation(time),
                Property::Weights | Property::Visible => {}
            }
        }
    }

    /// Weights of the morph targets of the node in `slot` at `time`, if the clip changes them.
    pub(super) fn weights(&self, slot: usize, time: f32) -> Option<Vec<f32>> {
        self.weights.get(&slot).map(|&track| self.tracks[track].keys.at(time))
    }

    /// Whether the node in `slot` is to be seen at `time`, if the clip changes that.
    pub(super) fn visible(&self, slot: usize, time: f32) -> Option<bool> {
        self.visible.get(&slot).map(|&track| self.tracks[track].keys.at(time)[0] != 0.0)
    }

    /// Whether it shows or hides nodes.
    pub(super) fn changes_visibility(&self) -> bool {
        !self.visible.is_empty()
    }
}

/// Reads every animation of the file.
pub(super) fn clips(document: &Document<'_>, hierarchy: &Hierarchy) -> Result<Vec<Clip>, SceneError> {
    (0..document.root.animations.len()).map(|index| clip(document, hierarchy, index)).collect()
}

fn clip(document: &Document<'_>, hierarchy: &Hierarchy, index: usize) -> Result<Clip, SceneError> {
    let animation = &document.root.animations[index];
    let own = format!("animations[{index}]");
    let mut tracks: Vec<Track> = Vec::new();
    let mut changes: Vec<Change> = Vec::new();
    let mut taken = HashSet::new();
    for (i, channel) in animation.channels.iter().enumerate() {
        let place = format!("{own}.channels[{i}]");
        if let Some(pointer) = &channel.target.extensions.pointer {
            changes.extend(change(document, animation, channel, &pointer.pointer, &place)?);
            continue;
        }
        let Some((slot, property)) = target(document, hierarchy, channel, &place)? else { continue };
        if !taken.insert((slot, property)) {
            return Err(document.invalid(&place, "changes what another channel of this animation changes"));
        }
        let (sampler, sampler_place) = sampler(document, animation, channel, &place)?;
        let width = match property {
            Property::Translation | Property::Scale => 3,
            Property::Rotation => 4,
            Property::Weights => target_count(document, channel, &place)?,
            Property::Visible => 1,
        };
        let keys = keys(document, sampler, Some(property), width, &sampler_place)?;
        tracks.push(Track { slot, property, keys });
    }
    if let Some(originals) = document.originals.as_ref().filter(|_| !changes.is_empty()) {
        // What they change must be there, and become what it may be.
        originals.at(&changes, 0.0, document.file())?;
    }
    let all = tracks.iter().map(|track| &track.keys).chain(changes.iter().map(|change| &change.keys));
    let seconds = all.map(Keys::end).fold(0.0, f32::max);
    let name = if animation.name.is_empty() { own } else { animation.name.clone() };
    let of = |property: Property| {
        let tracks = tracks.iter().enumerate().filter(|(_, track)| track.property == property);
        tracks.map(|(i, track)| (track.slot, i)).collect()
    };
    let (weights, visible) = (of(Property::Weights), of(Property::Visible));
    Ok(Clip { name, seconds, weights, visible, tracks, changes })
}

/// The sampler of `channel`, which is at `place`, and where it is.
fn sampler<'d>(
    document: &Document<'_>,
    animation: &'d Animation,
    channel: &Channel,
    place: &str,
) -> Result<(&'d AnimationSampler, String), SceneError> {
    let samplers = format!("{}.samplers", place.split_once('.').map_or(place, |(own, _)| own));
    let at = format!("{place}.sampler");
    let sampler = document.get(&animation.samplers, channel.sampler, &samplers, &at)?;
    Ok((sampler, format!("{samplers}[{}]", channel.sampler)))
}

/// What `channel` changes of a material, a light or a camera; `None`, with a warning, where `pointer` leads to something else.
fn change(
    document: &Document<'_>,
    animation: &Animation,
    channel: &Channel,
    pointer: &str,
    place: &str,
) -> Result<Option<Change>, SceneError> {
    let root = &document.root;
    let lights = root.extensions.lights.as_ref().map_or(0, |lights| lights.lights.len());
    let is_there = Part::of(pointer).is_some_and(|part| match part {
        Part::Material(index) => index < root.materials.len(),
        Part::Camera(index) => index < root.cameras.len(),
        Part::Light(index) => index < lights,
    });
    if !is_there {
        let path = pointer::template(pointer);
        let message = format!(
            "changes of \"{path}\" are not drawn; those of where nodes are, whether they are seen, and of their weights, \
             materials, lights and cameras are"
        );
        document.warn("animations", message);
        return Ok(None);
    }
    let (sampler, own) = sampler(document, animation, channel, place)?;
    let at = format!("{own}.output");
    let width = match document.get(&root.accessors, sampler.output, "accessors", &at)?.kind.as_str() {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        "VEC4" => 4,
        kind => return Err(document.invalid(&at, format!("has type {kind}, expected SCALAR to VEC4"))),
    };
    let keys = keys(document, sampler, None, width, &own)?;
    Ok(Some(Change { pointer: pointer.to_owned(), place: format!("{place}.target"), keys }))
}

/// What a channel changes; `None` where that is nothing in the scene.
fn target(
    document: &Document<'_>,
    hierarchy: &Hierarchy,
    channel: &Channel,
    place: &str,
) -> Result<Option<(usize, Property)>, SceneError> {
    let path = channel.target.path.as_str();
    let property = match path {
        "translation" => Property::Translation,
        "rotation" => Property::Rotation,
        "scale" => Property::Scale,
        "weights" => Property::Weights,
        pointer::VISIBLE => Property::Visible,
        _ => {
            let known = "translation, rotation, scale and weights are";
            document.warn("animations", format!("changes of \"{path}\" are not drawn; those of {known}"));
            return Ok(None);
        }
    };
    // Without a node the channel is to be ignored.
    let Some(node) = channel.target.node else { return Ok(None) };
    let place = format!("{place}.target.node");
    document.get(&document.root.nodes, node, "nodes", &place)?;
    let Some(slot) = hierarchy.slot(node) else { return Ok(None) };
    if !matches!(property, Property::Weights | Property::Visible) && !hierarchy.has_parts(slot) {
        let message = format!("animates the {path} of nodes[{node}], which has a matrix instead");
        return Err(document.invalid(&place, message));
    }
    Ok(Some((slot, property)))
}

/// Number of morph targets of the mesh that `channel` changes.
fn target_count(document: &Document<'_>, channel: &Channel, place: &str) -> Result<usize, SceneError> {
    let root = &document.root;
    let mesh = channel.target.node.and_then(|node| root.nodes.get(node)?.mesh);
    let primitives = mesh.and_then(|mesh| root.meshes.get(mesh)).map(|mesh| &mesh.primitives);
    let count = primitives.and_then(|primitives| primitives.first()).map_or(0, |first| first.targets.len());
    if count == 0 {
        let message = "animates the weights of a node without a mesh that has morph targets";
        return Err(document.invalid(&format!("{place}.target"), message));
    }
    Ok(count)
}

/// The keys of `sampler`, which is at `own`, for a property of a node, or another one of `width` numbers.
fn keys(
    document: &Document<'_>,
    sampler: &AnimationSampler,
    property: Option<Property>,
    width: usize,
    own: &str,
) -> Result<Keys, SceneError> {
    let interpolation = match (sampler.interpolation.as_deref(), property) {
        (Some("STEP"), _) => Interpolation::Step,
        (None | Some("LINEAR"), Some(Property::Rotation)) => Interpolation::Spherical,
        (None | Some("LINEAR"), _) => Interpolation::Linear,
        (Some("CUBICSPLINE"), _) => Interpolation::Cubic,
        (Some(other), _) => {
            let message = format!("is \"{other}\", expected STEP, LINEAR or CUBICSPLINE");
            return Err(document.invalid(&format!("{own}.interpolation"), message));
        }
    };
    let times = times(document, sampler.input, &format!("{own}.input"))?;
    let place = format!("{own}.output");
    let values: Vec<f32> = match property {
        Some(Property::Translation | Property::Scale) => {
            document.read_floats(sampler.output, &place, &["VEC3"], [0.0; 3])?.into_flattened()
        }
        // The tangents of splines are no rotations.
        Some(Property::Rotation) if interpolation == Interpolation::Cubic => {
            document.read_floats(sampler.output, &place, &["VEC4"], [0.0; 4])?.into_flattened()
        }
        Some(Property::Rotation) => rotations(document, sampler.output, &place)?.into_flattened(),
        Some(Property::Weights | Property::Visible) => {
            document.read_floats(sampler.output, &place, &["SCALAR"], [0.0])?.into_flattened()
        }
        None => {
            let kinds = ["SCALAR", "VEC2", "VEC3", "VEC4"];
            let values = document.read_floats(sampler.output, &place, &kinds, [0.0; 4])?;
            values.into_iter().flat_map(|value| value.into_iter().take(width)).collect()
        }
    };
    let per_key = interpolation.elements() * width;
    if values.len() != times.len() * per_key {
        let (keys, found) = (times.len(), values.len());
        let message = format!("has {found} numbers, expected {per_key} for each of {keys} keys");
        return Err(document.invalid(&place, message));
    }
    Ok(Keys::new(times, values, width, interpolation))
}

/// Times that do not decrease, at least one. That they increase is what the specification asks; where two keys fall on the
/// same time, as rounding in exporters makes them do, the value jumps there.
fn times(document: &Document<'_>, index: usize, place: &str) -> Result<Vec<f32>, SceneError> {
    let times = document.read_floats(index, place, &["SCALAR"], [0.0])?.into_flattened();
    if times.is_empty() {
        return Err(document.invalid(place, "has no times, expected at least one"));
    }
    if times[0] < 0.0 {
        return Err(document.invalid(place, format!("starts at {}, expected a time of at least 0", times[0])));
    }
    if let Some(at) = times.windows(2).position(|pair| pair[1] < pair[0]) {
        let (time, before) = (times[at + 1], times[at]);
        let message = format!("time {} is {time} after {before}, expected increasing times", at + 1);
        return Err(document.invalid(place, message));
    }
    Ok(times)
}

/// The quaternions of accessor `index`, brought to unit length.
pub(super) fn rotations(
    document: &Document<'_>,
    index: usize,
    place: &str,
) -> Result<Vec<[f32; 4]>, SceneError> {
    let mut values = document.read_floats(index, place, &["VEC4"], [0.0; 4])?;
    for (i, value) in values.iter_mut().enumerate() {
        let unit = glam::Vec4::from_array(*value).try_normalize();
        let unit = unit.ok_or_else(|| {
            document.invalid(place, format!("element {i} is {value:?}, expected a unit quaternion"))
        })?;
        *value = unit.to_array();
    }
    Ok(values)
}
