//! What a cone around a ray covers of the surface that the ray meets.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3};

use super::{Interaction, Placement, corners};
use crate::bvh::Hit;
use crate::desc::{Geometry, Mesh, PatchMesh};
use crate::geometry::patch;
use crate::texture::Footprint;

/// The footprint of a cone around a ray in `direction` at `time`, whose radius is `radius` where it meets the surface
/// at `interaction`. In texture coordinates quadrics and curves have none: images on them are not filtered.
///
/// The cone is taken for a cylinder and the surface for its tangent plane (Akenine-Moeller, Crassin, Boksansky, Belcour,
/// Panteleev and Wright 2021, "Improved Shader and Texture Level of Detail Using Ray Cones", section 4).
pub(crate) fn footprint(
    geometry: &Geometry,
    placement: &Placement,
    hit: &Hit,
    interaction: &Interaction,
    (direction, time): (Vec3, f32),
    radius: f32,
) -> Footprint {
    let axes = ellipse(interaction.geometric_normal, direction, radius);
    let local = axes.map(|axis| placement.vector_to_object(axis));
    let uv = match geometry {
        Geometry::Mesh(mesh) => on_triangle(mesh, hit, time, local),
        Geometry::Sphere { center, radius } => {
            let point = placement.to_object.transform_point3(interaction.position);
            [local.map(|step| on_sphere((point - center) / radius, step / radius)); 2]
        }
        Geometry::Patches(mesh) => [on_patch(mesh, hit, local); 2],
        Geometry::Quadric(_) | Geometry::Curves(_) => [[Vec2::ZERO; 2]; 2],
    };
    Footprint { axes, uv }
}

/// Half axes of the ellipse that a cylinder along `direction` cuts out of the plane with `normal`, both of unit length.
fn ellipse(normal: Vec3, direction: Vec3, radius: f32) -> [Vec3; 2] {
    /// Steepest cut: the ellipse of a grazing ray would have no end.
    const LEAST_COSINE: f32 = 1e-3;
    let cosine = normal.dot(direction);
    let along = direction - cosine * normal;
    // Seen all but head-on it is a circle, whose axes may lie anyhow, and what is left of the direction is rounding.
    let length2 = along.length_squared();
    let long = if length2 > 1e-6 { along / length2.sqrt() } else { normal.any_orthonormal_vector() };
    [long * (radius / cosine.abs().max(LEAST_COSINE)), normal.cross(long) * radius]
}

/// What the texture coordinates of a triangle change by along steps in its plane, in object space.
fn on_triangle(mesh: &Mesh, hit: &Hit, time: f32, steps: [Vec3; 2]) -> [[Vec2; 2]; 2] {
    let indices = mesh.triangles[hit.primitive as usize].map(|i| i as usize);
    let ([a, b, c], _) = corners(mesh, indices, time);
    let barycentric = parameters([b - a, c - a], steps);
    [0, 1].map(|set: usize| {
        let uvs = &mesh.uvs[set];
        if uvs.is_empty() {
            return [Vec2::ZERO; 2];
        }
        let [a, b, c] = indices.map(|i| uvs[i]);
        barycentric.map(|step| step.x * (b - a) + step.y * (c - a))
    })
}

/// What the texture coordinates of a bilinear patch change by along steps in its tangent plane, in object space.
fn on_patch(mesh: &PatchMesh, hit: &Hit, steps: [Vec3; 2]) -> [Vec2; 2] {
    let indices = mesh.patches[hit.primitive as usize].map(|i| i as usize);
    let derivatives = patch::derivatives(&indices.map(|i| mesh.positions[i]), hit.u, hit.v);
    let steps = parameters(derivatives, steps);
    if mesh.uvs.is_empty() {
        return steps;
    }
    let [p00, p10, p01, p11] = indices.map(|i| mesh.uvs[i]);
    let by_u = (p10 - p00).lerp(p11 - p01, hit.v);
    let by_v = (p01 - p00).lerp(p11 - p10, hit.u);
    steps.map(|step| step.x * by_u + step.y * by_v)
}

/// What the two parameters of a surface change by along steps in the plane of the derivatives of the position by them.
fn parameters([by_u, by_v]: [Vec3; 2], steps: [Vec3; 2]) -> [Vec2; 2] {
    let normal = by_u.cross(by_v);
    let inverse = normal.length_squared().recip();
    let (u, v) = (by_v.cross(normal) * inverse, normal.cross(by_u) * inverse);
    steps.map(|step| Vec2::new(u.dot(step), v.dot(step)))
}

/// What the texture coordinates of the unit sphere (see [`super::sphere_surface`]) change by along a step from
/// `outward` in the plane that touches it there.
fn on_sphere(outward: Vec3, step: Vec3) -> Vec2 {
    /// At the poles longitudes meet.
    const LEAST_SINE: f32 = 1e-4;
    let sine2 = (outward.x * outward.x + outward.z * outward.z).max(LEAST_SINE * LEAST_SINE);
    let longitude = (outward.z * step.x - outward.x * step.z) / sine2;
    Vec2::new(longitude / TAU, -step.y / (PI * sine2.sqrt()))
}

#[cfg(test)]
mod tests {
    use glam::{Affine3A, Mat3, Quat};

    use super::*;
    use crate::desc::MaterialId;
    use crate::interaction::sphere_surface;
    use crate::testing::Rng;
    use crate::texture::SurfacePoint;

    /// Cut by a plane, a cylinder leaves an ellipse: every point `cos a * x + sin a * y` of it is as far from the axis
    /// as the cylinder is wide, and in the plane.
    #[test]
    fn ellipses_lie_on_the_cylinder_and_in_the_plane() {
        let mut rng = Rng::new(1);
        for _ in 0..1000 {
            let (normal, direction) = (rng.next_direction(), rng.next_direction());
            if normal.dot(direction).abs() < 0.05 {
                continue;
            }
            let [x, y] = ellipse(normal, direction, 0.5);
            for step in [0.0, 0.8, 1.6, 2.4, 3.2, 4.0_f32] {
                let (sin, cos) = step.sin_cos();
                let point = cos * x + sin * y;
                let distance = (point - direction * direction.dot(point)).length();
                assert!(
                    (distance - 0.5).abs() < 1e-4 && point.dot(normal).abs() < 1e-4,
                    "{normal} {direction}"
                );
            }
        }
        let [x, y] = ellipse(Vec3::Z, Vec3::NEG_Z, 0.5);
        assert!((x.length() - 0.5).abs() < 1e-6 && (y.length() - 0.5).abs() < 1e-6 && x.dot(y).abs() < 1e-6);
    }

    /// Texture coordinates that are a linear function of the position change by that function along a step.
    #[test]
    fn steps_on_triangles_are_linear() {
        let mut rng = Rng::new(2);
        let mut random = || 2.0 * Vec3::new(rng.next_1d(), rng.next_1d(), rng.next_1d()) - 1.0;
        for _ in 0..100 {
            let corners = [random(), random(), random()];
            let (by_u, by_v) = (random(), random());
            let uv = |p: Vec3| Vec2::new(by_u.dot(p), by_v.dot(p));
            let mesh = Mesh {
                positions: corners.to_vec(),
                triangles: vec![[0, 1, 2]],
                uvs: [Vec::new(), corners.map(uv).to_vec()],
                ..Mesh::default()
            };
            let [edge1, edge2] = [corners[1] - corners[0], corners[2] - corners[0]];
            if edge1.cross(edge2).length() < 0.05 {
                continue;
            }
            let hit = Hit { t: 1.0, u: 0.2, v: 0.3, instance: 0, shape: 0, primitive: 0 };
            let steps = [0.3 * edge1 - edge2, 2.0 * edge2];
            let [none, found] = on_triangle(&mesh, &hit, 0.0, steps);
            assert_eq!(none, [Vec2::ZERO; 2]);
            for (found, step) in found.iter().zip(steps) {
                assert!((*found - uv(step)).length() < 1e-3, "{found} {}", uv(step));
            }
        }
    }

    /// On a patch, with texture coordinates of its own or without: the difference quotients of the coordinates.
    #[test]
    fn steps_on_patches_are_derivatives() {
        let corners = [[0., 0., 0.], [2., 0., 1.], [0., 1., -1.], [3., 2., 2.]].map(Vec3::from_array);
        let uvs = [[0., 0.], [2., 0.5], [0.5, 1.], [3., 3.]].map(Vec2::from_array);
        for uvs in [Vec::new(), uvs.to_vec()] {
            let mesh = PatchMesh {
                positions: corners.to_vec(),
                patches: vec![[0, 1, 2, 3]],
                uvs,
                ..PatchMesh::default()
            };
            let (u, v) = (0.3, 0.6);
            let hit = Hit { t: 1.0, u, v, instance: 0, shape: 0, primitive: 0 };
            let corner = |i: usize| {
                if mesh.uvs.is_empty() { [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE][i] } else { mesh.uvs[i] }
            };
            let uv = |u: f32, v: f32| {
                let below = corner(0).lerp(corner(1), u);
                below.lerp(corner(2).lerp(corner(3), u), v)
            };
            let h = 1e-3;
            for (du, dv) in [(h, 0.0), (0.0, h), (h, -h)] {
                let step = patch::blend(corners, u + du, v + dv) - patch::blend(corners, u, v);
                let expected = uv(u + du, v + dv) - uv(u, v);
                let [found, _] = on_patch(&mesh, &hit, [step; 2]);
                assert!((found - expected).length() < 1e-2 * h, "{found} {expected}");
            }
        }
    }

    /// On a sphere of radius 2 somewhere in the world, steps are the difference quotients of the coordinates.
    #[test]
    fn steps_on_spheres_are_derivatives() {
        let turn = Affine3A::from_mat3_translation(Mat3::from_quat(Quat::from_rotation_x(0.7)), Vec3::ONE);
        let placement = Placement::new(turn);
        let (center, radius) = (Vec3::new(1.0, -2.0, 0.5), 2.0);
        let geometry = Geometry::Sphere { center, radius };
        let mut rng = Rng::new(3);
        for _ in 0..200 {
            let outward = rng.next_direction();
            let uv = |p: Vec3| sphere_surface((p - center).normalize()).uv[0];
            let here = center + radius * outward;
            if outward.y.abs() > 0.95 || outward.z < 0.0 && outward.x.abs() < 0.05 {
                continue; // where coordinates run together or start again
            }
            let normal = turn.transform_vector3(outward);
            let interaction = Interaction {
                position: turn.transform_point3(here),
                error: Vec3::ZERO,
                geometric_normal: normal,
                shading_normal: normal,
                surface: SurfacePoint::default(),
                material: MaterialId(0),
            };
            let hit = Hit { t: 1.0, u: 0.0, v: 0.0, instance: 0, shape: 0, primitive: 0 };
            let found = footprint(&geometry, &placement, &hit, &interaction, (-normal, 0.0), 1e-2);
            for axis in 0..2 {
                let step = turn.matrix3.transpose() * glam::Vec3A::from(found.axes[axis]);
                let step = Vec3::from(step);
                let expected = 0.5 * (uv(here + step) - uv(here - step));
                // Of third order in a step of 0.005 radii, which is 0.02 of the narrowest parallel; and roundings of
                // coordinates up to 1 in a difference of 1e-3.
                assert!((found.uv[0][axis] - expected).length() < 2e-3 * expected.length(), "{outward}");
            }
        }
    }
}
