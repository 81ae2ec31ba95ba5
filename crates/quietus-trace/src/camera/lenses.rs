//! Lenses before a film: rays are bent at each of their surfaces (Kolb, Mitchell and Hanrahan 1995, "A Realistic Camera
//! Model for Computer Graphics", section 3). Only where a point of the film sees light at all does it look: ellipses
//! around what it sees of the opening, its exit pupil, are found beforehand.
//!
//! Here the film lies at z = 0 and what is seen at larger z, so that rays go along +z from the film.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::desc::{Aperture, Lenses};

/// Distances from the axis for which exit pupils are found.
const PUPILS: usize = 64;
/// Places along each side of the square in which pupils are looked for: first these, then those for small openings.
const COARSE: [u32; 2] = [64, 256];
/// The same for the square around what was found.
const FINE: u32 = 64;
/// Pupils are looked for as far as this many radii of the last surface from the axis: rays to its rim may come from there.
const REACH: f32 = 1.5;

/// Lenses, ready for a film of pixels.
#[derive(Clone, Debug)]
pub(super) struct LensSystem {
    /// From the film to the front.
    surfaces: Vec<Surface>,
    aperture: Option<Aperture>,
    /// Of each ring of the film, from the middle outwards, for points on the +x axis.
    pupils: Vec<Pupil>,
    /// Width of a ring.
    ring: f32,
    /// Size of a pixel.
    pixel: f32,
}

#[derive(Clone, Copy, Debug)]
struct Surface {
    place: f32,
    /// As in [`crate::desc::LensSurface`].
    curvature: f32,
    rim: f32,
    /// Index on the film's side over that on the other.
    ratio: f32,
}

/// An ellipse along the axes, in the plane of the last surface, that holds all through which light comes.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Pupil {
    center: Vec2,
    half: Vec2,
}

impl LensSystem {
    /// For a film of `rows` rows of square pixels; none where the lenses make no sense or no light comes through.
    pub(super) fn new(lenses: &Lenses, rows: f32) -> Option<Self> {
        let mut ahead = 1.0;
        let ratio = |index: f32| index / std::mem::replace(&mut ahead, index);
        let ratios: Vec<f32> = lenses.surfaces.iter().map(|surface| surface.index).map(ratio).collect();
        let surfaces: Vec<Surface> = lenses
            .surfaces
            .iter()
            .zip(ratios)
            .map(|(s, ratio)| Surface { place: s.place, curvature: s.curvature, rim: s.rim, ratio })
            .rev()
            .collect();
        let mut before = 0.0;
        let sound = surfaces.iter().all(|surface| {
            let grows = surface.place >= before && surface.place > 0.0;
            before = surface.place;
            grows && surface.rim > 0.0 && surface.ratio > 0.0 && surface.curvature.is_finite()
        });
        let finite = before.is_finite() && lenses.film_height > 0.0 && lenses.film_radius > 0.0;
        let masked = lenses.aperture.as_ref().is_none_or(|mask| {
            mask.size.iter().all(|side| *side > 0)
                && mask.weights.len() as u64 == u64::from(mask.size[0]) * u64::from(mask.size[1])
        });
        if surfaces.is_empty() || !sound || !finite || !masked {
            return None;
        }
        let mut system = Self {
            surfaces,
            aperture: lenses.aperture.clone(),
            pupils: Vec::new(),
            ring: lenses.film_radius / PUPILS as f32,
            pixel: lenses.film_height / rows,
        };
        let pupil = |i: usize| system.pupil(system.ring * i as f32, system.ring * (i + 1) as f32);
        let found: Vec<Option<Pupil>> = (0..PUPILS).into_par_iter().map(pupil).collect();
        found.iter().any(Option::is_some).then_some(())?;
        // Nothing is seen where nothing was found: an ellipse without an extent gives rays no weight.
        let none = Pupil { center: Vec2::ZERO, half: Vec2::ZERO };
        system.pupils = found.into_iter().map(|pupil| pupil.unwrap_or(none)).collect();
        Some(system)
    }

    /// Origin, direction and weight of the ray that shows what lies `offset` pixels right of and above the axis, through
    /// the point of the exit pupil that `lens`, in the unit disk, stands for; in the camera's space, which looks along
    /// -z. None where it does not come through.
    pub(super) fn ray(&self, offset: Vec2, lens: Vec2) -> Option<(Vec3, Vec3, f32)> {
        // Pictures on films stand on their heads.
        let film = -offset * self.pixel;
        let radius = film.length();
        let pupil = self.pupils[((radius / self.ring) as usize).min(PUPILS - 1)];
        // From the axis along which pupils were found to the one on which the point lies.
        let axis = if radius > 0.0 { film / radius } else { Vec2::X };
        let target = axis.rotate(pupil.center + lens * pupil.half);
        let distance = self.surfaces[0].place;
        let direction = (target - film).extend(distance).normalize();
        let (origin, out, passed) = self.trace(film.extend(0.0), direction)?;
        let weight = direction.z.powi(4) * PI * pupil.half.x * pupil.half.y / (distance * distance);
        let flip = Vec3::new(1.0, 1.0, -1.0);
        Some((origin * flip, out * flip, weight * passed)).filter(|(.., weight)| *weight > 0.0)
    }

    /// Follows a ray from the film to where it leaves the foremost surface, with the share of light that the stop lets
    /// through.
    fn trace(&self, mut origin: Vec3, mut direction: Vec3) -> Option<(Vec3, Vec3, f32)> {
        let mut passed = 1.0;
        for surface in &self.surfaces {
            if surface.curvature == 0.0 {
                origin += direction * ((surface.place - origin.z) / direction.z);
                let place = origin.truncate();
                match &self.aperture {
                    Some(mask) => passed *= look_up(mask, place / surface.rim),
                    None if place.length_squared() > surface.rim * surface.rim => return None,
                    None => {}
                }
                if passed == 0.0 {
                    return None;
                }
                continue;
            }
            origin = surface.hit(origin, direction)?;
            if origin.truncate().length_squared() > surface.rim * surface.rim {
                return None;
            }
            direction = surface.bend(origin, direction)?;
        }
        Some((origin, direction, passed))
    }

    /// What points of the film between two distances from the axis see of the opening.
    fn pupil(&self, inner: f32, outer: f32) -> Option<Pupil> {
        let reach = REACH * self.surfaces[0].rim;
        let whole = Pupil { center: Vec2::ZERO, half: Vec2::splat(reach) };
        let coarse = COARSE.into_iter().find_map(|grid| self.around(whole, grid, inner, outer))?;
        self.around(coarse, FINE, inner, outer)
    }

    /// The ellipse around what of `square` is seen, a step of the grid wider.
    fn around(&self, square: Pupil, grid: u32, inner: f32, outer: f32) -> Option<Pupil> {
        let step = 2.0 / grid as f32;
        let film = [inner, 0.5 * (inner + outer), outer].map(|x| Vec3::new(x, 0.0, 0.0));
        let seen = |place: Vec2| {
            film.iter().any(|film| {
                let direction = (place.extend(self.surfaces[0].place) - *film).normalize();
                self.trace(*film, direction).is_some()
            })
        };
        let place = |x: u32, y: u32| Vec2::new(x as f32 + 0.5, y as f32 + 0.5) * step - 1.0;
        let places: Vec<Vec2> = (0..grid * grid)
            .map(|i| square.center + place(i % grid, i / grid) * square.half)
            .filter(|place| seen(*place))
            .collect();
        let low = places.iter().copied().reduce(Vec2::min)?;
        let high = places.iter().copied().reduce(Vec2::max)?;
        let step = step * square.half;
        let mut pupil = Pupil { center: 0.5 * (low + high), half: 0.5 * (high - low) + step };
        // What lies towards the corners of the rectangle is to be within, too.
        let off = |place: &Vec2| (((*place - pupil.center).abs() + 0.5 * step) / pupil.half).length();
        let furthest = places.iter().map(off).fold(1.0, f32::max);
        pupil.half *= furthest;
        Some(pupil)
    }
}

impl Surface {
    /// Where a ray meets the sphere, on the side that is the surface.
    fn hit(&self, origin: Vec3, direction: Vec3) -> Option<Vec3> {
        let center = Vec3::new(0.0, 0.0, self.place - self.curvature);
        let from = origin - center;
        let along = from.dot(direction);
        // Not the difference of two large squares.
        let closest = from - along * direction;
        let square = self.curvature * self.curvature - closest.length_squared();
        if square < 0.0 {
            return None;
        }
        let root = square.sqrt().copysign(self.curvature);
        Some(origin + direction * (root - along))
    }

    /// The direction behind the surface, by Snell's law.
    fn bend(&self, place: Vec3, direction: Vec3) -> Option<Vec3> {
        if self.ratio == 1.0 {
            return Some(direction);
        }
        // Towards what is seen.
        let normal = (place - Vec3::new(0.0, 0.0, self.place - self.curvature)) / self.curvature;
        let cosine = normal.dot(direction);
        let square = 1.0 - self.ratio * self.ratio * (1.0 - cosine * cosine);
        if square < 0.0 || cosine <= 0.0 {
            return None;
        }
        Some((self.ratio * (direction - cosine * normal) + square.sqrt() * normal).normalize())
    }
}

/// Between the texels of a mask, at a place in -1..1 of both axes; black outside.
fn look_up(mask: &Aperture, place: Vec2) -> f32 {
    if place.abs().max_element() > 1.0 {
        return 0.0;
    }
    let [width, height] = mask.size;
    let uv = Vec2::new(0.5 * (place.x + 1.0), 0.5 * (1.0 - place.y));
    let at = uv * Vec2::new(width as f32, height as f32) - 0.5;
    let corner = at.floor();
    let between = at - corner;
    let texel = |x: i32, y: i32| {
        let inside = x >= 0 && y >= 0 && x < width as i32 && y < height as i32;
        if inside { mask.weights[y as usize * width as usize + x as usize] } else { 0.0 }
    };
    let (x, y) = (corner.x as i32, corner.y as i32);
    let row = |y: i32| texel(x, y) + (texel(x + 1, y) - texel(x, y)) * between.x;
    row(y) + (row(y + 1) - row(y)) * between.y
}

#[cfg(test)]
mod tests;
