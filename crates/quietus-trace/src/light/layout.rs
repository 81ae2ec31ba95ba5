//! Where directions lie on maps of all directions: latitude and longitude, and the equal-area octahedron.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3};

use crate::desc::EnvironmentLayout;

impl EnvironmentLayout {
    /// Place in the unit square of a direction (of unit length, in the map's space).
    #[inline]
    pub(super) fn place(self, direction: Vec3) -> Vec2 {
        match self {
            Self::LatLong => lat_long_place(direction),
            Self::EqualArea => equal_area_place(direction),
        }
    }

    /// Direction in the map's space of a place on it, and the solid angle there per area of the unit square.
    #[inline]
    pub(super) fn direction(self, place: Vec2) -> (Vec3, f32) {
        match self {
            Self::LatLong => {
                let (direction, sine) = lat_long_direction(place);
                (direction, TAU * PI * sine)
            }
            Self::EqualArea => (equal_area_direction(place), 2.0 * TAU),
        }
    }

    /// Solid angle per area of the unit square at a direction in the map's space.
    #[inline]
    pub(super) fn stretch(self, direction: Vec3) -> f32 {
        match self {
            Self::LatLong => TAU * PI * direction.x.hypot(direction.z),
            Self::EqualArea => 2.0 * TAU,
        }
    }

    /// The texel that stands for column `x` and row `y` of a map, which may lie beyond its border by one: there the map
    /// goes on with what is next to it on the sphere.
    #[inline]
    pub(crate) fn wrap(self, [x, y]: [i32; 2], [width, height]: [i32; 2]) -> [i32; 2] {
        match self {
            // Columns wrap around, rows end at the poles.
            Self::LatLong => [x.rem_euclid(width), y.clamp(0, height - 1)],
            // Every edge is folded onto itself around its middle.
            Self::EqualArea => {
                let (x, y) =
                    if x < 0 || x >= width { (x.clamp(0, width - 1), height - 1 - y) } else { (x, y) };
                if y < 0 || y >= height { [width - 1 - x, y.clamp(0, height - 1)] } else { [x, y] }
            }
        }
    }
}

/// Place on the map of a direction in its space: row 0 is +y, the middle column -z, columns run towards +x.
#[inline]
fn lat_long_place(direction: Vec3) -> Vec2 {
    // atan2 keeps its digits near the poles, where the arc cosine loses them.
    let polar = direction.x.hypot(direction.z).atan2(direction.y);
    let azimuth = direction.x.atan2(-direction.z);
    Vec2::new((0.5 + azimuth / TAU).clamp(0.0, 1.0), polar / PI)
}

/// Direction in the map's space of a place on it, and the sine of its polar angle.
#[inline]
fn lat_long_direction(point: Vec2) -> (Vec3, f32) {
    let (sine, cosine) = (PI * point.y).sin_cos();
    let (x, z) = (TAU * (point.x - 0.5)).sin_cos();
    (Vec3::new(sine * x, cosine, -sine * z), sine)
}

/// Place in the unit square of a direction: Clarberg 2008, "Fast Equal-Area Mapping of the (Hemi)Sphere using SIMD".
///
/// The octahedron |x| + |y| + |z| = 1 unfolded around +z, with radii stretched so that areas stay equal.
#[inline]
pub(super) fn equal_area_place(direction: Vec3) -> Vec2 {
    let [x, y] = [direction.x.abs(), direction.y.abs()];
    // sqrt(1 - |z|), without cancellation near the poles.
    let planar2 = x * x + y * y;
    let radius = (planar2 / (1.0 + direction.z.abs())).sqrt().min(1.0);
    let turn = y.atan2(x) * (2.0 / PI);
    let (mut u, mut v) = (radius - turn * radius, turn * radius);
    if direction.z < 0.0 {
        (u, v) = (1.0 - v, 1.0 - u);
    }
    let signed = Vec2::new(u.copysign(direction.x), v.copysign(direction.y));
    ((signed + 1.0) * 0.5).clamp(Vec2::ZERO, Vec2::ONE)
}

/// The inverse of [`equal_area_place`].
#[inline]
pub(crate) fn equal_area_direction(place: Vec2) -> Vec3 {
    let signed = 2.0 * place - 1.0;
    let [u, v] = [signed.x.abs(), signed.y.abs()];
    let from_edge = 1.0 - (u + v);
    let radius = 1.0 - from_edge.abs();
    let turn = if radius > 0.0 { (v - u) / radius + 1.0 } else { 1.0 };
    let (sin, cos) = (turn * (PI / 4.0)).sin_cos();
    let z = (1.0 - radius * radius).copysign(from_edge);
    let planar = radius * (2.0 - radius * radius).max(0.0).sqrt();
    Vec3::new((planar * cos).copysign(signed.x), (planar * sin).copysign(signed.y), z)
}

/// A place outside of the octahedral square, by less than its width, as the one inside that is the same on the sphere.
pub(crate) fn fold_square(place: Vec2) -> Vec2 {
    let mirrored = |a: f32| if a < 0.0 { -a } else { 2.0 - a };
    let outside = |a: f32| !(0.0..=1.0).contains(&a);
    let mut place = place;
    if outside(place.x) {
        place = Vec2::new(mirrored(place.x), 1.0 - place.y);
    }
    if outside(place.y) {
        place = Vec2::new(1.0 - place.x, mirrored(place.y));
    }
    place.clamp(Vec2::ZERO, Vec2::ONE)
}
