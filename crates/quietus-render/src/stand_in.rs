//! Uniform sampling in passes, until the library's coordinator is there.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use quietus::{PixelError, TileGrid};

pub(crate) struct AdaptiveSampling {
    grid: TileGrid,
    next: AtomicU64,
    spp: u32,
    stopped: AtomicBool,
}

pub(crate) struct PixelRuns {
    pub x: u32,
    pub y: u32,
    pub pixel: u8,
    pub replicate: u32,
    pub samples: Range<u32>,
}

pub(crate) struct Visit {
    grid: TileGrid,
    tile: u32,
    samples: Range<u32>,
}

impl AdaptiveSampling {
    pub(crate) fn new(width: u32, height: u32, spp: u32) -> Self {
        let grid = TileGrid::new(width, height);
        Self { grid, next: AtomicU64::new(0), spp, stopped: AtomicBool::new(false) }
    }

    pub(crate) fn stop(&self) {
        self.stopped.store(true, Ordering::Relaxed);
    }

    pub(crate) fn next_visit(&self) -> Option<Visit> {
        let next = self.next.fetch_add(1, Ordering::Relaxed);
        let tiles = u64::from(self.grid.tiles());
        let pass = next / tiles;
        let each = self.spp / 2;
        let from = (pass * 4).min(u64::from(each)) as u32;
        let to = (from + 4).min(each);
        (from < to && !self.stopped.load(Ordering::Relaxed)).then(|| Visit {
            grid: self.grid,
            tile: (next % tiles) as u32,
            samples: from..to,
        })
    }

    pub(crate) fn converged_fraction(&self) -> f64 {
        0.0
    }
}

impl Visit {
    pub(crate) fn tile(&self) -> u32 {
        self.tile
    }

    pub(crate) fn pixels(&self) -> impl Iterator<Item = PixelRuns> + '_ {
        let rect = self.grid.tile_rect(self.tile);
        (rect.y0..rect.y1).flat_map(move |y| {
            (rect.x0..rect.x1).flat_map(move |x| {
                (0..2).map(move |replicate| PixelRuns {
                    x,
                    y,
                    pixel: ((y - rect.y0) * 8 + x - rect.x0) as u8,
                    replicate,
                    samples: self.samples.clone(),
                })
            })
        })
    }

    pub(crate) fn finish(self, _: &[PixelError; 64]) {}
}
