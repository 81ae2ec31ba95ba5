//! Watching a render from outside: events, files and messages while it runs.

mod common;

use std::collections::BTreeMap;
use std::io::Read;
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use common::{command, quietus, stderr, stdout};
use quietus_film::read_exr;
use serde_json::Value;

/// Waits until `done` holds.
fn wait_for(what: &str, mut done: impl FnMut() -> bool) {
    let start = Instant::now();
    while !done() {
        assert!(start.elapsed() < Duration::from_secs(60), "in vain: {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn events_have_the_documented_keys_and_no_others() {
    let dir = tempfile::tempdir().unwrap();
    let flags = "render -o a.png --size 64x36 --sampling uniform --time 0.8 --progress json";
    let output = quietus(dir.path(), flags);
    assert!(output.status.success(), "{}", stderr(&output));
    let events: Vec<Value> = stdout(&output).lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    let document = include_str!("../../../docs/terminal.md");
    let documented = |name: &str| {
        let section = document.split("\n### ").find(|s| s.starts_with(&format!("`{name}`"))).expect(name);
        let keys = section.lines().filter_map(|line| line.strip_prefix("| `")?.split('`').next());
        let mut keys: Vec<_> = keys.map(str::to_owned).chain(["event".to_owned()]).collect();
        keys.sort();
        keys
    };
    for event in &events {
        let mut keys: Vec<_> = event.as_object().unwrap().keys().cloned().collect();
        keys.sort();
        assert_eq!(keys, documented(event["event"].as_str().unwrap()), "{event}");
    }
    let names: Vec<_> = events.iter().map(|event| event["event"].as_str().unwrap()).collect();
    assert!(names.len() > 1 && names[..names.len() - 1].iter().all(|name| *name == "progress"), "{names:?}");
    let samples: Vec<_> = events.iter().map(|event| event["samples"].as_u64().unwrap()).collect();
    assert!(samples.is_sorted(), "{samples:?}");
    let end = &events[events.len() - 1];
    assert_eq!(
        (&end["event"], &end["stopped_by"], &end["wrote"][0]),
        (&"end".into(), &"time".into(), &"a.png".into())
    );
    let output = quietus(dir.path(), "render missing.glb --progress json");
    let event: Value = serde_json::from_str(stdout(&output).trim()).unwrap();
    assert_eq!((&event["event"], &event["exit_code"]), (&"error".into(), &3.into()));
}

#[test]
fn quiet_is_quiet_and_verbose_is_not() {
    let dir = tempfile::tempdir().unwrap();
    let output = quietus(dir.path(), "-q render -o a.png --size 16x16 --spp 2");
    assert!(output.status.success());
    assert_eq!((stdout(&output), stderr(&output)), (String::new(), String::new()));
    let output = quietus(dir.path(), "render -o a.png --size 16x16 --spp 2 -v");
    assert!(stderr(&output).contains("INFO"), "{}", stderr(&output));
    let output = quietus(dir.path(), "render -q -v");
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn the_picture_so_far_is_saved_whole() {
    let dir = tempfile::tempdir().unwrap();
    let flags = "render -o a.exr -o a.png --size 64x36 --sampling uniform --time 10m --save-every 0.1";
    let mut child = command(dir.path(), flags).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let file = dir.path().join("a.exr");
    wait_for("a first picture", || file.exists());
    let total = |file: &Path| read_exr(file).unwrap().0.samples.iter().map(|&n| u64::from(n)).sum::<u64>();
    let (_, metadata) = read_exr(&file).unwrap();
    assert!(metadata.iter().any(|(name, _)| name == "unfinished"), "{metadata:?}");
    let first = total(&file);
    // Whenever it is read, it is whole.
    wait_for("a later picture", || total(&file) > first);
    assert!(child.try_wait().unwrap().is_none());
    child.kill().unwrap();
    child.wait().unwrap();
}

#[cfg(unix)]
#[test]
fn a_picture_that_cannot_be_saved_is_a_warning_and_in_the_end_kept_elsewhere() {
    let (dir, elsewhere) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let gone = dir.path().join("gone");
    std::fs::create_dir(&gone).unwrap();
    let flags = "render -o gone/a.exr --size 64x36 --sampling uniform --time 2 --save-every 0.05";
    let mut command = command(dir.path(), flags);
    command.env("TMPDIR", elsewhere.path());
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    wait_for("a first picture", || gone.join("a.exr").exists());
    // Its thread may be about to put a file there.
    wait_for("an empty place", || std::fs::remove_dir_all(&gone).is_ok());
    let output = child.wait_with_output().unwrap();
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(4), "{said}");
    assert_eq!(said.matches("warning: gone/a.exr: cannot write").count(), 1, "said once: {said}");
    assert!(said.contains("the render goes on, and will try again"), "{said}");
    assert!(
        said.contains("error: gone/a.exr: cannot write") && said.contains("; the picture is kept as "),
        "{said}"
    );
    let kept = std::fs::read_dir(elsewhere.path()).unwrap().next().unwrap().unwrap().path();
    assert!(read_exr(&kept).unwrap().0.samples.iter().all(|&samples| samples > 0));
}

#[cfg(unix)]
#[test]
fn a_disk_that_is_full_ends_with_an_error_and_nothing_half_written() {
    let dir = tempfile::tempdir().unwrap();
    // No file may exceed a few blocks, and the signal that says so is ignored: writes fail as on a full disk.
    let script = format!(
        "trap '' XFSZ; ulimit -f 4; exec {} render -o a.exr --size 96x64 --spp 2",
        env!("CARGO_BIN_EXE_quietus")
    );
    let mut command = Command::new("sh");
    command.current_dir(dir.path()).env("TMPDIR", dir.path()).args(["-c", &script]);
    let output = command.output().unwrap();
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(4), "{said}");
    assert!(
        said.contains("error: a.exr: cannot write") && said.contains("nor can it be kept elsewhere"),
        "{said}"
    );
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
}

/// A picture as a viewer has it that reads what tev reads.
#[derive(Default)]
struct Shown {
    size: [usize; 2],
    channels: BTreeMap<String, Vec<f32>>,
    updates: usize,
}

/// Takes a message apart.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        let (head, rest) = self.0.split_first_chunk().expect("a field");
        self.0 = rest;
        *head
    }

    fn int(&mut self) -> usize {
        i32::from_le_bytes(self.bytes()).try_into().unwrap()
    }

    fn text(&mut self) -> String {
        let end = self.0.iter().position(|&byte| byte == 0).expect("an end");
        let text = String::from_utf8(self.0[..end].to_vec()).unwrap();
        self.0 = &self.0[end + 1..];
        text
    }
}

impl Shown {
    /// Reads messages until the sender hangs up.
    fn read(mut stream: TcpStream) -> Self {
        let mut shown = Self::default();
        let mut length = [0; 4];
        while stream.read_exact(&mut length).is_ok() {
            let mut message = vec![0; u32::from_le_bytes(length) as usize - 4];
            stream.read_exact(&mut message).unwrap();
            shown.take(Fields(&message));
        }
        shown
    }

    fn take(&mut self, mut fields: Fields<'_>) {
        let [kind, focus] = fields.bytes();
        assert_eq!((focus, fields.text().as_str()), (0, "built-in scene"));
        match kind {
            4 => {
                self.size = [fields.int(), fields.int()];
                let pixels = self.size[0] * self.size[1];
                let names = (0..fields.int()).map(|_| fields.text());
                self.channels = names.map(|name| (name, vec![0.0; pixels])).collect();
                assert!(fields.0.is_empty());
            }
            6 => self.update(fields),
            other => panic!("message {other}"),
        }
    }

    fn update(&mut self, mut fields: Fields<'_>) {
        self.updates += 1;
        let names: Vec<_> = (0..fields.int()).map(|_| fields.text()).collect();
        let [x, y, width, height] = [(); 4].map(|()| fields.int());
        let mut longs = || -> Vec<usize> {
            names.iter().map(|_| i64::from_le_bytes(fields.bytes()).try_into().unwrap()).collect()
        };
        let (offsets, strides) = (longs(), longs());
        let values: Vec<f32> =
            fields.0.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
        for (c, name) in names.iter().enumerate() {
            let channel = self.channels.get_mut(name).expect("a channel that was announced");
            for pixel in 0..width * height {
                let at = (y + pixel / width) * self.size[0] + x + pixel % width;
                channel[at] = values[offsets[c] + pixel * strides[c]];
            }
        }
    }
}

#[test]
fn tev_ends_up_with_the_finished_picture() {
    let dir = tempfile::tempdir().unwrap();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let viewer = std::thread::spawn({
        let listener = listener.try_clone().unwrap();
        move || Shown::read(listener.accept().unwrap().0)
    });
    let address = listener.local_addr().unwrap();
    let flags = "render -o a.exr --size 160x90 --crop 7,3,140,90 --sampling uniform --time 1.5";
    let output = quietus(dir.path(), &format!("{flags} --tev {address}"));
    assert!(output.status.success() && stderr(&output).is_empty(), "{}", stderr(&output));
    let shown = viewer.join().unwrap();
    let picture = read_exr(&dir.path().join("a.exr")).unwrap().0;
    assert_eq!(shown.size, [133, 87]);
    // 3 x 2 squares at the end, and some of them before.
    assert!(shown.updates > 6, "{} updates", shown.updates);
    let channel = |c: usize| picture.beauty.iter().map(|pixel| pixel[c]).collect::<Vec<_>>();
    for (c, name) in ["R", "G", "B", "A"].into_iter().enumerate() {
        assert_eq!(shown.channels[name], channel(c), "{name}");
    }
    assert_eq!(shown.channels["error"], picture.error);
    assert_eq!(shown.channels["samples"], picture.samples.iter().map(|&n| n as f32).collect::<Vec<_>>());
}

#[test]
fn a_viewer_that_is_not_there_is_a_warning() {
    let dir = tempfile::tempdir().unwrap();
    let address = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let output = quietus(
        dir.path(),
        &format!("render -o a.png --size 32x18 --sampling uniform --time 1 --tev {address}"),
    );
    let said = stderr(&output);
    assert!(output.status.success(), "{said}");
    assert_eq!(said.matches(&format!("warning: tev at {address}: ")).count(), 1, "{said}");
    assert!(said.contains("the render goes on"), "{said}");
    assert!(dir.path().join("a.png").exists());
}

#[test]
fn a_trace_has_every_threads_passes_rebuilds_and_what_came_before() {
    let dir = tempfile::tempdir().unwrap();
    let flags =
        "render -o a.png --size 64x48 --target-error 0.02 --max-samples 64 --threads 3 --trace t.json";
    let output = quietus(dir.path(), flags);
    assert!(output.status.success() && stderr(&output).is_empty(), "{}", stderr(&output));
    let trace: Vec<Value> =
        serde_json::from_slice(&std::fs::read(dir.path().join("t.json")).unwrap()).unwrap();
    let names = trace.iter().filter(|event| event["ph"] == "M");
    let names: BTreeMap<u64, String> =
        names.map(|e| (e["tid"].as_u64().unwrap(), e["args"]["name"].as_str().unwrap().to_owned())).collect();
    let threads: Vec<&str> = names.values().map(String::as_str).collect();
    for thread in ["main", "render-0", "render-1", "render-2"] {
        assert!(threads.contains(&thread), "{thread}: {threads:?}");
    }
    let slices = |name: &str| -> Vec<&Value> {
        trace.iter().filter(|e| e["ph"] == "X" && e["name"].as_str().unwrap().starts_with(name)).collect()
    };
    for name in ["open", "parse", "build", "render", "write", "pass 0", "rebuild"] {
        assert!(!slices(name).is_empty(), "{name}");
    }
    // Passes lie within the render, and hold all samples.
    let number = |event: &Value, key: &str| event[key].as_f64().unwrap();
    let render = slices("render")[0];
    let (begin, end) = (number(render, "ts"), number(render, "ts") + number(render, "dur"));
    for pass in slices("pass") {
        let (from, to) = (number(pass, "ts"), number(pass, "ts") + number(pass, "dur"));
        assert!(from >= begin && to <= end, "{pass} in {render}");
    }
    let samples: u64 = slices("pass").iter().map(|pass| pass["args"]["samples"].as_u64().unwrap()).sum();
    let stats = quietus(dir.path(), &format!("{flags} --stats s.json"));
    assert!(stats.status.success());
    let stats: Value = serde_json::from_slice(&std::fs::read(dir.path().join("s.json")).unwrap()).unwrap();
    assert_eq!(
        (Some(samples), Some(slices("rebuild").len() as u64)),
        (stats["samples"].as_u64(), stats["rebuilds"].as_u64())
    );
}

#[cfg(unix)]
#[test]
fn a_trace_that_cannot_be_written_is_told_before_or_after_the_render() {
    let dir = tempfile::tempdir().unwrap();
    let output = quietus(dir.path(), "render -o a.png --size 8x8 --spp 1 --trace no/such/t.json");
    assert_eq!(output.status.code(), Some(4));
    assert!(
        stderr(&output).starts_with("error: no/such/t.json: cannot write")
            && !dir.path().join("a.png").exists()
    );
    let flags = "render -o a.png --size 64x36 --sampling uniform --time 1 --trace gone/t.json";
    let gone = dir.path().join("gone");
    std::fs::create_dir(&gone).unwrap();
    let child = command(dir.path(), flags).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    wait_for("a trace in the making", || std::fs::read_dir(&gone).unwrap().next().is_some());
    std::fs::remove_dir_all(&gone).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(4), "{}", stderr(&output));
    assert!(
        stderr(&output).contains("error: gone/t.json: cannot write") && dir.path().join("a.png").exists()
    );
}

#[cfg(target_os = "linux")]
mod terminal {
    use std::fs::{File, OpenOptions};
    use std::os::fd::OwnedFd;
    use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};

    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    use rustix::termios::{Winsize, tcsetwinsize};

    use super::*;

    /// A terminal with a program in it.
    struct Terminal {
        master: OwnedFd,
        output: Receiver<Vec<u8>>,
        screen: vt100::Parser,
    }

    impl Terminal {
        /// Starts `command` in a terminal of 24 rows and so many columns.
        fn start(mut command: Command, columns: u16) -> (Self, std::process::Child) {
            let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
            grantpt(&master).unwrap();
            unlockpt(&master).unwrap();
            let name = ptsname(&master, Vec::new()).unwrap().into_string().unwrap();
            let slave = OpenOptions::new().read(true).write(true).open(name).unwrap();
            let mut reader = File::from(master.try_clone().unwrap());
            let (sender, output) = channel();
            std::thread::spawn(move || {
                let mut bytes = [0; 4096];
                // Fails when the program is gone.
                while let Ok(count) = reader.read(&mut bytes) {
                    if sender.send(bytes[..count].to_vec()).is_err() {
                        break;
                    }
                }
            });
            let mut terminal = Self { master, output, screen: vt100::Parser::new(24, columns, 0) };
            terminal.resize(columns);
            command.stdin(Stdio::null()).stdout(slave.try_clone().unwrap()).stderr(slave);
            let child = command.env("TERM", "xterm-256color").env_remove("NO_COLOR").spawn().unwrap();
            (terminal, child)
        }

        fn resize(&mut self, columns: u16) {
            let size = Winsize { ws_row: 24, ws_col: columns, ws_xpixel: 0, ws_ypixel: 0 };
            tcsetwinsize(&self.master, size).unwrap();
            self.screen.screen_mut().set_size(24, columns);
        }

        /// Reads on until the lines on the screen are as `wanted`.
        fn wait(&mut self, what: &str, wanted: impl Fn(&[String]) -> bool) -> Vec<String> {
            let start = Instant::now();
            loop {
                let lines: Vec<String> =
                    self.screen.screen().contents().lines().map(|l| l.trim_end().to_owned()).collect();
                if wanted(&lines) {
                    return lines;
                }
                assert!(start.elapsed() < Duration::from_secs(60), "in vain: {what}: {lines:#?}");
                match self.output.recv_timeout(Duration::from_secs(1)) {
                    Ok(bytes) => self.screen.process(&bytes),
                    Err(RecvTimeoutError::Timeout) => {}
                    Err(RecvTimeoutError::Disconnected) => panic!("ended without {what}: {lines:#?}"),
                }
            }
        }
    }

    #[test]
    fn the_bar_stays_in_place_when_the_terminal_changes_and_warnings_come() {
        let dir = tempfile::tempdir().unwrap();
        let nowhere = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
        let flags = format!("render -o a.png --size 64x36 --sampling uniform --time 5m --tev {nowhere}");
        let (mut terminal, mut child) = Terminal::start(command(dir.path(), &flags), 110);
        let is_bar = |line: &String| line.contains("of the time");
        let lines = terminal.wait("a bar", |lines| lines.iter().any(is_bar));
        assert!(lines[0].starts_with('▕'), "{lines:#?}");
        let lines =
            terminal.wait("a warning below the bar", |lines| lines.iter().any(|l| l.contains("warning")));
        assert!(is_bar(&lines[0]) && lines[1].contains("Mrays/s") && lines[2].starts_with("warning: tev at"));
        assert_eq!(lines.len(), 3, "{lines:#?}");
        for columns in [40, 24, 90] {
            terminal.resize(columns);
            let fits = |lines: &[String]| {
                lines.len() == 3
                    && is_bar(&lines[0])
                    && lines.iter().all(|l| l.chars().count() < usize::from(columns))
                    && (columns < 60 || lines[0].ends_with("left"))
            };
            terminal.wait("three lines that fit", fits);
        }
        let status = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        assert!(status.success());
        let lines = terminal.wait("the end", |lines| lines.iter().any(|line| line.starts_with("wrote")));
        assert!(!lines.iter().any(is_bar), "{lines:#?}");
        // What was said stays, each once.
        for word in ["warning: tev at", "stopping; the picture so far"] {
            assert_eq!(lines.iter().filter(|line| line.starts_with(word)).count(), 1, "{lines:#?}");
        }
        assert_eq!(child.wait().unwrap().code(), Some(130));
    }
}
