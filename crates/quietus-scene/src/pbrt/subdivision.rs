//! Loop's subdivision surfaces: Loop 1987, "Smooth Subdivision Surfaces Based on Triangles", with the boundaries and
//! limits of Hoppe et al. 1994, "Piecewise Smooth Surface Reconstruction", as pbrt draws them.

use std::collections::HashMap;
use std::f32::consts::{PI, TAU};

use glam::Vec3;

/// Most triangles that a surface is divided into.
const MAX_TRIANGLES: usize = 1 << 26;

/// A surface under way: corners and the triangles between them.
#[derive(Clone, Debug)]
pub(super) struct Surface {
    pub positions: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
}

/// The edges of a surface. Those with one triangle, or with more than two, are its boundary.
struct Edges {
    /// Each once: its ends, the corners opposite to it, and how many triangles it has.
    list: Vec<Edge>,
    /// By its ends, the smaller one first.
    known: HashMap<[u32; 2], u32>,
}

struct Edge {
    ends: [u32; 2],
    opposite: [u32; 2],
    triangles: u32,
}

/// What surrounds a corner.
#[derive(Clone, Copy, Default)]
struct Ring {
    neighbors: u32,
    sum: Vec3,
    /// Of the neighbours along the boundary.
    boundary: u32,
    boundary_sum: Vec3,
}

impl Surface {
    /// Whether `levels` divisions stay within what is drawn.
    pub(super) fn fits(&self, levels: u32) -> bool {
        let count = 4_usize.checked_pow(levels).and_then(|share| share.checked_mul(self.triangles.len()));
        count.is_some_and(|count| count <= MAX_TRIANGLES)
    }

    /// Divides each triangle into four, once.
    #[must_use]
    pub(super) fn divided(&self) -> Self {
        let edges = Edges::of(&self.triangles);
        let rings = edges.rings(&self.positions);
        let even = |(position, ring): (&Vec3, &Ring)| ring.moved(*position, inner_weight, 1.0 / 8.0);
        let mut positions: Vec<Vec3> = self.positions.iter().zip(&rings).map(even).collect();
        positions.extend(edges.list.iter().map(|edge| {
            let [a, b] = edge.ends.map(|end| self.positions[end as usize]);
            if edge.is_boundary() {
                return a.midpoint(b);
            }
            let [c, d] = edge.opposite.map(|corner| self.positions[corner as usize]);
            (3.0 * (a + b) + c + d) / 8.0
        }));
        let first = self.positions.len() as u32;
        let mut triangles = Vec::with_capacity(4 * self.triangles.len());
        for &[a, b, c] in &self.triangles {
            let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|ends| first + edges.number(ends));
            triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        Self { positions, triangles }
    }

    /// Where the corners end after endlessly many divisions, and the surface's normals there. They point to where
    /// pbrt has them: to the side from which the triangles go round clockwise.
    pub(super) fn limit(&self) -> (Vec<Vec3>, Vec<Vec3>) {
        let edges = Edges::of(&self.triangles);
        let rings = edges.rings(&self.positions);
        let limit = |(position, ring): (&Vec3, &Ring)| ring.moved(*position, limit_weight, 1.0 / 6.0);
        let limits: Vec<Vec3> = self.positions.iter().zip(&rings).map(limit).collect();
        let mut fans: Vec<Vec<[u32; 2]>> = vec![Vec::new(); limits.len()];
        for &[a, b, c] in &self.triangles {
            for [corner, next, last] in [[a, b, c], [b, c, a], [c, a, b]] {
                fans[corner as usize].push([next, last]);
            }
        }
        let normal = |(corner, fan): (usize, &Vec<[u32; 2]>)| {
            let ring: Option<Vec<Vec3>> =
                ordered(fan).map(|ring| ring.iter().map(|&n| limits[n as usize]).collect());
            let tangents = ring.and_then(|ring| match rings[corner].boundary {
                0 => Some(inner_tangents(&ring)),
                2 => Some(boundary_tangents(limits[corner], &ring)),
                _ => None,
            });
            let normal = tangents.map_or(Vec3::ZERO, |[s, t]| s.cross(t)).normalize_or_zero();
            if normal != Vec3::ZERO {
                return -normal;
            }
            // A corner or a point where surfaces meet: the mean of the faces around it.
            let around = |&[next, last]: &[u32; 2]| {
                let [p, a, b] = [corner as u32, next, last].map(|i| limits[i as usize]);
                (a - p).cross(b - p)
            };
            -fan.iter().map(around).sum::<Vec3>().normalize_or_zero()
        };
        let normals = fans.iter().enumerate().map(normal).collect();
        (limits, normals)
    }
}

impl Edges {
    fn of(triangles: &[[u32; 3]]) -> Self {
        let mut edges = Self { list: Vec::new(), known: HashMap::with_capacity(3 * triangles.len() / 2) };
        for &[a, b, c] in triangles {
            for (ends, opposite) in [([a, b], c), ([b, c], a), ([c, a], b)] {
                let list = &mut edges.list;
                let number = *edges.known.entry(sorted(ends)).or_insert_with(|| {
                    list.push(Edge { ends, opposite: [opposite; 2], triangles: 0 });
                    list.len() as u32 - 1
                });
                let edge = &mut edges.list[number as usize];
                edge.opposite[(edge.triangles > 0) as usize] = opposite;
                edge.triangles += 1;
            }
        }
        edges
    }

    /// The number of an edge, which must be there.
    fn number(&self, ends: [u32; 2]) -> u32 {
        self.known[&sorted(ends)]
    }

    fn rings(&self, positions: &[Vec3]) -> Vec<Ring> {
        let mut rings = vec![Ring::default(); positions.len()];
        for edge in &self.list {
            let [a, b] = edge.ends;
            for (here, there) in [(a, b), (b, a)] {
                let (ring, there) = (&mut rings[here as usize], positions[there as usize]);
                ring.neighbors += 1;
                ring.sum += there;
                if edge.is_boundary() {
                    ring.boundary += 1;
                    ring.boundary_sum += there;
                }
            }
        }
        rings
    }
}

impl Edge {
    fn is_boundary(&self) -> bool {
        self.triangles != 2
    }
}

impl Ring {
    /// The corner pulled to its neighbours: to each of those around it by a weight that depends on their number, to
    /// each of the two along a boundary by `boundary`. Where more boundaries meet it stays.
    fn moved(&self, corner: Vec3, inner: impl Fn(u32) -> f32, boundary: f32) -> Vec3 {
        match self.boundary {
            0 if self.neighbors > 0 => {
                let weight = inner(self.neighbors);
                (1.0 - self.neighbors as f32 * weight) * corner + weight * self.sum
            }
            2 => (1.0 - 2.0 * boundary) * corner + boundary * self.boundary_sum,
            _ => corner,
        }
    }
}

fn sorted([a, b]: [u32; 2]) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

/// The weight of each of `neighbors` for a division (Warren's).
fn inner_weight(neighbors: u32) -> f32 {
    if neighbors == 3 { 3.0 / 16.0 } else { 3.0 / (8.0 * neighbors as f32) }
}

/// The same for endlessly many divisions.
fn limit_weight(neighbors: u32) -> f32 {
    1.0 / (neighbors as f32 + 3.0 / (8.0 * inner_weight(neighbors)))
}

/// The corners around one, counterclockwise, from its triangles' other corners; `None` where they are no single fan.
fn ordered(fan: &[[u32; 2]]) -> Option<Vec<u32>> {
    let first = fan.iter().find(|[next, _]| fan.iter().all(|[_, last]| last != next)).or(fan.first())?;
    let mut ring = vec![first[0]];
    for _ in fan {
        let here = ring.last()?;
        let mut following = fan.iter().filter(|[next, _]| next == here);
        let [_, last] = following.next()?;
        if following.next().is_some() {
            return None;
        }
        ring.push(*last);
    }
    if ring.first() == ring.last() {
        ring.pop();
    }
    Some(ring)
}

/// Two tangents at a corner inside the surface, the second counterclockwise of the first.
fn inner_tangents(ring: &[Vec3]) -> [Vec3; 2] {
    let mut tangents = [Vec3::ZERO; 2];
    for (i, &point) in ring.iter().enumerate() {
        let (sin, cos) = (TAU * i as f32 / ring.len() as f32).sin_cos();
        tangents[0] += cos * point;
        tangents[1] += sin * point;
    }
    tangents
}

/// The same at a boundary, whose neighbours are the first and the last: along it, and into the surface.
fn boundary_tangents(corner: Vec3, ring: &[Vec3]) -> [Vec3; 2] {
    let (first, last) = (ring[0], ring[ring.len() - 1]);
    let across = match *ring {
        [a, b] => a + b - 2.0 * corner,
        [_, a, _] => a - corner,
        [a, b, c, d] => 2.0 * (b + c) - a - d - 2.0 * corner,
        _ => {
            let theta = PI / (ring.len() - 1) as f32;
            let inner = ring.iter().enumerate().skip(1).take(ring.len() - 2);
            let bent: Vec3 = inner.map(|(k, &point)| (k as f32 * theta).sin() * point).sum();
            (2.0 - 2.0 * theta.cos()) * bent - theta.sin() * (first + last)
        }
    };
    [first - last, across]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid of `n` by `n` corners at what `place` makes of (x, y).
    fn grid(n: u32, place: impl Fn(f32, f32) -> Vec3) -> Surface {
        let at = |x: u32, y: u32| y * n + x;
        let positions = (0..n * n).map(|i| place((i % n) as f32, (i / n) as f32)).collect();
        let cells = (0..(n - 1) * (n - 1)).map(|i| (i % (n - 1), i / (n - 1)));
        let halves =
            |(x, y)| [[at(x, y), at(x + 1, y), at(x + 1, y + 1)], [at(x, y), at(x + 1, y + 1), at(x, y + 1)]];
        Surface { positions, triangles: cells.flat_map(halves).collect() }
    }

    fn octahedron() -> Surface {
        let positions = vec![Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
        let triangles =
            vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
        Surface { positions, triangles }
    }

    /// In the plane the weights of a corner must add up to one, and inside a regular grid they reproduce quadratic
    /// polynomials up to a constant (the surface is a box spline there), with the exact gradient.
    #[test]
    fn regular_surfaces_are_box_splines() {
        let surface = grid(7, |x, y| Vec3::new(x, y, 0.1 * x * x - 0.2 * x * y));
        let (limits, normals) = surface.limit();
        let middle = 3 * 7 + 3;
        assert!((limits[middle].truncate() - glam::Vec2::splat(3.0)).length() < 1e-5);
        let gradient = Vec3::new(0.2 * 3.0 - 0.2 * 3.0, -0.2 * 3.0, 0.0);
        let expected = -(Vec3::Z - gradient).normalize();
        assert!((normals[middle] - expected).length() < 1e-4, "{} {expected}", normals[middle]);
        for (limit, normal) in grid(5, |x, y| Vec3::new(x, y, 2.0)).limit().0.iter().zip(normals) {
            assert!((limit.z - 2.0).abs() < 1e-5 && normal.is_finite(), "{limit}");
        }
    }

    /// The limit of a corner does not depend on how often the surface is divided before.
    #[test]
    fn limits_stay_where_they_are() {
        for surface in [octahedron(), grid(4, |x, y| Vec3::new(x, y, (3.0 * x + y * y).sin()))] {
            let (limits, normals) = surface.limit();
            let finer = surface.divided().divided();
            let (again, turned) = finer.limit();
            for i in 0..surface.positions.len() {
                assert!((limits[i] - again[i]).length() < 1e-5, "{i}: {} {}", limits[i], again[i]);
                // Normals come from the limits around, which are closer by now.
                assert!(normals[i].dot(turned[i]) > 0.9, "{i}: {} {}", normals[i], turned[i]);
            }
        }
    }

    #[test]
    fn closed_surfaces_stay_closed_and_grow_fourfold() {
        let surface = octahedron().divided().divided();
        assert_eq!(surface.triangles.len(), 8 * 16);
        assert_eq!(surface.positions.len(), 8 * 16 / 2 + 2);
        assert!(Edges::of(&surface.triangles).list.iter().all(|edge| edge.triangles == 2));
        let (limits, normals) = surface.limit();
        for (limit, normal) in limits.iter().zip(normals) {
            assert!(limit.length() < 1.0 && limit.dot(normal) < -0.9 * limit.length(), "{limit} {normal}");
        }
    }

    /// Three triangles at an edge, triangles that meet at a point alone, triangles turned over, and corners that
    /// nothing uses.
    #[test]
    fn what_is_no_surface_is_divided_all_the_same() {
        for triangles in [
            vec![[0, 1, 2], [0, 1, 3], [1, 0, 4]],
            vec![[0, 1, 2], [0, 3, 4]],
            vec![[0, 1, 2], [0, 1, 2]],
            vec![[0, 1, 2], [1, 2, 3]],
            vec![[0, 0, 0], [1, 1, 2]],
        ] {
            let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_Y, Vec3::ONE];
            let (limits, normals) = Surface { positions, triangles }.divided().divided().limit();
            assert!(limits.iter().chain(&normals).all(|v| v.is_finite()));
        }
    }
}
