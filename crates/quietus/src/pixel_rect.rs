//! Rectangles on the image plane: whole pixels, and the real-valued areas of tree nodes.
//!
//! Coordinates are local to the sampled grid (the crop window), y down. Both kinds are half-open.

/// A half-open rectangle of whole pixels: `x0..x1` by `y0..y1`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PixelRect {
    /// Left edge, included.
    pub x0: u32,
    /// Top edge, included.
    pub y0: u32,
    /// Right edge, excluded.
    pub x1: u32,
    /// Bottom edge, excluded.
    pub y1: u32,
}

impl PixelRect {
    /// The rectangle `x0..x1` by `y0..y1`.
    pub const fn new(x0: u32, y0: u32, x1: u32, y1: u32) -> Self {
        Self { x0, y0, x1, y1 }
    }

    /// Width in pixels; 0 where the edges are in the wrong order.
    pub const fn width(&self) -> u32 {
        self.x1.saturating_sub(self.x0)
    }

    /// Height in pixels; 0 where the edges are in the wrong order.
    pub const fn height(&self) -> u32 {
        self.y1.saturating_sub(self.y0)
    }

    /// Number of pixels.
    pub const fn area(&self) -> u64 {
        self.width() as u64 * self.height() as u64
    }

    /// Whether it holds no pixel.
    pub const fn is_empty(&self) -> bool {
        self.width() == 0 || self.height() == 0
    }

    /// The pixels in both; empty where they are disjoint.
    pub fn intersection(&self, other: &Self) -> Self {
        let x0 = self.x0.max(other.x0);
        let y0 = self.y0.max(other.y0);
        Self { x0, y0, x1: self.x1.min(other.x1).max(x0), y1: self.y1.min(other.y1).max(y0) }
    }

    /// Whether the pixel lies inside.
    pub const fn contains(&self, x: u32, y: u32) -> bool {
        x >= self.x0 && x < self.x1 && y >= self.y0 && y < self.y1
    }

    /// Whether every pixel of `other` lies inside.
    pub const fn contains_rect(&self, other: &Self) -> bool {
        other.is_empty()
            || (other.x0 >= self.x0 && other.x1 <= self.x1 && other.y0 >= self.y0 && other.y1 <= self.y1)
    }
}

/// One of the two axes of the image plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Axis {
    /// Columns.
    X,
    /// Rows.
    Y,
}

/// A real-valued rectangle on the image plane: the area of a tree node (the talk, section 3.1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Area {
    /// Left edge.
    pub x0: f64,
    /// Top edge.
    pub y0: f64,
    /// Right edge.
    pub x1: f64,
    /// Bottom edge.
    pub y1: f64,
}

impl Area {
    /// Width, in pixels.
    pub fn width(&self) -> f64 {
        self.x1 - self.x0
    }

    /// Height, in pixels.
    pub fn height(&self) -> f64 {
        self.y1 - self.y0
    }

    /// Real-valued number of pixels, N of the region error.
    pub fn pixels(&self) -> f64 {
        self.width() * self.height()
    }

    /// The axis along which it is longer; X for a square.
    pub fn longer_axis(&self) -> Axis {
        if self.height() > self.width() { Axis::Y } else { Axis::X }
    }

    /// Length of the longer side, in pixels.
    pub fn longer_side(&self) -> f64 {
        self.width().max(self.height())
    }

    /// Bounds along an axis.
    pub fn bounds(&self, axis: Axis) -> (f64, f64) {
        match axis {
            Axis::X => (self.x0, self.x1),
            Axis::Y => (self.y0, self.y1),
        }
    }

    /// The two parts on either side of `position` on `axis`.
    pub fn split(&self, axis: Axis, position: f64) -> (Self, Self) {
        match axis {
            Axis::X => (Self { x1: position, ..*self }, Self { x0: position, ..*self }),
            Axis::Y => (Self { y1: position, ..*self }, Self { y0: position, ..*self }),
        }
    }

    /// The pixels it touches: bounds rounded **outward** (the talk, section 3.1), so that neighbours may share
    /// a pixel and none is lost between them. Edges lie at 0 or above.
    pub fn rounded_outward(&self) -> PixelRect {
        // By conversion, which truncates: `floor` and `ceil` are library calls on plain x86-64.
        let up = |edge: f64| {
            let down = edge as u32;
            down + u32::from(f64::from(down) < edge)
        };
        PixelRect { x0: self.x0 as u32, y0: self.y0 as u32, x1: up(self.x1), y1: up(self.y1) }
    }
}

impl From<PixelRect> for Area {
    fn from(rect: PixelRect) -> Self {
        Self { x0: rect.x0.into(), y0: rect.y0.into(), x1: rect.x1.into(), y1: rect.y1.into() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn rounding_outward_is_floor_and_ceiling(edges: [u16; 4], eighths: [bool; 4]) {
            let [x0, y0, x1, y1] =
                std::array::from_fn(|i| f64::from(edges[i]) + if eighths[i] { 0.125 } else { 0.0 });
            let rect = Area { x0, y0, x1, y1 }.rounded_outward();
            prop_assert_eq!(
                [rect.x0, rect.y0, rect.x1, rect.y1].map(f64::from),
                [x0.floor(), y0.floor(), x1.ceil(), y1.ceil()]
            );
        }
    }
}
