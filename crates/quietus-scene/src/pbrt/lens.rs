//! Lens files of realistic cameras: their surfaces, focused, and the one thin lens that draws about as large and as
//! blurred a picture, by what paraxial rays make of them (Born and Wolf, "Principles of Optics", 4.4; matrices as in Gerrard
//! and Burch 1975, "Introduction to Matrix Methods in Optics", chapter 2).

use glam::{DMat2, DVec2};
use quietus_trace::desc::{Aperture, LensSurface, Lenses};

use super::aperture;
use super::draft::{Draft, Entity};
use super::fault::{Context, Fault, Result};
use super::params::Params;

/// Surfaces of a lens file.
const MAX_SURFACES: usize = 1024;
/// Lens files count in millimetres, scenes with such cameras in metres.
const MILLIMETRE: f64 = 1e-3;

/// What a lens file says, focused. Lengths are in metres.
#[derive(Debug)]
pub(super) struct Lens {
    pub thin: ThinLens,
    surfaces: Vec<Surface>,
    /// Width and height of the film.
    film: [f64; 2],
    aperture: Option<Aperture>,
}

/// A thin lens in the place of several.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ThinLens {
    /// Of its opening.
    pub radius: f64,
    /// From the film to the lens, where all is one.
    pub image: f64,
    /// From the lens to what is sharp.
    pub object: f64,
    /// From the film to the last surface.
    film_distance: f64,
}

impl Lens {
    /// The angle of view along the height, in radians.
    pub(super) fn fov(&self) -> f64 {
        2.0 * (0.5 * self.film[1] / self.thin.image).atan()
    }

    /// The lenses where a metre is `scale` long.
    pub(super) fn lenses(&self, scale: f32) -> Lenses {
        let length = |metres: f64| scale * metres as f32;
        let mut place = self.thin.film_distance;
        let mut surfaces: Vec<LensSurface> = Vec::new();
        for (i, surface) in self.surfaces.iter().enumerate().rev() {
            if i + 1 < self.surfaces.len() {
                place += surface.thickness;
            }
            surfaces.push(LensSurface {
                place: length(place),
                curvature: length(surface.radius),
                rim: length(0.5 * surface.diameter),
                index: surface.index as f32,
            });
        }
        surfaces.reverse();
        let [width, height] = self.film;
        let film_radius = length(0.5 * width.hypot(height));
        Lenses { surfaces, film_height: length(height), film_radius, aperture: self.aperture.clone() }
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

/// The lenses of the camera of a scene, if it has some.
pub(super) fn of(draft: &Draft, size: [u32; 2], context: &Context) -> Result<Option<Lens>> {
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
    let mut surfaces = surfaces(&String::from_utf8_lossy(&bytes)).map_err(refuse)?;
    stop_down(&mut surfaces, params, context)?;
    let diagonal = match &draft.film {
        Some(film) => film.params.float_where("diagonal", 35.0, |d| d > 0.0, "above 0")?,
        None => 35.0,
    };
    let [width, height] = size.map(f64::from);
    let film = [width, height].map(|side| f64::from(diagonal) * MILLIMETRE * side / width.hypot(height));
    let aperture = aperture::read(params, context)?;
    let Some(thin) = thin(&surfaces, params)? else {
        let message =
            "no picture is focused by these lenses, or none on a film that close to what should be sharp";
        return Err(refuse(message.to_owned()));
    };
    Ok(Some(Lens { thin, surfaces, film, aperture }))
}

/// Narrows the stop to what the scene wishes; it is no larger than it was made.
fn stop_down(surfaces: &mut [Surface], params: &Params, context: &Context) -> Result<()> {
    let opening = params.float_where("aperturediameter", 1.0, |d| d > 0.0, "above 0")?;
    let opening = f64::from(opening) * MILLIMETRE;
    for stop in surfaces.iter_mut().filter(|surface| surface.radius == 0.0) {
        if opening > stop.diameter {
            let message = format!("the lenses open no further than {} mm", stop.diameter / MILLIMETRE);
            context.warn(params.place_of("aperturediameter"), message);
        }
        stop.diameter = stop.diameter.min(opening);
    }
    Ok(())
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
fn thin(surfaces: &[Surface], params: &Params) -> Result<Option<ThinLens>> {
    let distance = params.float_where("focusdistance", 10.0, |d| d > 0.0, "above 0")?;
    let (all, stop) = trace(surfaces);
    let [[a, c], [_, d]] = all.to_cols_array_2d();
    let focal = -1.0 / c;
    let length: f64 = surfaces[..surfaces.len() - 1].iter().map(|surface| surface.thickness).sum();
    // From the last surface to the principal plane on the film's side, and from that to the other one.
    let behind = (1.0 - a) / c;
    let between = length + behind - (d - 1.0) / c;
    // What is sharp lies so far from the film without that: image + object, with 1 / image + 1 / object = 1 / focal.
    let total = f64::from(distance) - between;
    let root = (total * total - 4.0 * focal * total).max(0.0).sqrt();
    let (image, object) = (0.5 * (total - root), 0.5 * (total + root));
    // The stop as it is seen from the front.
    let radius = match stop {
        Some((seen, diameter)) => 0.5 * diameter / seen.abs(),
        None => surfaces.iter().map(|surface| 0.5 * surface.diameter).fold(f64::INFINITY, f64::min),
    };
    let film_distance = image + behind;
    let sound = focal > 0.0
        && total > 4.0 * focal
        && [radius, film_distance].iter().all(|length| *length > 0.0)
        && [image, object, radius].iter().all(|x| x.is_finite());
    Ok(sound.then_some(ThinLens { radius, image, object, film_distance }))
}
