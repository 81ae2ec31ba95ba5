//! Filters against their integrals.

use super::*;
use crate::testing::{Rng, Suite, chi_square};

const ALL: [Filter; 6] = [
    Filter::BOX,
    Filter::TRIANGLE,
    Filter::GAUSSIAN,
    Filter::BLACKMAN_HARRIS,
    Filter::MITCHELL,
    Filter::LANCZOS_SINC,
];

/// Each filter in its own radius, and stretched differently along the axes.
fn filters() -> Vec<Filter> {
    let stretched = ALL.map(|filter| Filter { radius: filter.radius * Vec2::new(1.0, 0.6), ..filter });
    [ALL, stretched].concat()
}

const BINS: usize = 60;

/// Integral of `f` over each of the bins across the support, up to a common factor.
fn bin_integrals(shape: FilterShape, radius: f32, f: impl Fn(f32) -> f32) -> Vec<f64> {
    let integral = |bin: usize| {
        let place = |i: usize| 2.0 * (bin as f32 + (i as f32 + 0.5) / 64.0) / BINS as f32 - 1.0;
        (0..64).map(|i| f64::from(f(shape.weight(place(i) * radius, radius)))).sum()
    };
    (0..BINS).map(integral).collect()
}

/// Positions fall into bins as the integral of the filter's magnitude says, along both axes.
#[test]
fn filters_are_sampled_with_their_magnitude() {
    const SAMPLES: usize = 200_000;
    let filters = filters();
    let mut suite = Suite::new(2 * filters.len());
    for filter in filters {
        let sampler = FilterSampler::new(filter).expect("a sound filter");
        let mut rng = Rng::new(2);
        let mut observed = [[0u64; BINS]; 2];
        for _ in 0..SAMPLES {
            let place = sampler.sample(rng.next_2d()).offset / filter.radius;
            for axis in 0..2 {
                let bin = (f64::from(place[axis]) + 1.0) * 0.5 * BINS as f64;
                observed[axis][(bin as usize).min(BINS - 1)] += 1;
            }
        }
        for (axis, observed) in observed.iter().enumerate() {
            let integrals = bin_integrals(filter.shape, filter.radius[axis], f32::abs);
            let total: f64 = integrals.iter().sum();
            let expected: Vec<f64> = integrals.iter().map(|w| w / total * SAMPLES as f64).collect();
            suite.judge(chi_square(observed, &expected), format_args!("{filter:?}, axis {axis}"));
        }
    }
}

/// The weighted mean of a picture that is 1 left of a border, over a 256 x 256 grid of random numbers, is the
/// integral of the filter up to it: negative where lobes outweigh what is left of the border.
#[test]
fn weighted_samples_integrate_the_filter() {
    const GRID: u16 = 256;
    for filter in filters() {
        let sampler = FilterSampler::new(filter).expect("a sound filter");
        for axis in 0..2 {
            let radius = filter.radius[axis];
            let integrals = bin_integrals(filter.shape, radius, |f| f);
            let total: f64 = integrals.iter().sum();
            for border in [0, 5, 9, 15, 30, 41, BINS] {
                let expected: f64 = integrals[..border].iter().sum::<f64>() / total;
                let place = (2.0 * border as f32 / BINS as f32 - 1.0) * radius;
                let mut mean = 0.0;
                for i in 0..GRID {
                    for j in 0..GRID {
                        let u = (Vec2::new(f32::from(i), f32::from(j)) + 0.5) / f32::from(GRID);
                        let sample = sampler.sample(u);
                        let inside = sample.offset[axis] < place;
                        mean += if inside { f64::from(sample.weight) } else { 0.0 };
                    }
                }
                mean /= f64::from(GRID) * f64::from(GRID);
                // Up to three borders between parts of one sign cut the axis: each misplaces at most one of its
                // 256 cells of weight at most 2, twice for the border itself.
                let room = 16.0 / f64::from(GRID);
                assert!(
                    (mean - expected).abs() < room,
                    "{filter:?}, axis {axis}, {place}: {mean}, {expected}"
                );
            }
        }
    }
}

#[test]
fn only_filters_with_negative_lobes_have_weights() {
    let mut rng = Rng::new(3);
    for filter in filters() {
        let sampler = FilterSampler::new(filter).expect("a sound filter");
        let weights: Vec<f32> = (0..1000).map(|_| sampler.sample(rng.next_2d()).weight).collect();
        let lobes = matches!(filter.shape, FilterShape::Mitchell { .. } | FilterShape::LanczosSinc { .. });
        assert_eq!(weights.iter().any(|&weight| weight < 0.0), lobes, "{filter:?}");
        assert_eq!(weights.iter().any(|&weight| weight != 1.0), lobes, "{filter:?}");
    }
}

/// The variance factors that the module's documentation states.
#[test]
fn the_price_of_negative_lobes() {
    let price = |filter| {
        let sampler = FilterSampler::new(filter).expect("a sound filter");
        let weight = sampler.sample(Vec2::splat(0.5)).weight;
        format!("{:.2}", weight * weight)
    };
    assert_eq!([price(Filter::MITCHELL), price(Filter::LANCZOS_SINC)], ["1.31", "3.35"]);
}

#[test]
fn filters_end_at_their_radius() {
    for Filter { shape, radius } in ALL {
        assert_eq!(shape.weight(1.001 * radius.x, radius.x), 0.0, "{shape:?}");
        let compact = !matches!(shape, FilterShape::Box | FilterShape::LanczosSinc { .. });
        let at_end = shape.weight(radius.x, radius.x).abs();
        assert!(!compact || at_end < 1e-4 * shape.weight(0.0, radius.x), "{shape:?}: {at_end}");
    }
}

/// Closed forms at a few places: Mitchell and Netravali's B = C = 1/3 at 0, 1 and 1.5; zeros of the sinc.
#[test]
fn filters_have_their_textbook_values() {
    let near = |a: f32, b: f32| assert!((a - b).abs() < 1e-6, "{a} {b}");
    let mitchell = Filter::MITCHELL.shape;
    near(mitchell.weight(0.0, 2.0), 8.0 / 9.0);
    near(mitchell.weight(1.0, 2.0), 1.0 / 18.0);
    near(mitchell.weight(-1.5, 2.0), -7.0 / 216.0 - 1.0 / 216.0 * 0.5);
    let sinc = Filter::LANCZOS_SINC.shape;
    near(sinc.weight(0.0, 4.0), 1.0);
    near(sinc.weight(1.0, 4.0), 0.0);
    near(sinc.weight(0.5, 4.0), (2.0 / std::f32::consts::PI) * (6.0 / std::f32::consts::PI * 0.5));
    near(Filter::GAUSSIAN.shape.weight(0.5, 1.5), (-0.5_f32).exp() - (-4.5_f32).exp());
}

#[test]
fn filters_that_make_no_sense_are_refused() {
    let refused = |filter| FilterSampler::new(filter).expect_err("must be refused");
    for radius in [0.0, -1.0, f32::NAN, f32::INFINITY, 65.0] {
        assert!(matches!(refused(Filter::new(FilterShape::Triangle, radius)), FilterError::Radius(..)));
    }
    for sigma in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let error = refused(Filter::new(FilterShape::Gaussian { sigma }, 1.5));
        assert!(matches!(error, FilterError::Parameter { name: "sigma", .. }), "{error}");
    }
    // So wide that nothing is left of it where it is lowered.
    assert!(matches!(
        refused(Filter::new(FilterShape::Gaussian { sigma: 1e9 }, 1.5)),
        FilterError::Cancels(_)
    ));
    assert!(matches!(
        refused(Filter::new(FilterShape::Mitchell { b: 0.0, c: 30.0 }, 2.0)),
        FilterError::Cancels(_)
    ));
}
