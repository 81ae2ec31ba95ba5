//! Looks for indices, lengths and numbers that cannot be drawn.

use glam::{Mat3, Vec3};

use super::SceneBuildError as Error;
use crate::desc::{
    Environment, EnvironmentLayout, Geometry, Image, Instance, Light, Medium, MediumInterface, Mesh,
    SceneDesc, Texels,
};
use crate::geometry::motion::Motion;

/// Checks all but textures and materials.
pub(super) fn scene(desc: &SceneDesc) -> Result<(), Error> {
    for (o, object) in desc.objects.iter().enumerate() {
        for (s, shape) in object.shapes.iter().enumerate() {
            let place = || format!("object {o} \"{}\", shape {s}", object.name);
            index(&place, "material", shape.material.0, desc.materials.len())?;
            if shape.flipped {
                return Err(unsupported(&place, "a flipped shape"));
            }
            media(&place, shape.media, desc.media.len())?;
            match &shape.geometry {
                Geometry::Mesh(mesh) => self::mesh(&place, mesh)?,
                Geometry::Sphere { center, radius } => sphere(&place, *center, *radius)?,
                _ => return Err(unsupported(&place, "this kind of geometry")),
            }
        }
    }
    for (i, instance) in desc.instances.iter().enumerate() {
        self::instance(&|| format!("instance {i}"), instance, desc.objects.len())?;
    }
    for (i, medium) in desc.media.iter().enumerate() {
        self::medium(&|| format!("medium {i} \"{}\"", medium.name), medium)?;
    }
    for (i, camera) in desc.cameras.iter().enumerate() {
        if let Some(medium) = camera.medium {
            index(&|| format!("camera {i} \"{}\"", camera.name), "medium", medium.0, desc.media.len())?;
        }
    }
    for (i, light) in desc.lights.iter().enumerate() {
        self::light(&|| format!("light {i}"), light)?;
    }
    desc.environment.as_ref().map_or(Ok(()), environment)
}

/// Names the place of an error; only called when there is one.
type Place<'a> = &'a dyn Fn() -> String;

fn index(place: Place, what: &'static str, index: u32, len: usize) -> Result<(), Error> {
    if (index as usize) < len {
        return Ok(());
    }
    Err(Error::Index { place: place(), what, index: index.into(), len })
}

fn value<T: std::fmt::Display>(
    place: Place,
    what: &'static str,
    found: T,
    sound: bool,
    expected: &'static str,
) -> Result<(), Error> {
    if sound {
        Ok(())
    } else {
        Err(Error::Value { place: place(), what, found: found.to_string(), expected })
    }
}

/// For what the description can say and the renderer does not draw.
fn unsupported(place: Place, what: &'static str) -> Error {
    Error::Unsupported { place: place(), what }
}

fn mesh(place: Place, mesh: &Mesh) -> Result<(), Error> {
    let expected = mesh.positions.len();
    let lengths = [
        ("normals", mesh.normals.len()),
        ("tangents", mesh.tangents.len()),
        ("texture coordinates of set 0", mesh.uvs[0].len()),
        ("texture coordinates of set 1", mesh.uvs[1].len()),
        ("vertex colours", mesh.colors.len()),
        ("positions when the shutter closes", mesh.end_positions.len()),
        ("normals when the shutter closes", mesh.end_normals.len()),
    ];
    for (what, found) in lengths {
        if found != 0 && found != expected {
            return Err(Error::Length { place: place(), what, found, expected });
        }
    }
    // Both ends have normals, or neither.
    let (found, expected_normals) = (mesh.end_normals.len(), mesh.normals.len());
    if !mesh.end_positions.is_empty() && found != expected_normals || found > expected_normals {
        let what = "normals when the shutter closes";
        return Err(Error::Length { place: place(), what, found, expected: expected_normals });
    }
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        for &vertex in triangle {
            index(&|| format!("{}, triangle {t}", place()), "vertex", vertex, expected)?;
        }
    }
    for (v, position) in mesh.positions.iter().enumerate().chain(mesh.end_positions.iter().enumerate()) {
        let place = || format!("{}, vertex {v}", place());
        value(&place, "position", position, position.is_finite(), "finite numbers")?;
    }
    Ok(())
}

fn sphere(place: Place, center: Vec3, radius: f32) -> Result<(), Error> {
    value(place, "centre", center, center.is_finite(), "finite numbers")?;
    value(place, "radius", radius, radius > 0.0 && radius.is_finite(), "a finite number above 0")
}

fn instance(place: Place, instance: &Instance, objects: usize) -> Result<(), Error> {
    index(place, "object", instance.object.0, objects)?;
    let inverse = instance.to_world.inverse();
    let sound = instance.to_world.is_finite() && inverse.is_finite();
    value(place, "transform", instance.to_world, sound, "an invertible matrix of finite numbers")?;
    let Some(end) = instance.motion() else { return Ok(()) };
    let sound = Motion::new(&instance.to_world, end).is_some();
    let expected = "an invertible matrix of finite numbers that mirrors if that at the start does";
    value(place, "transform when the shutter closes", end, sound, expected)
}

fn media(place: Place, interface: Option<MediumInterface>, count: usize) -> Result<(), Error> {
    let Some(MediumInterface { inside, outside }) = interface else { return Ok(()) };
    for medium in [inside, outside].into_iter().flatten() {
        index(place, "medium", medium.0, count)?;
    }
    Ok(())
}

fn medium(place: Place, medium: &Medium) -> Result<(), Error> {
    let coefficients =
        [("absorption", medium.absorption), ("scattering", medium.scattering), ("emission", medium.emission)];
    for (what, c) in coefficients {
        value(place, what, c, c.is_finite() && c.min_element() >= 0.0, "at least 0, finite")?;
    }
    value(place, "asymmetry", medium.g, (-1.0..=1.0).contains(&medium.g), "a number in -1..1")
}

fn light(place: Place, light: &Light) -> Result<(), Error> {
    let color =
        |what, c: Vec3| value(place, what, c, c.is_finite() && c.min_element() >= 0.0, "at least 0, finite");
    let point = |p: Vec3| value(place, "position", p, p.is_finite(), "finite numbers");
    let unit = |d: Vec3| value(place, "direction", d, d.is_normalized(), "a vector of unit length");
    match *light {
        Light::Point { position, intensity } => point(position).and(color("intensity", intensity)),
        Light::Directional { direction, irradiance } => unit(direction).and(color("irradiance", irradiance)),
        Light::Spot { position, direction, intensity, inner_angle, outer_angle, .. } => {
            point(position).and(unit(direction)).and(color("intensity", intensity))?;
            let angle =
                |what, a: f32, sound| value(place, what, a, sound, "0 <= inner angle <= outer angle <= pi");
            angle("outer angle", outer_angle, (0.0..=std::f32::consts::PI).contains(&outer_angle))?;
            angle("inner angle", inner_angle, (0.0..=outer_angle).contains(&inner_angle))
        }
    }
}

fn environment(environment: &Environment) -> Result<(), Error> {
    let place = || "environment".to_owned();
    let scale = environment.scale;
    value(&place, "scale", scale, scale.is_finite() && scale.min_element() >= 0.0, "at least 0, finite")?;
    let rotation = environment.to_world;
    let off = rotation.transpose() * rotation - Mat3::IDENTITY;
    let sound = off.to_cols_array().iter().all(|entry| entry.abs() < 1e-3);
    value(&place, "transform", rotation, sound, "a rotation")?;
    let Some(image) = &environment.image else { return Ok(()) };
    let square = environment.layout != EnvironmentLayout::EqualArea || image.width == image.height;
    let size = || format!("{}x{}", image.width, image.height);
    let place = || format!("environment map \"{}\"", image.name);
    value(&place, "size", size(), square, "a square, for the equal-area layout")?;
    map(image)
}

fn map(image: &Image) -> Result<(), Error> {
    let place = || format!("environment map \"{}\"", image.name);
    let expected = image.width as usize * image.height as usize;
    let found = match &image.texels {
        Texels::Srgb8(texels) | Texels::Linear8(texels) => texels.len(),
        Texels::Float(texels) => texels.len(),
    };
    if found != expected {
        return Err(Error::Length { place: place(), what: "texels", found, expected });
    }
    value(
        &place,
        "number of texels",
        found,
        found > 0 && image.width.max(image.height) <= 1 << 24,
        "1 to 2^24 a side",
    )?;
    let Texels::Float(texels) = &image.texels else { return Ok(()) };
    for (i, [r, g, b, _]) in texels.iter().enumerate() {
        let sound = [r, g, b].iter().all(|c| c.is_finite() && **c >= 0.0);
        let place =
            || format!("{}, column {}, row {}", place(), i % image.width as usize, i / image.width as usize);
        value(&place, "texel", format!("({r}, {g}, {b})"), sound, "finite numbers of at least 0")?;
    }
    Ok(())
}
