//! Measured surfaces that were never measured: sheets of random numbers, and a surface that is known in closed form.

use super::super::{Bsdf, Conductor, ggx::Ggx};
use super::*;
use crate::desc::Sheets;
use crate::testing::{Mean, Rng, Suite, chi_square_directions, direction};

fn sheets<T>(size: [u32; 2], count: u32, mut value: impl FnMut(u32, Vec2) -> T) -> Sheets<T> {
    let mut values = Vec::new();
    for sheet in 0..count {
        for row in 0..size[1] {
            for column in 0..size[0] {
                let place = Vec2::new(column as f32, row as f32)
                    / Vec2::new(size[0] as f32 - 1.0, size[1] as f32 - 1.0);
                values.push(value(sheet, place));
            }
        }
    }
    Sheets { size, values }
}

/// Any sheets at all, for so many azimuths.
pub(crate) fn random(azimuths: usize) -> Arc<desc::Measured> {
    let mut rng = Rng::new(3 + azimuths as u64);
    let polar_angles = vec![0.0, 0.4, 0.9, 1.5];
    let count = (azimuths * polar_angles.len()) as u32;
    let step = TAU / (azimuths.max(2) - 1) as f32;
    let mut number = |least: f32| least + rng.next_1d();
    Arc::new(desc::Measured {
        azimuths: (0..azimuths).map(|i| i as f32 * step - PI).collect(),
        polar_angles,
        facets: sheets([4, 3], 1, |_, p| 1.0 - 0.8 * p.x),
        area: sheets([5, 4], 1, |_, p| 1.2 - p.x),
        // Whatever is far down is not seen, so that little is drawn below the horizon.
        visible: sheets([7, 6], count, |_, p| number(0.2) * (1.0 - p.x)),
        luminance: sheets([5, 5], count, |_, _| number(0.1)),
        colors: sheets([5, 6], count, |_, p| Vec3::new(0.9, 0.5, p.y)),
    })
}

#[test]
fn directions_are_drawn_by_their_density() {
    let views = [direction(0.3, 1.0), direction(1.1, -2.5), -direction(0.8, 0.4)];
    let mut suite = Suite::new(2 * views.len());
    for azimuths in [1, 6] {
        let table = MeasuredTable::new(&random(azimuths));
        let surface = Measured::new(&table);
        for (i, wo) in views.into_iter().enumerate() {
            let p = chi_square_directions(
                20 + i as u64,
                200_000,
                |rng: &mut Rng| surface.sample(wo, rng.next_2d()).map(|sample| sample.wi),
                |wi| surface.eval_pdf(wo, wi).1,
            );
            suite.judge(p, format_args!("{azimuths} azimuths, view {i}"));
        }
    }
}

/// The weight of a sample is value over density, and the density is that of the direction.
#[test]
fn samples_agree_with_evaluation() {
    let table = MeasuredTable::new(&random(6));
    let surface = Measured::new(&table);
    let mut rng = Rng::new(8);
    for _ in 0..2000 {
        let wo = rng.next_direction();
        let Some(sample) = surface.sample(wo, rng.next_2d()) else { continue };
        let (value, pdf) = surface.eval_pdf(wo, sample.wi);
        let polar = (wo + sample.wi).normalize().truncate().length();
        // Half vectors come back with an error of 1e-7, of which the map near the pole makes more.
        if polar < 1e-4 {
            continue;
        }
        assert!((pdf / sample.pdf - 1.0).abs() < 2e-2, "{pdf} {}", sample.pdf);
        let weight = value / pdf;
        assert!(
            (weight - sample.weight).abs().max_element() < 2e-2 * sample.weight.max_element(),
            "{weight}"
        );
    }
}

/// Maps there and back.
#[test]
fn sheets_are_inverted() {
    let desc = random(6);
    let distribution = Distribution::new(&desc.visible);
    let mix = Mix::new([&desc.azimuths, &desc.polar_angles], [0.7, 0.65]);
    let mut rng = Rng::new(4);
    for _ in 0..1000 {
        let u = rng.next_2d();
        let (place, pdf) = distribution.sample(u, &mix);
        let (back, same) = distribution.invert(place, &mix);
        assert!((back - u).abs().max_element() < 1e-4 && (pdf / same - 1.0).abs() < 1e-3, "{u} {back}");
        assert!((distribution.density(place, &mix) / pdf - 1.0).abs() < 1e-3);
    }
}

/// A rough conductor as if it had been measured: what is read from its tables is what it is, up to their resolution, which
/// halves the difference twice where it is doubled.
#[test]
fn a_conductor_that_was_measured_is_that_conductor() {
    let facets = Ggx::new(Vec2::splat(0.5)).expect("rough");
    let conductor = Bsdf::Conductor(Conductor::new(Vec3::splat(0.2), Vec3::splat(3.0), Some(facets)));
    let error = |resolution: u32| {
        let table = MeasuredTable::new(&measure(&conductor, facets, resolution));
        let surface = Measured::new(&table);
        let mut rng = Rng::new(12);
        let off = Mean::of(4000, || {
            let (wo, wi) = (
                direction(0.2 + f64::from(rng.next_1d()), 0.3),
                direction(f64::from(rng.next_1d()) * 1.3, 2.0),
            );
            let (expected, found) = (conductor.eval(wo, wi).x, surface.eval_pdf(wo, wi).0.x);
            f64::from((found / expected - 1.0).abs())
        });
        off.mean()
    };
    let (coarse, fine) = (error(16), error(32));
    assert!(fine < 0.5 * coarse, "{coarse} {fine}");
    // Even finer it still comes nearer: nothing but the resolution is wrong.
    assert!(error(64) < 0.5 * fine);
}

/// Fills tables as the device does: from what is seen.
fn measure(conductor: &Bsdf<'_>, ggx: Ggx, resolution: u32) -> Arc<desc::Measured> {
    let size = [resolution; 2];
    let polar_angles: Vec<f32> = (0..resolution).map(|i| 1.5 * i as f32 / (resolution - 1) as f32).collect();
    let facet = |p: Vec2| direction(f64::from(p.x * p.x * FRAC_PI_2), f64::from((2.0 * p.y - 1.0) * PI));
    let jacobian = |p: Vec2| 2.0 * PI * PI * p.x * (p.x * p.x * FRAC_PI_2).sin();
    let view = |sheet: u32| direction(f64::from(polar_angles[sheet as usize]), 0.0);
    let area = |wo: Vec3| wo.z / ggx.g1(wo);
    let visible = sheets([128, 128], resolution, |sheet, p| {
        let (wo, h) = (view(sheet), facet(p));
        (ggx.d(h) * wo.dot(h).max(0.0) / area(wo)) * jacobian(p)
    });
    let mut desc = desc::Measured {
        azimuths: vec![0.0],
        facets: sheets([256, 2], 1, |_, p| ggx.d(facet(p))),
        area: sheets([256, 2], 1, |_, p| area(direction(f64::from(p.x * p.x * FRAC_PI_2).min(1.57), 0.0))),
        luminance: sheets([2, 2], resolution, |_, _| 1.0),
        colors: Sheets { size, values: vec![] },
        visible,
        polar_angles: polar_angles.clone(),
    };
    let seen = Distribution::new(&desc.visible);
    desc.colors = sheets(size, resolution, |sheet, u| {
        let wo = view(sheet);
        let mix = Mix::new([&[0.0], &polar_angles], [0.0, polar_angles[sheet as usize]]);
        let (place, _) = seen.sample(u.clamp(Vec2::splat(1e-4), Vec2::splat(1.0 - 1e-4)), &mix);
        let h = facet(place);
        let wi = (2.0 * wo.dot(h) * h - wo).normalize();
        conductor.eval(wo, wi) * (4.0 * area(wo) / ggx.d(h))
    });
    Arc::new(desc)
}

/// Tables by formulas, of which a file for Mitsuba has been written, too.
fn agreed(azimuths: usize) -> Arc<desc::Measured> {
    let polar_angles = vec![0.0, 0.4, 0.9, 1.5];
    let count = (azimuths * polar_angles.len()) as u32;
    let step = TAU / (azimuths.max(2) - 1) as f32;
    Arc::new(desc::Measured {
        azimuths: if azimuths == 1 {
            vec![0.0]
        } else {
            (0..azimuths).map(|i| i as f32 * step - PI).collect()
        },
        polar_angles,
        facets: sheets([4, 3], 1, |_, p| 1.0 - 0.8 * p.x + 0.1 * p.y),
        // Mitsuba turns views of surfaces that look the same from all sides, where azimuths do not count.
        area: sheets([5, 4], 1, |_, p| 1.2 - p.x + if azimuths > 1 { 0.1 * p.y } else { 0.0 }),
        visible: sheets([7, 6], count, |i, p| 1.2 + (3.0 * i as f32 + 5.0 * p.x + 2.0 * p.y).sin()),
        luminance: sheets([6, 6], count, |i, p| 1.5 + (2.0 * i as f32 + 3.0 * p.x - 4.0 * p.y).cos()),
        colors: sheets([6, 6], count, |i, p| Vec3::splat(1.0 + 0.5 * (i as f32 + 6.0 * p.x + p.y).sin())),
    })
}

/// Values and densities of Mitsuba 3.9.1 (`measured`, `scalar_spectral`, spectra that are the same at all wavelengths) for
/// tables of the same numbers, see docs/materials.md.
#[test]
fn values_and_densities_are_those_of_a_witness() {
    /// Both count with some dozens of operations in `f32`, on angles of up to 2.8.
    const TOLERANCE: f32 = 1e-4;
    let expected = [
        [0.353_599_52, 0.245_904_42],
        [0.126_135_17, 0.045_630_965],
        [0.480_868_64, 0.051_307_23],
        [0.450_838_92, 0.081_687_964],
        [0.224_723_6, 0.324_756_3],
        [0.243_645_83, 0.664_948_94],
        [0.142_266_35, 0.035_492_38],
        [0.324_820_28, 0.095_643_75],
        [0.424_567_07, 0.045_815_047],
        [0.367_126_82, 0.193_896_04],
    ];
    let pairs = [
        [(0.3, 1.0), (0.5, -2.0)],
        [(0.3, 1.0), (0.9, 0.4)],
        [(1.1, -2.5), (0.2, 0.3)],
        [(1.1, -2.5), (0.7, 1.4)],
        [(0.7, 2.8), (1.0, -0.6)],
    ];
    for (i, [value, density]) in expected.into_iter().enumerate() {
        let table = MeasuredTable::new(&agreed(if i < pairs.len() { 1 } else { 5 }));
        let [wo, wi] = pairs[i % pairs.len()].map(|(theta, phi)| direction(theta, phi));
        let (found, pdf) = Measured::new(&table).eval_pdf(wo, wi);
        assert!((found.y / value - 1.0).abs() < TOLERANCE, "{i}: value {} for {value}", found.y);
        assert!((pdf / density - 1.0).abs() < TOLERANCE, "{i}: density {pdf} for {density}");
    }
}
