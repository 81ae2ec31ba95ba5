//! Walks below surfaces: light that has entered wanders until it comes up again.
//!
//! A walk is one segment of its path, however often it is scattered: entering and leaving count as what any surface
//! counts, the way between as nothing. No light is asked on the way, since the surface would hide it. Numbers of the walk
//! are hashed, as nobody knows how many will be needed.
//!
//! Which side is inside is told by the path, not by normals, which many a scene turns around: it is inside from where it
//! enters until it meets a surface of this kind from the other side. Surfaces of the kind that are met from the same
//! side stand in what it wanders in already, and are passed until they are left again: things that overlap are one.

use glam::{Vec2, Vec3};

use super::volume::Arrival;
use super::{CAMERA_DIMENSIONS, Path, VERTEX_DIMENSIONS};
use crate::bsdf::{fresnel, subsurface::Below};
use crate::bvh::{Hit, Ray};
use crate::interaction::Interaction;
use crate::isa::Isa;
use crate::medium::{Chance, Flight, Inside, Medium};
use crate::sampler::mix64;
use crate::tile::TileCounts;

/// Scatterings of a walk after which it ends one time in so many whenever their number has doubled. The chance of a walk
/// through what absorbs nothing to be longer than n falls with the root of n only: paths that are weighted by the root
/// of their length again cost as much, and bring as much variance, in every doubling.
const LONG: u32 = 64;
/// Chance to go on then.
const GOES_ON: f32 = std::f32::consts::FRAC_1_SQRT_2;
/// Scatterings and reflections from below of a walk. Far more than any walk has; what is beyond is lost, so that a path always ends.
const MOST_STEPS: u32 = 1 << 20;
/// Mean free paths are at least so many times as long as positions are off.
const RESOLUTION: f32 = 32.0;

/// What a path that is below a surface knows of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Depths {
    /// What it wanders in.
    medium: Medium,
    /// Where it came from.
    around: Inside,
    /// Whether it entered along the normal, against which one is expected to.
    inverted: bool,
    /// How many surfaces of other such things it is behind.
    shells: u32,
    /// Whether it has been scattered.
    scattered: bool,
}

impl Depths {
    /// Nothing yet.
    pub(super) fn none() -> Self {
        let medium = Medium::below([Vec3::ZERO; 2], 0.0);
        Self { medium, around: Inside::VACUUM, inverted: false, shells: 0, scattered: false }
    }

    pub(super) fn medium(&self) -> &Medium {
        &self.medium
    }
}

/// What a surface is to a walk that meets it.
enum Meeting {
    /// Where it ends.
    End,
    /// Part of another such thing.
    Shell,
    /// What reflects it from below, with this index of refraction.
    Ceiling(f32),
}

impl<I: Isa> Path<'_, I> {
    /// From where the path comes to a surface that light wanders below.
    #[inline]
    pub(super) fn below(&self) -> Below {
        match (self.inside == Inside::BELOW, self.depths.scattered) {
            (false, _) => Below::No,
            (true, false) => Below::Straight,
            (true, true) => Below::Scattered,
        }
    }

    /// Where light is that leaves such a surface in direction `w`; `None` where it enters.
    pub(super) fn beside(&self, hit: &Hit, surface: &Interaction, w: Vec3) -> Option<Inside> {
        let crosses = w.dot(surface.geometric_normal) * self.direction.dot(surface.geometric_normal) > 0.0;
        match (crosses, self.inside == Inside::BELOW) {
            (false, _) => Some(self.inside),
            (true, true) => Some(self.scene.beyond(hit, surface, w, self.depths.around)),
            (true, false) => None,
        }
    }

    /// Goes over to what lies in the path's direction, where it arrived at such a surface in direction `arrived`.
    pub(super) fn cross_subsurface(&mut self, hit: &Hit, surface: &Interaction, arrived: Vec3) {
        let (before, after) =
            (arrived.dot(surface.geometric_normal), self.direction.dot(surface.geometric_normal));
        if before * after <= 0.0 {
            return;
        }
        if self.inside == Inside::BELOW {
            self.inside = self.scene.beyond(hit, surface, self.direction, self.depths.around);
            return;
        }
        let medium = self.scene.materials.medium_below(surface.material, &surface.surface);
        let Some(medium) = medium else { return };
        self.depths = Depths {
            medium: medium.no_finer_than(RESOLUTION * surface.error.max_element()),
            around: self.inside,
            inverted: before > 0.0,
            shells: 0,
            scattered: false,
        };
        self.inside = Inside::BELOW;
        // No light was asked that is below.
        self.pdf = f32::INFINITY;
    }

    /// Wanders below a surface to wherever the walk ends.
    #[inline(always)]
    pub(super) fn wander(&mut self, depth: u32, counts: &mut TileCounts) -> Arrival {
        let (scene, medium) = (self.scene, self.depths.medium);
        self.sampler.start_dimension(CAMERA_DIMENSIONS + depth * VERTEX_DIMENSIONS - 1);
        let mut chance = Chance::new(mix64(self.coverage_key ^ u64::from(2 * depth)));
        let (mut flight, mut left) =
            Flight::in_channel(self.throughput, self.sampler.next_1d(), chance.number());
        let (mut trust, mut travelled) = (self.throughput.max_element(), 0.0);
        for step in 1..=MOST_STEPS {
            counts.rays += 1;
            let ray = Ray { t_max: flight.free(&medium), ..self.ray() };
            let hit = scene.accel.closest(self.isa, &ray, |hit| self.covers(hit, &ray, 2 * depth));
            if let Some(scattered) = flight.fly(&medium, hit.map_or(f32::INFINITY, |hit| hit.t)) {
                let number = flight.channel_number(&medium, Some(scattered.distance), left);
                travelled += scattered.distance;
                self.throughput *= scattered.weight;
                self.origin += scattered.distance * self.direction;
                let u = Vec2::new(chance.number(), chance.number());
                (self.direction, _) = medium.phase.sample(self.direction, u);
                (self.depths.scattered, self.pdf) = (true, f32::INFINITY);
                if !self.goes_on(step, &mut trust, &mut chance) {
                    break;
                }
                (flight, left) = Flight::in_channel(self.throughput, number, chance.number());
                continue;
            }
            let Some(hit) = hit else {
                self.arrive(&flight.passage);
                return Arrival::Nothing;
            };
            travelled += hit.t;
            let surface = scene.interaction(&hit, &ray);
            match self.meet(&hit, &surface, depth) {
                Meeting::End => {
                    self.arrive(&flight.passage);
                    return Arrival::Surface(hit, surface, travelled);
                }
                Meeting::Shell => self.origin = surface.leave(self.direction),
                Meeting::Ceiling(ior) => {
                    self.arrive(&flight.passage);
                    let cosine = self.direction.dot(surface.geometric_normal);
                    if chance.number() >= fresnel::dielectric(cosine.abs(), 1.0 / ior).0 {
                        return Arrival::Surface(hit, surface, travelled);
                    }
                    self.direction -= 2.0 * cosine * surface.geometric_normal;
                    self.origin = surface.leave(self.direction);
                    let number = flight.channel_number(&medium, None, left);
                    (flight, left) = Flight::in_channel(self.throughput, number, chance.number());
                }
            }
        }
        self.throughput = Vec3::ZERO;
        Arrival::Nothing
    }

    /// What the surface at `hit` is to a walk.
    #[inline(always)]
    fn meet(&mut self, hit: &Hit, surface: &Interaction, depth: u32) -> Meeting {
        let materials = &self.scene.materials;
        let material =
            materials.resolve(surface.material, &surface.surface, || self.bits(hit, 2 * depth) << 24);
        let Some(ior) = materials.subsurface_ior(material) else { return Meeting::End };
        let depths = &mut self.depths;
        if (self.direction.dot(surface.geometric_normal) > 0.0) == depths.inverted {
            depths.shells += 1;
            return Meeting::Shell;
        }
        if depths.shells > 0 {
            depths.shells -= 1;
            return Meeting::Shell;
        }
        if depths.scattered { Meeting::Ceiling(ior) } else { Meeting::End }
    }

    /// Russian roulette by what is left of the light that entered, and by the length of the walk.
    #[inline(always)]
    fn goes_on(&mut self, step: u32, trust: &mut f32, chance: &mut Chance) -> bool {
        if step >= LONG && step.is_power_of_two() {
            if chance.number() >= GOES_ON {
                return false;
            }
            self.throughput /= GOES_ON;
            *trust /= GOES_ON;
        }
        let carried = self.throughput.max_element() / *trust;
        if carried >= 1.0 {
            return true;
        }
        self.throughput /= carried;
        chance.number() < carried
    }
}
