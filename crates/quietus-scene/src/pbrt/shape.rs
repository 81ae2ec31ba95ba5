//! Shapes, in their own space.

use std::rc::Rc;

use glam::{Vec2, Vec3};
use quietus_trace::desc::{Mesh, PatchMesh, Quadric};

use super::curve;
use super::displacement::Displacement;
use super::draft::{Alpha, Entity, Files, Form, Shape, Style};
use super::fault::{Context, Fault, Result, unknown};
use super::params::{Kind, Params, Values};
use super::subdivision::Surface;
use super::transform::Moving;

/// Every type of shape.
const KINDS: [&str; 8] =
    ["bilinearmesh", "curve", "cylinder", "disk", "loopsubdiv", "plymesh", "sphere", "trianglemesh"];

/// Reads a shape. PLY files are only noted in `ply`, to be loaded side by side. `None` where there is nothing to draw.
pub(super) fn read(
    entity: &Entity,
    to_world: Moving,
    style: Rc<Style>,
    context: &Context,
    ply: &mut Files,
) -> Result<Option<Shape>> {
    let params = &entity.params;
    let mut displacement = None;
    let form = match &*entity.kind {
        "sphere" => Some(sphere(params)?),
        "disk" => Some(Form::Quadric(disk(params)?)),
        "cylinder" => Some(Form::Quadric(cylinder(params)?)),
        "trianglemesh" => Some(Form::Mesh(triangle_mesh(params, context)?)),
        "loopsubdiv" => Some(Form::Mesh(subdivided(params)?)),
        "bilinearmesh" => Some(Form::Patches(patches(params, context)?)),
        "plymesh" => {
            displacement = self::displacement(params)?;
            Some(Form::Ply(ply_mesh(params, context, ply)?))
        }
        "curve" => curve::read(params, context)?.map(Form::Curves),
        kind => return Err(Fault::invalid(params.place, unknown("shape", kind, &KINDS))),
    };
    let alpha = alpha(params)?;
    params.finish()?;
    let place = params.place;
    Ok(form.map(|form| Shape { form, to_world, style, alpha, displacement, place }))
}

fn alpha(params: &Params) -> Result<Option<Alpha>> {
    let Some(param) = params.find("alpha", &[Kind::Float, Kind::Texture])? else { return Ok(None) };
    match &param.values {
        Values::Numbers(values) => match values[..] {
            [value] if value >= 1.0 => Ok(None),
            [value] => Ok(Some(Alpha::Constant(value.max(0.0)))),
            _ => Err(Fault::invalid(param.place, "\"float alpha\" expects 1 value")),
        },
        Values::Strings(values) if values.len() == 1 => {
            Ok(Some(Alpha::Texture(values[0].clone(), param.place)))
        }
        _ => Err(Fault::invalid(param.place, "\"texture alpha\" expects 1 name")),
    }
}

fn above_zero(params: &Params, name: &'static str, default: f32) -> Result<f32> {
    params.float_where(name, default, |value| value > 0.0, "a number above 0")
}

/// The swept angle, in radians.
fn phi_max(params: &Params) -> Result<f32> {
    let degrees = params.float_where("phimax", 360.0, |phi| phi > 0.0, "an angle above 0")?;
    Ok(degrees.min(360.0).to_radians())
}

fn sphere(params: &Params) -> Result<Form> {
    let radius = above_zero(params, "radius", 1.0)?;
    let (a, b) = (params.float("zmin", -radius)?, params.float("zmax", radius)?);
    let (z_min, z_max) = (a.min(b).clamp(-radius, radius), a.max(b).clamp(-radius, radius));
    let phi_max = phi_max(params)?;
    if z_min == -radius && z_max == radius && phi_max == std::f32::consts::TAU {
        return Ok(Form::Sphere(radius));
    }
    heights(params, z_min, z_max)?;
    Ok(Form::Quadric(Quadric::PartialSphere { radius, z_min, z_max, phi_max }))
}

fn heights(params: &Params, z_min: f32, z_max: f32) -> Result<()> {
    if z_min < z_max {
        return Ok(());
    }
    let message = format!("{} lies between z = {z_min} and {z_max}, expected some height", params.owner);
    Err(Fault::invalid(params.place, message))
}

fn disk(params: &Params) -> Result<Quadric> {
    let radius = above_zero(params, "radius", 1.0)?;
    let expected = format!("a number from 0 to below the radius, {radius}");
    let inner_radius =
        params.float_where("innerradius", 0.0, |inner| (0.0..radius).contains(&inner), &expected)?;
    Ok(Quadric::Disk {
        height: params.float("height", 0.0)?,
        radius,
        inner_radius,
        phi_max: phi_max(params)?,
    })
}

fn cylinder(params: &Params) -> Result<Quadric> {
    let radius = above_zero(params, "radius", 1.0)?;
    let (a, b) = (params.float("zmin", -1.0)?, params.float("zmax", 1.0)?);
    let (z_min, z_max) = (a.min(b), a.max(b));
    heights(params, z_min, z_max)?;
    Ok(Quadric::Cylinder { radius, z_min, z_max, phi_max: phi_max(params)? })
}

/// Vertices with what may belong to them.
struct Vertices {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
}

fn vertices(params: &Params) -> Result<Vertices> {
    let positions = params.vec3s("P", Kind::Point3)?;
    if positions.is_empty() {
        return Err(Fault::invalid(params.place, format!("{} has no \"point3 P\"", params.owner)));
    }
    let normals: Vec<Vec3> =
        params.vec3s("N", Kind::Normal)?.into_iter().map(Vec3::normalize_or_zero).collect();
    let uvs = params.vec2s("uv")?;
    for (name, count) in [("N", normals.len()), ("uv", uvs.len())] {
        if count != 0 && count != positions.len() {
            let message =
                format!("\"{name}\" of {} has {count} values for {} vertices", params.owner, positions.len());
            return Err(Fault::invalid(params.place_of(name), message));
        }
    }
    Ok(Vertices { positions, normals, uvs })
}

/// Groups of `N` vertices; the `N` vertices themselves where no indices are given.
fn faces<const N: usize>(params: &Params, vertices: usize) -> Result<Vec<[u32; N]>> {
    let indices = params.integers("indices")?;
    if indices.is_empty() {
        if vertices == N {
            return Ok(vec![std::array::from_fn(|i| i as u32)]);
        }
        let message = format!("{} has no \"integer indices\" for its {vertices} vertices", params.owner);
        return Err(Fault::invalid(params.place, message));
    }
    let refuse = |message: String| Err(Fault::invalid(params.place_of("indices"), message));
    if let Some(index) = indices.iter().find(|&&index| index < 0 || index as usize >= vertices) {
        return refuse(format!("index {index} of {}, expected 0 to {}", params.owner, vertices - 1));
    }
    let (faces, rest) = indices.as_chunks::<N>();
    if !rest.is_empty() {
        return refuse(format!(
            "\"integer indices\" has {} values, expected a multiple of {N}",
            indices.len()
        ));
    }
    Ok(faces.iter().map(|face| face.map(|index| index as u32)).collect())
}

fn triangle_mesh(params: &Params, context: &Context) -> Result<Mesh> {
    let Vertices { positions, normals, uvs } = vertices(params)?;
    let triangles = faces::<3>(params, positions.len())?;
    if params.has("S") {
        context.warn(
            params.place_of("S"),
            "tangents \"S\" of meshes are not used; the texture coordinates give theirs",
        );
    }
    // Only textures of a kind that is not drawn look at the numbers of faces.
    params.ignore(&["S", "faceIndices"]);
    Ok(Mesh { positions, triangles, normals, uvs: [uvs, Vec::new()], ..Mesh::default() })
}

/// The limit of a subdivision surface, at the corners of what its triangles are divided into.
fn subdivided(params: &Params) -> Result<Mesh> {
    let levels = params.integer_from("levels", 0)?.unwrap_or(3);
    let positions = params.vec3s("P", Kind::Point3)?;
    if positions.is_empty() {
        return Err(Fault::invalid(params.place, format!("{} has no \"point3 P\"", params.owner)));
    }
    let triangles = faces::<3>(params, positions.len())?;
    params.choice("scheme", &["loop"])?;
    let mut surface = Surface { positions, triangles };
    if !surface.fits(levels) {
        let message = format!("{levels} divisions of {} triangles are too many", surface.triangles.len());
        return Err(Fault::unsupported(params.place_of("levels"), message));
    }
    for _ in 0..levels {
        surface = surface.divided();
    }
    let (positions, normals) = surface.limit();
    Ok(Mesh { positions, triangles: surface.triangles, normals, ..Mesh::default() })
}

fn patches(params: &Params, context: &Context) -> Result<PatchMesh> {
    let Vertices { positions, normals, uvs } = vertices(params)?;
    let patches = faces::<4>(params, positions.len())?;
    if params.has("emissionfilename") {
        context.warn(
            params.place_of("emissionfilename"),
            "\"emissionfilename\" is not used: the patch emits evenly",
        );
    }
    params.ignore(&["emissionfilename", "faceIndices"]);
    Ok(PatchMesh { positions, patches, normals, uvs })
}

fn ply_mesh(params: &Params, context: &Context, ply: &mut Files) -> Result<usize> {
    let Some(name) = params.string("filename")? else {
        return Err(Fault::invalid(params.place, "shape \"plymesh\" has no \"string filename\""));
    };
    Ok(ply.ask(context.resolve(name), params.place_of("filename")))
}

fn displacement(params: &Params) -> Result<Option<Displacement>> {
    // Of earlier versions of pbrt-v4.
    params.ignore(&["uvscale"]);
    let older = params.float_where("edgelength", 1.0, |length| length > 0.0, "above 0")?;
    let edge = params.float_where("displacement.edgelength", older, |length| length > 0.0, "above 0")?;
    let Some(param) = params.find("displacement", &[Kind::Texture])? else { return Ok(None) };
    match &param.values {
        Values::Strings(names) if names.len() == 1 => {
            Ok(Some(Displacement { texture: names[0].clone(), place: param.place, edge }))
        }
        _ => Err(Fault::invalid(param.place, "\"texture displacement\" expects 1 name")),
    }
}
