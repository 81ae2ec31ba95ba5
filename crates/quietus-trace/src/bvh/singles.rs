//! Primitives that have a leaf each: parts of curves, patches and quadrics.

use rayon::prelude::*;

use super::item::{Item, Kind};
use super::source::Placed;
use crate::desc::{CurveKind, CurveSegment, Curves, PatchMesh, Quadric};
use crate::geometry::curve::{self, CurvePart, MAX_PARTS, RibbonPart};
use crate::geometry::patch::{self, Corners};
use crate::geometry::quadric;

/// Segments in one scene's curves from which they are cut into fewer parts, which bounds their memory: half as many
/// from each of these on.
const MANY_SEGMENTS: [usize; 2] = [1 << 17, 1 << 19];

/// A patch or a quadric.
#[derive(Clone, Copy, Debug)]
pub(super) enum Solid {
    Patch(Corners),
    Quadric(Quadric),
}

/// All primitives that have a leaf each, in the order in which the scene lists them.
#[derive(Debug, Default)]
pub(super) struct Singles {
    pub(super) curves: Vec<CurvePart>,
    pub(super) ribbons: Vec<RibbonPart>,
    /// With what the references call them.
    pub(super) solids: Vec<(Solid, u32)>,
}

impl Singles {
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.curves) + size_of_val(&*self.ribbons) + size_of_val(&*self.solids)
    }

    /// Adds the parts of curves whose first segment is called `first`; `filtered` is added to what they are called.
    pub(super) fn curves(
        &mut self,
        placed: &Placed<'_>,
        curves: &Curves,
        first: usize,
        filtered: u32,
        items: &mut Vec<Item>,
    ) {
        let many = MANY_SEGMENTS.iter().filter(|&&many| curves.segments.len() >= many).count();
        let most = MAX_PARTS >> many;
        let placed_segments = curves.segments.par_iter().with_min_len(256).enumerate().map(|(i, segment)| {
            let segment = placed.segment(segment);
            let parts = curve::parts(&segment, most);
            (segment, (first + i) as u32 | filtered, parts)
        });
        let placed_segments: Vec<(CurveSegment, u32, u32)> = placed_segments.collect();
        for (segment, id, parts) in placed_segments {
            for part in 0..parts {
                let bounds = curve::bounds(&segment, part, parts);
                if curves.kind == CurveKind::Ribbon {
                    items.push(Item::new(bounds, self.ribbons.len() as u32, Kind::Ribbon));
                    self.ribbons.push(RibbonPart::new(&segment, part, parts, id));
                } else {
                    items.push(Item::new(bounds, self.curves.len() as u32, Kind::Curve));
                    self.curves.push(CurvePart::new(&segment, part, parts, id));
                }
            }
        }
    }

    /// Adds patches, of which the first is called `first`.
    pub(super) fn patches(
        &mut self,
        placed: &Placed<'_>,
        mesh: &PatchMesh,
        first: usize,
        filtered: u32,
        items: &mut Vec<Item>,
    ) {
        for (i, &corners) in mesh.patches.iter().enumerate() {
            let corners = corners.map(|index| placed.vertex(&mesh.positions, index));
            items.push(Item::new(patch::bounds(&corners), self.solids.len() as u32, Kind::Solid));
            self.solids.push((Solid::Patch(corners), (first + i) as u32 | filtered));
        }
    }

    /// Adds a quadric called `id`, which stands in its own space.
    pub(super) fn quadric(&mut self, quadric: &Quadric, id: u32, items: &mut Vec<Item>) {
        items.push(Item::new(quadric::bounds(quadric), self.solids.len() as u32, Kind::Solid));
        self.solids.push((Solid::Quadric(*quadric), id));
    }
}
