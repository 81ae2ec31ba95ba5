//! How should two replicates of a pixel share the sampler's points? Measures the alternatives of `docs/sampler.md`
//! and prints its table: `cargo run --release -p quietus-trace --example replicates`.

use quietus_trace::sampler::Sampler;

/// Independent pixels per figure: a variance is then known to 2 %.
const PIXELS: u32 = 5_000;

/// A way to deal `n` samples of a pixel to two replicates: replicate and sampler of each.
type Scheme = fn(pixel: u32, n: u32) -> Vec<(usize, Sampler)>;

/// An integrand over the unit cube, its expectation known.
struct Integrand {
    name: &'static str,
    expectation: f64,
    value: fn(&mut Sampler) -> f64,
}

fn main() {
    let schemes: [(&str, Scheme); 4] =
        [("own", own), ("popcount", popcount), ("parity", parity), ("random", random)];
    println!("| integrand | samples | {} |", schemes.map(|(name, _)| name).join(" | "));
    println!("|---|---|---|---|---|---|");
    for integrand in integrands() {
        for n in [8, 16, 32, 64, 256, 1024] {
            let random_variance = measure(&integrand, random, n).0;
            let cells = schemes.map(|(_, scheme)| {
                let (variance, claimed) = measure(&integrand, scheme, n);
                format!("{} ({})", figure(variance / random_variance), figure((claimed / variance).sqrt()))
            });
            println!("| {} | {n} | {} |", integrand.name, cells.join(" | "));
        }
    }
}

/// Three digits, however small.
fn figure(x: f64) -> String {
    if x >= 0.1 { format!("{x:.2}") } else { format!("{x:.1e}") }
}

/// Variance of the mean of all samples, and the mean square of the half-difference that is to estimate it.
fn measure(integrand: &Integrand, scheme: Scheme, n: u32) -> (f64, f64) {
    let (mut variance, mut claimed) = (0.0, 0.0);
    for pixel in 0..PIXELS {
        let mut halves = [0.0; 2];
        for (replicate, mut sampler) in scheme(pixel, n) {
            halves[replicate] += (integrand.value)(&mut sampler) / f64::from(n / 2);
        }
        let error = 0.5 * (halves[0] + halves[1]) - integrand.expectation;
        let half_difference = 0.5 * (halves[0] - halves[1]);
        variance += error * error;
        claimed += half_difference * half_difference;
    }
    (variance / f64::from(PIXELS), claimed / f64::from(PIXELS))
}

/// A sequence of its own for each replicate.
fn own(pixel: u32, n: u32) -> Vec<(usize, Sampler)> {
    (0..n).map(|i| ((i & 1) as usize, Sampler::new(0, pixel, 0, (i & 1) as u8, i / 2))).collect()
}

/// One sequence, dealt by the parity of the index bits at odd places.
fn popcount(pixel: u32, n: u32) -> Vec<(usize, Sampler)> {
    let class = |i: u32| ((i & 0xaaaa_aaaa).count_ones() & 1) as usize;
    (0..n).map(|i| (class(i), Sampler::new(0, pixel, 0, 0, i))).collect()
}

/// One sequence, dealt in turn.
fn parity(pixel: u32, n: u32) -> Vec<(usize, Sampler)> {
    (0..n).map(|i| ((i & 1) as usize, Sampler::new(0, pixel, 0, 0, i))).collect()
}

/// A new sequence for each sample: plain Monte Carlo, for scale.
fn random(pixel: u32, n: u32) -> Vec<(usize, Sampler)> {
    (0..n).map(|i| ((i & 1) as usize, Sampler::new(1 + u64::from(i), pixel, 0, 0, 0))).collect()
}

fn integrands() -> [Integrand; 7] {
    [
        Integrand {
            name: "straight edge, 2D",
            expectation: 0.5,
            value: |s| {
                let p = s.next_2d();
                f64::from(u8::from(p.y < 0.3 + 0.4 * p.x))
            },
        },
        Integrand {
            name: "round edge, 2D",
            expectation: std::f64::consts::FRAC_PI_4,
            value: |s| f64::from(u8::from(s.next_2d().length_squared() < 1.0)),
        },
        Integrand {
            // Integral of (0.3 + 0.4 x) (0.35 + 0.2 x): the edge, times what it sees of a light behind another.
            name: "edge and penumbra, 4D",
            expectation: 0.105 + 0.1 + 0.08 / 3.0,
            value: |s| {
                let (p, q) = (s.next_2d(), s.next_2d());
                f64::from(u8::from(p.y < 0.3 + 0.4 * p.x && q.x + 0.5 * q.y < 0.6 + 0.2 * p.x))
            },
        },
        Integrand {
            name: "smooth, 2D",
            expectation: std::f64::consts::E - 1.0,
            value: |s| {
                let p = s.next_2d().as_dvec2();
                p.x.exp() * (p.y + 0.5)
            },
        },
        Integrand {
            name: "smooth, 6D",
            expectation: 13.0 / 12.0,
            value: |s| {
                let [p, q, r] = [s.next_2d(), s.next_2d(), s.next_2d()].map(|p| p.as_dvec2());
                (p.x + 0.5) * (p.y + 0.5) * (0.5 + q.x) * (1.0 + (q.y - 0.5).powi(2)) * (0.75 + 0.5 * r.x)
            },
        },
        Integrand {
            // Poles as of a caustic: mean 1 / 0.6 times 1 / 0.7.
            name: "heavy tail, 4D",
            expectation: 1.0 / 0.42,
            value: |s| {
                let (p, q) = (s.next_2d().as_dvec2(), s.next_2d().as_dvec2());
                // Half a step off 0: the grid of f32 numbers starts there.
                (p.x + 3e-8).powf(-0.4) * (q.y + 3e-8).powf(-0.3)
            },
        },
        Integrand {
            name: "rare bright path, 4D",
            expectation: 1.0,
            value: |s| {
                let (p, q) = (s.next_2d(), s.next_2d());
                if p.x < 0.1 && q.y < 0.1 { 100.0 } else { 0.0 }
            },
        },
    ]
}
