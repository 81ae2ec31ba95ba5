//! How surfaces scatter light, in the local frame whose z axis is the shading normal.
//!
//! Conventions: `wo` points to where the path comes from (the camera), `wi` to where it goes (the light); both
//! are unit vectors that point away from the surface. Densities are per steradian. Every `eval` returns the BSDF
//! **times `|cos wi|`**, for transport of radiance: where light passes into a medium with relative index `eta`
//! (the index on `wi`'s side over the one on `wo`'s side), radiance is divided by `eta^2`.
//!
//! Perfectly smooth parts are `delta` distributions: `eval` and `pdf` are 0 for them, only `sample` finds them,
//! and its `pdf` is then the probability of the choice.
//!
//! Shading normals: `wo` and `wi` are sorted into reflection and transmission by the *shading* normal. A caller
//! with another geometric normal has to drop pairs for which [`same_side`] is false, or light leaks.

pub mod fresnel;
pub mod ggx;

mod albedo_table;
mod conductor;
mod dielectric;
mod film;
mod frosted;
pub mod hair;
pub mod layered;
pub mod measured;
mod metal_rough;
mod sheen;
pub mod subsurface;
mod thin;

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

pub use conductor::Conductor;
pub use dielectric::Dielectric;
pub use film::{Film, FilmParams};
pub use frosted::{FrostedGlass, FrostedTable};
pub use hair::{Hair, HairParams};
pub use layered::{CoatedDiffuse, Layered};
pub use measured::Measured;
pub use metal_rough::{MetalRough, MetalRoughParams};
pub use subsurface::Subsurface;
pub use thin::{DiffuseTransmission, ThinDielectric};

use crate::warp;

/// The scattering of one surface point: plain data, built anew at each hit.
// A box would be allocated at each hit.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug)]
pub enum Bsdf<'a> {
    /// Scatters nothing.
    Black,
    /// Lambert, on both sides.
    Diffuse(Diffuse),
    /// GGX metal, on both sides.
    Conductor(Conductor),
    /// GGX glass; +z points out of the medium.
    Dielectric(Dielectric),
    /// GGX glass that keeps what facets throw at each other; +z points out of the medium.
    FrostedGlass(FrostedGlass<'a>),
    /// A pane of glass.
    ThinDielectric(ThinDielectric),
    /// Lambert on both sides, and through.
    DiffuseTransmission(DiffuseTransmission),
    /// A diffuse base under a coat, on both sides.
    CoatedDiffuse(CoatedDiffuse<'a>),
    /// Any base under a coat, on both sides.
    Layered(Layered),
    /// A fibre; +x runs along it.
    Hair(Hair),
    /// The metallic-roughness model of glTF 2.0, on both sides.
    MetalRough(MetalRough),
    /// What a device has measured, on both sides.
    Measured(Measured<'a>),
    /// What light wanders under, seen from the side that it was told of.
    Subsurface(Subsurface),
}

/// A direction drawn from a BSDF.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// The direction, of unit length.
    pub wi: Vec3,
    /// BSDF times `|cos wi|` over `pdf`.
    pub weight: Vec3,
    /// Density per steradian of all lobes together; where `delta`, the probability of the choice.
    pub pdf: f32,
    /// Whether `wi` comes from a perfectly smooth part, which no other strategy can find.
    pub delta: bool,
    /// Whether `wi` lies on the other side than `wo`.
    pub transmission: bool,
    /// Index of refraction on `wi`'s side over the one on `wo`'s side; 1 for reflection and thin walls. Russian
    /// roulette wants the throughput times the product of `eta^2`, which undoes the compression of radiance.
    pub eta: f32,
}

/// Lambert's BRDF, on both sides.
#[derive(Clone, Copy, Debug)]
pub struct Diffuse {
    /// Albedo.
    pub reflectance: Vec3,
}

impl Bsdf<'_> {
    /// BSDF times `|cos wi|`.
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        self.eval_pdf(wo, wi).0
    }

    /// Density with which [`sample`](Self::sample) draws `wi`, over the unit sphere; delta parts count as 0.
    #[inline]
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.eval_pdf(wo, wi).1
    }

    /// [`eval`](Self::eval) and [`pdf`](Self::pdf) at once. The value of [`Layered`] is a random estimate, unbiased over
    /// the keys of paths; its density is exact.
    #[inline]
    pub fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        match self {
            Self::Black | Self::ThinDielectric(_) => (Vec3::ZERO, 0.0),
            Self::Diffuse(b) => b.eval_pdf(wo, wi),
            Self::DiffuseTransmission(b) => b.eval_pdf(wo, wi),
            Self::Conductor(b) => b.eval_pdf(wo, wi),
            Self::Dielectric(b) => b.eval_pdf(wo, wi),
            Self::FrostedGlass(b) => b.eval_pdf(wo, wi),
            Self::CoatedDiffuse(b) => b.eval_pdf(wo, wi),
            Self::Layered(b) => b.eval_pdf(wo, wi),
            Self::Hair(b) => b.eval_pdf(wo, wi),
            Self::MetalRough(b) => b.eval_pdf(wo, wi),
            Self::Subsurface(b) => b.eval_pdf(wo, wi),
            Self::Measured(b) => b.eval_pdf(wo, wi),
        }
    }

    /// A direction with density [`pdf`](Self::pdf), from random numbers in `[0, 1)`; `None` where the draw is
    /// lost (absorbed, or masked by the microsurface).
    #[inline]
    pub fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        match self {
            Self::Black => None,
            Self::Diffuse(b) => b.sample(wo, u),
            Self::Conductor(b) => b.sample(wo, u),
            Self::Dielectric(b) => b.sample(wo, u_lobe, u),
            Self::FrostedGlass(b) => b.sample(wo, u_lobe, u),
            Self::ThinDielectric(b) => b.sample(wo, u_lobe),
            Self::DiffuseTransmission(b) => b.sample(wo, u_lobe, u),
            Self::CoatedDiffuse(b) => b.sample(wo, u_lobe, u),
            Self::Layered(b) => b.sample(wo, u_lobe, u),
            Self::Hair(b) => b.sample(wo, u_lobe, u),
            Self::MetalRough(b) => b.sample(wo, u_lobe, u),
            Self::Subsurface(b) => b.sample(wo, u_lobe, u),
            Self::Measured(b) => b.sample(wo, u),
        }
    }

    /// Whether all of it is delta, so that light sampling cannot help.
    #[inline]
    pub fn is_delta(&self) -> bool {
        match self {
            Self::Black | Self::ThinDielectric(_) => true,
            Self::Diffuse(_)
            | Self::DiffuseTransmission(_)
            | Self::CoatedDiffuse(_)
            | Self::FrostedGlass(_)
            | Self::Hair(_)
            | Self::Measured(_) => false,
            Self::Conductor(b) => b.is_delta(),
            Self::Dielectric(b) => b.is_delta(),
            Self::Layered(b) => b.is_delta(),
            Self::MetalRough(b) => b.is_delta(),
            Self::Subsurface(b) => b.is_delta(),
        }
    }

    /// Whether light from behind the surface is surely lost.
    #[inline]
    pub(crate) fn reflects_only(&self) -> bool {
        match self {
            Self::Diffuse(_) | Self::Conductor(_) | Self::Measured(_) => true,
            Self::MetalRough(b) => b.reflects_only(),
            _ => false,
        }
    }

    /// A colour that stands for the surface in the albedo AOV; near its reflectance under white light from all
    /// sides.
    pub fn albedo(&self) -> Vec3 {
        match self {
            Self::Black => Vec3::ZERO,
            Self::Diffuse(b) => b.reflectance,
            Self::Conductor(b) => b.albedo(),
            Self::Dielectric(b) => b.albedo(),
            Self::FrostedGlass(b) => b.albedo(),
            Self::ThinDielectric(_) => Vec3::ONE,
            Self::DiffuseTransmission(b) => b.reflectance + b.transmittance,
            Self::CoatedDiffuse(b) => b.albedo(),
            Self::Layered(b) => b.albedo(),
            Self::Hair(b) => b.albedo(),
            Self::MetalRough(b) => b.albedo(),
            Self::Subsurface(b) => b.albedo(),
            Self::Measured(b) => b.albedo(),
        }
    }
}

impl Diffuse {
    #[inline]
    fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        if wo.z * wi.z <= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let pdf = wi.z.abs() * FRAC_1_PI;
        (self.reflectance * pdf, pdf)
    }

    #[inline]
    fn sample(&self, wo: Vec3, u: Vec2) -> Option<BsdfSample> {
        let mut wi = warp::cosine_hemisphere(u);
        if wo.z == 0.0 || wi.z == 0.0 {
            return None;
        }
        wi.z = wi.z.copysign(wo.z);
        Some(BsdfSample::reflection(wi, self.reflectance, wi.z.abs() * FRAC_1_PI))
    }
}

impl BsdfSample {
    /// A sample of a lobe that reflects and is not delta.
    #[inline]
    fn reflection(wi: Vec3, weight: Vec3, pdf: f32) -> Self {
        Self { wi, weight, pdf, delta: false, transmission: false, eta: 1.0 }
    }
}

/// Whether `wi` lies on the same side of the surface by the geometric normal as it does by the shading normal,
/// given `wi` in the world and as local `z` in the shading frame. Light that fails this would reflect through the
/// surface or transmit without crossing it; dropping it costs a little energy where the normals differ much.
#[inline]
pub fn same_side(wi_world: Vec3, geometric_normal: Vec3, wi_local_z: f32) -> bool {
    wi_world.dot(geometric_normal) * wi_local_z > 0.0
}

#[cfg(test)]
mod tests;
