//! What lies between surfaces: media that absorb, scatter and emit, the same everywhere or varying in a box.
//!
//! A path knows the medium it is in; where it crosses a border, the side it leaves to decides what comes next (no
//! nesting, no priorities: as pbrt-v4 does). How far it flies is drawn per segment between two surfaces, all media
//! on the way at once, see [`Flight`].

mod field;
mod flight;
mod henyey_greenstein;
#[cfg(test)]
mod tests;

use glam::Vec3;

use crate::desc::{self, MediumId, MediumInterface};
pub(crate) use field::{Chance, Field, Way};
pub(crate) use flight::{Flight, Passage, Scattered};
pub use henyey_greenstein::HenyeyGreenstein;

/// A medium, ready to be asked. Coefficients are per metre.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Medium {
    /// Absorption and scattering together.
    extinction: Vec3,
    scattering: Vec3,
    /// Radiance emitted per metre.
    emission: Vec3,
    /// The same over the absorption.
    glow: Vec3,
    pub(crate) phase: HenyeyGreenstein,
    scatters: bool,
    emits: bool,
    /// Which of the fields says how it varies, or [`SAME`].
    field: u32,
}

/// Stands for "is the same everywhere" in [`Medium::field`].
const SAME: u32 = u32::MAX;

impl Medium {
    /// Compiles a medium whose numbers have been checked.
    pub(crate) fn new(medium: &desc::Medium) -> Self {
        let emission = medium.emission * medium.absorption;
        Self {
            extinction: medium.absorption + medium.scattering,
            scattering: medium.scattering,
            emission,
            phase: HenyeyGreenstein::new(medium.g),
            scatters: medium.scattering != Vec3::ZERO,
            emits: emission != Vec3::ZERO,
            glow: medium.emission,
            field: SAME,
        }
    }

    /// What lies below a surface that light wanders under: absorbs and scatters so much, the same everywhere.
    pub(crate) fn below([absorption, scattering]: [Vec3; 2], g: f32) -> Self {
        Self {
            extinction: absorption + scattering,
            scattering,
            emission: Vec3::ZERO,
            glow: Vec3::ZERO,
            phase: HenyeyGreenstein::new(g),
            scatters: scattering != Vec3::ZERO,
            emits: false,
            field: SAME,
        }
    }

    /// The same with mean free paths of `least` at least: what is finer than positions are known cannot be followed.
    pub(crate) fn no_finer_than(self, least: f32) -> Self {
        let factor = self.extinction.map(|s| if s * least > 1.0 { 1.0 / (s * least) } else { 1.0 });
        Self { extinction: self.extinction * factor, scattering: self.scattering * factor, ..self }
    }

    /// Compiles all media, and the fields of those that vary.
    pub(crate) fn all(media: &[desc::Medium]) -> (Vec<Self>, Vec<Field>) {
        let mut fields = Vec::new();
        let compiled = media.iter().map(|medium| {
            let field = Field::new(medium).map_or(SAME, |field| {
                fields.push(field);
                fields.len() as u32 - 1
            });
            Self { field, ..Self::new(medium) }
        });
        (compiled.collect(), fields)
    }

    /// How it varies, if it does.
    #[inline]
    pub(crate) fn field<'a>(&self, fields: &'a [Field]) -> Option<&'a Field> {
        fields.get(self.field as usize)
    }

    /// Share of light left after `distance`, which may be infinite.
    #[inline]
    fn transmittance(&self, distance: f32) -> Vec3 {
        // 0 times infinity is nothing that has been absorbed.
        (-self.extinction * distance.min(f32::MAX)).map(f32::exp)
    }

    /// Radiance emitted over `distance` towards its start: `j (1 - exp(-sigma d)) / sigma`.
    #[inline]
    pub(crate) fn emitted(&self, distance: f32) -> Vec3 {
        if !self.emits {
            return Vec3::ZERO;
        }
        let thickness = self.extinction * distance.min(f32::MAX);
        // Emission needs absorption, so there is extinction where there is emission.
        let mean = |t: f32| if t > 0.0 { -(-t).exp_m1() } else { 0.0 };
        let inverse = self.extinction.map(|s| if s > 0.0 { 1.0 / s } else { 0.0 });
        self.emission * thickness.map(mean) * inverse
    }

    /// Single-scattering albedo, a colour that stands for the medium.
    pub(crate) fn albedo(&self) -> Vec3 {
        let share = |s: f32, t: f32| if t > 0.0 { s / t } else { 0.0 };
        let (s, t) = (self.scattering, self.extinction);
        Vec3::new(share(s.x, t.x), share(s.y, t.y), share(s.z, t.z))
    }
}

/// Where light is: in a medium, or in vacuum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Inside(u32);

impl Inside {
    /// No medium.
    pub(crate) const VACUUM: Self = Self(u32::MAX);

    /// Below a surface that light wanders under: the path itself knows in what.
    pub(crate) const BELOW: Self = Self(u32::MAX - 1);

    /// In the medium of this number, or in vacuum.
    pub(crate) fn new(medium: Option<MediumId>) -> Self {
        medium.map_or(Self::VACUUM, |MediumId(id)| Self(id))
    }

    /// The medium, if there is one.
    #[inline]
    pub(crate) fn of(self, media: &[Medium]) -> Option<&Medium> {
        media.get(self.0 as usize)
    }
}

/// The media on both sides of a surface, if it is a border between two.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Border {
    inside: Inside,
    outside: Inside,
}

impl Border {
    /// None where both sides are the same: such a surface stands in a medium and borders on none, whatever it says.
    pub(crate) fn new(interface: Option<MediumInterface>) -> Option<Self> {
        let MediumInterface { inside, outside } = interface?;
        (inside != outside).then(|| Self { inside: Inside::new(inside), outside: Inside::new(outside) })
    }

    /// What lies in direction `w` from a surface with this geometric normal.
    #[inline]
    pub(crate) fn beyond(&self, w: Vec3, normal: Vec3) -> Inside {
        if w.dot(normal) > 0.0 { self.outside } else { self.inside }
    }
}
