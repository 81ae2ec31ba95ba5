//! The lenses of realistic cameras, as the one thin lens that draws as large and as blurred a picture: what paraxial rays
//! make of them (Born and Wolf, "Principles of Optics", 4.4; matrices as in Gerrard and Burch 1975, "Introduction to Matrix
//! Methods in Optics", chapter 2).

use glam::{DMat2, DVec2};

use super::draft::{Draft, Entity};
use super::fault::{Context, Fault, Result};
use super::params::Params;

/// Surfaces of a lens file.
const MAX_SURFACES: usize = 1024;
/// Lens files count in millimetres, scenes with such cameras in metres.
const MILLIMETRE: f64 = 1e-3;

/// A thin lens before a film. Lengths are in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ThinLens {
    /// Of its opening.
    pub radius: f64,
    /// From the film to the lens, where all is one.
    pub image: f64,
    /// From the lens to what is sharp.
    pub object: f64,
    /// From the film to where the lens stands for what is before it.
    pub place: f64,
    /// Height of the film.
    pub height: f64,
}

impl ThinLens {
    /// Irradiance of the film in the middle for a radiance of 1.
    pub(super) fn brightness(&self) -> f32 {
        (std::f64::consts::PI * (self.radius / self.image).powi(2)) as f32
    }
}

/// A row of a lens file: a surface, from front to back.
#[derive(Clone, Copy, Debug)]
struct Surface {
    /// Above 0 where its middle lies behind it; 0 for the stop.
    radius: f64,
    /// To the next one.
    thickness: f64,
    /// Index of refraction behind it.
    index: f64,
    diameter: f64,
}

/// The lens of the camera of a scene, if it has lenses.
pub(super) fn of(draft: &Draft, size: [u32; 2], context: &Context) -> Result<Option<ThinLens>> {
    let Some((Entity { kind, params, .. }, ..)) = &draft.camera else { return Ok(None) };
    if &**kind != "realistic" {
        return Ok(None);
    }
    let Some(name) = params.string("lensfile")? else {
        return Err(Fault::invalid(params.place, format!("{} has no \"string lensfile\"", params.owner)));
    };
    let place = params.place_of("lensfile");
    let path = context.resolve(name);
    let bytes = crate::file::read(&path).map_err(|error| context.blame(place, error))?;
    let refuse = |message: String| Fault::invalid(place, format!("lens file {}: {message}", path.display()));
    let surfaces = surfaces(&String::from_utf8_lossy(&bytes)).map_err(refuse)?;
    let diagonal = match &draft.film {
        Some(film) => film.params.float_where("diagonal", 35.0, |d| d > 0.0, "above 0")?,
        None => 35.0,
    };
    let [width, height] = size.map(f64::from);
    let height = f64::from(diagonal) * MILLIMETRE * height / width.hypot(height);
    params.ignore(&["aperture"]);
    if params.has("aperture") {
        context.warn(params.place_of("aperture"), "the opening of a lens is drawn round");
    }
    thin(&surfaces, params, height)?.map(Some).ok_or_else(|| {
        let message =
            "no picture is focused by these lenses, or none on a film that close to what should be sharp";
        refuse(message.to_owned())
    })
}

/// Numbers by four, with comments from `#` on.
fn surfaces(text: &str) -> std::result::Result<Vec<Surface>, String> {
    let words = text.lines().flat_map(|line| line.split('#').next().unwrap_or("").split_whitespace());
    let number = |word: &str| super::params::number(word).ok_or_else(|| format!("\"{word}\" is no number"));
    let numbers = words.map(number).collect::<std::result::Result<Vec<f32>, String>>()?;
    let (rows, rest) = numbers.as_chunks::<4>();
    if !rest.is_empty() || rows.is_empty() || rows.len() > MAX_SURFACES {
        return Err(format!("has {} numbers, expected four for each surface", numbers.len()));
    }
    if rows.iter().flatten().any(|number| !number.is_finite()) {
        return Err("expected finite numbers".to_owned());
    }
    let surface = |row: &[f32; 4]| {
        let [radius, thickness, index, diameter] = row.map(f64::from);
        let index = if index == 0.0 { 1.0 } else { index };
        let [radius, thickness, diameter] = [radius, thickness, diameter].map(|length| length * MILLIMETRE);
        Surface { radius, thickness, index, diameter }
    };
    Ok(rows.iter().map(surface).collect())
}

/// What the surfaces do to paraxial rays, of which there is the height and the slope, from the front to the last surface;
/// and the height of a ray of height 1 at the stop, with the stop's diameter.
fn trace(surfaces: &[Surface]) -> (DMat2, Option<(f64, f64)>) {
    let (mut all, mut before, mut stop) = (DMat2::IDENTITY, 1.0, None);
    for (i, surface) in surfaces.iter().enumerate() {
        if surface.radius == 0.0 {
            stop = Some(((all * DVec2::X).x, surface.diameter));
        } else {
            let bend = (before - surface.index) / (surface.radius * surface.index);
            all = DMat2::from_cols_array(&[1.0, bend, 0.0, before / surface.index]) * all;
            before = surface.index;
        }
        if i + 1 < surfaces.len() {
            all = DMat2::from_cols_array(&[1.0, 0.0, surface.thickness, 1.0]) * all;
        }
    }
    (all, stop)
}

/// The thin lens; none where nothing is focused.
fn thin(surfaces: &[Surface], params: &Params, height: f64) -> Result<Option<ThinLens>> {
    let opening = params.float_where("aperturediameter", 1.0, |d| d > 0.0, "above 0")?;
    let distance = params.float_where("focusdistance", 10.0, |d| d > 0.0, "above 0")?;
    let (all, stop) = trace(surfaces);
    let [[a, c], [_, d]] = all.to_cols_array_2d();
    let focal = -1.0 / c;
    let length: f64 = surfaces[..surfaces.len() - 1].iter().map(|surface| surface.thickness).sum();
    // From the one principal plane to the other.
    let between = length + (1.0 - a) / c - (d - 1.0) / c;
    // What is sharp lies so far from the film without that: image + object, with 1 / image + 1 / object = 1 / focal.
    let total = f64::from(distance) - between;
    let root = (total * total - 4.0 * focal * total).max(0.0).sqrt();
    let (image, object) = (0.5 * (total - root), 0.5 * (total + root));
    let radius = match stop {
        // The stop as it is seen from the front. It is no larger than it was made.
        Some((seen, made)) => 0.5 * made.min(f64::from(opening) * MILLIMETRE) / seen.abs(),
        None => 0.5 * f64::from(opening) * MILLIMETRE,
    };
    let sound = focal > 0.0
        && total > 4.0 * focal
        && radius > 0.0
        && [image, object, radius].iter().all(|x| x.is_finite());
    Ok(sound.then_some(ThinLens { radius, image, object, place: image + between, height }))
}
