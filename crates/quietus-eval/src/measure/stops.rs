//! False stops: regions in which sampling stopped though their true error is above the target.

use quietus::{Policy, Settings};

use crate::{Reference, Replay};

/// What became of the regions in which sampling stopped. Shares are by area.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stops {
    /// Share of the picture in which sampling stopped before the maximum of samples.
    pub stopped: f64,
    /// Share of the stopped area whose true region error is not below the target.
    pub false_stops: f64,
    /// Mean of true region error over target, over the stopped area.
    pub true_over_target: f64,
}

/// Judges the stops of a run.
///
/// The true error of a pixel is Dammertz's formula with the difference to the reference in place of the
/// difference of two estimates: `sum_c |x_c - r_c| / sqrt(sum_c r_c)`. Where the estimate is honest the two
/// have the same mean, and a region that stops just at its target is a false stop in about half of all cases:
/// read the rate beside that of other policies. Regions are what the policy itself decides about: the
/// complete leaves of trees; tiles of 8x8 for `tile`, for `dammertz`, whose blocks are gone, and for `unbiased`,
/// which has none; single pixels for `pixel`.
pub fn stops(replay: &Replay, reference: &Reference, settings: &Settings) -> Stops {
    let width = settings.width as usize;
    let errors: Vec<f64> = (0..replay.counts.len()).map(|i| true_error(replay, reference, i)).collect();
    let frame = settings.frame_area.unwrap_or(f64::from(settings.width) * f64::from(settings.height));
    let (mut area, mut false_area, mut ratios) = (0.0, 0.0, 0.0);
    for region in regions(replay, settings) {
        let rect = region.rounded_outward();
        let rows = (rect.y0 as usize)..(rect.y1.min(settings.height) as usize);
        let columns = (rect.x0 as usize)..(rect.x1 as usize).min(width);
        let sum: f64 = rows.map(|y| errors[y * width..][columns.clone()].iter().sum::<f64>()).sum();
        let ratio = sum / (region.pixels() * frame).sqrt() / settings.target_error;
        area += region.pixels();
        ratios += region.pixels() * ratio;
        false_area += if ratio >= 1.0 { region.pixels() } else { 0.0 };
    }
    if area == 0.0 {
        return Stops::default();
    }
    Stops {
        stopped: area / errors.len() as f64,
        false_stops: false_area / area,
        true_over_target: ratios / area,
    }
}

fn true_error(replay: &Replay, reference: &Reference, i: usize) -> f64 {
    let (x, r) = (replay.picture.rgb[i], reference.mean.rgb[i]);
    let sum: f64 = r.iter().map(|&v| f64::from(v)).sum();
    let difference: f64 = (0..3).map(|c| (f64::from(x[c]) - f64::from(r[c])).abs()).sum();
    if sum > 0.0 { difference / sum.sqrt() } else { 0.0 }
}

/// The stopped regions of the policy.
fn regions(replay: &Replay, settings: &Settings) -> Vec<quietus::Area> {
    let side = match settings.policy {
        Policy::Uniform => return Vec::new(),
        Policy::Tile | Policy::Dammertz | Policy::Unbiased => 8,
        Policy::Pixel => 1,
        _ => return replay.stopped.clone(),
    };
    let (width, height) = (settings.width, settings.height);
    let at = |v: u32| (0..v).step_by(side as usize);
    let rects = at(height).flat_map(|y| {
        at(width).map(move |x| quietus::PixelRect::new(x, y, (x + side).min(width), (y + side).min(height)))
    });
    let is_stopped = |rect: &quietus::PixelRect| {
        (rect.y0..rect.y1).all(|y| (rect.x0..rect.x1).all(|x| !replay.unfinished[(y * width + x) as usize]))
    };
    rects.filter(is_stopped).map(quietus::Area::from).collect()
}

#[cfg(test)]
mod tests {
    use quietus::Statistics;

    use super::*;
    use crate::measure::tests::flat;

    /// The left of two 8x8 tiles is off by 0.3 in every channel, the right one is exact, over a reference of
    /// 0.75: the true error of a pixel is 0.9 / 1.5 = 0.6, that of the left tile 64 * 0.6 / sqrt(64 * 128) =
    /// 0.424.
    fn run() -> (Replay, Reference) {
        let reference = flat(16, 8, 0.75, 0.0);
        let mut picture = reference.mean.clone();
        (0..128).filter(|i| i % 16 < 8).for_each(|i| picture.rgb[i] = [1.05; 3]);
        let replay = Replay {
            picture,
            halves: Vec::new(),
            counts: vec![16; 128],
            samples: 2048,
            rays: 0.0,
            rejected: 0,
            unfinished: vec![false; 128],
            stopped: Vec::new(),
            statistics: Statistics::default(),
        };
        (replay, reference)
    }

    fn settings(policy: Policy, target_error: f64) -> Settings {
        Settings { policy, target_error, ..Settings::new(16, 8) }
    }

    #[test]
    fn a_false_stop_is_one_above_the_target() {
        let (mut replay, reference) = run();
        let judge = |replay: &Replay, target| stops(replay, &reference, &settings(Policy::Tile, target));
        let found = judge(&replay, 0.42);
        assert_eq!((found.stopped, found.false_stops), (1.0, 0.5));
        let error = 64.0 * 0.6 / (64.0_f64 * 128.0).sqrt();
        assert!((found.true_over_target - 0.5 * error / 0.42).abs() < 1e-6, "{found:?}");
        assert_eq!(judge(&replay, 0.43).false_stops, 0.0);
        // A tile with one pixel that goes on has not stopped.
        replay.unfinished[3] = true;
        assert_eq!(judge(&replay, 0.42), Stops { stopped: 0.5, false_stops: 0.0, true_over_target: 0.0 });
    }

    #[test]
    fn regions_are_those_of_the_policy() {
        let (mut replay, reference) = run();
        let share = |replay: &Replay, policy, target| {
            let found = stops(replay, &reference, &settings(policy, target));
            (found.stopped, found.false_stops)
        };
        assert_eq!(share(&replay, Policy::Uniform, 0.1), (0.0, 0.0));
        // A pixel alone: 0.6 / sqrt(128) = 0.053.
        assert_eq!(share(&replay, Policy::Pixel, 0.05), (1.0, 0.5));
        assert_eq!(share(&replay, Policy::Pixel, 0.06), (1.0, 0.0));
        // A leaf of 4x4 inside the left tile: 16 * 0.6 / sqrt(16 * 128) = 0.212.
        replay.stopped = vec![quietus::PixelRect::new(2, 2, 6, 6).into()];
        assert_eq!(share(&replay, Policy::Talk, 0.2), (0.125, 1.0));
        assert_eq!(share(&replay, Policy::Quietus, 0.22), (0.125, 0.0));
    }
}
