//! What is said about broken scenes of pbrt: the place of each fault and the words about it, and the warnings about
//! what is not drawn.

use std::path::Path;

use quietus_scene::{Loaded, SceneError, load_bytes};

fn read(text: &str) -> Result<Loaded, SceneError> {
    load_bytes(Path::new("no/such/folder/test.pbrt"), text.as_bytes())
}

/// Scenes, the place of their fault, and a part of what is said about it. `W` stands for `WorldBegin`.
const FAULTS: &[(&str, &str, &str)] = &[
    // The grammar.
    ("", "1:1", "the file ends before WorldBegin"),
    ("W\n\"sphere\"", "2:1", "\"sphere\" where a directive is expected"),
    ("W\n]", "2:1", "] where a directive is expected"),
    ("W\nShpae \"sphere\"", "2:1", "unknown directive \"Shpae\", did you mean \"Shape\"?"),
    // Scenes of pbrt-v3.
    ("W Material \"matte\"", "1:12", "it belongs to pbrt-v3, in pbrt-v4 it is \"diffuse\""),
    (
        "W Material \"diffuse\" \"rgb Kd\" [1 1 1] Shape \"sphere\"",
        "1:31",
        "in pbrt-v4 it is \"reflectance\"",
    ),
    ("Film \"image\" W", "1:1", "unknown film \"image\": it belongs to pbrt-v3"),
    ("W LightSource \"infinite\" \"string mapname\" \"a.exr\"", "1:35", "in pbrt-v4 it is \"filename\""),
    ("SurfaceIntegrator \"path\" W", "1:1", "in pbrt-v4 it is Integrator"),
    // Media that vary.
    ("W MakeNamedMedium \"a\" \"string type\" \"uniformgrid\"", "1:12", "has no \"float density\""),
    (
        "W MakeNamedMedium \"a\" \"string type\" \"uniformgrid\" \"integer nx\" 2 \"float density\" [1 2 3]",
        "1:75",
        "\"density\" has 3 values, expected nx * ny * nz = 2 * 1 * 1",
    ),
    (
        "W MakeNamedMedium \"a\" \"string type\" \"uniformgrid\" \"float density\" [-1]",
        "1:60",
        "value 0 of \"density\" is negative",
    ),
    ("W MakeNamedMedium \"a\" \"string type\" \"rgbgrid\"", "1:12", "neither \"rgb sigma_a\" nor"),
    ("W MakeNamedMedium \"a\" \"string type\" \"cloud\" \"point3 p1\" [1 1 0]", "1:54", "is flat"),
    ("W LightSource \"projection\"", "1:12", "has no \"string filename\""),
    (
        "W Shape \"loopsubdiv\" \"integer levels\" 30 \"point3 P\" [0 0 0 1 0 0 0 1 0]",
        "1:31",
        "30 divisions of 1 triangles are too many",
    ),
    ("W\nFurniture", "2:1", "unknown directive \"Furniture\""),
    ("W\n  Shape \"open", "2:9", "no closing quotation mark"),
    ("W\n  Shape sphere", "2:9", "sphere after shape, expected a string in quotation marks"),
    ("W Shape", "1:17", "the file ends inside shape"),
    ("W Translate 1 2", "1:25", "the file ends inside Translate"),
    ("W Translate 1 2 x", "1:26", "x in Translate, expected 3 numbers"),
    ("W Transform [ 1 0 0 0 ]", "1:32", "] in Transform, expected 16 numbers"),
    ("W AttributeBegin\n", "1:12", "AttributeBegin without AttributeEnd"),
    ("W\nAttributeEnd", "2:1", "AttributeEnd without AttributeBegin"),
    ("W AttributeBegin\nObjectEnd", "2:1", "ObjectEnd where AttributeEnd is expected"),
    ("W\nWorldBegin", "2:1", "WorldBegin belongs before WorldBegin"),
    ("Shape \"sphere\"", "1:1", "Shape belongs after WorldBegin"),
    ("W\nFilm \"rgb\"", "2:1", "Film belongs before WorldBegin"),
    // Parameters.
    (
        "W Shape \"sphere\"\n \"float raduis\" 1",
        "2:2",
        "unknown parameter of shape \"sphere\": \"raduis\", did you mean \"radius\"?",
    ),
    (
        "W Shape \"sphere\"\n \"flaot radius\" 1",
        "2:2",
        "unknown parameter type \"flaot\", did you mean \"float\"?",
    ),
    ("W Shape \"sphere\"\n \"radius\" 1", "2:2", "is no parameter, expected its type and name"),
    (
        "W Shape \"sphere\"\n \"integer radius\" 1",
        "2:2",
        "\"radius\" of shape \"sphere\" has type integer, expected float",
    ),
    ("W Shape \"sphere\"\n \"float radius\" [1 2]", "2:2", "\"float radius\" has 2 values, expected 1"),
    ("W Shape \"sphere\"\n \"float radius\" [\"1\"]", "2:18", "\"1\" in \"float radius\", expected a number"),
    ("W Shape \"sphere\"\n \"float radius\" inf", "2:17", "inf in \"float radius\", expected a number"),
    ("W Shape \"sphere\"\n \"float radius\" []", "2:2", "\"float radius\" has no value"),
    ("W Shape \"sphere\"\n \"float radius\" [1", "2:2", "\"float radius\" has no value"),
    (
        "W Shape \"disk\"\n \"integer height\" 0.5",
        "2:19",
        "0.5 in \"integer height\", expected an integer of 32 bits",
    ),
    ("W LightSource \"point\"\n \"rgb I\" [1 2]", "2:2", "\"rgb I\" has 2 values, expected 3"),
    ("W LightSource \"point\"\n \"rgb I\" [1 2 -3]", "2:2", "\"rgb I\" has a negative component"),
    ("W LightSource \"point\"\n \"blackbody I\" 0", "2:2", "expects one temperature above 0"),
    ("W LightSource \"point\"\n \"spectrum I\" [400 1 500]", "2:2", "expected pairs of wavelength and value"),
    ("W LightSource \"point\"\n \"spectrum I\" [500 1 400 1]", "2:2", "wavelength 400 after 500"),
    ("W LightSource \"point\"\n \"spectrum I\" \"stdillum-D66\"", "2:2", "did you mean \"stdillum-D65\"?"),
    ("W LightSource \"infinite\"\n \"bool L\" maybe", "2:11", "maybe in \"bool L\", expected true or false"),
    ("W LightSource \"infinite\"\n \"point3 portal\" [0 0 0]", "2:2", "has 1 corners, expected 4"),
    ("W LightSource \"infinite\"\n \"point3 portal\" [0 0 0 1 0 0 1 1 0 0 2 0]", "2:2", "are no rectangle"),
    ("W LightSource \"infinite\"\n \"point3 portal\" [0 0 0 1 0 0 2 1 0 1 1 0]", "2:2", "are no rectangle"),
    // Transforms.
    (
        "W\n Scale 1 0 1 Texture \"a\" \"float\" \"constant\"",
        "2:14",
        "Texture under a transform that flattens",
    ),
    ("Scale 1 0 1\nCamera \"perspective\" W", "2:1", "Camera under a transform that flattens space"),
    ("W\n Rotate 10 0 0 0", "2:2", "axis of length 0"),
    ("W\n LookAt 0 0 0 0 0 0 0 1 0", "2:2", "LookAt expects"),
    ("W\n Transform [1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 0]", "2:2", "with perspective"),
    ("W\n ConcatTransform [1 0 0 1 0 1 0 0 0 0 1 0 0 0 0 1]", "2:2", "with perspective"),
    ("W\n CoordSysTransform \"wrold\"", "2:20", "did you mean \"world\"?"),
    ("W\n ActiveTransform Start", "2:18", "expected StartTime, EndTime or All"),
    ("W\n ColorSpace \"rec709\"", "2:13", "unknown colour space \"rec709\", expected one of srgb"),
    // Shapes.
    ("W\nShape \"shpere\"", "2:1", "unknown shape \"shpere\", did you mean \"sphere\"?"),
    (
        "W\nShape \"sphere\" \"float radius\" 0",
        "2:16",
        "\"radius\" of shape \"sphere\" is 0, expected a number above 0",
    ),
    ("W\nShape \"sphere\" \"float zmin\" 1 \"float zmax\" 1", "2:1", "expected some height"),
    ("W\nShape \"disk\" \"float innerradius\" 1", "2:14", "expected a number from 0 to below the radius"),
    ("W\nShape \"trianglemesh\"", "2:1", "has no \"point3 P\""),
    ("W\nShape \"trianglemesh\" \"point3 P\" [0 0 0 1]", "2:22", "has 4 values, expected a multiple of 3"),
    (
        "W\nShape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0]",
        "2:1",
        "has no \"integer indices\" for its 2 vertices",
    ),
    (
        "W\nShape \"trianglemesh\" \"integer indices\" [0 1 3] \"point3 P\" [0 0 0 1 0 0 0 1 0]",
        "2:22",
        "index 3",
    ),
    (
        "W\nShape \"trianglemesh\" \"integer indices\" [0 1] \"point3 P\" [0 0 0 1 0 0 0 1 0]",
        "2:22",
        "expected a multiple of 3",
    ),
    (
        "W\nShape \"trianglemesh\" \"point2 uv\" [0 0] \"point3 P\" [0 0 0 1 0 0 0 1 0]",
        "2:22",
        "\"uv\" of shape \"trianglemesh\" has 1 values for 3 vertices",
    ),
    ("W\nShape \"plymesh\"", "2:1", "has no \"string filename\""),
    (
        "W\nShape \"curve\" \"point3 P\" [0 0 0 1 0 0]",
        "2:15",
        "a curve of 2 points, expected 4 and then multiples of 3 more",
    ),
    ("W\nShape \"curve\" \"integer degree\" 4 \"point3 P\" [0 0 0]", "2:15", "\"degree\" of a curve is 4"),
    (
        "W\nShape \"curve\" \"string type\" \"ribbon\" \"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0]",
        "2:1",
        "has 0 normals, expected 2",
    ),
    (
        "W\nShape \"curve\" \"string basis\" \"hermite\" \"point3 P\" [0 0 0]",
        "2:15",
        "expected one of bezier, bspline",
    ),
    ("W\nShape \"sphere\" \"texture alpha\" \"leaf\"", "2:16", "unknown float texture \"leaf\""),
    // Materials and textures.
    ("W\nMaterial \"plastic\"", "2:1", "unknown material \"plastic\""),
    ("W\nMaterial \"difuse\"", "2:1", "did you mean \"diffuse\"?"),
    (
        "W\nMaterial \"diffuse\" \"float reflectance\" 0.5",
        "2:20",
        "has type float, expected rgb or spectrum or blackbody or texture",
    ),
    (
        "W\nMaterial \"diffuse\" \"rgb reflectance\" [1 1 1.5]",
        "2:20",
        "\"rgb reflectance\" has a component above 1",
    ),
    ("W\nMaterial \"diffuse\" \"texture reflectance\" \"wood\"", "2:20", "unknown spectrum texture \"wood\""),
    (
        "W\nMaterial \"conductor\" \"rgb reflectance\" [1 1 1]\n\"spectrum eta\" \"metal-Ag-eta\"",
        "3:1",
        "has both \"reflectance\" and \"eta\"",
    ),
    ("W\nMaterial \"dielectric\" \"spectrum eta\" \"glass-BK8\"", "2:23", "did you mean \"glass-BK7\"?"),
    ("W\nNamedMaterial \"gold\"\nShape \"sphere\"", "2:1", "unknown material \"gold\""),
    ("W\nMakeNamedMaterial \"gold\"", "2:1", "material \"gold\" has no \"string type\""),
    (
        "W\nMakeNamedMaterial \"a\" \"string type\" \"diffuse\"\nMakeNamedMaterial \"a\" \"string type\" \"diffuse\"",
        "3:1",
        "made twice",
    ),
    (
        "W\nMakeNamedMaterial \"a\" \"string type\" \"mix\" \"string materials\" [\"a\" \"a\"]",
        "2:1",
        "is mixed from itself",
    ),
    ("W\nMaterial \"mix\" \"string materials\" [\"a\"]", "2:16", "expects 2 names"),
    ("W\nTexture \"a\" \"rgb\" \"constant\"", "2:13", "unknown type of texture values \"rgb\""),
    ("W\nTexture \"a\" \"color\" \"constant\"", "2:13", "in pbrt-v4 it is \"spectrum\""),
    ("W\nTexture \"a\" \"float\" \"imagemp\"", "2:1", "did you mean \"imagemap\"?"),
    ("W\nTexture \"a\" \"float\" \"imagemap\"", "2:1", "has no \"string filename\""),
    (
        "W\nTexture \"a\" \"float\" \"constant\"\nTexture \"a\" \"float\" \"constant\"",
        "3:1",
        "float texture \"a\" is defined twice",
    ),
    ("W\nTexture \"a\" \"float\" \"scale\" \"texture tex\" \"b\"", "2:29", "unknown float texture \"b\""),
    // Lights.
    ("W\nLightSource \"sun\"", "2:1", "unknown light \"sun\""),
    ("W\nAreaLightSource \"difuse\"", "2:1", "unknown area light \"difuse\", did you mean \"diffuse\"?"),
    (
        "W\nLightSource \"infinite\" \"rgb L\" [1 1 1]\n\"string filename\" \"a.exr\"",
        "3:1",
        "has both \"filename\" and \"L\"",
    ),
    (
        "W\nLightSource \"distant\" \"point3 to\" [0 0 0]",
        "2:23",
        "\"from\" and \"to\" of light \"distant\" are the same",
    ),
    ("W\nLightSource \"point\" \"float scale\" -1", "2:21", "is -1, expected at least 0"),
    // Objects, media, attributes.
    ("W\nObjectInstance \"tree\"", "2:1", "unknown object \"tree\""),
    ("W\nObjectBegin \"a\" ObjectEnd\nObjectBegin \"a\" ObjectEnd", "3:1", "object \"a\" is defined twice"),
    ("W\nObjectBegin \"a\"\nObjectInstance \"a\" ObjectEnd", "3:1", "inside an object's definition"),
    ("W\nMediumInterface \"fog\" \"\" Shape \"sphere\"", "2:1", "unknown medium \"fog\""),
    ("MakeNamedMedium \"fog\" \"string type\" \"foggy\"\nW", "1:23", "unknown medium \"foggy\""),
    ("W\nAttribute \"shapes\" \"float radius\" 1", "2:11", "did you mean \"shape\"?"),
    ("Option \"bool sneed\" true\nW", "1:8", "did you mean \"seed\"?"),
    ("W\nInclude \"gone.pbrt\"", "named by no/such/folder/test.pbrt:2:1", "no such file"),
    // How to draw.
    ("Camera \"perspektive\"\nW", "1:1", "did you mean \"perspective\"?"),
    ("Camera \"perspective\" \"float fov\" 180\nW", "1:22", "expected an angle between 0 and 180"),
    ("Camera \"perspective\" \"float shutteropen\" 2\nW", "1:1", "expected a later time"),
    ("Film \"rbg\"\nW", "1:1", "did you mean \"rgb\"?"),
    ("Film \"rgb\" \"integer xresolution\" 0\nW", "1:12", "is 0, expected at least 1"),
    (
        "W\nMaterial \"subsurface\" \"string name\" \"Skin1\" \"rgb reflectance\" [1 1 1]",
        "2:45",
        "both \"name\" and \"reflectance\"",
    ),
    ("W\nMaterial \"subsurface\" \"float g\" 1", "2:23", "between -1 and 1"),
    ("Film \"rgb\" \"float cropwindow\" [0.5 0.5 0 1]\nW", "1:12", "leaves nothing of the picture"),
    ("Film \"rgb\" \"string sensor\" \"eye\"\nW", "1:12", "unknown sensor \"eye\""),
    ("PixelFilter \"gauss\"\nW", "1:1", "unknown filter \"gauss\""),
    ("Sampler \"random\"\nW", "1:1", "unknown sampler \"random\""),
    ("Integrator \"pth\"\nW", "1:1", "did you mean \"path\"?"),
];

#[test]
fn faults_are_named_with_their_place() {
    let mut wrong = String::new();
    for (text, place, words) in FAULTS {
        let text = text.replace("W", "WorldBegin").replace("WorldBeginorldBegin", "WorldBegin");
        let said = match read(&text) {
            Ok(_) => "no error".to_owned(),
            Err(error) if error.place() == *place && error.message().contains(words) => continue,
            Err(error) => error.to_string(),
        };
        wrong += &format!("{text}\n    says     {said}\n    expected {place}: ...{words}...\n");
    }
    assert!(wrong.is_empty(), "{wrong}");
}

#[test]
fn errors_start_with_file_line_and_column() {
    let error = read("WorldBegin\n\n  Shape \"shpere\"").expect_err("a fault");
    assert_eq!(
        error.to_string(),
        "no/such/folder/test.pbrt:3:3: unknown shape \"shpere\", did you mean \"sphere\"?"
    );
}

/// Directives after `WorldBegin`, the place of the warning, and a part of it.
const WARNINGS: &[(&str, &str, &str)] = &[
    ("LightSource \"goniometric\"", "2:1", "shines to all sides alike"),
    ("AttributeBegin Scale 1 0 1 Shape \"sphere\" AttributeEnd", "2:28", "a shape has no extent where its"),
    ("Material \"subsurface\" \"string name\" \"Skim1\" Shape \"sphere\"", "2:1", "did you mean \"Skin1\"?"),
    (
        "Texture \"a\" \"float\" \"ptex\" \"string filename\" \"a.ptx\"",
        "2:1",
        "texture \"ptex\" is not drawn",
    ),
    (
        "MakeNamedMedium \"a\" \"string type\" \"homogeneous\" \"string preset\" \"Ketchap\"",
        "2:1",
        "did you mean \"Ketchup\"?",
    ),
    (
        "Texture \"a\" \"float\" \"fbm\" Material \"hair\" \"texture alpha\" \"a\"",
        "2:43",
        "\"texture alpha\" of material \"hair\" is not drawn; 2 stands in",
    ),
    ("Material \"subsurface\" \"string name\" \"Skin1\" \"float g\" .5", "2:45", "\"g\" does not count"),
    ("Shape \"sphere\" \"float radius\" 1 \"float radius\" 2", "2:33", "given twice"),
    ("WorldEnd", "2:1", "not part of pbrt-v4"),
    ("Material \"interface\" AreaLightSource \"diffuse\" Shape \"sphere\"", "2:48", "do not shine"),
    ("ObjectBegin \"a\" AreaLightSource \"diffuse\" Shape \"sphere\" ObjectEnd", "2:43", "do not shine"),
];

#[test]
fn what_is_not_drawn_is_said_once_with_its_place() {
    for (text, place, words) in WARNINGS {
        let loaded = read(&format!("WorldBegin\n{text}\n")).unwrap_or_else(|error| panic!("{error}"));
        let found = loaded.warnings.iter().filter(|w| w.message.contains(words)).collect::<Vec<_>>();
        assert_eq!(found.len(), 1, "{text}: {:?}", loaded.warnings);
        assert_eq!(found[0].place, *place, "{text}");
    }
    let many = "Shape \"sphere\" \"float radius\" 1 \"float radius\" 2\n".repeat(5);
    let loaded = read(&format!("WorldBegin\n{many}")).expect("sound");
    let about = loaded.warnings.iter().filter(|warning| warning.message.contains("given twice"));
    assert_eq!(about.count(), 1);
}

/// Includes of includes, with faults in them.
#[test]
fn faults_in_included_files_name_those() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).expect("a writable folder");
        path
    };
    write("b.pbrt", "\n Shape \"cube\"");
    write("a.pbrt", "Include \"b.pbrt\"");
    let main = write("main.pbrt", "WorldBegin Include \"a.pbrt\"");
    let error = quietus_scene::load(&main).expect_err("a fault");
    assert!(error.file().ends_with("b.pbrt"), "{error}");
    assert_eq!(error.place(), "2:2");

    write("b.pbrt", "WorldEnd");
    let loaded = quietus_scene::load(&main).expect("sound");
    assert!(loaded.warnings[0].place.ends_with("b.pbrt:1:1"), "{:?}", loaded.warnings);

    write("b.pbrt", "Include \"a.pbrt\"");
    let error = quietus_scene::load(&main).expect_err("a cycle");
    assert!(error.message().contains("includes itself"), "{error}");

    let main = write("ply.pbrt", "WorldBegin\nShape \"plymesh\" \"string filename\" \"a.ply\"");
    write("a.ply", "ply\nformat ascii 2.0\n");
    let error = quietus_scene::load(&main).expect_err("a fault");
    assert!(error.file().ends_with("a.ply") && error.place() == "2", "{error}");
}
