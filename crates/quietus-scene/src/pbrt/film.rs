//! Film, filter, sampler and integrator: what the scene wishes for its picture.

use glam::{Vec2, Vec3};
use quietus_trace::desc::PictureDefaults;
use quietus_trace::filter::{Filter, FilterShape};

use super::draft::{Draft, Entity};
use super::fault::{Context, Fault, Result, unknown};
use super::params::Params;
use super::spectrum;

/// Every type of film, filter, sampler and integrator.
const FILMS: [&str; 3] = ["gbuffer", "rgb", "spectral"];
const FILTERS: [&str; 5] = ["box", "gaussian", "mitchell", "sinc", "triangle"];
const SAMPLERS: [&str; 7] =
    ["halton", "independent", "paddedsobol", "pmj02bn", "sobol", "stratified", "zsobol"];
const INTEGRATORS: [&str; 12] = [
    "ambientocclusion",
    "bdpt",
    "function",
    "lightpath",
    "mlt",
    "path",
    "randomwalk",
    "simplepath",
    "simplevolpath",
    "sppm",
    "volpath",
    "ao",
];
/// What pbrt-v4 calls the measured sensors, without the colour of its filters.
const SENSORS: [&str; 18] = [
    "canon_eos_100d",
    "canon_eos_1dx_mkii",
    "canon_eos_200d",
    "canon_eos_200d_mkii",
    "canon_eos_5d",
    "canon_eos_5d_mkii",
    "canon_eos_5d_mkiii",
    "canon_eos_5d_mkiv",
    "canon_eos_5ds",
    "canon_eos_m",
    "cie1931",
    "hasselblad_l1d_20c",
    "nikon_d810",
    "nikon_d850",
    "sony_ilce_6400",
    "sony_ilce_7m3",
    "sony_ilce_7rm3",
    "sony_ilce_9",
];

/// pbrt's own size.
const SIZE: [u32; 2] = [1280, 720];

/// What the scene wishes for its picture; `open_for` is how long the shutter is open, which exposes the film.
pub(super) fn picture(draft: &Draft, open_for: f32, context: &Context) -> Result<PictureDefaults> {
    let mut picture = PictureDefaults { size: Some(SIZE), ..PictureDefaults::default() };
    if let Some(entity) = &draft.film {
        film(entity, open_for, context, &mut picture)?;
    } else {
        picture.exposure = exposure(open_for);
    }
    picture.filter = Some(match &draft.filter {
        Some(entity) => filter(entity)?,
        None => Filter::GAUSSIAN,
    });
    if let Some(entity) = &draft.sampler {
        picture.samples = Some(samples(entity)?);
    }
    picture.max_depth = Some(match &draft.integrator {
        Some(entity) => integrator(entity, context)?,
        None => segments(DEFAULT_DEPTH),
    });
    Ok(picture)
}

/// Width and height of the picture.
pub(super) fn size(draft: &Draft) -> Result<[u32; 2]> {
    draft.film.as_ref().map_or(Ok(SIZE), |film| size_of(&film.params))
}

fn size_of(params: &Params) -> Result<[u32; 2]> {
    let side = |name, i: usize| -> Result<u32> { Ok(params.integer_from(name, 1)?.unwrap_or(SIZE[i])) };
    Ok([side("xresolution", 0)?, side("yresolution", 1)?])
}

fn exposure(ratio: f32) -> Option<Vec3> {
    (ratio != 1.0).then(|| Vec3::splat(ratio))
}

fn film(entity: &Entity, open_for: f32, context: &Context, picture: &mut PictureDefaults) -> Result<()> {
    let params = &entity.params;
    let kind = &*entity.kind;
    if !FILMS.contains(&kind) {
        return Err(Fault::invalid(params.place, unknown("film", kind, &FILMS)));
    }
    if kind != "rgb" {
        context.warn(params.place, format!("film \"{kind}\" is drawn as film \"rgb\""));
    }
    let size = size_of(params)?;
    picture.size = Some(size);
    picture.crop = crop(params, size)?;
    let iso = params.float_where("iso", 100.0, |iso| iso > 0.0, "above 0")?;
    let balance = sensor(params, context)?;
    let ratio = open_for * iso / 100.0;
    picture.exposure = if balance == Vec3::ONE { exposure(ratio) } else { Some(ratio * balance) };
    let most = params.float_option("maxcomponentvalue")?;
    picture.max_component = most.filter(|most| *most > 0.0 && most.is_finite());
    params.ignore(&[
        "buckets",
        "coordinatesystem",
        "diagonal",
        "filename",
        "lambdamax",
        "lambdamin",
        "nbuckets",
        "savefp16",
    ]);
    params.finish()
}

/// What the colours of the sensor are multiplied by.
fn sensor(params: &Params, context: &Context) -> Result<Vec3> {
    let name = params.string("sensor")?.unwrap_or("cie1931");
    if !SENSORS.contains(&name) {
        return Err(Fault::invalid(params.place_of("sensor"), unknown("sensor", name, &SENSORS)));
    }
    if name != "cie1931" {
        let message = format!("sensor \"{name}\" is not drawn; the standard observer stands in");
        context.warn(params.place_of("sensor"), message);
    }
    let expected = "0 for none, or at least 1000 kelvin";
    match params.float_where("whitebalance", 0.0, |kelvin| kelvin == 0.0 || kelvin >= 1000.0, expected)? {
        // pbrt balances measured sensors for daylight of 6500 K, which is the white of our colours.
        0.0 => Ok(Vec3::ONE),
        kelvin => Ok(white_balance(f64::from(kelvin))),
    }
}

/// What makes daylight of this temperature (light of black bodies, where that is redder than daylight is) white.
///
/// pbrt adapts responses of cones, of which this is the simplest form: each channel for itself. What is white comes out
/// the same, saturated colours turn a little.
fn white_balance(kelvin: f64) -> Vec3 {
    let light = spectrum::daylight(kelvin).max(Vec3::splat(1e-3));
    light.recip()
}

/// The part to draw, in 0..1 of the frame.
fn crop(params: &Params, size: [u32; 2]) -> Result<Option<[f32; 4]>> {
    let [width, height] = size.map(|side| side as f32);
    let window = params.floats("cropwindow")?;
    let bounds = params.integers("pixelbounds")?;
    let (name, crop) = match (window, bounds) {
        ([], []) => return Ok(None),
        (&[x0, x1, y0, y1], []) => ("cropwindow", [x0.min(x1), x0.max(x1), y0.min(y1), y0.max(y1)]),
        ([], &[x0, x1, y0, y1]) => {
            let [x0, x1, y0, y1] = [x0, x1, y0, y1].map(|bound| bound as f32);
            ("pixelbounds", [x0 / width, x1 / width, y0 / height, y1 / height])
        }
        ([], _) => {
            let message = format!("\"pixelbounds\" has {} values, expected x0, x1, y0, y1", bounds.len());
            return Err(Fault::invalid(params.place_of("pixelbounds"), message));
        }
        (_, []) => {
            let message = format!("\"cropwindow\" has {} values, expected x0, x1, y0, y1", window.len());
            return Err(Fault::invalid(params.place_of("cropwindow"), message));
        }
        _ => {
            let message = "film has both \"cropwindow\" and \"pixelbounds\", expected one of them";
            return Err(Fault::invalid(params.place_of("cropwindow"), message));
        }
    };
    let crop = crop.map(|bound| bound.clamp(0.0, 1.0));
    if crop[0] < crop[1] && crop[2] < crop[3] {
        return Ok(Some(crop));
    }
    Err(Fault::invalid(params.place_of(name), format!("\"{name}\" leaves nothing of the picture")))
}

fn filter(entity: &Entity) -> Result<Filter> {
    let params = &entity.params;
    let radius = |default: f32| -> Result<Vec2> {
        let one = |name| params.float_where(name, default, |r| r > 0.0, "above 0");
        Ok(Vec2::new(one("xradius")?, one("yradius")?))
    };
    let (shape, radius) = match &*entity.kind {
        "box" => (FilterShape::Box, radius(0.5)?),
        "triangle" => (FilterShape::Triangle, radius(2.0)?),
        "gaussian" => {
            let sigma = params.float_where("sigma", 0.5, |sigma| sigma > 0.0, "above 0")?;
            (FilterShape::Gaussian { sigma }, radius(1.5)?)
        }
        "mitchell" => {
            let (b, c) = (params.float("B", 1.0 / 3.0)?, params.float("C", 1.0 / 3.0)?);
            (FilterShape::Mitchell { b, c }, radius(2.0)?)
        }
        "sinc" => {
            let tau = params.float_where("tau", 3.0, |tau| tau > 0.0, "above 0")?;
            (FilterShape::LanczosSinc { tau }, radius(4.0)?)
        }
        kind => return Err(Fault::invalid(params.place, unknown("filter", kind, &FILTERS))),
    };
    params.finish()?;
    Ok(Filter { shape, radius })
}

/// Samples per pixel. How they are spread is the renderer's own business.
fn samples(entity: &Entity) -> Result<u32> {
    /// pbrt's own number.
    const DEFAULT: u32 = 16;
    let params = &entity.params;
    let count = match &*entity.kind {
        "stratified" => {
            let x = params.integer_from("xsamples", 1)?.unwrap_or(4);
            let y = params.integer_from("ysamples", 1)?.unwrap_or(4);
            x.saturating_mul(y)
        }
        "independent" => params.integer_from("pixelsamples", 1)?.unwrap_or(4),
        kind if SAMPLERS.contains(&kind) => params.integer_from("pixelsamples", 1)?.unwrap_or(DEFAULT),
        kind => return Err(Fault::invalid(params.place, unknown("sampler", kind, &SAMPLERS))),
    };
    params.ignore(&["jitter", "randomization", "seed"]);
    params.finish()?;
    Ok(count)
}

/// pbrt's own number of scatterings.
const DEFAULT_DEPTH: u32 = 5;

/// pbrt counts where a path scatters; we count its segments.
fn segments(scatterings: u32) -> u32 {
    scatterings.saturating_add(1)
}

fn integrator(entity: &Entity, context: &Context) -> Result<u32> {
    let params = &entity.params;
    let kind = &*entity.kind;
    if !INTEGRATORS.contains(&kind) {
        return Err(Fault::invalid(params.place, unknown("integrator", kind, &INTEGRATORS)));
    }
    if !matches!(kind, "path" | "volpath" | "simplepath" | "simplevolpath") {
        let message = format!("integrator \"{kind}\": the path tracer draws this scene as any other");
        context.warn(params.place, message);
    }
    if params.boolean("regularize", false)? {
        let message = "\"regularize\" is not followed: it would blur what it makes easier";
        context.warn(params.place_of("regularize"), message);
    }
    let depth = params.integer_from("maxdepth", 0)?.unwrap_or(DEFAULT_DEPTH);
    params.ignore(&[
        "bootstrapsamples",
        "chains",
        "cossample",
        "filename",
        "function",
        "imagefilename",
        "largestepprobability",
        "lightsampler",
        "maxdistance",
        "mutationsperpixel",
        "photonsperiteration",
        "radius",
        // Of earlier versions of pbrt-v4.
        "rrthreshold",
        "samplebsdf",
        "samplelights",
        "seed",
        "sigma",
        "skipbad",
        "visualizestrategies",
        "visualizeweights",
    ]);
    params.finish()?;
    Ok(segments(depth))
}
