//! What the trees are made of: instances' shapes turned into items for the builder and blocks for the leaves.

use glam::{Affine3A, Vec3};
use rayon::prelude::*;

use super::Bounds;
use super::item::{Item, Kind};
use super::singles::Singles;
use super::wide::Leaves;
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

impl Part<'_> {
    /// What a leaf calls an item.
    fn id(&self, item: &Item) -> u32 {
        item.index() | self.filter_bit()
    }

    fn filter_bit(&self) -> u32 {
        if self.filtered { FILTERED } else { 0 }
    }

    /// A triangle of its mesh as the builder sees it.
    #[inline(always)]
    fn triangle(&self, mesh: &Mesh, primitive: usize) -> Item {
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
        Item::new(bounds, (self.first + primitive) as u32, kind)
    }
}

/// Empty where something is not a number, which passes min and max unseen.
#[inline(always)]
fn triangle_bounds([a, b, c]: [Vec3; 3]) -> Bounds {
    let bounds = Bounds { min: a.min(b).min(c), max: a.max(b).max(c) };
    if (a + b + c).is_nan() { Bounds::EMPTY } else { bounds }
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
                source.end += match geometry {
                    Geometry::Mesh(mesh) => mesh.triangles.len(),
                    Geometry::Sphere { .. } => 1,
                    Geometry::Quadric(_) => 1,
                    Geometry::Patches(mesh) => mesh.patches.len(),
                    Geometry::Curves(curves) => curves.segments.len(),
                };
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
        for part in &self.parts {
            let (instance, shape) = (part.placed.instance, part.shape);
            let reference = |primitive| Reference { instance, shape, primitive };
            let (first, filtered) = (part.first, part.filter_bit());
            match part.geometry {
                Geometry::Mesh(mesh) => {
                    let count = mesh.triangles.len();
                    references
                        .par_extend((0..count as u32).into_par_iter().with_min_len(4096).map(reference));
                    let item = |i: usize| part.triangle(mesh, i);
                    items.par_extend((0..count).into_par_iter().with_min_len(4096).map(item));
                }
                &Geometry::Sphere { center, radius } => {
                    references.push(reference(0));
                    let (center, radius) = part.placed.sphere(center, radius);
                    let bounds = Bounds {
                        min: (center - radius).map(f32::next_down),
                        max: (center + radius).map(f32::next_up),
                    };
                    items.push(Item::new(bounds, first as u32, Kind::Sphere));
                }
                Geometry::Quadric(quadric) => {
                    references.push(reference(0));
                    singles.quadric(quadric, first as u32 | filtered, items);
                }
                Geometry::Patches(mesh) => {
                    references.extend((0..mesh.patches.len() as u32).map(reference));
                    singles.patches(&part.placed, mesh, first, filtered, items);
                }
                Geometry::Curves(curves) => {
                    references.extend((0..curves.segments.len() as u32).map(reference));
                    singles.curves(&part.placed, curves, first, filtered, items);
                }
            }
        }
        drop_unbounded(items);
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
            let Geometry::Mesh(mesh) = part.geometry else { unreachable!("a triangle is of a mesh") };
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
            let Geometry::Mesh(mesh) = part.geometry else { unreachable!("a triangle is of a mesh") };
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
