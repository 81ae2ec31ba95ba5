//! What is in a scene, in numbers.

use std::fmt;

use glam::Vec3;
use quietus_trace::desc::{Geometry, Light, Material, Object, Quadric, SceneDesc, Shape};

/// Counts and bounds of a scene, see [`summary`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Summary {
    /// Triangles held in memory.
    pub triangles: u64,
    /// Triangles in the world, each instance counted.
    pub instanced_triangles: u64,
    /// Spheres in the world, each instance counted.
    pub spheres: u64,
    /// Objects.
    pub objects: u64,
    /// Instances.
    pub instances: u64,
    /// Materials.
    pub materials: u64,
    /// Textures.
    pub textures: u64,
    /// Point, spot and directional lights, and those that send a picture.
    pub lights: [u64; 4],
    /// Shapes in the world whose material emits.
    pub emitters: u64,
    /// Whether light comes from infinitely far away.
    pub environment: bool,
    /// Names of the cameras, the default first.
    pub cameras: Vec<String>,
    /// Smallest and largest corner of the world's bounding box; `None` where nothing is placed.
    pub bounds: Option<[Vec3; 2]>,
}

/// Counts what is in `scene`. Indices out of range count as nothing.
pub fn summary(scene: &SceneDesc) -> Summary {
    let mut sum = Summary {
        triangles: scene.objects.iter().map(triangles).sum(),
        objects: scene.objects.len() as u64,
        instances: scene.instances.len() as u64,
        materials: scene.materials.len() as u64,
        textures: scene.textures.len() as u64,
        environment: scene.environment.is_some(),
        cameras: scene.cameras.iter().map(|camera| camera.name.clone()).collect(),
        bounds: bounds(scene),
        ..Summary::default()
    };
    for light in &scene.lights {
        let kind = match light {
            Light::Point { .. } => 0,
            Light::Spot { .. } => 1,
            Light::Directional { .. } => 2,
            Light::Picture { .. } => 3,
        };
        sum.lights[kind] += 1;
    }
    for instance in &scene.instances {
        let Some(object) = scene.objects.get(instance.object.0 as usize) else { continue };
        sum.instanced_triangles += triangles(object);
        for shape in &object.shapes {
            sum.spheres += u64::from(matches!(shape.geometry, Geometry::Sphere { .. }));
            sum.emitters += u64::from(scene.materials.get(shape.material.0 as usize).is_some_and(emits));
        }
    }
    sum
}

fn triangles(object: &Object) -> u64 {
    let of_shape = |geometry: &Geometry| match geometry {
        Geometry::Mesh(mesh) => mesh.triangles.len() as u64,
        _ => 0,
    };
    object.shapes.iter().map(|shape| of_shape(&shape.geometry)).sum()
}

/// Whether a surface of `material` emits light.
pub(crate) fn emits(material: &Material) -> bool {
    material.emission.factor.max_element() > 0.0
}

/// The world's bounding box, as [`for_each_outermost`] sees it.
pub(crate) fn bounds(scene: &SceneDesc) -> Option<[Vec3; 2]> {
    let bounds = bounds_of(|see| for_each_outermost(scene, |_, _| true, see));
    (bounds[0].x <= bounds[1].x).then_some(bounds)
}

/// The box around `shape`, in its own space; its corners are the wrong way round where there is nothing.
pub(crate) fn shape_bounds(shape: &Shape) -> [Vec3; 2] {
    bounds_of(|see| for_each_point(shape, see))
}

/// The box around what `points` shows; its corners are the wrong way round where that is nothing.
pub(crate) fn bounds_of(points: impl FnOnce(&mut dyn FnMut(Vec3))) -> [Vec3; 2] {
    let mut bounds = [Vec3::INFINITY, Vec3::NEG_INFINITY];
    points(&mut |point| bounds = [bounds[0].min(point), bounds[1].max(point)]);
    bounds
}

/// Shows points in the world whose hull holds all that is placed and wanted (`wants` is asked by the index of an instance and
/// that of a shape of its object): vertices of meshes, and corners of boxes around other shapes. Of objects that are placed many
/// times only the corners of the boxes around their shapes are shown, so that the work does not grow as vertices times
/// instances.
pub(crate) fn for_each_outermost(
    scene: &SceneDesc,
    wants: impl Fn(usize, usize) -> bool,
    see: &mut dyn FnMut(Vec3),
) {
    const MANY: u32 = 64;
    let mut times = vec![0_u32; scene.objects.len()];
    for instance in &scene.instances {
        if let Some(times) = times.get_mut(instance.object.0 as usize) {
            *times = times.saturating_add(1);
        }
    }
    let mut boxes = vec![Vec::new(); scene.objects.len()];
    for (i, instance) in scene.instances.iter().enumerate() {
        let index = instance.object.0 as usize;
        let Some(object) = scene.objects.get(index) else { continue };
        let many = times[index] > MANY;
        if many && boxes[index].is_empty() {
            boxes[index] = object.shapes.iter().map(shape_bounds).collect();
        }
        for (j, shape) in object.shapes.iter().enumerate().filter(|(j, _)| wants(i, *j)) {
            let mut place = |point: Vec3| see(instance.to_world.transform_point3(point));
            match boxes[index].get(j) {
                None => for_each_point(shape, &mut place),
                Some([low, high]) if low.x <= high.x => corners(*low, *high).for_each(place),
                Some(_) => {}
            }
        }
    }
}

/// Shows points of `shape` whose hull holds it.
fn for_each_point(shape: &Shape, see: &mut dyn FnMut(Vec3)) {
    match &shape.geometry {
        Geometry::Mesh(mesh) => {
            let used = mesh.triangles.iter().flatten();
            used.filter_map(|&i| mesh.positions.get(i as usize)).for_each(|&p| see(p));
        }
        Geometry::Sphere { center, radius } => {
            let radius = Vec3::splat(*radius);
            corners(*center - radius, *center + radius).for_each(&mut *see);
        }
        Geometry::Quadric(quadric) => {
            let [low, high] = quadric_box(quadric);
            corners(low, high).for_each(&mut *see);
        }
        Geometry::Patches(mesh) => {
            let used = mesh.patches.iter().flatten();
            used.filter_map(|&i| mesh.positions.get(i as usize)).for_each(|&p| see(p));
        }
        Geometry::Curves(curves) => {
            for segment in &curves.segments {
                let half = Vec3::splat(0.5 * segment.widths[0].max(segment.widths[1]));
                segment.points.iter().flat_map(|&p| corners(p - half, p + half)).for_each(&mut *see);
            }
        }
    }
}

/// The corners of a box.
fn corners(low: Vec3, high: Vec3) -> impl Iterator<Item = Vec3> {
    (0..8).map(move |corner| {
        let pick = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
        Vec3::new(pick(0), pick(1), pick(2))
    })
}

/// A box around a quadric, as if it were swept all around.
fn quadric_box(quadric: &Quadric) -> [Vec3; 2] {
    let (radius, z_min, z_max) = match *quadric {
        Quadric::PartialSphere { radius, z_min, z_max, .. }
        | Quadric::Cylinder { radius, z_min, z_max, .. } => (radius, z_min, z_max),
        Quadric::Disk { height, radius, .. } => (radius, height, height),
    };
    [Vec3::new(-radius, -radius, z_min), Vec3::new(radius, radius, z_max)]
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { triangles, instanced_triangles, spheres, objects, instances, .. } = self;
        writeln!(f, "triangles    {triangles} ({instanced_triangles} with every instance counted)")?;
        writeln!(f, "spheres      {spheres}")?;
        writeln!(f, "objects      {objects}, placed {instances} times")?;
        writeln!(f, "materials    {}", self.materials)?;
        writeln!(f, "textures     {}", self.textures)?;
        let [point, spot, directional, pictures] = self.lights;
        write!(f, "lights       {point} point, {spot} spot, {directional} directional")?;
        if pictures > 0 {
            write!(f, ", {pictures} with a picture")?;
        }
        writeln!(f)?;
        writeln!(f, "emitters     {}", self.emitters)?;
        writeln!(f, "environment  {}", if self.environment { "yes" } else { "no" })?;
        writeln!(f, "cameras      {}", self.cameras.join(", "))?;
        match self.bounds {
            Some([low, high]) => write!(
                f,
                "bounds       ({:.3}, {:.3}, {:.3}) .. ({:.3}, {:.3}, {:.3})",
                low.x, low.y, low.z, high.x, high.y, high.z
            ),
            None => write!(f, "bounds       empty"),
        }
    }
}
