//! The render itself: worker threads, and one that watches.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use quietus::{AdaptiveSampling, Visit, Worker};
use quietus_film::{Film, Layout, LayoutError, TILE_PIXELS, TileBuffer};
use quietus_trace::tile::{PixelWork, TileCounts};

use crate::fault::{Fault, locate};
use crate::live::Live;
use crate::pixel_errors::{REPLICATES, tile_errors};
use crate::process;
use crate::progress::{Estimator, Progress};
use crate::settings::RenderSettings;
use crate::statistics::{LoggedRebuild, MOST_LOGGED, SampleStatistics, Statistics};
use crate::tracer::Tracer;

/// How often the watcher looks. Often enough for a smooth progress bar and a prompt Ctrl-C, too seldom to cost.
const WATCH_INTERVAL: Duration = Duration::from_millis(50);

/// How a caller watches and stops a render.
pub struct Control<'a> {
    /// Set to stop at the next visit boundary of each thread.
    pub cancel: &'a AtomicBool,
    /// Called about twenty times a second, from the thread that called [`render`].
    pub watch: &'a mut dyn FnMut(&Watched<'_>),
    /// Made for the same frame and window, where somebody wants to see tiles change or to hold the threads.
    pub live: Option<&'a Live>,
}

/// What a watcher sees of a running render. Film and sampling go on changing while it looks.
pub struct Watched<'a> {
    /// How far it is.
    pub progress: Progress,
    /// The film; each tile is copied out whole.
    pub film: &'a Film,
    /// The sampling: counts, errors, masks, trees.
    pub sampling: &'a AdaptiveSampling,
}

/// Why a render ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoppedBy {
    /// It was finished.
    Done,
    /// Its time was up.
    TimeLimit,
    /// [`Control::cancel`] was set.
    Cancelled,
}

/// A finished or stopped render.
pub struct Rendered {
    /// The film as it stands.
    pub film: Film,
    /// The sampling as it stands: sample counts, errors, trees.
    pub sampling: AdaptiveSampling,
    /// Its figures.
    pub statistics: Statistics,
    /// Why it ended.
    pub stopped_by: StoppedBy,
}

/// Why nothing was rendered.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// Frame or window out of range.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// Settings that the sampling refuses.
    #[error(transparent)]
    Settings(#[from] quietus::SettingsError),
    /// A thread could not be started.
    #[error("cannot start render thread {number}: {source}")]
    Thread {
        /// Which one, from 0.
        number: usize,
        /// What the system said.
        source: std::io::Error,
    },
    /// The tracer panicked.
    #[error("panic at pixel ({}, {}), replicate {}, sample {}: {}", .0.x, .0.y, .0.replicate, .0.index, .0.message)]
    Panicked(Fault),
}

/// One worker's counters, on a cache line of their own: only its thread writes them.
#[repr(align(128))]
#[derive(Default)]
struct Counters {
    samples: AtomicU64,
    rays: AtomicU64,
}

impl Counters {
    /// Relaxed: statistics order nothing; the final reading comes after the threads were joined.
    fn add(&self, samples: u64, counts: TileCounts) {
        self.samples.fetch_add(samples, Ordering::Relaxed);
        self.rays.fetch_add(counts.rays, Ordering::Relaxed);
    }
}

/// What all threads of a render share.
struct Shared<'a, T> {
    tracer: &'a T,
    settings: &'a RenderSettings,
    film: Film,
    sampling: AdaptiveSampling,
    live: Option<&'a Live>,
    counters: Vec<Counters>,
    fault: Mutex<Option<Fault>>,
    /// Threads still running, and the bell they ring when they end.
    running: Mutex<usize>,
    ended: Condvar,
}

/// Renders until the sampling is done, the time is up or the caller cancels.
///
/// # Errors
/// When frame or window are out of range, a thread cannot be started, or the tracer panics.
pub fn render<T: Tracer>(
    tracer: &T,
    settings: &RenderSettings,
    control: &mut Control<'_>,
) -> Result<Rendered, RenderError> {
    let layout = Layout::new(settings.frame, settings.window, REPLICATES)?;
    let shared = Shared {
        tracer,
        settings,
        film: Film::new(layout),
        sampling: AdaptiveSampling::new(settings.library(REPLICATES as u32))?,
        live: control.live,
        counters: (0..settings.threads.get()).map(|_| Counters::default()).collect(),
        fault: Mutex::default(),
        running: Mutex::new(0),
        ended: Condvar::new(),
    };
    let (start, cpu_start) = (Instant::now(), process::cpu_time());
    let stopped_by = std::thread::scope(|scope| {
        for number in 0..settings.threads.get() {
            *lock(&shared.running) += 1;
            let shared = &shared;
            let work = move || {
                let _ended = Ended(shared);
                shared.work(&shared.counters[number]);
            };
            let builder = std::thread::Builder::new().name(format!("render-{number}"));
            if let Err(source) = builder.spawn_scoped(scope, work) {
                *lock(&shared.running) -= 1;
                shared.sampling.stop();
                return Err(RenderError::Thread { number, source });
            }
        }
        Ok(shared.watch(start, control))
    })?;
    let wall = start.elapsed();
    if let Some(fault) = lock(&shared.fault).take() {
        return Err(RenderError::Panicked(fault));
    }
    let cpu = cpu_start.zip(process::cpu_time()).map(|(before, after)| after.saturating_sub(before));
    let statistics = shared.statistics(wall, cpu);
    // It may have finished just when it was told to stop.
    let stopped_by = if shared.sampling.is_finished() { StoppedBy::Done } else { stopped_by };
    Ok(Rendered { film: shared.film, sampling: shared.sampling, statistics, stopped_by })
}

impl<T: Tracer> Shared<'_, T> {
    /// One thread's life: visits until there are none.
    fn work(&self, counters: &Counters) {
        let mut buffer = TileBuffer::new(REPLICATES);
        let mut work = Vec::with_capacity(TILE_PIXELS * REPLICATES);
        let metric = self.sampling.settings().policy.metric();
        let mut worker = self.sampling.worker();
        while let Some(visit) = self.next_visit(&mut worker) {
            work.clear();
            work.extend(visit.pixels().map(|run| PixelWork {
                x: run.x,
                y: run.y,
                pixel: run.pixel,
                replicate: run.replicate,
                first: run.samples.start,
                count: run.samples.end - run.samples.start,
            }));
            // Whatever the buffer holds after a panic is thrown away with it: nothing broken is looked at.
            let draw = AssertUnwindSafe(|| self.tracer.render_tile(&work, &mut buffer));
            let counts = match catch_unwind(draw) {
                Ok(counts) => counts,
                Err(payload) => {
                    // Others may wait for this visit: it will not come back.
                    drop(visit);
                    let fault = locate(self.tracer, &work, payload.as_ref());
                    lock(&self.fault).get_or_insert(fault);
                    return;
                }
            };
            let (summary, errors) = self
                .film
                .commit(visit.tile() as usize, &mut buffer, |replicates| tile_errors(metric, replicates));
            counters.add(summary.drawn, counts);
            if let Some(live) = self.live {
                live.touch(visit.tile() as usize);
            }
            visit.finish(&errors);
        }
    }

    /// The next visit, once nobody holds the threads any more.
    fn next_visit<'w, 'a>(&self, worker: &'w mut Worker<'a>) -> Option<Visit<'w, 'a>> {
        if let Some(live) = self.live {
            live.pass_gate(|| self.sampling.outcome().is_some());
        }
        worker.next_visit()
    }

    /// Reports progress and stops the workers when the time is up or the caller says so.
    fn watch(&self, start: Instant, control: &mut Control<'_>) -> StoppedBy {
        let pixels = self.settings.window.pixels() as u64;
        let most = pixels as f64 * f64::from(self.settings.max_samples);
        let mut estimator = Estimator::new(pixels, Some(most), self.settings.time_limit);
        let mut stopped_by = StoppedBy::Done;
        let mut running = lock(&self.running);
        while *running > 0 {
            let left = self.settings.time_limit.map(|limit| limit.saturating_sub(self.elapsed(start)));
            let wait = left.filter(|left| !left.is_zero()).map_or(WATCH_INTERVAL, |l| l.min(WATCH_INTERVAL));
            running = match self.ended.wait_timeout(running, wait) {
                Ok((guard, _)) => guard,
                Err(poisoned) => poisoned.into_inner().0,
            };
            if *running == 0 {
                break;
            }
            drop(running);
            if stopped_by == StoppedBy::Done {
                stopped_by = self.stop_if_asked(start, control.cancel);
            }
            let converged = self.sampling.converged_fraction();
            let progress = estimator.reading(self.elapsed(start), self.samples(), self.rays(), converged);
            (control.watch)(&Watched { progress, film: &self.film, sampling: &self.sampling });
            running = lock(&self.running);
        }
        stopped_by
    }

    fn stop_if_asked(&self, start: Instant, cancel: &AtomicBool) -> StoppedBy {
        let late = self.settings.time_limit.is_some_and(|limit| self.elapsed(start) >= limit);
        // Relaxed: the flag guards no data.
        let stopped_by = match (cancel.load(Ordering::Relaxed), late) {
            (true, _) => StoppedBy::Cancelled,
            (false, true) => StoppedBy::TimeLimit,
            (false, false) => return StoppedBy::Done,
        };
        self.sampling.stop();
        stopped_by
    }

    /// Time since the render began, without pauses.
    fn elapsed(&self, start: Instant) -> Duration {
        start.elapsed().saturating_sub(self.live.map_or(Duration::ZERO, Live::paused_for))
    }

    fn samples(&self) -> u64 {
        self.counters.iter().map(|c| c.samples.load(Ordering::Relaxed)).sum()
    }

    fn rays(&self) -> u64 {
        self.counters.iter().map(|c| c.rays.load(Ordering::Relaxed)).sum()
    }

    fn statistics(&self, wall: Duration, cpu: Option<Duration>) -> Statistics {
        let sampling = self.sampling.statistics();
        let thread_seconds = wall.as_secs_f64() * self.settings.threads.get() as f64;
        let share = |nanoseconds: u64| nanoseconds as f64 * 1e-9 / thread_seconds.max(1e-9);
        let milliseconds = |nanoseconds: u64| nanoseconds as f64 * 1e-6;
        let slowest = sampling.slowest_rebuild();
        let rejected_pixels = self.sampling.rejected_pixels();
        let pixels = self.sampling.grid().rect().area() as f64;
        Statistics {
            wall_seconds: wall.as_secs_f64(),
            cpu_seconds: cpu.map(|cpu| cpu.as_secs_f64()),
            samples: self.samples(),
            rays: self.rays(),
            per_pixel: SampleStatistics::of(&self.film.sample_counts()),
            passes: sampling.passes,
            converged_fraction: (self.sampling.converged_fraction() - rejected_pixels as f64 / pixels)
                .max(0.0),
            rejected_pixels,
            rebuilds: sampling.rebuilds.len(),
            rebuild_ms_median: milliseconds(sampling.rebuild_nanoseconds_median()),
            rebuild_ms_max: slowest.map_or(0.0, |rebuild| milliseconds(rebuild.nanoseconds)),
            rebuild_log: sampling.rebuilds.iter().take(MOST_LOGGED).map(LoggedRebuild::new).collect(),
            tree_nodes_max: sampling.rebuilds.iter().map(|rebuild| rebuild.nodes).max().unwrap_or(0),
            lock_wait_fraction: share(sampling.lock_wait_nanoseconds),
            idle_fraction: share(sampling.idle_nanoseconds),
            visits: sampling.visits,
            skips: sampling.skips,
            reopened_pixels: sampling.reopened_pixels,
            reopened_regions: sampling.reopened_regions,
            noise_reached: None,
            noise_low: None,
            noise_high: None,
            nonfinite_samples: self.film.rejected().count(),
            peak_rss_bytes: process::peak_rss_bytes(),
        }
    }
}

/// Counts a thread out when it ends, however it ends; one that panics takes the others with it.
struct Ended<'a, T>(&'a Shared<'a, T>);

impl<T> Drop for Ended<'_, T> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.sampling.stop();
        }
        *lock(&self.0.running) -= 1;
        self.0.ended.notify_one();
    }
}

/// The locks here guard single values that are whole at any time, also after a panic.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
