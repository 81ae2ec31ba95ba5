//! What a scene is about: all that is placed in it, but for backdrops that dwarf it and for crumbs that are far off.

use glam::{Affine3A, Vec3};
use quietus_trace::desc::{Geometry, Mesh, SceneDesc, Shape};

use crate::summary;

/// How many times larger than all that stands in front of it a backdrop is that counts as one, and how many times smaller
/// the scene is to become without its crumbs: what is drawn so much smaller than the picture can hardly be looked at.
const DWARFED: f32 = 8.0;

/// Share of the extents (squared) of all things that crumbs may have together.
const CRUMBS: f32 = 1e-3;

/// Thickness of a backdrop's sheet over its smaller width.
const SHEET: f32 = 0.01;

/// How much the radius of a backdrop's dome may vary.
const DOME: f32 = 0.15;

/// The shapes of a scene by which it is framed.
pub(super) struct Subject {
    /// By instance and shape; empty where all are.
    kept: Vec<Vec<bool>>,
}

/// A placed shape.
struct Thing {
    instance: usize,
    shape: usize,
    low: Vec3,
    high: Vec3,
    backdrop: bool,
}

impl Thing {
    fn extent(&self) -> f32 {
        self.low.distance(self.high)
    }
}

impl Subject {
    /// Looks for it in `scene`.
    pub(super) fn of(scene: &SceneDesc) -> Self {
        let mut things = things(scene);
        let all = things.len();
        things.sort_by(|a, b| b.extent().total_cmp(&a.extent()));
        things.drain(..backdrops(&things));
        drop_crumbs(&mut things);
        if things.len() == all {
            return Self { kept: Vec::new() };
        }
        let shapes = |instance: &quietus_trace::desc::Instance| {
            vec![false; scene.objects[instance.object.0 as usize].shapes.len()]
        };
        let mut kept: Vec<_> = scene.instances.iter().map(shapes).collect();
        things.iter().for_each(|thing| kept[thing.instance][thing.shape] = true);
        Self { kept }
    }

    /// Whether it is all of the scene.
    pub(super) fn is_everything(&self) -> bool {
        self.kept.is_empty()
    }

    /// Whether shape `shape` of instance `instance` is part of it.
    pub(super) fn has(&self, instance: usize, shape: usize) -> bool {
        self.kept.get(instance).is_none_or(|shapes| shapes[shape])
    }
}

/// All placed shapes that have an extent.
fn things(scene: &SceneDesc) -> Vec<Thing> {
    let objects: Vec<Vec<_>> = scene
        .objects
        .iter()
        .map(|object| {
            object.shapes.iter().map(|shape| (summary::shape_bounds(shape), is_backdrop(shape))).collect()
        })
        .collect();
    let mut things = Vec::new();
    for (i, instance) in scene.instances.iter().enumerate() {
        for (shape, (bounds, backdrop)) in objects[instance.object.0 as usize].iter().enumerate() {
            let [low, high] = placed(bounds, &instance.to_world);
            if low.x <= high.x {
                things.push(Thing { instance: i, shape, low, high, backdrop: *backdrop });
            }
        }
    }
    things
}

/// The box around a box that was moved.
fn placed([low, high]: &[Vec3; 2], to_world: &Affine3A) -> [Vec3; 2] {
    if low.x > high.x {
        return [*low, *high];
    }
    let center = to_world.transform_point3(0.5 * (*low + *high));
    let half = 0.5 * (*high - *low);
    let axes = [
        to_world.matrix3.x_axis * half.x,
        to_world.matrix3.y_axis * half.y,
        to_world.matrix3.z_axis * half.z,
    ];
    let half = axes.into_iter().fold(Vec3::ZERO, |sum, axis| sum + Vec3::from(axis.abs()));
    [center - half, center + half]
}

/// How many of `things`, largest first, are backdrops that dwarf what is left.
fn backdrops(things: &[Thing]) -> usize {
    let front = things.iter().take_while(|thing| thing.backdrop).count();
    let (mut low, mut high) = bounds(&things[front..]);
    for count in (1..=front).rev() {
        let extent = low.distance(high);
        if low.x <= high.x && extent > 0.0 && things[count - 1].extent() > DWARFED * extent {
            return count;
        }
        (low, high) = (low.min(things[count - 1].low), high.max(things[count - 1].high));
    }
    0
}

/// Takes away the farthest of `things` where they are hardly anything and the rest is much closer together.
fn drop_crumbs(things: &mut Vec<Thing>) {
    let weight = |thing: &Thing| f64::from(thing.extent()).powi(2);
    let total: f64 = things.iter().map(weight).sum();
    if total.is_nan() || total <= 0.0 {
        return;
    }
    let middle = middle(things, total);
    let reach = |thing: &Thing| (thing.high - middle).max(middle - thing.low).length();
    things.sort_by(|a, b| reach(a).total_cmp(&reach(b)));
    let mut left = total;
    let enough = things.iter().position(|thing| {
        left -= weight(thing);
        left <= f64::from(CRUMBS) * total
    });
    let core = enough.map_or(things.len(), |last| last + 1);
    let extent = |things: &[Thing]| {
        let (low, high) = bounds(things);
        low.distance(high)
    };
    if extent(things) > DWARFED * extent(&things[..core]) {
        things.truncate(core);
    }
}

/// Median of the centres, weighed by squared extents, per axis.
fn middle(things: &[Thing], total: f64) -> Vec3 {
    let along = |axis: usize| {
        let mut places: Vec<_> = things
            .iter()
            .map(|thing| (0.5 * (thing.low[axis] + thing.high[axis]), f64::from(thing.extent()).powi(2)))
            .collect();
        places.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut sum = 0.0;
        let half = places.iter().find(|(_, weight)| {
            sum += weight;
            sum >= 0.5 * total
        });
        half.map_or(0.0, |place| place.0)
    };
    Vec3::new(along(0), along(1), along(2))
}

fn bounds(things: &[Thing]) -> (Vec3, Vec3) {
    let none = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    things.iter().fold(none, |(low, high), thing| (low.min(thing.low), high.max(thing.high)))
}

/// Whether a shape is a flat sheet, or a sphere, or a part of one that holds its middle: what stands behind or around
/// other things.
fn is_backdrop(shape: &Shape) -> bool {
    match &shape.geometry {
        Geometry::Sphere { .. } => true,
        Geometry::Mesh(mesh) => {
            let bounds = summary::shape_bounds(shape);
            is_sheet(bounds) || is_dome(mesh, bounds)
        }
        _ => false,
    }
}

fn is_sheet([low, high]: [Vec3; 2]) -> bool {
    let mut sides = (high - low).to_array();
    sides.sort_by(f32::total_cmp);
    sides[0] <= SHEET * sides[1]
}

/// Whether all triangles are about as far from the middle of the box `low` to `high`, or from that of its bottom: their corners,
/// and, as boxes have eight of those, what lies between them.
fn is_dome(mesh: &Mesh, [low, high]: [Vec3; 2]) -> bool {
    let middle = 0.5 * (low + high);
    [middle, middle.with_y(low.y)].into_iter().any(|center| {
        let corners = mesh.triangles.iter().map(|triangle| triangle.map(|i| mesh.positions[i as usize]));
        let distances =
            corners.flat_map(|[a, b, c]| [a, b, c, (a + b + c) / 3.0].map(|p| p.distance(center)));
        let (least, most) =
            distances.fold((f32::INFINITY, 0.0), |(a, b): (f32, f32), d| (a.min(d), b.max(d)));
        least >= (1.0 - DOME) * most
    })
}
