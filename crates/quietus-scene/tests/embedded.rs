//! The scene built into the program keeps the promises its module makes.

use glam::Vec3;
use quietus_scene::{embedded, summary};
use quietus_trace::desc::{Geometry, SceneDesc, Shape, Surface};

fn shapes(scene: &SceneDesc) -> impl Iterator<Item = &Shape> {
    scene.objects.iter().flat_map(|object| &object.shapes)
}

#[test]
fn summary_of_the_scene() {
    insta::assert_snapshot!(summary(&embedded()));
}

#[test]
fn indices_are_in_range() {
    let scene = embedded();
    assert!(scene.instances.iter().all(|instance| (instance.object.0 as usize) < scene.objects.len()));
    assert!(shapes(&scene).all(|shape| (shape.material.0 as usize) < scene.materials.len()));
    for shape in shapes(&scene) {
        let Geometry::Mesh(mesh) = &shape.geometry else { continue };
        assert!(mesh.triangles.iter().flatten().all(|&i| (i as usize) < mesh.positions.len()));
        assert_eq!(mesh.uvs[0].len(), mesh.positions.len());
    }
}

#[test]
fn the_lamp_is_small_and_there_is_glass_and_a_mirror() {
    let scene = embedded();
    let sum = summary(&scene);
    let [low, high] = sum.bounds.expect("a room");
    let lamp = shapes(&scene).find_map(|shape| match shape.geometry {
        Geometry::Sphere { radius, .. } => {
            let emission = scene.materials[shape.material.0 as usize].emission.factor;
            (emission.max_element() > 0.0).then_some(2.0 * radius)
        }
        _ => None,
    });
    let share = lamp.expect("a lamp") / (high.x - low.x);
    assert!(share < 0.1, "the lamp is {share} of the room's width");
    assert!(scene.materials.iter().any(|m| matches!(m.surface, Surface::Dielectric { .. })));
    let mirror = |surface: &Surface| matches!(surface, Surface::Conductor { roughness, .. } if roughness.u.factor == 0.0);
    assert!(scene.materials.iter().any(|material| mirror(&material.surface)));
}

/// Every wall faces into the room, where camera and lamp are.
#[test]
fn walls_face_inwards() {
    let scene = embedded();
    let eye = Vec3::from(scene.cameras[0].to_world.translation);
    let walls =
        scene.objects.iter().filter(|o| ["floor", "ceiling"].contains(&&*o.name) || o.name.ends_with("wall"));
    let mut count = 0;
    for shape in walls.flat_map(|object| &object.shapes) {
        let Geometry::Mesh(mesh) = &shape.geometry else { panic!("walls are meshes") };
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
            assert!((b - a).cross(c - a).dot(eye - a) > 0.0);
            count += 1;
        }
    }
    assert_eq!(count, 12, "six walls");
}

/// Spheres neither overlap each other nor stick into the floor: nested glass would be drawn wrong.
#[test]
fn spheres_stand_apart() {
    let scene = embedded();
    let spheres: Vec<_> = shapes(&scene)
        .filter_map(|shape| match shape.geometry {
            Geometry::Sphere { center, radius } => Some((center, radius)),
            _ => None,
        })
        .collect();
    for (i, (a, r)) in spheres.iter().enumerate() {
        assert!(a.y >= r - 1e-6);
        assert!(spheres[..i].iter().all(|(b, s)| a.distance(*b) > r + s));
    }
}
