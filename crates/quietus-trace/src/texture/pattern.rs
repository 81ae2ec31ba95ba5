//! Patterns that need no picture: noise, dots, corners, and which way a surface faces. After Pharr, Jakob, Humphreys
//! 2023, "Physically Based Rendering", 4th edition, chapter 10, as far as pbrt-v4 has them.

use glam::{Affine3A, Vec2, Vec3, Vec4};

use super::SurfacePoint;
use crate::desc::{Mapping, NoisePattern};
use crate::noise::{Octaves, noise};

/// Radius of a dot in its cell.
const DOT_RADIUS: f32 = 0.35;

/// The share of a plane that dots cover. Noise in the middle of a cell is the mean of eight products, each the sum of
/// two signs' halves: above 0 with the probability (1 - binom(16, 8) / 2^16) / 2.
pub(super) const SHARE_OF_DOTS: f32 =
    0.5 * (1.0 - 12870.0 / 65536.0) * std::f32::consts::PI * DOT_RADIUS * DOT_RADIUS;

/// Whether `point` lies in a dot. Two cells in five, by chance, have one, somewhere in them.
pub(super) fn is_in_dot(mapping: &Mapping, point: &SurfacePoint) -> bool {
    let place = mapping.coordinates(point);
    let cell = (place + 0.5).floor();
    let chance = |x: f32, y: f32| noise((cell + Vec2::new(x, y)).extend(0.5));
    if chance(0.5, 0.5) <= 0.0 {
        return false;
    }
    let center = cell + (0.5 - DOT_RADIUS) * Vec2::new(chance(1.5, 2.8), chance(4.5, 9.8));
    place.distance_squared(center) < DOT_RADIUS * DOT_RADIUS
}

/// Between four corners, at (0, 0), (1, 0), (0, 1) and (1, 1).
pub(super) fn between_corners([a, b, c, d]: [Vec3; 4], mapping: &Mapping, point: &SurfacePoint) -> Vec4 {
    let Vec2 { x, y } = mapping.coordinates(point);
    a.lerp(b, x).lerp(c.lerp(d, x), y).extend(1.0)
}

/// How much the surface faces `direction` or looks away from it: the cosine's magnitude. Half of it where the surface
/// around the point is not known.
pub(super) fn facing(direction: Vec3, point: &SurfacePoint) -> f32 {
    let [a, b] = point.footprint.axes.map(Vec3::normalize_or_zero);
    a.cross(b).try_normalize().map_or(0.5, |normal| normal.dot(direction).abs())
}

impl NoisePattern {
    /// Its value at `point`, looked at over its footprint unless that is left out.
    pub(super) fn at(&self, from_world: &Affine3A, point: &SurfacePoint, footprint: bool) -> Vec4 {
        let p = from_world.transform_point3(point.position);
        // A pixel is two half axes wide.
        let width = if footprint {
            let lengths = point.footprint.axes.map(|axis| from_world.transform_vector3(axis).length());
            2.0 * lengths[0].max(lengths[1])
        } else {
            0.0
        };
        self.of(p, width)
    }

    /// Its value at `p` in its own space, looked at over `width`.
    fn of(&self, p: Vec3, width: f32) -> Vec4 {
        let octaves = |count, roughness, scale: f32| Octaves { roughness, count, width: scale * width };
        let number = match *self {
            Self::Brownian { octaves: count, roughness } => octaves(count, roughness, 1.0).brownian(p),
            Self::Wrinkled { octaves: count, roughness } => octaves(count, roughness, 1.0).turbulence(p),
            Self::Windy => {
                let wind = octaves(3, 0.5, 0.1).brownian(0.1 * p);
                wind.abs() * octaves(6, 0.5, 1.0).brownian(p)
            }
            Self::Marble { octaves: count, roughness, scale, variation } => {
                let p = scale * p;
                let swirl = octaves(count, roughness, scale).brownian(p);
                return marble(0.5 + 0.5 * (p.y + variation * swirl).sin()).extend(1.0);
            }
        };
        Vec3::splat(number).extend(1.0)
    }

    /// About its mean over space.
    pub(super) fn mean(&self) -> Vec4 {
        /// Enough for two digits.
        const PLACES: u16 = 4096;
        // Multiples of irrational numbers (Roberts 2018's R3) fill 256 cells of noise a side evenly.
        let steps = 256.0 * Vec3::new(0.819_172_5, 0.671_043_6, 0.549_700_5);
        let sum: Vec4 =
            (0..PLACES).map(|i| self.of((f32::from(i) * steps).rem_euclid(Vec3::splat(256.0)), 0.0)).sum();
        sum / f32::from(PLACES)
    }
}

/// The colours of marble: Bezier curves between greys with a vein, for `t` in 0..1.
fn marble(t: f32) -> Vec3 {
    const STONE: Vec3 = Vec3::new(0.58, 0.58, 0.6);
    const COLORS: [Vec3; 9] = [
        STONE,
        STONE,
        STONE,
        Vec3::splat(0.5),
        Vec3::new(0.6, 0.59, 0.58),
        STONE,
        STONE,
        Vec3::new(0.2, 0.2, 0.33),
        STONE,
    ];
    /// Every four colours that follow each other make a piece.
    const PIECES: usize = COLORS.len() - 3;
    let place = t.clamp(0.0, 1.0) * PIECES as f32;
    let first = (place as usize).min(PIECES - 1);
    let t = place - first as f32;
    // De Casteljau's algorithm.
    let [a, b, c, d] = std::array::from_fn(|i| COLORS[first + i]);
    let (a, b, c) = (a.lerp(b, t), b.lerp(c, t), c.lerp(d, t));
    1.5 * a.lerp(b, t).lerp(b.lerp(c, t), t)
}
