//! One visit of a tile: which samples to draw, and the errors that come back.

use std::{fmt, ops::Range, time::Duration};

use super::{AdaptiveSampling, FinishRule, Worker};
use crate::{
    PixelError, PixelRect, TILE_PIXELS, TILE_SIZE, active_mask,
    protocol::{Outcome, Turn},
};

/// Samples to draw for one replicate of one pixel.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct PixelWork {
    /// Column in the full frame.
    pub x: u32,
    /// Row in the full frame, 0 at the top.
    pub y: u32,
    /// Place in the tile, row by row: 0..64.
    pub pixel: u8,
    /// Which replicate: 0 or 1, unless [`Settings::replicates`](crate::Settings::replicates) asks for more.
    pub replicate: u8,
    /// Sample indices, which go on where the replicate's last visit ended.
    pub samples: Range<u32>,
}

/// A tile that one thread has to itself until it [`finish`](Self::finish)es. A thread has one at a time: who wants to hold
/// many uses [`WholePasses`](crate::WholePasses).
///
/// Dropped unfinished, as happens where a renderer panics, it ends the sampling as
/// [`Outcome::Abandoned`]: other threads would wait for it for ever.
pub struct Visit<'w, 'a> {
    worker: &'w mut Worker<'a>,
    turn: Turn,
    mask: u64,
    is_finished: bool,
}

impl<'w, 'a> Visit<'w, 'a> {
    pub(super) fn new(worker: &'w mut Worker<'a>, turn: Turn, mask: u64) -> Self {
        Self { worker, turn, mask, is_finished: false }
    }

    /// Index of the tile in [`AdaptiveSampling::grid`].
    pub fn tile(&self) -> u32 {
        self.turn.tile
    }

    /// The pass, from 0.
    pub fn pass(&self) -> u64 {
        self.turn.pass
    }

    /// How long its worker has slept by now because nothing was eligible, all visits together.
    pub fn slept(&self) -> Duration {
        Duration::from_nanos(self.worker.slept_nanoseconds)
    }

    /// The pixels to draw, bit `8 y + x`; at least one.
    pub fn mask(&self) -> u64 {
        self.mask
    }

    /// The pixels of the tile, in the full frame.
    pub fn rect(&self) -> PixelRect {
        let window = self.sampling().settings.window();
        let PixelRect { x0, y0, x1, y1 } = self.sampling().grid().tile_rect(self.turn.tile);
        PixelRect::new(window.x0 + x0, window.y0 + y0, window.x0 + x1, window.y0 + y1)
    }

    /// What to draw: pixel after pixel, and the replicates of each. Runs without samples are left out.
    pub fn pixels(&self) -> impl Iterator<Item = PixelWork> + use<'a> {
        let sampling = self.sampling();
        let (turn, rect) = (self.turn, self.rect());
        active_mask::pixels(self.mask).flat_map(move |pixel| {
            let total = sampling.target_count(sampling.counts.pixel(turn.tile, pixel), turn.pass);
            let (dx, dy) = (u32::from(pixel) % TILE_SIZE, u32::from(pixel) / TILE_SIZE);
            (0..sampling.settings.replicates)
                .map(move |replicate| PixelWork {
                    x: rect.x0 + dx,
                    y: rect.y0 + dy,
                    pixel,
                    replicate: replicate as u8,
                    samples: sampling.counts.run(turn.tile, pixel, replicate, total),
                })
                .filter(|work| !work.samples.is_empty())
        })
    }

    /// Hands over the errors of the tile's pixels, row by row in 8 columns also where the picture's edge cuts the tile
    /// ([`PixelWork::pixel`] is the index), now that all of [`Self::pixels`] is drawn.
    /// Errors of pixels that were not to be drawn are not looked at; they keep what they had.
    pub fn finish(mut self, errors: &[PixelError; TILE_PIXELS]) {
        self.sampling().finish_visit(self.turn, self.mask, errors);
        self.is_finished = true;
    }

    fn sampling(&self) -> &'a AdaptiveSampling {
        self.worker.sampling
    }
}

impl fmt::Debug for Visit<'_, '_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Turn { tile, pass } = self.turn;
        let mut visit = f.debug_struct("Visit");
        visit.field("tile", &tile).field("pass", &pass);
        visit.field("mask", &format_args!("{:#018x}", self.mask)).finish_non_exhaustive()
    }
}

impl Drop for Visit<'_, '_> {
    fn drop(&mut self) {
        if !self.is_finished {
            self.sampling().protocol.end(Outcome::Abandoned);
        }
    }
}

impl AdaptiveSampling {
    /// Ends a turn in which the pixels of `mask` were drawn.
    pub(super) fn finish_visit(&self, turn: Turn, mask: u64, errors: &[PixelError; TILE_PIXELS]) {
        let before = self.plane(turn.pass.saturating_sub(1));
        let (mut merged, mut samples) = (before.load_tile(turn.tile), before.load_samples(turn.tile));
        for pixel in active_mask::pixels(mask) {
            let total = self.target_count(self.counts.pixel(turn.tile, pixel), turn.pass);
            self.counts.advance(turn.tile, pixel, total);
            (merged[usize::from(pixel)], samples[usize::from(pixel)]) = (errors[usize::from(pixel)], total);
        }
        let plane = self.plane(turn.pass);
        plane.store_tile(turn.tile, &merged);
        plane.store_samples(turn.tile, &samples);
        self.protocol.finish(turn, true, |update| self.update(update));
        if let FinishRule::AtRest(rest) = &self.finish {
            // After the regions were told that something was drawn, so that who finds the errors at rest knows.
            rest.end_drawing();
        }
    }
}
