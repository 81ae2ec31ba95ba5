//! The film itself: tiles behind their own locks.

use std::sync::{Mutex, MutexGuard, PoisonError};

use serde::{Deserialize, Serialize};

use crate::buffer::{TileBuffer, VisitAovs, VisitReplicate, VisitSummary};
use crate::layout::{Layout, TILE, TILE_PIXELS};
use crate::picture::Picture;
use crate::rejected::RejectedSamples;

/// One of the independent estimates of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Replicate {
    /// Sums of red, green, blue (linear Rec.709) and alpha over the accepted samples.
    pub sum: [f32; 4],
    /// Accepted samples.
    pub count: u32,
}

impl Replicate {
    /// Mean of red, green, blue and alpha; `None` without samples.
    pub fn mean(&self) -> Option<[f32; 4]> {
        (self.count > 0).then(|| self.sum.map(|sum| (f64::from(sum) / f64::from(self.count)) as f32))
    }

    /// Rounds once per visit: the visit's own sum is f64, so that thousands of small samples are not lost one by
    /// one against a large sum.
    fn add(&mut self, visit: &VisitReplicate) {
        self.count = self.count.saturating_add(visit.count);
        for (sum, more) in self.sum.iter_mut().zip(visit.sum) {
            *sum = (f64::from(*sum) + more) as f32;
        }
    }
}

/// Sums of albedo, normal and depth over the accepted samples of all replicates of a pixel, and of squares.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Aovs {
    sum: [f32; 7],
    /// Of alpha, albedo and normal.
    squares: [f32; 3],
    hits: u32,
}

impl Aovs {
    fn add(&mut self, visit: &VisitAovs) {
        self.hits = self.hits.saturating_add(visit.hits);
        let sums = self.sum.iter_mut().chain(&mut self.squares);
        for (sum, more) in sums.zip(visit.sum.iter().chain(&visit.squares)) {
            *sum = (f64::from(*sum) + more) as f32;
        }
    }

    /// The variances of one sample's alpha, albedo and normal, means over their channels, as far as sums in `f32` tell;
    /// `alpha` is the sum of alpha over the `count` samples.
    pub fn variances(&self, alpha: f64, count: u32) -> [f64; 3] {
        let count = f64::from(count.max(1));
        let length =
            |from: usize| self.sum[from..from + 3].iter().map(|&sum| (f64::from(sum) / count).powi(2)).sum();
        let means: [f64; 3] = [(alpha / count).powi(2), length(0), length(3)];
        let variance = |i: usize| (f64::from(self.squares[i]) / count - means[i]).max(0.0);
        [variance(0), variance(1) / 3.0, variance(2) / 3.0]
    }

    /// Mean albedo over `count` samples.
    pub fn albedo(&self, count: u32) -> [f32; 3] {
        [0, 1, 2].map(|i| mean(self.sum[i], count))
    }

    /// Mean normal over `count` samples: shorter than 1 where normals differ, or some samples hit nothing.
    pub fn normal(&self, count: u32) -> [f32; 3] {
        [3, 4, 5].map(|i| mean(self.sum[i], count))
    }

    /// Mean depth of the samples that hit something, 0 where none did.
    pub fn depth(&self) -> f32 {
        mean(self.sum[6], self.hits)
    }
}

fn mean(sum: f32, count: u32) -> f32 {
    if count == 0 { 0.0 } else { (f64::from(sum) / f64::from(count)) as f32 }
}

struct Tile {
    /// R in a row for each of the 64 pixels.
    replicates: Box<[Replicate]>,
    aovs: Box<[Aovs; TILE_PIXELS]>,
}

pub(crate) fn tile_bytes(replicates: usize) -> usize {
    size_of::<Mutex<Tile>>() + TILE_PIXELS * (replicates * size_of::<Replicate>() + size_of::<Aovs>())
}

/// A tile copied out under its lock: what a viewer or a writer sees.
pub struct TileCopy {
    /// The pixels it covers, in full-frame coordinates.
    pub window: crate::Window,
    replicates_per_pixel: usize,
    replicates: Box<[Replicate]>,
    aovs: Box<[Aovs; TILE_PIXELS]>,
}

impl TileCopy {
    /// The replicates of the pixel in `column` and `row` of the tile (0..8 each).
    pub fn replicates(&self, column: u32, row: u32) -> &[Replicate] {
        let first = (row * TILE + column) as usize * self.replicates_per_pixel;
        &self.replicates[first..][..self.replicates_per_pixel]
    }

    /// The other sums of that pixel.
    pub fn aovs(&self, column: u32, row: u32) -> &Aovs {
        &self.aovs[(row * TILE + column) as usize]
    }
}

/// All that a film holds, bit for bit: what another film goes on from.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FilmState {
    /// R in a row for each of the 64 pixels of each tile.
    replicates: Vec<Replicate>,
    /// One for each of the 64 pixels of each tile.
    aovs: Vec<Aovs>,
    rejected: RejectedSamples,
}

/// All tiles of a picture in the making. Threads share it by reference.
pub struct Film {
    layout: Layout,
    tiles: Vec<Mutex<Tile>>,
    rejected: Mutex<RejectedSamples>,
}

impl Film {
    /// An empty film.
    pub fn new(layout: Layout) -> Self {
        let [across, down] = layout.tiles();
        let tile = || {
            let replicates = vec![Replicate::default(); TILE_PIXELS * layout.replicates()];
            Mutex::new(Tile {
                replicates: replicates.into_boxed_slice(),
                aovs: Box::new([Aovs::default(); TILE_PIXELS]),
            })
        };
        let tiles = (0..across as usize * down as usize).map(|_| tile()).collect();
        Self { layout, tiles, rejected: Mutex::default() }
    }

    /// Where the film lies.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Adds what a visit to tile `index` collected, clears the buffer, and shows the tile's replicates (R in a row
    /// per pixel, 64 pixels row by row) and other sums to `look` under the same lock, for the pixel errors.
    ///
    /// # Panics
    /// When `index` is not below the number of tiles, or the buffer was made for another number of replicates.
    pub fn commit<T>(
        &self,
        index: usize,
        buffer: &mut TileBuffer,
        look: impl FnOnce(&[Replicate], &[Aovs; TILE_PIXELS]) -> T,
    ) -> (VisitSummary, T) {
        assert_eq!(buffer.replicates_per_pixel(), self.layout.replicates(), "buffer made for another film");
        let summary = buffer.summary();
        let seen = {
            let mut tile = lock(&self.tiles[index]);
            add_visit(&mut tile, buffer);
            look(&tile.replicates, &tile.aovs)
        };
        if summary.rejected > 0 {
            lock(&self.rejected).merge(buffer.rejected());
        }
        buffer.clear();
        (summary, seen)
    }

    /// Copies tile `index` out under its lock.
    ///
    /// # Panics
    /// When `index` is not below the number of tiles.
    pub fn tile(&self, index: usize) -> TileCopy {
        let tile = lock(&self.tiles[index]);
        TileCopy {
            window: self.layout.tile_window(index),
            replicates_per_pixel: self.layout.replicates(),
            replicates: tile.replicates.clone(),
            aovs: tile.aovs.clone(),
        }
    }

    /// Copies everything out. While nobody adds samples, as tile after tile is copied under its own lock.
    pub fn state(&self) -> FilmState {
        let pixels = self.tiles.len() * TILE_PIXELS;
        let mut replicates = Vec::with_capacity(pixels * self.layout.replicates());
        let mut aovs = Vec::with_capacity(pixels);
        for tile in &self.tiles {
            let tile = lock(tile);
            replicates.extend_from_slice(&tile.replicates);
            aovs.extend_from_slice(&*tile.aovs);
        }
        FilmState { replicates, aovs, rejected: self.rejected() }
    }

    /// A film that holds what another one held. `None` where that one was laid out otherwise.
    pub fn restored(layout: Layout, state: &FilmState) -> Option<Self> {
        let film = Self::new(layout);
        let pixels = film.tiles.len() * TILE_PIXELS;
        let per_tile = TILE_PIXELS * film.layout.replicates();
        let fits = state.aovs.len() == pixels && state.replicates.len() == film.tiles.len() * per_tile;
        if !fits || !state.rejected.is_possible() {
            return None;
        }
        let (aovs, _) = state.aovs.as_chunks();
        for ((tile, replicates), aovs) in film.tiles.iter().zip(state.replicates.chunks(per_tile)).zip(aovs) {
            let mut tile = lock(tile);
            tile.replicates.copy_from_slice(replicates);
            *tile.aovs = *aovs;
        }
        *lock(&film.rejected) = state.rejected.clone();
        Some(film)
    }

    /// The rejected samples so far.
    pub fn rejected(&self) -> RejectedSamples {
        lock(&self.rejected).clone()
    }

    /// Accepted samples of every pixel of the window, tile by tile.
    pub fn sample_counts(&self) -> Vec<u32> {
        let mut counts = Vec::with_capacity(self.layout.window().pixels());
        for (index, tile) in self.tiles.iter().enumerate() {
            let (tile, window) = (lock(tile), self.layout.tile_window(index));
            for row in 0..window.height() as usize {
                for column in 0..window.width() as usize {
                    let first = (row * TILE as usize + column) * self.layout.replicates();
                    let replicates = &tile.replicates[first..][..self.layout.replicates()];
                    counts.push(replicates.iter().fold(0, |sum: u32, r| sum.saturating_add(r.count)));
                }
            }
        }
        counts
    }

    /// Assembles the picture as it stands. `error` tells the remaining error of a pixel from its replicates.
    pub fn picture(&self, error: impl Fn(&[Replicate]) -> f32) -> Picture {
        let mut picture = Picture::empty(self.layout.frame(), self.layout.window());
        for index in 0..self.tiles.len() {
            let tile = self.tile(index);
            let window = tile.window;
            for (row, y) in (window.y0..window.y1).enumerate() {
                for (column, x) in (window.x0..window.x1).enumerate() {
                    let (column, row) = (column as u32, row as u32);
                    let replicates = tile.replicates(column, row);
                    picture.set(x, y, replicates, tile.aovs(column, row), error(replicates));
                }
            }
        }
        picture
    }
}

fn add_visit(tile: &mut Tile, buffer: &TileBuffer) {
    let per_pixel = buffer.replicates_per_pixel();
    for (pixel, replicates, aovs) in buffer.touched() {
        let target = &mut tile.replicates[pixel * per_pixel..][..per_pixel];
        target.iter_mut().zip(replicates).for_each(|(film, visit)| film.add(visit));
        tile.aovs[pixel].add(aovs);
    }
}

/// Nothing that can panic half-way changes a tile under its lock except `look`, which only reads: what a poisoned
/// lock guards is whole.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use quietus_trace::tile::{PixelWork, Sample, SampleSink};

    use super::*;
    use crate::Window;

    fn work(x: u32, y: u32, pixel: u8, replicate: u8) -> PixelWork {
        PixelWork { x, y, pixel, replicate, first: 0, count: 1 }
    }

    fn grey(value: f32) -> Sample {
        Sample { radiance: Vec3::splat(value), alpha: 1.0, depth: 2.0, ..Sample::default() }
    }

    #[test]
    fn the_picture_weighs_replicates_by_their_counts() {
        let film = Film::new(Layout::full(3, 2).unwrap());
        let mut buffer = TileBuffer::new(2);
        [1.0, 2.0, 3.0].iter().for_each(|&v| buffer.add(&work(1, 1, 9, 0), 0, &grey(v)));
        buffer.add(&work(1, 1, 9, 1), 0, &grey(10.0));
        let (summary, counts) = film.commit(0, &mut buffer, |r, _| [r[18].count, r[19].count]);
        assert_eq!(summary, VisitSummary { drawn: 4, rejected: 0 });
        assert_eq!(counts, [3, 1]);
        let picture = film.picture(|replicates| replicates[1].sum[0]);
        let index = picture.index(1, 1);
        assert_eq!(picture.beauty[index], [4.0, 4.0, 4.0, 1.0]);
        assert_eq!(picture.samples, [0, 0, 0, 0, 4, 0]);
        assert_eq!(picture.error[index], 10.0);
        assert_eq!(picture.depth[index], 2.0);
        assert_eq!(picture.beauty[0], [0.0; 4]);
    }

    #[test]
    fn a_film_goes_on_from_the_state_of_another() {
        let layout = || Layout::full(9, 3).unwrap();
        let film = Film::new(layout());
        let mut buffer = TileBuffer::new(2);
        buffer.add(&work(8, 1, 8, 1), 0, &grey(0.3));
        buffer.add(&work(8, 1, 8, 1), 1, &grey(f32::NAN));
        film.commit(1, &mut buffer, |_, _| ());
        let state = film.state();
        let other = Film::restored(layout(), &state).unwrap();
        assert_eq!(other.state(), state);
        let pictures = [&film, &other].map(|film| film.picture(|replicates| replicates[1].sum[0]));
        assert!(pictures[0] == pictures[1] && pictures[0].beauty[17][0] == 0.3);
        assert_eq!(other.rejected().count(), 1);
        assert!(Film::restored(Layout::full(9, 9).unwrap(), &state).is_none());
    }

    #[test]
    fn samples_that_are_not_finite_are_dropped_whole_and_reported() {
        let film = Film::new(Layout::new([40, 40], Window { x0: 30, y0: 20, x1: 40, y1: 40 }, 1).unwrap());
        let mut buffer = TileBuffer::new(1);
        let bad = [
            Sample { radiance: Vec3::new(0.0, f32::NAN, 0.0), ..Sample::default() },
            Sample { radiance: Vec3::new(f32::INFINITY, 0.0, 0.0), ..Sample::default() },
            Sample { depth: f32::NEG_INFINITY, ..Sample::default() },
            Sample { normal: Vec3::NAN, ..Sample::default() },
            Sample { radiance: Vec3::splat(f32::MAX), ..Sample::default() },
        ];
        bad.iter().enumerate().for_each(|(i, s)| buffer.add(&work(31, 22, 17, 0), i as u32, s));
        buffer.add(&work(31, 22, 17, 0), 5, &grey(0.5));
        let (summary, replicate) = film.commit(0, &mut buffer, |r, _| r[17]);
        assert_eq!(summary, VisitSummary { drawn: 6, rejected: 5 });
        assert_eq!(replicate, Replicate { sum: [0.5, 0.5, 0.5, 1.0], count: 1 });
        let rejected = film.rejected();
        assert_eq!(rejected.count(), 5);
        let first = rejected.first().next().unwrap();
        assert_eq!((first.x, first.y, first.replicate, first.index), (31, 22, 0, 0));
    }

    #[test]
    fn a_buffer_forgets_after_each_visit() {
        let film = Film::new(Layout::full(8, 8).unwrap());
        let mut buffer = TileBuffer::new(2);
        buffer.add(&work(0, 0, 0, 0), 0, &grey(1.0));
        buffer.add(&work(7, 7, 63, 1), 0, &grey(f32::NAN));
        film.commit(0, &mut buffer, |_, _| ());
        assert_eq!(buffer.summary(), VisitSummary::default());
        film.commit(0, &mut buffer, |_, _| ());
        assert_eq!(film.tile(0).replicates(0, 0)[0].count, 1);
        assert_eq!(film.rejected().count(), 1);
    }

    #[test]
    fn long_sums_of_small_samples_stay_exact_enough() {
        // 0.1 is not representable: 200,000 f32 additions drift by about 1e-3 of the sum, one rounding per visit
        // of 100 samples stays within 2,000 half-ulps.
        let film = Film::new(Layout::full(1, 1).unwrap());
        let mut buffer = TileBuffer::new(2);
        for _ in 0..2_000 {
            (0..100).for_each(|i| buffer.add(&work(0, 0, 0, 0), i, &grey(0.1)));
            film.commit(0, &mut buffer, |_, _| ());
        }
        let mean = film.tile(0).replicates(0, 0)[0].mean().unwrap()[0];
        assert!((mean - 0.1).abs() <= 0.1 * 2_000.0 * f32::EPSILON / 2.0, "{mean}");
    }

    #[test]
    fn a_film_takes_the_bytes_it_says() {
        let layout = Layout::full(9, 8).unwrap();
        assert_eq!(layout.film_bytes(), 2 * (64 * (2 * 20 + 44) + size_of::<Mutex<Tile>>() as u64));
    }
}
