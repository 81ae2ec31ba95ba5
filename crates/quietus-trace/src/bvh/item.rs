//! What trees are built over: primitives by their bounds, and the bounds of many.

use glam::{Vec4, Vec4Swizzles};
use rayon::prelude::*;

use super::Bounds;

/// Ranges larger than this are gone through by several threads.
pub(super) const PARALLEL: usize = 1 << 16;

/// What a leaf holds; a leaf holds one kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub(super) enum Kind {
    Triangle,
    Sphere,
    Instance,
    MovingTriangle,
    Curve,
    Ribbon,
    /// A patch or a quadric.
    Solid,
}

impl Kind {
    /// The kind of a number it was made of.
    #[inline(always)]
    pub(super) fn from_number(number: u32) -> Self {
        match number {
            0 => Self::Triangle,
            1 => Self::Sphere,
            3 => Self::MovingTriangle,
            4 => Self::Curve,
            5 => Self::Ribbon,
            6 => Self::Solid,
            _ => Self::Instance,
        }
    }

    /// Whether a leaf may hold several.
    pub(super) fn has_blocks(self) -> bool {
        matches!(self, Self::Triangle | Self::Sphere | Self::MovingTriangle)
    }
}

/// A primitive as the builder sees it: bounds, with an index and the kind in the fourth lanes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Item {
    pub(super) min: Vec4,
    pub(super) max: Vec4,
}

impl Item {
    pub(super) fn new(bounds: Bounds, index: u32, kind: Kind) -> Self {
        Self {
            min: bounds.min.extend(f32::from_bits(index)),
            max: bounds.max.extend(f32::from_bits(kind as u32)),
        }
    }

    pub(super) fn index(&self) -> u32 {
        self.min.w.to_bits()
    }

    pub(super) fn kind(&self) -> Kind {
        Kind::from_number(self.max.w.to_bits())
    }

    /// Whether its bounds are finite and hold something.
    pub(super) fn is_bounded(&self) -> bool {
        let (min, max) = (self.min.xyz(), self.max.xyz());
        min.is_finite() && max.is_finite() && min.cmple(max).all()
    }

    /// Twice the centroid.
    #[inline(always)]
    pub(super) fn center(&self) -> Vec4 {
        self.min + self.max
    }
}

/// Bounds whose fourth lanes mean nothing.
#[derive(Clone, Copy, Debug)]
pub(super) struct Box4 {
    pub(super) min: Vec4,
    pub(super) max: Vec4,
}

impl Box4 {
    pub(super) const EMPTY: Self = Self { min: Vec4::INFINITY, max: Vec4::NEG_INFINITY };

    #[inline(always)]
    pub(super) fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    #[inline(always)]
    pub(super) fn with(self, min: Vec4, max: Vec4) -> Self {
        Self { min: self.min.min(min), max: self.max.max(max) }
    }

    /// Half the surface area.
    #[inline(always)]
    pub(super) fn area(self) -> f32 {
        let d = self.max - self.min;
        d.x * d.y + d.y * d.z + d.z * d.x
    }

    pub(super) fn bounds(self) -> Bounds {
        Bounds { min: self.min.xyz(), max: self.max.xyz() }
    }
}

/// Bounds of a range, of its primitives and of their centroids (doubled).
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    pub(super) boxes: Box4,
    pub(super) centers: Box4,
}

impl Extent {
    pub(super) const EMPTY: Self = Self { boxes: Box4::EMPTY, centers: Box4::EMPTY };

    #[inline(always)]
    pub(super) fn add(&mut self, item: &Item) {
        self.boxes = self.boxes.with(item.min, item.max);
        let center = item.center();
        self.centers = self.centers.with(center, center);
    }

    #[inline(always)]
    pub(super) fn union(self, other: Self) -> Self {
        Self { boxes: self.boxes.union(other.boxes), centers: self.centers.union(other.centers) }
    }

    pub(super) fn of(items: &[Item]) -> Self {
        if items.len() > PARALLEL {
            let parts = items.par_chunks(PARALLEL / 4).map(Self::of);
            return parts.reduce(|| Self::EMPTY, Self::union);
        }
        let mut extent = Self::EMPTY;
        for item in items {
            extent.add(item);
        }
        extent
    }
}
