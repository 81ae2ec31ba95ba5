//! Participating media.

use std::collections::HashMap;
use std::rc::Rc;

use glam::Vec3;
use quietus_trace::desc::{self, MediumId};

use super::draft::{Entity, Medium};
use super::fault::{Context, Fault, Result, unknown};
use super::params::Params;

/// Every type of medium.
const KINDS: [&str; 5] = ["cloud", "homogeneous", "nanovdb", "rgbgrid", "uniformgrid"];

/// pbrt's default, whole milk: absorption and scattering per mm.
const DEFAULT: [Vec3; 2] = [Vec3::new(0.0011, 0.0024, 0.014), Vec3::new(2.55, 3.21, 3.77)];

/// Measured materials, absorption and reduced scattering per mm: Jensen, Marschner, Levoy, Hanrahan 2001, "A Practical
/// Model for Subsurface Light Transport", figure 5.
const PRESETS: [(&str, [f32; 3], [f32; 3]); 12] = [
    ("Apple", [0.0030, 0.0034, 0.046], [2.29, 2.39, 1.97]),
    ("Chicken1", [0.015, 0.077, 0.19], [0.15, 0.21, 0.38]),
    ("Chicken2", [0.018, 0.088, 0.20], [0.19, 0.25, 0.32]),
    ("Cream", [0.0002, 0.0028, 0.0163], [7.38, 5.47, 3.15]),
    ("Ketchup", [0.061, 0.97, 1.45], [0.18, 0.07, 0.03]),
    ("Marble", [0.0021, 0.0041, 0.0071], [2.19, 2.62, 3.00]),
    ("Potato", [0.0024, 0.0090, 0.12], [0.68, 0.70, 0.55]),
    ("Skimmilk", [0.0014, 0.0025, 0.0142], [0.70, 1.22, 1.90]),
    ("Skin1", [0.032, 0.17, 0.48], [0.74, 0.88, 1.01]),
    ("Skin2", [0.013, 0.070, 0.145], [1.09, 1.59, 1.79]),
    ("Spectralon", [0.0, 0.0, 0.0], [11.6, 20.4, 14.9]),
    ("Wholemilk", [0.0011, 0.0024, 0.014], [2.55, 3.21, 3.77]),
];

/// The absorption and scattering that `name` stands for, pbrt's default where it is not known here.
pub(super) fn preset(name: Option<&str>, params: &Params, context: &Context) -> [Vec3; 2] {
    let Some(name) = name else { return DEFAULT };
    match PRESETS.iter().find(|(preset, ..)| *preset == name) {
        Some((_, absorption, scattering)) => [Vec3::from_array(*absorption), Vec3::from_array(*scattering)],
        None => {
            let message = format!("the measured medium \"{name}\" is not known here; whole milk stands in");
            context.warn(params.place, message);
            DEFAULT
        }
    }
}

/// The media of a scene, under their names.
#[derive(Debug, Default)]
pub(super) struct Media {
    pub list: Vec<desc::Medium>,
    by_name: HashMap<Box<str>, MediumId>,
}

impl Media {
    /// Reads the media of `entities`.
    pub(super) fn new(entities: &[(Box<str>, Entity)], context: &Context) -> Result<Self> {
        let mut media = Self::default();
        for (name, entity) in entities {
            let medium = read(name, entity, context)?;
            media.by_name.insert(name.clone(), MediumId(media.list.len() as u32));
            media.list.push(medium);
        }
        Ok(media)
    }

    /// The medium of that name; `None` is vacuum.
    pub(super) fn get(&self, medium: Option<&Medium>) -> Result<Option<MediumId>> {
        let Some((name, place)) = medium else { return Ok(None) };
        let name: &Rc<str> = name;
        match self.by_name.get(&**name) {
            Some(id) => Ok(Some(*id)),
            None => {
                let known: Vec<&str> = self.by_name.keys().map(|name| &**name).collect();
                Err(Fault::invalid(*place, unknown("medium", name, &known)))
            }
        }
    }
}

fn read(name: &str, entity: &Entity, context: &Context) -> Result<desc::Medium> {
    let params = &entity.params;
    let kind = &*entity.kind;
    if !KINDS.contains(&kind) {
        return Err(Fault::invalid(params.place_of("type"), unknown("medium", kind, &KINDS)));
    }
    let share = match kind {
        "homogeneous" => 1.0,
        "uniformgrid" => {
            context.warn(params.place, "media on grids are drawn with their mean density");
            let densities = params.floats("density")?;
            densities.iter().sum::<f32>() / densities.len().max(1) as f32
        }
        _ => {
            context.warn(params.place, format!("media of type \"{kind}\" are left out"));
            params.ignore(&["sigma_a", "sigma_s", "Le"]);
            return left_out(name, params);
        }
    };
    if kind != "homogeneous" {
        params.ignore(&GRID_PARAMETERS);
    }
    let [absorption, scattering] = preset(params.string("preset")?, params, context);
    let factor = |name, default: Vec3| -> Result<Vec3> {
        Ok(params.spectrum(name, context)?.map_or(default, |spectrum| spectrum.factor()))
    };
    let scale = share * params.float_where("scale", 1.0, |scale| scale >= 0.0, "at least 0")?;
    let glow = params.spectrum("Le", context)?.map_or(Vec3::ZERO, |spectrum| spectrum.light());
    let medium = desc::Medium {
        name: name.to_owned(),
        absorption: factor("sigma_a", absorption)? * scale,
        scattering: factor("sigma_s", scattering)? * scale,
        emission: glow * params.float_where("Lescale", 1.0, |scale| scale >= 0.0, "at least 0")?,
        g: params.float_where("g", 0.0, |g| g.abs() < 1.0, "between -1 and 1")?,
    };
    params.finish()?;
    Ok(medium)
}

/// What only media that vary know.
const GRID_PARAMETERS: [&str; 18] = [
    "Lescale",
    "Temperature",
    "bounds",
    "density",
    "filename",
    "frequency",
    "nx",
    "ny",
    "nz",
    "p0",
    "p1",
    "temperature",
    "temperaturecutoff",
    "temperatureoffset",
    "temperaturescale",
    "wispiness",
    "emissionscale",
    "LeScale",
];

/// Nothing, in place of a medium.
fn left_out(name: &str, params: &Params) -> Result<desc::Medium> {
    params.ignore(&["g", "preset", "scale"]);
    params.ignore(&GRID_PARAMETERS);
    params.finish()?;
    let none = Vec3::ZERO;
    Ok(desc::Medium { name: name.to_owned(), absorption: none, scattering: none, emission: none, g: 0.0 })
}
