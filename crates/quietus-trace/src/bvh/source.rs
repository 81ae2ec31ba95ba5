//! What the trees are made of: instances' shapes turned into items for the builder and blocks for the leaves.

use glam::{Affine3A, Vec3};
use rayon::prelude::*;

use super::item::{Item, Kind};
use super::singles::Singles;
use super::wide::Leaves;
use super::{Bounds, memory};
use crate::desc::{CurveSegment, Geometry, MaterialId, Mesh, Object};
use crate::geometry::sphere::SphereBlock;
use crate::geometry::triangle::{MovingBlock, TriangleBlock};

/// Which primitive of the scene. Ordered as the scene lists them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Reference {
    pub(super) instance: u32,
    pub(super) shape: u32,
    pub(super) primitive: u32,
}

/// Set in a primitive's id where the filter must be asked.
pub(super) const FILTERED: u32 = 1 << 31;

/// An object in the space of a tree.
#[derive(Clone, Copy)]
pub(super) struct Placed<'a> {
    pub(super) instance: u32,
    pub(super) object: &'a Object,
    /// None for the object's own space.
    pub(super) transform: Option<Affine3A>,
}

impl Placed<'_> {
    /// A triangle whose vertices are among `positions`.
    #[inline(always)]
    fn vertices(&self, positions: &[Vec3], [a, b, c]: [u32; 3]) -> [Vec3; 3] {
        [self.vertex(positions, a), self.vertex(positions, b), self.vertex(positions, c)]
    }

    #[inline(always)]
    pub(super) fn vertex(&self, positions: &[Vec3], index: u32) -> Vec3 {
        let p = positions[index as usize];
        match &self.transform {
            Some(transform) => transform.transform_point3(p),
            None => p,
        }
    }

    /// In the tree's space, where the transform is a similarity.
    fn sphere(&self, center: Vec3, radius: f32) -> (Vec3, f32) {
        self.transform
            .map_or((center, radius), |m| (m.transform_point3(center), radius * m.matrix3.x_axis.length()))
    }
}

impl Placed<'_> {
    /// A piece of a curve in the tree's space, where the transform is a similarity that does not mirror.
    pub(super) fn segment(&self, segment: &CurveSegment) -> CurveSegment {
        let Some(m) = &self.transform else { return *segment };
        let scale = m.matrix3.x_axis.length();
        CurveSegment {
            points: segment.points.map(|p| m.transform_point3(p)),
            widths: segment.widths.map(|width| scale * width),
            normals: segment.normals.map(|n| m.transform_vector3(n) / scale),
            ..*segment
        }
    }
}

/// One shape, and the index of its first reference.
struct Part<'a> {
    placed: Placed<'a>,
    shape: u32,
    geometry: &'a Geometry,
    filtered: bool,
    first: usize,
}

impl<'a> Part<'a> {
    #[inline(always)]
    fn mesh(&self) -> &'a Mesh {
        let Geometry::Mesh(mesh) = self.geometry else { unreachable!("a triangle is of a mesh") };
        mesh
    }

    /// What a leaf calls an item.
    fn id(&self, item: &Item) -> u32 {
        item.index() | self.filter_bit()
    }

    fn filter_bit(&self) -> u32 {
        if self.filtered { FILTERED } else { 0 }
    }

    /// One past its last reference.
    #[inline(always)]
    fn end(&self) -> usize {
        self.first + primitives(self.geometry)
    }

    /// A triangle of its mesh, by its reference, as the builder sees it.
    #[inline(always)]
    fn triangle(&self, reference: usize) -> Item {
        let (mesh, primitive) = (self.mesh(), reference - self.first);
        let corners = mesh.triangles[primitive];
        let vertices = self.placed.vertices(&mesh.positions, corners);
        let (mut bounds, mut kind) = (triangle_bounds(vertices), Kind::Triangle);
        if !mesh.end_positions.is_empty() {
            let end = self.placed.vertices(&mesh.end_positions, corners);
            if end != vertices {
                let end = triangle_bounds(end);
                let broken = bounds.is_empty() || end.is_empty();
                bounds = if broken { Bounds::EMPTY } else { bounds.union(end).widened() };
                kind = Kind::MovingTriangle;
            }
        }
        Item::new(bounds, reference as u32, kind)
    }
}

/// Empty where something is not a number, which passes min and max unseen.
#[inline(always)]
fn triangle_bounds([a, b, c]: [Vec3; 3]) -> Bounds {
    let bounds = Bounds { min: a.min(b).min(c), max: a.max(b).max(c) };
    if (a + b + c).is_nan() { Bounds::EMPTY } else { bounds }
}

/// How many references a shape has.
#[inline(always)]
fn primitives(geometry: &Geometry) -> usize {
    match geometry {
        Geometry::Mesh(mesh) => mesh.triangles.len(),
        Geometry::Sphere { .. } | Geometry::Quadric(_) => 1,
        Geometry::Patches(mesh) => mesh.patches.len(),
        Geometry::Curves(curves) => curves.segments.len(),
    }
}

/// All shapes of one tree.
pub(super) struct Source<'a> {
    parts: Vec<Part<'a>>,
    /// One past the last reference.
    end: usize,
}

impl<'a> Source<'a> {
    /// Shapes of `placed`, whose references are numbered from `first` on.
    pub(super) fn new(placed: &[Placed<'a>], first: usize, opaque: &impl Fn(MaterialId) -> bool) -> Self {
        let mut source = Self { parts: Vec::new(), end: first };
        for &placed in placed {
            for (index, shape) in placed.object.shapes.iter().enumerate() {
                let geometry = &shape.geometry;
                let filtered = !opaque(shape.material);
                let shape = index as u32;
                source.parts.push(Part { placed, shape, geometry, filtered, first: source.end });
                source.end += primitives(geometry);
            }
        }
        assert!(source.end < FILTERED as usize, "more than two billion primitives");
        source
    }

    /// Appends one reference for each primitive and one item for each or each of its parts; no item where its bounds
    /// are not finite.
    pub(super) fn collect(
        &self,
        references: &mut Vec<Reference>,
        singles: &mut Singles,
        items: &mut Vec<Item>,
    ) {
        let Some(start) = self.parts.first() else { return };
        let first = references.len();
        items.reserve_exact(self.end - first);
        memory::prefer_huge_pages(items.spare_capacity_mut());
        references.par_extend((first..self.end).into_par_iter().with_min_len(4096).map_init(
            || start,
            |part, index| {
                *part = self.part_from(part, index);
                let primitive = (index - part.first) as u32;
                Reference { instance: part.placed.instance, shape: part.shape, primitive }
            },
        ));
        // Meshes side by side at once: there may be thousands, and small ones.
        let is_mesh = |part: &Part<'_>| matches!(part.geometry, Geometry::Mesh(_));
        for run in self.parts.chunk_by(|a, b| is_mesh(a) && is_mesh(b)) {
            let part = &run[0];
            let (first, filtered) = (part.first, part.filter_bit());
            match part.geometry {
                Geometry::Mesh(_) => {
                    let indices = first..run[run.len() - 1].end();
                    let indices = indices.into_par_iter().with_min_len(4096);
                    items.par_extend(indices.map_init(
                        || part,
                        |part, index| {
                            *part = self.part_from(part, index);
                            part.triangle(index)
                        },
                    ));
                }
                &Geometry::Sphere { center, radius } => {
                    let (center, radius) = part.placed.sphere(center, radius);
                    let bounds = Bounds {
                        min: (center - radius).map(f32::next_down),
                        max: (center + radius).map(f32::next_up),
                    };
                    items.push(Item::new(bounds, first as u32, Kind::Sphere));
                }
                Geometry::Quadric(quadric) => singles.quadric(quadric, first as u32 | filtered, items),
                Geometry::Patches(mesh) => singles.patches(&part.placed, mesh, first, filtered, items),
                Geometry::Curves(curves) => singles.curves(&part.placed, curves, first, filtered, items),
            }
        }
        drop_unbounded(items);
    }

    /// The part that holds a reference: `part`, if it does.
    #[inline(always)]
    fn part_from<'s>(&'s self, part: &'s Part<'a>, reference: usize) -> &'s Part<'a> {
        if (part.first..part.end()).contains(&reference) { part } else { self.part(reference) }
    }

    fn part(&self, reference: usize) -> &Part<'a> {
        &self.parts[self.parts.partition_point(|p| p.first <= reference) - 1]
    }
}

/// Removes the items that have no finite bounds.
fn drop_unbounded(items: &mut Vec<Item>) {
    if items.par_iter().with_min_len(4096).all(Item::is_bounded) {
        return;
    }
    items.retain(Item::is_bounded);
}

impl Leaves for Source<'_> {
    fn triangles(&self, items: &[Item]) -> TriangleBlock {
        let mut block = TriangleBlock::default();
        for (lane, item) in items.iter().enumerate() {
            let index = item.index() as usize;
            let part = self.part(index);
            let mesh = part.mesh();
            let corners = mesh.triangles[index - part.first];
            block.set(lane, part.placed.vertices(&mesh.positions, corners), part.id(item));
        }
        block
    }

    fn moving(&self, items: &[Item]) -> MovingBlock {
        let mut block = MovingBlock::default();
        for (lane, item) in items.iter().enumerate() {
            let index = item.index() as usize;
            let part = self.part(index);
            let mesh = part.mesh();
            let corners = mesh.triangles[index - part.first];
            let start = part.placed.vertices(&mesh.positions, corners);
            let end = part.placed.vertices(&mesh.end_positions, corners);
            block.set(lane, start, end, part.id(item));
        }
        block
    }

    fn spheres(&self, items: &[Item]) -> SphereBlock {
        let mut block = SphereBlock::default();
        for (lane, item) in items.iter().enumerate() {
            let part = self.part(item.index() as usize);
            let &Geometry::Sphere { center, radius } = part.geometry else {
                unreachable!("a sphere is a sphere")
            };
            let (center, radius) = part.placed.sphere(center, radius);
            block.set(lane, center, radius, part.id(item));
        }
        block
    }
}
