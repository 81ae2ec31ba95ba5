//! Lights, and how next-event estimation finds them.
//!
//! All lights stand in one order: emissive triangles, whole spheres, other surfaces, surfaces that move, lights
//! without extent, the environment. A light is chosen by [`LightSelector`], then a direction to it. Densities are per steradian at the point that
//! asks; for a light that also has a surface (or surrounds the scene) the same density can be had for a direction
//! found otherwise, which multiple importance sampling needs.

mod bounds;
mod build;
mod distribution;
mod environment;
mod layout;
mod map;
mod picture;
mod portal;
mod punctual;
mod select;
mod shared_exponent;
mod sphere;
mod surface;
#[cfg(test)]
mod tests;
mod tree;
mod triangle;

use glam::{Vec2, Vec3};

use crate::bvh::Hit;
use crate::desc;
use crate::isa::Isa;
pub(crate) use bounds::{LightBounds, Receiver};
pub(crate) use environment::Environment;
pub(crate) use layout::{equal_area_direction, fold_square};
pub(crate) use punctual::PunctualLight;
use select::LightSelector;
pub(crate) use sphere::SphereLight;
pub(crate) use surface::{PatchLight, QuadricLight, SurfaceLight};
pub(crate) use triangle::TriangleLight;

/// Of linear Rec.709.
const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

/// Luminance of linear Rec.709.
#[inline]
pub(crate) fn luminance(color: Vec3) -> f32 {
    color.dot(LUMINANCE)
}

/// A place a shadow ray runs to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Target {
    pub(crate) position: Vec3,
    /// Bound on how far the position may be off, per axis.
    pub(crate) error: Vec3,
    /// Normal of the light's surface; 0 where it has none.
    pub(crate) normal: Vec3,
}

/// A direction to a light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightSample {
    /// Towards the light, of unit length.
    pub(crate) direction: Vec3,
    /// Where the light is; none for infinitely far.
    pub(crate) target: Option<Target>,
    /// Radiance that arrives unless something is in between; for a delta light the irradiance on a surface that
    /// faces it.
    pub(crate) radiance: Vec3,
    /// Density per steradian of this direction, or the probability of a delta light.
    pub(crate) pdf: f32,
    /// Whether no other strategy can find this light.
    pub(crate) delta: bool,
}

impl LightSample {
    #[inline]
    fn from_infinity(direction: Vec3, radiance: Vec3, pdf: f32) -> Self {
        Self { direction, target: None, radiance, pdf, delta: false }
    }
}

/// A point on an emissive surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AreaSample {
    pub(crate) target: Target,
    /// From the point that asks to the surface, of unit length.
    pub(crate) direction: Vec3,
    /// Density per steradian of `direction`.
    pub(crate) pdf: f32,
    /// Whether the front of the surface is seen.
    pub(crate) front: bool,
}

/// An emissive surface, and where in the scene it stands.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Emitter<G> {
    pub(crate) geometry: G,
    pub(crate) instance: u32,
    pub(crate) shape: u32,
    pub(crate) primitive: u32,
    /// Radiance averaged over the surface; exact where nothing is textured.
    pub(crate) radiance: Vec3,
    /// Whether radiance or coverage differ from place to place.
    pub(crate) varies: bool,
    pub(crate) two_sided: bool,
    /// Whether nothing but light sampling finds it.
    pub(crate) unseen: bool,
}

/// An emissive surface of any kind.
#[derive(Clone, Copy, Debug)]
pub(crate) enum AreaLight {
    Triangle(TriangleLight),
    Sphere(SphereLight),
    Surface(SurfaceLight),
}

impl AreaLight {
    /// Where `emitter`, which has this geometry, shines to.
    pub(crate) fn bounds<G>(&self, emitter: &Emitter<G>) -> LightBounds {
        match self {
            Self::Triangle(triangle) => triangle.bounds(emitter),
            Self::Sphere(sphere) => sphere.bounds(emitter),
            Self::Surface(surface) => surface.bounds(emitter),
        }
    }

    /// Some point of it for every `u`, and what [`Hit`] calls u and v.
    pub(crate) fn point(&self, u: Vec2) -> (Vec3, Vec2) {
        match self {
            Self::Triangle(triangle) => triangle.point(u),
            Self::Sphere(sphere) => (sphere.point(u), Vec2::ZERO),
            Self::Surface(surface) => (surface.point(u), u),
        }
    }

    /// A point seen from `from`, and what [`Hit`] calls u and v.
    pub(crate) fn sample(&self, from: Vec3, u: Vec2) -> Option<(AreaSample, Vec2)> {
        match self {
            Self::Triangle(triangle) => triangle.sample(from, u),
            Self::Sphere(sphere) => Some((sphere.sample(from, u)?, Vec2::ZERO)),
            Self::Surface(surface) => Some((surface.sample(from, u)?, u)),
        }
    }

    /// Density per steradian with which [`Self::sample`] chooses the point at `distance` along `direction`, where
    /// the surface has this normal and, if it is a patch, these parameters.
    pub(crate) fn pdf(
        &self,
        from: Vec3,
        (direction, distance): (Vec3, f32),
        (normal, at): (Vec3, Vec2),
    ) -> f32 {
        match self {
            Self::Triangle(triangle) => triangle.pdf(direction, distance),
            Self::Sphere(sphere) => sphere.pdf(from, direction),
            Self::Surface(surface) => surface.pdf(direction, distance, normal, at),
        }
    }
}

impl<G> Emitter<G> {
    /// The same with another geometry.
    pub(crate) fn with<H>(&self, geometry: H) -> Emitter<H> {
        let Self { instance, shape, primitive, radiance, varies, two_sided, unseen, .. } = *self;
        Emitter { geometry, instance, shape, primitive, radiance, varies, two_sided, unseen }
    }

    fn power(&self, area: f32) -> f32 {
        let sides = if self.two_sided { 2.0 } else { 1.0 };
        std::f32::consts::PI * area * sides * luminance(self.radiance)
    }
}

/// What [`Lights::sample`] found.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Found {
    /// All there is to know.
    Light(LightSample),
    /// A point on a surface whose emission or coverage varies: `radiance` is not yet known.
    Varying(LightSample, Hit),
    /// Light number `.0` among those that move, with the probability of its choice.
    Moving(u32, f32),
}

/// The emissive surfaces of a scene; what is found on one of them is asked for by its number among its kind.
#[derive(Debug, Default)]
pub(crate) struct Emitters {
    pub(crate) triangles: Vec<Emitter<TriangleLight>>,
    pub(crate) spheres: Vec<Emitter<SphereLight>>,
    pub(crate) surfaces: Vec<Emitter<SurfaceLight>>,
    /// What moves, with bounds of its way; its geometry is for the scene to say.
    pub(crate) moving: Vec<Emitter<LightBounds>>,
}

/// All lights of a scene.
#[derive(Debug, Default)]
pub(crate) struct Lights {
    triangles: Vec<Emitter<TriangleLight>>,
    spheres: Vec<Emitter<SphereLight>>,
    surfaces: Vec<Emitter<SurfaceLight>>,
    moving: Vec<Emitter<LightBounds>>,
    punctual: Vec<PunctualLight>,
    environment: Option<Environment>,
    selector: LightSelector,
}

impl Lights {
    /// Collects the lights of a scene.
    pub(crate) fn new(
        Emitters { triangles, spheres, surfaces, moving }: Emitters,
        lights: &[desc::Light],
        environment: Option<&desc::Environment>,
    ) -> Self {
        let mut punctual: Vec<_> = lights.iter().map(PunctualLight::new).collect();
        punctual.sort_by_key(PunctualLight::is_infinite);
        let near = punctual.iter().take_while(|light| !light.is_infinite()).count();
        let environment = environment.map(Environment::new);
        let mut local: Vec<LightBounds> = triangles.iter().map(|t| t.geometry.bounds(t)).collect();
        local.extend(spheres.iter().map(|s| s.geometry.bounds(s)));
        local.extend(surfaces.iter().map(|s| s.geometry.bounds(s)));
        local.extend(moving.iter().map(|m| m.geometry));
        local.extend(punctual[..near].iter().map(PunctualLight::bounds));
        let mut infinite: Vec<f32> = punctual[near..].iter().map(PunctualLight::power).collect();
        infinite.extend(environment.iter().map(Environment::mean_irradiance));
        let selector = LightSelector::new(&local, &infinite);
        Self { triangles, spheres, surfaces, moving, punctual, environment, selector }
    }

    /// The environment, if there is one.
    pub(crate) fn environment(&self) -> Option<&Environment> {
        self.environment.as_ref()
    }

    /// Chooses a light and a direction to it; none where the light cannot be seen by the receiver or shows its dark
    /// side. The density contains the choice of the light.
    #[inline(always)]
    pub(crate) fn sample<I: Isa>(&self, isa: I, receiver: &Receiver, u_light: f32, u: Vec2) -> Option<Found> {
        let (light, probability) = self.selector.sample(isa, receiver, u_light)?;
        let (index, from) = (light as usize, receiver.position);
        if let Some(emitter) = self.triangles.get(index) {
            let (area, barycentric) = emitter.geometry.sample(from, u)?;
            return emitter.found(&area, probability, from, barycentric);
        }
        let index = index - self.triangles.len();
        if let Some(emitter) = self.spheres.get(index) {
            return emitter.found(&emitter.geometry.sample(from, u)?, probability, from, Vec2::ZERO);
        }
        let index = index - self.spheres.len();
        if let Some(emitter) = self.surfaces.get(index) {
            // Where it is a patch, the random numbers are its parameters.
            return emitter.found(&emitter.geometry.sample(from, u)?, probability, from, u);
        }
        let index = index - self.surfaces.len();
        if index < self.moving.len() {
            return Some(Found::Moving(index as u32, probability));
        }
        let index = index - self.moving.len();
        let sample = match self.punctual.get(index) {
            Some(light) => light.sample(from),
            None => self.environment.as_ref()?.sample(from, u),
        };
        sample.map(|sample| Found::Light(LightSample { pdf: sample.pdf * probability, ..sample }))
    }

    /// Density with which [`Self::sample`] chooses the point at `distance` along `direction` on triangle light
    /// number `index`.
    #[inline(always)]
    pub(crate) fn pdf_of_triangle<I: Isa>(
        &self,
        isa: I,
        index: u32,
        receiver: &Receiver,
        direction: Vec3,
        distance: f32,
    ) -> f32 {
        let probability = self.selector.probability(isa, receiver, index);
        probability * self.triangles[index as usize].geometry.pdf(direction, distance)
    }

    /// Density with which [`Self::sample`] chooses `direction`, which hits sphere light number `index`.
    #[inline(always)]
    pub(crate) fn pdf_of_sphere<I: Isa>(
        &self,
        isa: I,
        index: u32,
        receiver: &Receiver,
        direction: Vec3,
    ) -> f32 {
        let light = self.triangles.len() as u32 + index;
        let probability = self.selector.probability(isa, receiver, light);
        probability * self.spheres[index as usize].geometry.pdf(receiver.position, direction)
    }

    /// Density with which [`Self::sample`] chooses, on light number `index` among other surfaces, the point at
    /// `distance` along `direction`, with this normal and, on a patch, these parameters.
    #[inline]
    pub(crate) fn pdf_of_surface<I: Isa>(
        &self,
        isa: I,
        index: u32,
        receiver: &Receiver,
        (direction, distance): (Vec3, f32),
        (normal, at): (Vec3, Vec2),
    ) -> f32 {
        let light = self.triangles.len() + self.spheres.len() + index as usize;
        let probability = self.selector.probability(isa, receiver, light as u32);
        probability * self.surfaces[index as usize].geometry.pdf(direction, distance, normal, at)
    }

    /// Light number `index` among those that move.
    pub(crate) fn moving(&self, index: u32) -> &Emitter<LightBounds> {
        &self.moving[index as usize]
    }

    /// The probability with which [`Self::sample`] chooses light number `index` among those that move.
    pub(crate) fn probability_of_moving<I: Isa>(&self, isa: I, index: u32, receiver: &Receiver) -> f32 {
        let light = self.triangles.len() + self.spheres.len() + self.surfaces.len() + index as usize;
        self.selector.probability(isa, receiver, light as u32)
    }

    /// The probability with which [`Self::sample`] chooses the environment, if there is one.
    #[inline(always)]
    pub(crate) fn probability_of_environment<I: Isa>(&self, isa: I, receiver: &Receiver) -> f32 {
        let surfaces = self.triangles.len() + self.spheres.len() + self.surfaces.len() + self.moving.len();
        let light = surfaces + self.punctual.len();
        self.selector.probability(isa, receiver, light as u32)
    }
}

impl<G> Emitter<G> {
    /// Completes a point on the surface; none where its side is dark. `at` is what [`Hit`] calls u and v.
    #[inline]
    pub(crate) fn found(&self, area: &AreaSample, probability: f32, from: Vec3, at: Vec2) -> Option<Found> {
        if !(area.front || self.two_sided) {
            return None;
        }
        let sample = LightSample {
            direction: area.direction,
            target: Some(area.target),
            radiance: self.radiance,
            pdf: area.pdf * probability,
            delta: self.unseen,
        };
        if !self.varies {
            return Some(Found::Light(sample));
        }
        let Self { instance, shape, primitive, .. } = *self;
        let t = area.target.position.distance(from);
        Some(Found::Varying(sample, Hit { t, u: at.x, v: at.y, instance, shape, primitive }))
    }
}
