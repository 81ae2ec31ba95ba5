//! What a ray meets first, and whether it meets anything.

use glam::Vec3;

use crate::desc::{Geometry, Instance, MaterialId, Object};
use crate::geometry::{sphere, triangle};
use crate::isa::Isa;

/// A half-line, or a piece of it.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Where it starts.
    pub origin: Vec3,
    /// Where it runs to; not 0, need not be of unit length: distances are in its units.
    pub direction: Vec3,
    /// Only hits beyond this distance count.
    pub t_min: f32,
    /// Only hits up to this distance count; may be infinite.
    pub t_max: f32,
}

/// Where a ray met a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// Triangles: barycentric coordinate of the second vertex. Spheres: 0.
    pub u: f32,
    /// Triangles: barycentric coordinate of the third vertex. Spheres: 0.
    pub v: f32,
    /// Index of the instance.
    pub instance: u32,
    /// Index of the shape in the instance's object.
    pub shape: u32,
    /// Index of the triangle in the shape's mesh. Spheres: 0.
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
}

#[derive(Clone, Copy, Debug)]
enum Form {
    Triangle([Vec3; 3]),
    Sphere(Vec3, f32),
}

#[derive(Clone, Copy, Debug)]
struct Primitive {
    form: Form,
    opaque: bool,
    instance: u32,
    shape: u32,
    primitive: u32,
}

/// The acceleration structure over a whole scene.
#[derive(Debug)]
pub struct Accel {
    primitives: Vec<Primitive>,
    bounds: Bounds,
}

impl Accel {
    /// Builds it over what the instances place in the world. `opaque` says which materials cover everywhere:
    /// hits on others are put before the filter of [`Accel::closest`] and [`Accel::occluded`].
    ///
    /// # Panics
    /// Where an instance names an object, or a triangle a vertex, that is not there.
    pub fn build(objects: &[Object], instances: &[Instance], opaque: impl Fn(MaterialId) -> bool) -> Self {
        let mut accel = Self { primitives: Vec::new(), bounds: Bounds::EMPTY };
        for (i, instance) in instances.iter().enumerate() {
            for (s, shape) in objects[instance.object.0 as usize].shapes.iter().enumerate() {
                let mut push = |primitive: usize, form| {
                    let (instance, shape_index) = (i as u32, s as u32);
                    accel.primitives.push(Primitive {
                        form,
                        opaque: opaque(shape.material),
                        instance,
                        shape: shape_index,
                        primitive: primitive as u32,
                    });
                };
                let place = |p: Vec3| instance.to_world.transform_point3(p);
                match &shape.geometry {
                    Geometry::Mesh(mesh) => {
                        for (p, &indices) in mesh.triangles.iter().enumerate() {
                            push(p, Form::Triangle(indices.map(|i| place(mesh.positions[i as usize]))));
                        }
                    }
                    Geometry::Sphere { center, radius } => {
                        let scale = instance.to_world.matrix3.x_axis.length();
                        push(0, Form::Sphere(place(*center), radius * scale));
                    }
                }
            }
        }
        for primitive in &accel.primitives {
            let (min, max) = match primitive.form {
                Form::Triangle([a, b, c]) => (a.min(b).min(c), a.max(b).max(c)),
                Form::Sphere(c, r) => (c - r, c + r),
            };
            accel.bounds.min = accel.bounds.min.min(min);
            accel.bounds.max = accel.bounds.max.max(max);
        }
        accel
    }

    /// Bounds of the world.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Bytes it occupies.
    pub fn bytes(&self) -> usize {
        self.primitives.len() * size_of::<Primitive>()
    }

    /// The nearest hit in (`t_min`, `t_max`].
    ///
    /// `filter` is asked about hits on shapes whose material is not opaque, in no particular order, and
    /// rejects a hit by returning false. Of several hits at the same distance the one on the first
    /// (instance, shape, primitive) is returned. A ray that is not finite meets nothing.
    pub fn closest<I: Isa>(&self, isa: I, ray: &Ray, mut filter: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        let _ = isa;
        let mut ray = *ray;
        let mut best = None;
        let sheared = triangle::Sheared::new(ray.direction);
        for p in &self.primitives {
            let Some((t, u, v)) = (match p.form {
                Form::Triangle(vertices) => triangle::intersect(ray.origin, &sheared, vertices),
                Form::Sphere(c, r) => {
                    sphere::intersect(ray.origin, ray.direction, ray.t_min, ray.t_max, c, r)
                        .map(|t| (t, 0.0, 0.0))
                }
            }) else {
                continue;
            };
            let hit = Hit { t, u, v, instance: p.instance, shape: p.shape, primitive: p.primitive };
            if t > ray.t_min && t <= ray.t_max && (p.opaque || filter(&hit)) {
                best = Some(hit);
                ray.t_max = t;
            }
        }
        best
    }

    /// Whether there is a hit in (`t_min`, `t_max`] that `filter` does not reject; see [`Accel::closest`].
    pub fn occluded<I: Isa>(&self, isa: I, ray: &Ray, filter: impl FnMut(&Hit) -> bool) -> bool {
        self.closest(isa, ray, filter).is_some()
    }
}
