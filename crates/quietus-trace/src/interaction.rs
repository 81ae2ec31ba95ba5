//! From a hit to the surface there: position with error bound, normals, texture coordinates, tangents, colours.

mod footprint;
mod shapes;

pub(crate) use footprint::footprint;
use glam::{Affine3A, Mat3A, Vec2, Vec3, Vec3A, Vec4};

use crate::bvh::{Hit, Ray};
use crate::desc::{Geometry, MaterialId, Mesh};
use crate::frame::Frame;
use crate::geometry::{offset_ray_origin, sphere, transform_error, triangle};
use crate::material::SurfacePoint;

/// A placement, with what follows from its transform.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placement {
    pub(crate) to_world: Affine3A,
    /// Inverse transpose, up to a positive factor: takes normals to the world, front to front under mirroring too.
    normals: Mat3A,
    pub(crate) to_object: Affine3A,
    /// Most scenes place most things where they were modelled; then nothing needs to be transformed.
    identity: bool,
}

impl Placement {
    /// For an invertible transform.
    pub(crate) fn new(to_world: Affine3A) -> Self {
        let to_object = to_world.inverse();
        Self {
            to_world,
            normals: to_object.matrix3.transpose(),
            to_object,
            identity: to_world == Affine3A::IDENTITY,
        }
    }

    /// -1 for a transform that mirrors, else 1.
    fn handedness(&self) -> f32 {
        self.to_world.matrix3.determinant().signum()
    }

    #[inline(always)]
    fn normal(&self, normal: Vec3) -> Vec3 {
        if self.identity {
            normal
        } else {
            Vec3::from(self.normals * Vec3A::from(normal)).normalize_or_zero()
        }
    }

    #[inline(always)]
    fn vector_to_object(&self, v: Vec3) -> Vec3 {
        if self.identity { v } else { self.to_object.transform_vector3(v) }
    }

    #[inline(always)]
    fn vector(&self, v: Vec3) -> Vec3 {
        if self.identity { v } else { self.to_world.transform_vector3(v) }
    }

    /// Position and error bound in the world of those in object space.
    #[inline(always)]
    fn point(&self, p: Vec3, error: Vec3) -> (Vec3, Vec3) {
        if self.identity {
            (p, error)
        } else {
            (self.to_world.transform_point3(p), transform_error(&self.to_world, p, error))
        }
    }
}

/// A point on a surface, in the world.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Interaction {
    pub(crate) position: Vec3,
    /// Bound on how far the position may be off, per axis.
    pub(crate) error: Vec3,
    /// Geometric normal, towards the front.
    pub(crate) geometric_normal: Vec3,
    /// Interpolated normal, on the same side as the geometric one.
    pub(crate) shading_normal: Vec3,
    /// What textures want to know.
    pub(crate) surface: SurfacePoint,
    pub(crate) material: MaterialId,
}

impl Interaction {
    /// The surface at `hit`, found along `ray`, whose direction is of unit length. `placement` is that of the ray's
    /// time. Texture coordinates are left at 0 where the material, which is not `textured`, would not look at them.
    #[inline(always)]
    pub(crate) fn new(
        geometry: &Geometry,
        (material, textured): (MaterialId, bool),
        placement: &Placement,
        hit: &Hit,
        ray: &Ray,
    ) -> Self {
        match geometry {
            Geometry::Mesh(mesh) => Self::on_triangle(mesh, material, textured, placement, hit, ray.time),
            Geometry::Sphere { center, radius } => {
                let rough = ray.origin + hit.t * ray.direction;
                Self::on_sphere(*center, *radius, material, textured, placement, rough)
            }
            _ => Self::on_other(geometry, material, placement, hit, ray),
        }
    }

    /// The same with front and back exchanged.
    #[inline(always)]
    pub(crate) fn flipped(self) -> Self {
        Self { geometric_normal: -self.geometric_normal, shading_normal: -self.shading_normal, ..self }
    }

    #[inline(always)]
    fn on_triangle(
        mesh: &Mesh,
        material: MaterialId,
        textured: bool,
        placement: &Placement,
        hit: &Hit,
        time: f32,
    ) -> Self {
        let indices = mesh.triangles[hit.primitive as usize].map(|i| i as usize);
        let (corners, motion_error) = corners(mesh, indices, time);
        let error = triangle::point_error(corners, hit.u, hit.v) + motion_error;
        let (position, error) = placement.point(triangle::point(corners, hit.u, hit.v), error);
        let cross = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let geometric_normal = placement.normal(cross.normalize_or_zero());
        let shading_normal = if mesh.normals.is_empty() {
            geometric_normal
        } else {
            let mut normal = blend(&mesh.normals, indices, hit.u, hit.v);
            if !mesh.end_normals.is_empty() {
                normal += (blend(&mesh.end_normals, indices, hit.u, hit.v) - normal) * time;
            }
            let interpolated = placement.normal(normal);
            let toward_front = interpolated.dot(geometric_normal);
            // Normals of an opposite winding are common in the wild; the winding decides what is front.
            (interpolated * toward_front.signum()).normalize_or(geometric_normal)
        };
        let surface = if textured || !mesh.colors.is_empty() {
            SurfacePoint { position, ..mesh_surface(mesh, hit.primitive, hit.u, hit.v) }
        } else {
            SurfacePoint::default()
        };
        Self { position, error, geometric_normal, shading_normal, surface, material }
    }

    #[inline(always)]
    fn on_sphere(
        center: Vec3,
        radius: f32,
        material: MaterialId,
        textured: bool,
        placement: &Placement,
        rough: Vec3,
    ) -> Self {
        let local = if placement.identity { rough } else { placement.to_object.transform_point3(rough) };
        let point = sphere::point(local, center, radius);
        let (position, error) = placement.point(point, sphere::point_error(point, center, radius));
        let outward = (point - center) / radius;
        let normal = placement.normal(outward).normalize();
        // Angles from directions are dear.
        let surface = if textured {
            SurfacePoint { position, ..sphere_surface(outward) }
        } else {
            SurfacePoint::default()
        };
        Self { position, error, geometric_normal: normal, shading_normal: normal, surface, material }
    }

    /// Where a ray in direction `w` may start.
    #[inline(always)]
    pub(crate) fn leave(&self, w: Vec3) -> Vec3 {
        offset_ray_origin(self.position, self.error, self.geometric_normal, w)
    }
}

/// A triangle's corners at `time`, and how far they may be off per axis.
#[inline(always)]
pub(crate) fn corners(mesh: &Mesh, indices: [usize; 3], time: f32) -> ([Vec3; 3], Vec3) {
    let start = indices.map(|i| mesh.positions[i]);
    if mesh.end_positions.is_empty() {
        return (start, Vec3::ZERO);
    }
    let end = indices.map(|i| mesh.end_positions[i]);
    (triangle::corners_at(start, end, time), triangle::motion_error(start, end))
}

/// What textures want to know of the surface that `ray` hits.
pub(crate) fn surface_point(
    geometry: &Geometry,
    placement: &Placement,
    hit: &Hit,
    ray: &Ray,
) -> SurfacePoint {
    let position = ray.origin + hit.t * ray.direction;
    let surface = match geometry {
        Geometry::Mesh(mesh) => mesh_surface(mesh, hit.primitive, hit.u, hit.v),
        Geometry::Sphere { center, .. } => {
            let point = placement.to_object.transform_point3(position);
            sphere_surface((point - center).normalize_or(Vec3::Y))
        }
        _ => SurfacePoint { uv: [shapes::uv(geometry, placement, hit, ray); 2], ..SurfacePoint::default() },
    };
    SurfacePoint { position, ..surface }
}

/// Texture coordinates and vertex colour at a point of a triangle; its position is for the caller to fill in.
#[inline(always)]
pub(crate) fn mesh_surface(mesh: &Mesh, primitive: u32, u: f32, v: f32) -> SurfacePoint {
    let indices = mesh.triangles[primitive as usize].map(|i| i as usize);
    let uv = |set: &Vec<Vec2>| if set.is_empty() { Vec2::ZERO } else { blend(set, indices, u, v) };
    let color = if mesh.colors.is_empty() { Vec4::ONE } else { blend(&mesh.colors, indices, u, v) };
    SurfacePoint { uv: [uv(&mesh.uvs[0]), uv(&mesh.uvs[1])], color, ..SurfacePoint::default() }
}

/// Texture coordinates of a sphere, whose object-space normal is `outward`, as on a globe: v runs down from +y, u
/// eastwards, the middle of the map faces +z. Its position is for the caller to fill in.
#[inline(always)]
pub(crate) fn sphere_surface(outward: Vec3) -> SurfacePoint {
    let u = 0.5 + outward.x.atan2(outward.z) / std::f32::consts::TAU;
    let v = outward.y.clamp(-1.0, 1.0).acos() / std::f32::consts::PI;
    SurfacePoint { uv: [Vec2::new(u, v); 2], ..SurfacePoint::default() }
}

/// The directions in the world in which the texture coordinates of set 0 grow, for normal maps: the mesh's tangents
/// where it has them, else from the triangle's corners. The normal is the shading normal.
pub(crate) fn tangent_frame(
    geometry: &Geometry,
    placement: &Placement,
    hit: &Hit,
    normal: Vec3,
    ray: &Ray,
) -> Frame {
    let any = Frame::from_normal(normal);
    let mesh = match geometry {
        Geometry::Mesh(mesh) => mesh,
        Geometry::Sphere { .. } => return sphere_frame(placement, normal),
        _ => return shapes::tangent_frame(geometry, placement, hit, normal, ray),
    };
    let indices = mesh.triangles[hit.primitive as usize].map(|i| i as usize);
    if !mesh.tangents.is_empty() {
        let tangent = blend(&mesh.tangents, indices, hit.u, hit.v);
        let across = placement.vector(tangent.truncate());
        let across = (across - normal * normal.dot(across)).normalize_or_zero();
        // glTF: bitangent = cross(normal, tangent) * w in the mesh's own space; a mirror turns it around.
        let bitangent = normal.cross(across) * (placement.handedness() * tangent.w.signum());
        return if across == Vec3::ZERO { any } else { Frame { tangent: across, bitangent, normal } };
    }
    if mesh.uvs[0].is_empty() {
        return any;
    }
    let ([a, b, c], _) = corners(mesh, indices, ray.time);
    let [uv_a, uv_b, uv_c] = indices.map(|i| mesh.uvs[0][i]);
    let (edge1, edge2, d1, d2) = (b - a, c - a, uv_b - uv_a, uv_c - uv_a);
    let determinant = d1.perp_dot(d2);
    if determinant == 0.0 {
        return any;
    }
    let along_u = placement.vector((d2.y * edge1 - d1.y * edge2) / determinant);
    let along_v = placement.vector((d1.x * edge2 - d2.x * edge1) / determinant);
    let tangent = (along_u - normal * normal.dot(along_u)).normalize_or_zero();
    // v grows downwards in images, while glTF's bitangent points up.
    let side = if normal.cross(tangent).dot(-along_v) < 0.0 { -1.0 } else { 1.0 };
    if tangent == Vec3::ZERO {
        any
    } else {
        Frame { tangent, bitangent: normal.cross(tangent) * side, normal }
    }
}

/// Around a sphere u grows along the parallels, and the pole +y is up.
fn sphere_frame(placement: &Placement, normal: Vec3) -> Frame {
    let outward = placement.to_world.matrix3.transpose() * Vec3A::from(normal);
    let frame = Frame::from_normal_tangent(normal, placement.vector(Vec3::new(outward.z, 0.0, -outward.x)));
    Frame { bitangent: frame.bitangent * placement.handedness(), ..frame }
}

/// Interpolates vertex data.
#[inline(always)]
fn blend<T>(data: &[T], indices: [usize; 3], u: f32, v: f32) -> T
where
    T: Copy + std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>,
{
    data[indices[0]] * (1.0 - u - v) + data[indices[1]] * u + data[indices[2]] * v
}
