//! Descriptions that cannot be drawn are refused, each with its place.

use std::sync::Arc;

use glam::{Affine3A, Mat3, Vec2, Vec3, Vec4};

use super::{Scene, SceneBuildError as Error};
use crate::desc::{
    Alpha, ColorParam, Environment, Geometry, Image, Instance, Light, Material, MaterialId, Mesh, Object,
    ObjectId, SceneDesc, Shape, Surface, Texels, TextureId,
};
use crate::material::MaterialError;

fn mesh() -> Mesh {
    Mesh { positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y], triangles: vec![[0, 1, 2]], ..Mesh::default() }
}

/// A triangle, a sphere, one instance.
fn sound() -> SceneDesc {
    let shape = |geometry| Shape::new(geometry, MaterialId(0));
    SceneDesc {
        materials: vec![Material {
            name: "grey".into(),
            surface: Surface::Diffuse { reflectance: ColorParam::constant(Vec3::splat(0.5)) },
            emission: ColorParam::constant(Vec3::ZERO),
            emission_two_sided: false,
            normal_map: None,
            bump: None,
            alpha: Alpha::Opaque,
        }],
        objects: vec![Object {
            name: "thing".into(),
            shapes: vec![
                shape(Geometry::Mesh(Arc::new(mesh()))),
                shape(Geometry::Sphere { center: Vec3::ZERO, radius: 1.0 }),
            ],
        }],
        instances: vec![Instance::still(ObjectId(0), Affine3A::IDENTITY)],
        ..SceneDesc::default()
    }
}

/// The error of a sound scene after `spoil`.
fn refusal(spoil: impl FnOnce(&mut SceneDesc)) -> Error {
    let mut desc = sound();
    Scene::build(&desc).expect("sound before it is spoilt");
    spoil(&mut desc);
    Scene::build(&desc).expect_err("spoilt")
}

fn with_mesh(spoil: impl FnOnce(&mut Mesh)) -> String {
    let mut mesh = mesh();
    spoil(&mut mesh);
    refusal(|desc| desc.objects[0].shapes[0].geometry = Geometry::Mesh(Arc::new(mesh))).to_string()
}

#[test]
fn indices_past_the_end_are_named() {
    let error = refusal(|desc| desc.objects[0].shapes[1].material = MaterialId(3));
    let place = "object 0 \"thing\", shape 1".to_owned();
    assert_eq!(error, Error::Index { place, what: "material", index: 3, len: 1 });
    let error = refusal(|desc| desc.instances[0].object = ObjectId(1));
    assert_eq!(error.to_string(), "instance 0: object 1 does not exist; there are 1");
    assert_eq!(
        with_mesh(|mesh| mesh.triangles.push([0, 1, 3])),
        "object 0 \"thing\", shape 0, triangle 1: vertex 3 does not exist; there are 3"
    );
}

#[test]
fn lengths_that_differ_are_counted() {
    type Spoil = fn(&mut Mesh);
    let spoilt: [(Spoil, &str); 5] = [
        (|mesh| mesh.normals = vec![Vec3::Z], "normals"),
        (|mesh| mesh.tangents = vec![Vec4::X], "tangents"),
        (|mesh| mesh.uvs[0] = vec![Vec2::ZERO], "texture coordinates of set 0"),
        (|mesh| mesh.uvs[1] = vec![Vec2::ZERO], "texture coordinates of set 1"),
        (|mesh| mesh.colors = vec![Vec4::ONE], "vertex colours"),
    ];
    for (spoil, what) in spoilt {
        let expected = format!("object 0 \"thing\", shape 0: 1 {what}, expected 3");
        assert_eq!(with_mesh(spoil), expected);
    }
    let error = refusal(|desc| desc.environment = Some(sky(2, vec![[1.0; 4]])));
    let place = "environment map \"sky\"".to_owned();
    assert_eq!(error, Error::Length { place, what: "texels", found: 1, expected: 2 });
}

/// A map of one row.
fn sky(width: u32, texels: Vec<[f32; 4]>) -> Environment {
    let image = Image { name: "sky".into(), width, height: 1, texels: Texels::Float(texels) };
    Environment {
        layout: crate::desc::EnvironmentLayout::LatLong,
        image: Some(Arc::new(image)),
        scale: Vec3::ONE,
        to_world: Mat3::IDENTITY,
        portal: None,
    }
}

#[test]
fn numbers_out_of_range_are_quoted() {
    let sphere = |center, radius| {
        refusal(|desc| desc.objects[0].shapes[1].geometry = Geometry::Sphere { center, radius }).to_string()
    };
    let place = "object 0 \"thing\", shape";
    assert_eq!(sphere(Vec3::ZERO, 0.0), format!("{place} 1: radius is 0; expected a finite number above 0"));
    assert_eq!(
        sphere(Vec3::NAN, 1.0),
        format!("{place} 1: centre is [NaN, NaN, NaN]; expected finite numbers")
    );
    assert_eq!(
        with_mesh(|mesh| mesh.positions[2].x = f32::INFINITY),
        format!("{place} 0, vertex 2: position is [inf, 1, 0]; expected finite numbers")
    );
    let error = refusal(|desc| desc.instances[0].to_world = Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0)));
    assert!(
        matches!(&error, Error::Value { place, what: "transform", .. } if place == "instance 0"),
        "{error}"
    );
}

#[test]
fn lights_that_cannot_shine_are_refused() {
    let (position, direction, intensity) = (Vec3::ZERO, Vec3::X, Vec3::ONE);
    let spot = |inner_angle, outer_angle| Light::Spot {
        position,
        direction,
        intensity,
        inner_angle,
        outer_angle,
        falloff: crate::desc::SpotFalloff::Square,
    };
    let spoilt = [
        (Light::Point { position: Vec3::NAN, intensity }, "position"),
        (Light::Point { position, intensity: -intensity }, "intensity"),
        (Light::Directional { direction: Vec3::ONE, irradiance: intensity }, "direction"),
        (Light::Directional { direction, irradiance: Vec3::INFINITY }, "irradiance"),
        (spot(0.5, 4.0), "outer angle"),
        (spot(0.5, 0.4), "inner angle"),
        (spot(f32::NAN, 0.4), "inner angle"),
    ];
    for (light, expected) in spoilt {
        let error = refusal(|desc| desc.lights = vec![light.clone()]);
        let found =
            matches!(&error, Error::Value { place, what, .. } if place == "light 0" && *what == expected);
        assert!(found, "{expected}: {error}");
    }
}

#[test]
fn environments_that_cannot_shine_are_refused() {
    let constant = Environment {
        layout: crate::desc::EnvironmentLayout::LatLong,
        image: None,
        scale: Vec3::ONE,
        to_world: Mat3::IDENTITY,
        portal: None,
    };
    let spoilt = [
        (Environment { scale: Vec3::NEG_ONE, ..constant.clone() }, "environment: scale is"),
        (Environment { to_world: 2.0 * Mat3::IDENTITY, ..constant }, "environment: transform is"),
        (sky(0, Vec::new()), "environment map \"sky\": number of texels is 0;"),
        (
            sky(2, vec![[1.0; 4], [1.0, -1.0, 1.0, 1.0]]),
            "environment map \"sky\", column 1, row 0: texel is (1, -1, 1);",
        ),
    ];
    for (environment, expected) in spoilt {
        let message = refusal(|desc| desc.environment = Some(environment)).to_string();
        assert!(message.starts_with(expected), "{message}");
    }
}

#[test]
fn material_errors_are_passed_on() {
    let error = refusal(|desc| desc.materials[0].normal_map = Some((TextureId(0), 1.0)));
    assert!(matches!(error, Error::Material(MaterialError::NoSuchTexture { .. })), "{error}");
}

#[test]
fn shapes_without_extent_are_refused() {
    use crate::desc::{CurveKind, CurveSegment, Curves, PatchMesh, Quadric};
    let message = |geometry: Geometry| {
        let error = refusal(|desc| desc.objects[0].shapes[1].geometry = geometry).to_string();
        error.strip_prefix("object 0 \"thing\", shape 1").expect("says where").to_owned()
    };
    let (radius, phi_max) = (1.0, 1.0);
    let quadrics = [
        (Quadric::Cylinder { radius: -1.0, z_min: 0.0, z_max: 1.0, phi_max }, ": radius is -1;"),
        (Quadric::Cylinder { radius, z_min: 1.0, z_max: 0.0, phi_max }, ": range of heights is 1..0;"),
        (Quadric::PartialSphere { radius, z_min: 0.0, z_max: 2.0, phi_max }, ": range of heights is 0..2;"),
        (Quadric::Disk { height: f32::NAN, radius, inner_radius: 0.0, phi_max }, ": height is NaN;"),
        (Quadric::Disk { height: 0.0, radius, inner_radius: 1.0, phi_max }, ": inner radius is 1;"),
        (Quadric::Disk { height: 0.0, radius, inner_radius: 0.0, phi_max: 7.0 }, ": swept angle is 7;"),
    ];
    for (quadric, expected) in quadrics {
        let message = message(Geometry::Quadric(quadric));
        assert!(message.starts_with(expected), "{message}");
    }
    let flat =
        PatchMesh { positions: vec![Vec3::ZERO; 3], patches: vec![[0, 1, 2, 3]], ..PatchMesh::default() };
    let found = message(Geometry::Patches(Arc::new(flat)));
    assert_eq!(found, ", patch 0: vertex 3 does not exist; there are 3");
    let short = PatchMesh { positions: vec![Vec3::ZERO; 4], uvs: vec![Vec2::ZERO], ..PatchMesh::default() };
    let found = message(Geometry::Patches(Arc::new(short)));
    assert_eq!(found, ": 1 texture coordinates, expected 4");
    let sound = CurveSegment {
        points: [Vec3::ZERO; 4],
        widths: [0.1; 2],
        u_range: [0.0, 1.0],
        normals: [Vec3::Z; 2],
    };
    let curves = [
        (CurveSegment { widths: [0.1, -0.1], ..sound }, ", segment 0: width is -0.1;"),
        (CurveSegment { points: [Vec3::NAN; 4], ..sound }, ", segment 0: control point is"),
        (CurveSegment { normals: [Vec3::ONE; 2], ..sound }, ", segment 0: normal is [1, 1, 1];"),
    ];
    for (segment, expected) in curves {
        let curves = Curves { kind: CurveKind::Ribbon, segments: vec![segment] };
        let message = message(Geometry::Curves(Arc::new(curves)));
        assert!(message.starts_with(expected), "{message}");
    }
}

#[test]
fn motions_that_lead_nowhere_are_refused() {
    let mirror = Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
    let message = refusal(|desc| desc.instances[0].end_to_world = Some(mirror)).to_string();
    assert!(message.starts_with("instance 0: transform when the shutter closes is"), "{message}");
    let expected = "object 0 \"thing\", shape 0: 1 positions when the shutter closes, expected 3";
    assert_eq!(with_mesh(|mesh| mesh.end_positions = vec![Vec3::ZERO]), expected);
    let message = with_mesh(|mesh| {
        mesh.normals = vec![Vec3::Z; 3];
        mesh.end_positions = mesh.positions.clone();
    });
    assert_eq!(message, "object 0 \"thing\", shape 0: 0 normals when the shutter closes, expected 3");
}
