//! Looks for indices, lengths and numbers that cannot be drawn.

use glam::{Mat3, Vec3};
use rayon::prelude::*;

use super::SceneBuildError as Error;
use crate::desc::{
    CurveKind, Curves, Density, Environment, EnvironmentLayout, Geometry, Glow, Grid, Image, Instance, Light,
    Medium, MediumInterface, Mesh, PatchMesh, PictureSpread, Portal, Quadric, SceneDesc, Shape, Texels,
    Variation,
};
use crate::geometry::motion::Motion;

/// Checks all but textures and materials.
pub(super) fn scene(desc: &SceneDesc) -> Result<(), Error> {
    let fault = desc.objects.par_iter().enumerate().find_map_first(|(o, object)| {
        object.shapes.par_iter().enumerate().find_map_first(|(s, shape)| {
            self::shape(&|| format!("object {o} \"{}\", shape {s}", object.name), shape, desc).err()
        })
    });
    fault.map_or(Ok(()), Err)?;
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

fn shape(place: Place, shape: &Shape, desc: &SceneDesc) -> Result<(), Error> {
    index(place, "material", shape.material.0, desc.materials.len())?;
    media(place, shape.media, desc.media.len())?;
    geometry(place, &shape.geometry)
}

fn geometry(place: Place, geometry: &Geometry) -> Result<(), Error> {
    match geometry {
        Geometry::Mesh(mesh) => self::mesh(place, mesh),
        Geometry::Sphere { center, radius } => sphere(place, *center, *radius),
        Geometry::Quadric(quadric) => self::quadric(place, quadric),
        Geometry::Patches(mesh) => patches(place, mesh),
        Geometry::Curves(curves) => self::curves(place, curves),
    }
}

fn positions(place: Place, positions: &[Vec3]) -> Result<(), Error> {
    for (v, position) in positions.iter().enumerate() {
        let place = || format!("{}, vertex {v}", place());
        value(&place, "position", position, position.is_finite(), "finite numbers")?;
    }
    Ok(())
}

fn quadric(place: Place, quadric: &Quadric) -> Result<(), Error> {
    let above_zero =
        |what, x: f32| value(place, what, x, x > 0.0 && x.is_finite(), "a finite number above 0");
    let heights = |low: f32, high: f32| {
        let sound = low < high && low.is_finite() && high.is_finite();
        value(
            place,
            "range of heights",
            format_args!("{low}..{high}"),
            sound,
            "finite numbers, the lower one first",
        )
    };
    let phi_max = match *quadric {
        Quadric::PartialSphere { radius, z_min, z_max, phi_max } => {
            above_zero("radius", radius).and(heights(z_min, z_max))?;
            let sound = -radius <= z_min && z_max <= radius;
            value(
                place,
                "range of heights",
                format_args!("{z_min}..{z_max}"),
                sound,
                "a part of the sphere's",
            )?;
            phi_max
        }
        Quadric::Disk { height, radius, inner_radius, phi_max } => {
            above_zero("radius", radius)?;
            value(place, "height", height, height.is_finite(), "a finite number")?;
            let sound = (0.0..radius).contains(&inner_radius);
            value(place, "inner radius", inner_radius, sound, "at least 0 and below the radius")?;
            phi_max
        }
        Quadric::Cylinder { radius, z_min, z_max, phi_max } => {
            above_zero("radius", radius).and(heights(z_min, z_max))?;
            phi_max
        }
    };
    // 2 pi may have been rounded up on its way here.
    let sound = phi_max > 0.0 && phi_max <= std::f32::consts::TAU * (1.0 + 1e-5);
    value(place, "swept angle", phi_max, sound, "more than 0 and at most 2 pi")
}

fn patches(place: Place, mesh: &PatchMesh) -> Result<(), Error> {
    let expected = mesh.positions.len();
    for (what, found) in [("normals", mesh.normals.len()), ("texture coordinates", mesh.uvs.len())] {
        if found != 0 && found != expected {
            return Err(Error::Length { place: place(), what, found, expected });
        }
    }
    for (p, patch) in mesh.patches.iter().enumerate() {
        for &vertex in patch {
            index(&|| format!("{}, patch {p}", place()), "vertex", vertex, expected)?;
        }
    }
    positions(place, &mesh.positions)
}

fn curves(place: Place, curves: &Curves) -> Result<(), Error> {
    for (s, segment) in curves.segments.iter().enumerate() {
        let place = || format!("{}, segment {s}", place());
        for point in segment.points {
            value(&place, "control point", point, point.is_finite(), "finite numbers")?;
        }
        for width in segment.widths {
            let sound = width >= 0.0 && width.is_finite();
            value(&place, "width", width, sound, "a finite number of at least 0")?;
        }
        for normal in segment.normals {
            let sound = curves.kind != CurveKind::Ribbon || normal.is_normalized();
            value(&place, "normal", normal, sound, "a vector of unit length")?;
        }
    }
    Ok(())
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
    positions(place, &mesh.positions).and(positions(place, &mesh.end_positions))
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
    value(place, "asymmetry", medium.g, (-1.0..=1.0).contains(&medium.g), "a number in -1..1")?;
    medium.variation.as_ref().map_or(Ok(()), |variation| self::variation(place, variation))
}

fn variation(place: Place, variation: &Variation) -> Result<(), Error> {
    let space = variation.from_world;
    let sound = space.is_finite() && space.inverse().is_finite();
    value(place, "transform", space, sound, "an invertible matrix of finite numbers")?;
    let number = |value: &f32| value.is_finite() && *value >= 0.0;
    let color = |value: &Vec3| value.is_finite() && value.min_element() >= 0.0;
    match &variation.density {
        Density::Grid(grid) => self::grid(place, grid, number)?,
        Density::Colors { absorption, scattering } => {
            [absorption, scattering].into_iter().flatten().try_for_each(|c| grid(place, c, color))?;
        }
        Density::Cloud { density, wispiness, frequency, to_cloud } => {
            for (what, found) in [("density", density), ("wispiness", wispiness), ("frequency", frequency)] {
                value(place, what, found, number(found), "at least 0, finite")?;
            }
            value(place, "transform of the cloud", to_cloud, to_cloud.is_finite(), "finite numbers")?;
        }
    }
    match &variation.glow {
        None => Ok(()),
        Some(Glow::Grid(grid)) => self::grid(place, grid, number),
        Some(Glow::Colors(grid)) => self::grid(place, grid, color),
        Some(Glow::Heat { temperature, scale, colors, hottest }) => {
            grid(place, temperature, number)?;
            scale.as_ref().map_or(Ok(()), |scale| grid(place, scale, number))?;
            let sound = colors.len() >= 2 && colors.iter().all(color);
            value(place, "number of colours", colors.len(), sound, "2 or more, all at least 0, finite")?;
            let sound = *hottest > 0.0 && hottest.is_finite();
            value(place, "hottest temperature", hottest, sound, "above 0, finite")
        }
    }
}

fn grid<T>(place: Place, grid: &Grid<T>, sound: impl Fn(&T) -> bool) -> Result<(), Error> {
    let [x, y, z] = grid.size;
    let size = format!("{x}x{y}x{z}");
    value(place, "size of the grid", size, (1..1 << 24).contains(&x.min(y).min(z)), "1x1x1 or more")?;
    let count = |[x, y, z]: [u32; 3]| {
        (x as usize).checked_mul(y as usize).and_then(|xy| xy.checked_mul(z as usize)).unwrap_or(usize::MAX)
    };
    let (found, expected, what) = match &grid.bricks {
        None => (grid.values.len(), count(grid.size), "values in the grid"),
        Some(bricks) => (bricks.len(), count(grid.blocks()), "blocks in the grid"),
    };
    if expected != found {
        return Err(Error::Length { place: place(), what, found, expected });
    }
    let stored = grid.values.len() / Grid::<T>::BRICK_CELLS;
    for &brick in grid.bricks.iter().flatten().filter(|&&brick| brick != Grid::<T>::NOTHING) {
        index(place, "brick", brick, stored)?;
    }
    let all = grid.values.iter().all(sound);
    value(place, "a value of the grid", "something else", all, "finite numbers of at least 0")
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
        Light::Picture { position, from_world, intensity, ref image, spread } => {
            point(position).and(color("intensity", intensity))?;
            let sound = from_world.is_finite() && from_world.inverse().is_finite();
            value(place, "transform", from_world, sound, "an invertible matrix of finite numbers")?;
            if let PictureSpread::Window { half } = spread {
                let sound = half.is_finite() && half.min_element() > 0.0;
                value(place, "half window", half, sound, "above 0, finite")?;
            }
            map("picture of a light", image)
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
    if let Some(Portal { corner, edges }) = environment.portal {
        value(&place, "corner of the portal", corner, corner.is_finite(), "finite")?;
        let [x, y] = edges.map(Vec3::length_squared);
        // Rounding of coordinates far from the origin may turn an edge a little.
        let right = edges[0].dot(edges[1]).abs() <= 1e-3 * (x * y).sqrt();
        let sound = right && (x * y).is_normal();
        value(&place, "edges of the portal", format!("{edges:?}"), sound, "perpendicular, of some length")?;
    }
    let Some(image) = &environment.image else { return Ok(()) };
    let square = environment.layout != EnvironmentLayout::EqualArea || image.width == image.height;
    let size = || format!("{}x{}", image.width, image.height);
    let place = || format!("environment map \"{}\"", image.name);
    value(&place, "size", size(), square, "a square, for the equal-area layout")?;
    map("environment map", image)
}

fn map(what: &str, image: &Image) -> Result<(), Error> {
    let place = || format!("{what} \"{}\"", image.name);
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
        value(&place, "texel", format_args!("({r}, {g}, {b})"), sound, "finite numbers of at least 0")?;
    }
    Ok(())
}
