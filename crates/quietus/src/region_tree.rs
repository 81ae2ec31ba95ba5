//! The explicit binary tree over the image plane, rebuilt from scratch at each update (the talk, sections 2, 3).
//!
//! Its root is the whole area it answers for. Nodes are split where the error on both sides is equal; leaves and
//! inner nodes can be marked complete. Nothing is ever removed: because every update starts from the errors as
//! they are now, a newly found feature pulls the split lines towards itself, and neighbours that were complete
//! get area that is not, and are sampled again.

use crate::{PixelRect, active_mask, pixel_rect::Area, region_error::region_error, summed_area::ErrorSums};

/// A node is complete only where its longer side is below this many pixels: a large quiet area is split further,
/// so that a feature found in it later re-opens little.
pub const MAX_COMPLETE_SIDE: f64 = 16.0;

/// The least length of a side after a split, in pixels: the square root of the golden ratio, an irrational
/// number, so that splits never line up with pixels or tiles.
pub const MIN_SIDE: f64 = 1.272_019_649_514_069;

/// A node is split where its error is below this many times the target: before, its errors are too uncertain to
/// tell where to split (Dammertz et al. 2010).
pub const SPLIT_FACTOR: f64 = 256.0;

/// What decides a tree's shape beside the errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TreeSettings {
    /// The region error below which a small node is complete; above 0.
    pub target_error: f64,
    /// Pixels in the frame, N_img of the region error.
    pub frame_area: f64,
    /// Where splits may fall.
    pub split: Split,
}

/// Where splits may fall.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Split {
    /// Anywhere: in floating point (the talk, section 3.1).
    #[default]
    Continuous,
    /// On pixel boundaries (Dammertz et al. 2010). The talk gives the reason against it: the position is a step
    /// function of the errors, which newly found ones may not move at all.
    Integer,
}

/// A node of the tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// Its real-valued part of the image plane.
    pub area: Area,
    /// Its region error.
    pub error: f64,
    /// Index of the first of its two children, which stand side by side after their parent.
    pub children: Option<u32>,
    /// Whether sampling may stop in all of it.
    pub complete: bool,
}

/// The tree of one region.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RegionTree {
    nodes: Vec<Node>,
}

impl RegionTree {
    /// Builds the tree anew over the bounds of `sums`; memory of an earlier use is kept.
    ///
    /// Of each node, its error e_R, and its longer side s:
    /// - complete where `e_R < eps` and `s < 16`;
    /// - else split along the longer axis where `e_R < 256 eps` and `s > 2 * 1.272`;
    /// - else an active leaf.
    pub fn rebuild(&mut self, sums: &impl ErrorSums, settings: &TreeSettings) {
        self.grow(sums.bounds().into(), (), |area, ()| {
            // The sum runs over all pixels of the outward-rounded rectangle and is set against the real-valued area,
            // as published practice has it.
            let sum = sums.sum(&area.rounded_outward());
            let error = region_error(sum, area.pixels(), settings.frame_area);
            let side = area.longer_side();
            let complete = error < settings.target_error && side < MAX_COMPLETE_SIDE;
            let splits = !complete && error < SPLIT_FACTOR * settings.target_error && side > 2.0 * MIN_SIDE;
            let split = splits.then(|| (split_position(area, sums, sum, settings.split), ()));
            Grown { error, complete, split }
        });
    }

    /// Builds the tree anew from `root` down, by what `judge` says of each node's area and of what its parent has
    /// left to it: `inheritance` for the root.
    pub(crate) fn grow<I: Copy>(
        &mut self,
        root: Area,
        inheritance: I,
        mut judge: impl FnMut(&Area, I) -> Grown<I>,
    ) {
        self.nodes.clear();
        // Depth first: a node's children are split while its part of the sums is still in the cache.
        let mut open = Vec::with_capacity(64);
        let mut add = |nodes: &mut Vec<Node>, open: &mut Vec<_>, area: Area, inheritance| {
            let Grown { error, complete, split } = judge(&area, inheritance);
            open.extend(split.map(|split| (nodes.len(), split)));
            nodes.push(Node { area, error, children: None, complete });
        };
        add(&mut self.nodes, &mut open, root, inheritance);
        while let Some((index, (position, inheritance))) = open.pop() {
            let area = self.nodes[index].area;
            let (first, second) = area.split(area.longer_axis(), position);
            self.nodes[index].children = Some(self.nodes.len() as u32);
            add(&mut self.nodes, &mut open, first, inheritance);
            add(&mut self.nodes, &mut open, second, inheritance);
        }
        self.mark_complete_parents();
    }

    /// Decides anew which leaves are complete, by their areas.
    pub(crate) fn mark_complete(&mut self, is_complete: impl Fn(&Area) -> bool) {
        for leaf in self.nodes.iter_mut().filter(|node| node.children.is_none()) {
            leaf.complete = is_complete(&leaf.area);
        }
        self.mark_complete_parents();
    }

    /// Inner nodes are complete when both children are. Children stand after their parents.
    fn mark_complete_parents(&mut self) {
        for index in (0..self.nodes.len()).rev() {
            if let Some(first) = self.nodes[index].children {
                let first = first as usize;
                self.nodes[index].complete = self.nodes[first].complete && self.nodes[first + 1].complete;
            }
        }
    }

    /// All nodes, the root first, parents before their children.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The leaves, in no particular order.
    pub fn leaves(&self) -> impl Iterator<Item = &Node> {
        self.nodes.iter().filter(|node| node.children.is_none())
    }

    /// Whether sampling may stop everywhere. A tree that was never built is not complete.
    pub fn is_complete(&self) -> bool {
        self.nodes.first().is_some_and(|root| root.complete)
    }

    /// The pixels of a tile that are covered by a leaf that is not complete: the talk's check of a tile against
    /// the tree. A tile completely within a complete node yields 0 and is skipped. A tree that was never built
    /// leaves all pixels active.
    pub fn active(&self, tile: &PixelRect) -> u64 {
        if self.nodes.is_empty() {
            return active_mask::rect_in_tile(tile, tile);
        }
        self.active_below(0, tile)
    }

    fn active_below(&self, index: u32, tile: &PixelRect) -> u64 {
        let node = &self.nodes[index as usize];
        let rect = node.area.rounded_outward();
        if node.complete || rect.intersection(tile).is_empty() {
            return 0;
        }
        match node.children {
            None => active_mask::rect_in_tile(tile, &rect),
            Some(first) => self.active_below(first, tile) | self.active_below(first + 1, tile),
        }
    }

    /// Calls `draw` with the pixels of each leaf that is not complete; together they are the active pixels.
    pub fn for_each_active(&self, mut draw: impl FnMut(&PixelRect)) {
        for leaf in self.leaves().filter(|leaf| !leaf.complete) {
            draw(&leaf.area.rounded_outward());
        }
    }
}

/// What became of a node, and of its children's inheritance.
pub(crate) struct Grown<I> {
    /// Its error.
    pub(crate) error: f64,
    /// Whether it is complete, where it stays a leaf.
    pub(crate) complete: bool,
    /// Where its longer axis is to be split, and what its children inherit; `None` for a leaf.
    pub(crate) split: Option<(f64, I)>,
}

/// Where, on its longer axis, the error on both sides is equal: the half-way point of the running sum of marginal errors, linear
/// inside the column (row) that holds it, clamped so that each side keeps at least [`MIN_SIDE`]. The middle,
/// where there is no error at all. `total` is the sum of the errors.
pub(crate) fn split_position(area: &Area, sums: &impl ErrorSums, total: u64, split: Split) -> f64 {
    let axis = area.longer_axis();
    let (start, end) = area.bounds(axis);
    let rect = area.rounded_outward();
    let position = match sums.half_way(&rect, axis, total) {
        // (total / 2 - before) / within, with the halves taken last so that the integers stay exact.
        Some(half) => f64::from(half.index) + (total - 2 * half.before) as f64 / (2 * half.within) as f64,
        None => 0.5 * (start + end),
    };
    match split {
        Split::Continuous => position.clamp(start + MIN_SIDE, end - MIN_SIDE),
        Split::Integer => position.round().clamp(start.floor() + 1.0, end.ceil() - 1.0),
    }
}
