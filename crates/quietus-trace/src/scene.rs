//! A scene ready to be drawn, compiled from its description.

mod check;
mod compile;
mod emitters;
#[cfg(test)]
mod tests;

use glam::{Vec2, Vec3};
use thiserror::Error;

use crate::bvh::{Accel, Bounds, Hit, Ray};
use crate::desc::{Geometry, MaterialId, SceneDesc};
use crate::geometry::motion::Motion;
use crate::interaction::{Interaction, Placement, footprint, surface_point};
use crate::isa::Isa;
use crate::light::{AreaLight, Environment, Found, LightSample, Lights, Receiver};
use crate::material::{MaterialError, MaterialTable};
use crate::medium::{Border, Field, Inside, Medium};
use crate::texture::Footprint;

/// Why a description cannot be drawn. Every message names the part by its index and, where it has one, its name.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SceneBuildError {
    /// An index points past the end of what it indexes.
    #[error("{place}: {what} {index} does not exist; there are {len}")]
    Index {
        /// Where the index stands.
        place: String,
        /// What it should name.
        what: &'static str,
        /// The index.
        index: u64,
        /// How many there are.
        len: usize,
    },
    /// A vector has the wrong length.
    #[error("{place}: {found} {what}, expected {expected}")]
    Length {
        /// Where it stands.
        place: String,
        /// What is counted.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many there should be.
        expected: usize,
    },
    /// A number is out of its range.
    #[error("{place}: {what} is {found}; expected {expected}")]
    Value {
        /// Where it stands.
        place: String,
        /// What it is.
        what: &'static str,
        /// The number.
        found: String,
        /// Its range.
        expected: &'static str,
    },
    /// A texture or material cannot be used.
    #[error(transparent)]
    Material(#[from] MaterialError),
}

/// A scene compiled for rendering; shared by all threads.
#[derive(Debug)]
pub struct Scene {
    pub(crate) accel: Accel,
    pub(crate) materials: MaterialTable,
    pub(crate) lights: Lights,
    pub(crate) media: Vec<Medium>,
    /// How those of them vary that do.
    pub(crate) fields: Vec<Field>,
    /// Whether there is anything between surfaces: media, or what light wanders in below a surface.
    pub(crate) has_volumes: bool,
    /// Whether there are surfaces that are nothing but borders between media.
    has_borders: bool,
    instances: Vec<PlacedObject>,
    /// The shapes of all objects, object after object.
    shapes: Vec<CompiledShape>,
    /// For every shape of every instance the number of its first light among its kind, or [`NO_LIGHT`].
    first_lights: Vec<u32>,
    /// How instances move that do.
    motions: Vec<Motion>,
    /// Whether anything moves while the shutter is open.
    moves: bool,
}

/// Stands for "emits nothing" in [`Scene::first_lights`].
const NO_LIGHT: u32 = u32::MAX;

/// Stands for "does not move" in [`PlacedObject::motion`].
const STILL: u32 = u32::MAX;

#[derive(Clone, Copy, Debug)]
struct PlacedObject {
    /// When the shutter opens.
    placement: Placement,
    /// Index into [`Scene::motions`], or [`STILL`].
    motion: u32,
    /// Where its shapes start in [`Scene::shapes`].
    first_shape: u32,
    /// Where its shapes start in [`Scene::first_lights`].
    first_slot: u32,
}

#[derive(Clone, Debug)]
struct CompiledShape {
    geometry: Geometry,
    material: MaterialId,
    /// Whether the material looks at texture coordinates.
    textured: bool,
    /// The media on its sides.
    border: Option<Border>,
    /// Whether it is nothing but such a border.
    only_border: bool,
    /// Whether front and back are exchanged.
    flipped: bool,
}

impl Scene {
    /// Checks `desc` and compiles it; meshes and images stay shared with it. Uses all threads of rayon's pool.
    ///
    /// # Errors
    /// The first index, length or number that is out of range, see [`SceneBuildError`].
    pub fn build(desc: &SceneDesc) -> Result<Self, SceneBuildError> {
        let (materials, checked) =
            rayon::join(|| MaterialTable::compile(&desc.textures, &desc.materials), || check::scene(desc));
        let materials = materials?;
        checked?;
        Ok(compile::scene(desc, materials))
    }

    /// Bounds of all surfaces, in the world.
    pub fn bounds(&self) -> Bounds {
        self.accel.bounds()
    }

    /// What lies infinitely far away, if anything does.
    #[inline(always)]
    pub(crate) fn environment(&self) -> Option<&Environment> {
        self.lights.environment()
    }

    #[inline(always)]
    fn shape(&self, instance: u32, shape: u32) -> (&PlacedObject, &CompiledShape) {
        let placed = &self.instances[instance as usize];
        (placed, &self.shapes[(placed.first_shape + shape) as usize])
    }

    /// Whether any surface is nothing but a border between media.
    #[inline(always)]
    pub(crate) fn has_borders(&self) -> bool {
        self.has_borders
    }

    /// Whether a hit is on a surface that is nothing but a border between media.
    #[inline(always)]
    pub(crate) fn is_border(&self, hit: &Hit) -> bool {
        self.shape(hit.instance, hit.shape).1.only_border
    }

    /// The medium in direction `w` from the surface of `hit`, for light that is in the medium `inside` where it does
    /// not border on others.
    #[inline(always)]
    pub(crate) fn beyond(&self, hit: &Hit, surface: &Interaction, w: Vec3, inside: Inside) -> Inside {
        let border = self.shape(hit.instance, hit.shape).1.border;
        border.map_or(inside, |border| border.beyond(w, surface.geometric_normal))
    }

    /// Whether anything moves while the shutter is open.
    #[inline(always)]
    pub(crate) fn moves(&self) -> bool {
        self.moves
    }

    /// Where an instance is at `time`: in `moved` if it moves.
    #[inline(always)]
    fn placement<'a>(
        &self,
        placed: &'a PlacedObject,
        time: f32,
        moved: &'a mut Option<Placement>,
    ) -> &'a Placement {
        if placed.motion == STILL {
            return &placed.placement;
        }
        moved.insert(self.moved(placed.motion, time))
    }

    #[cold]
    fn moved(&self, motion: u32, time: f32) -> Placement {
        Placement::new(self.motions[motion as usize].at(time))
    }

    /// The surface at `hit`, found along `ray`, whose direction is of unit length.
    #[inline(always)]
    pub(crate) fn interaction(&self, hit: &Hit, ray: &Ray) -> Interaction {
        let (placed, shape) = self.shape(hit.instance, hit.shape);
        let mut moved = None;
        let placement = self.placement(placed, ray.time, &mut moved);
        let surface =
            Interaction::new(&shape.geometry, (shape.material, shape.textured), placement, hit, ray);
        if shape.flipped { surface.flipped() } else { surface }
    }

    /// What a cone of `radius` around a ray in `direction`, of unit length, covers of the surface at `hit`; the point
    /// alone where the material looks at no textures.
    #[inline(always)]
    pub(crate) fn footprint(
        &self,
        hit: &Hit,
        surface: &Interaction,
        (direction, time): (Vec3, f32),
        radius: f32,
    ) -> Footprint {
        let (placed, shape) = self.shape(hit.instance, hit.shape);
        if !shape.textured {
            return Footprint::POINT;
        }
        let mut moved = None;
        let placement = self.placement(placed, time, &mut moved);
        footprint(&shape.geometry, placement, hit, surface, (direction, time), radius)
    }

    /// The frame normal maps and tangents want at `hit` of `ray`, around the shading normal `normal`.
    pub(crate) fn tangent_frame(&self, hit: &Hit, normal: Vec3, ray: &Ray) -> crate::frame::Frame {
        let (placed, shape) = self.shape(hit.instance, hit.shape);
        let mut moved = None;
        let placement = self.placement(placed, ray.time, &mut moved);
        crate::interaction::tangent_frame(&shape.geometry, placement, hit, normal, ray)
    }

    /// Coverage at a hit of `ray`.
    pub(crate) fn coverage(&self, hit: &Hit, ray: &Ray) -> f32 {
        let (placed, shape) = self.shape(hit.instance, hit.shape);
        let mut moved = None;
        let placement = self.placement(placed, ray.time, &mut moved);
        self.materials.alpha(shape.material, &surface_point(&shape.geometry, placement, hit, ray))
    }

    /// Chooses a light and a direction to it from the receiver, for random numbers in `[0, 1)`.
    #[inline(always)]
    pub(crate) fn sample_light<I: Isa>(
        &self,
        isa: I,
        receiver: &Receiver,
        u_light: f32,
        u: Vec2,
    ) -> Option<LightSample> {
        let found = match self.lights.sample(isa, receiver, u_light, u)? {
            Found::Moving(number, probability) => self.sample_moving(number, probability, receiver, u)?,
            found => found,
        };
        match found {
            Found::Light(sample) => Some(sample),
            Found::Varying(sample, hit) => {
                let ray = Ray::new(receiver.position, sample.direction, receiver.time);
                Some(LightSample { radiance: self.visible_emission(&hit, &ray), ..sample })
            }
            Found::Moving(..) => None,
        }
    }

    /// A point on a light that moves, where it is at the receiver's time.
    #[cold]
    fn sample_moving(&self, number: u32, probability: f32, receiver: &Receiver, u: Vec2) -> Option<Found> {
        let emitter = self.lights.moving(number);
        let light = self.moving_light(emitter.instance, emitter.shape, emitter.primitive, receiver.time)?;
        let (area, at) = light.sample(receiver.position, u)?;
        emitter.found(&area, probability, receiver.position, at)
    }

    /// A primitive as a light, where it is at `time`.
    fn moving_light(&self, instance: u32, shape: u32, primitive: u32, time: f32) -> Option<AreaLight> {
        let (placed, shape) = self.shape(instance, shape);
        let mut moved = None;
        let to_world = &self.placement(placed, time, &mut moved).to_world;
        emitters::area_light(&shape.geometry, shape.flipped, primitive, to_world, time)
    }

    /// Density for what moves: see [`Self::light_pdf`].
    #[cold]
    fn moving_light_pdf<I: Isa>(
        &self,
        isa: I,
        number: u32,
        hit: &Hit,
        surface: &Interaction,
        receiver: &Receiver,
        direction: Vec3,
    ) -> f32 {
        let Some(light) = self.moving_light(hit.instance, hit.shape, hit.primitive, receiver.time) else {
            return 0.0;
        };
        let distance = surface.position.distance(receiver.position);
        let place = (surface.geometric_normal, Vec2::new(hit.u, hit.v));
        let probability = self.lights.probability_of_moving(isa, number, receiver);
        probability * light.pdf(receiver.position, (direction, distance), place)
    }

    /// Emission times coverage where `ray` meets a side that emits.
    #[inline(never)]
    fn visible_emission(&self, hit: &Hit, ray: &Ray) -> Vec3 {
        let (placed, shape) = self.shape(hit.instance, hit.shape);
        let mut moved = None;
        let placement = self.placement(placed, ray.time, &mut moved);
        let at = Interaction::new(&shape.geometry, (shape.material, true), placement, hit, ray);
        let coverage = if self.materials.is_unseen(at.material) { 1.0 } else { self.coverage(hit, ray) };
        self.materials.emission(at.material, &at.surface, true) * coverage
    }

    /// Density per steradian with which [`Self::sample_light`] chooses for `receiver` the point `surface`, which a ray
    /// from there in `direction` (of unit length) hit.
    #[inline(always)]
    pub(crate) fn light_pdf<I: Isa>(
        &self,
        isa: I,
        hit: &Hit,
        surface: &Interaction,
        receiver: &Receiver,
        direction: Vec3,
    ) -> f32 {
        let (placed, shape) = self.shape(hit.instance, hit.shape);
        let first = self.first_lights[(placed.first_slot + hit.shape) as usize];
        if first == NO_LIGHT {
            return 0.0;
        }
        if self.moves && (placed.motion != STILL || emitters::is_deforming(&shape.geometry)) {
            let number = first + hit.primitive;
            return self.moving_light_pdf(isa, number, hit, surface, receiver, direction);
        }
        let distance = surface.position.distance(receiver.position);
        match shape.geometry {
            Geometry::Mesh(_) => {
                self.lights.pdf_of_triangle(isa, first + hit.primitive, receiver, direction, distance)
            }
            Geometry::Sphere { .. } => self.lights.pdf_of_sphere(isa, first, receiver, direction),
            _ => {
                let light = first + hit.primitive;
                let place = (surface.geometric_normal, Vec2::new(hit.u, hit.v));
                self.lights.pdf_of_surface(isa, light, receiver, (direction, distance), place)
            }
        }
    }
}
