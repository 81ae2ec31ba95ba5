//! The surface at a hit on a quadric, a patch or a curve.

use glam::{Vec2, Vec3};

use super::{Interaction, Placement};
use crate::bvh::{Hit, Ray};
use crate::desc::{CurveKind, Curves, Geometry, MaterialId, PatchMesh, Quadric};
use crate::frame::Frame;
use crate::geometry::curve::Strip;
use crate::geometry::{curve, gamma, patch, quadric};
use crate::texture::SurfacePoint;

impl Interaction {
    /// On anything but a mesh or a sphere; never inlined, to keep those two short.
    #[inline(never)]
    pub(super) fn on_other(
        geometry: &Geometry,
        material: MaterialId,
        placement: &Placement,
        hit: &Hit,
        ray: &Ray,
    ) -> Self {
        match geometry {
            Geometry::Quadric(quadric) => Self::on_quadric(quadric, material, placement, hit, ray),
            Geometry::Patches(mesh) => Self::on_patch(mesh, material, placement, hit),
            Geometry::Curves(curves) => Self::on_curve(curves, material, placement, hit, ray),
            Geometry::Mesh(_) | Geometry::Sphere { .. } => unreachable!("have functions of their own"),
        }
    }

    fn on_quadric(
        quadric: &Quadric,
        material: MaterialId,
        placement: &Placement,
        hit: &Hit,
        ray: &Ray,
    ) -> Self {
        let point = quadric_point(quadric, placement, hit, ray);
        let (position, error) = placement.point(point.position, point.error);
        let normal = placement.normal(point.normal);
        let surface = surface_point(position, point.uv);
        Self { position, error, geometric_normal: normal, shading_normal: normal, surface, material }
    }

    fn on_patch(mesh: &PatchMesh, material: MaterialId, placement: &Placement, hit: &Hit) -> Self {
        let indices = mesh.patches[hit.primitive as usize].map(|i| i as usize);
        let corners = indices.map(|i| mesh.positions[i]);
        let at = patch::blend(corners, hit.u, hit.v);
        let (position, error) = placement.point(at, patch::point_error(&corners));
        let geometric_normal = placement.normal(patch::normal(&corners, hit.u, hit.v));
        let shading_normal = if mesh.normals.is_empty() {
            geometric_normal
        } else {
            let normal = patch::blend(indices.map(|i| mesh.normals[i]), hit.u, hit.v);
            let interpolated = placement.normal(normal);
            (interpolated * interpolated.dot(geometric_normal).signum()).normalize_or(geometric_normal)
        };
        let surface = surface_point(position, patch_uv(mesh, hit));
        Self { position, error, geometric_normal, shading_normal, surface, material }
    }

    fn on_curve(curves: &Curves, material: MaterialId, placement: &Placement, hit: &Hit, ray: &Ray) -> Self {
        let segment = &curves.segments[hit.primitive as usize];
        let strip = strip(curves, placement, hit, ray);
        let local = placement.to_object.transform_point3(ray.origin + hit.t * ray.direction);
        // Whoever leaves the strip must leave the one that faces its own ray: the width is the bound. It is doubled
        // as in "Physically Based Rendering", 4th edition, section 6.7.2.
        let error = Vec3::splat(2.0 * curve::width(segment, hit.u)) + gamma(8) * local.abs();
        let (position, error) = placement.point(local, error);
        let surface = surface_point(position, curve::uv(segment, hit.u, strip.v));
        let normal = strip.normal;
        Self { position, error, geometric_normal: normal, shading_normal: normal, surface, material }
    }
}

fn surface_point(position: Vec3, uv: Vec2) -> SurfacePoint {
    SurfacePoint { uv: [uv; 2], position, ..SurfacePoint::default() }
}

fn quadric_point(quadric: &Quadric, placement: &Placement, hit: &Hit, ray: &Ray) -> quadric::Point {
    let rough = ray.origin + hit.t * ray.direction;
    quadric::point(quadric, placement.to_object.transform_point3(rough))
}

fn patch_uv(mesh: &PatchMesh, hit: &Hit) -> Vec2 {
    if mesh.uvs.is_empty() {
        return Vec2::new(hit.u, hit.v);
    }
    patch::blend(mesh.patches[hit.primitive as usize].map(|i| mesh.uvs[i as usize]), hit.u, hit.v)
}

/// The strip in the world that `ray` has met.
fn strip(curves: &Curves, placement: &Placement, hit: &Hit, ray: &Ray) -> Strip {
    let segment = &curves.segments[hit.primitive as usize];
    let tangent = placement.vector(curve::tangent(&segment.points, hit.u));
    // The kernel has measured it in the object's space, where a mirrored one lies the other way around.
    let v = if placement.handedness() < 0.0 { 1.0 - hit.v } else { hit.v };
    let strip = Strip::facing(tangent, ray.direction, v);
    match curves.kind {
        CurveKind::Flat => strip,
        CurveKind::Cylinder => strip.rounded(),
        CurveKind::Ribbon => strip.turned(placement.normal(curve::normal_at(&segment.normals, hit.u))),
    }
}

/// Texture coordinates at a hit on anything but a mesh or a sphere.
pub(super) fn uv(geometry: &Geometry, placement: &Placement, hit: &Hit, ray: &Ray) -> Vec2 {
    match geometry {
        Geometry::Quadric(quadric) => quadric_point(quadric, placement, hit, ray).uv,
        Geometry::Patches(mesh) => patch_uv(mesh, hit),
        Geometry::Curves(curves) => {
            let segment = &curves.segments[hit.primitive as usize];
            curve::uv(segment, hit.u, strip(curves, placement, hit, ray).v)
        }
        Geometry::Mesh(_) | Geometry::Sphere { .. } => unreachable!("have functions of their own"),
    }
}

/// The right-handed frame around `normal` whose x axis is the direction in which u grows: of anything but a mesh or a
/// sphere.
pub(super) fn tangent_frame(
    geometry: &Geometry,
    placement: &Placement,
    hit: &Hit,
    normal: Vec3,
    ray: &Ray,
) -> Frame {
    let along_u = match geometry {
        Geometry::Quadric(quadric) => quadric_point(quadric, placement, hit, ray).along_u,
        Geometry::Patches(mesh) => patch_along_u(mesh, hit),
        Geometry::Curves(curves) => curve::tangent(&curves.segments[hit.primitive as usize].points, hit.u),
        Geometry::Mesh(_) | Geometry::Sphere { .. } => unreachable!("have functions of their own"),
    };
    Frame::from_normal_tangent(normal, placement.vector(along_u))
}

/// Derivative of a patch's position by its first texture coordinate; by its first parameter where it has none.
fn patch_along_u(mesh: &PatchMesh, hit: &Hit) -> Vec3 {
    let indices = mesh.patches[hit.primitive as usize].map(|i| i as usize);
    let [by_u, by_v] = patch::derivatives(&indices.map(|i| mesh.positions[i]), hit.u, hit.v);
    if mesh.uvs.is_empty() {
        return by_u;
    }
    let [p00, p10, p01, p11] = indices.map(|i| mesh.uvs[i]);
    let uv_by_u = (p10 - p00) * (1.0 - hit.v) + (p11 - p01) * hit.v;
    let uv_by_v = (p01 - p00) * (1.0 - hit.u) + (p11 - p10) * hit.u;
    let determinant = uv_by_u.perp_dot(uv_by_v);
    if determinant == 0.0 { by_u } else { (uv_by_v.y * by_u - uv_by_u.y * by_v) / determinant }
}
