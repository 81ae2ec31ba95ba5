//! A binary tree by the surface area heuristic, and the plan by which it becomes an 8-wide one.
//!
//! Splits are chosen among bins of centroids on all three axes (Wald 2007, "On fast Construction of SAH-based
//! Bounding Volume Hierarchies"), in parallel for large ranges. On the way back up, dynamic programming finds
//! for each node the cheapest way to represent it by at most 1, 2, .. 7 roots of wide subtrees (Ylitie, Karras
//! and Laine 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", section 3.1).

use glam::Vec4;
use rayon::prelude::*;

use super::Bounds;
use super::item::{Box4, Extent, Item, PARALLEL};
use crate::isa::{Isa, Job, Level};

/// Children of a wide node.
pub(super) const WIDTH: usize = 8;
/// Most primitives in a leaf: one block.
pub(super) const LEAF: usize = 8;
/// Cost of testing a block of 8 primitives, in visits of a wide node. Measured.
const BLOCK_COST: f32 = 1.2;
/// Ranges of this size and less are not split further. Measured: splitting on costs build time and memory
/// for no faster rays.
const STOP: usize = 4;
/// Bins per axis for large ranges.
const BINS: usize = 16;
/// Depth from which ranges are halved instead, which bounds the depth to this plus the logarithm of their size.
const SAH_DEPTH: u32 = 64;
/// No tree is deeper: telling the kinds apart and halving 2^31 primitives until leaves take fewer than 40 levels.
pub(super) const MAX_DEPTH: usize = SAH_DEPTH as usize + 40;
/// Ranges larger than this are worth a task of their own.
const TASK: usize = 4096;

/// A node of the binary tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub(super) bounds: Bounds,
    /// Items below.
    pub(super) count: u32,
    /// Where its children are, side by side, in the nodes of its part; 0 in a leaf of the binary tree, and in a root
    /// whose children have parts of their own.
    left: u32,
    plan: Plan,
}

impl Node {
    /// Stands where a node will be.
    const BLANK: Self = Self { bounds: Bounds::EMPTY, count: 0, left: 0, plan: Plan(0) };

    /// Whether the wide tree has a leaf here.
    pub(super) fn is_leaf(&self) -> bool {
        self.plan.is_leaf()
    }
}

/// For 2 to 8 roots: how many of them go to the left child (3 bits each), 0 where one root fewer is no worse.
/// Bit 0: whether the single root is a leaf.
#[derive(Clone, Copy, Debug)]
struct Plan(u32);

impl Plan {
    fn is_leaf(self) -> bool {
        self.0 & 1 == 1
    }

    fn left_roots(self, roots: usize) -> usize {
        (self.0 >> (3 * roots) & 7) as usize
    }

    fn set_left_roots(&mut self, roots: usize, left: usize) {
        self.0 |= (left as u32) << (3 * roots);
    }
}

/// Cost of the cheapest representation by at most 1, 2, .. 7 roots.
type Costs = [f32; WIDTH - 1];

/// What one task has built.
struct Part {
    /// The root first.
    nodes: Vec<Node>,
    /// Where the root's children are, if they are not among the nodes.
    children: Option<Box<[Part; 2]>>,
}

/// A subtree of the binary tree: where its items start, and its root.
#[derive(Clone, Copy)]
pub(super) struct Subtree<'a> {
    pub(super) item: usize,
    part: &'a Part,
    node: usize,
}

impl<'a> Subtree<'a> {
    /// Its root.
    pub(super) fn root(self) -> &'a Node {
        &self.part.nodes[self.node]
    }

    /// The subtrees below its root, which is not a leaf of the binary tree.
    fn children(self) -> [Self; 2] {
        let of = |part: &'a Part, node| Self { item: self.item, part, node };
        let [left, right] = match &self.part.children {
            Some(parts) if self.node == 0 => parts.each_ref().map(|part| of(part, 0)),
            _ => {
                let left = self.root().left as usize;
                [of(self.part, left), of(self.part, left + 1)]
            }
        };
        [left, Self { item: self.item + left.root().count as usize, ..right }]
    }

    /// The roots of the wide subtrees below this one, the root of a wide node, left to right.
    pub(super) fn wide_children(self, mut each: impl FnMut(Self)) {
        self.descend(WIDTH, &mut each);
    }

    fn descend(self, mut roots: usize, each: &mut impl FnMut(Self)) {
        let plan = self.root().plan;
        while roots > 1 && plan.left_roots(roots) == 0 {
            roots -= 1;
        }
        if roots == 1 {
            return each(self);
        }
        let [left, right] = self.children();
        let left_roots = plan.left_roots(roots);
        left.descend(left_roots, each);
        right.descend(roots - left_roots, each);
    }
}

/// A binary tree.
pub(super) struct Tree(Part);

impl Tree {
    /// Sorts `items`, of which there is at least one, into the order of the tree's leaves.
    pub(super) fn build(items: &mut [Item]) -> Self {
        let extent = Extent::of(items);
        let mut scratch = Bins::EMPTY;
        Self(build_part(Level::detect(), items, extent, 0, &mut scratch).0)
    }

    /// All of it.
    pub(super) fn root(&self) -> Subtree<'_> {
        Subtree { item: 0, part: &self.0, node: 0 }
    }
}

/// Builds a subtree: by tasks of its own for both halves where it is large.
fn build_part(
    level: Level,
    items: &mut [Item],
    extent: Extent,
    depth: u32,
    scratch: &mut Bins,
) -> (Part, Costs) {
    let count = items.len();
    if count <= TASK {
        let mut nodes = Vec::with_capacity(count / 2 + 1);
        nodes.push(Node::BLANK);
        let costs = build_range(level, items, &mut nodes, 0, extent, depth, scratch);
        return (Part { nodes, children: None }, costs);
    }
    let (middle, left_extent, right_extent) = level.run(Partition { items, extent: &extent, depth, scratch });
    let (left, right) = items.split_at_mut(middle);
    let ((left, left_costs), (right, right_costs)) = rayon::join(
        || build_part(level, left, left_extent, depth + 1, scratch),
        || build_part(level, right, right_extent, depth + 1, &mut { Bins::EMPTY }),
    );
    let (plan, costs) = combine(&left_costs, &right_costs, extent.boxes.area(), f32::INFINITY);
    let root = Node { bounds: extent.boxes.bounds(), count: count as u32, left: 0, plan };
    (Part { nodes: vec![root], children: Some(Box::new([left, right])) }, costs)
}

/// Builds a subtree whose root is `nodes[at]`.
fn build_range(
    level: Level,
    items: &mut [Item],
    nodes: &mut Vec<Node>,
    at: usize,
    extent: Extent,
    depth: u32,
    scratch: &mut Bins,
) -> Costs {
    let count = items.len();
    let uniform = count <= LEAF && items.iter().all(|i| i.kind() == items[0].kind());
    let may_be_leaf = uniform && (items[0].kind().has_blocks() || count == 1);
    let bounds = extent.boxes.bounds();
    let leaf_cost = extent.boxes.area() * BLOCK_COST;
    if may_be_leaf && count <= STOP {
        nodes[at] = Node { bounds, count: count as u32, left: 0, plan: Plan(1) };
        return [leaf_cost; WIDTH - 1];
    }
    let (middle, left_extent, right_extent) = level.run(Partition { items, extent: &extent, depth, scratch });
    let left = nodes.len();
    nodes.extend([Node::BLANK; 2]);
    let (left_items, right_items) = items.split_at_mut(middle);
    let left_costs = build_range(level, left_items, nodes, left, left_extent, depth + 1, scratch);
    let right_costs = build_range(level, right_items, nodes, left + 1, right_extent, depth + 1, scratch);
    let leaf_cost = if may_be_leaf { leaf_cost } else { f32::INFINITY };
    let (plan, costs) = combine(&left_costs, &right_costs, extent.boxes.area(), leaf_cost);
    nodes[at] = Node { bounds, count: count as u32, left: left as u32, plan };
    costs
}

/// One step of the dynamic programme.
fn combine(left: &Costs, right: &Costs, area: f32, leaf_cost: f32) -> (Plan, Costs) {
    let mut plan = Plan(0);
    let split = |roots: usize| {
        let each = (1..roots).map(|k| (left[k - 1] + right[roots - k - 1], k));
        each.fold((f32::INFINITY, 1), |a, b| if b.0 < a.0 { b } else { a })
    };
    let (below, left_roots) = split(WIDTH);
    plan.set_left_roots(WIDTH, left_roots);
    let node_cost = area + below;
    // Areas of huge scenes overflow; an infinite cost then says no more that the range may be a leaf.
    if leaf_cost.is_finite() && leaf_cost <= node_cost {
        plan.0 |= 1;
    }
    let mut costs = [leaf_cost.min(node_cost); WIDTH - 1];
    for roots in 2..WIDTH {
        let (cost, left_roots) = split(roots);
        costs[roots - 1] = costs[roots - 2];
        if cost < costs[roots - 1] {
            costs[roots - 1] = cost;
            plan.set_left_roots(roots, left_roots);
        }
    }
    (plan, costs)
}

/// Splits a range of at least 2 items into two that are not empty; compiled for wide instructions.
struct Partition<'a> {
    items: &'a mut [Item],
    extent: &'a Extent,
    depth: u32,
    scratch: &'a mut Bins,
}

impl Job for Partition<'_> {
    /// Where the right side starts, and the extents of both.
    type Output = (usize, Extent, Extent);

    #[inline(always)]
    fn run<I: Isa>(self, _: I) -> Self::Output {
        let Self { items, extent, depth, scratch } = self;
        if depth < SAH_DEPTH
            && let Some(split) = find_split(items, extent, scratch)
        {
            let parts = partition_at(items, &split);
            if parts.0 > 0 && parts.0 < items.len() {
                return parts;
            }
        }
        split_evenly(items)
    }
}

/// For centroids all in one place, and for too deep trees. Kinds apart, so that small ranges become leaves.
#[cold]
fn split_evenly(items: &mut [Item]) -> (usize, Extent, Extent) {
    if items.iter().any(|i| i.kind() != items[0].kind()) {
        items.sort_unstable_by_key(|i| (i.kind() as u32, i.index()));
        let middle = items.partition_point(|i| i.kind() == items[0].kind());
        return halves(items, middle);
    }
    halves(items, items.len() / 2)
}

fn halves(items: &[Item], middle: usize) -> (usize, Extent, Extent) {
    (middle, Extent::of(&items[..middle]), Extent::of(&items[middle..]))
}

/// Maps centroids to bins, the same way for binning and partitioning.
#[derive(Clone, Copy)]
struct Binning {
    offset: Vec4,
    scale: Vec4,
    bins: usize,
}

impl Binning {
    #[inline(always)]
    fn new(centers: &Box4, count: usize) -> Self {
        let bins = BINS.min(4 + count / 16);
        let size = centers.max - centers.min;
        // Rounded to nearest, the least centroid falls into the first bin and the greatest into the last.
        let scale = Vec4::splat((bins - 1) as f32) / size;
        let flat = size.cmple(Vec4::splat(f32::MIN_POSITIVE));
        Self { offset: centers.min, scale: Vec4::select(flat, Vec4::ZERO, scale), bins }
    }

    #[inline(always)]
    fn bin(&self, item: &Item, axis: usize) -> usize {
        /// From here on floats are integers: a sum's last bits are the rounded addend.
        const MAGIC: f32 = 8_388_608.0;
        let center = item.min[axis] + item.max[axis];
        let b = (center - self.offset[axis]) * self.scale[axis] + MAGIC;
        // Masked, for centroids of such magnitude that differences overflow.
        b.to_bits() as usize & (BINS - 1)
    }

    /// As [`Binning::bin`], for all axes at once.
    #[inline(always)]
    fn bins(&self, item: &Item) -> [usize; 3] {
        const MAGIC: Vec4 = Vec4::splat(8_388_608.0);
        let b = (item.center() - self.offset) * self.scale + MAGIC;
        let mask = BINS - 1;
        [b.x.to_bits() as usize & mask, b.y.to_bits() as usize & mask, b.z.to_bits() as usize & mask]
    }
}

struct Split {
    binning: Binning,
    axis: usize,
    /// First bin of the right side.
    bin: usize,
}

#[derive(Clone, Copy)]
struct Bins {
    boxes: [[Box4; 3]; BINS],
    counts: [[u32; 3]; BINS],
}

impl Bins {
    const EMPTY: Self = Self { boxes: [[Box4::EMPTY; 3]; BINS], counts: [[0; 3]; BINS] };

    /// Fills the bins that `binning` uses.
    #[inline(always)]
    fn fill(&mut self, items: &[Item], binning: &Binning) {
        self.boxes[..binning.bins].fill([Box4::EMPTY; 3]);
        self.counts[..binning.bins].fill([0; 3]);
        for item in items {
            let [x, y, z] = binning.bins(item);
            self.add(x, 0, item);
            self.add(y, 1, item);
            self.add(z, 2, item);
        }
    }

    #[inline(always)]
    fn add(&mut self, bin: usize, axis: usize, item: &Item) {
        self.boxes[bin][axis] = self.boxes[bin][axis].with(item.min, item.max);
        self.counts[bin][axis] += 1;
    }

    fn merge(mut self, other: Self) -> Self {
        for b in 0..BINS {
            for axis in 0..3 {
                self.boxes[b][axis] = self.boxes[b][axis].union(other.boxes[b][axis]);
                self.counts[b][axis] += other.counts[b][axis];
            }
        }
        self
    }
}

/// A split before a bin, and what it costs.
#[derive(Clone, Copy)]
struct Candidate {
    cost: f32,
    axis: usize,
    bin: usize,
}

impl Bins {
    /// The cheapest split on one axis, or `best` where none is cheaper.
    #[inline(always)]
    fn best(&self, axis: usize, used: usize, mut best: Candidate) -> Candidate {
        let mut right_cost = [0.0; BINS];
        let (mut boxes, mut count) = (Box4::EMPTY, 0);
        for bin in (1..used).rev() {
            boxes = boxes.union(self.boxes[bin][axis]);
            count += self.counts[bin][axis];
            right_cost[bin] = if count == 0 { f32::INFINITY } else { boxes.area() * blocks(count) };
        }
        (boxes, count) = (Box4::EMPTY, 0);
        for (bin, right_cost) in right_cost.iter().enumerate().take(used).skip(1) {
            boxes = boxes.union(self.boxes[bin - 1][axis]);
            count += self.counts[bin - 1][axis];
            let cost = boxes.area() * blocks(count) + right_cost;
            if count > 0 && cost < best.cost {
                best = Candidate { cost, axis, bin };
            }
        }
        best
    }
}

/// The split of least area times number of blocks, None where all centroids share a bin on every axis.
#[inline(always)]
fn find_split(items: &[Item], extent: &Extent, bins: &mut Bins) -> Option<Split> {
    let binning = Binning::new(&extent.centers, items.len());
    let mut best = Candidate { cost: f32::INFINITY, axis: 0, bin: 0 };
    if items.len() > PARALLEL {
        let parts = items.par_chunks(PARALLEL / 4).map(|part| {
            let mut bins = Bins::EMPTY;
            bins.fill(part, &binning);
            bins
        });
        *bins = parts.reduce(|| Bins::EMPTY, Bins::merge);
    } else {
        bins.fill(items, &binning);
    }
    for axis in 0..3 {
        best = bins.best(axis, binning.bins, best);
    }
    let Candidate { cost, axis, bin } = best;
    (cost < f32::INFINITY).then_some(Split { binning, axis, bin })
}

/// What a number of items weighs: half blocks, since blocks are rarely full.
#[inline(always)]
fn blocks(count: u32) -> f32 {
    count.div_ceil(4) as f32
}

/// Reorders `items`: left of the split first. Returns their number and both extents.
#[inline(always)]
fn partition_at(items: &mut [Item], split: &Split) -> (usize, Extent, Extent) {
    let is_left = |item: &Item| split.binning.bin(item, split.axis) < split.bin;
    let (mut left, mut right) = (Extent::EMPTY, Extent::EMPTY);
    let (mut i, mut j) = (0, items.len());
    loop {
        while i < j && is_left(&items[i]) {
            left.add(&items[i]);
            i += 1;
        }
        while i < j && !is_left(&items[j - 1]) {
            j -= 1;
            right.add(&items[j]);
        }
        if i == j {
            return (i, left, right);
        }
        items.swap(i, j - 1);
    }
}
