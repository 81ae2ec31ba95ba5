//! Writes a scene for Mitsuba 3: a dictionary for its `load_dict`, meshes as PLY, textures as EXR or PNG.
//!
//! What Mitsuba has no counterpart for is replaced by what comes nearest, and the replacement is noted: such
//! scenes compare speed, not light.

use std::collections::{BTreeSet, HashMap};
use std::path::Path;

use anyhow::{Context, Result, bail};
use glam::{Affine3A, Mat3A, Mat4, Vec3};
use quietus_trace::desc::{
    Camera, EnvironmentLayout, FrameAxis, Geometry, Light, MaterialId, Mesh, Projection, Quadric, SceneDesc,
    Shape,
};
use serde_json::{Map, Value, json};

use crate::materials::{Materials, rgb};

/// What a picture is drawn with.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Look {
    pub(crate) size: [u32; 2],
    pub(crate) max_depth: u32,
}

/// Writes `scene` into `folder`; returns what had to be replaced or left out.
pub(crate) fn export(scene: &SceneDesc, look: Look, folder: &Path) -> Result<BTreeSet<String>> {
    let mut export = Export {
        scene,
        folder,
        materials: Materials::new(scene, folder),
        entries: Map::new(),
        groups: HashMap::new(),
        notes: BTreeSet::new(),
    };
    export.entry("type", json!("scene"));
    // Mitsuba's own default for roulette: what that costs in variance, or saves in rays, counts.
    let integrator = if scene.media.is_empty() { "path" } else { "volpath" };
    export.entry("integrator", json!({"type": integrator, "max_depth": look.max_depth, "rr_depth": 5}));
    let camera = scene.cameras.first().context("the scene has no camera")?;
    export.entry("sensor", sensor(camera, look)?);
    export.instances()?;
    export.lights()?;
    let Export { mut entries, materials, mut notes, .. } = export;
    let (dictionary, more) = materials.finish();
    for (key, value) in dictionary {
        entries.insert(key, value);
    }
    notes.extend(more);
    // References must come after what they name: load_dict resolves them in the order of the dictionary.
    let (first, last): (Vec<_>, Vec<_>) =
        entries.into_iter().partition(|(key, _)| !key.starts_with("shape") && !key.starts_with("group"));
    let (groups, shapes): (Vec<_>, Vec<_>) = last.into_iter().partition(|(key, _)| key.starts_with("group"));
    let ordered: Map<String, Value> = first.into_iter().chain(groups).chain(shapes).collect();
    std::fs::write(folder.join("scene.json"), serde_json::to_vec(&ordered)?)?;
    Ok(notes)
}

pub(crate) fn matrix(transform: &Affine3A) -> Value {
    // Row by row.
    json!({"matrix": Mat4::from(*transform).transpose().to_cols_array()})
}

/// Mitsuba's cameras look along +z with +x to the left.
fn sensor(camera: &Camera, look: Look) -> Result<Value> {
    let Projection::Perspective { fov, axis } = camera.projection else {
        bail!("only perspective cameras are compared");
    };
    let turn = Affine3A::from_scale(Vec3::new(-1.0, 1.0, -1.0));
    let axis = match axis {
        FrameAxis::Vertical => "y",
        FrameAxis::Shorter => "smaller",
    };
    let kind = if camera.lens_radius > 0.0 { "thinlens" } else { "perspective" };
    let mut sensor = json!({
        "type": kind,
        "fov": fov.to_degrees(),
        "fov_axis": axis,
        "to_world": matrix(&(camera.to_world * turn)),
        "near_clip": 1e-3,
        "far_clip": 1e6,
        "sampler": {"type": "multijitter"},
        "film": {
            "type": "hdrfilm",
            "width": look.size[0],
            "height": look.size[1],
            "rfilter": {"type": "box"},
            "component_format": "float32",
            "pixel_format": "rgb",
        },
    });
    if camera.lens_radius > 0.0 {
        sensor["aperture_radius"] = json!(camera.lens_radius);
        sensor["focus_distance"] = json!(camera.focus_distance);
    }
    Ok(sensor)
}

struct Export<'a> {
    scene: &'a SceneDesc,
    folder: &'a Path,
    materials: Materials<'a>,
    entries: Map<String, Value>,
    /// Names of shape groups by object.
    groups: HashMap<u32, Option<String>>,
    notes: BTreeSet<String>,
}

impl Export<'_> {
    fn entry(&mut self, key: &str, value: Value) {
        self.entries.insert(key.to_owned(), value);
    }

    fn note(&mut self, what: &str) {
        self.notes.insert(what.to_owned());
    }

    fn instances(&mut self) -> Result<()> {
        let mut uses = vec![0u32; self.scene.objects.len()];
        for instance in &self.scene.instances {
            uses[instance.object.0 as usize] += 1;
        }
        for (number, instance) in self.scene.instances.iter().enumerate() {
            if instance.end_to_world.is_some() {
                self.note("motion is left out");
            }
            let object = &self.scene.objects[instance.object.0 as usize];
            let emits = object.shapes.iter().any(|shape| self.emission(shape.material) != Vec3::ZERO);
            if uses[instance.object.0 as usize] > 1 && !emits {
                self.grouped(number, instance.object.0, &instance.to_world)?;
                continue;
            }
            for (part, shape) in object.shapes.iter().enumerate() {
                let key = format!("shape-{number:06}-{part:06}");
                if let Some(value) = self.shape(&key, shape, &instance.to_world, true)? {
                    self.entry(&key, value);
                }
            }
        }
        Ok(())
    }

    /// An instance of a group that is written once.
    fn grouped(&mut self, number: usize, object: u32, to_world: &Affine3A) -> Result<()> {
        if !self.groups.contains_key(&object) {
            let key = format!("group-{object:06}");
            let mut group = json!({"type": "shapegroup"});
            let scene = self.scene;
            for (part, shape) in scene.objects[object as usize].shapes.iter().enumerate() {
                let name = format!("{key}-{part:06}");
                if let Some(value) = self.shape(&name, shape, &Affine3A::IDENTITY, false)? {
                    group[name] = value;
                }
            }
            self.entry(&key, group);
            self.groups.insert(object, Some(key));
        }
        let key = self.groups[&object].clone();
        let instance = json!({
            "type": "instance",
            "to_world": matrix(to_world),
            "group": {"type": "ref", "id": key},
        });
        self.entry(&format!("shape-{number:06}"), instance);
        Ok(())
    }

    fn emission(&self, material: MaterialId) -> Vec3 {
        self.scene.materials[material.0 as usize].emission.factor
    }

    fn shape(
        &mut self,
        key: &str,
        shape: &Shape,
        to_world: &Affine3A,
        may_emit: bool,
    ) -> Result<Option<Value>> {
        let mut value = match &shape.geometry {
            Geometry::Mesh(mesh) => {
                let file = format!("{key}.ply");
                write_ply(mesh, to_world, shape.flipped, &self.folder.join(&file))?;
                json!({"type": "ply", "filename": file})
            }
            Geometry::Sphere { center, radius } => {
                let place = *to_world
                    * Affine3A::from_translation(*center)
                    * Affine3A::from_scale(Vec3::splat(*radius));
                json!({"type": "sphere", "to_world": matrix(&place), "flip_normals": shape.flipped})
            }
            Geometry::Quadric(Quadric::Disk { height, radius, .. }) => {
                let place = *to_world
                    * Affine3A::from_translation(Vec3::new(0.0, 0.0, *height))
                    * Affine3A::from_scale(Vec3::new(*radius, *radius, 1.0));
                json!({"type": "disk", "to_world": matrix(&place), "flip_normals": shape.flipped})
            }
            _ => {
                self.note("shapes other than meshes, spheres and disks are left out");
                return Ok(None);
            }
        };
        if shape.media.is_some() {
            self.note("media are left out");
        }
        value["bsdf"] = self.materials.reference(shape.material)?;
        let emission = self.emission(shape.material);
        if may_emit && emission != Vec3::ZERO {
            value["emitter"] = json!({"type": "area", "radiance": rgb(emission)});
        }
        Ok(Some(value))
    }

    fn lights(&mut self) -> Result<()> {
        for (number, light) in self.scene.lights.iter().enumerate() {
            let value = match *light {
                Light::Point { position, intensity } => {
                    json!({"type": "point", "position": position.to_array(), "intensity": rgb(intensity)})
                }
                Light::Directional { direction, irradiance } => {
                    json!({"type": "directional", "direction": direction.to_array(), "irradiance": rgb(irradiance)})
                }
                Light::Spot { .. } | Light::Picture { .. } => {
                    self.note("spot lights and lights that send a picture are left out");
                    continue;
                }
            };
            self.entry(&format!("light-{number:06}"), value);
        }
        let Some(environment) = &self.scene.environment else { return Ok(()) };
        let value = match &environment.image {
            None => json!({"type": "constant", "radiance": rgb(environment.scale)}),
            Some(image) if environment.layout == EnvironmentLayout::LatLong => {
                crate::materials::write_exr(image, environment.scale, &self.folder.join("environment.exr"))?;
                // Both have +y for a pole; Mitsuba's first column looks along -z, ours the middle one.
                let turn = Mat3A::from_rotation_y(std::f32::consts::PI);
                let rotation = Affine3A::from_mat3(environment.to_world)
                    * Affine3A { matrix3: turn, ..Affine3A::IDENTITY };
                json!({"type": "envmap", "filename": "environment.exr", "to_world": matrix(&rotation)})
            }
            Some(_) => {
                self.note("an environment map that is not lat-long is left out");
                return Ok(());
            }
        };
        self.entry("environment", value);
        Ok(())
    }
}

/// A binary PLY in world space, its front kept its front.
fn write_ply(mesh: &Mesh, to_world: &Affine3A, flipped: bool, path: &Path) -> Result<()> {
    let has_normals = !mesh.normals.is_empty();
    let uvs = &mesh.uvs[0];
    let normal_matrix = to_world.matrix3.inverse().transpose();
    let mut header =
        format!("ply\nformat binary_little_endian 1.0\nelement vertex {}\n", mesh.positions.len());
    let normals = if has_normals { &["nx", "ny", "nz"][..] } else { &[] };
    let coordinates = if uvs.is_empty() { &[][..] } else { &["u", "v"] };
    for name in ["x", "y", "z"].iter().chain(normals).chain(coordinates) {
        header += &format!("property float {name}\n");
    }
    header += &format!(
        "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.triangles.len()
    );
    let mut bytes = header.into_bytes();
    for (i, &position) in mesh.positions.iter().enumerate() {
        push(&mut bytes, &to_world.transform_point3(position).to_array());
        if has_normals {
            let normal = Vec3::from(normal_matrix * glam::Vec3A::from(mesh.normals[i])).normalize_or_zero();
            push(&mut bytes, &(if flipped { -normal } else { normal }).to_array());
        }
        if !uvs.is_empty() {
            push(&mut bytes, &uvs[i].to_array());
        }
    }
    let swap = flipped != (to_world.matrix3.determinant() < 0.0);
    for &[a, b, c] in &mesh.triangles {
        bytes.push(3);
        for index in if swap { [a, c, b] } else { [a, b, c] } {
            bytes.extend((index as i32).to_le_bytes());
        }
    }
    std::fs::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))
}

fn push(bytes: &mut Vec<u8>, numbers: &[f32]) {
    bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
}
