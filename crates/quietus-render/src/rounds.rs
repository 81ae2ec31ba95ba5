//! A render: rounds of sampling over one film, each to a target that the ones before have set.
//!
//! A round is one [`AdaptiveSampling`] that runs until it is done; the next goes on from there with larger quotas.
//! Between rounds the [`Steering`] looks at the film, and at noise that is measured with fresh samples, and says how
//! much larger. A goal that needs none of this has one round.
//!
//! Nothing here depends on threads: with a goal that does not depend on time, the picture does not either.

mod decision;
mod past;

use std::time::{Duration, Instant};

use quietus::{AdaptiveSampling, Start};
use quietus_film::Film;
use quietus_trace::tile::TileCounts;

use crate::aov_demand::AovDemand;
use crate::checkpoint::{Keeper, RenderState};
use crate::clock::Clock;
use crate::costs::Costs;
use crate::live::Live;
use crate::noise::{Copied, Noise};
use crate::outlook::{Outlook, Seen};
use crate::pixel_errors::REPLICATES;
use crate::process;
use crate::progress::{Drawn, Estimator};
use crate::recording::{Recording, Round as PastRound};
use crate::run::{Bound, Control, Counters, RenderError, Rendered, Round, StoppedBy, Watched};
use crate::settings::{Goal, Machinery, RenderSettings, Sampling};
use crate::steering::{Aim, Steering};
use crate::timeline;
use crate::tracer::Tracer;
use decision::Decision;
pub(crate) use past::Past;
use past::{Begun, Kept, PastRounds};

/// What a render goes on from, and what it leaves for others to go on from.
#[derive(Default)]
pub struct Keeping {
    /// Goes on from this state, of a render with the same scene and settings. Goals and limits may be others: where they
    /// are, another round begins.
    pub from: Option<RenderState>,
    /// Saves the state from time to time, and at the end, whatever the end is.
    pub keeper: Option<Keeper>,
    /// Draws again what was drawn when this was recorded, whatever time it takes.
    pub replay: Option<Recording>,
}

/// Renders until the goal is reached, the time is up or the caller cancels.
///
/// # Errors
/// When frame or window are out of range, the way of sampling cannot be steered for the goal, a thread cannot be
/// started, or the tracer panics.
pub fn render<T: Tracer>(
    tracer: &T,
    settings: &RenderSettings,
    control: &mut Control<'_>,
) -> Result<Rendered, RenderError> {
    render_keeping(tracer, settings, control, &mut Keeping::default())
}

/// As [`render`], from a state that was kept, or keeping it.
///
/// # Errors
/// As [`render`]; also where state or recording cannot be of a render with these settings.
pub fn render_keeping<T: Tracer>(
    tracer: &T,
    settings: &RenderSettings,
    control: &mut Control<'_>,
    keeping: &mut Keeping,
) -> Result<Rendered, RenderError> {
    check(settings)?;
    let layout = settings.layout()?;
    let keeper = keeping.keeper.as_mut();
    if let Some(RenderState { aim, learnt, max_samples, past, sampling, film }) = keeping.from.take() {
        let film = Film::restored(layout, &film).ok_or(quietus::Misfit("a film of another size"))?;
        past.check()?;
        let mut rounds = Rounds::new(tracer, settings, film, past, control);
        if !rounds.steering.restore(learnt) {
            return Err(quietus::Misfit("more rounds than a render has").into());
        }
        let sampling = AdaptiveSampling::restored(rounds.library_up_to(&aim, max_samples), &sampling)?;
        let (aim, sampling) = rounds.towards_the_goal(aim, max_samples, sampling)?;
        if rounds.steering.is_past_the_first() {
            rounds.outlook.begin(&aim, rounds.steering.creep(aim.is_last), &sampling, None);
        }
        return rounds.run(control, aim, sampling, keeper);
    }
    let start = Instant::now();
    let film = Film::new(layout);
    let past = Past { wall: start.elapsed(), ..Past::default() };
    let rounds = Rounds::new(tracer, settings, film, past, control);
    if let Some(recording) = keeping.replay.take() {
        return rounds.replay(recording, control);
    }
    let aim = rounds.steering.first();
    let sampling = AdaptiveSampling::new(rounds.library(&aim))?;
    rounds.run(control, aim, sampling, keeper)
}

/// Goes on from where a render ended, perhaps to another goal, with nothing lost: all its samples are kept, and both are
/// reported as one render, without the time in between.
///
/// # Errors
/// As [`render`].
///
/// # Panics
/// When frame or window are not those of `before`.
pub fn go_on<T: Tracer>(
    tracer: &T,
    settings: &RenderSettings,
    before: Rendered,
    control: &mut Control<'_>,
    keeper: Option<&mut Keeper>,
) -> Result<Rendered, RenderError> {
    check(settings)?;
    let layout = before.film.layout();
    assert_eq!((layout.frame(), layout.window()), (settings.frame, settings.window), "another picture");
    let rounds = Rounds::new(tracer, settings, before.film, before.past, control);
    let aim = rounds.steering.first();
    let sampling = AdaptiveSampling::resumed(rounds.library(&aim), &Start::of(&before.sampling))?;
    rounds.run(control, aim, sampling, keeper)
}

/// Whether the goal makes sense.
fn check(settings: &RenderSettings) -> Result<(), RenderError> {
    if let Some(weights) = &settings.weights {
        if !settings.sampling.can_forecast() {
            return Err(RenderError::Weights(settings.sampling));
        }
        let (frame, weights) = (settings.frame, weights.frame());
        if frame != weights {
            return Err(RenderError::WeightsSize { frame, weights });
        }
    }
    let is_sound = |&noise: &f64| noise > 0.0 && noise.is_finite();
    if let Some(&noise) = settings.aov_noise.iter().flatten().find(|noise| !is_sound(noise)) {
        return Err(RenderError::Noise(noise));
    }
    if settings.aov_noise.iter().any(Option::is_some) && !matches!(settings.goal, Goal::Noise(_)) {
        return Err(RenderError::AovNoise);
    }
    let goal = match settings.goal {
        Goal::TargetError(_) => return Ok(()),
        Goal::Noise(noise) if !(noise > 0.0 && noise.is_finite()) => return Err(RenderError::Noise(noise)),
        Goal::Noise(_) => "noise",
        Goal::Limits => "a time",
    };
    match settings.sampling.can_forecast() {
        true => Ok(()),
        false => Err(RenderError::Goal { sampling: settings.sampling, goal }),
    }
}

/// Share of the time left after which a round that should be over, and is not, is cut short for another one with smaller
/// quotas.
const LONGEST_ROUND: f64 = 0.75;

/// Share of a limited time in which the noise of the picture is measured for the report; and at most, where a busy machine
/// lets workers wait so long that nothing would be left of it once they have stopped.
const REPORT_TIME: (f64, f64) = (0.015, 0.06);

struct Rounds<'a, T> {
    tracer: &'a T,
    settings: &'a RenderSettings,
    film: Film,
    counters: Vec<Counters>,
    costs: Costs,
    /// Seconds of one thread that measured the noise.
    measured: f64,
    /// As if nothing had come between it and what went before.
    start: Instant,
    cpu_start: Option<Duration>,
    estimator: Estimator,
    outlook: Outlook,
    steering: Steering,
    past: PastRounds,
}

impl<'a, T: Tracer> Rounds<'a, T> {
    fn new(
        tracer: &'a T,
        settings: &'a RenderSettings,
        film: Film,
        past: Past,
        control: &Control<'_>,
    ) -> Self {
        let counters: Vec<_> = (0..settings.threads.get()).map(|_| Counters::default()).collect();
        counters[0].add(
            past.samples,
            TileCounts { rays: past.rays, ..TileCounts::default() },
            Duration::ZERO,
        );
        let [across, down] = film.layout().tiles();
        let pixels = settings.window.pixels() as u64;
        let most = (settings.max_samples < u32::MAX).then(|| pixels as f64 * f64::from(settings.max_samples));
        let now = Instant::now();
        // The clock takes all pauses off, also those of the past.
        let behind = past.wall + control.live.map_or(Duration::ZERO, Live::paused_for);
        Self {
            tracer,
            settings,
            film,
            counters,
            costs: Costs::new(across as usize * down as usize),
            measured: 0.0,
            start: now.checked_sub(behind).unwrap_or(now),
            cpu_start: process::cpu_time().map(|now| now.saturating_sub(past.cpu)),
            estimator: Estimator::new(pixels, most, settings.time_limit),
            outlook: Outlook::new(settings),
            steering: Steering::new(settings),
            past: past.rounds,
        }
    }

    /// Rounds from the one that aims at `aim` with `sampling`.
    fn run(
        mut self,
        control: &mut Control<'_>,
        mut aim: Aim,
        mut sampling: AdaptiveSampling,
        mut keeper: Option<&mut Keeper>,
    ) -> Result<Rendered, RenderError> {
        sampling = observed(sampling);
        let stopped_by = loop {
            let clock = self.clock(control);
            let (start, before) = (clock.elapsed(), Counters::sum(&self.counters)[0]);
            let begun = self.begin(aim);
            let round = || self.round(&sampling, &begun, control, keeper.as_deref_mut());
            let stopped_by = tracing::debug_span!("round").in_scope(round)?;
            let drawn = Counters::sum(&self.counters)[0];
            // A state may be that of the end of a round.
            let (drawn, start) =
                if drawn > before { (drawn - before, start) } else { (drawn, Duration::ZERO) };
            let pace = drawn as f64 / clock.elapsed().saturating_sub(start).as_secs_f64().max(1e-9);
            self.end(&sampling, aim, self.settings.max_samples);
            // It may have finished just when it was told to stop.
            let decision = match stopped_by.filter(|_| !sampling.is_finished()) {
                Some(stopped_by) => Decision::Stop(stopped_by),
                None => self.after(&sampling, &mut aim, pace, control)?,
            };
            match decision {
                Decision::Stop(stopped_by) => {
                    if let Some(keeper) = keeper {
                        let wall = self.clock(control).elapsed();
                        keeper.save(|| self.kept().state(&begun, &sampling, wall));
                        keeper.wait();
                    }
                    break stopped_by;
                }
                Decision::GoOn(next) => aim = next,
            }
            let (creep, measured) = (self.steering.creep(aim.is_last), self.steering.measured());
            self.outlook.begin(&aim, creep, &sampling, measured);
            sampling = observed(AdaptiveSampling::resumed(self.library(&aim), &Start::of(&sampling))?);
        };
        // Before pixels have their minimum there is hardly time, and nothing that says where to measure.
        let is_worth_it = || !self.is_too_early(&sampling) || self.has_minimum(&sampling);
        let is_unknown = self.steering.has_rounds() && self.steering.reported().is_none();
        if stopped_by != StoppedBy::Cancelled && is_unknown && is_worth_it() {
            self.measure_in_time(stopped_by == StoppedBy::TimeLimit, &sampling, control)?;
        }
        let (noise, bound) = (self.steering.reported(), self.steering.bound());
        Ok(self.rendered(sampling, stopped_by, noise, bound, control))
    }

    /// What to do after a round that came to its end, or was cut short for another one.
    fn after(
        &mut self,
        sampling: &AdaptiveSampling,
        aim: &mut Aim,
        pace: f64,
        control: &mut Control<'_>,
    ) -> Result<Decision, RenderError> {
        let is_cut_short = !sampling.is_finished();
        let is_asked_anew = self.take_asked(control);
        aim.is_last &= !is_cut_short && !is_asked_anew;
        if is_cut_short && self.is_too_early(sampling) {
            return Ok(Decision::GoOn(*aim));
        }
        self.decide(sampling, aim, pace, control)
    }

    /// Draws what was recorded.
    fn replay(mut self, recording: Recording, control: &mut Control<'_>) -> Result<Rendered, RenderError> {
        let mut last: Option<AdaptiveSampling> = None;
        let mut stopped_by = StoppedBy::Done;
        for PastRound { aim, max_samples, cut } in recording.rounds {
            let settings = self.library_up_to(&aim, max_samples);
            let mut sampling = match &last {
                Some(last) => AdaptiveSampling::resumed(settings, &Start::of(last))?,
                None => AdaptiveSampling::new(settings)?,
            };
            if let Some(visits) = &cut {
                sampling = sampling.stop_after(visits)?;
            }
            let begun = self.begin(aim);
            let stopped = self.round(&sampling, &begun, control, None)?;
            self.end(&sampling, aim, max_samples);
            last = Some(sampling);
            if let Some(stopped) = stopped {
                stopped_by = stopped;
                break;
            }
        }
        let sampling = last.ok_or(quietus::Misfit("a recording without rounds"))?;
        Ok(self.rendered(sampling, stopped_by, recording.noise, recording.bound, control))
    }

    /// Where a round stands that is about to begin.
    fn begin(&self, aim: Aim) -> Begun {
        Begun { aim, learnt: self.steering.learnt().clone(), before: self.past.clone() }
    }

    /// Takes down a round that is over.
    fn end(&mut self, sampling: &AdaptiveSampling, aim: Aim, max_samples: u32) {
        self.past.totals.add(sampling);
        let cut = (!sampling.is_finished()).then(|| sampling.finished_visits());
        self.past.history.push(PastRound { aim, max_samples, cut });
    }

    /// From a round that was to reach `aim` with at most `max_samples` to one towards the goal there is now, if that is
    /// another one and the next decision would come too late to heed it.
    fn towards_the_goal(
        &mut self,
        aim: Aim,
        max_samples: u32,
        sampling: AdaptiveSampling,
    ) -> Result<(Aim, AdaptiveSampling), RenderError> {
        let next = if self.steering.has_rounds() { aim } else { self.steering.first() };
        if next == aim && max_samples == self.settings.max_samples {
            return Ok((aim, sampling));
        }
        self.end(&sampling, aim, max_samples);
        Ok((next, AdaptiveSampling::resumed(self.library(&next), &Start::of(&sampling))?))
    }

    fn rendered(
        self,
        sampling: AdaptiveSampling,
        stopped_by: StoppedBy,
        noise: Option<Noise>,
        bound: Option<Bound>,
        control: &Control<'_>,
    ) -> Rendered {
        let past = self.kept().past(self.clock(control).elapsed(), self.past.clone());
        let mut statistics =
            past.rounds.totals.statistics(&sampling, &self.film, self.counters.len(), past.wall);
        statistics.cpu_seconds = self.cpu_start.map(|_| past.cpu.as_secs_f64());
        (statistics.samples, statistics.rays) = (past.samples, past.rays);
        statistics.noise_is_weighted = self.settings.weights.is_some();
        statistics.outlook_samples = self.outlook.scouted();
        noise.into_iter().for_each(|noise| statistics.set_noise(noise));
        statistics.noise_asked = self.steering.asked().map(|asked| 100.0 * asked);
        let recording = Recording { rounds: past.rounds.history.clone(), noise, bound };
        let weights = self.settings.weights.clone();
        let aov_noise = self.steering.reported_aovs();
        statistics.set_aov_noise(&aov_noise, &self.settings.aov_noise);
        Rendered {
            film: self.film,
            sampling,
            statistics,
            stopped_by,
            noise,
            aov_noise,
            bound,
            recording,
            weights,
            past,
        }
    }

    fn kept(&self) -> Kept<'_> {
        Kept {
            film: &self.film,
            counters: &self.counters,
            cpu_start: self.cpu_start,
            max_samples: self.settings.max_samples,
        }
    }

    fn library(&self, aim: &Aim) -> quietus::Settings {
        self.library_up_to(aim, self.settings.max_samples)
    }

    /// As [`Self::library`] where no pixel is to exceed `max_samples`.
    fn library_up_to(&self, aim: &Aim, max_samples: u32) -> quietus::Settings {
        let max_samples = if self.settings.sampling == Sampling::Uniform { aim.samples } else { max_samples };
        let machinery = Machinery { lag: aim.lag, ..self.settings.machinery };
        let limited = RenderSettings { max_samples, machinery, ..self.settings.clone() };
        quietus::Settings {
            approach: aim.approach,
            fine_steps: aim.fine_steps,
            ..limited.library(REPLICATES as u32, aim.target_error)
        }
    }

    fn copied(&self) -> Copied {
        Copied::of(&self.film, self.settings.weights.as_deref(), AovDemand::of(self.settings))
    }

    fn clock<'c>(&self, control: &Control<'c>) -> Clock<'c> {
        let limit = self.settings.time_limit.map(|limit| limit - self.report_time(limit));
        Clock { start: self.start, limit, live: control.live }
    }

    /// What is kept of a time for the report.
    fn report_time(&self, limit: Duration) -> Duration {
        let (usual, most) = REPORT_TIME;
        let wait = Counters::longest_visit(&self.counters).min(limit.mul_f64(most - usual));
        if self.steering.has_rounds() { limit.mul_f64(usual) + wait } else { Duration::ZERO }
    }

    /// Takes in a noise that was asked for since; whether there was one.
    fn take_asked(&mut self, control: &Control<'_>) -> bool {
        let Some(noise) = newly_asked(&self.steering, self.settings, control) else { return false };
        self.steering.ask(noise);
        self.outlook.ask(noise);
        true
    }

    /// Whether a round was cut short before there are quotas to go by.
    fn is_too_early(&self, sampling: &AdaptiveSampling) -> bool {
        self.settings.sampling == Sampling::Quietus
            && (0..sampling.grid().tiles()).any(|tile| sampling.quotas(tile).is_none())
    }

    /// Whether all pixels have their minimum of samples.
    fn has_minimum(&self, sampling: &AdaptiveSampling) -> bool {
        let (grid, minimum) = (sampling.grid(), self.settings.min_samples.min(self.settings.max_samples));
        let has = |tile: u32, pixel: u8| sampling.counts().pixel(tile, pixel) >= minimum;
        let mut tiles = 0..grid.tiles();
        tiles.all(|tile| quietus::active_mask::pixels(grid.full_mask(tile)).all(|pixel| has(tile, pixel)))
    }

    /// Draws until the sampling is done, or has to stop, and says why. Also stops where another noise was asked for,
    /// or the round takes too much of the time, without a reason to end the render.
    fn round(
        &mut self,
        sampling: &AdaptiveSampling,
        begun: &Begun,
        control: &mut Control<'_>,
        mut keeper: Option<&mut Keeper>,
    ) -> Result<Option<StoppedBy>, RenderError> {
        let mut stopped_by = None;
        let clock = self.clock(control);
        // A first round has no quotas that another one could go by.
        let may_be_cut = self.steering.has_rounds() && !begun.aim.is_last && !self.is_too_early(sampling);
        let kept = Kept {
            film: &self.film,
            counters: &self.counters,
            cpu_start: self.cpu_start,
            max_samples: self.settings.max_samples,
        };
        let (estimator, counters, film) = (&mut self.estimator, &self.counters, &self.film);
        let round_end = clock.left().filter(|_| may_be_cut);
        let round_end = round_end.map(|left| clock.elapsed() + left.mul_f64(LONGEST_ROUND));
        let (outlook, measured) = (&mut self.outlook, self.measured);
        let (steering, settings, noise) = (&self.steering, self.settings, self.steering.progress());
        let (tracer, costs) = (self.tracer, &self.costs);
        let corner = [self.settings.window.x0, self.settings.window.y0];
        let weights = self.settings.weights.as_deref().map(|weights| (weights, corner));
        let (live, aov_demand) = (control.live, begun.aim.aov_demand);
        let round = Round { tracer, film, sampling, live, counters, costs, weights, aov_demand };
        let watch = || {
            stopped_by = stopped_by.or(clock.stops(control));
            let is_over = round_end.is_some_and(|end| clock.elapsed() >= end);
            if stopped_by.is_some() || is_over || newly_asked(steering, settings, control).is_some() {
                sampling.stop();
            }
            let [samples, rays] = Counters::sum(counters);
            outlook.scout(tracer, samples, film);
            let (elapsed, spent) = (clock.elapsed(), measured + Counters::seconds(counters));
            let total = outlook.total(elapsed, spent, sampling, Seen { film, costs });
            let drawn = Drawn { samples, rays, spent, total };
            let mut progress = estimator.reading(elapsed, drawn, sampling.converged_fraction());
            progress.noise = noise;
            (control.watch)(&Watched { progress, film, sampling });
            if let Some(keeper) = keeper.as_deref_mut().filter(|keeper| keeper.is_due()) {
                keeper.save(|| kept.state(begun, sampling, clock.elapsed()));
            }
            clock.interval()
        };
        round.run(watch)?;
        Ok(stopped_by)
    }
}

/// Lets whoever listens know of its rebuilds.
fn observed(sampling: AdaptiveSampling) -> AdaptiveSampling {
    if timeline::is_wanted() { sampling.observed_by(timeline::rebuilt) } else { sampling }
}

/// A noise that was asked for since the steering learnt of its goal.
fn newly_asked(steering: &Steering, settings: &RenderSettings, control: &Control<'_>) -> Option<f64> {
    let asked = control.live.filter(|_| settings.sampling.can_forecast())?.asked_noise()?;
    (steering.asked() != Some(asked)).then_some(asked)
}
