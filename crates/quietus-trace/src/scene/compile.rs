//! From a checked description to a scene: light tables, flat shapes, the acceleration structure.

use super::emitters::{Collector, is_deforming};
use super::{CompiledShape, PlacedObject, STILL, Scene};
use crate::bvh::Accel;
use crate::desc::SceneDesc;
use crate::geometry::motion::Motion;
use crate::interaction::Placement;
use crate::light::Lights;
use crate::material::MaterialTable;
use crate::medium::{Border, Medium};

/// Compiles a description that has been checked.
pub(super) fn scene(desc: &SceneDesc, materials: MaterialTable) -> Scene {
    let (shapes, first_shapes) = shapes(desc, &materials);
    let mut collector = Collector::new(desc, &materials);
    let (instances, motions) = place(desc, &first_shapes, &mut collector);
    let (emitters, first_lights) = collector.finish();
    let (accel, lights) = rayon::join(
        || Accel::build(&desc.objects, &desc.instances, |material| materials.is_opaque(material)),
        || Lights::new(emitters, &desc.lights, desc.environment.as_ref()),
    );
    let moves = !motions.is_empty() || shapes.iter().any(|shape| is_deforming(&shape.geometry));
    let (media, fields) = Medium::all(&desc.media);
    let has_volumes = !media.is_empty() || materials.any_subsurface();
    let has_borders = shapes.iter().any(|shape| shape.only_border);
    Scene {
        accel,
        materials,
        lights,
        media,
        fields,
        has_volumes,
        has_borders,
        instances,
        shapes,
        first_lights,
        motions,
        moves,
    }
}

/// The shapes of all objects, and for each object the index of its first.
fn shapes(desc: &SceneDesc, materials: &MaterialTable) -> (Vec<CompiledShape>, Vec<u32>) {
    let mut shapes = Vec::new();
    let mut first_shapes = Vec::new();
    for object in &desc.objects {
        first_shapes.push(shapes.len() as u32);
        shapes.extend(object.shapes.iter().map(|s| CompiledShape {
            geometry: s.geometry.clone(),
            material: s.material,
            textured: materials.is_textured(s.material),
            border: Border::new(s.media),
            only_border: materials.is_interface(s.material) && Border::new(s.media).is_some(),
            flipped: s.flipped,
        }));
    }
    (shapes, first_shapes)
}

/// The instances, whose emitters `collector` gets, and the motions of those that move.
fn place(
    desc: &SceneDesc,
    first_shapes: &[u32],
    collector: &mut Collector<'_>,
) -> (Vec<PlacedObject>, Vec<Motion>) {
    let mut instances = Vec::with_capacity(desc.instances.len());
    let mut motions = Vec::new();
    for (index, instance) in desc.instances.iter().enumerate() {
        let placement = Placement::new(instance.to_world);
        let first_slot = collector.slots();
        let motion = instance.motion().and_then(|end| Motion::new(&instance.to_world, end));
        let number = if motion.is_some() { motions.len() as u32 } else { STILL };
        collector.instance(index as u32, &placement, motion.as_ref());
        motions.extend(motion);
        instances.push(PlacedObject {
            placement,
            motion: number,
            first_shape: first_shapes[instance.object.0 as usize],
            first_slot,
        });
    }
    (instances, motions)
}
