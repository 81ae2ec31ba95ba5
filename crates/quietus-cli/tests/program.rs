//! The program from outside: what it writes, what it says, and how it ends.

mod common;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use common::{command, quietus, refusal, stderr};
use quietus_film::{Metadata, Picture, read_exr};
use tempfile::TempDir;

fn dir() -> TempDir {
    tempfile::tempdir().expect("a temporary directory")
}

fn files(dir: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(dir).unwrap();
    let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// Runs it, wants success, and reads `a.exr`.
fn draw(flags: &str) -> (Picture, Metadata) {
    let dir = dir();
    let output = quietus(dir.path(), &format!("render -o a.exr {flags}"));
    assert!(output.status.success(), "{flags}: {}", stderr(&output));
    read_exr(&dir.path().join("a.exr")).unwrap()
}

/// Runs it, wants exit code `code`, one message and no output; returns the message.
fn refused(dir: &Path, arguments: &str, code: i32) -> String {
    let before = files(dir);
    let output = quietus(dir, arguments);
    let message = refusal(arguments, &output, code);
    assert_eq!(files(dir), before, "{arguments} left something behind");
    message
}

#[test]
fn the_pictures_are_written_and_named() {
    let dir = dir();
    let output = quietus(dir.path(), "render --size 24x16 --spp 2");
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(files(dir.path()), ["quietus.exr", "quietus.png"]);
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    for file in ["quietus.png", "quietus.exr"] {
        let path = dir.path().canonicalize().unwrap().join(file);
        assert!(said.contains(&format!("wrote {}", path.display())), "{said}");
    }
    assert_eq!(stderr(&output), "", "quiet where stderr is no terminal");
}

#[test]
fn the_exr_holds_every_channel_and_setting() {
    let (picture, metadata) = draw("--size 40x24 --spp 6 --seed 9 --crop 8,4,30,20 --filter box");
    assert_eq!((picture.frame, picture.window.x0, picture.window.height()), ([40, 24], 8, 16));
    assert!(picture.samples.iter().all(|&count| count == 6));
    assert!(picture.beauty.iter().any(|pixel| pixel[0] > 0.0));
    assert!(picture.depth.iter().any(|&depth| depth > 0.0));
    assert!(picture.albedo.iter().any(|albedo| albedo[0] > 0.0));
    assert!(picture.normal.iter().any(|normal| *normal != [0.0; 3]));
    let get = |name: &str| metadata.iter().find(|(n, _)| n == name).map(|(_, value)| value.as_str());
    let expected = [
        ("seed", "9"),
        ("version", env!("CARGO_PKG_VERSION")),
        ("sampling", "uniform"),
        ("filter", "box"),
        ("crop", "[8,4,30,20]"),
        ("max_samples", "6"),
    ];
    for (name, value) in expected {
        assert_eq!(get(name), Some(value), "{name}");
    }
}

/// A lamp under a film of every wish.
const WISHES: &str = r#"Film "rgb" "integer xresolution" 40 "integer yresolution" 30 "float iso" 200
    "float cropwindow" [ 0.5 1 0 0.5 ] "float maxcomponentvalue" 3
PixelFilter "mitchell" "float xradius" 2.5
Sampler "zsobol" "integer pixelsamples" 6
Integrator "path" "integer maxdepth" 2
Camera "perspective" "float fov" 50
WorldBegin
AttributeBegin
  AreaLightSource "diffuse" "rgb L" [ 1 1 1 ] "bool twosided" true
  Shape "bilinearmesh" "point3 P" [ -9 -9 5  9 -9 5  -9 9 5  9 9 5 ]
AttributeEnd
"#;

#[test]
fn a_scene_decides_what_flags_leave_open() {
    let dir = dir();
    std::fs::write(dir.path().join("wishes.pbrt"), WISHES).unwrap();
    let drawn = |flags: &str| {
        let output = quietus(dir.path(), &format!("render wishes.pbrt -o a.exr {flags}"));
        assert!(output.status.success(), "{flags}: {}", stderr(&output));
        let (picture, metadata) = read_exr(&dir.path().join("a.exr")).unwrap();
        let get = move |name: &str| metadata.iter().find(|(n, _)| n == name).map(|(_, value)| value.clone());
        (picture, get, stderr(&output))
    };
    let (picture, get, said) = drawn("--target-error 0.001");
    let expected = "wishes.pbrt asks for: 40x30 pixels; columns 0.5 to 1 and rows 0 to 0.5 of a frame of 1; at most 6 \
                    samples per pixel; paths of up to 3 segments; filter mitchell (b 0.33333334, c 0.33333334, radius \
                    2.5 x 2); exposure 2; samples darkened to 3 (energy is lost; --max-component inf)\n";
    assert_eq!(said, expected);
    assert_eq!((picture.frame, picture.window.x0, picture.window.y1), ([40, 30], 20, 15));
    assert!(picture.samples.iter().all(|&samples| samples <= 6));
    for (name, value) in [
        ("max_samples", "6"),
        ("max_depth", "3"),
        ("filter", "mitchell"),
        ("filter_radius", "[2.5,2.0]"),
        ("exposure", "[2.0,2.0,2.0]"),
        ("max_component", "3.0"),
        ("from_scene", r#"["size","crop","max_samples","max_depth","filter","exposure","max_component"]"#),
    ] {
        assert_eq!(get(name).as_deref(), Some(value), "{name}");
    }
    let flags =
        "--width 20 --crop 0,0,20,15 --spp 2 --max-depth 1 --filter box --exposure 0.5 --max-component inf";
    let (picture, get, said) = drawn(flags);
    assert_eq!(said, "");
    assert_eq!((picture.frame, picture.window.width()), ([20, 15], 20));
    // The lamp fills the picture: its radiance times the exposure.
    assert!(picture.beauty.iter().all(|pixel| (pixel[0] - 0.5).abs() < 1e-3), "{:?}", picture.beauty[0]);
    let found = ["filter", "exposure", "max_component", "from_scene"].map(get);
    assert_eq!(found.map(Option::unwrap_or_default), ["box", "[0.5,0.5,0.5]", "", "[]"]);
    let info = quietus(dir.path(), "info wishes.pbrt");
    let text = String::from_utf8_lossy(&info.stdout).into_owned();
    for line in
        ["asks for     40x30 pixels", "asks for     at most 6 samples per pixel", "asks for     exposure 2"]
    {
        assert!(text.lines().any(|found| found == line), "{line}: {text}");
    }
}

#[test]
fn threads_change_nothing() {
    for sampling in ["quietus", "talk", "uniform --spp 8"] {
        let limit = if sampling.starts_with("uniform") { "" } else { "--target-error 0.02 --max-samples 64" };
        let of =
            |threads: u32| draw(&format!("--size 72x40 --sampling {sampling} {limit} --threads {threads}")).0;
        let one = of(1);
        for threads in [2, 3, 4, 7] {
            assert!(of(threads) == one, "{sampling} with {threads} threads");
        }
    }
}

#[test]
fn a_crop_is_cut_out_of_the_full_frame() {
    let (full, _) = draw("--size 40x24 --spp 4");
    let (crop, _) = draw("--size 40x24 --spp 4 --crop 5,3,26,24");
    for y in 3..24 {
        for x in 5..26 {
            let (a, b) = (crop.index(x, y), full.index(x, y));
            assert_eq!(crop.beauty[a], full.beauty[b], "({x}, {y})");
        }
    }
}

#[test]
fn the_seed_decides_the_noise() {
    let of = |seed: u32| draw(&format!("--size 24x16 --spp 2 --seed {seed}")).0.beauty;
    assert_eq!(of(1), of(1));
    assert_ne!(of(1), of(2));
}

#[test]
fn statistics_have_the_documented_keys_and_no_others() {
    let dir = dir();
    let flags =
        "render -o a.png --size 48x32 --target-error 0.02 --max-samples 64 --stats s.json --tree t.svg";
    let output = quietus(dir.path(), flags);
    assert!(output.status.success(), "{}", stderr(&output));
    let text = std::fs::read_to_string(dir.path().join("s.json")).unwrap();
    let stats: serde_json::Value = serde_json::from_str(&text).unwrap();
    let document = include_str!("../../../docs/stats.md");
    let documented = |section: &str| {
        let section = document.split("\n## ").find(|s| s.starts_with(section)).unwrap();
        let keys = section.lines().filter_map(|line| line.strip_prefix("| `")?.split('`').next());
        let mut keys: Vec<_> = keys.map(str::to_owned).collect();
        keys.sort();
        keys
    };
    let keys = |value: &serde_json::Value| {
        let mut keys: Vec<_> = value.as_object().unwrap().keys().cloned().collect();
        keys.sort();
        keys
    };
    assert_eq!(keys(&stats), documented("Keys"));
    assert_eq!(keys(&stats["settings"]), documented("Settings"));
    assert!(stats["samples"].as_u64().unwrap() >= 16 * 48 * 32);
    assert!(stats["rays"].as_u64() > stats["samples"].as_u64());
    assert!(stats["rebuilds"].as_u64().unwrap() > 0);
    let log = stats["rebuild_log"].as_array().unwrap();
    assert_eq!(log.len() as u64, stats["rebuilds"].as_u64().unwrap());
    let (mut longest, mut most_nodes) = (0.0_f64, 0);
    for entry in log {
        assert_eq!(keys(entry), documented("Rebuild log"));
        longest = longest.max(entry["milliseconds"].as_f64().unwrap());
        most_nodes = most_nodes.max(entry["nodes"].as_u64().unwrap());
    }
    assert_eq!(
        (Some(longest), Some(most_nodes)),
        (stats["rebuild_ms_max"].as_f64(), stats["tree_nodes_max"].as_u64())
    );
    let svg = std::fs::read_to_string(dir.path().join("t.svg")).unwrap();
    assert!(svg.starts_with("<svg") && svg.contains("<rect"));
}

#[test]
fn an_environment_takes_the_place_of_the_sky_made_up_for_dark_scenes() {
    let dir = dir();
    let triangle = r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36, "uri":
        "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]}"#;
    std::fs::write(dir.path().join("dark.gltf"), triangle).unwrap();
    assert!(quietus(dir.path(), "render -o sky.exr --size 8x8 --spp 1").status.success());
    let camera = "warning: dark.gltf: cameras: the scene has no camera: one that frames it is added\n";
    let sky = "warning: dark.gltf: the scene has neither lights nor emitters brighter than white: a plain sky is added to light it\n";
    let said = |flags: &str| {
        let output = quietus(dir.path(), &format!("render dark.gltf -o a.png --size 8x8 --spp 1 {flags}"));
        assert!(output.status.success(), "{}", stderr(&output));
        stderr(&output)
    };
    assert_eq!(said(""), format!("{camera}{sky}"));
    assert_eq!(said("--env sky.exr"), camera);
    assert_eq!(said("--env none"), camera);
}

/// A triangle that moves by a unit along x, from 1 to 2 seconds; its first animation stands still.
const MOVING: &str = r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
    "nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
        {"bufferView": 1, "componentType": 5126, "count": 2, "type": "SCALAR"},
        {"bufferView": 0, "componentType": 5126, "count": 2, "type": "VEC3"},
        {"componentType": 5126, "count": 2, "type": "VEC3"}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 1, "byteLength": 8}],
    "buffers": [{"byteLength": 36, "uri":
        "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"},
        {"byteLength": 8, "uri": "data:application/octet-stream;base64,AACAPwAAAEA="}],
    "animations": [
        {"name": "rest", "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
            "samplers": [{"input": 1, "output": 3}]},
        {"name": "go", "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
            "samplers": [{"input": 1, "output": 2}]}
    ]}"#;

#[test]
fn frames_are_numbered_and_move() {
    let dir = dir();
    std::fs::write(dir.path().join("moving.gltf"), MOVING).unwrap();
    let draw = |flags: &str| {
        let flags = format!("render moving.gltf --size 24x16 --spp 4 --filter box {flags}");
        let output = quietus(dir.path(), &flags);
        assert!(output.status.success(), "{flags}: {}", stderr(&output));
        stderr(&output)
    };
    let said = draw("--frames 11-13 --fps 8 --animation go -o go.##.exr --stats go.json");
    assert_eq!(said.matches("no camera").count(), 1, "warnings are said once: {said}");
    let mut expected: Vec<_> =
        [11, 12, 13].iter().flat_map(|i| [format!("go.{i}.exr"), format!("go.00{i}.json")]).collect();
    expected.push("moving.gltf".to_owned());
    expected.sort();
    assert_eq!(files(dir.path()), expected);
    let picture = |name: &str| read_exr(&dir.path().join(name)).unwrap();
    let (frame, metadata) = picture("go.12.exr");
    let get = |name: &str| metadata.iter().find(|(n, _)| n == name).map(|(_, value)| value.as_str());
    let settings = [("animation", "go"), ("frame", "12"), ("fps", "8.0"), ("shutter", "0.5")];
    for (name, value) in settings {
        assert_eq!(get(name), Some(value), "{name}");
    }
    assert_ne!(frame.beauty, picture("go.13.exr").0.beauty);
    draw("--frame 12 --fps 8 --animation 1 -o one.exr");
    assert!(picture("one.exr").0 == frame, "a frame does not depend on the others");
    draw("--frame 12 --fps 8 --animation go --shutter 0 -o sharp.exr");
    assert_ne!(picture("sharp.exr").0.beauty, frame.beauty, "what moves is blurred");
    let said = draw("--frame 99 -o rest.exr");
    assert!(said.contains("drawing `rest`, the first of 2 animations"), "{said}");
    assert!(said.contains("`rest` ends after 2.000 s, with frame 48"), "{said}");
    let said = draw("-o still.exr");
    assert!(said.contains("the pose stored in the file is drawn"), "{said}");
    let info = quietus(dir.path(), "info moving.gltf");
    let info = String::from_utf8_lossy(&info.stdout).into_owned();
    assert!(info.contains("animation 0  rest, 2.000 s\nanimation 1  go, 2.000 s"), "{info}");
    let refusals = [
        ("--frame 1 --animation jump", "no animation is called `jump`; the scene has `rest`, `go`"),
        ("--frames 3", "expected the first and the last frame"),
        ("--frames 3-4 --frame 3", "cannot be used with"),
        ("--shutter 0.5", "--shutter needs --frame or --frames"),
        ("--frame 1 --shutter 2", "expected a number from 0 to 1"),
    ];
    for (flags, expected) in refusals {
        let message = refused(dir.path(), &format!("render moving.gltf {flags}"), 2);
        assert!(message.contains(expected), "{flags}: {message}");
    }
    let message = refused(dir.path(), "render --frame 1", 2);
    assert!(message.contains("the built-in scene has no frames"), "{message}");
}

#[test]
fn flags_that_make_no_sense_are_usage_errors() {
    let dir = dir();
    let cases = [
        ("render --size 0x5", "a frame of 0x5 pixels is out of range"),
        ("render --size 999999x999999", "a frame of 999999x999999 pixels is out of range"),
        ("render --size 65536x65536", "too large"),
        ("render --size 10by10", "expected width and height in pixels"),
        ("render --size 10x10 --crop 4,4,4,9", "the window 4,4,4,9 is not inside the frame of 10x10"),
        ("render --size 10x10 --crop 0,0,11,10", "the window 0,0,11,10 is not inside the frame of 10x10"),
        ("render --crop 1,2,3", "expected four whole numbers"),
        ("render --target-error NaN", "expected a number above 0"),
        ("render --target-error -1", "expected a number above 0"),
        ("render --spp 0", "expected a whole number from 1 to 4294967295"),
        ("render --spp many", "expected a whole number from 1 to 4294967295"),
        ("render --seed -1", "invalid value '-1' for '--seed <N>': expected a whole number from 0 to"),
        ("render --noise -1%", "invalid value '-1%' for '--noise <P%>': expected percent of white"),
        (
            "render --time -3s -o a.png",
            "invalid value '-3s' for '--time <DURATION>': expected a time above 0",
        ),
        ("render --crop -1,0,5,5", "expected four whole numbers"),
        ("render --noise -o a.png", "a value is required for '--noise <P%>'"),
        ("render --quiet -1", "unexpected value '-1' for '--quiet'"),
        ("render -1", "unexpected argument '-1' found"),
        ("render --bind nowhere", "expected an IP address, such as 127.0.0.1"),
        ("render --spp 4 --sampling pixel", "--spp is for --sampling uniform"),
        ("render --spp 4 --target-error 0.1", "--target-error is for adaptive sampling"),
        ("render --min-samples 10 --max-samples 9", "--min-samples 10 is more than --max-samples 9"),
        ("render --sampling uniform --tree t.svg", "--tree needs a tree"),
        ("render --time never", "expected a time above 0"),
        ("render --threads 0", "expected a number of threads from 1 to 1024"),
        ("render --camera nobody", "no camera is called `nobody`; the scene has `main`"),
        ("render -o picture.jpeg", "picture.jpeg: unknown picture format"),
        ("render -o a.png -o a.png", "a.png: named twice"),
        ("render -o a.png -o ./a.png", "./a.png: named twice"),
        ("render --sampling sometimes", "invalid value 'sometimes'"),
        ("draw", "unrecognized subcommand 'draw'"),
        ("scene.glb", "`scene.glb` is no command: `quietus render scene.glb` draws a scene"),
        ("render --exposure 2 --stops 1", "cannot be used with"),
    ];
    for (arguments, expected) in cases {
        let message = refused(dir.path(), arguments, 2);
        assert!(message.contains(expected), "{arguments}: {message}");
    }
}

#[test]
fn inputs_that_cannot_be_read_are_input_errors() {
    let dir = dir();
    let write = |name: &str, bytes: &[u8]| std::fs::write(dir.path().join(name), bytes).unwrap();
    write("truncated.glb", b"glTF\x02\0\0\0\xff\xff\0\0");
    write("bad.gltf", b"{\"asset\": {\"version\": \"2.0\"}, \"meshes\": [}");
    write("empty.gltf", b"");
    write("half.exr", &[0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0]);
    write("noise.hdr", b"#?RADIANCE\nnothing");
    let cases = [
        ("render missing.glb", "missing.glb"),
        ("render truncated.glb", "truncated.glb"),
        ("render bad.gltf", "bad.gltf"),
        ("render empty.gltf", "empty.gltf"),
        ("render --env missing.hdr", "missing.hdr"),
        ("render --env noise.hdr", "noise.hdr"),
        ("render --env half.exr", "half.exr"),
        ("info missing.exr", "missing.exr: no such file"),
        ("info half.exr", "half.exr: not a readable OpenEXR file"),
        ("info missing.gltf", "missing.gltf"),
        ("info bad.gltf", "bad.gltf"),
    ];
    for (arguments, expected) in cases {
        let message = refused(dir.path(), arguments, 3);
        assert!(message.contains(expected), "{arguments}: {message}");
    }
}

#[test]
fn outputs_that_cannot_be_written_are_known_before_rendering() {
    let dir = dir();
    std::fs::create_dir(dir.path().join("folder.png")).unwrap();
    // Without a limit: these would render for hours before they failed.
    let cases = [
        ("render --target-error 1e-9 -o no/such/dir/a.png", "no/such/dir/a.png: cannot write"),
        ("render --target-error 1e-9 -o folder.png", "folder.png: exists and is not a regular file"),
        ("render --target-error 1e-9 --stats nowhere/s.json", "nowhere/s.json: cannot write"),
        ("render --target-error 1e-9 --tree nowhere/t.svg", "nowhere/t.svg: cannot write"),
    ];
    for (arguments, expected) in cases {
        let message = refused(dir.path(), arguments, 4);
        assert!(message.contains(expected), "{arguments}: {message}");
    }
}

#[test]
fn info_describes_an_exr() {
    let dir = dir();
    assert!(quietus(dir.path(), "render -o a.exr --size 24x16 --spp 2 --crop 1,2,20,10").status.success());
    let output = quietus(dir.path(), "info a.exr");
    assert!(output.status.success(), "{}", stderr(&output));
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    for expected in [
        "display window  24x16 at (0, 0)",
        "data window     19x8 at (1, 2)",
        "channel         samples   u32  min 2            mean 2            max 2",
        "sampling        uniform",
    ] {
        assert!(said.contains(expected), "{expected:?} is not in:\n{said}");
    }
}

#[test]
fn the_time_limit_ends_a_render_well() {
    let dir = dir();
    let output = quietus(dir.path(), "render -o a.png --size 64x36 --sampling uniform --time 0.3");
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(String::from_utf8_lossy(&output.stdout).starts_with("time is up: "));
    assert_eq!(files(dir.path()), ["a.png"]);
}

#[test]
fn help_lists_the_exit_codes() {
    for arguments in ["--help", "render --help"] {
        let output = quietus(&PathBuf::from("."), arguments);
        assert!(output.status.success());
        assert!(String::from_utf8_lossy(&output.stdout).contains("130  stopped by Ctrl-C"));
    }
}

#[cfg(target_os = "linux")]
mod interrupts {
    use std::io::{BufRead, BufReader};
    use std::process::{Child, ChildStdout};
    use std::time::{Duration, Instant};

    use super::*;

    /// A program that runs.
    struct Running {
        child: Child,
        stdout: BufReader<ChildStdout>,
    }

    impl Running {
        fn new(dir: &Path, arguments: &str) -> Self {
            let mut command = command(dir, arguments);
            let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
            let stdout = BufReader::new(child.stdout.take().unwrap());
            Self { child, stdout }
        }

        /// Waits for the end; gives the exit code and what was said on stdout and on stderr.
        fn finish(self) -> (Option<i32>, String, String) {
            let stdout = std::io::read_to_string(self.stdout).unwrap();
            let output = self.child.wait_with_output().unwrap();
            (output.status.code(), stdout, stderr(&output))
        }
    }

    /// Starts a render without end and waits until it draws.
    fn start(dir: &Path) -> Running {
        let flags = "-o a.exr -o a.png --stats s.json --size 64x36 --sampling uniform --time 10m";
        let mut running = Running::new(dir, &format!("render {flags} --progress json"));
        let mut line = String::new();
        while !line.contains("\"event\":\"progress\"") {
            line.clear();
            assert_ne!(running.stdout.read_line(&mut line).unwrap(), 0, "the program never draws");
        }
        running
    }

    /// Whether the process of this status file has a handler for SIGINT, signal 2. It is the last that gets one.
    fn catches_interrupts(status: &str) -> bool {
        has_signal(status, "SigCgt:", 2)
    }

    fn has_signal(status: &str, kind: &str, signal: u32) -> bool {
        let mask = status.lines().find_map(|line| line.strip_prefix(kind));
        let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
        mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
    }

    fn send(signal: &str, child: &Child) {
        let status = Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap();
        assert!(status.success());
    }

    fn interrupt(child: &Child) {
        send("-INT", child);
    }

    #[test]
    fn ctrl_c_writes_what_there_is_and_says_how_far_it_came() {
        writes_what_there_is(&["-INT"]);
    }

    #[test]
    fn farms_and_closed_terminals_leave_what_there_is() {
        writes_what_there_is(&["-TERM"]);
        // The shell sends it, and the system again.
        writes_what_there_is(&["-HUP", "-HUP"]);
    }

    fn writes_what_there_is(signals: &[&str]) {
        let dir = dir();
        let running = start(dir.path());
        signals.iter().for_each(|signal| send(signal, &running.child));
        // Where whoever runs the tests ignores hangups, as `nohup` does, so must the program.
        let own = std::fs::read_to_string("/proc/self/status").unwrap();
        if signals.contains(&"-HUP") && has_signal(&own, "SigIgn:", 1) {
            send("-INT", &running.child);
        }
        let (code, said, errors) = running.finish();
        assert_eq!(code, Some(130), "{errors}");
        assert!(said.contains("stopping; the picture so far will be written"), "{said}");
        assert!(said.contains("\"stopped_by\":\"interrupt\""), "{said}");
        assert_eq!(files(dir.path()), ["a.exr", "a.png", "s.json"]);
        read_exr(&dir.path().join("a.exr")).unwrap();
        let stats = std::fs::read_to_string(dir.path().join("s.json")).unwrap();
        let stats: serde_json::Value = serde_json::from_str(&stats).unwrap();
        assert_eq!(stats["stopped_by"], "interrupt");
    }

    #[test]
    fn a_second_ctrl_c_quits_and_leaves_nothing_half_written() {
        let dir = dir();
        let mut running = start(dir.path());
        // Signals that arrive together count as one: repeated until the program is gone. It may have finished
        // writing before the second one reached it.
        let status = loop {
            if let Some(status) = running.child.try_wait().unwrap() {
                break status;
            }
            interrupt(&running.child);
        };
        assert_eq!(status.code(), Some(130));
        assert!(files(dir.path()).iter().all(|name| ["a.exr", "a.png", "s.json"].contains(&name.as_str())));
    }

    #[test]
    fn ctrl_c_while_a_scene_is_read_says_that_there_is_no_picture() {
        let dir = dir();
        // Takes minutes to read.
        std::fs::write(dir.path().join("part.pbrt"), "Identity\n".repeat(100_000)).unwrap();
        std::fs::write(dir.path().join("long.pbrt"), "Include \"part.pbrt\"\n".repeat(60_000)).unwrap();
        let running = Running::new(dir.path(), "render long.pbrt");
        let status = format!("/proc/{}/status", running.child.id());
        let start = Instant::now();
        while !catches_interrupts(&std::fs::read_to_string(&status).unwrap()) {
            assert!(start.elapsed() < Duration::from_secs(60), "the program never watches for Ctrl-C");
            std::thread::sleep(Duration::from_millis(5));
        }
        interrupt(&running.child);
        let (code, said, errors) = running.finish();
        let expected = "stopped before there was a picture to write\n";
        assert_eq!((code, said.as_str(), errors.as_str()), (Some(130), "", expected));
        assert_eq!(files(dir.path()), ["long.pbrt", "part.pbrt"]);
    }
}
