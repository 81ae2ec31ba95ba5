//! Replay: the library deals visits, and samples are looked up instead of traced.

use quietus::{
    AdaptiveSampling, ErrorMetric, Outcome, PixelError, ReplicateMean, Settings, Statistics, TILE_PIXELS,
    Visit,
};

use crate::{Bank, EvalError, Picture, packed, runs::Deal};

/// What a run of a policy on a bank led to.
#[derive(Clone, Debug)]
pub struct Replay {
    /// The mean of each pixel's accepted samples; black where there are none.
    pub picture: Picture,
    /// The means of each pixel's first two replicates.
    pub halves: Vec<[[f32; 3]; 2]>,
    /// Samples of each pixel, over all replicates, row by row.
    pub counts: Vec<u32>,
    /// Samples of all pixels.
    pub samples: u64,
    /// Rays these took: each pixel's samples times its mean rays in the bank.
    pub rays: f64,
    /// Samples that the film would have rejected; they count as drawn and are left out of means.
    pub rejected: u64,
    /// Whether sampling went on to the pixel at the end: it ran into the maximum. Row by row.
    pub unfinished: Vec<bool>,
    /// Regions in which sampling stopped, where the policy says so.
    pub stopped: Vec<quietus::Area>,
    /// The library's counters.
    pub statistics: Statistics,
}

impl Replay {
    /// Mean samples of a pixel.
    pub fn samples_per_pixel(&self) -> f64 {
        self.samples as f64 / self.counts.len() as f64
    }
}

/// Runs the policy of `settings` on `bank` with the policy's own metric, on the calling thread. Equal
/// arguments give equal results.
///
/// `run` numbers the run: the first `streams / replicates` ones share no sample (with two replicates, run k
/// has the very samples of the live render with the bank's seed plus k), later ones deal each pixel's streams
/// anew; see the bank's description. In free-running mode the visits come in the order in which one thread
/// does them.
///
/// # Errors
/// Where the library refuses the settings, or they do not fit the bank: another size, a crop, more replicates
/// than streams, or a maximum of samples the streams do not hold.
pub fn replay(bank: &Bank, settings: &Settings, run: u64) -> Result<Replay, EvalError> {
    replay_with(bank, settings, settings.policy.metric(), run)
}

/// As [`replay`], with another metric; its channels are red, green, blue and alpha.
///
/// # Errors
/// As [`replay`].
pub fn replay_with(
    bank: &Bank,
    settings: &Settings,
    metric: &dyn ErrorMetric,
    run: u64,
) -> Result<Replay, EvalError> {
    replay_watched(bank, settings, metric, run, |_| ())
}

/// As [`replay_with`]; `watch` sees the film as it is whenever the first visit of a pass ends the one before.
pub(crate) fn replay_watched(
    bank: &Bank,
    settings: &Settings,
    metric: &dyn ErrorMetric,
    run: u64,
    mut watch: impl FnMut(&BankFilm<'_>),
) -> Result<Replay, EvalError> {
    fits(bank, settings)?;
    let sampling = AdaptiveSampling::new(settings.clone())?;
    let replicates = settings.replicates as usize;
    let pixels = bank.spec().look.pixels();
    let mut film = BankFilm {
        bank,
        deal: Deal::new(bank.spec().streams, settings.replicates, pixels, run),
        replicates,
        sums: vec![Sum::default(); pixels * replicates],
        rejected: 0,
    };
    let mut worker = sampling.worker();
    let mut pass = 0;
    while let Some(visit) = worker.next_visit() {
        if visit.pass() > pass {
            pass = visit.pass();
            watch(&film);
        }
        let errors = film.draw(&visit, metric);
        visit.finish(&errors);
    }
    drop(worker);
    if sampling.outcome() != Some(Outcome::Finished) {
        let outcome = sampling.outcome();
        return Err(EvalError::Request(format!("the replay ended as {outcome:?} instead of being finished")));
    }
    Ok(film.develop(&sampling))
}

fn fits(bank: &Bank, settings: &Settings) -> Result<(), EvalError> {
    let spec = bank.spec();
    let refuse = |message: String| Err(EvalError::Request(message));
    if [settings.width, settings.height] != [spec.look.width, spec.look.height] || settings.crop.is_some() {
        let size = format!("{}x{}", spec.look.width, spec.look.height);
        return refuse(format!(
            "the bank holds {size} pixels; the settings must ask for just these, without crop"
        ));
    }
    if settings.replicates > spec.streams {
        let (asked, there) = (settings.replicates, spec.streams);
        return refuse(format!("{asked} replicates were asked for; the bank has {there} streams"));
    }
    // Replicates hold equal shares, the first ones one more.
    let held = u64::from(spec.samples) * u64::from(settings.replicates);
    if u64::from(settings.max_samples) > held {
        return refuse(format!(
            "at most {} samples per pixel were asked for; {} replicates of {} samples hold {held}",
            settings.max_samples, settings.replicates, spec.samples
        ));
    }
    Ok(())
}

/// One replicate of one pixel, summed and rounded as the film does: replays take the decisions of live
/// renders.
#[derive(Clone, Copy, Default)]
struct Sum {
    channels: [f32; 4],
    accepted: u32,
    drawn: u32,
}

/// A film whose samples are looked up.
pub(crate) struct BankFilm<'a> {
    bank: &'a Bank,
    deal: Deal,
    replicates: usize,
    /// R in a row for each pixel, row by row.
    sums: Vec<Sum>,
    rejected: u64,
}

impl BankFilm<'_> {
    /// Mean of a pixel's accepted samples; black where there are none.
    pub(crate) fn mean(&self, pixel: usize) -> [f32; 3] {
        let sums = self.replicates_of(pixel);
        let accepted: u32 = sums.iter().map(|s| s.accepted).sum();
        [0, 1, 2].map(|channel| {
            let sum: f64 = sums.iter().map(|s| f64::from(s.channels[channel])).sum();
            (sum / f64::from(accepted.max(1))) as f32
        })
    }

    /// Samples drawn.
    pub(crate) fn samples(&self) -> u64 {
        self.sums.iter().map(|s| u64::from(s.drawn)).sum()
    }

    fn pixel(&self, x: u32, y: u32) -> usize {
        y as usize * self.bank.spec().look.width as usize + x as usize
    }

    /// Looks the samples of a visit up; returns the errors of its pixels.
    fn draw(&mut self, visit: &Visit<'_, '_>, metric: &dyn ErrorMetric) -> [PixelError; TILE_PIXELS] {
        let mut errors = [PixelError::REJECTED; TILE_PIXELS];
        for work in visit.pixels() {
            let pixel = self.pixel(work.x, work.y);
            let stream = self.bank.stream(pixel, self.deal.stream(pixel, work.replicate));
            let words = &stream[work.samples.start as usize..work.samples.end as usize];
            let slot = pixel * self.replicates + usize::from(work.replicate);
            self.rejected += add(&mut self.sums[slot], words);
        }
        let pixels = self.pixels_of(visit);
        let channels: Vec<[f32; 4]> = pixels.clone().flat_map(|(_, pixel)| self.means(pixel)).collect();
        let means: Vec<ReplicateMean<'_>> = pixels
            .clone()
            .flat_map(|(_, pixel)| self.replicates_of(pixel))
            .zip(&channels)
            .map(|(sum, channels)| ReplicateMean { count: sum.accepted, channels })
            .collect();
        for ((bit, _), means) in pixels.zip(means.chunks(self.replicates)) {
            errors[usize::from(bit)] = metric.pixel_error(means);
        }
        errors
    }

    /// The pixels a visit draws: their place in the tile, and their number in the picture.
    fn pixels_of(&self, visit: &Visit<'_, '_>) -> impl Iterator<Item = (u8, usize)> + Clone + use<> {
        let (rect, width) = (visit.rect(), self.bank.spec().look.width);
        quietus::active_mask::pixels(visit.mask()).collect::<Vec<_>>().into_iter().map(move |bit| {
            let (x, y) = (rect.x0 + u32::from(bit) % 8, rect.y0 + u32::from(bit) / 8);
            (bit, y as usize * width as usize + x as usize)
        })
    }

    fn replicates_of(&self, pixel: usize) -> &[Sum] {
        &self.sums[pixel * self.replicates..][..self.replicates]
    }

    fn means(&self, pixel: usize) -> impl Iterator<Item = [f32; 4]> + '_ {
        self.replicates_of(pixel).iter().map(|sum| {
            let n = f64::from(sum.accepted.max(1));
            sum.channels.map(|c| (f64::from(c) / n) as f32)
        })
    }

    /// What is left when the library says it is finished.
    fn develop(self, sampling: &AdaptiveSampling) -> Replay {
        let look = &self.bank.spec().look;
        let mut picture = Picture::black(look.width, look.height);
        let mut counts = vec![0; look.pixels()];
        let half = |means: [f32; 4]| [means[0], means[1], means[2]];
        let halves = (0..look.pixels()).map(|pixel| {
            let mut means = self.means(pixel).map(half);
            [means.next().unwrap_or_default(), means.next().unwrap_or_default()]
        });
        let halves = halves.collect();
        let mut rays = 0.0;
        for (pixel, sums) in self.sums.chunks(self.replicates).enumerate() {
            counts[pixel] = sums.iter().map(|s| s.drawn).sum();
            rays += f64::from(counts[pixel]) * f64::from(self.bank.rays()[pixel]);
            picture.rgb[pixel] = self.mean(pixel);
        }
        Replay {
            picture,
            halves,
            samples: counts.iter().map(|&n| u64::from(n)).sum(),
            counts,
            rays,
            rejected: self.rejected,
            unfinished: unfinished(sampling),
            stopped: stopped(sampling),
            statistics: sampling.statistics(),
        }
    }
}

/// Adds samples to a replicate; returns how many were rejected.
#[inline]
fn add(sum: &mut Sum, words: &[[u8; 8]]) -> u64 {
    let (mut channels, mut rejected) = ([0.0_f64; 4], 0);
    for &bytes in words {
        let word = u64::from_le_bytes(bytes);
        if word == packed::REJECTED {
            rejected += 1;
            continue;
        }
        for (channel, value) in channels.iter_mut().zip(packed::unpack(word)) {
            *channel += f64::from(value);
        }
    }
    sum.channels.iter_mut().zip(channels).for_each(|(sum, more)| *sum = (f64::from(*sum) + more) as f32);
    sum.drawn += words.len() as u32;
    sum.accepted += words.len() as u32 - rejected;
    u64::from(rejected)
}

/// Pixels that are still active, row by row.
fn unfinished(sampling: &AdaptiveSampling) -> Vec<bool> {
    let grid = sampling.grid();
    let mut active = vec![false; grid.rect().area() as usize];
    for tile in 0..grid.tiles() {
        let rect = grid.tile_rect(tile);
        for bit in quietus::active_mask::pixels(sampling.active_mask(tile)) {
            let (x, y) = (rect.x0 + u32::from(bit) % 8, rect.y0 + u32::from(bit) / 8);
            if rect.contains(x, y) {
                active[y as usize * grid.width() as usize + x as usize] = true;
            }
        }
    }
    active
}

/// Complete leaves of the trees, each once: a leaf in the overlap of two regions belongs to the one whose
/// home holds its centre.
fn stopped(sampling: &AdaptiveSampling) -> Vec<quietus::Area> {
    let regions = quietus::Regions::new(*sampling.grid(), sampling.settings().regions_per_axis);
    let mut areas = Vec::new();
    for (region, tree) in (0..).zip(sampling.region_trees()) {
        let home = regions.home_rect(region);
        let complete = tree.iter().flat_map(|tree| tree.leaves()).filter(|leaf| leaf.complete);
        areas.extend(complete.map(|leaf| leaf.area).filter(|area| {
            let (x, y) = (0.5 * (area.x0 + area.x1), 0.5 * (area.y0 + area.y1));
            home.contains(x as u32, y as u32)
        }));
    }
    areas
}

#[cfg(test)]
mod tests;
