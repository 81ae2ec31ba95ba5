//! How much light a thick medium under a smooth surface gives back, and which medium gives back so much.

use rayon::prelude::*;

use super::super::fresnel;
use crate::medium::HenyeyGreenstein;
use crate::sampler::mix64;

/// Walks that a table is made of: reflectances are off by 0.1 % of white at most.
pub(crate) const WALKS: u32 = 1 << 17;
/// Walks that one thread makes at a time.
const CHUNK: u32 = 1 << 11;
/// Scatterings that are followed. Of those of longer walks it is known that the chance of coming up falls with the power
/// -3/2 of their number.
const FOLLOWED: usize = 512;
/// Intervals of the table.
const INTERVALS: usize = 64;

/// What follows from an index of refraction and an asymmetry of scattering.
///
/// For light that enters evenly from outside the chances of coming up again after 1, 2, 3, ... scatterings are counted by
/// walks through a half-space that absorbs nothing. With a single-scattering albedo `a` the reflectance is the sum of
/// those chances times `a`, `a^2`, `a^3`, ... (Novak, Georgiev, Hanika, Jarosz 2018, "Monte Carlo Methods for Volumetric
/// Light Transport Simulation", section 2, in words), which is turned around by bisection.
#[derive(Clone, Debug)]
pub(crate) struct SubsurfaceTable {
    /// Share of even light from outside that enters.
    pub(crate) entering: f32,
    /// For evenly spaced reflectances the root of the albedo's distance from 1, which is nearly a straight line.
    roots: Vec<f32>,
}

impl SubsurfaceTable {
    /// For an index of refraction inside over outside and a mean cosine of scattering.
    pub(crate) fn new(ior: f32, g: f32) -> Self {
        let chances = chances(ior, g);
        let root = |i: usize| match i {
            0 => 1.0,
            INTERVALS => 0.0,
            _ => root_of(&chances, i as f64 / INTERVALS as f64),
        };
        Self { entering: entering(ior), roots: (0..=INTERVALS).map(root).collect() }
    }

    /// The albedo of a medium that gives back this share of the light that has entered.
    #[inline]
    pub(crate) fn albedo(&self, reflectance: f32) -> f32 {
        let place = reflectance.clamp(0.0, 1.0) * INTERVALS as f32;
        let low = (place as usize).min(INTERVALS - 1);
        let root = self.roots[low] + (place - low as f32) * (self.roots[low + 1] - self.roots[low]);
        1.0 - root * root
    }

    /// The share of the light that has entered which a medium of this albedo gives back.
    pub(crate) fn reflectance(&self, albedo: f32) -> f32 {
        let root = (1.0 - albedo).clamp(0.0, 1.0).sqrt();
        let high = self.roots.partition_point(|&r| r > root).clamp(1, INTERVALS);
        let [a, b] = [self.roots[high - 1], self.roots[high]];
        ((high - 1) as f32 + (a - root) / (a - b)) / INTERVALS as f32
    }
}

/// Share of even light that enters: 1 minus the mean of Fresnel's reflectance over the cosine's square.
fn entering(ior: f32) -> f32 {
    const STEPS: u32 = 4096;
    let part = |i: u32| {
        let cosine = ((f64::from(i) + 0.5) / f64::from(STEPS)).sqrt();
        1.0 - f64::from(fresnel::dielectric(cosine as f32, ior).0)
    };
    ((0..STEPS).map(part).sum::<f64>() / f64::from(STEPS)) as f32
}

/// The root of the distance from 1 of the albedo that reflects so much, between 0 and 1.
fn root_of(chances: &[f64], reflectance: f64) -> f32 {
    let [mut low, mut high] = [0.0_f64, 1.0];
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if reflected(chances, 1.0 - middle * middle) > reflectance { low = middle } else { high = middle }
    }
    (0.5 * (low + high)) as f32
}

/// Reflectance of a half-space of this albedo: the sum over the chances, the last of which is that of all longer walks.
fn reflected(chances: &[f64], albedo: f64) -> f64 {
    /// Quantiles of the lengths of walks that are not followed.
    const QUANTILES: u32 = 32;
    let (&longer, followed) = chances.split_last().expect("chances");
    let (mut sum, mut power) = (0.0, 1.0);
    for chance in followed {
        power *= albedo;
        sum += chance * power;
    }
    let tail = |i: u32| {
        let quantile = (f64::from(i) + 0.5) / f64::from(QUANTILES);
        albedo.powf(FOLLOWED as f64 / (quantile * quantile))
    };
    sum + longer * (0..QUANTILES).map(tail).sum::<f64>() / f64::from(QUANTILES)
}

/// The chances of coming up after 1, 2, ... scatterings, and after more than [`FOLLOWED`].
fn chances(ior: f32, g: f32) -> Vec<f64> {
    let empty = || vec![0.0; FOLLOWED + 1];
    let chunk = |chunk: u32| {
        let mut counts = empty();
        (chunk * CHUNK..(chunk + 1) * CHUNK).for_each(|walk| wander(walk, ior, g, &mut counts));
        counts
    };
    // In order, so that the sums do not depend on threads.
    let parts: Vec<Vec<f64>> = (0..WALKS / CHUNK).into_par_iter().map(chunk).collect();
    let mut sums = empty();
    for part in parts {
        sums.iter_mut().zip(part).for_each(|(sum, count)| *sum += count);
    }
    let total: f64 = sums.iter().sum();
    sums.iter_mut().for_each(|sum| *sum /= total);
    sums
}

/// One walk, in mean free paths below the surface; only depth and the cosine with the way down matter.
fn wander(walk: u32, ior: f32, g: f32, counts: &mut [f64]) {
    let mut bits = mix64(u64::from(walk));
    let mut number = || {
        bits = bits.wrapping_add(0x9e37_79b9_7f4a_7c15);
        (mix64(bits) >> 40) as f32 / (1_u32 << 24) as f32
    };
    // Even light: the square of the cosine is uniform.
    let squared = (walk as f32 + number()) / WALKS as f32;
    let (reflected, mut cosine) = fresnel::dielectric(squared.min(1.0).sqrt(), ior);
    let weight = f64::from(1.0 - reflected);
    let phase = HenyeyGreenstein::new(g);
    let (mut depth, mut scatterings) = (0.0_f32, 0);
    if weight <= 0.0 {
        return;
    }
    loop {
        let mut free = -(-number()).ln_1p();
        if cosine < 0.0 && depth + cosine * free < 0.0 {
            if number() >= fresnel::dielectric(-cosine, 1.0 / ior).0 {
                counts[scatterings - 1] += weight;
                return;
            }
            free += depth / cosine;
            (depth, cosine) = (0.0, -cosine);
        }
        depth += cosine * free;
        if scatterings == FOLLOWED {
            counts[FOLLOWED] += weight;
            return;
        }
        scatterings += 1;
        cosine = phase.turn(cosine, number(), number());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Suite, normal_tail};

    /// Chandrasekhar 1950, "Radiative Transfer": isotropic scattering without a surface reflects `1 - H(1)-like` sums;
    /// integrated over even light from outside that is `1 - 2 sqrt(1 - a) int H(mu) mu dmu`.
    #[test]
    fn reflectance_of_a_bare_half_space_is_chandrasekhars() {
        let chances = chances(1.0, 0.0);
        let mut suite = Suite::new(4);
        for albedo in [0.2, 0.6, 0.9, 0.99] {
            let (expected, found) = (h_reflectance(albedo), reflected(&chances, albedo));
            // Every walk brings at most the albedo, and at least nothing.
            let deviation = (found * (albedo - found).max(0.0) / f64::from(WALKS)).sqrt();
            let p = 2.0 * normal_tail(((found - expected) / deviation).abs());
            suite.judge(p, format_args!("albedo {albedo}: {found} instead of {expected}"));
        }
    }

    /// By iterating `1 / H(mu) = sqrt(1 - a) + a / 2 int H(x) x / (mu + x) dx`.
    fn h_reflectance(albedo: f64) -> f64 {
        const POINTS: usize = 400;
        let place = |i: usize| (i as f64 + 0.5) / POINTS as f64;
        let root = (1.0 - albedo).sqrt();
        let mut h = vec![1.0; POINTS];
        for _ in 0..400 {
            let next = |i: usize| {
                let mu = place(i);
                let part = |j: usize| h[j] * place(j) / (mu + place(j));
                (root + 0.5 * albedo * (0..POINTS).map(part).sum::<f64>() / POINTS as f64).recip()
            };
            let new: Vec<f64> = (0..POINTS).map(next).collect();
            h.iter_mut().zip(new).for_each(|(h, new)| *h = 0.5 * (*h + new));
        }
        1.0 - 2.0 * root * (0..POINTS).map(|i| h[i] * place(i)).sum::<f64>() / POINTS as f64
    }

    #[test]
    fn albedo_and_reflectance_are_inverse() {
        for (ior, g) in [(1.0, 0.0), (1.33, 0.0), (1.5, 0.8), (1.4, -0.4)] {
            let table = SubsurfaceTable::new(ior, g);
            assert_eq!((table.albedo(0.0), table.albedo(1.0)), (0.0, 1.0));
            for i in 1..100 {
                let reflectance = i as f32 / 100.0;
                let back = table.reflectance(table.albedo(reflectance));
                // Near white the root is lost in the rounding of 1 - root^2.
                let tolerance = 1e-5 + 4.0 * f32::EPSILON / (1.0 - table.albedo(reflectance)).sqrt();
                assert!((back - reflectance).abs() < tolerance, "{ior}, {g}: {back} of {reflectance}");
            }
        }
    }

    /// Fresnel's reflectance of even light at 1.5: 0.0918 (Duntley 1942, "The optical properties of diffusing materials").
    #[test]
    fn share_that_enters_is_duntleys() {
        assert!((entering(1.5) - (1.0 - 0.0918)).abs() < 1e-4, "{}", entering(1.5));
        assert_eq!(entering(1.0), 1.0);
    }
}
