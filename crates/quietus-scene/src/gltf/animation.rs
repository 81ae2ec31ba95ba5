//! Animations: which properties of which nodes change with time (specification, section 3.11).

use std::collections::{HashMap, HashSet};

use glam::Vec3;

use super::document::Document;
use super::hierarchy::{Hierarchy, Local};
use super::keys::{Interpolation, Keys};
use super::schema::{AnimationSampler, Channel};
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
                Property::Weights => {}
            }
        }
    }

    /// Weights of the morph targets of the node in `slot` at `time`, if the clip changes them.
    pub(super) fn weights(&self, slot: usize, time: f32) -> Option<Vec<f32>> {
        self.weights.get(&slot).map(|&track| self.tracks[track].keys.at(time))
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
    let mut taken = HashSet::new();
    for (i, channel) in animation.channels.iter().enumerate() {
        let place = format!("{own}.channels[{i}]");
        let Some((slot, property)) = target(document, hierarchy, channel, &place)? else { continue };
        if !taken.insert((slot, property)) {
            return Err(document.invalid(&place, "changes what another channel of this animation changes"));
        }
        let samplers = format!("{own}.samplers");
        let sampler =
            document.get(&animation.samplers, channel.sampler, &samplers, &format!("{place}.sampler"))?;
        let width = match property {
            Property::Translation | Property::Scale => 3,
            Property::Rotation => 4,
            Property::Weights => target_count(document, channel, &place)?,
        };
        let own = format!("{samplers}[{}]", channel.sampler);
        let keys = keys(document, sampler, property, width, &own)?;
        tracks.push(Track { slot, property, keys });
    }
    let seconds = tracks.iter().map(|track| track.keys.end()).fold(0.0, f32::max);
    let name = if animation.name.is_empty() { own } else { animation.name.clone() };
    let weights = tracks.iter().enumerate().filter(|(_, track)| track.property == Property::Weights);
    let weights = weights.map(|(i, track)| (track.slot, i)).collect();
    Ok(Clip { name, seconds, tracks, weights })
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
    if property != Property::Weights && !hierarchy.has_parts(slot) {
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

fn keys(
    document: &Document<'_>,
    sampler: &AnimationSampler,
    property: Property,
    width: usize,
    own: &str,
) -> Result<Keys, SceneError> {
    let interpolation = match (sampler.interpolation.as_deref(), property) {
        (Some("STEP"), _) => Interpolation::Step,
        (None | Some("LINEAR"), Property::Rotation) => Interpolation::Spherical,
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
        Property::Translation | Property::Scale => {
            document.read_floats(sampler.output, &place, &["VEC3"], [0.0; 3])?.into_flattened()
        }
        // The tangents of splines are no rotations.
        Property::Rotation if interpolation == Interpolation::Cubic => {
            document.read_floats(sampler.output, &place, &["VEC4"], [0.0; 4])?.into_flattened()
        }
        Property::Rotation => rotations(document, sampler.output, &place)?.into_flattened(),
        Property::Weights => {
            document.read_floats(sampler.output, &place, &["SCALAR"], [0.0])?.into_flattened()
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
