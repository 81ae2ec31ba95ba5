//! Lights: with a surface, without, and from infinitely far away.
//!
//! pbrt-v4 gives lights the luminance 1 for `scale` 1, unless their colour is an `rgb`, which counts as it is; see
//! [`Spectrum::light`](super::spectrum::Spectrum::light). `power` and `illuminance` replace that strength.

use std::f32::consts::PI;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3, Mat3, Vec2, Vec3};
use quietus_trace::desc::{
    Environment, EnvironmentLayout, Image, Light, PictureSpread, Portal, SceneDesc, SpotFalloff, Texels,
};

use super::draft::{AreaLight, Entity};
use super::fault::{Context, Fault, Place, Result, unknown};
use super::images::{Channels, ImageId, Images, Requests, Use, linear};
use super::params::{Kind, Params};
use super::surrounding;
use super::transform::{Moving, Parts, uniform_scale};

/// Every type of light without a surface.
const KINDS: [&str; 6] = ["distant", "goniometric", "infinite", "point", "projection", "spot"];

/// Luminance of linear Rec.709.
const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

/// Reads an area light.
pub(super) fn area(entity: &Entity, context: &Context, images: &mut Requests) -> Result<AreaLight> {
    let params = &entity.params;
    if &*entity.kind != "diffuse" {
        return Err(Fault::invalid(params.place, unknown("area light", &entity.kind, &["diffuse"])));
    }
    let image = image(params, context, images)?;
    let radiance = params.light("L", context)? * scale(params)?;
    let power = positive(params, "power")?;
    let two_sided = params.boolean("twosided", false)?;
    params.finish()?;
    Ok(AreaLight { radiance, power, two_sided, image, place: params.place })
}

/// A light's picture. It takes the place of the colour.
fn image(params: &Params, context: &Context, images: &mut Requests) -> Result<Option<ImageId>> {
    let place = params.place_of("filename");
    if params.has("filename") && params.has("L") {
        let message = format!("{} has both \"filename\" and \"L\", expected one of them", params.owner);
        return Err(Fault::invalid(place, message));
    }
    picture(params, Use::COLOR, context, images)
}

/// The picture that `filename` names.
fn picture(
    params: &Params,
    wanted: Use,
    context: &Context,
    images: &mut Requests,
) -> Result<Option<ImageId>> {
    let Some(name) = params.string("filename")? else { return Ok(None) };
    let place = context.full_words(params.place_of("filename"));
    Ok(Some(images.ask(context.resolve(name), wanted, &place)))
}

fn scale(params: &Params) -> Result<f32> {
    params.float_where("scale", 1.0, |scale| scale >= 0.0, "at least 0")
}

/// A number that only counts above 0.
fn positive(params: &Params, name: &'static str) -> Result<Option<f32>> {
    Ok(params.float_option(name)?.filter(|value| *value > 0.0))
}

/// Lights that only shine once their pictures are there.
#[derive(Debug, Default)]
pub(super) struct Lights {
    pub lights: Vec<Light>,
    projected: Vec<Projected>,
    skies: Vec<Sky>,
}

/// A light from infinitely far away.
#[derive(Debug)]
struct Sky {
    image: Option<ImageId>,
    scale: Vec3,
    /// What an upward-facing surface is to receive.
    illuminance: Option<f32>,
    /// From the light's space.
    to_world: DMat3,
    portal: Option<Portal>,
    place: Place,
}

impl Lights {
    /// Reads the lights of `entities`.
    pub(super) fn new(
        entities: &[(Entity, Moving)],
        context: &Context,
        images: &mut Requests,
    ) -> Result<Self> {
        let mut lights = Self::default();
        for (entity, to_world) in entities {
            let params = &entity.params;
            if !to_world.is_still() {
                context
                    .warn(params.place, "lights without a surface do not move: they stay where they start");
            }
            let to_world = to_world.0[0];
            match &*entity.kind {
                "infinite" => lights.skies.push(infinite(params, to_world, context, images)?),
                "distant" => lights.lights.push(distant(params, to_world, context)?),
                "point" => lights.lights.push(point(params, to_world, context)?),
                "spot" => lights.lights.push(spot(params, to_world, context)?),
                "goniometric" => lights.shine(goniometric(params, to_world, context, images)?),
                "projection" => lights.shine(projection(params, to_world, context, images)?),
                kind => return Err(Fault::invalid(params.place, unknown("light", kind, &KINDS))),
            }
            params.finish()?;
        }
        Ok(lights)
    }

    fn shine(&mut self, light: Shone) {
        match light {
            Shone::At(light) => self.lights.push(light),
            Shone::Through(light) => self.projected.push(light),
        }
    }

    /// Puts the lights into `scene`. Several skies become one.
    pub(super) fn finish(self, images: &Images, context: &Context, scene: &mut SceneDesc) -> Result<()> {
        let portal = self.portal(context);
        scene.lights = self.lights;
        for light in &self.projected {
            scene.lights.push(light.light(images)?);
        }
        let (with_image, plain): (Vec<_>, Vec<_>) = self.skies.iter().partition(|sky| sky.image.is_some());
        let constant: Vec3 = plain.iter().map(|sky| sky.plain()).sum();
        if let Some(second) = with_image.get(1) {
            context.warn(second.place, "pictures of several infinite lights are added up in one");
        }
        scene.environment = match with_image[..] {
            [sky] => Some(sky.surrounding(images, constant)?),
            [_, _, ..] => {
                let surroundings: Vec<_> = with_image
                    .iter()
                    .map(|sky| sky.surrounding(images, Vec3::ZERO))
                    .collect::<Result<_>>()?;
                Some(surrounding::added(&surroundings, constant))
            }
            [] if plain.is_empty() => None,
            [] => Some(Environment {
                image: None,
                layout: EnvironmentLayout::LatLong,
                scale: constant,
                to_world: Mat3::IDENTITY,
                portal: None,
            }),
        };
        if let Some(environment) = &mut scene.environment {
            environment.portal = portal;
        }
        Ok(())
    }

    /// The portal that all skies have.
    fn portal(&self, context: &Context) -> Option<Portal> {
        let first = self.skies.first()?.portal;
        let Some(other) = self.skies.iter().find(|sky| sky.portal != first) else { return first };
        let message =
            "portals of several infinite lights are only drawn where all have the same: they are left out";
        context.warn(other.place, message);
        None
    }
}

impl Sky {
    /// Radiance without a picture.
    fn plain(&self) -> Vec3 {
        // A surface under an even sky of radiance L receives pi L.
        self.illuminance.map_or(self.scale, |illuminance| self.scale * illuminance / PI)
    }

    /// The environment with its picture, and `constant` added everywhere.
    fn surrounding(&self, images: &Images, constant: Vec3) -> Result<Environment> {
        let image = images.get(self.image.unwrap_or_else(|| unreachable!("only called with a picture")));
        let layout = layout(image).map_err(|message| Fault::invalid(self.place, message))?;
        let mut scale = self.scale;
        if let Some(wanted) = self.illuminance {
            // The program pbrt gives texels of a picture half of their solid angle here, and so twice the light that
            // its documentation promises. Scenes are made with the program.
            let found = 0.5 * illuminance(image, layout);
            if found > 0.0 {
                scale *= wanted / found;
            }
        }
        let image =
            if constant == Vec3::ZERO { Arc::clone(image) } else { brightened(image, constant / scale) };
        let to_world = match layout {
            EnvironmentLayout::EqualArea => self.to_world,
            // In the light's space z is up, and the middle of the picture looks along -x.
            EnvironmentLayout::LatLong => self.to_world * DMat3::from_cols(DVec3::NEG_Y, DVec3::Z, DVec3::X),
        };
        Ok(Environment { image: Some(image), layout, scale, to_world: to_world.as_mat3(), portal: None })
    }
}

/// pbrt's own square maps; pictures twice as wide as high are of the usual kind with latitude and longitude.
fn layout(image: &Image) -> std::result::Result<EnvironmentLayout, String> {
    match (image.width, image.height) {
        (width, height) if width == height => Ok(EnvironmentLayout::EqualArea),
        (width, height) if width == 2 * height => Ok(EnvironmentLayout::LatLong),
        (width, height) => Err(format!(
            "the picture of the infinite light is {width} x {height}, expected a square (equal-area) or twice as \
             wide as high (latitude and longitude)"
        )),
    }
}

/// Mean luminance of a picture's texels.
pub(super) fn mean_luminance(image: &Image) -> f32 {
    let texels = linear(image.texels.clone());
    let sum: f64 = texels.iter().map(|[r, g, b, _]| f64::from(LUMINANCE.dot(Vec3::new(*r, *g, *b)))).sum();
    (sum / texels.len().max(1) as f64) as f32
}

fn brightened(image: &Image, constant: Vec3) -> Arc<Image> {
    let add = |[r, g, b, a]: [f32; 4]| [r + constant.x, g + constant.y, b + constant.z, a];
    let texels = linear(image.texels.clone()).into_iter().map(add).collect();
    Arc::new(Image { texels: Texels::Float(texels), ..image.clone() })
}

/// Illuminance of an upward-facing (+z in the light's space) surface.
fn illuminance(image: &Image, layout: EnvironmentLayout) -> f32 {
    let (width, height) = (image.width as usize, image.height as usize);
    // The cosine to +z, integrated over a texel.
    let weight = |x: usize, y: usize| match layout {
        EnvironmentLayout::LatLong => {
            let half = 0.5 * std::f64::consts::PI;
            let edge = |y: usize| (2.0 * half * y as f64 / height as f64).min(half).sin().powi(2);
            half * 2.0 * (edge(y + 1) - edge(y)) / width as f64
        }
        EnvironmentLayout::EqualArea => {
            // The height depends on the distance from the middle alone, as the sum of both coordinates measures it
            // (Clarberg 2008, "Fast Equal-Area Mapping of the (Hemi)Sphere using SIMD").
            let at = |i: usize, count: usize| (2.0 * (i as f64 + 0.5) / count as f64 - 1.0).abs();
            let inside = 1.0 - (at(x, width) + at(y, height));
            let cosine = 1.0 - (1.0 - inside.abs()).powi(2);
            let solid_angle = 4.0 * std::f64::consts::PI / (width * height) as f64;
            if inside > 0.0 { cosine * solid_angle } else { 0.0 }
        }
    };
    let texels = linear(image.texels.clone()).into_iter().enumerate();
    let light = texels
        .map(|(i, [r, g, b, _])| f64::from(LUMINANCE.dot(Vec3::new(r, g, b))) * weight(i % width, i / width));
    light.sum::<f64>() as f32
}

fn infinite(params: &Params, to_world: DAffine3, context: &Context, images: &mut Requests) -> Result<Sky> {
    if uniform_scale(&to_world).is_none() {
        context.warn(params.place, "an infinite light that is stretched is only turned");
    }
    let parts = Parts::of(to_world);
    // What is left of a scale that may mirror.
    let mirror = if parts.scale.determinant() < 0.0 { -1.0 } else { 1.0 };
    let to_world = match uniform_scale(&to_world) {
        Some(scale) => to_world.matrix3 * (1.0 / scale),
        None => DMat3::from_quat(parts.rotation) * DMat3::from_diagonal(DVec3::splat(mirror)),
    };
    let portal = portal(params)?;
    let strength = match params.spectrum("L", context)? {
        // As in pbrt, where a portal makes a picture of it.
        Some(spectrum) if portal.is_some() => spectrum.radiance(),
        _ => params.light("L", context)?,
    };
    Ok(Sky {
        image: image(params, context, images)?,
        scale: strength * scale(params)?,
        illuminance: positive(params, "illuminance")?,
        to_world,
        portal,
        place: params.place,
    })
}

/// Four corners in the world, whatever the light's transform. Light is seen on the side to which the first edge turns
/// by the last one.
fn portal(params: &Params) -> Result<Option<Portal>> {
    let corners = params.vec3s("portal", Kind::Point3)?;
    let refuse = |expected: &str| Err(Fault::invalid(params.place_of("portal"), expected));
    let (corner, edges, opposite) = match corners[..] {
        [] => return Ok(None),
        [a, b, c, d] => (a, [d - a, b - a], c),
        _ => return refuse(&format!("\"portal\" has {} corners, expected 4", corners.len())),
    };
    let [x, y] = edges.map(Vec3::length);
    let skewed = edges[0].dot(edges[1]).abs() > 1e-3 * x * y;
    let open = (corner + edges[0] + edges[1]).distance(opposite) > 1e-3 * (x + y);
    if !(x * y).is_normal() || skewed || open {
        return refuse("the corners of \"portal\" are no rectangle, expected one, corner after corner");
    }
    Ok(Some(Portal { corner, edges }))
}

/// `from` and the direction to `to`, in the world.
fn aim(params: &Params, to_world: DAffine3) -> Result<(Vec3, Vec3)> {
    let from = params.vec3("from", Kind::Point3, Vec3::ZERO)?.as_dvec3();
    let to = params.vec3("to", Kind::Point3, Vec3::Z)?.as_dvec3();
    let direction = to_world.transform_vector3(to - from).try_normalize();
    let direction = direction.ok_or_else(|| {
        Fault::invalid(params.place_of("to"), format!("\"from\" and \"to\" of {} are the same", params.owner))
    })?;
    Ok((to_world.transform_point3(from).as_vec3(), direction.as_vec3()))
}

fn distant(params: &Params, to_world: DAffine3, context: &Context) -> Result<Light> {
    let (_, direction) = aim(params, to_world)?;
    let strength = params.light("L", context)? * scale(params)?;
    let irradiance = strength * positive(params, "illuminance")?.unwrap_or(1.0);
    Ok(Light::Directional { direction, irradiance })
}

/// Intensity; `solid_angle` is what one unit of intensity gives in power.
fn intensity(params: &Params, solid_angle: f32, context: &Context) -> Result<Vec3> {
    let strength = params.light("I", context)? * scale(params)?;
    Ok(match positive(params, "power")? {
        Some(power) => strength * power / solid_angle,
        None => strength,
    })
}

fn point(params: &Params, to_world: DAffine3, context: &Context) -> Result<Light> {
    let from = params.vec3("from", Kind::Point3, Vec3::ZERO)?.as_dvec3();
    let position = to_world.transform_point3(from).as_vec3();
    Ok(Light::Point { position, intensity: intensity(params, 4.0 * PI, context)? })
}

fn spot(params: &Params, to_world: DAffine3, context: &Context) -> Result<Light> {
    let (position, direction) = aim(params, to_world)?;
    let angle = params.float_where("coneangle", 30.0, |a| a > 0.0 && a <= 180.0, "an angle up to 180")?;
    let delta = |name, default| params.float_where(name, default, |d| d >= 0.0, "at least 0");
    // The program calls it so, its documentation once did otherwise.
    let delta = delta("conedeltaangle", delta("conedelta", 5.0)?)?;
    let (outer_angle, inner_angle) = (angle.to_radians(), (angle - delta).max(0.0).to_radians());
    let (end, start) = (outer_angle.cos(), inner_angle.cos());
    let solid_angle = 2.0 * PI * ((1.0 - start) + (start - end) / 2.0);
    let intensity = intensity(params, solid_angle, context)?;
    let falloff = SpotFalloff::Smooth;
    Ok(Light::Spot { position, direction, intensity, inner_angle, outer_angle, falloff })
}

/// A light with a diagram of its intensities, and one that sends a picture.
#[derive(Debug)]
struct Projected {
    image: ImageId,
    /// Of a projector, the full angle of the shorter side, in radians.
    fov: Option<f32>,
    strength: Vec3,
    power: Option<f32>,
    to_world: DAffine3,
    place: Place,
}

fn goniometric(
    params: &Params,
    to_world: DAffine3,
    context: &Context,
    images: &mut Requests,
) -> Result<Shone> {
    let number = Use { channels: Channels::Mean, ..Use::COLOR };
    let Some(image) = picture(params, number, context, images)? else {
        context.warn(params.place, "a goniometric light without \"filename\" shines to all sides alike");
        let position = to_world.translation.as_vec3();
        return Ok(Shone::At(Light::Point { position, intensity: intensity(params, 4.0 * PI, context)? }));
    };
    // The diagram's pole is y.
    let axes = DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::Y);
    Ok(Shone::Through(Projected {
        image,
        fov: None,
        strength: params.light("I", context)? * scale(params)?,
        power: positive(params, "power")?,
        to_world: to_world * DAffine3::from_mat3(axes),
        place: params.place,
    }))
}

fn projection(
    params: &Params,
    to_world: DAffine3,
    context: &Context,
    images: &mut Requests,
) -> Result<Shone> {
    let Some(image) = picture(params, Use::COLOR, context, images)? else {
        let message = format!("{} has no \"string filename\"", params.owner);
        return Err(Fault::invalid(params.place, message));
    };
    let fov =
        params.float_where("fov", 90.0, |fov| fov > 0.0 && fov < 180.0, "an angle between 0 and 180")?;
    Ok(Shone::Through(Projected {
        image,
        fov: Some(fov.to_radians()),
        strength: Vec3::splat(scale(params)?),
        power: positive(params, "power")?,
        // The first row of the picture is on top.
        to_world: to_world * DAffine3::from_scale(DVec3::new(1.0, -1.0, 1.0)),
        place: params.place,
    }))
}

/// A light, or what becomes one with its picture.
enum Shone {
    At(Light),
    Through(Projected),
}

impl Projected {
    /// The light with its picture.
    fn light(&self, images: &Images) -> Result<Light> {
        let image = images.get(self.image);
        let (width, height) = (image.width as f32, image.height as f32);
        let spread = match self.fov {
            Some(fov) => {
                let size = Vec2::new(width, height);
                PictureSpread::Window { half: size / size.min_element() * (0.5 * fov).tan() }
            }
            None if width == height => PictureSpread::AllAround,
            None => {
                let message = format!(
                    "the diagram of the goniometric light is {width} x {height}, expected a square (equal-area)"
                );
                return Err(Fault::invalid(self.place, message));
            }
        };
        let mut intensity = self.strength;
        if let Some(power) = self.power {
            let found = spread.power(image, |rgb| LUMINANCE.dot(rgb));
            intensity *= if found > 0.0 { power / found } else { 0.0 };
        }
        Ok(Light::Picture {
            position: self.to_world.translation.as_vec3(),
            from_world: self.to_world.matrix3.inverse().as_mat3(),
            intensity,
            image: Arc::clone(image),
            spread,
        })
    }
}
