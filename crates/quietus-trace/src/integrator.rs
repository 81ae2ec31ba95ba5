//! One camera path: unidirectional path tracing with next-event estimation.
//!
//! At every surface that is not perfectly smooth one light is chosen and connected to, and the path goes on in a
//! direction drawn from the BSDF. What both ways can find is weighted by the power heuristic (Veach 1997, section
//! 9.2.4); what only one can find, in full: lights without extent, and emitters seen after a perfectly smooth
//! surface, which is how caustics appear. Nothing is clamped unless the view asks for it.
//!
//! In scenes with media the same happens at points between surfaces: see `volume`.

use glam::{Vec2, Vec3};

use crate::bsdf::{Bsdf, same_side};
use crate::bvh::{Hit, Ray};
use crate::camera::Cone;
use crate::frame::Frame;
use crate::geometry::offset_ray_origin;
use crate::interaction::Interaction;
use crate::isa::Isa;
use crate::light::{LightSample, Receiver, Target};
use crate::medium::{Inside, Medium};
use crate::sampler::{Sampler, mix64};
use crate::scene::Scene;
use crate::tile::{PixelWork, Sample, TileCounts};
use crate::view::View;
use crate::warp;
use subsurface::Depths;
use volume::{Arrival, Connection, ScatterInMedium, Travel};

mod subsurface;
mod volume;

/// Path segments before Russian roulette may end a path: direct light carries most of the picture. In the Cornell box
/// of the benchmark `paths`, 2 instead of 4 saves 23 % of the rays and adds 2 % to the variance.
const ROULETTE_AFTER: u32 = 2;
/// How much more than what it carries a path is trusted with where it may yet escape to an environment, which is bright on
/// all sides, at the first roulette and later. What it carries counts in proportion to what the first surface left of it:
/// paths from dark surfaces are all that their pixels are drawn from. docs/light-transport.md tells what other values
/// cost.
const TRUST_IN_ENVIRONMENTS: [f32; 2] = [4.0, 2.0];

/// Dimensions of the sampler taken by the camera: place in the filter, place on the lens.
const CAMERA_DIMENSIONS: u32 = 4;
/// Dimension of the time at which the path is shot, where anything moves: the first of those that a vertex of depth
/// 0 would take.
const TIME_DIMENSION: u32 = CAMERA_DIMENSIONS;
/// Dimension of the colour channel that a path goes on with where channels part: the next of those. So the samples of a
/// pixel are spread evenly over channels.
const CHANNEL_DIMENSION: u32 = TIME_DIMENSION + 1;
/// Dimensions taken by a vertex, surface or medium: light (1), place on it (2), lobe (1), direction (2), roulette (1),
/// and how far the path flies from there (1), which is drawn in scenes with media. What the vertex of depth 0, the
/// camera, does not need of its block is the time's and the first flight's.
const VERTEX_DIMENSIONS: u32 = 8;

/// A path at work.
struct Path<'a, I> {
    isa: I,
    scene: &'a Scene,
    view: &'a View,
    sampler: Sampler,
    /// Source of the decisions about surfaces of partial coverage, whose number is not known beforehand.
    coverage_key: u64,
    origin: Vec3,
    /// Of unit length.
    direction: Vec3,
    /// How much of the world around it the path stands for.
    cone: Cone,
    /// In 0..1 of the shutter's time; 0 where nothing moves.
    time: f32,
    /// Whom next-event estimation spoke of where the path last scattered.
    receiver: Receiver,
    /// Density per steradian of [`Self::direction`]; infinite where nothing else can find it.
    pdf: f32,
    throughput: Vec3,
    /// What it carried, at most 1, when Russian roulette began.
    at_first: f32,
    /// Product of `eta^2` so far: what refraction has taken from the throughput without losing energy.
    eta2: f32,
    /// The medium it is in; looked at in scenes with media alone.
    inside: Inside,
    /// What that is below a surface that light wanders under.
    depths: Depths,
    sample: Sample,
    /// Whether albedo and normal have been found.
    guided: bool,
}

/// Sample `index` of the pixel of `run`.
#[inline(always)]
pub(crate) fn sample<I: Isa>(
    isa: I,
    scene: &Scene,
    view: &View,
    run: &PixelWork,
    index: u32,
    counts: &mut TileCounts,
) -> Sample {
    let mut sampler = Sampler::new(view.seed, run.x, run.y, run.replicate, index);
    let filtered = view.filter.sample(sampler.next_2d());
    let film = Vec2::new(run.x as f32 + 0.5, run.y as f32 + 0.5) + filtered.offset;
    let lens = if view.camera.has_lens() { warp::disk(sampler.next_2d()) } else { Vec2::ZERO };
    let coverage_key = sampler.bits();
    let time = if scene.moves() || view.camera.moves() { time(&mut sampler) } else { 0.0 };
    let ray = view.camera.ray(film, lens, time);
    if ray.weight == 0.0 {
        counts.paths += 1;
        return Sample { alpha: filtered.weight, ..Sample::default() };
    }
    let mut path = Path {
        isa,
        scene,
        view,
        sampler,
        coverage_key,
        origin: ray.origin,
        direction: ray.direction,
        cone: ray.cone,
        time,
        receiver: Receiver::medium(ray.origin, time),
        pdf: f32::INFINITY,
        throughput: Vec3::ONE,
        at_first: 1.0,
        eta2: 1.0,
        inside: view.medium,
        depths: Depths::none(),
        sample: Sample::default(),
        guided: false,
    };
    counts.paths += 1;
    for depth in 1..=view.max_depth {
        let arrival = if scene.has_volumes {
            isa.outline(Travel { path: &mut path, depth, counts })
        } else {
            path.travel(depth, counts)
        };
        let (hit, mut surface) = match arrival {
            Arrival::Surface(hit, surface, distance) => {
                path.reach(depth, distance, ray.axis_cosine);
                (hit, surface)
            }
            Arrival::Nothing => {
                path.escape(depth);
                break;
            }
            Arrival::Scattered(medium, distance) => {
                path.reach(depth, distance, ray.axis_cosine);
                path.guide_in_medium(&medium);
                let ends = depth == view.max_depth;
                if ends || !isa.outline(ScatterInMedium { path: &mut path, medium, depth, counts }) {
                    break;
                }
                continue;
            }
        };
        surface.surface.footprint =
            scene.footprint(&hit, &surface, (path.direction, path.time), path.cone.radius);
        let emission = path.emission(&hit, &surface, depth);
        surface.material = scene.materials.resolve(surface.material, &surface.surface, || {
            // Coverage was decided by the upper bits.
            path.bits(&hit, 2 * depth) << 24
        });
        let frame = path.frame(&hit, &surface);
        let mut bsdf = if scene.materials.disperses(surface.material) {
            let channel = path.single_out();
            scene.materials.bsdf_of_channel(surface.material, &surface.surface, channel)
        } else {
            scene.materials.bsdf(surface.material, &surface.surface, path.coverage_key)
        };
        if let Bsdf::Subsurface(b) = &mut bsdf {
            *b = b.seen_from(path.below());
        }
        path.guide(emission, &frame, &bsdf);
        if depth == view.max_depth || matches!(bsdf, Bsdf::Black) {
            break;
        }
        path.sampler.start_dimension(CAMERA_DIMENSIONS + depth * VERTEX_DIMENSIONS);
        counts.rays += u64::from(path.next_event(&hit, &surface, &frame, &bsdf, depth));
        let arrived = path.direction;
        if !path.scatter(&surface, &frame, &bsdf, depth) {
            break;
        }
        if matches!(bsdf, Bsdf::Subsurface(_)) {
            path.cross_subsurface(&hit, &surface, arrived);
        } else if scene.has_volumes {
            path.cross(&hit, &surface);
        }
    }
    // Not the guides, which thereby are averaged with the filter's magnitude and stay in their ranges.
    path.sample.radiance = view.expose(path.sample.radiance * ray.weight) * filtered.weight;
    path.sample.alpha *= filtered.weight;
    path.sample
}

/// When the path is shot: uniform over the shutter's time.
#[inline(always)]
fn time(sampler: &mut Sampler) -> f32 {
    sampler.start_dimension(TIME_DIMENSION);
    sampler.next_1d()
}

impl<I: Isa> Path<'_, I> {
    /// The next segment, open-ended.
    #[inline(always)]
    fn ray(&self) -> Ray {
        Ray::new(self.origin, self.direction, self.time)
    }

    /// What the next segment hits, where there are no media.
    #[inline(always)]
    fn travel(&self, depth: u32, counts: &mut TileCounts) -> Arrival {
        counts.rays += 1;
        let ray = self.ray();
        match self.scene.accel.closest(self.isa, &ray, |hit| self.covers(hit, &ray, 2 * depth)) {
            Some(hit) => Arrival::Surface(hit, self.scene.interaction(&hit, &ray), hit.t),
            None => Arrival::Nothing,
        }
    }

    /// Records that the path met something after `distance`, if that was the first along a ray that has the cosine
    /// `axis_cosine` with the camera's axis.
    #[inline(always)]
    fn reach(&mut self, depth: u32, distance: f32, axis_cosine: f32) {
        self.cone.radius += self.cone.spread * distance;
        if depth == 1 {
            self.sample.alpha = 1.0;
            self.sample.depth = distance * axis_cosine;
        }
    }

    /// Whether a surface of partial coverage counts. Every place of every segment (`salt`) decides by itself, and
    /// always the same way, however often it is asked.
    fn covers(&self, hit: &Hit, ray: &Ray, salt: u32) -> bool {
        let coverage = self.scene.coverage(hit, ray);
        if coverage <= 0.0 || coverage >= 1.0 {
            return coverage > 0.0;
        }
        ((self.bits(hit, salt) >> 40) as f32) < coverage * (1u32 << 24) as f32
    }

    /// Random bits of a hit on a segment (`salt`): the same whenever they are asked for.
    fn bits(&self, hit: &Hit, salt: u32) -> u64 {
        let place = u64::from(hit.instance) << 32 | u64::from(hit.shape) << 40 ^ u64::from(hit.primitive);
        let entry = u64::from(hit.t.to_bits()) << 32 | u64::from(salt);
        mix64(mix64(self.coverage_key ^ place) ^ entry)
    }

    /// Goes on with one colour channel alone, because others part from it: chosen by what each carries, and weighted by
    /// one over its probability.
    #[cold]
    fn single_out(&mut self) -> usize {
        let sum = self.throughput.element_sum();
        self.sampler.start_dimension(CHANNEL_DIMENSION);
        // Of no importance the next time: only one channel is left then.
        let mut u = self.sampler.next_1d() * sum;
        let mut channel = self.throughput.max_position();
        for candidate in 0..3 {
            let carried = self.throughput[candidate];
            if carried > 0.0 {
                channel = candidate;
                if u < carried {
                    break;
                }
                u -= carried;
            }
        }
        self.throughput = Vec3::AXES[channel] * sum;
        channel
    }

    /// Adds light that was scattered `scatterings` times.
    #[inline(always)]
    fn add(&mut self, radiance: Vec3, scatterings: u32) {
        self.sample.radiance += self.view.limit_indirect(radiance, scatterings);
    }

    /// Nothing was hit: adds the environment.
    #[inline(always)]
    fn escape(&mut self, depth: u32) {
        let Some(environment) = self.scene.environment() else { return };
        let (radiance, weight) = if self.pdf == f32::INFINITY {
            (environment.radiance(self.origin, self.direction), 1.0)
        } else {
            let (radiance, pdf) = environment.radiance_pdf(self.receiver.position, self.direction);
            let chosen = self.scene.lights.probability_of_environment(self.isa, &self.receiver);
            (radiance, power_heuristic(self.pdf, chosen * pdf))
        };
        self.add(self.throughput * radiance * weight, depth - 1);
        if !self.guided {
            self.sample.albedo = radiance.min(Vec3::ONE);
        }
    }

    /// Adds what the surface emits towards the path; returns it.
    #[inline(always)]
    fn emission(&mut self, hit: &Hit, surface: &Interaction, depth: u32) -> Vec3 {
        let materials = &self.scene.materials;
        let only_way = self.pdf == f32::INFINITY;
        if let Some(color) = materials.unlit_color(surface.material, &surface.surface) {
            // Shown, but lighting nothing: only where it is seen directly or through mirrors and glass.
            let shown = if only_way { color } else { Vec3::ZERO };
            self.add(self.throughput * shown, depth - 1);
            return shown;
        }
        if !materials.emits(surface.material) {
            return Vec3::ZERO;
        }
        let front = self.direction.dot(surface.geometric_normal) < 0.0;
        let radiance = materials.emission(surface.material, &surface.surface, front);
        if radiance != Vec3::ZERO {
            let weight = if only_way {
                1.0
            } else {
                let light_pdf = self.scene.light_pdf(self.isa, hit, surface, &self.receiver, self.direction);
                power_heuristic(self.pdf, light_pdf)
            };
            self.add(self.throughput * radiance * weight, depth - 1);
        }
        radiance
    }

    /// The shading frame.
    #[inline(always)]
    fn frame(&self, hit: &Hit, surface: &Interaction) -> Frame {
        let materials = &self.scene.materials;
        let frame = if materials.needs_tangent(surface.material) {
            let tangents = self.scene.tangent_frame(hit, surface.shading_normal, &self.ray());
            materials.shading_frame(surface.material, &surface.surface, &tangents)
        } else {
            Frame::from_normal(surface.shading_normal)
        };
        // A shading normal that shows the surface's other side would make it black at its silhouette.
        let toward = self.direction.dot(frame.normal) * self.direction.dot(surface.geometric_normal);
        if toward > 0.0 { frame } else { Frame::from_normal_tangent(surface.geometric_normal, frame.tangent) }
    }

    /// Records albedo and normal at the first surface that is not a perfect mirror or glass.
    #[inline(always)]
    fn guide(&mut self, emission: Vec3, frame: &Frame, bsdf: &Bsdf) {
        let emits = emission != Vec3::ZERO;
        if self.guided || (bsdf.is_delta() && !matches!(bsdf, Bsdf::Black | Bsdf::Subsurface(_)) && !emits) {
            return;
        }
        self.guided = true;
        self.sample.albedo = if emits { emission.min(Vec3::ONE) } else { bsdf.albedo() };
        self.sample.normal = frame.normal;
    }

    /// Records a medium that scatters the path before any surface does; it has no normal.
    fn guide_in_medium(&mut self, medium: &Medium) {
        if !self.guided {
            self.guided = true;
            self.sample.albedo = medium.albedo();
        }
    }

    /// Connects the surface to one light; returns whether a ray was traced.
    #[inline(always)]
    fn next_event(
        &mut self,
        hit: &Hit,
        surface: &Interaction,
        frame: &Frame,
        bsdf: &Bsdf,
        depth: u32,
    ) -> bool {
        let (u_light, u) = (self.sampler.next_1d(), self.sampler.next_2d());
        if bsdf.is_delta() {
            return false;
        }
        let toward = if self.direction.dot(frame.normal) > 0.0 { -frame.normal } else { frame.normal };
        self.receiver = Receiver::surface(surface.position, self.time, toward, !bsdf.reflects_only());
        let Some(light) = self.scene.sample_light(self.isa, &self.receiver, u_light, u) else { return false };
        let (wo, wi) = (frame.to_local(-self.direction), frame.to_local(light.direction));
        if !same_side(light.direction, surface.geometric_normal, wi.z) {
            return false;
        }
        let (value, bsdf_pdf) = bsdf.eval_pdf(wo, wi);
        let ray = segment_to(surface.leave(light.direction), &light, self.time);
        if self.scene.has_volumes {
            let inside = match bsdf {
                Bsdf::Subsurface(_) => self.beside(hit, surface, light.direction),
                _ => Some(self.scene.beyond(hit, surface, light.direction, self.inside)),
            };
            let Some(inside) = inside else { return false };
            let connection = Connection { light, carried: self.throughput * value, pdf: bsdf_pdf, inside };
            return self.connect(&ray, &connection, depth);
        }
        let weight = if light.delta { 1.0 } else { power_heuristic(light.pdf, bsdf_pdf) };
        let contribution = self.throughput * value * light.radiance * (weight / light.pdf);
        if contribution == Vec3::ZERO {
            return false;
        }
        let covers = |hit: &Hit| self.covers(hit, &ray, 2 * depth + 1);
        if !self.scene.accel.occluded(self.isa, &ray, covers) {
            self.add(contribution, depth);
        }
        true
    }

    /// Draws the next direction; returns whether the path goes on.
    #[inline(always)]
    fn scatter(&mut self, surface: &Interaction, frame: &Frame, bsdf: &Bsdf, depth: u32) -> bool {
        let (u_lobe, u) = (self.sampler.next_1d(), self.sampler.next_2d());
        let Some(scattered) = bsdf.sample(frame.to_local(-self.direction), u_lobe, u) else { return false };
        let direction = frame.to_world(scattered.wi).normalize();
        if !same_side(direction, surface.geometric_normal, scattered.wi.z) {
            return false;
        }
        self.throughput *= scattered.weight;
        self.eta2 *= scattered.eta * scattered.eta;
        self.pdf = if scattered.delta { f32::INFINITY } else { scattered.pdf };
        self.cone.spread = self.cone.spread.max(spread(self.pdf));
        self.origin = surface.leave(direction);
        self.direction = direction;
        self.survives(depth)
    }

    /// Russian roulette by what the path can still carry.
    #[inline(always)]
    fn survives(&mut self, depth: u32) -> bool {
        let mut carried = self.throughput.max_element() * self.eta2;
        if depth < ROULETTE_AFTER {
            self.at_first = carried.min(1.0);
            return carried > 0.0;
        }
        if self.scene.environment().is_some() {
            let [at_first, later] = TRUST_IN_ENVIRONMENTS;
            carried *= if depth == ROULETTE_AFTER { at_first } else { later } / self.at_first;
        }
        if carried >= 1.0 {
            return true;
        }
        let survives = self.sampler.next_1d() < carried;
        self.throughput /= carried;
        survives
    }
}

/// Where a segment to a light ends, its whole length being 1. Components of its direction are rounded by 2^-24, which from
/// far away moves its end through a light that lies near the origin: by up to 2^-22 over the cosine at the light, of
/// which the least that is taken care of is 1/16.
const BEFORE_LIGHT: f32 = 1.0 - 1.0 / (1 << 18) as f32;

/// The segment from a point that is on no surface to a light; its end is moved off the light's surface.
#[inline(always)]
fn segment_to(origin: Vec3, light: &LightSample, time: f32) -> Ray {
    match light.target {
        None => Ray::new(origin, light.direction, time),
        Some(Target { position, error, normal }) => {
            let end = offset_ray_origin(position, error, normal, -light.direction);
            Ray { t_max: BEFORE_LIGHT, ..Ray::new(origin, end - origin, time) }
        }
    }
}

/// Spread of the cone around a direction drawn with the density `pdf` per steradian: that of as many such directions
/// side by side as a pixel takes samples, taken for 64 (Suykens and Willems 2001, "Path Differentials and
/// Applications", section 3). 0 for a mirror, which is taken for flat: cones are rather too narrow than too wide, since
/// that costs noise alone.
#[inline(always)]
fn spread(pdf: f32) -> f32 {
    const SAMPLES: f32 = 64.0;
    (std::f32::consts::PI * SAMPLES * pdf).sqrt().recip().min(1.0)
}

/// Weight of a sample of density `own` where another strategy has the density `other` (Veach 1997, section 9.2.4,
/// exponent 2), in the form that neither overflows nor divides 0 by 0.
#[inline(always)]
pub(crate) fn power_heuristic(own: f32, other: f32) -> f32 {
    // A path that has come far through a thick medium may have a density that is too small for its format, and where the sky
    // is dark no other strategy looks.
    let ratio = other / own.max(f32::MIN_POSITIVE);
    1.0 / (1.0 + ratio * ratio)
}

#[cfg(test)]
mod tests;
