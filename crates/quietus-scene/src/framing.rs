//! Placing cameras: looking at a point, and framing a scene that has no camera of its own.

use glam::{Affine3A, Mat3, Vec3};
use quietus_trace::desc::{Camera, Geometry, SceneDesc};

use crate::summary;

mod subject;
use subject::Subject;

/// Camera space to world for a camera at `eye` that looks at `target`, +y up as far as that goes.
pub(crate) fn look_at(eye: Vec3, target: Vec3) -> Affine3A {
    let back = (eye - target).normalize();
    // Looking straight up or down leaves the roll open: -z is then the top of the picture.
    let right = Vec3::Y.cross(back).try_normalize().unwrap_or(Vec3::X);
    Affine3A::from_mat3_translation(Mat3::from_cols(right, back.cross(right), back), eye)
}

/// Vertical angle of view of framing cameras: that of a 50 mm lens on 24 mm of film, which draws things
/// without visible distortion.
const FRAMING_FOV_Y: f32 = 0.471;

/// Where they look from, best first: a third of the way round and a little from above, which shows a thing's
/// shape; straight from the front, as into a room whose side walls would be in the way.
const VIEWS: [Vec3; 3] = [Vec3::new(0.5, 0.3, 0.8), Vec3::new(-0.5, 0.3, 0.8), Vec3::Z];

/// Share of the picture's surfaces that may turn their back before a view counts as obstructed.
const MAX_BACKS: f32 = 0.1;

/// Shapes of pictures, width over height, that a framing camera may ask for: the first one that a scene fits into
/// without leaving the top and bottom empty.
const SHAPES: [f32; 5] = [9.0 / 16.0, 3.0 / 4.0, 1.0, 4.0 / 3.0, 16.0 / 9.0];

/// Keeps the outermost things off the picture's very edge.
const MARGIN: f32 = 0.95;

/// Whether a camera that frames `scene` leaves something out: backdrops that dwarf the rest, and crumbs far off.
pub(crate) fn leaves_out(scene: &SceneDesc) -> bool {
    !Subject::of(scene).is_everything()
}

/// Looks for a camera that shows the whole of a scene, or of what it is about, whatever happens in it.
pub(crate) struct Framing {
    /// Near the things, so that differences of their coordinates keep their digits.
    center: Vec3,
    /// Shapes of the picture to choose from.
    shapes: Vec<f32>,
    /// What was seen along each of [`VIEWS`].
    views: [View; VIEWS.len()],
    /// The scene as it was at first, by which views are judged.
    triangles: Vec<[Vec3; 3]>,
}

impl Framing {
    /// Frames `scene`, in a picture of width over height `shape` or one that suits it.
    pub(crate) fn new(scene: &SceneDesc, shape: Option<f32>) -> Self {
        let subject = Subject::of(scene);
        let bounds =
            summary::bounds_of(|see| summary::for_each_outermost(scene, |i, j| subject.has(i, j), see));
        let empty = bounds[0].x > bounds[1].x;
        let [low, high] = if empty { [Vec3::NEG_ONE, Vec3::ONE] } else { bounds };
        let shapes = shape.map_or(SHAPES.to_vec(), |shape| vec![shape]);
        let views = VIEWS.map(|direction| View::new(direction, shapes.len()));
        let triangles = world_triangles(scene, &subject);
        let mut framing = Self { center: 0.5 * (low + high), shapes, views, triangles };
        if empty {
            // There is nothing to see: as much of it as would fit into a cube.
            let Self { shapes, views, .. } = &mut framing;
            for view in views {
                view.include(low, shapes);
                view.include(high, shapes);
            }
        }
        framing.include_subject(scene, &subject);
        framing
    }

    /// Shows `scene`, too.
    pub(crate) fn include(&mut self, scene: &SceneDesc) {
        self.include_subject(scene, &Subject::of(scene));
    }

    fn include_subject(&mut self, scene: &SceneDesc, subject: &Subject) {
        let Self { center, shapes, views, .. } = self;
        summary::for_each_outermost(scene, |i, j| subject.has(i, j), &mut |point| {
            views.iter_mut().for_each(|view| view.include(point - *center, shapes));
        });
    }

    /// Of [`VIEWS`] the first that is not blocked by the backs of surfaces: those of a room seen from outside.
    pub(crate) fn camera(&self) -> Camera {
        let mut best = (f32::INFINITY, self.look_along(&self.views[0]));
        for view in &self.views {
            let camera = self.look_along(view);
            let backs = share_of_backs(&self.triangles, &camera);
            if backs < best.0 {
                best = (backs, camera);
            }
            if backs <= MAX_BACKS {
                break;
            }
        }
        best.1
    }

    /// A camera along `view`, as near as it sees everything, in the first shape in which the height decides how near
    /// that is.
    fn look_along(&self, view: &View) -> Camera {
        let fits = |i: &usize| view.distance_across(*i, self.shapes[*i]) <= view.distance_along();
        let chosen = (0..self.shapes.len()).find(fits).unwrap_or(self.shapes.len() - 1);
        let shape = self.shapes[chosen];
        // Only degenerate scenes are nearer; they get a camera that stands a little off.
        let least = view.nearest.max(0.0) + 1e-6 * self.center.abs().max_element().max(1.0);
        let distance = view.distance_across(chosen, shape).max(view.distance_along()).max(least);
        let [left, right] = view.across[chosen];
        let [bottom, top] = view.along;
        let eye = Vec3::new(0.5 * (right - left), 0.5 * (top - bottom), distance);
        let to_world = Affine3A::from_mat3_translation(view.axes, self.center + view.axes * eye);
        Camera {
            aspect: Some(shape),
            focus_distance: distance,
            ..Camera::perspective("framing", to_world, FRAMING_FOV_Y)
        }
    }
}

/// What is to be seen along one direction, in axes of a camera: x to the right, y up, and z towards the viewer.
///
/// A camera at e sees the point p between the sides of a picture that widens by s per unit of depth where
/// `|p.x - e.x| <= s (e.z - p.z)`. All points are seen from `e.z >= (r + l) / 2s` on, at `e.x = (r - l) / 2`, where
/// r and l are the largest `p.x + s p.z` and `-p.x + s p.z`.
struct View {
    /// Its axes in the world.
    axes: Mat3,
    /// l and r for each shape.
    across: Vec<[f32; 2]>,
    /// The same downwards and upwards.
    along: [f32; 2],
    /// Largest z.
    nearest: f32,
}

impl View {
    fn new(direction: Vec3, shapes: usize) -> Self {
        let axes = look_at(direction, Vec3::ZERO).matrix3.into();
        let none = [f32::NEG_INFINITY; 2];
        Self { axes, across: vec![none; shapes], along: none, nearest: f32::NEG_INFINITY }
    }

    fn include(&mut self, point: Vec3, shapes: &[f32]) {
        let p = self.axes.transpose() * point;
        for (sides, shape) in self.across.iter_mut().zip(shapes) {
            let depth = shape * slope() * p.z;
            *sides = [sides[0].max(depth - p.x), sides[1].max(depth + p.x)];
        }
        let depth = slope() * p.z;
        self.along = [self.along[0].max(depth - p.y), self.along[1].max(depth + p.y)];
        self.nearest = self.nearest.max(p.z);
    }

    /// Least distance at which nothing is cut off left and right, in a picture of the shape `chosen`.
    fn distance_across(&self, chosen: usize, shape: f32) -> f32 {
        let [left, right] = self.across[chosen];
        0.5 * (left + right) / (shape * slope())
    }

    /// Least distance at which nothing is cut off above and below.
    fn distance_along(&self) -> f32 {
        0.5 * (self.along[0] + self.along[1]) / slope()
    }
}

/// How much of the height, from the middle, is seen per unit of depth.
fn slope() -> f32 {
    MARGIN * (0.5 * FRAMING_FOV_Y).tan()
}

/// Most triangles that views are judged by.
const MAX_JUDGED: usize = 1 << 20;

/// The corners of every placed triangle of `subject`, counter-clockwise seen from its front; of every n-th where there are more than
/// [`MAX_JUDGED`].
fn world_triangles(scene: &SceneDesc, subject: &Subject) -> Vec<[Vec3; 3]> {
    let meshes = scene.instances.iter().enumerate().flat_map(|(i, instance)| {
        let shapes = scene.objects[instance.object.0 as usize].shapes.iter().enumerate();
        shapes.filter_map(move |(j, shape)| match &shape.geometry {
            Geometry::Mesh(mesh) if subject.has(i, j) => Some((instance, mesh)),
            _ => None,
        })
    });
    let total: usize = meshes.clone().map(|(_, mesh)| mesh.triangles.len()).sum();
    let step = total.div_ceil(MAX_JUDGED).max(1);
    let mut triangles = Vec::with_capacity(total.min(MAX_JUDGED));
    let mut skip = 0;
    for (instance, mesh) in meshes {
        let mirrored = instance.to_world.matrix3.determinant() < 0.0;
        triangles.extend(mesh.triangles.iter().skip(skip).step_by(step).map(|triangle| {
            let corner = |i: u32| instance.to_world.transform_point3(mesh.positions[i as usize]);
            let [a, b, c] = triangle.map(corner);
            if mirrored { [a, c, b] } else { [a, b, c] }
        }));
        // How far behind the next mesh's beginning the next triangle of the row lies.
        let count = mesh.triangles.len();
        skip = if skip >= count { skip - count } else { (step - (count - skip) % step) % step };
    }
    triangles
}

/// Of the rays through a coarse grid of the picture that hit anything, the share that hits a back first; 0 where none
/// hits. Every triangle is tried, once per scene and view: that takes less time than building a tree.
fn share_of_backs(triangles: &[[Vec3; 3]], camera: &Camera) -> f32 {
    const GRID: u16 = 8;
    let slope = (0.5 * FRAMING_FOV_Y).tan();
    let shape = camera.aspect.unwrap_or(1.0);
    let origin = Vec3::from(camera.to_world.translation);
    let (mut hits, mut backs) = (0_u16, 0_u16);
    for cell in 0..GRID * GRID {
        let place = |i: u16| slope * ((f32::from(i) + 0.5) / (0.5 * f32::from(GRID)) - 1.0);
        let direction = Vec3::new(shape * place(cell % GRID), place(cell / GRID), -1.0);
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
