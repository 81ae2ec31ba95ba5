//! One round of a render: worker threads that draw until the sampling has what it wants. And what a caller sees of it.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use quietus::{AdaptiveSampling, Visit, Worker};
use quietus_film::{Film, LayoutError, TILE_PIXELS, TileBuffer};
use quietus_trace::tile::{PixelWork, TileCounts};
use serde::{Deserialize, Serialize};

use crate::aov_demand::AovDemand;
use crate::costs::Costs;
use crate::crew;
use crate::fault::{Fault, locate};
use crate::live::Live;
use crate::noise::{Noise, OfAovs};
use crate::pixel_errors::{REPLICATES, tile_errors};
use crate::progress::Progress;
use crate::recording::Recording;
use crate::rounds::Past;
use crate::settings::Sampling;
use crate::statistics::Statistics;
use crate::timeline::Timeline;
use crate::tracer::Tracer;
use crate::weights::Weights;

/// How a caller watches and stops a render.
pub struct Control<'a> {
    /// Set to stop at the next visit boundary of each thread.
    pub cancel: &'a AtomicBool,
    /// Called about twenty times a second, from the thread that called [`crate::render`].
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
    /// Its noise, where noise was asked for.
    pub noise: Option<Noise>,
    /// That of alpha, albedo and normal, where one of them was asked for.
    pub aov_noise: OfAovs<Noise>,
    /// What kept it from what was asked for, if anything did.
    pub bound: Option<Bound>,
    /// What it takes to draw it again.
    pub recording: Recording,
    /// What its errors were weighted by.
    pub(crate) weights: Option<Arc<Weights>>,
    /// For [`crate::go_on`].
    pub(crate) past: Past,
}

/// A limit that keeps a picture from having the noise that was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Bound {
    /// The minimum of samples per pixel already makes it cleaner.
    MinSamples,
    /// With the maximum of samples per pixel it will be noisier.
    MaxSamples,
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
    /// A goal that the way of sampling cannot steer for.
    #[error("{sampling:?} sampling cannot be steered for {goal}: that takes quietus or uniform")]
    Goal {
        /// How samples are spread.
        sampling: Sampling,
        /// What was asked for.
        goal: &'static str,
    },
    /// Weights where samples are not dealt by errors that can be weighted.
    #[error("{0:?} sampling takes no weights: that takes quietus or uniform")]
    Weights(Sampling),
    /// Weights of another frame.
    #[error("expected weights for {}x{}, not for {}x{}", .frame[0], .frame[1], .weights[0], .weights[1])]
    WeightsSize {
        /// Width and height of the picture.
        frame: [u32; 2],
        /// Those of the weights.
        weights: [u32; 2],
    },
    /// A noise of alpha, albedo or normal where none of the picture is asked for.
    #[error("a noise of alpha, albedo or normal goes with one of the picture")]
    AovNoise,
    /// A noise out of range.
    #[error("expected a noise above 0, as a share of white, not {0}")]
    Noise(f64),
    /// A thread could not be started.
    #[error("cannot start render thread {number}: {source}")]
    Thread {
        /// Which one, from 0.
        number: usize,
        /// What the system said.
        source: std::io::Error,
    },
    /// A state or a recording that is not of this render.
    #[error("cannot go on: {0}")]
    State(#[from] quietus::Misfit),
    /// The tracer panicked.
    #[error("panic at pixel ({}, {}), replicate {}, sample {}: {}", .0.x, .0.y, .0.replicate, .0.index, .0.message)]
    Panicked(Fault),
}

/// One worker's counters, on a cache line of their own: only its thread writes them.
#[repr(align(128))]
#[derive(Default)]
pub(crate) struct Counters {
    samples: AtomicU64,
    rays: AtomicU64,
    nanoseconds: AtomicU64,
    /// Of the longest visit lately.
    longest: AtomicU64,
}

/// Share of what the longest visit took that is forgotten at every other one: an inverse power of two.
const FORGOTTEN: u64 = 64;

impl Counters {
    /// Relaxed: statistics order nothing; the final reading comes after the threads were joined.
    pub(crate) fn add(&self, samples: u64, counts: TileCounts, took: Duration) {
        self.samples.fetch_add(samples, Ordering::Relaxed);
        self.rays.fetch_add(counts.rays, Ordering::Relaxed);
        self.nanoseconds.fetch_add(took.as_nanos() as u64, Ordering::Relaxed);
    }

    /// Adds a visit that took so long. Only the worker itself may.
    fn add_visit(&self, samples: u64, counts: TileCounts, took: Duration) {
        self.add(samples, counts, took);
        let before = self.longest.load(Ordering::Relaxed);
        self.longest.store((before - before / FORGOTTEN).max(took.as_nanos() as u64), Ordering::Relaxed);
    }

    /// The longest visit lately: what it may take until all workers have stopped.
    pub(crate) fn longest_visit(all: &[Self]) -> Duration {
        Duration::from_nanos(all.iter().map(|c| c.longest.load(Ordering::Relaxed)).max().unwrap_or(0))
    }

    /// Samples and rays of all workers.
    pub(crate) fn sum(all: &[Self]) -> [u64; 2] {
        let sum = |of: fn(&Self) -> &AtomicU64| all.iter().map(|c| of(c).load(Ordering::Relaxed)).sum();
        [sum(|c| &c.samples), sum(|c| &c.rays)]
    }

    /// Seconds that all workers have spent drawing.
    pub(crate) fn seconds(all: &[Self]) -> f64 {
        all.iter().map(|c| c.nanoseconds.load(Ordering::Relaxed) as f64 * 1e-9).sum()
    }
}

/// What the threads of a round share.
pub(crate) struct Round<'a, T> {
    pub(crate) tracer: &'a T,
    pub(crate) film: &'a Film,
    pub(crate) sampling: &'a AdaptiveSampling,
    pub(crate) live: Option<&'a Live>,
    /// One for each thread.
    pub(crate) counters: &'a [Counters],
    /// What tiles cost.
    pub(crate) costs: &'a Costs,
    /// Where error matters more, and the place of the window in the frame.
    pub(crate) weights: Option<(&'a Weights, [u32; 2])>,
    /// What is asked of alpha, albedo and normals.
    pub(crate) aov_demand: Option<AovDemand>,
}

impl<T: Tracer> Round<'_, T> {
    /// Draws until the sampling ends. `watch` is called again and again meanwhile, at intervals that it returns; it may
    /// stop the sampling.
    pub(crate) fn run(&self, watch: impl FnMut() -> crew::Interval) -> Result<(), RenderError> {
        let fault = Mutex::new(None);
        crew::run(
            self.counters.len(),
            |number| {
                let _guard = StopOnPanic(self.sampling);
                self.work(&self.counters[number], &fault);
            },
            || self.sampling.stop(),
            watch,
        )?;
        let fault = lock(&fault).take();
        fault.map_or(Ok(()), |fault| Err(RenderError::Panicked(fault)))
    }

    /// One thread's life: visits until there are none.
    fn work(&self, counters: &Counters, fault: &Mutex<Option<Fault>>) {
        let mut buffer = TileBuffer::new(REPLICATES);
        let mut work = Vec::with_capacity(TILE_PIXELS * REPLICATES);
        let metric = self.sampling.settings().policy.metric();
        let mut worker = self.sampling.worker();
        let mut timeline = Timeline::new();
        while let Some(visit) = self.next_visit(&mut worker) {
            if let Some(timeline) = &mut timeline {
                timeline.begin(visit.pass(), visit.slept());
            }
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
            let began = Instant::now();
            let draw = AssertUnwindSafe(|| self.tracer.render_tile(&work, &mut buffer));
            let counts = match catch_unwind(draw) {
                Ok(counts) => counts,
                Err(payload) => {
                    // Others may wait for this visit: it will not come back.
                    drop(visit);
                    let found = locate(self.tracer, &work, payload.as_ref());
                    lock(fault).get_or_insert(found);
                    return;
                }
            };
            let (summary, mut errors) =
                self.film.commit(visit.tile() as usize, &mut buffer, |replicates, aovs| {
                    let mut errors = tile_errors(metric, replicates);
                    if let Some(demand) = &self.aov_demand {
                        demand.add(replicates, aovs, &mut errors);
                    }
                    errors
                });
            if let Some((weights, [x0, y0])) = self.weights {
                let rect = self.sampling.grid().tile_rect(visit.tile());
                weights.weigh([x0 + rect.x0, y0 + rect.y0], &mut errors);
            }
            let took = began.elapsed();
            counters.add_visit(summary.drawn, counts, took);
            self.costs.add(visit.tile(), summary.drawn, took);
            if let Some(live) = self.live {
                live.touch(visit.tile() as usize);
            }
            visit.finish(&errors);
            if let Some(timeline) = &mut timeline {
                timeline.finish(summary.drawn);
            }
        }
    }

    /// The next visit, once nobody holds the threads any more.
    fn next_visit<'w, 'a>(&self, worker: &'w mut Worker<'a>) -> Option<Visit<'w, 'a>> {
        if let Some(live) = self.live {
            live.pass_gate(|| self.sampling.outcome().is_some());
        }
        worker.next_visit()
    }
}

/// A thread that panics takes the others with it.
struct StopOnPanic<'a>(&'a AdaptiveSampling);

impl Drop for StopOnPanic<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.stop();
        }
    }
}

/// The locks here guard single values that are whole at any time, also after a panic.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl From<quietus::StateError> for RenderError {
    fn from(error: quietus::StateError) -> Self {
        match error {
            quietus::StateError::Settings(error) => error.into(),
            quietus::StateError::State(misfit) => misfit.into(),
        }
    }
}
