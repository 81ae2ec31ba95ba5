//! The spectra that scene files call by name: metals, glasses and standard illuminants.

use glam::DVec2;

use super::Spectrum;
use super::cie::Daylight;

/// Photon energies of [`METALS`], in eV: from 3.3 down to 1.6 in steps of 0.1.
const HIGHEST_ENERGY: f64 = 3.3;
const ENERGY_STEP: f64 = 0.1;
/// Energy times wavelength, in eV nm.
const EV_NM: f64 = 1_239.841_98;

/// Complex index of refraction of metals, eta + i k, at the photon energies above. Ag, Al and Au: E. D. Palik (ed.)
/// 1985, "Handbook of Optical Constants of Solids"; Cu: Hagemann, Gudat, Kunz 1975, J. Opt. Soc. Am. 65, 742; CuZn:
/// 70 % copper, Querry 1985, "Optical Constants", report CRDC-CR-85034.
#[allow(clippy::approx_constant, reason = "an index of refraction that happens to be 6.28")]
const METALS: [(&str, [f32; 18], [f32; 18]); 5] = [
    (
        "Ag",
        [
            0.200, 0.192, 0.173, 0.173, 0.160, 0.157, 0.144, 0.132, 0.130, 0.130, 0.129, 0.120, 0.121, 0.131,
            0.140, 0.140, 0.148, 0.143,
        ],
        [
            1.67, 1.81, 1.95, 2.11, 2.26, 2.40, 2.56, 2.72, 2.88, 3.07, 3.25, 3.45, 3.66, 3.88, 4.16, 4.43,
            4.74, 5.09,
        ],
    ),
    (
        "Al",
        [
            0.432, 0.460, 0.490, 0.523, 0.558, 0.598, 0.644, 0.695, 0.755, 0.826, 0.912, 1.020, 1.150, 1.300,
            1.490, 1.740, 2.140, 2.630,
        ],
        [
            4.56, 4.71, 4.86, 5.02, 5.20, 5.38, 5.58, 5.80, 6.03, 6.28, 6.55, 6.85, 7.15, 7.48, 7.82, 8.21,
            8.57, 8.60,
        ],
    ),
    (
        "Au",
        [
            1.696, 1.674, 1.658, 1.636, 1.616, 1.562, 1.426, 1.242, 0.916, 0.608, 0.402, 0.306, 0.236, 0.194,
            0.166, 0.160, 0.164, 0.176,
        ],
        [
            1.906, 1.936, 1.956, 1.958, 1.940, 1.904, 1.846, 1.796, 1.840, 2.120, 2.540, 2.880, 2.970, 3.060,
            3.150, 3.800, 4.357, 4.860,
        ],
    ),
    (
        "Cu",
        [
            1.248, 1.232, 1.208, 1.184, 1.176, 1.169, 1.160, 1.152, 1.137, 1.121, 1.037, 0.826, 0.468, 0.272,
            0.214, 0.213, 0.223, 0.244,
        ],
        [
            2.03, 2.07, 2.14, 2.21, 2.28, 2.36, 2.43, 2.50, 2.55, 2.60, 2.59, 2.60, 2.81, 3.24, 3.67, 4.05,
            4.43, 4.84,
        ],
    ),
    (
        "CuZn",
        [
            1.492, 1.475, 1.445, 1.388, 1.301, 1.164, 1.003, 0.842, 0.713, 0.614, 0.551, 0.498, 0.460, 0.449,
            0.444, 0.445, 0.452, 0.460,
        ],
        [
            1.816, 1.814, 1.805, 1.791, 1.783, 1.806, 1.878, 2.018, 2.205, 2.428, 2.659, 2.894, 3.163, 3.433,
            3.717, 4.016, 4.340, 4.696,
        ],
    ),
];

/// Sellmeier coefficients: B1 to B3, then C1 to C3 in square micrometres.
type Sellmeier = [f64; 6];

/// Glasses of Schott's catalogue, under pbrt's names for them.
const GLASSES: [(&str, Sellmeier); 7] = [
    (
        "glass-BK7",
        [1.039_612_12, 0.231_792_344, 1.010_469_45, 0.006_000_698_67, 0.020_017_914_4, 103.560_653],
    ),
    (
        "glass-BAF10",
        [1.585_149_5, 0.143_559_385, 1.085_212_69, 0.009_266_812_82, 0.042_448_980_5, 105.613_573],
    ),
    (
        "glass-FK51A",
        [0.971_247_817, 0.216_901_417, 0.904_651_666, 0.004_723_019_95, 0.015_357_561_2, 168.681_33],
    ),
    (
        "glass-LASF9",
        [2.000_295_47, 0.298_926_886, 1.806_918_43, 0.012_142_601_7, 0.053_873_623_6, 156.530_829],
    ),
    ("glass-F5", [1.524_818_89, 0.187_085_527, 1.427_290_15, 0.011_254_756, 0.058_899_539_2, 129.141_675]),
    ("glass-F10", [1.621_539_02, 0.256_287_842, 1.644_475_52, 0.012_224_145_7, 0.059_573_677_5, 147.468_793]),
    ("glass-F11", [1.737_596_95, 0.313_747_346, 1.898_781_01, 0.013_188_707, 0.062_306_814_2, 155.236_29]),
];

/// Chromaticities of the CIE's fluorescent lamps F1 to F12 (CIE 15:2004, table T.7): lights are given their own
/// strength, so that of a lamp's spectrum only its colour is left.
const FLUORESCENT: [[f64; 2]; 12] = [
    [0.3131, 0.3371],
    [0.3721, 0.3751],
    [0.4091, 0.3941],
    [0.4402, 0.4031],
    [0.3138, 0.3452],
    [0.3779, 0.3882],
    [0.3129, 0.3292],
    [0.3458, 0.3586],
    [0.3741, 0.3727],
    [0.3458, 0.3588],
    [0.3805, 0.3769],
    [0.4370, 0.4042],
];

/// All names, for messages.
pub(super) const NAMES: [&str; 37] = [
    "glass-BK7",
    "glass-BAF10",
    "glass-FK51A",
    "glass-LASF9",
    "glass-F5",
    "glass-F10",
    "glass-F11",
    "metal-Ag-eta",
    "metal-Ag-k",
    "metal-Al-eta",
    "metal-Al-k",
    "metal-Au-eta",
    "metal-Au-k",
    "metal-Cu-eta",
    "metal-Cu-k",
    "metal-CuZn-eta",
    "metal-CuZn-k",
    "metal-MgO-eta",
    "metal-MgO-k",
    "metal-TiO2-eta",
    "metal-TiO2-k",
    "stdillum-A",
    "stdillum-D50",
    "stdillum-D65",
    "stdillum-F1",
    "stdillum-F2",
    "stdillum-F3",
    "stdillum-F4",
    "stdillum-F5",
    "stdillum-F6",
    "stdillum-F7",
    "stdillum-F8",
    "stdillum-F9",
    "stdillum-F10",
    "stdillum-F11",
    "stdillum-F12",
    "illum-acesD60",
];

/// The spectrum called `name`.
pub(super) fn named(name: &str) -> Option<Spectrum> {
    if let Some(metal) = name.strip_prefix("metal-") {
        let (metal, part) = metal.rsplit_once('-')?;
        return match part {
            "eta" => self::metal(metal, true),
            "k" => self::metal(metal, false),
            _ => None,
        };
    }
    if let Some((_, [b1, b2, b3, c1, c2, c3])) = GLASSES.iter().find(|(glass, _)| *glass == name) {
        return Some(sampled(|square| {
            1.0 + square * (b1 / (square - c1) + b2 / (square - c2) + b3 / (square - c3))
        }));
    }
    if let Some(lamp) = name.strip_prefix("stdillum-F") {
        let number: usize = lamp.parse().ok()?;
        return Some(Spectrum::Chromaticity(DVec2::from_array(*FLUORESCENT.get(number.wrapping_sub(1))?)));
    }
    match name {
        // Defined by its temperature, with an older second radiation constant (CIE 15:2004, section 3.1).
        "stdillum-A" => Some(Spectrum::BlackBody(2855.5)),
        "stdillum-D50" => Some(daylight(5000.0)),
        "stdillum-D65" => Some(daylight(6500.0)),
        "illum-acesD60" => Some(daylight(6000.0)),
        _ => None,
    }
}

fn daylight(kelvin: f64) -> Spectrum {
    let daylight = Daylight::new(kelvin);
    let samples = (300..=830).step_by(10);
    Spectrum::Sampled(samples.map(|nm| (nm as f32, daylight.power(f64::from(nm)) as f32)).collect())
}

fn metal(name: &str, real: bool) -> Option<Spectrum> {
    match name {
        // Transparent in the visible range: Stephens and Malitson 1952, J. Res. NBS 49, 249 (MgO); DeVore 1951,
        // J. Opt. Soc. Am. 41, 416 (rutile, ordinary ray).
        "MgO" | "TiO2" if !real => return Some(Spectrum::Sampled(vec![(360.0, 0.0), (830.0, 0.0)])),
        "MgO" => {
            return Some(sampled(|square| {
                2.956_362 - 0.010_623_87 * square - 0.000_020_496_8 * square * square
                    + 0.021_957_70 / (square - 0.014_283_22)
            }));
        }
        "TiO2" => return Some(sampled(|square| 5.913 + 0.2441 / (square - 0.0803))),
        _ => {}
    }
    let (_, eta, k) = METALS.iter().find(|(metal, ..)| *metal == name)?;
    let values = if real { eta } else { k };
    let sample =
        |(i, &value): (usize, &f32)| ((EV_NM / (HIGHEST_ENERGY - i as f64 * ENERGY_STEP)) as f32, value);
    Some(Spectrum::Sampled(values.iter().enumerate().map(sample).collect()))
}

/// Index of refraction from its square, a function of the square of the wavelength in micrometres.
fn sampled(square_of_index: impl Fn(f64) -> f64) -> Spectrum {
    let sample = |nm: u32| {
        let micrometres = f64::from(nm) * 1e-3;
        (nm as f32, square_of_index(micrometres * micrometres).sqrt() as f32)
    };
    Spectrum::Sampled((360..=830).step_by(10).map(sample).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_has_a_spectrum() {
        for name in NAMES {
            assert!(named(name).is_some(), "{name}");
        }
        for name in ["metal-Ag", "metal-Xx-eta", "stdillum-F0", "stdillum-F13", "glass-", ""] {
            assert!(named(name).is_none(), "{name}");
        }
    }

    /// Indices at the sodium line, as Schott's catalogue and the tables of minerals give them.
    #[test]
    fn indices_of_refraction() {
        let cases = [
            ("glass-BK7", 1.5167),
            ("glass-BAF10", 1.6700),
            ("glass-FK51A", 1.4866),
            ("glass-LASF9", 1.8502),
            ("glass-F5", 1.6727),
            ("glass-F10", 1.7283),
            ("glass-F11", 1.7847),
            ("metal-MgO-eta", 1.737),
            ("metal-TiO2-eta", 2.613),
        ];
        for (name, expected) in cases {
            let found = named(name).expect("a name").at(589.0);
            assert!((found - expected).abs() < 1e-3, "{name}: {found}");
        }
    }
}
