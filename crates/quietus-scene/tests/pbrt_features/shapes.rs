//! Shapes, instances, transforms and files.

use super::*;

#[test]
fn what_transforms_flatten_is_left_out() {
    let flat = "ConcatTransform [-0 -0 0 0 0 1 0 0 -1e-16 0 -1 0 7 8 9 1]";
    let Loaded { scene, warnings } = read(&format!(
        "WorldBegin ObjectBegin \"a\" Shape \"sphere\" ObjectEnd AttributeBegin {flat} AttributeBegin AttributeEnd
         Shape \"sphere\" LightSource \"point\" ObjectInstance \"a\" AttributeEnd LightSource \"point\" {TRIANGLE}"
    ));
    assert_eq!((shapes(&scene).len(), scene.instances.len(), scene.lights.len()), (2, 1, 1));
    let said = warnings.iter().filter(|warning| warning.message.contains("flattens space")).count();
    assert_eq!(said, 3, "{warnings:?}");
}

#[test]
fn mirrors_keep_the_front_and_reversal_exchanges_it() {
    let scene = world(&format!("Scale -1 1 1 {TRIANGLE}"));
    let [shape] = shapes(&scene)[..] else { panic!("expected one shape") };
    let [a, b, c] = mesh(shape).triangles[0].map(|i| mesh(shape).positions[i as usize]);
    assert!((b - a).cross(c - a).z > 0.0, "the front of the unmirrored triangle faces +z, and so it stays");
    assert!(!shape.flipped);
    let scene = world(&format!("ReverseOrientation {TRIANGLE} ReverseOrientation {TRIANGLE}"));
    assert_eq!(shapes(&scene).iter().map(|shape| shape.flipped).collect::<Vec<_>>(), [true, false]);
    // Normals decide the front where they are given.
    let scene = world(&format!("{TRIANGLE} \"normal N\" [0 0 -1 0 0 -1 0 0 -1]"));
    assert_eq!(mesh(shapes(&scene)[0]).triangles, [[0, 2, 1]]);
}

#[test]
fn world_shapes_share_an_object_and_instances_stay() {
    let scene = world(
        "Translate 1 0 0 Shape \"sphere\" Shape \"disk\"
         ObjectBegin \"a\" Translate 0 1 0 Shape \"sphere\" Rotate 90 1 0 0 Shape \"cylinder\" ObjectEnd
         Scale 2 2 2 ObjectInstance \"a\" ObjectInstance \"a\"",
    );
    // The sphere; the disk, which has its own place; the object's sphere and cylinder, twice.
    assert_eq!(scene.instances.len(), 1 + 1 + 2 * 2);
    let Geometry::Sphere { center, radius } = scene.objects[0].shapes[0].geometry else { panic!("a sphere") };
    assert_eq!((center, radius), (Vec3::X, 1.0));
    let of_a: Vec<_> = scene.objects.iter().enumerate().filter(|(_, object)| object.name == "a").collect();
    assert_eq!(of_a.len(), 2);
    let sphere = scene.instances.iter().find(|i| i.object.0 as usize == of_a[0].0).expect("placed");
    // Defined one to the right and one up, in a world that is then doubled and one further to the right.
    assert!(close(sphere.to_world.transform_point3(Vec3::new(1.0, 1.0, 0.0)), Vec3::new(3.0, 2.0, 0.0)));
}

#[test]
fn motion_is_what_the_shutter_sees_of_it() {
    let moving = "ActiveTransform EndTime Translate 4 0 0 ActiveTransform All Shape \"sphere\"";
    let instance = |header: &str| {
        let scene = read(&format!("{header}\nWorldBegin {moving}")).scene;
        assert_eq!(scene.instances.len(), 1);
        let end = scene.instances[0].end_to_world.expect("it moves");
        [Vec3::from(scene.instances[0].to_world.translation), end.translation.into()]
    };
    assert_eq!(instance(""), [Vec3::ZERO, Vec3::new(4.0, 0.0, 0.0)]);
    let half = "Camera \"perspective\" \"float shutteropen\" 0.25 \"float shutterclose\" 0.5";
    assert_eq!(instance(half), [Vec3::X, Vec3::new(2.0, 0.0, 0.0)]);
    let later = "TransformTimes 0.25 0.75 Camera \"perspective\" \"float shutteropen\" 0.5";
    assert_eq!(instance(later), [Vec3::new(2.0, 0.0, 0.0), Vec3::new(4.0, 0.0, 0.0)]);
    let camera = camera("ActiveTransform EndTime Translate 0 0 1 ActiveTransform All Camera \"perspective\"");
    assert!(camera.end_to_world.is_some());
}

#[test]
fn curves_that_look_the_same_are_one_shape() {
    let curve = "Shape \"curve\" \"string type\" \"cylinder\" \"float width0\" 0.2 \"float width1\" 0.1
        \"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0 4 0 0 5 0 0 6 0 0]\n";
    let scene = world(&format!("Scale 2 2 2 {curve} {curve} ReverseOrientation {curve}"));
    let [a, b] = shapes(&scene)[..] else { panic!("{} shapes", shapes(&scene).len()) };
    let segments = |shape: &Shape| match &shape.geometry {
        Geometry::Curves(curves) => (curves.kind, curves.segments.clone()),
        _ => panic!("curves"),
    };
    let (kind, both) = segments(if a.flipped { b } else { a });
    assert_eq!((kind, both.len()), (CurveKind::Cylinder, 4));
    assert!(close(both[1].points[3], Vec3::new(12.0, 0.0, 0.0)));
    assert!((both[0].widths[1] - 0.3).abs() < 1e-6 && (both[1].widths[0] - 0.3).abs() < 1e-6);
    assert_eq!(segments(if a.flipped { a } else { b }).1.len(), 2);
}

#[test]
fn included_files_go_on_and_imported_ones_leave_no_trace() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &[u8]| std::fs::write(folder.path().join(name), text).expect("writable");
    write("part.pbrt", b"Translate 1 0 0 Shape \"sphere\"");
    let read = |text: &str| {
        write("main.pbrt", text.as_bytes());
        let scene = load(&folder.path().join("main.pbrt")).unwrap_or_else(|error| panic!("{error}")).scene;
        let center = |shape: &&Shape| match shape.geometry {
            Geometry::Sphere { center, .. } => center.x,
            _ => panic!("a sphere"),
        };
        shapes(&scene).iter().map(center).collect::<Vec<_>>()
    };
    assert_eq!(read("WorldBegin Include \"part.pbrt\" Shape \"sphere\""), [1.0, 1.0]);
    // A list of parameters goes on behind the file that begins it, and over the ends of several.
    write("nested.pbrt", b"Translate 1 0 0 Include \"part.pbrt\" # the end");
    for text in [
        "WorldBegin Include \"part.pbrt\" \"float radius\" 2 Shape \"sphere\"",
        "WorldBegin Include \"nested.pbrt\"\n\"float radius\" [ 2 ]\nTranslate -1 0 0 Shape \"sphere\"",
    ] {
        let centers = read(text);
        assert_eq!(centers.len(), 2, "{text}");
        assert_eq!(centers[1], 1.0, "{text}");
        let scene = load(&folder.path().join("main.pbrt")).expect("sound").scene;
        assert!(matches!(shapes(&scene)[0].geometry, Geometry::Sphere { radius: 2.0, .. }), "{text}");
    }
    assert_eq!(read("WorldBegin Import \"part.pbrt\" Shape \"sphere\""), [1.0, 0.0]);
    // The same, packed.
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    std::io::Write::write_all(&mut packed, b"Translate 1 0 0 Shape \"sphere\"").expect("a writable vector");
    write("part.pbrt.gz", &packed.finish().expect("a writable vector"));
    assert_eq!(read("WorldBegin Include \"part.pbrt.gz\" Shape \"sphere\""), [1.0, 1.0]);
}

#[test]
fn a_mesh_file_that_several_shapes_use() {
    let folder = tempfile::tempdir().expect("a folder");
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 1 0 0 0 1 0 3 0 1 2\n";
    std::fs::write(folder.path().join("a.ply"), ply).expect("writable");
    let path = folder.path().join("main.pbrt");
    let shape = "Shape \"plymesh\" \"string filename\" \"a.ply\"";
    std::fs::write(&path, format!("WorldBegin {shape} Translate 0 0 1 {shape}")).expect("writable");
    let scene = load(&path).expect("sound").scene;
    let heights: Vec<_> = shapes(&scene).iter().map(|shape| mesh(shape).positions[0].z).collect();
    assert_eq!(heights, [0.0, 1.0]);
    assert_eq!(scene.instances.len(), 1);
}

#[test]
fn subdivision_surfaces_are_divided() {
    let scene = world(
        "Shape \"loopsubdiv\" \"integer levels\" 2 \"integer indices\" [0 1 2 0 3 1 0 2 3 1 3 2]
         \"point3 P\" [0 0 1 1 0 -.5 -1 1 -.5 -1 -1 -.5]",
    );
    let surface = mesh(shapes(&scene)[0]);
    assert_eq!(surface.triangles.len(), 4 * 16);
    assert_eq!(surface.normals.len(), surface.positions.len());
}

/// Heights are looked up over texture coordinates, edges measured in the world.
#[test]
fn displaced_meshes_take_the_form_of_their_texture() {
    let folder = tempfile::tempdir().expect("a folder");
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
               property float u\nproperty float v\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
               0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n";
    std::fs::write(folder.path().join("a.ply"), ply).expect("a writable folder");
    let read = |more: &str| {
        let text = format!(
            "WorldBegin\nTexture \"ramp\" \"float\" \"bilerp\" \"float v00\" 0 \"float v01\" 0 \"float v10\" 2 \
             \"float v11\" 2\nTranslate 0 0 5\nScale 2 2 2\n\
             Shape \"plymesh\" \"string filename\" \"a.ply\" {more}"
        );
        load_bytes(&folder.path().join("a.pbrt"), text.as_bytes())
    };
    let loaded =
        read("\"texture displacement\" \"ramp\" \"float displacement.edgelength\" 0.5").expect("sound");
    assert!(
        loaded.warnings.iter().all(|warning| !warning.message.contains("displace")),
        "{:?}",
        loaded.warnings
    );
    let Geometry::Mesh(mesh) = &loaded.scene.objects[0].shapes[0].geometry else { panic!("a mesh") };
    assert!(mesh.triangles.len() > 16);
    for (position, uv) in mesh.positions.iter().zip(&mesh.uvs[0]) {
        let expected = Vec3::new(2.0 * uv.x, 2.0 * uv.y, 5.0 + 4.0 * uv.x);
        assert!(position.distance(expected) < 1e-5, "{position} {expected}");
    }
    let unknown = read("\"texture displacement\" \"rmap\"").expect_err("no such texture");
    assert!(unknown.message().contains("did you mean \"ramp\""), "{unknown}");
}
