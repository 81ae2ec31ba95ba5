//! Media that vary from place to place: grids, and the cloud of noise.

use std::sync::Arc;

use glam::{Affine3A, DAffine3, DVec3, Vec3};
use quietus_trace::desc::{Density, Glow, Grid, Variation};

use super::fault::{Context, Fault, Result};
use super::params::{Kind, Params};
use super::spectrum::{self, Spectrum};
use super::transform::single;
use crate::error::SceneError;
use crate::nanovdb;

/// How the medium of type `kind` varies, whose space is `to_world`; none where it does not.
pub(super) fn variation(
    kind: &str,
    params: &Params,
    to_world: DAffine3,
    context: &Context,
) -> Result<Option<Arc<Variation>>> {
    let (density, glow) = match kind {
        "uniformgrid" => uniform(params, context)?,
        "rgbgrid" => colors(params)?,
        "cloud" => (cloud(params)?, None),
        "nanovdb" => return vdb(params, to_world, context).map(Some),
        _ => return Ok(None),
    };
    let from_unit = bounds(params)?;
    let density = match density {
        Density::Cloud { density, wispiness, frequency, .. } => {
            Density::Cloud { density, wispiness, frequency, to_cloud: single(from_unit) }
        }
        other => other,
    };
    let from_world = single((to_world * from_unit).inverse());
    Ok(Some(Arc::new(Variation { from_world, density, glow })))
}

/// From the unit cube to the box between `p0` and `p1`.
fn bounds(params: &Params) -> Result<DAffine3> {
    let [p0, p1] = [
        params.vec3("p0", Kind::Point3, Vec3::ZERO)?.as_dvec3(),
        params.vec3("p1", Kind::Point3, Vec3::ONE)?.as_dvec3(),
    ];
    let (low, high): (DVec3, DVec3) = (p0.min(p1), p0.max(p1));
    if (high - low).min_element() <= 0.0 {
        let message = format!("the box of {} between \"p0\" and \"p1\" is flat", params.owner);
        return Err(Fault::invalid(params.place_of("p1"), message));
    }
    Ok(DAffine3::from_translation(low) * DAffine3::from_scale(high - low))
}

fn size(params: &Params) -> Result<[u32; 3]> {
    let along = |name| -> Result<u32> { Ok(params.integer_from(name, 1)?.unwrap_or(1)) };
    Ok([along("nx")?, along("ny")?, along("nz")?])
}

/// A grid of `values`, which must be as many as its `size` says and at least 0.
fn grid<T>(
    params: &Params,
    name: &'static str,
    values: Vec<T>,
    sound: impl Fn(&T) -> bool,
) -> Result<Grid<T>> {
    let size = size(params)?;
    let refuse = |message: String| Err(Fault::invalid(params.place_of(name), message));
    let expected = size.iter().map(|&n| n as usize).try_fold(1_usize, usize::checked_mul);
    if expected != Some(values.len()) {
        let [x, y, z] = size;
        let message =
            format!("\"{name}\" has {} values, expected nx * ny * nz = {x} * {y} * {z}", values.len());
        return refuse(message);
    }
    match values.iter().position(|value| !sound(value)) {
        Some(index) => refuse(format!("value {index} of \"{name}\" is negative, expected at least 0")),
        None => Ok(Grid::dense(size, values)),
    }
}

fn numbers(params: &Params, name: &'static str) -> Result<Option<Grid<f32>>> {
    let values = params.floats(name)?;
    if values.is_empty() {
        return Ok(None);
    }
    grid(params, name, values.to_vec(), |value| *value >= 0.0).map(Some)
}

/// A grid of colours, through `convert` from the colour space they are meant in.
fn rgb(
    params: &Params,
    name: &'static str,
    convert: impl Fn(&Spectrum) -> Vec3,
) -> Result<Option<Grid<Vec3>>> {
    let Some(param) = params.find(name, &[Kind::Rgb])? else { return Ok(None) };
    let (colors, rest) = param.numbers().as_chunks::<3>();
    if !rest.is_empty() {
        let message =
            format!("\"rgb {name}\" has {} values, expected a multiple of 3", param.numbers().len());
        return Err(Fault::invalid(param.place, message));
    }
    let colors: Vec<Vec3> = colors
        .iter()
        .map(|rgb| {
            let color = Vec3::from_array(*rgb);
            // A component below 0 must be refused, not converted.
            if color.min_element() < 0.0 { color } else { convert(&Spectrum::Rgb(param.space, color)) }
        })
        .collect();
    grid(params, name, colors, |color| color.min_element() >= 0.0).map(Some)
}

/// A grid of densities, whose light comes from `Le` or from temperatures.
fn uniform(params: &Params, context: &Context) -> Result<(Density, Option<Glow>)> {
    let Some(density) = numbers(params, "density")? else {
        return Err(Fault::invalid(params.place, format!("{} has no \"float density\"", params.owner)));
    };
    // A single number is for the whole medium.
    let scale = if params.floats("Lescale")?.len() == 1 { None } else { numbers(params, "Lescale")? };
    let glow = match numbers(params, "temperature")? {
        Some(_) if params.has("Le") => {
            let message =
                format!("{} has both \"Le\" and \"temperature\", expected one of them", params.owner);
            return Err(Fault::invalid(params.place_of("temperature"), message));
        }
        Some(temperature) => Some(heat(params, temperature, scale)?),
        None => scale.map(Glow::Grid),
    };
    if params.has("temperaturecutoff") && params.has("temperatureoffset") {
        context.warn(
            params.place_of("temperaturecutoff"),
            "\"temperaturecutoff\" is the old name of \"temperatureoffset\", which counts",
        );
    }
    Ok((Density::Grid(density), glow))
}

/// Densities, and temperatures if there are any, of a file of NanoVDB.
fn vdb(params: &Params, to_world: DAffine3, context: &Context) -> Result<Arc<Variation>> {
    let Some(name) = params.string("filename")? else {
        return Err(Fault::invalid(params.place, format!("{} has no \"string filename\"", params.owner)));
    };
    let (path, place) = (context.resolve(name), params.place_of("filename"));
    let read = || -> std::result::Result<_, SceneError> {
        let bytes = crate::file::read(&path)?;
        Ok((nanovdb::read(&path, &bytes, "density")?, nanovdb::read(&path, &bytes, "temperature")?))
    };
    let (density, temperature) = read().map_err(|error| context.blame(place, error))?;
    let Some(density) = density else {
        return Err(Fault::invalid(place, format!("{} holds no grid called \"density\"", path.display())));
    };
    let clamped = density.clamped + temperature.as_ref().map_or(0, |grid| grid.clamped);
    if clamped > 0 {
        context.warn(
            place,
            format!("{clamped} values of {} are negative or no numbers: they are 0", path.display()),
        );
    }
    let glow = match temperature.map(|temperature| temperature.within(&density)) {
        None => None,
        Some(Some(temperature)) => Some(heat(params, temperature, None)?),
        Some(None) => {
            let message = "temperatures on other cells than those of the densities are left out";
            context.warn(place, message);
            None
        }
    };
    let size = DVec3::from_array(density.grid.size.map(f64::from));
    // From the middles of cells to their borders.
    let from_unit =
        density.to_space * DAffine3::from_translation(DVec3::splat(-0.5)) * DAffine3::from_scale(size);
    let from_world = single((to_world * from_unit).inverse());
    Ok(Arc::new(Variation { from_world, density: Density::Grid(density.grid), glow }))
}

/// Black bodies, as bright as the brightest of their wavelengths is 1.
fn heat(params: &Params, temperature: Grid<f32>, scale: Option<Grid<f32>>) -> Result<Glow> {
    /// Temperatures whose colours are computed; those in between are mixed.
    const COLORS: u16 = 1024;
    let offset = params.float("temperatureoffset", params.float("temperaturecutoff", 0.0)?)?;
    let factor = params.float("temperaturescale", 1.0)?;
    let hottest = temperature.values.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
    let color = |i: u16| {
        let share = f64::from(i) / f64::from(COLORS - 1);
        spectrum::glow((share * f64::from(hottest) - f64::from(offset)) * f64::from(factor))
    };
    Ok(Glow::Heat { temperature, scale, colors: (0..COLORS).map(color).collect(), hottest })
}

/// Grids of colours for what the medium does.
fn colors(params: &Params) -> Result<(Density, Option<Glow>)> {
    let absorption = rgb(params, "sigma_a", Spectrum::factor)?;
    let scattering = rgb(params, "sigma_s", Spectrum::factor)?;
    if absorption.is_none() && scattering.is_none() {
        let message = format!("{} has neither \"rgb sigma_a\" nor \"rgb sigma_s\"", params.owner);
        return Err(Fault::invalid(params.place, message));
    }
    let glow = rgb(params, "Le", Spectrum::light)?;
    if glow.is_some() && absorption.is_none() {
        let message = format!("{} has \"Le\", which needs \"rgb sigma_a\"", params.owner);
        return Err(Fault::invalid(params.place_of("Le"), message));
    }
    Ok((Density::Colors { absorption, scattering }, glow.map(Glow::Colors)))
}

fn cloud(params: &Params) -> Result<Density> {
    let number = |name, default| params.float_where(name, default, |value| value >= 0.0, "at least 0");
    Ok(Density::Cloud {
        density: number("density", 1.0)?,
        wispiness: number("wispiness", 1.0)?,
        frequency: number("frequency", 5.0)?,
        to_cloud: Affine3A::IDENTITY,
    })
}
