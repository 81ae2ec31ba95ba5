//! After a round: what the film and fresh samples say, and whether another one begins.

use std::sync::atomic::Ordering;

use quietus::AdaptiveSampling;

use super::Rounds;
use crate::clock::Clock;
use crate::noise::{Copied, Effort, LEAST_PICKS, Measured, Measuring};
use crate::progress::Drawn;
use crate::run::{Control, Counters, RenderError, StoppedBy, Watched};
use crate::steering::{Aim, TimeLeft, Verdict};
use crate::tracer::Tracer;

/// Most of a limited time that passes until the noise was measured by as few picks as it takes.
const LATEST: f64 = 1.018;

/// How long the noise is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Until {
    /// Until it is known as well as it was to be; not at all where time does not allow that.
    Known,
    /// Until time is up.
    Late,
}

/// What comes after a round.
pub(super) enum Decision {
    Stop(StoppedBy),
    GoOn(Aim),
}

impl<T: Tracer> Rounds<'_, T> {
    /// What to do after a round that reached its aim.
    pub(super) fn decide(
        &mut self,
        sampling: &AdaptiveSampling,
        aim: &Aim,
        pace: f64,
        control: &mut Control<'_>,
    ) -> Result<Decision, RenderError> {
        if !self.steering.has_rounds() {
            return Ok(Decision::Stop(StoppedBy::Done));
        }
        let picture = self.copied();
        let forecast = self.steering.look(&picture, sampling);
        if self.steering.asked().is_some() {
            let effort = if aim.is_last { Effort::REPORT } else { self.steering.effort(&forecast) };
            match self.measure(&picture, effort, (self.clock(control), Until::Known), sampling, control)? {
                Ok(measured) => self.steering.take(&measured, &forecast),
                Err(stopped_by) => return Ok(Decision::Stop(stopped_by)),
            }
        }
        let time = TimeLeft {
            limit: self.clock(control).limit,
            elapsed: self.clock(control).elapsed(),
            samples: sampling.counts().total() as f64,
            pace,
        };
        Ok(match self.steering.verdict(aim, &forecast, &time) {
            Verdict::Finished if self.steering.reported().is_none() && self.clock(control).is_late() => {
                Decision::Stop(StoppedBy::TimeLimit)
            }
            Verdict::Finished => Decision::Stop(StoppedBy::Done),
            Verdict::GoOn(aim) => Decision::GoOn(aim),
            Verdict::MeasureAgain => {
                let until = (self.clock(control), Until::Known);
                match self.measure(&picture, Effort::REPORT, until, sampling, control)? {
                    Ok(measured) => {
                        self.steering.take_report(&measured);
                        Decision::Stop(StoppedBy::Done)
                    }
                    Err(stopped_by) => Decision::Stop(stopped_by),
                }
            }
        })
    }

    /// Measures the noise of a picture that no measurement has ended, as well as what is left of all time allows: pixels are drawn
    /// until that is over.
    pub(super) fn measure_in_time(
        &mut self,
        is_time_up: bool,
        sampling: &AdaptiveSampling,
        control: &mut Control<'_>,
    ) -> Result<(), RenderError> {
        let clock = Clock { limit: self.settings.time_limit, ..self.clock(control) };
        // More than fits: time cuts it off.
        let fits = clock.left().filter(|_| is_time_up).unwrap_or_default().div_duration_f64(clock.elapsed());
        let effort = Effort { share: Effort::REPORT.share.max(2.0 * fits), ..Effort::REPORT };
        let picture = self.copied();
        let until = (clock, Until::Late);
        if let Ok(measured) = self.measure(&picture, effort, until, sampling, control)? {
            self.steering.take_report(&measured);
        }
        Ok(())
    }

    /// Measures the noise of the film. Where that is cut short: why.
    pub(super) fn measure(
        &mut self,
        picture: &Copied,
        effort: Effort,
        (clock, until): (Clock<'_>, Until),
        sampling: &AdaptiveSampling,
        control: &mut Control<'_>,
    ) -> Result<Result<Measured, StoppedBy>, RenderError> {
        let (window, number) = (self.film.layout().window(), self.past.measurements);
        self.past.measurements += 1;
        let counters: Vec<_> = self.counters.iter().map(|_| Counters::default()).collect();
        let measuring = Measuring {
            tracer: self.tracer,
            window,
            live: control.live,
            counters: &counters,
            number,
            effort,
        };
        let cancel = control.cancel;
        let (estimator, drawn, noise) = (&mut self.estimator, &self.counters, self.steering.progress());
        let (film, outlook, measured) = (&self.film, &self.outlook, self.measured);
        let watch = || {
            let [samples, rays] = Counters::sum(drawn);
            let spent = measured + Counters::seconds(drawn) + Counters::seconds(&counters);
            let drawn = Drawn { samples, rays, spent, total: outlook.known() };
            let mut progress = estimator.reading(clock.elapsed(), drawn, sampling.converged_fraction());
            progress.noise = noise;
            (control.watch)(&Watched { progress, film, sampling });
            clock.interval()
        };
        let is_over = until == Until::Late;
        // Relaxed: the flag guards no data.
        let is_cancelled = || cancel.load(Ordering::Relaxed) || !is_over && clock.is_late();
        let latest = clock.limit.map(|limit| limit.mul_f64(LATEST));
        let is_too_late = || latest.is_some_and(|latest| clock.elapsed() >= latest);
        let is_enough = |picks: usize| is_over && clock.is_late() && (picks >= LEAST_PICKS || is_too_late());
        let span = tracing::debug_span!("measure noise", number).entered();
        let outcome = measuring.run(picture, is_cancelled, is_enough, watch)?;
        drop(span);
        self.past.totals.noise_samples += Counters::sum(&counters)[0];
        self.measured += Counters::seconds(&counters);
        Ok(outcome.ok_or_else(|| clock.stops(control).unwrap_or(StoppedBy::Done)))
    }
}
