//! Gathers emissive surfaces, still and moving.

use glam::{Affine3A, Vec2, Vec3};

use super::NO_LIGHT;
use crate::bvh::{Hit, Ray};
use crate::desc::{Geometry, SceneDesc, Shape};
use crate::geometry::motion::Motion;
use crate::interaction::{Placement, corners, surface_point};
use crate::light::{
    AreaLight, Emitter, Emitters, PatchLight, QuadricLight, SphereLight, SurfaceLight, TriangleLight,
};
use crate::material::MaterialTable;

/// Whether it changes its form.
pub(super) fn is_deforming(geometry: &Geometry) -> bool {
    matches!(geometry, Geometry::Mesh(mesh) if !mesh.end_positions.is_empty())
}

/// One primitive of a shape as a light, where it is at `time`; none for curves, which are so thin that sampling them
/// would gain little: paths find them by chance.
pub(super) fn area_light(
    geometry: &Geometry,
    flipped: bool,
    primitive: u32,
    to_world: &Affine3A,
    time: f32,
) -> Option<AreaLight> {
    Some(match geometry {
        Geometry::Mesh(mesh) => {
            let indices = mesh.triangles[primitive as usize].map(|i| i as usize);
            let (corners, _) = corners(mesh, indices, time);
            AreaLight::Triangle(TriangleLight::new(corners, to_world, flipped))
        }
        Geometry::Sphere { center, radius } => {
            AreaLight::Sphere(SphereLight::new(*center, *radius, *to_world, flipped))
        }
        Geometry::Quadric(quadric) => {
            AreaLight::Surface(SurfaceLight::Quadric(QuadricLight::new(*quadric, *to_world, flipped)))
        }
        Geometry::Patches(mesh) => {
            let corners = mesh.patches[primitive as usize].map(|i| mesh.positions[i as usize]);
            AreaLight::Surface(SurfaceLight::Patch(PatchLight::new(corners, to_world, flipped)))
        }
        Geometry::Curves(_) => return None,
    })
}

/// How many lights a shape makes.
fn primitives(geometry: &Geometry) -> u32 {
    match geometry {
        Geometry::Mesh(mesh) => mesh.triangles.len() as u32,
        Geometry::Sphere { .. } | Geometry::Quadric(_) => 1,
        Geometry::Patches(mesh) => mesh.patches.len() as u32,
        Geometry::Curves(_) => 0,
    }
}

/// Gathers the emitters of one instance after another.
pub(super) struct Collector<'a> {
    desc: &'a SceneDesc,
    materials: &'a MaterialTable,
    emitters: Emitters,
    /// See [`super::Scene::first_lights`].
    first: Vec<u32>,
}

impl<'a> Collector<'a> {
    pub(super) fn new(desc: &'a SceneDesc, materials: &'a MaterialTable) -> Self {
        Self { desc, materials, emitters: Emitters::default(), first: Vec::new() }
    }

    /// How many shapes of instances it has seen.
    pub(super) fn slots(&self) -> u32 {
        self.first.len() as u32
    }

    /// The emitters, and for every shape of every instance the number of its first light among its kind.
    pub(super) fn finish(self) -> (Emitters, Vec<u32>) {
        (self.emitters, self.first)
    }

    /// Takes in the shapes of an instance: where it is when the shutter opens, and how it moves if it does.
    pub(super) fn instance(&mut self, index: u32, placement: &Placement, motion: Option<&Motion>) {
        let object = &self.desc.objects[self.desc.instances[index as usize].object.0 as usize];
        for (number, shape) in (0u32..).zip(&object.shapes) {
            // Borders between media are not seen and shine as little.
            let shines = self.materials.emits(shape.material) && !self.materials.is_interface(shape.material);
            let shines = shines && primitives(&shape.geometry) > 0;
            let first = if shines { self.shape([index, number], shape, placement, motion) } else { NO_LIGHT };
            self.first.push(first);
        }
    }

    /// Adds an emissive shape; returns the number of its first light among its kind.
    fn shape(
        &mut self,
        [instance, number]: [u32; 2],
        shape: &Shape,
        placement: &Placement,
        motion: Option<&Motion>,
    ) -> u32 {
        let moves = motion.is_some() || is_deforming(&shape.geometry);
        let first = match shape.geometry {
            _ if moves => self.emitters.moving.len(),
            Geometry::Mesh(_) => self.emitters.triangles.len(),
            Geometry::Sphere { .. } => self.emitters.spheres.len(),
            _ => self.emitters.surfaces.len(),
        };
        for primitive in 0..primitives(&shape.geometry) {
            let at = |time: f32| {
                let to_world = motion.map_or(placement.to_world, |motion| motion.at(time));
                area_light(&shape.geometry, shape.flipped, primitive, &to_world, time)
            };
            let Some(light) = at(0.0) else { continue };
            let emitter = self.emitter([instance, number, primitive], shape, placement, &light);
            if moves {
                let bounds = SNAPSHOTS.iter().filter_map(|&time| Some(at(time)?.bounds(&emitter)));
                let bounds = bounds.reduce(|all, bounds| all.snapshot(&bounds));
                self.emitters.moving.extend(bounds.map(|bounds| emitter.with(bounds)));
                continue;
            }
            match light {
                AreaLight::Triangle(triangle) => self.emitters.triangles.push(emitter.with(triangle)),
                AreaLight::Sphere(sphere) => self.emitters.spheres.push(emitter.with(sphere)),
                AreaLight::Surface(surface) => self.emitters.surfaces.push(emitter.with(surface)),
            }
        }
        first as u32
    }

    /// All about an emitter but its geometry.
    fn emitter(
        &self,
        [instance, number, primitive]: [u32; 3],
        shape: &Shape,
        placement: &Placement,
        light: &AreaLight,
    ) -> Emitter<()> {
        let material = shape.material;
        let unseen = self.materials.is_unseen(material);
        let varies =
            self.materials.emission_is_textured(material) || !(unseen || self.materials.is_opaque(material));
        let radiance_at = |u: Vec2| {
            let (position, at) = light.point(u);
            let hit = Hit { t: 0.0, u: at.x, v: at.y, instance, shape: number, primitive };
            // The direction matters as little as the distance: the hit is where the ray starts.
            let surface = surface_point(&shape.geometry, placement, &hit, &Ray::new(position, Vec3::Z, 0.0));
            let coverage = if unseen { 1.0 } else { self.materials.alpha(material, &surface) };
            self.materials.emission(material, &surface, true) * coverage
        };
        let radiance = if varies { mean(radiance_at) } else { radiance_at(Vec2::splat(0.5)) };
        let two_sided = self.materials.emits_two_sided(material);
        Emitter { geometry: (), instance, shape: number, primitive, radiance, varies, two_sided, unseen }
    }
}

/// When a moving light is looked at to bound its way. Between them it may stray a little from these bounds; then paths
/// find it by chance, which stays right, only noisier.
const SNAPSHOTS: [f32; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];

/// Points per axis at which a light whose emission varies is looked at to weigh it against others. Where all of
/// them are dark the light is left to paths that hit it by chance, which stays right, only noisier.
const PROBES: u32 = 4;

fn mean(radiance: impl Fn(Vec2) -> Vec3) -> Vec3 {
    let place = |i: u32| (i as f32 + 0.5) / PROBES as f32;
    let probes = (0..PROBES * PROBES).map(|i| radiance(Vec2::new(place(i % PROBES), place(i / PROBES))));
    probes.sum::<Vec3>() / (PROBES * PROBES) as f32
}
