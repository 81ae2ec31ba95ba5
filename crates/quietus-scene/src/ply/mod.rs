//! PLY files: triangles and polygons with positions, normals and texture coordinates; text or binary, either byte
//! order, gzipped or not (Turk 1994, "The PLY Polygon File Format").

mod body;
mod header;

use std::path::Path;

use glam::{Vec2, Vec3};
use quietus_trace::desc::Mesh;

use crate::error::{ErrorKind, SceneError};
use crate::file;
use body::Body;
use header::{Element, Header, Property};

/// Reads the mesh in the file at `path`.
pub(crate) fn read(path: &Path) -> Result<Mesh, SceneError> {
    let bytes = file::read_unpacked(path)?;
    parse(path, &bytes)
}

/// Reads the mesh in `bytes`; `path` is for messages.
pub(crate) fn parse(path: &Path, bytes: &[u8]) -> Result<Mesh, SceneError> {
    let (header, start) = header::read(path, bytes)?;
    let mut body = Body::new(path, &bytes[start..], start, header.format);
    let mut mesh = Mesh::default();
    let mut found = (false, false);
    for element in &header.elements {
        match element.name.as_str() {
            "vertex" => {
                vertices(&mut body, element, &mut mesh, path)?;
                found.0 = true;
            }
            "face" => {
                faces(&mut body, element, &mut mesh)?;
                found.1 = true;
            }
            _ => body.skip(element)?,
        }
    }
    match found {
        (true, true) => {}
        (false, _) => return Err(missing(path, &header, "vertex")),
        (_, false) => return Err(missing(path, &header, "face")),
    }
    check_indices(path, &mesh)?;
    Ok(mesh)
}

fn missing(path: &Path, header: &Header, name: &str) -> SceneError {
    let elements: Vec<_> = header.elements.iter().map(|element| element.name.as_str()).collect();
    let message = format!("the file has elements {}, expected one called {name}", elements.join(", "));
    SceneError::new(ErrorKind::Invalid, path, "header", message)
}

/// Names that different programs give to texture coordinates.
const UV_NAMES: [[&str; 2]; 4] =
    [["u", "v"], ["s", "t"], ["texture_u", "texture_v"], ["texture_s", "texture_t"]];

/// The numbers of the properties called `names`, if they are all there.
fn columns<const N: usize>(element: &Element, names: [&str; N]) -> Option<[usize; N]> {
    let of = |name: &str| element.properties.iter().position(|property| property.is_scalar(name));
    let found = names.map(of);
    found.iter().all(Option::is_some).then(|| found.map(|column| column.unwrap_or(0)))
}

fn vertices(body: &mut Body<'_>, element: &Element, mesh: &mut Mesh, path: &Path) -> Result<(), SceneError> {
    let Some(xyz) = columns(element, ["x", "y", "z"]) else {
        let message = "vertices have no x, y and z";
        return Err(SceneError::new(ErrorKind::Invalid, path, "header", message));
    };
    let normal = columns(element, ["nx", "ny", "nz"]);
    let uv = UV_NAMES.iter().find_map(|names| columns(element, *names));
    let count = body.expect(element)?;
    mesh.positions = Vec::with_capacity(count);
    mesh.normals = Vec::with_capacity(if normal.is_some() { count } else { 0 });
    mesh.uvs[0] = Vec::with_capacity(if uv.is_some() { count } else { 0 });
    let Mesh { positions, normals, uvs, .. } = mesh;
    body.rows(element, |row| {
        let position = Vec3::from_array(xyz.map(|column| row[column]));
        if !position.is_finite() {
            return Err(format!("vertex {} is at {position}, expected finite numbers", positions.len()));
        }
        positions.push(position);
        if let Some(normal) = normal {
            let normal = Vec3::from_array(normal.map(|column| row[column]));
            normals.push(if normal.is_finite() { normal.normalize_or_zero() } else { Vec3::ZERO });
        }
        if let Some(uv) = uv {
            let uv = Vec2::from_array(uv.map(|column| row[column]));
            uvs[0].push(if uv.is_finite() { uv } else { Vec2::ZERO });
        }
        Ok(())
    })
}

fn faces(body: &mut Body<'_>, element: &Element, mesh: &mut Mesh) -> Result<(), SceneError> {
    let is_list = |property: &Property| matches!(property.name.as_str(), "vertex_indices" | "vertex_index");
    let Some(column) = element.properties.iter().position(|p| p.list.is_some() && is_list(p)) else {
        return Err(body.error(ErrorKind::Invalid, "faces have no list vertex_indices"));
    };
    let count = body.expect(element)?;
    mesh.triangles = Vec::with_capacity(count);
    let triangles = &mut mesh.triangles;
    body.lists(element, column, |face| match *face {
        [a, b, c] => triangles.push([a, b, c]),
        // Two triangles for four corners, fans for more.
        [first, ref rest @ ..] => {
            triangles.extend(rest.windows(2).map(|pair| [first, pair[0], pair[1]]));
        }
        [] => {}
    })
}

fn check_indices(path: &Path, mesh: &Mesh) -> Result<(), SceneError> {
    let count = mesh.positions.len();
    let largest = mesh.triangles.as_flattened().iter().max();
    match largest {
        Some(&index) if index as usize >= count => {
            let message = format!("a face refers to vertex {}, expected 0 to {count} - 1", index as i32);
            Err(SceneError::new(ErrorKind::Invalid, path, "element face", message))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests;
