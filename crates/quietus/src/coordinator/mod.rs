//! The coordinator: what a renderer's threads share, and the only place where algorithm and protocol meet.
//!
//! It never sees colours, rays, films, files or thread pools: threads ask for tile visits, draw what a visit
//! says, and hand back 64 pixel errors.

mod checks;
mod end;
mod region;
mod settings;
mod start;
mod state;
mod statistics;
#[cfg(all(test, not(any(loom, shuttle))))]
mod tests;
mod visit;
mod whole_passes;
mod worker;

pub use settings::{Checks, MAX_FRAME_PIXELS, Settings, SettingsError};
pub use start::Start;
pub use state::{Paused, RegionState, SamplingState, StateError};
pub use statistics::{RebuildRecord, Statistics};
pub use visit::{PixelWork, Visit};
pub use whole_passes::{WholePass, WholePasses};
pub use worker::Worker;

use std::fmt;

use crate::{
    ErrorPlane, PixelError, RegionTree, Regions, ReplicateMean, TILE_PIXELS, TileGrid,
    active_mask::pixels,
    inspect::tree_svg,
    morton::morton_order,
    policy::{Policy, RuleSettings, StoppingRule},
    protocol::{Mode, Outcome, Protocol},
    sample_counts::SampleCounts,
    spread::Spread,
    sync::Ordering,
};
use checks::TreeChecks;
use end::{PassLedger, Quiescence};
use region::Region;
use statistics::Counters;

/// Adaptive sampling of one picture, shared by reference among the renderer's own threads.
pub struct AdaptiveSampling {
    settings: Settings,
    regions: Regions,
    protocol: Protocol<Region>,
    checks: TreeChecks,
    /// Error planes by slot of the pass.
    planes: Box<[ErrorPlane]>,
    counts: SampleCounts,
    finish: FinishRule,
    counters: Counters,
    progress: Box<[region::Progress]>,
    /// Passes before whose end no tree is made.
    untreed_passes: u64,
    /// The pass whose size the first one has.
    first_pass: u64,
    /// Which pixels each pass draws until all have their minimum; `None` where it draws all of them.
    spread: Option<Spread>,
    /// Whether it goes on from pixels below the minimum of samples.
    lacks_minimum: bool,
    observer: Option<Observer>,
}

/// Is told of every rebuild.
type Observer = Box<dyn Fn(&RebuildRecord) + Send + Sync>;

/// When the picture is finished.
enum FinishRule {
    QuietPasses(PassLedger),
    AtRest(Box<Quiescence>),
}

impl AdaptiveSampling {
    /// Prepares to sample what `settings` ask for.
    ///
    /// # Errors
    /// Where the settings make no sense; the error says what would.
    pub fn new(settings: Settings) -> Result<Self, SettingsError> {
        Self::build(settings, None)
    }

    fn build(settings: Settings, start: Option<&Start>) -> Result<Self, SettingsError> {
        settings.validate()?;
        start.map_or(Ok(()), |start| start.check(&settings))?;
        let grid = settings.grid();
        let regions = Regions::new(grid, settings.regions_per_axis);
        let planes: Box<[_]> = (0..settings.mode.slots()).map(|_| ErrorPlane::new(grid)).collect();
        let mut rules = rules(&settings, &regions);
        if let Some(start) = start {
            planes.iter().for_each(|plane| start.fill(plane));
            rules.iter_mut().for_each(|rule| rule.update(&planes[0]));
        }
        let checks = TreeChecks::new(&settings, &regions, &rules);
        let states: Vec<_> =
            (0..).zip(rules).map(|(r, rule)| Region::new(&regions, r, rule, start.is_some())).collect();
        let spread = Spread::of(&settings.pass_counts());
        Ok(Self {
            progress: states.iter().map(Region::progress).collect(),
            protocol: protocol(&settings, &regions, states),
            checks,
            planes,
            counts: match start {
                Some(start) => start.counts(&grid, settings.replicates),
                None => SampleCounts::new(grid.tiles(), settings.replicates),
            },
            finish: match settings.mode {
                Mode::Deterministic { lag } => FinishRule::QuietPasses(PassLedger::new(regions.len(), lag)),
                Mode::FreeRunning => FinishRule::AtRest(Box::new(Quiescence::new(regions.len()))),
            },
            counters: Counters::default(),
            untreed_passes: untreed_passes(&settings),
            first_pass: match (start, &spread) {
                (None, _) => 0,
                (Some(start), None) => start.passes(&settings.pass_counts()),
                (Some(start), Some(spread)) => spread.first_pass(&grid, &start.samples),
            },
            spread,
            observer: None,
            lacks_minimum: start.is_some_and(|start| start.is_below(settings.min_samples, &grid)),
            regions,
            settings,
        })
    }

    /// Makes a mistake in the protocol on purpose, for tests that must catch it.
    #[doc(hidden)]
    #[cfg(any(test, loom, shuttle))]
    pub fn with_fault(mut self, fault: Option<crate::protocol::Fault>) -> Self {
        self.protocol = self.protocol.with_fault(fault);
        self
    }

    /// The same, but each rebuild is told to `observer`, on the thread that has just made it and while the tree's region
    /// is locked: it should be quick.
    pub fn observed_by(mut self, observer: impl Fn(&RebuildRecord) + Send + Sync + 'static) -> Self {
        self.observer = Some(Box::new(observer));
        self
    }

    /// The error of a pixel from its replicates, in the metric that the policy is made for ([`Policy::metric`]): channels are
    /// linear red, green and blue, and may have alpha behind them.
    ///
    /// # Panics
    /// Where a replicate with samples has fewer than three channels.
    pub fn pixel_error(&self, replicates: &[ReplicateMean<'_>]) -> PixelError {
        self.settings.policy.metric().pixel_error(replicates)
    }

    /// A handle for one of the renderer's threads.
    pub fn worker(&self) -> Worker<'_> {
        Worker::new(self)
    }

    /// Deals no more visits, from any thread at any time. Visits that are being drawn can still be finished.
    pub fn stop(&self) {
        self.protocol.end(Outcome::Stopped);
    }

    /// Whether the picture is finished: no pixel needs more samples.
    pub fn is_finished(&self) -> bool {
        self.outcome() == Some(Outcome::Finished)
    }

    /// Why no more visits are dealt; `None` while they are.
    pub fn outcome(&self) -> Option<Outcome> {
        self.protocol.outcome()
    }

    /// What was asked for.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The tiles of the window (the crop, or the frame).
    pub fn grid(&self) -> &TileGrid {
        self.regions.grid()
    }

    /// How many samples each replicate of each pixel has. Exact once the workers are done.
    pub fn counts(&self) -> &SampleCounts {
        &self.counts
    }

    /// The errors of a tile as of its last finished visit; zero before its first.
    pub fn errors(&self, tile: u32) -> [PixelError; TILE_PIXELS] {
        let visits = self.protocol.finished_visits(tile);
        self.plane(visits.saturating_sub(1)).load_tile(tile)
    }

    /// The active pixels of a tile, bit `8 y + x`, as of its home region's latest tree.
    pub fn active_mask(&self, tile: u32) -> u64 {
        let home = self.protocol.home(tile);
        let trees = self.protocol.published(home);
        self.checks.active(tile, home, trees.saturating_sub(1))
    }

    /// The share of pixels that are complete in the latest trees, in 0..=1. Pixels that stopped at the maximum of
    /// samples while their region was active are not among them; rejected pixels share the fate of their region, see [`Self::rejected_pixels`].
    pub fn converged_fraction(&self) -> f64 {
        // Relaxed: a progress report.
        let active: u64 = self.progress.iter().map(|p| p.active_pixels.load(Ordering::Relaxed)).sum();
        1.0 - active as f64 / self.grid().rect().area() as f64
    }

    /// Pixels in which sampling has stopped although they have no estimate, because their samples were rejected:
    /// [`Self::converged_fraction`] counts them, an honest report takes them off. Looks at every error, so it is for
    /// the end of a render rather than for its progress.
    pub fn rejected_pixels(&self) -> u64 {
        let rejected = |tile| {
            let errors = self.errors(tile);
            let stopped = self.grid().full_mask(tile) & !self.active_mask(tile);
            pixels(stopped).filter(|&pixel| errors[usize::from(pixel)].is_rejected()).count() as u64
        };
        (0..self.grid().tiles()).map(rejected).sum()
    }

    /// The samples that each pixel of a tile is to have as of its home region's latest tree, over all replicates and row
    /// by row; 0 outside the window. `None` where the policy deals no samples, or no tree was made yet.
    pub fn quotas(&self, tile: u32) -> Option<[f32; TILE_PIXELS]> {
        self.protocol.with_state(self.protocol.home(tile), |state| state.quotas(tile))
    }

    /// The latest tree of each region, `None` where the policy has none or it was not built yet.
    pub fn region_trees(&self) -> Vec<Option<RegionTree>> {
        (0..self.regions.len())
            .map(|region| self.protocol.with_state(region, |state| state.tree().cloned()))
            .collect()
    }

    /// An SVG drawing of the latest trees.
    pub fn tree_svg(&self) -> String {
        let trees = self.region_trees();
        tree_svg(&self.regions, trees.iter().map(Option::as_ref))
    }

    /// What happened so far. Workers add what they counted when they draw, sleep or end.
    pub fn statistics(&self) -> Statistics {
        let [visits, skips, idle_nanoseconds] = self.counters.load();
        let mut statistics = Statistics {
            visits,
            skips,
            idle_nanoseconds,
            passes: self.passes(),
            lock_wait_nanoseconds: self.checks.read_wait_nanoseconds(),
            ..Statistics::default()
        };
        for region in 0..self.regions.len() {
            self.protocol.with_state(region, |state| state.add_to(&mut statistics));
        }
        statistics
    }

    fn passes(&self) -> u64 {
        match &self.finish {
            FinishRule::QuietPasses(ledger) => ledger.complete(),
            FinishRule::AtRest(_) => self.protocol.tickets() / u64::from(self.grid().tiles()),
        }
    }

    /// The error plane of a pass.
    fn plane(&self, pass: u64) -> &ErrorPlane {
        &self.planes[(pass % self.planes.len() as u64) as usize]
    }

    /// The pixels that a tile's visit in `pass` may draw, whatever their counts.
    fn check(&self, tile: u32, pass: u64) -> u64 {
        // Tree `pass` - lag has the slot of tree `pass`, which is not made before this visit is finished. In the first
        // passes that slot holds what sampling started with: all pixels active, or the tree of an earlier sampling.
        self.checks.active(tile, self.protocol.home(tile), pass) | self.below_minimum(tile)
    }

    /// The pixels of a tile that lack samples from an earlier sampling's early end.
    fn below_minimum(&self, tile: u32) -> u64 {
        match self.lacks_minimum {
            true => self.below(tile, self.grid().full_mask(tile), self.settings.min_samples),
            false => 0,
        }
    }

    /// Those of `mask` that have not reached the maximum of samples.
    fn below_maximum(&self, tile: u32, mask: u64) -> u64 {
        self.below(tile, mask, self.settings.max_samples)
    }

    /// Those of `mask` that have fewer samples than that.
    fn below(&self, tile: u32, mask: u64, samples: u32) -> u64 {
        pixels(mask)
            .filter(|&pixel| self.counts.pixel(tile, pixel) < samples)
            .fold(0, |below, pixel| below | 1 << pixel)
    }

    /// Those of `mask` that it is the turn of, where pixels take turns.
    fn due(&self, tile: u32, pass: u64, mask: u64) -> u64 {
        let Some(spread) = &self.spread else { return mask };
        pixels(mask)
            .filter(|&pixel| spread.is_due(pixel, self.counts.pixel(tile, pixel), self.first_pass + pass))
            .fold(0, |due, pixel| due | 1 << pixel)
    }

    /// Whether pixels are still taking turns in a pass, so that one that draws nothing says nothing.
    fn is_spreading(&self, pass: u64) -> bool {
        self.spread.as_ref().is_some_and(|spread| self.first_pass + pass < spread.passes())
    }

    /// What a pixel of `count` samples is to have after pass `pass`, over all replicates.
    fn target_count(&self, count: u32, pass: u64) -> u32 {
        let counts = self.settings.pass_counts();
        match self.settings.policy {
            Policy::Quietus => counts.next(count),
            _ if self.spread.is_some() => counts.next(count),
            _ => counts.grown(count, self.first_pass + pass),
        }
    }
}

/// The policy's state in each region.
fn rules(settings: &Settings, regions: &Regions) -> Vec<Box<dyn StoppingRule>> {
    let frame = f64::from(settings.width) * f64::from(settings.height);
    let rule_settings = RuleSettings {
        regions: regions.clone(),
        target_error: settings.target_error,
        frame_area: settings.frame_area.unwrap_or(frame),
        rebuild: settings.rebuild,
        counts: settings.pass_counts(),
    };
    (0..regions.len()).map(|region| settings.policy.rule(&rule_settings, region)).collect()
}

/// Visits in Morton order of the tiles that the regions share.
fn protocol(settings: &Settings, regions: &Regions, states: Vec<Region>) -> Protocol<Region> {
    let tiles = 0..regions.grid().tiles();
    let homes: Vec<u32> = tiles.clone().map(|tile| regions.home(tile)).collect();
    let containing: Vec<Vec<u32>> = tiles.map(|tile| regions.containing(tile).collect()).collect();
    Protocol::new(settings.mode, morton_order(regions.grid()), &homes, &containing, states)
}

impl fmt::Debug for AdaptiveSampling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { settings, .. } = self;
        let (outcome, passes) = (self.outcome(), self.passes());
        f.debug_struct("AdaptiveSampling")
            .field("settings", settings)
            .field("passes", &passes)
            .field("outcome", &outcome)
            .finish_non_exhaustive()
    }
}

/// Passes before whose end no tree is made: those that bring every pixel to its minimum, so that a region is not
/// called complete before. With the policy `quietus` fewer, as tree k takes effect in pass k + lag.
fn untreed_passes(settings: &Settings) -> u64 {
    let passes = settings.pass_counts().min_passes();
    match settings.mode {
        Mode::Deterministic { lag } if settings.policy == Policy::Quietus => {
            (passes + 1).saturating_sub(lag.into()).max(1)
        }
        _ => passes,
    }
}
