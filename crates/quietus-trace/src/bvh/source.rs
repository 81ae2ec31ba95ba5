//! What the trees are made of: instances' shapes turned into items for the builder and blocks for the leaves.

use glam::{Affine3A, Vec3};
use rayon::prelude::*;

use super::Bounds;
use super::binary::{Item, Kind};
use super::wide::Leaves;
use crate::desc::{Geometry, MaterialId, Mesh, Object};
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
    fn vertex(&self, positions: &[Vec3], index: u32) -> Vec3 {
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
        item.index() | if self.filtered { FILTERED } else { 0 }
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
                    _ => unreachable!("refused when the scene is built"),
                };
            }
        }
        assert!(source.end < FILTERED as usize, "more than two billion primitives");
        source
    }

    /// Appends one reference and one item for each primitive; no item where its bounds are not finite.
    pub(super) fn collect(&self, references: &mut Vec<Reference>, items: &mut Vec<Item>) {
        for part in &self.parts {
            let (instance, shape) = (part.placed.instance, part.shape);
            match part.geometry {
                Geometry::Mesh(mesh) => {
                    let count = mesh.triangles.len();
                    references.par_extend(
                        (0..count as u32).into_par_iter().with_min_len(4096).map(|primitive| Reference {
                            instance,
                            shape,
                            primitive,
                        }),
                    );
                    let from = items.len();
                    let item = |i: usize| part.triangle(mesh, i);
                    items.par_extend((0..count).into_par_iter().with_min_len(4096).map(item));
                    drop_unbounded(items, from);
                }
                &Geometry::Sphere { center, radius } => {
                    references.push(Reference { instance, shape, primitive: 0 });
                    let (center, radius) = part.placed.sphere(center, radius);
                    let bounds = Bounds {
                        min: (center - radius).map(f32::next_down),
                        max: (center + radius).map(f32::next_up),
                    };
                    let from = items.len();
                    items.push(Item::new(bounds, part.first as u32, Kind::Sphere));
                    drop_unbounded(items, from);
                }
                _ => unreachable!("refused when the scene is built"),
            }
        }
    }

    fn part(&self, reference: usize) -> &Part<'a> {
        &self.parts[self.parts.partition_point(|p| p.first <= reference) - 1]
    }
}

/// Removes the items from `from` on that have no finite bounds.
fn drop_unbounded(items: &mut Vec<Item>, from: usize) {
    if items[from..].par_iter().with_min_len(4096).all(Item::is_bounded) {
        return;
    }
    let mut index = 0;
    items.retain(|item| {
        index += 1;
        index <= from || item.is_bounded()
    });
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
