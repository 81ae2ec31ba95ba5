//! From the draft to the scene: shapes get their materials and become objects and instances.
//!
//! Still shapes are brought into the world and share one object, so that the hierarchy over it sees everything at
//! once. What moves, what only has a form in its own space (disks, stretched spheres), and meshes that are large and
//! used several times get objects of their own.

use std::collections::HashMap;
use std::rc::Rc;
use std::sync::Arc;

use glam::{DAffine3, Vec3, Vec4};
use quietus_trace::desc::{
    Curves, Geometry, Instance, Material, MaterialId, MediumInterface, Mesh, Object, ObjectId, Quadric,
    SceneDesc, Shape,
};
use quietus_trace::texture::{SurfacePoint, TextureError, TextureTable};

use super::camera::{self, Shutter};
use super::displacement::{self, Displacement};
use super::draft::{self, AreaLight, Draft, Form, Group};
use super::fault::{Context, Fault, Result, unknown};
use super::film;
use super::images::{Images, Requests};
use super::lens;
use super::light::{self, Lights};
use super::material::{Materials, Worn};
use super::medium::Media;
use super::meshes::{self, Made};
use super::texture::Textures;
use super::transform::{Moving, mirrors, single, uniform_scale};

/// Puts the scene together; area lights have asked for `images`.
pub(super) fn scene(mut draft: Draft, images: Requests, context: &Context) -> Result<SceneDesc> {
    let mut groups = std::mem::take(&mut draft.groups);
    let files = std::mem::take(&mut draft.ply).list;
    let textures = Textures::new(context, images, &draft.textures)?;
    let mut materials = Materials::new(context, &draft, textures);
    materials.make_all()?;
    let lights = Lights::new(&draft.lights, context, &mut materials.textures.images)?;
    let media = Media::new(&draft.media, context)?;
    let shutter = Shutter::of(draft.camera.as_ref().map(|(entity, ..)| entity))?;
    let lens = lens::of(&draft, film::size(&draft)?, context)?;
    let picture = film::picture(&draft, shutter.close - shutter.open, context)?;
    let motion = Motion::new(&draft, shutter)?;
    let size = picture.size.unwrap_or([1, 1]);
    let mut scene = SceneDesc { picture, ..SceneDesc::default() };
    scene.cameras.push(match &draft.camera {
        Some((entity, to_world, medium)) => {
            let medium = media.get(medium.as_ref())?;
            camera::read(entity, motion.of(*to_world), medium, (size, lens), context)?
        }
        None => {
            context.warn_all("the scene has no camera: pbrt's own, at the origin, draws it");
            camera::default(size)
        }
    });
    let requests = std::mem::take(&mut materials.textures.images);
    groups.iter_mut().flat_map(|group| &mut group.shapes).for_each(|shape| {
        shape.to_world = motion.of(shape.to_world);
    });
    let tasks = meshes::Tasks::new(&mut groups, &files);
    let (loaded, made) = rayon::join(|| requests.load(), || tasks.run());
    let mut meshes = made.check(context)?.into_iter();
    let images = loaded?;

    let mut builder = Builder { context, materials, media: &media, images: &images, heights: None, scene };
    let placed: Vec<Placed> = groups
        .into_iter()
        .enumerate()
        .map(|(i, group)| builder.group(group, i != 0, &mut meshes))
        .collect::<Result<_>>()?;
    builder.place(&placed, &draft, motion)?;
    let Builder { materials, mut scene, .. } = builder;
    scene.materials = materials.list;
    scene.textures = materials.textures.finish(&images);
    scene.media = media.list;
    lights.finish(&images, context, &mut scene)?;
    warn_of_darkness(&scene, context);
    Ok(scene)
}

fn warn_of_darkness(scene: &SceneDesc, context: &Context) {
    let emits = |material: &Material| material.emission.factor.max_element() > 0.0;
    if scene.lights.is_empty() && scene.environment.is_none() && !scene.materials.iter().any(emits) {
        context.warn_all("the scene has no light: its picture is black");
    }
}

/// What part of the motion in the file the open shutter sees.
#[derive(Clone, Copy, Debug)]
struct Motion {
    from: f64,
    to: f64,
}

impl Motion {
    fn new(draft: &Draft, shutter: Shutter) -> Result<Self> {
        let [start, end] = draft.times.unwrap_or([0.0, 1.0]).map(f64::from);
        let length = end - start;
        // Things that move in no time are where they end.
        let at = |time: f32| if length > 0.0 { (f64::from(time) - start) / length } else { 1.0 };
        Ok(Self { from: at(shutter.open), to: at(shutter.close) })
    }

    fn of(self, to_world: Moving) -> Moving {
        to_world.between(self.from, self.to)
    }
}

/// The objects of a group, and where they lie in its space.
type Placed = (Box<str>, Vec<(ObjectId, Moving)>);

struct Builder<'a, 'c> {
    context: &'c Context,
    materials: Materials<'a, 'c>,
    media: &'a Media,
    images: &'a Images,
    /// Textures of heights, once they are asked for.
    heights: Option<Arc<TextureTable>>,
    scene: SceneDesc,
}

/// What shapes must have in common to be drawn as one.
type CurveKey = (MaterialId, Option<MediumInterface>, bool, CurveKindKey);
/// Which kind of curve, as a number that can be hashed.
type CurveKindKey = u8;

/// An object being filled.
#[derive(Default)]
struct Filling {
    shapes: Vec<Shape>,
    /// Curves that look the same, in the order in which they first appear.
    curves: Vec<(CurveKey, Curves)>,
    by_look: HashMap<CurveKey, usize>,
}

/// Everything that lies in the same place.
type PlaceKey = [u64; 24];

impl Builder<'_, '_> {
    /// Makes the objects of a group. Those of an object's definition have no lights.
    fn group(
        &mut self,
        group: Group,
        definition: bool,
        meshes: &mut impl Iterator<Item = Made>,
    ) -> Result<Placed> {
        let mut fillings: Vec<(Moving, Filling)> = vec![(Moving::IDENTITY, Filling::default())];
        let mut by_place: HashMap<PlaceKey, usize> = HashMap::from([(key(&Moving::IDENTITY), 0)]);
        let mut shared: HashMap<(usize, MaterialId, Option<MediumInterface>, bool), ObjectId> =
            HashMap::new();
        let mut placed = Vec::new();
        for shape in group.shapes {
            let made = match shape.form {
                Form::Mesh(_) | Form::Ply(_) => meshes.next(),
                _ => None,
            };
            let (drawn, place) = self.shape(shape, definition, made)?;
            if let (Geometry::Mesh(mesh), false) = (&drawn.geometry, place == Moving::IDENTITY)
                && Arc::strong_count(mesh) > 1
            {
                let key = (Arc::as_ptr(mesh) as usize, drawn.material, drawn.media, drawn.flipped);
                let object = *shared.entry(key).or_insert_with(|| self.object(&group.name, vec![drawn]));
                placed.push((object, place));
                continue;
            }
            let index = *by_place.entry(key(&place)).or_insert_with(|| {
                fillings.push((place, Filling::default()));
                fillings.len() - 1
            });
            let filling = &mut fillings[index].1;
            match &drawn.geometry {
                Geometry::Curves(curves) => filling.add_curves(&drawn, curves),
                _ => filling.shapes.push(drawn),
            }
        }
        for (place, filling) in fillings {
            let shapes = filling.finish();
            if !shapes.is_empty() {
                placed.push((self.object(&group.name, shapes), place));
            }
        }
        Ok((group.name, placed))
    }

    fn object(&mut self, name: &str, shapes: Vec<Shape>) -> ObjectId {
        self.scene.objects.push(Object { name: name.to_owned(), shapes });
        ObjectId(self.scene.objects.len() as u32 - 1)
    }

    /// A shape as the scene gets it, and where it lies.
    fn shape(
        &mut self,
        shape: draft::Shape,
        definition: bool,
        made: Option<Made>,
    ) -> Result<(Shape, Moving)> {
        let style = &shape.style;
        let base = self.materials.resolve(&style.material)?;
        let light = self.light(&shape, base, definition);
        let made = match (&shape.displacement, made) {
            (Some(displacement), Some(made)) => Some(self.displaced(&shape, displacement, &made)?),
            (_, made) => made,
        };
        let mut area = area(&shape, made.as_ref());
        if let Some(AreaLight { power: Some(_), image: Some(image), .. }) = light.as_deref() {
            area *= light::mean_luminance(self.images.get(*image));
        }
        if let (Some(AreaLight { power: Some(_), place, .. }), Some(Made { area: (_, false), .. })) =
            (light.as_deref(), &made)
        {
            let message = "\"power\" is spread evenly over a mesh: pbrt gives each of its triangles as much";
            self.context.warn(*place, message);
        }
        let worn = Worn { light: light.as_deref(), area, alpha: shape.alpha.as_ref() };
        let material = self.materials.worn(base, &worn)?;
        let [inside, outside] = &style.media;
        let media = MediumInterface {
            inside: self.media.get(inside.as_ref())?,
            outside: self.media.get(outside.as_ref())?,
        };
        let media = (media.inside != media.outside).then_some(media);
        // Patches in the world have been mirrored with it, which exchanges their sides.
        let (still, to_world) = (shape.to_world.is_still(), shape.to_world.0[0]);
        let exchanged = matches!(shape.form, Form::Patches(_)) && still && mirrors(&to_world);
        let flipped = style.reversed ^ exchanged;
        let (geometry, place) = self.geometry(shape.form, shape.to_world, made, material);
        Ok((Shape { geometry, material, media, flipped }, place))
    }

    /// The mesh of a shape, displaced.
    fn displaced(&mut self, shape: &draft::Shape, wanted: &Displacement, made: &Made) -> Result<Made> {
        let Displacement { texture, place, edge } = wanted;
        let height = self.materials.textures.number_texture(texture, *place)?;
        let invalid = |error: TextureError| Fault::invalid(*place, error.to_string());
        let table = match &self.heights {
            Some(table) => Arc::clone(table),
            None => Arc::new(self.materials.textures.table(self.images).map_err(invalid)?),
        };
        self.heights = Some(Arc::clone(&table));
        let to_world = shape.to_world.0[0];
        let most = displacement::MAX_TRIANGLES;
        let height = |point: &SurfacePoint| height.at(point, &table);
        let Some(mesh) = displacement::displaced(&made.mesh, &to_world, (*edge, most), height) else {
            let message = format!("edges of {edge} make more than {most} triangles, expected longer ones");
            return Err(Fault::unsupported(*place, message));
        };
        let powered = shape.style.light.as_ref().is_some_and(|light| light.power.is_some());
        Ok(Made::displaced(mesh, &to_world, shape.to_world.is_still(), powered))
    }

    /// The form of a shape, in the world where it can be, and else where it lies.
    fn geometry(
        &self,
        form: Form,
        to_world: Moving,
        made: Option<Made>,
        material: MaterialId,
    ) -> (Geometry, Moving) {
        match form {
            Form::Mesh(_) | Form::Ply(_) => {
                let Some(Made { mesh, baked, .. }) = made else {
                    unreachable!("every mesh of the draft has been made")
                };
                let place = if baked { Moving::IDENTITY } else { to_world };
                (Geometry::Mesh(self.with_tangents(mesh, material)), place)
            }
            Form::Sphere(radius) => self.sphere(radius, to_world, self.materials.is_textured(material)),
            Form::Quadric(quadric) => (Geometry::Quadric(quadric), to_world),
            Form::Patches(mut patches) if to_world.is_still() => {
                meshes::bake_patches(&mut patches, &to_world.0[0]);
                (Geometry::Patches(Arc::new(patches)), Moving::IDENTITY)
            }
            Form::Patches(patches) => (Geometry::Patches(Arc::new(patches)), to_world),
            Form::Curves(curves) => self::curves(curves, to_world),
        }
    }

    /// The light of a shape, unless it is where pbrt draws none.
    fn light(&self, shape: &draft::Shape, base: usize, definition: bool) -> Option<Rc<AreaLight>> {
        let light = shape.style.light.clone()?;
        if self.materials.is_interface(base) {
            self.context.warn(shape.place, "area lights on material \"interface\" do not shine");
            return None;
        }
        if definition {
            self.context.warn(shape.place, "area lights inside of objects do not shine");
            return None;
        }
        Some(light)
    }

    fn sphere(&self, radius: f32, place: Moving, textured: bool) -> (Geometry, Moving) {
        let phi_max = std::f32::consts::TAU;
        let whole = Quadric::PartialSphere { radius, z_min: -radius, z_max: radius, phi_max };
        match (textured, uniform_scale(&place.0[0])) {
            // Only the whole form knows where texels lie.
            (true, _) => (Geometry::Quadric(whole), place),
            (false, Some(scale)) if place.is_still() => {
                let center = place.0[0].translation.as_vec3();
                (Geometry::Sphere { center, radius: radius * scale as f32 }, Moving::IDENTITY)
            }
            (false, _) => (Geometry::Sphere { center: Vec3::ZERO, radius }, place),
        }
    }

    /// Normal maps need tangents with the bitangent on pbrt's side: where `cross(normal, tangent)` points.
    fn with_tangents(&self, mesh: Arc<Mesh>, material: MaterialId) -> Arc<Mesh> {
        if !self.materials.has_normal_map(material) || mesh.uvs[0].is_empty() {
            return mesh;
        }
        let mut mesh = Mesh::clone(&mesh);
        mesh.tangents = tangents(&mesh);
        Arc::new(mesh)
    }

    /// Places the groups: the world once, the others where the draft uses them.
    fn place(&mut self, placed: &[Placed], draft: &Draft, motion: Motion) -> Result<()> {
        let mut place = |objects: &[(ObjectId, Moving)], to_world: Moving| {
            self.scene.instances.extend(objects.iter().map(|(object, own)| {
                let whole = to_world.after(*own);
                let [start, end] = whole.0.map(single);
                Instance {
                    object: *object,
                    to_world: start,
                    end_to_world: (!whole.is_still()).then_some(end),
                }
            }));
        };
        if let Some((_, world)) = placed.first() {
            place(world, Moving::IDENTITY);
        }
        let definitions = placed.get(1..).unwrap_or(&[]);
        let by_name: HashMap<&str, &Vec<_>> =
            definitions.iter().map(|(name, objects)| (&**name, objects)).collect();
        for used in &draft.uses {
            let Some(objects) = by_name.get(&*used.name) else {
                let known: Vec<&str> = by_name.keys().copied().collect();
                return Err(Fault::invalid(used.place, unknown("object", &used.name, &known)));
            };
            place(objects, motion.of(used.to_world));
        }
        Ok(())
    }
}

impl Filling {
    /// Adds to the curves that look the same.
    fn add_curves(&mut self, shape: &Shape, curves: &Arc<Curves>) {
        let key = (shape.material, shape.media, shape.flipped, curves.kind as CurveKindKey);
        let index = *self.by_look.entry(key).or_insert_with(|| {
            self.curves.push((key, Curves { kind: curves.kind, segments: Vec::new() }));
            self.curves.len() - 1
        });
        self.curves[index].1.segments.extend_from_slice(&curves.segments);
    }

    fn finish(self) -> Vec<Shape> {
        let mut shapes = self.shapes;
        shapes.extend(self.curves.into_iter().map(|((material, media, flipped, _), curves)| Shape {
            geometry: Geometry::Curves(Arc::new(curves)),
            material,
            media,
            flipped,
        }));
        shapes
    }
}

/// The bits of a transform.
fn key(place: &Moving) -> PlaceKey {
    let mut bits = [0; 24];
    let values = place.0.iter().flat_map(DAffine3::to_cols_array);
    for (bits, value) in bits.iter_mut().zip(values) {
        // 0 and -0 are the same place.
        *bits = (value + 0.0).to_bits();
    }
    bits
}

/// The area that the power of a light on `shape` is spread over, as pbrt has it.
fn area(shape: &draft::Shape, made: Option<&Made>) -> f32 {
    match &shape.form {
        Form::Mesh(_) | Form::Ply(_) => made.map_or(0.0, |made| made.area.0),
        Form::Sphere(radius) => 4.0 * std::f32::consts::PI * radius * radius,
        Form::Quadric(Quadric::PartialSphere { radius, z_min, z_max, phi_max })
        | Form::Quadric(Quadric::Cylinder { radius, z_min, z_max, phi_max }) => {
            phi_max * radius * (z_max - z_min)
        }
        Form::Quadric(Quadric::Disk { radius, inner_radius, phi_max, .. }) => {
            0.5 * phi_max * (radius * radius - inner_radius * inner_radius)
        }
        Form::Patches(patches) => patch_area(patches, &shape.to_world.0[0]),
        Form::Curves(curves) => {
            let segment = |s: &quietus_trace::desc::CurveSegment| {
                let length: f32 = s.points.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
                0.5 * (s.widths[0] + s.widths[1]) * length
            };
            curves.segments.iter().map(segment).sum::<f32>() / curves.segments.len().max(1) as f32
        }
    }
}

/// Mean area of the patches, each taken as two triangles.
fn patch_area(patches: &quietus_trace::desc::PatchMesh, to_world: &DAffine3) -> f32 {
    let area = |patch: &[u32; 4]| {
        let [a, b, c, d] = patch.map(|i| patches.positions[i as usize].as_dvec3());
        let edge = |from, to| to_world.transform_vector3(to - from);
        0.5 * (edge(a, b).cross(edge(a, c)).length() + edge(d, b).cross(edge(d, c)).length())
    };
    (patches.patches.iter().map(area).sum::<f64>() / patches.patches.len().max(1) as f64) as f32
}

/// Brings curves into the world, where their widths allow it.
fn curves(mut curves: Curves, place: Moving) -> (Geometry, Moving) {
    let Some(scale) = uniform_scale(&place.0[0]).filter(|_| place.is_still()) else {
        return (Geometry::Curves(Arc::new(curves)), place);
    };
    let to_world = place.0[0];
    for segment in &mut curves.segments {
        let point = |point: Vec3| to_world.transform_point3(point.as_dvec3()).as_vec3();
        let normal =
            |normal: Vec3| to_world.transform_vector3(normal.as_dvec3()).normalize_or_zero().as_vec3();
        segment.points = segment.points.map(point);
        segment.widths = segment.widths.map(|width| width * scale as f32);
        segment.normals = segment.normals.map(normal);
    }
    (Geometry::Curves(Arc::new(curves)), Moving::IDENTITY)
}

/// Directions in which u grows, at the vertices: means over the triangles around them, weighted by area.
fn tangents(mesh: &Mesh) -> Vec<Vec4> {
    let mut sums = vec![Vec3::ZERO; mesh.positions.len()];
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
        let [uv_a, uv_b, uv_c] = triangle.map(|i| mesh.uvs[0][i as usize]);
        let (d1, d2) = (uv_b - uv_a, uv_c - uv_a);
        let determinant = d1.perp_dot(d2);
        let along = ((b - a) * d2.y - (c - a) * d1.y) * determinant.signum();
        if determinant != 0.0 {
            let weight = (b - a).cross(c - a).length();
            triangle.iter().for_each(|&i| sums[i as usize] += along.normalize_or_zero() * weight);
        }
    }
    sums.into_iter().map(|sum| sum.normalize_or_zero().extend(1.0)).collect()
}
