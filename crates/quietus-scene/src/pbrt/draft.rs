//! What the directives of a scene say, before files are loaded and everything is put together.

use std::collections::HashMap;
use std::path::PathBuf;
use std::rc::Rc;

use glam::Vec3;
use quietus_trace::desc::{Curves, Mesh, PatchMesh, Quadric};

use super::displacement::Displacement;
use super::fault::Place;
use super::images::ImageId;
use super::params::{Param, Params};
use super::transform::Moving;

/// One directive with its type and parameters.
#[derive(Debug)]
pub(super) struct Entity {
    /// As in the file: "sphere".
    pub kind: Box<str>,
    pub params: Params,
}

/// A whole scene.
#[derive(Debug, Default)]
pub(super) struct Draft {
    pub camera: Option<(Entity, Moving, Option<Medium>)>,
    pub film: Option<Entity>,
    pub filter: Option<Entity>,
    pub sampler: Option<Entity>,
    pub integrator: Option<Entity>,
    /// When motion starts and ends.
    pub times: Option<[f32; 2]>,
    pub materials: Vec<Entity>,
    pub named_materials: HashMap<Box<str>, usize>,
    pub textures: Vec<TextureEntity>,
    pub media: Vec<(Box<str>, Entity, Moving)>,
    pub lights: Vec<(Entity, Moving)>,
    /// The world first, then the definitions of objects.
    pub groups: Vec<Group>,
    pub uses: Vec<Use>,
    pub ply: Files,
}

/// Files, each once, and where they are first named.
#[derive(Debug, Default)]
pub(super) struct Files {
    pub list: Vec<(PathBuf, Place)>,
    known: HashMap<PathBuf, usize>,
}

impl Files {
    /// The number of a file in the list.
    pub(super) fn ask(&mut self, path: PathBuf, place: Place) -> usize {
        *self.known.entry(path).or_insert_with_key(|path| {
            self.list.push((path.clone(), place));
            self.list.len() - 1
        })
    }
}

/// A texture.
#[derive(Debug)]
pub(super) struct TextureEntity {
    pub name: Box<str>,
    /// Whether its values are colours, not numbers.
    pub color: bool,
    pub entity: Entity,
    pub to_world: Moving,
}

/// Shapes that are placed together.
#[derive(Debug, Default)]
pub(super) struct Group {
    pub name: Box<str>,
    pub shapes: Vec<Shape>,
}

/// A placement of a group.
#[derive(Debug)]
pub(super) struct Use {
    pub name: Box<str>,
    pub place: Place,
    pub to_world: Moving,
}

/// A medium by its name, and where it is named.
pub(super) type Medium = (Rc<str>, Place);

/// Which material.
#[derive(Clone, Debug)]
pub(super) enum MaterialRef {
    /// Of [`Draft::materials`].
    Index(usize),
    /// A named one, and where it is named: it may be made later.
    Named(Rc<str>, Place),
}

/// What a shape inherits from the directives before it.
#[derive(Clone, Debug)]
pub(super) struct Style {
    pub material: MaterialRef,
    pub light: Option<Rc<AreaLight>>,
    /// The media inside and outside.
    pub media: [Option<Medium>; 2],
    /// `ReverseOrientation`.
    pub reversed: bool,
}

/// A shape, in its own space.
#[derive(Debug)]
pub(super) struct Shape {
    pub form: Form,
    pub to_world: Moving,
    pub style: Rc<Style>,
    /// Coverage: `None` where it is 1 everywhere.
    pub alpha: Option<Alpha>,
    pub displacement: Option<Displacement>,
    pub place: Place,
}

/// Coverage.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Alpha {
    Constant(f32),
    /// A texture, and where it is named.
    Texture(Box<str>, Place),
}

/// The form of a shape.
#[derive(Debug)]
pub(super) enum Form {
    Mesh(Mesh),
    /// Of [`Draft::ply`]'s list.
    Ply(usize),
    Sphere(f32),
    Quadric(Quadric),
    Patches(PatchMesh),
    Curves(Curves),
}

/// An area light.
#[derive(Debug)]
pub(super) struct AreaLight {
    /// Radiance, or what multiplies the picture.
    pub radiance: Vec3,
    /// Power that each face is to have, in units of its radiance.
    pub power: Option<f32>,
    pub two_sided: bool,
    pub image: Option<ImageId>,
    pub place: Place,
}

/// Parameters that `Attribute` gives to everything of a kind.
#[derive(Clone, Debug, Default)]
pub(super) struct Attributes {
    pub shape: Vec<Rc<Vec<Param>>>,
    pub light: Vec<Rc<Vec<Param>>>,
    pub material: Vec<Rc<Vec<Param>>>,
    pub medium: Vec<Rc<Vec<Param>>>,
    pub texture: Vec<Rc<Vec<Param>>>,
}
