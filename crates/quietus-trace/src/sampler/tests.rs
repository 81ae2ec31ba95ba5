//! Structure and independence of the sampler's points.

use glam::Vec2;

use super::Sampler;
use crate::testing::{Mean, Suite, chi_square};

fn point(seed: u64, x: u32, y: u32, replicate: u8, index: u32, dimension: u32) -> Vec2 {
    let mut sampler = Sampler::new(seed, x, y, replicate, index);
    sampler.start_dimension(dimension);
    sampler.next_2d()
}

/// The defining property of a (0, 2)-sequence in base 2: of the first `2^m` points, and of every later block of
/// as many, each elementary interval of area `2^-m` holds exactly one.
#[test]
fn every_block_of_a_set_is_a_net() {
    for (pixel, dimension) in [(0, 0), (5, 2), (1 << 31, 7), (77, 1000)] {
        for m in 0..=10u32 {
            for block in [0, 1, 5] {
                let first = block << m;
                let points: Vec<_> =
                    (first..first + (1 << m)).map(|i| point(3, pixel, 9, 1, i, dimension)).collect();
                for columns in 0..=m {
                    let mut hits = vec![0; 1 << m];
                    for p in &points {
                        let column = (p.x * (1 << columns) as f32) as usize;
                        let row = (p.y * (1 << (m - columns)) as f32) as usize;
                        hits[column << (m - columns) | row] += 1;
                    }
                    assert!(hits.iter().all(|&h| h == 1), "m {m}, block {block}, {columns} column bits");
                }
            }
        }
    }
}

#[test]
fn single_dimensions_are_stratified() {
    for m in 0..=12u32 {
        let mut hits = vec![0; 1 << m];
        for i in 0..1 << m {
            hits[(Sampler::new(1, 2, 3, 0, i).next_1d() * (1 << m) as f32) as usize] += 1;
        }
        assert!(hits.iter().all(|&h| h == 1), "m {m}");
    }
}

#[test]
fn a_sample_depends_on_nothing_but_its_coordinates() {
    let mut one = Sampler::new(9, 100, 200, 1, 12345);
    let first = [one.next_1d(), one.next_2d().x, one.next_1d()];
    let mut again = Sampler::new(9, 100, 200, 1, 12345);
    again.start_dimension(3);
    assert_eq!(again.next_1d(), first[2]);
    again.start_dimension(0);
    assert_eq!(again.next_1d(), first[0]);
    assert_eq!(again.next_2d().x, first[1]);
}

/// Across pixels, one sample's points fill the square evenly at a fixed index and dimension.
#[test]
fn points_are_uniform_across_each_coordinate() {
    const SIDE: u32 = 256;
    type Vary = fn(u32, u32) -> Vec2;
    let varied: [(&str, Vary); 7] = [
        ("pixels", |i, j| point(0, i, j, 0, 0, 0)),
        ("high bits of pixels", |i, j| point(0, i << 24, j << 24, 0, 0, 0)),
        ("pixels, last index", |i, j| point(0, i, j, 0, u32::MAX, 8)),
        ("seeds and pixels", |i, j| point(u64::from(i), j, 0, 0, 3, 0)),
        ("high bits of seeds", |i, j| point(u64::from(i) << 56, j, 0, 0, 3, 0)),
        ("replicates and pixels", |i, j| point(0, j, 0, i as u8, 1, 0)),
        ("dimensions and pixels", |i, j| point(0, j, 0, 0, 2, i)),
    ];
    let mut suite = Suite::new(varied.len());
    for (name, vary) in varied {
        let mut counts = vec![0u64; 32 * 32];
        for i in 0..SIDE {
            for j in 0..SIDE {
                let p = vary(i, j) * 32.0;
                counts[p.x as usize * 32 + p.y as usize] += 1;
            }
        }
        let expected = vec![f64::from(SIDE * SIDE) / 1024.0; 1024];
        suite.judge(chi_square(&counts, &expected), name);
    }
}

/// Single bits of neighbours in any coordinate are uncorrelated: each product of signs has mean 0.
#[test]
fn neighbours_are_independent() {
    const PIXELS: u32 = 20_000;
    const BITS: u32 = 8;
    type Pair = fn(u32) -> [Vec2; 2];
    let pairs: [(&str, Pair); 9] = [
        ("x", |i| [point(0, 2 * i, 0, 0, 0, 0), point(0, 2 * i + 1, 0, 0, 0, 0)]),
        ("y", |i| [point(0, i, 6, 0, 0, 0), point(0, i, 7, 0, 0, 0)]),
        ("x and y swapped", |i| [point(0, i, 70_000, 0, 0, 0), point(0, 70_000, i, 0, 0, 0)]),
        ("high bit of x", |i| [point(0, i, 0, 0, 0, 0), point(0, i | 1 << 31, 0, 0, 0, 0)]),
        ("replicate", |i| [point(0, i, 0, 0, 0, 0), point(0, i, 0, 1, 0, 0)]),
        ("seed", |i| [point(4, i, 0, 0, 0, 0), point(5, i, 0, 0, 0, 0)]),
        ("high bit of seed", |i| [point(4, i, 0, 0, 0, 0), point(4 | 1 << 63, i, 0, 0, 0, 0)]),
        ("dimension", |i| [point(0, i, 0, 0, 0, 0), point(0, i, 0, 0, 0, 2)]),
        ("seed and replicate", |i| [point(1, i, 0, 0, 0, 0), point(0, i, 0, 1, 0, 0)]),
    ];
    // Every leading bit of x against every one of x and of y.
    let mut suite = Suite::new(pairs.len() * (BITS * BITS * 2) as usize);
    for (name, pair) in pairs {
        let points: Vec<_> = (0..PIXELS).map(pair).collect();
        let sign = |x: f32, bit: u32| 1.0 - 2.0 * f64::from(((x * (2 << bit) as f32) as u32) & 1);
        for a in 0..BITS {
            for b in 0..BITS {
                for axis in 0..2 {
                    let mut products = points.iter().map(|[p, q]| sign(p.x, a) * sign(q[axis], b));
                    let mean = Mean::of(PIXELS as usize, || products.next().expect("one per pixel"));
                    suite.judge(mean.p_equals(0.0), format!("{name}: bit {a} of x, bit {b} of axis {axis}"));
                }
            }
        }
    }
}

/// The padded sets of one pixel are shuffled against each other: over many indices, pairs of their coordinates
/// fill the square as evenly as independent ones, or more so (a chi-square too small is no fault).
#[test]
fn sets_of_one_pixel_are_independent() {
    let mut suite = Suite::new(6);
    for dimension in [2, 4, 100] {
        for axis in 0..2 {
            let mut counts = vec![0u64; 16 * 16];
            for pixel in 0..64 {
                for i in 0..256 {
                    let p = point(0, pixel, 1, 0, i, 0).x;
                    let q = point(0, pixel, 1, 0, i, dimension)[axis];
                    counts[(p * 16.0) as usize * 16 + (q * 16.0) as usize] += 1;
                }
            }
            suite.judge(chi_square(&counts, &[64.0; 256]), format!("dimension {dimension}, axis {axis}"));
        }
    }
}
