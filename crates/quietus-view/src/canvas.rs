//! The picture as the browsers are to have it: the bytes of every tile, and when each changed last.
//!
//! Who sends a tile asks for those that changed since it looked last, from a place where it left off. So a client costs
//! two numbers per layer, a slow one skips what was drawn over meanwhile, and nobody is waited for.

use quietus_film::Layout;

use crate::layer::{LAYERS, Layer};

/// One layer of all tiles.
struct Plane {
    bytes: Vec<u8>,
    /// The clock when each tile changed last, 0 for never.
    stamps: Vec<u64>,
}

/// All layers that somebody looks at.
pub(crate) struct Canvas {
    layout: Layout,
    planes: [Option<Plane>; LAYERS],
    clock: u64,
}

/// How far somebody has seen a layer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Cursor {
    /// All that changed up to then is known.
    since: u64,
    /// When the sweep that is under way began; what changes behind it is for the next one.
    began: u64,
    /// The tile the sweep goes on with.
    next: usize,
}

impl Canvas {
    /// Nothing on it yet.
    pub(crate) fn new(layout: Layout) -> Self {
        Self { layout, planes: [const { None }; LAYERS], clock: 0 }
    }

    fn tiles(&self) -> usize {
        let [across, down] = self.layout.tiles();
        across as usize * down as usize
    }

    /// Whether the layer is kept.
    pub(crate) fn has(&self, layer: Layer) -> bool {
        self.planes[layer as usize].is_some()
    }

    /// Keeps a layer from now on, empty at first.
    pub(crate) fn keep(&mut self, layer: Layer) {
        let tiles = self.tiles();
        self.planes[layer as usize].get_or_insert_with(|| Plane {
            bytes: vec![0; tiles * layer.tile_bytes()],
            stamps: vec![0; tiles],
        });
    }

    /// Keeps it no longer.
    pub(crate) fn forget(&mut self, layer: Layer) {
        self.planes[layer as usize] = None;
    }

    /// Takes a tile's new bytes. Nothing where the layer is not kept, or the bytes are what they were.
    pub(crate) fn store(&mut self, layer: Layer, tile: usize, bytes: &[u8]) {
        let Some(plane) = &mut self.planes[layer as usize] else { return };
        let place = &mut plane.bytes[tile * layer.tile_bytes()..][..layer.tile_bytes()];
        if plane.stamps[tile] == 0 || place != bytes {
            place.copy_from_slice(bytes);
            self.clock += 1;
            plane.stamps[tile] = self.clock;
        }
    }

    /// The next tiles that `cursor` has not seen, at most `most`, and moves it on behind them.
    pub(crate) fn unseen(&self, layer: Layer, cursor: &mut Cursor, most: usize) -> Vec<usize> {
        let mut found = Vec::new();
        let Some(plane) = &self.planes[layer as usize] else { return found };
        // The rest of a sweep may hold nothing; then the next one, over all tiles, tells.
        for _ in 0..2 {
            if found.is_empty() && cursor.since < self.clock {
                self.sweep(plane, cursor, most, &mut found);
            }
        }
        found
    }

    /// Goes on with a sweep, up to its end unless `found` is full before.
    fn sweep(&self, plane: &Plane, cursor: &mut Cursor, most: usize, found: &mut Vec<usize>) {
        if cursor.next == 0 {
            cursor.began = self.clock;
        }
        for tile in cursor.next..plane.stamps.len() {
            if found.len() == most {
                cursor.next = tile;
                return;
            }
            if plane.stamps[tile] > cursor.since {
                found.push(tile);
            }
        }
        *cursor = Cursor { since: cursor.began, began: cursor.began, next: 0 };
    }

    /// The bytes of a tile.
    ///
    /// # Panics
    /// When the layer is not kept.
    pub(crate) fn tile(&self, layer: Layer, tile: usize) -> &[u8] {
        let plane = self.planes[layer as usize].as_ref().expect("only kept layers have tiles to be seen");
        &plane.bytes[tile * layer.tile_bytes()..][..layer.tile_bytes()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn canvas() -> Canvas {
        let mut canvas = Canvas::new(Layout::full(40, 8).unwrap());
        canvas.keep(Layer::Active);
        canvas
    }

    fn store(canvas: &mut Canvas, tile: usize, value: u8) {
        canvas.store(Layer::Active, tile, &[value; 8]);
    }

    #[test]
    fn changes_are_seen_once_and_only_where_there_are_any() {
        let (mut canvas, mut cursor) = (canvas(), Cursor::default());
        assert_eq!(canvas.unseen(Layer::Active, &mut cursor, 9), [0; 0]);
        store(&mut canvas, 3, 0);
        store(&mut canvas, 1, 7);
        assert_eq!(canvas.unseen(Layer::Active, &mut cursor, 9), [1, 3]);
        assert_eq!(canvas.unseen(Layer::Active, &mut cursor, 9), [0; 0]);
        store(&mut canvas, 1, 7);
        store(&mut canvas, 3, 1);
        assert_eq!(canvas.unseen(Layer::Active, &mut cursor, 9), [3]);
        assert_eq!(canvas.tile(Layer::Active, 3), [1; 8]);
        assert_eq!(canvas.unseen(Layer::Beauty, &mut cursor, 9), [0; 0]);
    }

    #[test]
    fn a_sweep_goes_on_where_it_stopped_and_the_next_one_finds_what_changed_behind_it() {
        let (mut canvas, mut cursor) = (canvas(), Cursor::default());
        (0..5).for_each(|tile| store(&mut canvas, tile, 1));
        let mut next = |canvas: &Canvas| canvas.unseen(Layer::Active, &mut cursor, 2);
        assert_eq!(next(&canvas), [0, 1]);
        store(&mut canvas, 0, 2);
        store(&mut canvas, 4, 2);
        assert_eq!(next(&canvas), [2, 3]);
        assert_eq!(next(&canvas), [4]);
        // Tile 4 was seen with its last change, but only its stamp could tell: it comes once more.
        assert_eq!(next(&canvas), [0, 4]);
        assert_eq!(next(&canvas), [0; 0]);
    }
}
