//! The CIE 1931 standard observer, daylight and black bodies.

use glam::DVec3;

/// Wavelengths, in nm, over which spectra are integrated, one nm apart.
pub(super) const RANGE: std::ops::RangeInclusive<u32> = 360..=830;

/// The colour matching functions at a wavelength in nm: the multi-lobe fits of Wyman, Sloan and Shirley 2013,
/// "Simple Analytic Approximations to the CIE XYZ Color Matching Functions", equation 4.
pub(super) fn matching(wavelength: f64) -> DVec3 {
    let lobe = |height: f64, center: f64, below: f64, above: f64| {
        let slope = if wavelength < center { below } else { above };
        height * (-0.5 * ((wavelength - center) * slope).powi(2)).exp()
    };
    DVec3::new(
        lobe(0.362, 442.0, 0.0624, 0.0374) + lobe(1.056, 599.8, 0.0264, 0.0323)
            - lobe(0.065, 501.1, 0.0490, 0.0382),
        lobe(0.821, 568.8, 0.0213, 0.0247) + lobe(0.286, 530.9, 0.0613, 0.0322),
        lobe(1.217, 437.0, 0.0845, 0.0278) + lobe(0.681, 459.0, 0.0385, 0.0725),
    )
}

/// XYZ of the spectrum `power`, in nm to power per nm, up to a common factor.
pub(super) fn xyz(power: impl Fn(f64) -> f64) -> DVec3 {
    RANGE.map(|wavelength| power(wavelength.into()) * matching(wavelength.into())).sum()
}

/// Black-body radiation at `kelvin`, up to a factor (Planck's law).
pub(super) fn black_body(kelvin: f64, wavelength: f64) -> f64 {
    /// Second radiation constant in nm K (CODATA 2018).
    const C2: f64 = 1.438_776_877e7;
    // The peak of Wien's law keeps numbers in range whatever the temperature.
    let scaled = wavelength / 560.0;
    1.0 / (scaled.powi(5) * (C2 / (wavelength * kelvin)).exp_m1())
}

/// Mean and first two components of daylight from 300 nm to 830 nm, 10 nm apart (CIE 15:2004, table T.2).
const DAYLIGHT: [[f64; 3]; 54] = [
    [0.04, 0.02, 0.0],
    [6.0, 4.5, 2.0],
    [29.6, 22.4, 4.0],
    [55.3, 42.0, 8.5],
    [57.3, 40.6, 7.8],
    [61.8, 41.6, 6.7],
    [61.5, 38.0, 5.3],
    [68.8, 42.4, 6.1],
    [63.4, 38.5, 3.0],
    [65.8, 35.0, 1.2],
    [94.8, 43.4, -1.1],
    [104.8, 46.3, -0.5],
    [105.9, 43.9, -0.7],
    [96.8, 37.1, -1.2],
    [113.9, 36.7, -2.6],
    [125.6, 35.9, -2.9],
    [125.5, 32.6, -2.8],
    [121.3, 27.9, -2.6],
    [121.3, 24.3, -2.6],
    [113.5, 20.1, -1.8],
    [113.1, 16.2, -1.5],
    [110.8, 13.2, -1.3],
    [106.5, 8.6, -1.2],
    [108.8, 6.1, -1.0],
    [105.3, 4.2, -0.5],
    [104.4, 1.9, -0.3],
    [100.0, 0.0, 0.0],
    [96.0, -1.6, 0.2],
    [95.1, -3.5, 0.5],
    [89.1, -3.5, 2.1],
    [90.5, -5.8, 3.2],
    [90.3, -7.2, 4.1],
    [88.4, -8.6, 4.7],
    [84.0, -9.5, 5.1],
    [85.1, -10.9, 6.7],
    [81.9, -10.7, 7.3],
    [82.6, -12.0, 8.6],
    [84.9, -14.0, 9.8],
    [81.3, -13.6, 10.2],
    [71.9, -12.0, 8.3],
    [74.3, -13.3, 9.6],
    [76.4, -12.9, 8.5],
    [63.3, -10.6, 7.0],
    [71.7, -11.6, 7.6],
    [77.0, -12.2, 8.0],
    [65.2, -10.2, 6.7],
    [47.7, -7.8, 5.2],
    [68.6, -11.2, 7.4],
    [65.0, -10.4, 6.8],
    [66.0, -10.6, 7.0],
    [61.0, -9.7, 6.4],
    [53.3, -8.3, 5.5],
    [58.9, -9.3, 6.1],
    [61.9, -9.8, 6.5],
];

/// A phase of daylight, 100 at 560 nm (CIE 15:2004, section 3.1).
#[derive(Clone, Copy, Debug)]
pub(super) struct Daylight([f64; 2]);

impl Daylight {
    /// Daylight of a nominal correlated colour temperature between 4000 K and 7000 K, such as 6500 for D65.
    pub(super) fn new(nominal: f64) -> Self {
        // The names are older than today's second radiation constant.
        let kelvin = nominal * 1.4388 / 1.4380;
        let x = -4.6070e9 / kelvin.powi(3) + 2.9678e6 / kelvin.powi(2) + 0.09911e3 / kelvin + 0.244063;
        let y = -3.0 * x * x + 2.870 * x - 0.275;
        let below = 0.0241 + 0.2562 * x - 0.7341 * y;
        // As the standard says, to three digits.
        let rounded = |component: f64| (1000.0 * component).round() / 1000.0;
        Self([
            rounded((-1.3515 - 1.7703 * x + 5.9114 * y) / below),
            rounded((0.0300 - 31.4424 * x + 30.0717 * y) / below),
        ])
    }

    /// D65.
    pub(super) fn d65() -> Self {
        Self::new(6500.0)
    }

    /// Its power at a wavelength in nm.
    pub(super) fn power(&self, wavelength: f64) -> f64 {
        let place = ((wavelength - 300.0) / 10.0).clamp(0.0, 53.0);
        let (cell, t) = ((place as usize).min(52), place - (place as usize).min(52) as f64);
        let component = |i: usize| DAYLIGHT[cell][i] * (1.0 - t) + DAYLIGHT[cell + 1][i] * t;
        component(0) + self.0[0] * component(1) + self.0[1] * component(2)
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;

    fn chromaticity(xyz: DVec3) -> DVec2 {
        xyz.truncate() / xyz.element_sum()
    }

    /// Chromaticities the CIE gives. The fits of the observer are good to half a percent of its peak (Wyman, Sloan
    /// and Shirley, table 1), which moves chromaticities by less than that.
    #[test]
    fn known_chromaticities() {
        let cases = [
            ("equal energy", xyz(|_| 1.0), [1.0 / 3.0, 1.0 / 3.0]),
            ("D65", xyz(|w| Daylight::d65().power(w)), [0.3127, 0.3290]),
            ("D50", xyz(|w| Daylight::new(5000.0).power(w)), [0.3457, 0.3585]),
            ("illuminant A", xyz(|w| black_body(2855.5, w)), [0.4476, 0.4074]),
        ];
        for (name, xyz, expected) in cases {
            let off = (chromaticity(xyz) - DVec2::from_array(expected)).abs().max_element();
            assert!(off < 5e-3, "{name}: {} instead of {expected:?}", chromaticity(xyz));
        }
    }

    #[test]
    fn daylight_as_tabulated() {
        // CIE 15:2004, table T.1.
        for (wavelength, power) in [(400.0, 82.75), (450.0, 117.01), (560.0, 100.0), (700.0, 71.61)] {
            let found = Daylight::d65().power(wavelength);
            assert!((found - power).abs() < 0.006, "{wavelength} nm: {found}");
        }
    }

    #[test]
    fn black_bodies_peak_where_wien_says() {
        let peak = (300..900)
            .max_by(|a, b| black_body(5000.0, f64::from(*a)).total_cmp(&black_body(5000.0, f64::from(*b))));
        assert_eq!(peak, Some(580));
        assert!(black_body(100.0, 360.0) >= 0.0 && black_body(1e6, 360.0).is_finite());
    }
}
