//! Values of Mitsuba 3.9.1 (`scalar_rgb`), BSDF times cosine, as a second witness; docs/materials.md has the script.
//!
//! Mitsuba multiplies masking and shadowing as if they were independent, where ours are height-correlated: the ratio of
//! the two is taken out before comparing.

use glam::Vec3;

use super::{brushed, gold};
use crate::bsdf::{Bsdf, CoatedDiffuse, Dielectric, Hair, HairParams, ThinDielectric, layered::CoatTable};

/// Values are printed with seven digits, and some dozens of operations in `f32` lie behind either. A direction with
/// digits cut off off by 1e-7 moves a lobe of width 0.1 by a few parts in 1e5.
const TOLERANCE: f32 = 1e-4;

const HIGH: Vec3 = Vec3::new(0.372_025_6, 0.115_081, 0.921_061);
const LOW: Vec3 = Vec3::new(0.532_440_8, 0.829_227_4, 0.169_967_1);
const ACROSS: Vec3 = Vec3::new(-0.474_627_7, 0.067_656_54, 0.877_582_6);
const ASIDE: Vec3 = Vec3::new(-0.609_221_4, -0.705_369_5, 0.362_357_8);

fn assert_close(found: Vec3, expected: Vec3, what: &str) {
    assert_within(TOLERANCE, found, expected, what);
}

fn assert_within(tolerance: f32, found: Vec3, expected: Vec3, what: &str) {
    let off = ((found - expected) / expected).abs().max_element();
    assert!(off < tolerance, "{what}: {found}, expected {expected}, off by {off}");
}

/// Masking and shadowing as if independent, over ours.
fn independence(wo: Vec3, wi: Vec3) -> f32 {
    let ggx = brushed(0.1, 0.4).expect("rough");
    ggx.g1(wo) * ggx.g1(wi) / ggx.g2(wo, wi)
}

#[test]
fn anisotropic_gold() {
    let metal = gold(brushed(0.1, 0.4));
    for (wo, wi, expected) in [
        (HIGH, ACROSS, [1.083_06, 0.890_672_5, 0.429_287_9]),
        (HIGH, ASIDE, [0.084_201_79, 0.069_309_32, 0.034_158_08]),
        (LOW, ACROSS, [0.596_662, 0.491_352_1, 0.243_481_3]),
        (LOW, ASIDE, [0.593_555_3, 0.516_525_9, 0.323_912_3]),
    ] {
        let found = metal.eval(wo, wi) * independence(wo, wi);
        assert_close(found, Vec3::from(expected), &format!("{wo} -> {wi}"));
    }
}

#[test]
fn anisotropic_glass() {
    let glass = Bsdf::Dielectric(Dielectric::new(1.5, brushed(0.1, 0.4), Vec3::ONE));
    for (wo, wi, expected) in [
        (HIGH, ACROSS, 0.046_656_705),
        (LOW, ASIDE, 0.147_184_71),
        // Into the glass and out of it.
        (
            Vec3::new(-0.370_873_1, -0.810_372_6, 0.453_596_1),
            Vec3::new(0.283_844_6, 0.730_091_3, -0.621_61),
            3.242_328_2,
        ),
        (
            Vec3::new(-0.226_308_2, -0.517_306_2, -0.825_335_6),
            Vec3::new(0.325_389_9, 0.639_313, 0.696_706_7),
            26.211_346,
        ),
    ] {
        let found = glass.eval(wo, wi) * independence(wo, wi);
        assert_close(found, Vec3::splat(expected), &format!("{wo} -> {wi}"));
    }
}

/// Mitsuba's `plastic` with `nonlinear`: a diffuse base under a smooth coat, all reflections between them summed up,
/// nothing absorbed. It takes the internal reflectance from a fit, which gives 0.596_811_06 where integration gives
/// 0.596_345_76: the ratio of the two series is taken out.
#[test]
fn plastic() {
    let table = CoatTable::new(1.5, 0.0, Some(0.0));
    let coat = Dielectric::new(1.5, None, Vec3::ONE);
    let reflectance = Vec3::new(0.9, 0.5, 0.2);
    let plastic = CoatedDiffuse::new(coat, &table, reflectance, 1000);
    let fit = (1.0 - 0.596_345_8 * reflectance) / (1.0 - 0.596_811_06 * reflectance);
    for (wo, wi, expected) in [
        (HIGH, ACROSS, [0.222_077_9, 0.081_396_49, 0.025_939_08]),
        (HIGH, ASIDE, [0.080_711_16, 0.029_582_44, 0.009_427_204]),
        (LOW, ACROSS, [0.139_993_9, 0.051_310_9, 0.016_351_53]),
        (LOW, ASIDE, [0.050_878_88, 0.018_648_24, 0.005_942_741]),
    ] {
        let found = plastic.eval_pdf(wo, wi).0 * fit;
        assert_close(found, Vec3::from(expected), &format!("{wo} -> {wi}"));
    }
}

#[test]
fn pane() {
    let pane = ThinDielectric { ior: 1.5 };
    for (angle, expected) in
        [(0.0f32, 0.076_923_09), (0.5, 0.079_216_3), (1.0, 0.143_890_95), (1.4, 0.566_443_3)]
    {
        assert_close(Vec3::splat(pane.reflectance(angle.cos())), Vec3::splat(expected), "reflectance");
    }
}

/// Brown hair with tilted scales, hit off its middle. Mitsuba (and pbrt) halve the second term of the asymptotic series
/// of the Bessel function, which is an error of a sixteenth of a lobe's variance.
#[test]
fn hair() {
    for (h, wo, wi, expected) in [
        (
            -0.38941834f32,
            [0.2, 0.3815505, 0.9024518],
            [-0.19, -0.8261428, 0.5304602],
            [0.0047552204, 0.0046317987, 0.004_608_414],
        ),
        (
            -0.38941834f32,
            [0.2, 0.3815505, 0.9024518],
            [-0.25, 0.1366389, -0.9585561],
            [4.7111664, 2.5709183, 0.61756754],
        ),
        (
            0.64421769f32,
            [-0.5, -0.5579089, 0.6623728],
            [0.53, 0.8458734, 0.059985],
            [0.004910822, 0.0047057844, 0.0046671075],
        ),
        (
            -0.932_039_1_f32,
            [0.1, 0.9273672, 0.3605414],
            [-0.12, -0.3866044, 0.9144053],
            [0.0025249084, 0.000_745_708, 0.00026506596],
        ),
    ] {
        let hair = Hair::new(&HairParams {
            h,
            ior: 1.55,
            absorption: Vec3::new(0.46, 0.77, 1.5),
            beta_m: 0.04,
            beta_n: 0.3,
            tilt: 2f32.to_radians(),
        });
        let found = Bsdf::Hair(hair).eval(wo.into(), wi.into());
        let root_v = 0.726 * 0.04 + 0.812 * 0.04 * 0.04;
        // TRT is the widest lobe.
        let tolerance = TOLERANCE + 4.0 * root_v * root_v / 16.0;
        assert_within(tolerance, found, expected.into(), &format!("{wo:?} -> {wi:?}"));
    }
}
