//! From a checked description to a scene: light tables, flat shapes, the acceleration structure.

use glam::{Vec2, Vec3};

use super::{CompiledShape, NO_LIGHT, PlacedObject, STILL, Scene};
use crate::bvh::Accel;
use crate::desc::{Geometry, MaterialId, SceneDesc, Shape};
use crate::geometry::motion::Motion;
use crate::interaction::{Placement, mesh_surface, sphere_surface};
use crate::light::{
    Emitter, Emitters, Lights, PatchLight, QuadricLight, SphereLight, SurfaceLight, TriangleLight,
};
use crate::material::{MaterialTable, SurfacePoint};
use crate::medium::{Border, Medium};
use crate::warp;

/// Compiles a description that has been checked.
pub(super) fn scene(desc: &SceneDesc, materials: MaterialTable) -> Scene {
    let mut shapes = Vec::new();
    let mut first_shapes = Vec::new();
    for object in &desc.objects {
        first_shapes.push(shapes.len() as u32);
        shapes.extend(object.shapes.iter().map(|s| CompiledShape {
            geometry: s.geometry.clone(),
            material: s.material,
            textured: materials.is_textured(s.material),
            border: Border::new(s.media),
            only_border: materials.is_interface(s.material) && Border::new(s.media).is_some(),
            flipped: s.flipped,
        }));
    }
    let mut collector =
        Collector { desc, materials: &materials, emitters: Emitters::default(), first: Vec::new() };
    let mut instances = Vec::with_capacity(desc.instances.len());
    let mut motions = Vec::new();
    for (index, instance) in desc.instances.iter().enumerate() {
        let placement = Placement::new(instance.to_world);
        let first_slot = collector.first.len() as u32;
        let motion = instance.motion().and_then(|end| Motion::new(&instance.to_world, end));
        let number = if motion.is_some() { motions.len() as u32 } else { STILL };
        motions.extend(motion);
        instances.push(PlacedObject {
            placement,
            motion: number,
            first_shape: first_shapes[instance.object.0 as usize],
            first_slot,
        });
        collector.instance(index as u32, &placement);
    }
    let Collector { emitters, first: first_lights, .. } = collector;
    let lights = Lights::new(emitters, &desc.lights, desc.environment.as_ref());
    let accel = Accel::build(&desc.objects, &desc.instances, |material| materials.is_opaque(material));
    let moves = !motions.is_empty() || shapes.iter().any(|shape| is_deforming(&shape.geometry));
    let media = desc.media.iter().map(Medium::new).collect();
    let has_borders = shapes.iter().any(|shape| shape.only_border);
    Scene { accel, materials, lights, media, has_borders, instances, shapes, first_lights, motions, moves }
}

/// Whether it changes its form.
fn is_deforming(geometry: &Geometry) -> bool {
    matches!(geometry, Geometry::Mesh(mesh) if !mesh.end_positions.is_empty())
}

/// Gathers emissive surfaces.
struct Collector<'a> {
    desc: &'a SceneDesc,
    materials: &'a MaterialTable,
    emitters: Emitters,
    /// See [`Scene::first_lights`].
    first: Vec<u32>,
}

impl Collector<'_> {
    fn instance(&mut self, index: u32, placement: &Placement) {
        let instance = &self.desc.instances[index as usize];
        let object = &self.desc.objects[instance.object.0 as usize];
        for (number, shape) in object.shapes.iter().enumerate() {
            // What moves is left to paths that hit it: the lights' tables know one place for each.
            let moves = instance.motion().is_some() || is_deforming(&shape.geometry);
            // Borders between media are not seen and shine as little.
            let shines = self.materials.emits(shape.material) && !self.materials.is_interface(shape.material);
            let first =
                if shines && !moves { self.shape(index, number as u32, shape, placement) } else { NO_LIGHT };
            self.first.push(first);
        }
    }

    /// Adds an emissive shape; returns the number of its first light among its kind.
    fn shape(&mut self, instance: u32, number: u32, shape: &Shape, placement: &Placement) -> u32 {
        let material = shape.material;
        match &shape.geometry {
            Geometry::Mesh(mesh) => {
                let first = self.emitters.triangles.len() as u32;
                for (primitive, &indices) in mesh.triangles.iter().enumerate() {
                    let primitive = primitive as u32;
                    let corners = indices.map(|i| mesh.positions[i as usize]);
                    let geometry = TriangleLight::new(corners, &placement.to_world, shape.flipped);
                    let at = |u: Vec2| {
                        let b = warp::triangle(u);
                        mesh_surface(mesh, primitive, b.x, b.y)
                    };
                    let emitter = self.emitter(geometry, [instance, number, primitive], material, at);
                    self.emitters.triangles.push(emitter);
                }
                first
            }
            Geometry::Sphere { center, radius } => {
                let geometry = SphereLight::new(*center, *radius, placement.to_world, shape.flipped);
                let at = |u: Vec2| sphere_surface(warp::uniform_sphere(u));
                let emitter = self.emitter(geometry, [instance, number, 0], material, at);
                self.emitters.spheres.push(emitter);
                self.emitters.spheres.len() as u32 - 1
            }
            Geometry::Quadric(quadric) => {
                let geometry = QuadricLight::new(*quadric, placement.to_world, shape.flipped);
                self.surface([instance, number, 0], SurfaceLight::Quadric(geometry), material)
            }
            Geometry::Patches(mesh) => {
                let first = self.emitters.surfaces.len() as u32;
                for (primitive, &indices) in mesh.patches.iter().enumerate() {
                    let corners = indices.map(|i| mesh.positions[i as usize]);
                    let geometry = PatchLight::new(corners, &placement.to_world, shape.flipped);
                    let place = [instance, number, primitive as u32];
                    self.surface(place, SurfaceLight::Patch(geometry), material);
                }
                first
            }
            // So thin that light sampling would gain little: paths find them by chance.
            Geometry::Curves(_) => NO_LIGHT,
        }
    }

    fn surface(&mut self, place: [u32; 3], geometry: SurfaceLight, material: MaterialId) -> u32 {
        let [instance, shape, primitive] = place;
        let varies = self.varies(material);
        let radiance = self.materials.mean_emission(material);
        let two_sided = self.materials.emits_two_sided(material);
        let emitter = Emitter { geometry, instance, shape, primitive, radiance, varies, two_sided };
        self.emitters.surfaces.push(emitter);
        self.emitters.surfaces.len() as u32 - 1
    }

    /// Whether emission or coverage differ from place to place.
    fn varies(&self, material: MaterialId) -> bool {
        self.materials.emission_is_textured(material) || !self.materials.is_opaque(material)
    }

    fn emitter<G>(
        &self,
        geometry: G,
        [instance, shape, primitive]: [u32; 3],
        material: MaterialId,
        at: impl Fn(Vec2) -> SurfacePoint,
    ) -> Emitter<G> {
        let varies = self.varies(material);
        let radiance_at = |u: Vec2| {
            let surface = at(u);
            self.materials.emission(material, &surface, true) * self.materials.alpha(material, &surface)
        };
        let radiance = if varies { mean(radiance_at) } else { radiance_at(Vec2::splat(0.5)) };
        let two_sided = self.materials.emits_two_sided(material);
        Emitter { geometry, instance, shape, primitive, radiance, varies, two_sided }
    }
}

/// Points per axis at which a light whose emission varies is looked at to weigh it against others. Where all of
/// them are dark the light is left to paths that hit it by chance, which stays right, only noisier.
const PROBES: u32 = 4;

fn mean(radiance: impl Fn(Vec2) -> Vec3) -> Vec3 {
    let place = |i: u32| (i as f32 + 0.5) / PROBES as f32;
    let probes = (0..PROBES * PROBES).map(|i| radiance(Vec2::new(place(i % PROBES), place(i / PROBES))));
    probes.sum::<Vec3>() / (PROBES * PROBES) as f32
}
