//! Materials that light wanders below: by their coefficients, by a name, or by the colour that is seen.

use glam::Vec3;
use quietus_trace::desc::{ColorParam, Interior, Subsurface, Surface};

use super::fault::{Fault, Result};
use super::material::Materials;
use super::medium;
use super::params::Params;

/// Ways to say what is below, each by the parameters that belong to it.
const WAYS: [&[&str]; 3] = [&["name"], &["sigma_a", "sigma_s"], &["reflectance", "mfp"]];

impl Materials<'_, '_> {
    /// What pbrt approximates by how light spreads over a flat surface is drawn as it is: by walks.
    pub(super) fn subsurface(&self, params: &Params) -> Result<Surface> {
        let ior = self.ior(params, "eta", 1.33)?;
        let roughness = self.roughness(params, ["roughness", "uroughness", "vroughness"])?;
        let mut g = params.float_where("g", 0.0, |g| g.abs() < 1.0, "between -1 and 1")?;
        if g != 0.0 && params.has("name") {
            let message =
                "\"g\" does not count beside \"name\", whose scattering is that of an even phase function";
            self.context.warn(params.place_of("g"), message);
            g = 0.0;
        }
        let scale = params.float_where("scale", 1.0, |scale| scale > 0.0, "above 0")?;
        let interior = self.interior(params, scale)?;
        Ok(Surface::Subsurface(Box::new(Subsurface { ior, roughness, interior, g })))
    }

    fn interior(&self, params: &Params, scale: f32) -> Result<Interior> {
        one_way(params)?;
        let color = |name, default, most, scale| -> Result<ColorParam> {
            let color = self.textures.color(params, name, default, most)?;
            Ok(ColorParam { factor: color.factor * scale, ..color })
        };
        if params.has("reflectance") {
            return Ok(Interior::Reflectance {
                reflectance: color("reflectance", Vec3::ZERO, 1.0, 1.0)?,
                mean_free_path: color("mfp", Vec3::ONE, f32::INFINITY, scale)?,
            });
        }
        let named = medium::preset(params.string("name")?, params, self.context);
        let [absorption, scattering] = named.unwrap_or(medium::WHOLE_MILK);
        Ok(Interior::Coefficients {
            absorption: color("sigma_a", absorption, f32::INFINITY, scale)?,
            scattering: color("sigma_s", scattering, f32::INFINITY, scale)?,
        })
    }
}

/// Refuses parameters that contradict each other.
fn one_way(params: &Params) -> Result<()> {
    let given: Vec<&str> =
        WAYS.iter().filter_map(|way| way.iter().copied().find(|name| params.has(name))).collect();
    match given[..] {
        [first, second, ..] => {
            let message =
                format!("{} has both \"{first}\" and \"{second}\", expected one of them", params.owner);
            Err(Fault::invalid(params.place_of(second), message))
        }
        [_] | [] => Ok(()),
    }
}
