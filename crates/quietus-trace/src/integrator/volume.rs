//! Paths through media: how far they fly, what they meet on the way, and how they scatter between surfaces.
//!
//! Only scenes with media come here. A surface that is nothing but the border between two media is passed straight
//! on and counts neither as a bounce nor as something that throws a shadow.

use glam::Vec3;

use super::{BEFORE_LIGHT, CAMERA_DIMENSIONS, Path, VERTEX_DIMENSIONS, power_heuristic, segment_to, spread};
use crate::bvh::{Hit, Ray};
use crate::interaction::Interaction;
use crate::isa::{Isa, Job};
use crate::light::{LightSample, Receiver};
use crate::medium::{Chance, Flight, Inside, Medium, Passage, Scattered, Way};
use crate::sampler::mix64;
use crate::tile::TileCounts;

/// Borders a segment may cross. Far more than any scene has; what is beyond is lost, so that a path always ends.
const MAX_BORDERS: u32 = 1 << 16;

/// Where a segment ends.
pub(super) enum Arrival {
    /// On a surface, so far from where the segment started.
    Surface(Hit, Interaction, f32),
    /// Nowhere: nothing is in the way.
    Nothing,
    /// Between surfaces, where the medium scatters it, so far from where it started.
    Scattered(Medium, f32),
}

/// Follows a segment of a path, over borders, to its end.
pub(super) struct Travel<'p, 's, I> {
    pub(super) path: &'p mut Path<'s, I>,
    pub(super) depth: u32,
    pub(super) counts: &'p mut TileCounts,
}

impl<J: Isa> Job for Travel<'_, '_, J> {
    type Output = Arrival;

    #[inline(always)]
    fn run<I: Isa>(self, _: I) -> Arrival {
        let Self { path, depth, counts } = self;
        let scene = path.scene;
        if path.inside == Inside::BELOW {
            return path.wander(depth, counts);
        }
        path.sampler.start_dimension(CAMERA_DIMENSIONS + depth * VERTEX_DIMENSIONS - 1);
        let mut flight = Flight::new(path.throughput, path.sampler.next_1d());
        let mut travelled = 0.0;
        for _ in 0..MAX_BORDERS {
            counts.rays += 1;
            let ray = path.ray();
            let filter = |hit: &Hit| scene.is_border(hit) || path.covers(hit, &ray, 2 * depth);
            let hit = scene.accel.closest(path.isa, &ray, filter);
            let length = hit.map_or(f32::INFINITY, |hit| hit.t);
            if let Some(medium) = path.inside.of(&scene.media)
                && let Some(scattered) = path.fly(medium, &mut flight, length, depth)
            {
                path.throughput *= scattered.weight;
                path.origin += scattered.distance * path.direction;
                return Arrival::Scattered(*medium, travelled + scattered.distance);
            }
            travelled += length;
            let Some(hit) = hit else {
                path.arrive(&flight.passage);
                return Arrival::Nothing;
            };
            let surface = scene.interaction(&hit, &ray);
            if !scene.is_border(&hit) {
                path.arrive(&flight.passage);
                return Arrival::Surface(hit, surface, travelled);
            }
            path.cross(&hit, &surface);
            path.origin = surface.leave(path.direction);
        }
        path.throughput = Vec3::ZERO;
        Arrival::Nothing
    }
}

/// Scatters a path where the medium it is in does so; returns whether the path goes on.
pub(super) struct ScatterInMedium<'p, 's, I> {
    pub(super) path: &'p mut Path<'s, I>,
    pub(super) medium: Medium,
    pub(super) depth: u32,
    pub(super) counts: &'p mut TileCounts,
}

impl<J: Isa> Job for ScatterInMedium<'_, '_, J> {
    type Output = bool;

    #[inline(always)]
    fn run<I: Isa>(self, _: I) -> bool {
        let Self { path, medium, depth, counts } = self;
        path.sampler.start_dimension(CAMERA_DIMENSIONS + depth * VERTEX_DIMENSIONS);
        path.receiver = Receiver::medium(path.origin, path.time);
        let (u_light, u) = (path.sampler.next_1d(), path.sampler.next_2d());
        if let Some(light) = path.scene.sample_light(path.isa, &path.receiver, u_light, u) {
            let density = medium.phase.density(path.direction, light.direction);
            let ray = segment_to(path.origin, &light, path.time);
            let carried = path.throughput * density;
            let connection = Connection { light, carried, pdf: density, inside: path.inside };
            counts.rays += u64::from(path.connect(&ray, &connection, depth));
        }
        // A medium has one lobe: the number that chooses among several is left out.
        let (_, u) = (path.sampler.next_1d(), path.sampler.next_2d());
        (path.direction, path.pdf) = medium.phase.sample(path.direction, u);
        path.cone.spread = path.cone.spread.max(spread(path.pdf));
        path.survives(depth)
    }
}

/// What next-event estimation connects with.
pub(super) struct Connection {
    pub(super) light: LightSample,
    /// Throughput times BSDF and cosine, or phase function.
    pub(super) carried: Vec3,
    /// Density with which the path itself would go on to the light.
    pub(super) pdf: f32,
    /// The medium on this end.
    pub(super) inside: Inside,
}

impl<I: Isa> Path<'_, I> {
    /// Flies through a medium for `length`, and adds what it emits on the way.
    #[inline(always)]
    fn fly(&mut self, medium: &Medium, flight: &mut Flight, length: f32, depth: u32) -> Option<Scattered> {
        let Some(field) = medium.field(&self.scene.fields) else {
            let emitted = self.throughput * flight.passage.weight() * medium.emitted(length);
            self.add(emitted, depth - 1);
            return flight.fly(medium, length);
        };
        let way = Way { origin: self.origin, direction: self.direction, length };
        let mut chance = self.chance(2 * depth, &way);
        let carried = self.throughput;
        field.fly(medium, flight, &way, &mut chance, |emitted| self.add(carried * emitted, depth - 1))
    }

    /// Random numbers of a way, which belongs to the segment `salt`: every way has its own.
    fn chance(&self, salt: u32, way: &Way) -> Chance {
        let place = u64::from(way.length.to_bits()) << 32 | u64::from(way.origin.x.to_bits());
        Chance::new(mix64(self.coverage_key ^ u64::from(salt)) ^ place)
    }

    /// Multiplies in a flight that was not scattered: into the density too, which counts the survivors.
    #[inline(always)]
    pub(super) fn arrive(&mut self, passage: &Passage) {
        self.throughput *= passage.weight();
        if self.pdf != f32::INFINITY {
            self.pdf *= passage.probability();
        }
    }

    /// Goes over to the medium that lies in the path's direction.
    #[inline(always)]
    pub(super) fn cross(&mut self, hit: &Hit, surface: &Interaction) {
        self.inside = self.scene.beyond(hit, surface, self.direction, self.inside);
    }

    /// Adds the light that comes along `ray`, through media and over borders; returns whether a ray was traced.
    #[inline(always)]
    pub(super) fn connect(&mut self, ray: &Ray, connection: &Connection, depth: u32) -> bool {
        let Connection { light, carried, pdf, inside } = connection;
        let contribution = *carried * light.radiance;
        if contribution == Vec3::ZERO {
            return false;
        }
        if self.scene.accel.occluded(self.isa, ray, |hit| self.covers(hit, ray, 2 * depth + 1)) {
            return true;
        }
        let passage = self.passage(ray, *inside, *carried, depth);
        let weight = if light.delta { 1.0 } else { power_heuristic(light.pdf, pdf * passage.probability()) };
        self.add(contribution * passage.transmittance() * (weight / light.pdf), depth);
        true
    }

    /// What happens to light on a ray on which no surface is in the way.
    #[inline(always)]
    fn passage(&self, ray: &Ray, mut inside: Inside, carried: Vec3, depth: u32) -> Passage {
        let scene = self.scene;
        let mut passage = Passage::new(carried);
        let scale = ray.direction.length();
        // Distances are those of a direction of unit length from here on.
        // Media fill all of the way, up to the light itself.
        let end = if ray.t_max == BEFORE_LIGHT { 1.0 } else { ray.t_max };
        let mut ray = Ray { direction: ray.direction / scale, t_max: end * scale, ..*ray };
        for _ in 0..MAX_BORDERS {
            let hit = if scene.has_borders() {
                scene.accel.closest(self.isa, &ray, |hit| scene.is_border(hit))
            } else {
                None
            };
            let below = (inside == Inside::BELOW).then(|| self.depths.medium());
            if let Some(medium) = inside.of(&scene.media).or(below) {
                let length = hit.map_or(ray.t_max, |hit| hit.t);
                if let Some(field) = medium.field(&scene.fields) {
                    let way = Way { origin: ray.origin, direction: ray.direction, length };
                    field.pass(medium, &mut passage, &way, &mut self.chance(2 * depth + 1, &way));
                } else {
                    passage.pass(medium, length);
                }
            }
            let Some(hit) = hit else { break };
            let surface = scene.interaction(&hit, &ray);
            inside = scene.beyond(&hit, &surface, ray.direction, inside);
            ray.origin = surface.leave(ray.direction);
            ray.t_max -= hit.t;
        }
        passage
    }
}
