//! Spectra, and what they are in linear Rec.709.
//!
//! pbrt draws with wavelengths and this renderer with three channels, so each spectrum becomes what a white (D65)
//! light would show of it. Light that saturated surfaces throw at each other differs by the nature of that.

mod cie;
mod color_space;
mod named;

use std::path::Path;

use glam::{DVec2, DVec3, Vec3};

use super::fault::{Context, Fault, Result, unknown};
use super::params::{Kind, Param, Params, Values, number};
use crate::error::{ErrorKind, SceneError};
use crate::file;
use cie::Daylight;
pub(super) use color_space::ColorSpace;

/// A spectrum as a scene file gives it.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Spectrum {
    /// A colour of a colour space.
    Rgb(ColorSpace, Vec3),
    /// Values at wavelengths in nm, which grow; linear in between, 0 outside.
    Sampled(Vec<(f32, f32)>),
    /// A black body, in kelvin.
    BlackBody(f32),
    /// A light of which only the colour is known.
    Chromaticity(DVec2),
}

/// The types that a spectrum may have.
pub(super) const KINDS: [Kind; 3] = [Kind::Rgb, Kind::Spectrum, Kind::Blackbody];

impl Spectrum {
    /// What `param` says.
    pub(super) fn read(param: &Param, context: &Context) -> Result<Self> {
        let refuse = |message: String| Err(Fault::invalid(param.place, message));
        let name = &param.name;
        match (&param.values, param.kind) {
            (Values::Numbers(values), Kind::Rgb) => match values[..] {
                [r, g, b] if values.iter().all(|value| *value >= 0.0) => {
                    Ok(Self::Rgb(param.space, Vec3::new(r, g, b)))
                }
                [_, _, _] => refuse(format!("\"rgb {name}\" has a negative component")),
                _ => refuse(format!("\"rgb {name}\" has {} values, expected 3", values.len())),
            },
            (Values::Numbers(values), Kind::Blackbody) => match values[..] {
                [kelvin] if kelvin > 0.0 => Ok(Self::BlackBody(kelvin)),
                _ => refuse(format!("\"blackbody {name}\" expects one temperature above 0, in kelvin")),
            },
            (Values::Numbers(values), _) => {
                samples(values).or_else(|message| refuse(format!("\"spectrum {name}\" {message}")))
            }
            (Values::Strings(values), _) => match &values[..] {
                [text] => Self::named(text, param, context),
                _ => refuse(format!("\"spectrum {name}\" has {} names, expected 1", values.len())),
            },
            _ => refuse(format!("\"{name}\" is no spectrum")),
        }
    }

    /// A spectrum by its name or in a file.
    fn named(text: &str, param: &Param, context: &Context) -> Result<Self> {
        if let Some(spectrum) = named::named(text) {
            return Ok(spectrum);
        }
        let path = context.resolve(text);
        if !path.is_file() && !text.contains(['.', '/']) {
            return Err(Fault::invalid(param.place, unknown("spectrum", text, &named::NAMES)));
        }
        read_file(&path).map_err(|error| context.blame(param.place, error))
    }

    /// The spectrum that scene files call `name`; without light where there is none of that name.
    pub(super) fn known(name: &str) -> Self {
        named::named(name).unwrap_or(Self::Rgb(ColorSpace::Srgb, Vec3::ZERO))
    }

    /// Its value at a wavelength in nm.
    pub(super) fn at(&self, wavelength: f32) -> f32 {
        match self {
            Self::Sampled(samples) => interpolate(samples, wavelength),
            Self::BlackBody(kelvin) => cie::black_body(f64::from(*kelvin), wavelength.into()) as f32,
            Self::Rgb(..) | Self::Chromaticity(_) => 1.0,
        }
    }

    /// As the colour of a light. Unless it is a colour already, its luminance is 1: so pbrt-v4 does it, and scenes
    /// give the strength beside it.
    pub(super) fn light(&self) -> Vec3 {
        let xyz = match self {
            Self::Rgb(space, rgb) => return space.light(*rgb),
            Self::Chromaticity(xy) => color_space::xyz_of(*xy),
            _ => cie::xyz(|wavelength| f64::from(self.at(wavelength as f32))),
        };
        if xyz.y > 0.0 {
            color_space::rgb_from_xyz(xyz / xyz.y).as_vec3().max(Vec3::ZERO)
        } else {
            Vec3::ZERO
        }
    }

    /// As the colour of a light, with the strength that its own values give it.
    pub(super) fn radiance(&self) -> Vec3 {
        match self {
            Self::Rgb(..) | Self::Chromaticity(_) => self.light(),
            Self::BlackBody(kelvin) => glow(f64::from(*kelvin)),
            Self::Sampled(_) => {
                let xyz = cie::xyz(|wavelength| f64::from(self.at(wavelength as f32)));
                color_space::rgb_from_xyz(xyz / cie::xyz(|_| 1.0).y).as_vec3().max(Vec3::ZERO)
            }
        }
    }

    /// As a factor of light: a reflectance or a coefficient, what white light shows of it.
    pub(super) fn factor(&self) -> Vec3 {
        match self {
            Self::Rgb(space, rgb) => space.factor(*rgb),
            Self::Chromaticity(_) => self.light(),
            _ => shown(|wavelength| f64::from(self.at(wavelength as f32))).max(Vec3::ZERO),
        }
    }

    /// As one number: its mean weighted by what the eye sees.
    pub(super) fn mean(&self) -> f32 {
        match self {
            Self::Rgb(..) | Self::Chromaticity(_) => self.factor().dot(Vec3::new(0.2126, 0.7152, 0.0722)),
            _ => {
                let luminance = |power: &dyn Fn(f64) -> f64| cie::xyz(power).y;
                (luminance(&|w| f64::from(self.at(w as f32))) / luminance(&|_| 1.0)) as f32
            }
        }
    }

    /// As an index of refraction of each channel: its mean over the wavelengths which that channel shows.
    pub(super) fn index(&self) -> Vec3 {
        if let Self::Rgb(_, rgb) = self {
            return *rgb;
        }
        let wavelengths: Vec<f32> = (0..=30).map(|i| 400.0 + 10.0 * i as f32).collect();
        let shares = channels_of_wavelengths(&wavelengths);
        let (mut sum, mut all) = (Vec3::ZERO, Vec3::ZERO);
        for (wavelength, share) in wavelengths.into_iter().zip(shares) {
            // What a channel lacks of other colours is no place where it is seen.
            let share = share.max(Vec3::ZERO);
            sum += share * self.at(wavelength);
            all += share;
        }
        sum / all
    }

    /// Whether it has the same value at all wavelengths that are seen.
    pub(super) fn is_flat(&self) -> bool {
        match self {
            Self::Rgb(_, rgb) => rgb.x == rgb.y && rgb.y == rgb.z,
            Self::Sampled(_) => {
                let first = self.at(400.0);
                (0..=60).all(|i| self.at(400.0 + 5.0 * i as f32) == first)
            }
            _ => false,
        }
    }
}

/// The light of a black body at `kelvin` whose brightest wavelength has the radiance 1; none below 100 K.
pub(super) fn glow(kelvin: f64) -> Vec3 {
    /// Wien's displacement constant in nm K (CODATA 2018).
    const WIEN: f64 = 2.897_771_955e6;
    if kelvin <= 100.0 || !kelvin.is_finite() {
        return Vec3::ZERO;
    }
    let brightest = cie::black_body(kelvin, WIEN / kelvin);
    let xyz = cie::xyz(|wavelength| cie::black_body(kelvin, wavelength) / brightest);
    color_space::rgb_from_xyz(xyz / cie::xyz(|_| 1.0).y).as_vec3().max(Vec3::ZERO)
}

/// How much each of ascending wavelengths adds to the channels of what white light shows, where reflectances are linear
/// between them and stay as they are beyond the ends.
pub(crate) fn channels_of_wavelengths(wavelengths: &[f32]) -> Vec<Vec3> {
    let tent = |i: usize, at: f64| {
        let place = |j: usize| f64::from(wavelengths[j]);
        let edge = |j: usize, from: usize| {
            let width = place(j) - place(from);
            if width == 0.0 { 0.0 } else { ((at - place(from)) / width).clamp(0.0, 1.0) }
        };
        let rise = if i == 0 { 1.0 } else { edge(i, i - 1) };
        let fall = if i + 1 == wavelengths.len() { 1.0 } else { edge(i, i + 1) };
        if at < place(i) { rise } else { fall }
    };
    (0..wavelengths.len()).map(|i| shown(|at| tent(i, at))).collect()
}

/// The colour of daylight of a correlated colour temperature (CIE 15:2004, section 3.1), and below 4000 K, where there is no
/// daylight, of a black body; of luminance 1.
pub(super) fn daylight(kelvin: f64) -> Vec3 {
    let k = kelvin.min(25_000.0);
    if k < 4000.0 {
        let light = glow(k);
        return light / light.dot(Vec3::new(0.2126, 0.7152, 0.0722)).max(f32::MIN_POSITIVE);
    }
    let x = if k <= 7000.0 {
        -4.6070e9 / k.powi(3) + 2.9678e6 / k.powi(2) + 0.09911e3 / k + 0.244063
    } else {
        -2.0064e9 / k.powi(3) + 1.9018e6 / k.powi(2) + 0.24748e3 / k + 0.237040
    };
    let y = -3.0 * x * x + 2.870 * x - 0.275;
    color_space::rgb_from_xyz(color_space::xyz_of(glam::DVec2::new(x, y))).as_vec3()
}

/// What white light shows of a surface with this reflectance. Normalised by what it shows of white: the fitted
/// observer's own white is a little off.
fn shown(reflectance: impl Fn(f64) -> f64) -> Vec3 {
    let white = Daylight::d65();
    let rgb = |power: &dyn Fn(f64) -> f64| color_space::rgb_from_xyz(cie::xyz(power));
    let of_white: DVec3 = rgb(&|wavelength| white.power(wavelength));
    (rgb(&|wavelength| white.power(wavelength) * reflectance(wavelength)) / of_white).as_vec3()
}

/// The complex index of refraction of a metal in each channel: eta as white light shows it, and k so that the channel
/// reflects at normal incidence what the spectra reflect.
pub(super) fn metal_index(eta: &Spectrum, k: &Spectrum) -> [Vec3; 2] {
    if let (Spectrum::Rgb(..), Spectrum::Rgb(..)) = (eta, k) {
        return [eta.factor(), k.factor()];
    }
    let value = |spectrum: &Spectrum, wavelength: f64| match spectrum {
        Spectrum::Rgb(..) => f64::from(spectrum.mean()),
        _ => f64::from(spectrum.at(wavelength as f32)),
    };
    let reflectance = |wavelength: f64| {
        let (eta, k) = (value(eta, wavelength), value(k, wavelength));
        ((eta - 1.0).powi(2) + k * k) / ((eta + 1.0).powi(2) + k * k)
    };
    // Below 0 nothing is meant, and at 1 k would be infinite.
    let seen = shown(reflectance).clamp(Vec3::ZERO, Vec3::splat(0.9999));
    let eta = eta.factor().max(Vec3::splat(1e-3));
    let square = (seen * (eta + 1.0) * (eta + 1.0) - (eta - 1.0) * (eta - 1.0)) / (1.0 - seen);
    [eta, square.max(Vec3::ZERO).map(f32::sqrt)]
}

fn interpolate(samples: &[(f32, f32)], wavelength: f32) -> f32 {
    let after = samples.partition_point(|(w, _)| *w < wavelength);
    match (after.checked_sub(1).map(|i| samples[i]), samples.get(after)) {
        (Some((w0, v0)), Some((w1, v1))) => v0 + (v1 - v0) * (wavelength - w0) / (w1 - w0),
        (None, Some((w, v))) if *w == wavelength => *v,
        _ => 0.0,
    }
}

/// Pairs of wavelength and value; else what is wrong with them.
fn samples(values: &[f32]) -> std::result::Result<Spectrum, String> {
    let (pairs, rest) = values.as_chunks::<2>();
    if !rest.is_empty() {
        return Err(format!("has {} values, expected pairs of wavelength and value", values.len()));
    }
    if let Some(pair) = pairs.windows(2).find(|pair| pair[1][0] <= pair[0][0]) {
        return Err(format!("has wavelength {} after {}, expected growing ones", pair[1][0], pair[0][0]));
    }
    if pairs.is_empty() {
        return Err("has no values, expected pairs of wavelength and value".to_owned());
    }
    Ok(Spectrum::Sampled(pairs.iter().map(|[wavelength, value]| (*wavelength, *value)).collect()))
}

/// A file of pairs of wavelength and value, `#` starting comments.
fn read_file(path: &Path) -> std::result::Result<Spectrum, SceneError> {
    let bytes = file::read_unpacked(path)?;
    let text = String::from_utf8_lossy(&bytes);
    let mut values = Vec::new();
    for (row, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or("");
        for word in line.split([' ', '\t', ',', ';']).filter(|word| !word.is_empty()) {
            let Some(value) = number(word) else {
                let message = format!("{word}: expected a number");
                return Err(SceneError::new(ErrorKind::Syntax, path, format!("{}", row + 1), message));
            };
            values.push(value);
        }
    }
    samples(&values)
        .map_err(|message| SceneError::new(ErrorKind::Invalid, path, "", format!("the spectrum {message}")))
}

impl Params {
    /// A spectrum, if it is given.
    pub(super) fn spectrum(&self, name: &'static str, context: &Context) -> Result<Option<Spectrum>> {
        self.find(name, &KINDS)?.map(|param| Spectrum::read(param, context)).transpose()
    }

    /// The colour of a light, white by default; see [`Spectrum::light`].
    pub(super) fn light(&self, name: &'static str, context: &Context) -> Result<Vec3> {
        Ok(self.spectrum(name, context)?.map_or(Vec3::ONE, |spectrum| spectrum.light()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_energy_is_white_on_a_surface_and_pink_in_a_light() {
        let flat = samples(&[300.0, 0.5, 900.0, 0.5]).expect("sound");
        assert!((flat.factor() - 0.5).abs().max_element() < 1e-6);
        assert!(flat.is_flat());
        assert!((flat.mean() - 0.5).abs() < 1e-6);
        // XYZ (1, 1, 1) in linear Rec.709, to the accuracy of the fitted observer.
        let light = flat.light();
        assert!((light - Vec3::new(1.2048, 0.9483, 0.9087)).abs().max_element() < 0.02, "{light}");
    }

    #[test]
    fn lights_have_luminance_1_unless_they_are_colours() {
        for spectrum in [
            Spectrum::BlackBody(3000.0),
            Spectrum::Chromaticity(DVec2::new(0.3458, 0.3586)),
            samples(&[400.0, 10.0, 500.0, 80.0, 700.0, 30.0]).expect("sound"),
        ] {
            let luminance = spectrum.light().dot(Vec3::new(0.2126, 0.7152, 0.0722));
            assert!((luminance - 1.0).abs() < 1e-3, "{spectrum:?}: {luminance}");
        }
        let rgb = Vec3::new(3.0, 2.0, 1.0);
        assert_eq!(Spectrum::Rgb(ColorSpace::Srgb, rgb).light(), rgb);
        assert_eq!(samples(&[400.0, 0.0, 700.0, 0.0]).expect("sound").light(), Vec3::ZERO);
    }

    #[test]
    fn metals_reflect_in_their_colour() {
        let of = |metal: &str| {
            let part = |part: &str| named::named(&format!("metal-{metal}-{part}")).expect("a name");
            let [eta, k] = metal_index(&part("eta"), &part("k"));
            ((eta - 1.0) * (eta - 1.0) + k * k) / ((eta + 1.0) * (eta + 1.0) + k * k)
        };
        let (gold, copper, silver, aluminium) = (of("Au"), of("Cu"), of("Ag"), of("Al"));
        assert!(gold.x > 0.9 && gold.z < 0.5, "{gold}");
        assert!(copper.x > copper.y && copper.y > copper.z, "{copper}");
        assert!(silver.min_element() > 0.9, "{silver}");
        assert!((aluminium - 0.91).abs().max_element() < 0.02, "{aluminium}");
    }

    #[test]
    fn samples_must_grow_and_come_in_pairs() {
        for values in [&[400.0][..], &[500.0, 1.0, 400.0, 1.0], &[400.0, 1.0, 400.0, 2.0], &[]] {
            assert!(samples(values).is_err(), "{values:?}");
        }
        let ramp = samples(&[400.0, 0.0, 500.0, 1.0]).expect("sound");
        assert_eq!(
            [ramp.at(399.0), ramp.at(400.0), ramp.at(450.0), ramp.at(500.0), ramp.at(501.0)],
            [0.0, 0.0, 0.5, 1.0, 0.0]
        );
    }
}
