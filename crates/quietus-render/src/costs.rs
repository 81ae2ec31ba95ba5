//! What a sample costs, tile by tile: glass and hair take several times as long as the sky.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Time and samples of each tile so far. They are statistics of other data, and order nothing: relaxed.
pub(crate) struct Costs {
    tiles: Vec<Cost>,
}

#[derive(Default)]
struct Cost {
    nanoseconds: AtomicU64,
    samples: AtomicU64,
}

impl Cost {
    fn seconds_and_samples(&self) -> [f64; 2] {
        let nanoseconds = self.nanoseconds.load(Ordering::Relaxed) as f64;
        [nanoseconds * 1e-9, self.samples.load(Ordering::Relaxed) as f64]
    }
}

impl Costs {
    /// Of tiles that nothing is known of.
    pub(crate) fn new(tiles: usize) -> Self {
        Self { tiles: std::iter::repeat_with(Cost::default).take(tiles).collect() }
    }

    /// A tile's samples took that long.
    pub(crate) fn add(&self, tile: u32, samples: u64, took: Duration) {
        let cost = &self.tiles[tile as usize];
        cost.nanoseconds.fetch_add(took.as_nanos() as u64, Ordering::Relaxed);
        cost.samples.fetch_add(samples, Ordering::Relaxed);
    }

    /// Seconds that a thread takes for a sample of each tile; the mean where a tile was not drawn yet. `None` where none was.
    pub(crate) fn seconds(&self) -> Option<Vec<f64>> {
        let tiles: Vec<[f64; 2]> = self.tiles.iter().map(Cost::seconds_and_samples).collect();
        let sum = |part: usize| tiles.iter().map(|tile| tile[part]).sum::<f64>();
        let mean = sum(0) / sum(1);
        let each = |&[seconds, samples]: &[f64; 2]| if samples > 0.0 { seconds / samples } else { mean };
        mean.is_finite().then(|| tiles.iter().map(each).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_have_costs_of_their_own() {
        let costs = Costs::new(3);
        assert_eq!(costs.seconds(), None);
        costs.add(0, 100, Duration::from_millis(1));
        costs.add(2, 100, Duration::from_millis(2));
        costs.add(2, 200, Duration::from_millis(7));
        let seconds = costs.seconds().unwrap();
        let expected = [1e-5, 0.01 / 400.0, 3e-5];
        assert!(seconds.iter().zip(expected).all(|(a, b)| (a / b - 1.0).abs() < 1e-9), "{seconds:?}");
    }
}
