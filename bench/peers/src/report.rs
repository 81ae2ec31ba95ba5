//! What was measured, as ratios.

use serde::Deserialize;

/// One process: two pictures with independent seeds.
#[derive(Debug, Deserialize)]
pub(crate) struct Measured {
    load_seconds: f64,
    wall_seconds: Vec<f64>,
    cpu_seconds: Vec<f64>,
    /// Per pixel, as drawn: it may be more than was asked for.
    samples: u32,
    peak_bytes: u64,
    /// Mean of both pictures.
    #[serde(skip)]
    mean: f64,
    /// Mean over pixels and channels of the variance of one picture over its squared mean plus 0.01.
    #[serde(skip)]
    relative_variance: f64,
}

impl Measured {
    /// Takes in the two pictures.
    pub(crate) fn compare(&mut self, a: &[f32], b: &[f32]) {
        let pairs = || a.iter().zip(b).map(|(&a, &b)| (f64::from(a), f64::from(b)));
        let n = a.len() as f64;
        self.mean = pairs().map(|(a, b)| 0.5 * (a + b)).sum::<f64>() / n;
        let relative = |(a, b): (f64, f64)| {
            let mean = 0.5 * (a + b);
            0.5 * (a - b) * (a - b) / (mean * mean + 0.01)
        };
        self.relative_variance = pairs().map(relative).sum::<f64>() / n;
    }
}

/// All turns of one renderer.
pub(crate) struct Row {
    name: String,
    turns: Vec<Measured>,
}

impl Row {
    pub(crate) fn new(name: &str) -> Self {
        Self { name: name.to_owned(), turns: vec![] }
    }

    pub(crate) fn add(&mut self, measured: Measured) {
        self.turns.push(measured);
    }

    fn median(&self, figure: impl Fn(&Measured) -> f64) -> f64 {
        let mut figures: Vec<f64> = self.turns.iter().map(figure).collect();
        figures.sort_by(f64::total_cmp);
        0.5 * (figures[(figures.len() - 1) / 2] + figures[figures.len() / 2])
    }

    /// Paths per CPU second of the second picture: by then everything is compiled and loaded.
    fn paths_per_cpu_second(&self, pixels: f64) -> f64 {
        pixels * self.median(|m| f64::from(m.samples) / m.cpu_seconds[1])
    }

    /// What one picture costs from nothing, in seconds.
    fn first_picture(&self) -> f64 {
        self.median(|m| m.load_seconds + m.wall_seconds[0])
    }

    /// Relative variance times the seconds of the second picture: error at equal time.
    fn error_times_time(&self) -> f64 {
        self.median(|m| m.relative_variance * m.wall_seconds[1])
    }

    fn megabytes(&self) -> f64 {
        self.median(|m| 1e-6 * m.peak_bytes as f64)
    }
}

/// Prints a table; ratios are above 1 where Quietus, the first row, is better.
pub(crate) fn print(scene: &str, size: u32, samples: u32, rows: &[Row]) {
    let pixels = f64::from(size) * f64::from(size);
    println!(
        "\n{scene}: {size}x{size}, {samples} samples per pixel, medians; in brackets Quietus's gain over it"
    );
    println!("| renderer | M paths per CPU-s | picture with load, s | peak MB | relMSE x s | mean |");
    println!("|---|---|---|---|---|---|");
    let ours = &rows[0];
    for row in rows {
        let gain = |ours: f64, theirs: f64| format!("({:.2})", ours / theirs);
        println!(
            "| {} | {:.2} {} | {:.2} {} | {:.0} {} | {:.4} {} | {:.4} |",
            row.name,
            1e-6 * row.paths_per_cpu_second(pixels),
            gain(ours.paths_per_cpu_second(pixels), row.paths_per_cpu_second(pixels)),
            row.first_picture(),
            gain(row.first_picture(), ours.first_picture()),
            row.megabytes(),
            gain(row.megabytes(), ours.megabytes()),
            row.error_times_time(),
            gain(row.error_times_time(), ours.error_times_time()),
            row.median(|m| m.mean),
        );
    }
}
