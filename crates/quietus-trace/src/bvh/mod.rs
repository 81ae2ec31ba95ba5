//! What a ray meets first, and whether it meets anything.
//!
//! [`Accel`] is an 8-wide tree over all primitives of the world, with one more such tree for each
//! object that several instances share: `source` lists their primitives, `binary` decides their shape, `wide`
//! writes them out, `traverse` is the ray kernel. It is watertight: no ray slips between triangles that share
//! an edge. What a ray meets does not depend on the instruction set, nor, rounding aside, on the tree.
//!
//! What moves has boxes that hold all of its way. Instances that move have a tree of their own, to which the ray
//! is brought at its time; meshes that change their form have leaves with the vertices of both ends.

use glam::{Affine3A, Mat3A, Vec3, Vec3A};

use crate::desc::{Geometry, Instance, MaterialId, Object};
use crate::geometry::motion::Motion;
use crate::isa::Isa;

mod binary;
mod item;
mod leaf;
mod memory;
mod singles;
mod source;
#[cfg(test)]
mod tests;
mod traverse;
mod wide;

use item::{Item, Kind};
use source::{Placed, Reference, Source};
use wide::{Link, Store};

/// A half-line, or a piece of it.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Where it starts.
    pub origin: Vec3,
    /// Where it runs to; not 0, need not be of unit length: distances are in its units.
    pub direction: Vec3,
    /// Only hits beyond this distance count; at least 0.
    pub t_min: f32,
    /// Only hits up to this distance count; may be infinite.
    pub t_max: f32,
    /// When it is shot, in 0..=1 of the shutter's time.
    pub time: f32,
}

impl Ray {
    /// A half-line from `origin` in `direction` at `time`.
    pub const fn new(origin: Vec3, direction: Vec3, time: f32) -> Self {
        Self { origin, direction, t_min: 0.0, t_max: f32::INFINITY, time }
    }
}

/// Where a ray met a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// Triangles: barycentric coordinate of the second vertex. Patches: u. Curves: how far along. Else 0.
    pub u: f32,
    /// Triangles: barycentric coordinate of the third vertex. Patches: v. Curves: how far across, see
    /// [`CurvePart::intersect`](crate::geometry::curve::CurvePart::intersect). Else 0.
    pub v: f32,
    /// Index of the instance.
    pub instance: u32,
    /// Index of the shape in the instance's object.
    pub shape: u32,
    /// Index of the triangle, patch or curve segment in its shape. Else 0.
    pub primitive: u32,
}

/// Bounds of something, parallel to the axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Least coordinates.
    pub min: Vec3,
    /// Greatest coordinates.
    pub max: Vec3,
}

impl Bounds {
    /// Bounds of nothing.
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// Whether there is nothing inside.
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// With room for a few roundings of the coordinates.
    fn widened(self) -> Self {
        let room = 4.0 * f32::EPSILON * self.min.abs().max(self.max.abs());
        Self { min: self.min - room, max: self.max + room }
    }

    /// Bounds of both.
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Bounds of the image of these under `transform`, with room for rounding.
    pub fn transformed(&self, transform: &Affine3A) -> Self {
        let center = 0.5 * (self.min + self.max);
        let half = 0.5 * (self.max - self.min);
        let m = transform.matrix3;
        let absolute = Mat3A::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs());
        let center = transform.transform_point3(center);
        let size = Vec3::from(absolute * Vec3A::from(half));
        // A dozen roundings of numbers no greater than these, here and in the ray's way back.
        let magnitude =
            absolute * Vec3A::from(self.min.abs().max(self.max.abs())) + transform.translation.abs();
        let half = size + 16.0 * f32::EPSILON * Vec3::from(magnitude);
        Self { min: center - half, max: center + half }
    }
}

/// An instance of an object with a tree of its own.
#[derive(Clone, Copy, Debug)]
struct Inner {
    /// Unless it moves.
    to_object: Affine3A,
    root: Link,
    instance: u32,
    /// Index of its motion, or [`STILL`].
    motion: u32,
}

/// Stands for "does not move" in [`Inner::motion`].
const STILL: u32 = u32::MAX;

/// The acceleration structure over a whole scene.
#[derive(Debug)]
pub struct Accel {
    store: Store,
    references: Vec<Reference>,
    instances: Vec<Inner>,
    motions: Vec<Motion>,
    root: Link,
    bounds: Bounds,
}

impl Accel {
    /// Builds it over what the instances place in the world. `opaque` says which materials cover everywhere:
    /// hits on others are put before the filter of [`Accel::closest`] and [`Accel::occluded`].
    ///
    /// Objects of a single instance become part of the world's tree; their vertices are transformed by
    /// [`Affine3A::transform_point3`]. Primitives that are not finite, and instances whose motion passes through
    /// flatness, are left out.
    ///
    /// # Panics
    /// Where an instance names an object, or a triangle a vertex, that is not there; with more than 2^31
    /// primitives.
    pub fn build(objects: &[Object], instances: &[Instance], opaque: impl Fn(MaterialId) -> bool) -> Self {
        let shared = shared_objects(objects, instances);
        let mut accel = Self {
            store: Store::default(),
            references: Vec::new(),
            instances: Vec::new(),
            motions: Vec::new(),
            root: Link::node(0),
            bounds: Bounds::EMPTY,
        };
        let trees: Vec<Option<(Link, Bounds)>> = (objects.iter().zip(&shared))
            .map(|(object, &shared)| {
                let placed = Placed { instance: 0, object, transform: None };
                shared.then(|| accel.append(&[placed], Vec::new(), &opaque))
            })
            .collect();
        let mut placed = Vec::new();
        let mut items = Vec::new();
        for (instance, at) in (0u32..).zip(instances) {
            let &Instance { object, to_world, .. } = at;
            let index = object.0 as usize;
            if let Some((root, bounds)) = trees[index] {
                items.extend(accel.inner(at, instance, root, &bounds));
            } else {
                let transform = (to_world != Affine3A::IDENTITY).then_some(to_world);
                placed.push(Placed { instance, object: &objects[index], transform });
            }
        }
        (accel.root, accel.bounds) = accel.append(&placed, items, &opaque);
        accel
    }

    /// Adds an instance of an object with a tree of its own; none where its bounds are empty or not finite.
    fn inner(&mut self, at: &Instance, instance: u32, root: Link, bounds: &Bounds) -> Option<Item> {
        if bounds.is_empty() {
            return None;
        }
        let (bounds, motion) = match at.motion() {
            None => (bounds.transformed(&at.to_world), None),
            Some(end) => {
                let motion = Motion::new(&at.to_world, end)?;
                (motion.bounds(bounds), Some(motion))
            }
        };
        let item = Item::new(bounds, self.instances.len() as u32, Kind::Instance);
        if !item.is_bounded() {
            return None;
        }
        let number = if motion.is_some() { self.motions.len() as u32 } else { STILL };
        self.motions.extend(motion);
        self.instances.push(Inner { to_object: at.to_world.inverse(), root, instance, motion: number });
        Some(item)
    }

    /// Appends a tree over `items` and the primitives of `placed`.
    fn append(
        &mut self,
        placed: &[Placed<'_>],
        mut items: Vec<Item>,
        opaque: &impl Fn(MaterialId) -> bool,
    ) -> (Link, Bounds) {
        let source = Source::new(placed, self.references.len(), opaque);
        source.collect(&mut self.references, &mut self.store.singles, &mut items);
        self.store.append(&mut items, &source)
    }

    /// Bounds of the world.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Bytes it occupies.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.store.nodes)
            + size_of_val(&*self.store.triangles)
            + size_of_val(&*self.store.moving)
            + size_of_val(&*self.store.spheres)
            + self.store.singles.bytes()
            + size_of_val(&*self.references)
            + size_of_val(&*self.instances)
            + size_of_val(&*self.motions)
    }

    /// The nearest hit in (`t_min`, `t_max`].
    ///
    /// `filter` is asked about hits on shapes whose material is not opaque, in no particular order and perhaps
    /// about hits behind the nearest, and rejects a hit by returning false. Of several hits at the same
    /// distance the one on the first (instance, shape, primitive) is returned. A ray that is not finite, or
    /// has no direction, meets nothing.
    #[inline(always)]
    pub fn closest<I: Isa>(&self, isa: I, ray: &Ray, filter: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        isa.outline(traverse::Query::<_, false> { accel: self, ray, filter })
    }

    /// Whether there is a hit in (`t_min`, `t_max`] that `filter` does not reject; see [`Accel::closest`].
    #[inline(always)]
    pub fn occluded<I: Isa>(&self, isa: I, ray: &Ray, filter: impl FnMut(&Hit) -> bool) -> bool {
        isa.outline(traverse::Query::<_, true> { accel: self, ray, filter }).is_some()
    }
}

/// Which objects get a tree of their own: those of several instances, those that move, and those whose primitives an
/// instance would not leave what they are.
fn shared_objects(objects: &[Object], instances: &[Instance]) -> Vec<bool> {
    let mut uses = vec![0u32; objects.len()];
    let mut shared = vec![false; objects.len()];
    for instance in instances {
        let index = instance.object.0 as usize;
        uses[index] += 1;
        shared[index] |= uses[index] > 1 || instance.motion().is_some();
        shared[index] |=
            objects[index].shapes.iter().any(|shape| changes(&shape.geometry, &instance.to_world));
    }
    shared
}

/// Whether a transform would make a shape's primitives something else.
fn changes(geometry: &Geometry, transform: &Affine3A) -> bool {
    match geometry {
        Geometry::Mesh(_) | Geometry::Patches(_) => false,
        Geometry::Sphere { .. } => !is_similarity(transform),
        // Their direction across is that of their normal times their tangent.
        Geometry::Curves(_) => !is_similarity(transform) || transform.matrix3.determinant() < 0.0,
        // They know no axis but z.
        Geometry::Quadric(_) => *transform != Affine3A::IDENTITY,
    }
}

/// Whether a transform keeps spheres spheres, up to rounding.
fn is_similarity(transform: &Affine3A) -> bool {
    let [x, y, z] = [0, 1, 2].map(|i| transform.matrix3.col(i));
    let square = x.length_squared();
    let off = [y.length_squared() - square, z.length_squared() - square, x.dot(y), y.dot(z), z.dot(x)];
    off.into_iter().all(|off| off.abs() <= 16.0 * f32::EPSILON * square)
}
