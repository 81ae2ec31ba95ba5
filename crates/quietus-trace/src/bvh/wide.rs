//! The 8-wide tree as it is traversed: nodes and leaf blocks, written out from the binary tree by its plan.

use std::mem::MaybeUninit;

use super::binary::{Subtree, Tree, WIDTH};
use super::item::{Item, Kind};
use super::singles::Singles;
use super::{Bounds, memory};
use crate::geometry::sphere::SphereBlock;
use crate::geometry::triangle::{MovingBlock, TriangleBlock};
use crate::isa::{Isa, Lanes};

/// Cache lines of a node or a block that are asked for ahead of time. Measured.
const PREFETCHED: usize = 4;
/// Subtrees larger than this are written by a task of their own.
const TASK: u32 = 4096;

/// What a node's lane, or an entry of the stack, leads to: kind in the upper three bits, index below.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Link(u32);

impl Link {
    const SHIFT: u32 = 29;
    /// Greatest index, reserved.
    const LAST: u32 = (1 << Self::SHIFT) - 1;
    /// End of an instance's tree: back to the world's.
    pub(super) const LEAVE: Self = Self(u32::MAX);

    const fn tagged(tag: u32, index: usize) -> Self {
        assert!(index < Self::LAST as usize, "more than half a billion nodes or blocks");
        Self(tag << Self::SHIFT | index as u32)
    }

    pub(super) const fn node(index: usize) -> Self {
        Self::tagged(0, index)
    }

    const fn leaf(kind: Kind, index: usize) -> Self {
        Self::tagged(kind as u32 + 1, index)
    }

    /// The node's index, if it is one.
    #[inline(always)]
    pub(super) fn as_node(self) -> Option<usize> {
        (self.0 >> Self::SHIFT == 0).then_some(self.0 as usize)
    }

    /// The block's index, if it is one of triangles.
    #[inline(always)]
    pub(super) fn as_triangles(self) -> Option<usize> {
        self.of_kind(Kind::Triangle)
    }

    /// The instance's index, if it is one.
    #[inline(always)]
    pub(super) fn as_instance(self) -> Option<usize> {
        self.of_kind(Kind::Instance)
    }

    #[inline(always)]
    fn of_kind(self, kind: Kind) -> Option<usize> {
        (self.0 >> Self::SHIFT == kind as u32 + 1).then_some(self.index())
    }

    /// For a leaf: what it holds, and where.
    #[inline(always)]
    pub(super) fn as_leaf(self) -> (Kind, usize) {
        (Kind::from_number((self.0 >> Self::SHIFT) - 1), self.index())
    }

    #[inline(always)]
    fn index(self) -> usize {
        (self.0 & Self::LAST) as usize
    }

    #[inline(always)]
    pub(super) fn bits(self) -> u32 {
        self.0
    }

    /// The link that [`Link::bits`] was told of.
    #[inline(always)]
    pub(super) fn from_bits(bits: u32) -> Self {
        Self(bits)
    }
}

/// Bounds of up to 8 children, and where they are: four cache lines.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct Node {
    /// By axis: minima, maxima. Lanes without a child are inside out, so that no ray meets them.
    pub(super) planes: [[Lanes; 2]; 3],
    pub(super) links: [Link; WIDTH],
}

impl Node {
    const EMPTY: Self = Self {
        planes: [[Lanes([f32::INFINITY; WIDTH]), Lanes([f32::NEG_INFINITY; WIDTH])]; 3],
        links: [Link(0); WIDTH],
    };

    fn set(&mut self, lane: usize, bounds: &Bounds, link: Link) {
        for axis in 0..3 {
            self.planes[axis][0].0[lane] = bounds.min[axis];
            self.planes[axis][1].0[lane] = bounds.max[axis];
        }
        self.links[lane] = link;
    }
}

/// All trees' nodes and leaves.
#[derive(Debug, Default)]
pub(super) struct Store {
    pub(super) nodes: Vec<Node>,
    pub(super) triangles: Vec<TriangleBlock>,
    pub(super) moving: Vec<MovingBlock>,
    pub(super) spheres: Vec<SphereBlock>,
    /// Leaves whose links name them by the order in which the scene lists them.
    pub(super) singles: Singles,
}

/// Fills leaf blocks: whoever knows what an [`Item`]'s index means.
pub(super) trait Leaves: Sync {
    /// A block of triangles.
    fn triangles(&self, items: &[Item]) -> TriangleBlock;
    /// A block of triangles that move.
    fn moving(&self, items: &[Item]) -> MovingBlock;
    /// A block of spheres.
    fn spheres(&self, items: &[Item]) -> SphereBlock;
}

/// Numbers of nodes and blocks.
#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    nodes: usize,
    triangles: usize,
    moving: usize,
    spheres: usize,
}

impl Counts {
    fn add(&mut self, other: &Self) {
        self.nodes += other.nodes;
        self.triangles += other.triangles;
        self.moving += other.moving;
        self.spheres += other.spheres;
    }
}

/// How many nodes and blocks a wide subtree needs; for large ones also those of each child, so that children
/// can be written in parallel.
#[derive(Debug, Default)]
struct Census {
    counts: Counts,
    children: Vec<Census>,
}

struct Emitter<'a, L> {
    items: &'a [Item],
    leaves: &'a L,
}

/// The part of the output that belongs to one subtree.
struct Output<'a> {
    /// Indices of the first elements.
    base: Counts,
    nodes: &'a mut [MaybeUninit<Node>],
    triangles: &'a mut [MaybeUninit<TriangleBlock>],
    moving: &'a mut [MaybeUninit<MovingBlock>],
    spheres: &'a mut [MaybeUninit<SphereBlock>],
}

impl<'a> Output<'a> {
    /// Takes what `counts` says off the front.
    fn take(&mut self, counts: &Counts) -> Output<'a> {
        let base = self.base;
        self.base.add(counts);
        Output {
            base,
            nodes: self.nodes.split_off_mut(..counts.nodes).expect("counted before"),
            triangles: self.triangles.split_off_mut(..counts.triangles).expect("counted before"),
            moving: self.moving.split_off_mut(..counts.moving).expect("counted before"),
            spheres: self.spheres.split_off_mut(..counts.spheres).expect("counted before"),
        }
    }

    /// Panics unless all of it has been taken.
    fn finish(&self) {
        let left = self.nodes.len() + self.triangles.len() + self.moving.len() + self.spheres.len();
        assert_eq!(left, 0, "counted otherwise before");
    }
}

impl Store {
    /// # Safety
    /// `index` must come from a link of this store.
    #[inline(always)]
    pub(super) unsafe fn node(&self, index: usize) -> &Node {
        debug_assert!(index < self.nodes.len());
        // SAFETY: links lead to what `append` has written, and nothing is ever removed.
        unsafe { self.nodes.get_unchecked(index) }
    }

    /// Hints that what `link` leads to will be looked at, if it is a node or a block of triangles.
    #[inline(always)]
    pub(super) fn prefetch<I: Isa>(&self, isa: I, link: Link) {
        let start: *const u8 = match link.as_node() {
            Some(index) => self.nodes.as_ptr().wrapping_add(index).cast(),
            None => self.triangles.as_ptr().wrapping_add(link.index()).cast(),
        };
        for line in 0..PREFETCHED {
            isa.prefetch(start.wrapping_add(64 * line));
        }
    }

    /// # Safety
    /// `index` must come from a link of this store to triangles.
    #[inline(always)]
    pub(super) unsafe fn triangles(&self, index: usize) -> &TriangleBlock {
        debug_assert!(index < self.triangles.len());
        // SAFETY: links lead to what `append` has written, and nothing is ever removed.
        unsafe { self.triangles.get_unchecked(index) }
    }

    /// Builds a tree over `items` and appends it. Returns its root and bounds.
    pub(super) fn append<L: Leaves>(&mut self, items: &mut [Item], leaves: &L) -> (Link, Bounds) {
        let root = Link::node(self.nodes.len());
        if items.is_empty() {
            self.nodes.push(Node::EMPTY);
            return (root, Bounds::EMPTY);
        }
        let tree = Tree::build(items);
        let emitter = Emitter { items, leaves };
        let census = emitter.census(tree.root());
        let counts = census.counts;
        let base = Counts {
            nodes: self.nodes.len(),
            triangles: self.triangles.len(),
            moving: self.moving.len(),
            spheres: self.spheres.len(),
        };
        self.nodes.reserve_exact(counts.nodes);
        self.triangles.reserve_exact(counts.triangles);
        self.moving.reserve_exact(counts.moving);
        self.spheres.reserve_exact(counts.spheres);
        let output = Output {
            base,
            nodes: &mut self.nodes.spare_capacity_mut()[..counts.nodes],
            triangles: &mut self.triangles.spare_capacity_mut()[..counts.triangles],
            moving: &mut self.moving.spare_capacity_mut()[..counts.moving],
            spheres: &mut self.spheres.spare_capacity_mut()[..counts.spheres],
        };
        memory::prefer_huge_pages(output.nodes);
        memory::prefer_huge_pages(output.triangles);
        memory::prefer_huge_pages(output.moving);
        memory::prefer_huge_pages(output.spheres);
        emitter.emit(tree.root(), &census, output);
        // SAFETY: `emit` has written every element of its output: it splits it exactly by the census, down to
        // single elements, and panics where elements are left over.
        unsafe {
            self.nodes.set_len(base.nodes + counts.nodes);
            self.triangles.set_len(base.triangles + counts.triangles);
            self.moving.set_len(base.moving + counts.moving);
            self.spheres.set_len(base.spheres + counts.spheres);
        }
        (root, tree.root().root().bounds)
    }
}

impl<L: Leaves> Emitter<'_, L> {
    fn children<'t>(&self, at: Subtree<'t>) -> ([Subtree<'t>; WIDTH], usize) {
        let mut children = [at; WIDTH];
        let mut len = 0;
        at.wide_children(|child| {
            children[len] = child;
            len += 1;
        });
        (children, len)
    }

    fn leaf_kind(&self, at: Subtree<'_>) -> Option<Kind> {
        at.root().is_leaf().then(|| self.items[at.item].kind())
    }

    /// Counts the subtree of a wide node.
    fn census(&self, at: Subtree<'_>) -> Census {
        let (children, len) = self.children(at);
        let mut census = Census { counts: Counts { nodes: 1, ..Counts::default() }, children: Vec::new() };
        if at.root().count > TASK {
            use rayon::prelude::*;
            census.children = children[..len].par_iter().map(|&child| self.child_census(child)).collect();
            for child in &census.children {
                census.counts.add(&child.counts);
            }
        } else {
            for &child in &children[..len] {
                census.counts.add(&self.child_census(child).counts);
            }
        }
        census
    }

    fn child_census(&self, at: Subtree<'_>) -> Census {
        let counts = match self.leaf_kind(at) {
            None => return self.census(at),
            Some(Kind::Triangle) => Counts { triangles: 1, ..Counts::default() },
            Some(Kind::MovingTriangle) => Counts { moving: 1, ..Counts::default() },
            Some(Kind::Sphere) => Counts { spheres: 1, ..Counts::default() },
            Some(Kind::Instance | Kind::Curve | Kind::Ribbon | Kind::Solid) => Counts::default(),
        };
        Census { counts, children: Vec::new() }
    }

    /// Writes the subtree of a wide node to exactly `output`.
    fn emit(&self, at: Subtree<'_>, census: &Census, mut output: Output<'_>) {
        if census.children.is_empty() {
            self.emit_serial(at, &mut output);
            output.finish();
            return;
        }
        let (children, len) = self.children(at);
        let own = output.take(&Counts { nodes: 1, ..Counts::default() });
        let mut node = Node::EMPTY;
        rayon::scope(|scope| {
            for (lane, (&child, census)) in children[..len].iter().zip(&census.children).enumerate() {
                let mut part = output.take(&census.counts);
                let bounds = &child.root().bounds;
                if child.root().is_leaf() {
                    node.set(lane, bounds, self.emit_leaf(child, &mut part));
                } else {
                    node.set(lane, bounds, Link::node(part.base.nodes));
                    scope.spawn(move |_| self.emit(child, census, part));
                }
            }
        });
        output.finish();
        own.nodes[0].write(node);
    }

    /// Writes the subtree of a wide node to the front of `output`.
    fn emit_serial(&self, at: Subtree<'_>, output: &mut Output<'_>) -> Link {
        let own = output.take(&Counts { nodes: 1, ..Counts::default() });
        let (children, len) = self.children(at);
        let mut node = Node::EMPTY;
        for (lane, &child) in children[..len].iter().enumerate() {
            let link = if child.root().is_leaf() {
                self.emit_leaf(child, output)
            } else {
                self.emit_serial(child, output)
            };
            node.set(lane, &child.root().bounds, link);
        }
        own.nodes[0].write(node);
        Link::node(own.base.nodes)
    }

    fn emit_leaf(&self, at: Subtree<'_>, output: &mut Output<'_>) -> Link {
        let items = &self.items[at.item..][..at.root().count as usize];
        let kind = items[0].kind();
        match kind {
            Kind::Triangle => {
                let own = output.take(&Counts { triangles: 1, ..Counts::default() });
                own.triangles[0].write(self.leaves.triangles(items));
                Link::leaf(kind, own.base.triangles)
            }
            Kind::MovingTriangle => {
                let own = output.take(&Counts { moving: 1, ..Counts::default() });
                own.moving[0].write(self.leaves.moving(items));
                Link::leaf(kind, own.base.moving)
            }
            Kind::Sphere => {
                let own = output.take(&Counts { spheres: 1, ..Counts::default() });
                own.spheres[0].write(self.leaves.spheres(items));
                Link::leaf(kind, own.base.spheres)
            }
            Kind::Instance | Kind::Curve | Kind::Ribbon | Kind::Solid => {
                Link::leaf(kind, items[0].index() as usize)
            }
        }
    }
}
