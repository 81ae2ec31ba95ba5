//! Placing cameras: looking at a point, and framing a scene that has no camera of its own.

use glam::{Affine3A, Mat3, Vec3};
use quietus_trace::desc::{Camera, Geometry, SceneDesc};

/// Camera space to world for a camera at `eye` that looks at `target`, +y up as far as that goes.
pub(crate) fn look_at(eye: Vec3, target: Vec3) -> Affine3A {
    let back = (eye - target).normalize();
    // Looking straight up or down leaves the roll open: -z is then the top of the picture.
    let right = Vec3::Y.cross(back).try_normalize().unwrap_or(Vec3::X);
    Affine3A::from_mat3_translation(Mat3::from_cols(right, back.cross(right), back), eye)
}

/// Vertical angle of view of [`frame`]'s cameras: that of a 50 mm lens on 24 mm of film, which draws things
/// without visible distortion.
const FRAMING_FOV_Y: f32 = 0.471;

/// Where [`frame`] looks from, best first: a third of the way round and a little from above, which shows a thing's
/// shape; straight from the front, as into a room whose side walls would be in the way.
const VIEWS: [Vec3; 3] = [Vec3::new(0.5, 0.3, 0.8), Vec3::new(-0.5, 0.3, 0.8), Vec3::Z];

/// Share of the picture's surfaces that may turn their back before a view counts as obstructed.
const MAX_BACKS: f32 = 0.1;

/// A camera that shows the whole of `scene`, whose world bounds are `bounds`, in a picture at least as wide as high.
/// Of [`VIEWS`] it takes the first that is not blocked by the backs of surfaces: those of a room seen from outside.
pub(crate) fn frame(scene: &SceneDesc, bounds: [Vec3; 2]) -> Camera {
    let triangles = world_triangles(scene);
    let mut best = (f32::INFINITY, VIEWS[0]);
    for view in VIEWS {
        let backs = share_of_backs(&triangles, &look_from(view, bounds));
        if backs < best.0 {
            best = (backs, view);
        }
        if backs <= MAX_BACKS {
            break;
        }
    }
    look_from(best.1, bounds)
}

/// A camera in direction `view` of the box `[low, high]`, just far enough away to see its corners.
fn look_from(view: Vec3, [low, high]: [Vec3; 2]) -> Camera {
    // Keeps the outermost things off the picture's very edge.
    const MARGIN: f32 = 0.95;
    let center = 0.5 * (low + high);
    let axes = look_at(view, Vec3::ZERO).matrix3;
    let slope = MARGIN * (0.5 * FRAMING_FOV_Y).tan();
    let distance = |corner: u32| {
        let pick = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
        let p = axes.transpose() * (Vec3::new(pick(0), pick(1), pick(2)) - center);
        p.z + p.x.abs().max(p.y.abs()) / slope
    };
    // Only degenerate boxes are smaller; they get a camera that stands a little off.
    let least = 1e-6 * center.abs().max_element().max(1.0);
    let distance = (0..8).map(distance).fold(least, f32::max);
    Camera {
        focus_distance: distance,
        ..Camera::perspective("framing", look_at(center + distance * view.normalize(), center), FRAMING_FOV_Y)
    }
}

/// The corners of every placed triangle, counter-clockwise seen from its front.
fn world_triangles(scene: &SceneDesc) -> Vec<[Vec3; 3]> {
    let mut triangles = Vec::new();
    for instance in &scene.instances {
        let mirrored = instance.to_world.matrix3.determinant() < 0.0;
        for shape in &scene.objects[instance.object.0 as usize].shapes {
            let Geometry::Mesh(mesh) = &shape.geometry else { continue };
            triangles.extend(mesh.triangles.iter().map(|triangle| {
                let corner = |i: u32| instance.to_world.transform_point3(mesh.positions[i as usize]);
                let [a, b, c] = triangle.map(corner);
                if mirrored { [a, c, b] } else { [a, b, c] }
            }));
        }
    }
    triangles
}

/// Of the rays through a coarse grid of the picture that hit anything, the share that hits a back first; 0 where none
/// hits. Every triangle is tried, once per scene and view: that takes less time than building a tree.
fn share_of_backs(triangles: &[[Vec3; 3]], camera: &Camera) -> f32 {
    const GRID: u16 = 8;
    let slope = (0.5 * FRAMING_FOV_Y).tan();
    let origin = Vec3::from(camera.to_world.translation);
    let (mut hits, mut backs) = (0_u16, 0_u16);
    for cell in 0..GRID * GRID {
        let place = |i: u16| slope * ((f32::from(i) + 0.5) / (0.5 * f32::from(GRID)) - 1.0);
        let direction = Vec3::new(place(cell % GRID), place(cell / GRID), -1.0);
        let direction = camera.to_world.transform_vector3(direction);
        let seen = triangles.iter().filter_map(|triangle| intersect(triangle, origin, direction));
        if let Some((_, front)) = seen.min_by(|a, b| a.0.total_cmp(&b.0)) {
            hits += 1;
            backs += u16::from(!front);
        }
    }
    f32::from(backs) / f32::from(hits.max(1))
}

/// Distance along the ray, and whether the front is hit (Möller and Trumbore 1997, without culling).
fn intersect([a, b, c]: &[Vec3; 3], origin: Vec3, direction: Vec3) -> Option<(f32, bool)> {
    let (e1, e2, to_origin) = (b - a, c - a, origin - a);
    let p = direction.cross(e2);
    let determinant = e1.dot(p);
    let q = to_origin.cross(e1);
    let (u, v) = (to_origin.dot(p) / determinant, direction.dot(q) / determinant);
    let t = e2.dot(q) / determinant;
    // A determinant of 0 makes these infinite or not a number, which no comparison lets through.
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some((t, determinant > 0.0))
}
