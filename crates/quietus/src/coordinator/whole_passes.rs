//! For renderers that draw a whole pass at once, as those on a GPU do, or that have a tile scheduler of their own:
//! sample counts per pixel out, errors per pixel in.

use std::ops::Range;

use super::{AdaptiveSampling, Settings, SettingsError, Start, statistics::Tally};
use crate::{
    PixelError, PixelRect, ReplicateMean, TILE_PIXELS,
    active_mask::pixels,
    protocol::{Mode, Skips, Turn},
};

/// Adaptive sampling by whole passes: each says what to draw in every pixel, and ends when all errors are in.
///
/// How a pass is drawn, in which order and by how many threads, is the renderer's. Each pass knows the errors of the one
/// before it, as [`Mode::Deterministic`] with a lag of 1 does; [`Settings::mode`] is not looked at. The price is a
/// barrier between passes, which [`AdaptiveSampling`]'s own workers do without.
///
/// ```
/// use quietus::{PixelError, Settings, WholePasses};
///
/// let (width, height) = (64, 48);
/// # fn noise(x: usize, n: u32) -> f32 { if n < 2 { f32::NAN } else { x as f32 * 1e-4 } }
/// let mut passes = WholePasses::new(Settings { max_samples: 128, ..Settings::new(width, height) })?;
/// let mut errors = vec![PixelError::ZERO; (width * height) as usize];
/// while let Some(pass) = passes.next_pass() {
///     // On a GPU: upload `pass.first()` and `pass.end()`, one thread to a pixel; read the errors back.
///     for (pixel, samples) in pass.work() {
///         let drawn = samples.end;
///         errors[pixel] = PixelError::from_f32(noise(pixel % width as usize, drawn));
///     }
///     pass.finish(&errors);
/// }
/// assert!(passes.sampling().is_finished());
/// # Ok::<(), quietus::SettingsError>(())
/// ```
#[derive(Debug)]
pub struct WholePasses {
    sampling: AdaptiveSampling,
    /// Number of the next pass.
    pass: u64,
    first: Vec<u32>,
    end: Vec<u32>,
}

/// What one pass draws. Pixels count row by row over the window: the crop, or the frame.
///
/// Sample s of a pixel, from 0 over all passes, belongs to replicate `s % R` of R, and is that replicate's sample `s / R`:
/// with the two replicates that are the default, samples take turns between the halves.
///
/// Dropped unfinished, a pass is dealt again as it was.
#[derive(Debug)]
pub struct WholePass<'a> {
    passes: &'a mut WholePasses,
}

impl WholePasses {
    /// Prepares to sample what `settings` ask for.
    ///
    /// # Errors
    /// Where the settings make no sense; the error says what would.
    pub fn new(settings: Settings) -> Result<Self, SettingsError> {
        Ok(Self::over(AdaptiveSampling::new(by_passes(settings))?))
    }

    /// Goes on from where an earlier sampling of the same window ended: [`AdaptiveSampling::resumed`].
    ///
    /// # Errors
    /// As [`AdaptiveSampling::resumed`].
    pub fn resumed(settings: Settings, start: &Start) -> Result<Self, SettingsError> {
        Ok(Self::over(AdaptiveSampling::resumed(by_passes(settings), start)?))
    }

    fn over(sampling: AdaptiveSampling) -> Self {
        let pixels = sampling.grid().rect().area() as usize;
        Self { sampling, pass: 0, first: vec![0; pixels], end: vec![0; pixels] }
    }

    /// The next pass that draws anything; `None` once the picture is finished or the sampling was stopped.
    pub fn next_pass(&mut self) -> Option<WholePass<'_>> {
        while self.sampling.outcome().is_none() {
            if self.plan() {
                return Some(WholePass { passes: self });
            }
            self.take_turns(|_| unreachable!("a pass that draws nothing has no errors"));
        }
        None
    }

    /// What the passes are dealt by: counts, errors, statistics, trees. Between passes one may
    /// [`stop`](AdaptiveSampling::stop) it.
    pub fn sampling(&self) -> &AdaptiveSampling {
        &self.sampling
    }

    /// Notes what the pass will draw; whether that is anything.
    fn plan(&mut self) -> bool {
        let (sampling, grid) = (&self.sampling, *self.sampling.grid());
        let mut draws = false;
        for tile in 0..grid.tiles() {
            let rect = grid.tile_rect(tile);
            let mask = sampling.pixels_to_draw(Turn { tile, pass: self.pass });
            draws |= mask != 0;
            for pixel in pixels(grid.full_mask(tile)) {
                let count = sampling.counts.pixel(tile, pixel);
                let is_drawn = mask >> pixel & 1 == 1;
                let end = if is_drawn { sampling.target_count(count, self.pass) } else { count };
                let index = index(&rect, grid.width(), pixel);
                (self.first[index], self.end[index]) = (count, end);
            }
        }
        draws
    }

    /// Takes every tile's turn in the pass; `errors` gives those of a tile that is drawn.
    fn take_turns(&mut self, errors: impl Fn(&PixelRect) -> [PixelError; TILE_PIXELS]) {
        let sampling = &self.sampling;
        let mut tally = Tally::default();
        for _ in 0..sampling.grid().tiles() {
            let Some(turn) = sampling.protocol.next_turn(&mut tally.idle_nanoseconds) else { break };
            debug_assert_eq!(turn.pass, self.pass, "nobody else takes turns");
            match sampling.mask_to_draw(turn) {
                0 => {
                    tally.skips += 1;
                    sampling.skip(Skips { tiles: &[turn.tile], pass: turn.pass });
                }
                mask => {
                    tally.visits += 1;
                    sampling.finish_visit(turn, mask, &errors(&sampling.grid().tile_rect(turn.tile)));
                }
            }
        }
        sampling.counters.add(&mut tally);
        self.pass += 1;
    }
}

impl WholePass<'_> {
    /// Number of the pass, from 0. Passes that draw nothing are passed over.
    pub fn pass(&self) -> u64 {
        self.passes.pass
    }

    /// Samples that each pixel has, over all replicates: where this pass goes on.
    pub fn first(&self) -> &[u32] {
        &self.passes.first
    }

    /// Samples that each pixel will have when this pass is drawn; as many as before where it is not drawn.
    pub fn end(&self) -> &[u32] {
        &self.passes.end
    }

    /// The pixels to draw, and which of their samples.
    pub fn work(&self) -> impl Iterator<Item = (usize, Range<u32>)> {
        let runs = self.first().iter().zip(self.end()).map(|(&first, &end)| first..end);
        runs.enumerate().filter(|(_, samples)| !samples.is_empty())
    }

    /// The error of a pixel from its replicates: [`AdaptiveSampling::pixel_error`].
    ///
    /// # Panics
    /// Where a replicate with samples has fewer than three channels.
    pub fn pixel_error(&self, replicates: &[ReplicateMean<'_>]) -> PixelError {
        self.passes.sampling.pixel_error(replicates)
    }

    /// Hands over the errors of all pixels of the window, now that the pass is drawn. Those of pixels that were not to be
    /// drawn are not looked at; they keep what they had.
    ///
    /// # Panics
    /// Where there is not one error for each pixel of the window.
    pub fn finish(self, errors: &[PixelError]) {
        let passes = self.passes;
        let (found, expected) = (errors.len(), passes.first.len());
        assert!(found == expected, "the window has {expected} pixels, but {found} errors came back");
        let width = passes.sampling.grid().width();
        passes.take_turns(|rect| {
            let mut tile = [PixelError::ZERO; TILE_PIXELS];
            for (row, y) in tile.chunks_exact_mut(crate::TILE_SIZE as usize).zip(rect.y0..rect.y1) {
                let first = y as usize * width as usize + rect.x0 as usize;
                let count = rect.width() as usize;
                row[..count].copy_from_slice(&errors[first..first + count]);
            }
            tile
        });
    }
}

/// Settings for passes that each know the one before.
fn by_passes(settings: Settings) -> Settings {
    Settings { mode: Mode::Deterministic { lag: 1 }, ..settings }
}

/// Where a tile's pixel is in the window, row by row.
fn index(tile: &PixelRect, width: u32, pixel: u8) -> usize {
    let (x, y) =
        (tile.x0 + u32::from(pixel) % crate::TILE_SIZE, tile.y0 + u32::from(pixel) / crate::TILE_SIZE);
    y as usize * width as usize + x as usize
}

#[cfg(all(test, not(any(loom, shuttle))))]
mod tests {
    use super::*;
    use crate::{PassSchedule, Policy};

    /// Noise that differs from pixel to pixel, and is known the better the more samples it comes from.
    fn error(pixel: usize, samples: u32) -> PixelError {
        let hash = (pixel as u32).wrapping_mul(0x9e37_79b9) ^ samples.wrapping_mul(0x85eb_ca6b);
        PixelError::from_f32(
            (hash >> 8) as f32 / (1 << 24) as f32 * if pixel.is_multiple_of(7) { 2.0 } else { 0.01 },
        )
    }

    fn settings(policy: Policy, width: u32, height: u32) -> Settings {
        let crop = Some(PixelRect::new(1, 2, width + 1, height + 2));
        let schedule = PassSchedule::new(1, 2, 1);
        let size = Settings::new(width + 3, height + 4);
        Settings { policy, crop, schedule, target_error: 0.02, max_samples: 333, ..size }
    }

    /// The same through visits of tiles.
    fn by_visits(settings: Settings) -> Vec<u32> {
        let sampling = AdaptiveSampling::new(settings).unwrap();
        let (window, width) = (sampling.settings().window(), sampling.grid().width());
        let mut counts = vec![0; window.area() as usize];
        let mut worker = sampling.worker();
        while let Some(visit) = worker.next_visit() {
            for work in visit.pixels() {
                let pixel = (work.y - window.y0) * width + work.x - window.x0;
                counts[pixel as usize] += work.samples.len() as u32;
            }
            let (rect, mut errors) = (visit.rect(), [PixelError::ZERO; TILE_PIXELS]);
            for pixel in pixels(visit.mask()) {
                let (x, y) =
                    (rect.x0 + u32::from(pixel) % 8 - window.x0, rect.y0 + u32::from(pixel) / 8 - window.y0);
                let at = (y * width + x) as usize;
                errors[usize::from(pixel)] = error(at, counts[at]);
            }
            visit.finish(&errors);
        }
        counts
    }

    #[test]
    fn draws_what_visits_of_tiles_draw() {
        use Policy as P;
        for policy in [P::Uniform, P::Tile, P::Dammertz, P::Pixel, P::Talk, P::Quietus, P::Unbiased] {
            for (width, height) in [(1, 1), (7, 3), (9, 17), (61, 40)] {
                let settings = settings(policy, width, height);
                let mut passes = WholePasses::new(settings.clone()).unwrap();
                let mut errors = vec![PixelError::REJECTED; (width * height) as usize];
                while let Some(pass) = passes.next_pass() {
                    for (pixel, samples) in pass.work() {
                        errors[pixel] = error(pixel, samples.end);
                    }
                    pass.finish(&errors);
                }
                assert!(passes.sampling().is_finished());
                let expected = by_visits(by_passes(settings));
                assert_eq!(passes.end, expected, "{policy:?} at {width}x{height}");
                assert_eq!(passes.sampling().counts().total(), expected.iter().map(|&n| u64::from(n)).sum());
            }
        }
    }

    #[test]
    fn runs_of_replicates_are_the_sample_numbers_they_divide() {
        for replicates in 1..4 {
            let counts = crate::SampleCounts::new(1, replicates);
            for total in [3, 4, 11, 23] {
                let (first, mut by_number) = (counts.pixel(0, 0), vec![Vec::new(); replicates as usize]);
                (first..total).for_each(|s| by_number[(s % replicates) as usize].push(s / replicates));
                let by_run: Vec<Vec<u32>> =
                    (0..replicates).map(|r| counts.run(0, 0, r, total).collect()).collect();
                assert_eq!(by_number, by_run);
                counts.advance(0, 0, total);
            }
        }
    }

    #[test]
    fn a_dropped_pass_comes_again_and_a_stop_ends_it() {
        let mut passes = WholePasses::new(Settings::new(20, 10)).unwrap();
        let first = passes.next_pass().map(|pass| pass.end().to_vec());
        assert_eq!(passes.next_pass().map(|pass| pass.end().to_vec()), first);
        passes.sampling().stop();
        assert!(passes.next_pass().is_none());
        assert_eq!(passes.sampling().counts().total(), 0);
    }

    #[test]
    #[should_panic(expected = "the window has 200 pixels, but 7 errors came back")]
    fn errors_of_another_window_are_refused() {
        let mut passes = WholePasses::new(Settings::new(20, 10)).unwrap();
        passes.next_pass().unwrap().finish(&[PixelError::ZERO; 7]);
    }
}
