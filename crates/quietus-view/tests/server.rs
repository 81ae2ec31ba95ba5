//! The server from outside: who may come in, what they get, and what bad ones achieve, which is nothing.

use std::collections::HashMap;
use std::io::{Read, Write};
use std::net::{IpAddr, Ipv4Addr, TcpStream};
use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use glam::Vec3;
use quietus_film::{Layout, Window};
use quietus_render::{Control, Goal, Live, Machinery, RenderSettings, Sampling, Tracer, Watched, render};
use quietus_trace::tile::{PixelWork, Sample, SampleSink, TileCounts};
use quietus_view::{Options, ReferencePicture, Session, Token, View, Wish};
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};

const TOKEN: &str = "a-token-for-tests-0";
const SIZE: [u32; 2] = [44, 20];
const TILES: usize = 6 * 3;

fn options(port: u16) -> Options {
    let reference =
        ReferencePicture { size: [1, 2], pixels: vec![[1.0, 0.5, 0.25, 1.0], [1e9, -1.0, 0.0, 0.0]] };
    let token = Some(Token::chosen(TOKEN).unwrap());
    Options { bind: IpAddr::V4(Ipv4Addr::LOCALHOST), port, token, reference: Some(reference) }
}

/// Address and port.
fn host(view: &View) -> String {
    view.address().trim_start_matches("http://").split('/').next().unwrap().to_owned()
}

/// Status and whole text of the answer to a request.
fn ask(host: &str, path: &str, headers: &str) -> (u16, String) {
    let mut stream = TcpStream::connect(host).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\n{headers}Connection: close\r\n\r\n").unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    let text = String::from_utf8_lossy(&answer).into_owned();
    (text.split(' ').nth(1).and_then(|code| code.parse().ok()).unwrap_or(0), text)
}

type Socket = WebSocket<TcpStream>;

/// A websocket with these headers instead of, or besides, the usual ones.
fn socket(host: &str, token: &str, headers: &[(&'static str, &str)]) -> Result<Socket, String> {
    let mut request = format!("ws://{host}/{token}/ws").into_client_request().unwrap();
    for (name, value) in headers {
        request.headers_mut().insert(*name, value.parse().unwrap());
    }
    let stream = TcpStream::connect(host).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    tungstenite::client(request, stream).map(|(socket, _)| socket).map_err(|error| error.to_string())
}

fn send(socket: &mut Socket, request: &str) {
    socket.send(Message::text(request)).unwrap();
}

/// Reads until `found` has something to say.
fn read<T>(socket: &mut Socket, mut found: impl FnMut(&Message) -> Option<T>) -> T {
    loop {
        let message = socket.read().expect("the server goes on talking");
        if let Some(value) = found(&message) {
            return value;
        }
    }
}

/// Layer and indices of a batch of tiles.
fn tiles(message: &Message) -> Option<(u8, Vec<u32>)> {
    let Message::Binary(bytes) = message else { return None };
    let word = |i: usize| u32::from_le_bytes(bytes[4 * i..][..4].try_into().unwrap());
    (bytes[0] == 1).then(|| (bytes[1], (0..word(2) as usize).map(|i| word(3 + i)).collect()))
}

/// Reads and takes tiles of a layer until all have come.
fn all_tiles(socket: &mut Socket, layer: u8) {
    let mut seen = [false; TILES];
    while seen.contains(&false) {
        let (kind, indices) = read(socket, tiles);
        send(socket, r#"{"do":"ack"}"#);
        indices.iter().filter(|_| kind == layer).for_each(|&tile| seen[tile as usize] = true);
    }
}

/// Whether the server closes the connection.
fn is_closed(socket: &mut Socket) -> bool {
    let end = Instant::now() + Duration::from_secs(20);
    while Instant::now() < end {
        match socket.read() {
            Err(_) | Ok(Message::Close(_)) => return true,
            Ok(_) => (),
        }
    }
    false
}

/// A number below 16 that looks random: what repeated itself would have no noise left one day, and the render an end.
fn hash(words: [u32; 4]) -> u32 {
    let mixed = words.iter().fold(0_u64, |mixed, &word| {
        (mixed ^ u64::from(word)).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29)
    });
    (mixed >> 40) as u32 % 16
}

/// Draws noise; a millisecond for each tile.
struct Slow;

impl Tracer for Slow {
    fn render_tile(&self, work: &[PixelWork], sink: &mut impl SampleSink) -> TileCounts {
        std::thread::sleep(Duration::from_millis(1));
        for run in work {
            for index in run.first..run.first + run.count {
                let value = hash([run.x, run.y, index, run.replicate.into()]) as f32;
                let sample =
                    Sample { radiance: Vec3::splat(value), alpha: 1.0, depth: 3.0, ..Sample::default() };
                sink.add(run, index, &sample);
            }
        }
        TileCounts::default()
    }
}

fn settings() -> RenderSettings {
    RenderSettings {
        frame: SIZE,
        window: Window { x0: 0, y0: 0, x1: SIZE[0], y1: SIZE[1] },
        sampling: Sampling::Quietus,
        goal: Goal::TargetError(1e-9),
        min_samples: 4,
        // Without end for any machine.
        max_samples: u32::MAX,
        time_limit: None,
        threads: NonZeroUsize::new(2).unwrap(),
        machinery: Machinery::default(),
        weights: None,
        aov_noise: [None; 3],
    }
}

/// What a test sees of a render that goes on until it has seen enough.
struct Seen<'a> {
    host: String,
    view: &'a Mutex<View>,
    samples: &'a AtomicU64,
}

impl Seen<'_> {
    /// Waits until the render has drawn more.
    fn goes_on(&self) {
        let (before, end) = (self.samples.load(Ordering::Relaxed), Instant::now() + Duration::from_secs(20));
        while self.samples.load(Ordering::Relaxed) <= before {
            assert!(Instant::now() < end, "the render stands still");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    fn wish(&self) -> Option<Wish> {
        let end = Instant::now() + Duration::from_secs(20);
        while Instant::now() < end {
            if let Some(wish) = self.view.lock().unwrap().next_wish(Duration::ZERO) {
                return Some(wish);
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        None
    }
}

/// Ends the render also where the test fails.
struct Stop<'a>(&'a AtomicBool, &'a Live);

impl Drop for Stop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
        self.1.resume();
    }
}

fn with_render(test: impl FnOnce(&Seen<'_>)) {
    with_tracer(&Slow, test);
}

fn with_tracer(tracer: &impl Tracer, test: impl FnOnce(&Seen<'_>)) {
    let mut view = View::start(options(0)).unwrap();
    let layout = Layout::new(SIZE, settings().window, 2).unwrap();
    let live = Arc::new(Live::new(&layout));
    let session = Session {
        title: "test".into(),
        frame: SIZE,
        window: [0, 0, SIZE[0], SIZE[1]],
        sampling: "quietus".into(),
        has_tree: true,
        can_change_noise: true,
        can_restart: true,
        outputs: Vec::new(),
    };
    view.begin(session, layout, Arc::clone(&live));
    let host = host(&view);
    let (view, cancel, samples) = (Mutex::new(view), AtomicBool::new(false), AtomicU64::new(0));
    std::thread::scope(|scope| {
        let _stop = Stop(&cancel, &live);
        scope.spawn(|| {
            let mut watch = |watched: &Watched<'_>| {
                samples.store(watched.progress.samples, Ordering::Relaxed);
                view.lock().unwrap().show(watched, &live);
            };
            let control = &mut Control { cancel: &cancel, watch: &mut watch, live: Some(&live) };
            render(tracer, &settings(), control).unwrap();
        });
        test(&Seen { host, view: &view, samples: &samples });
    });
}

#[test]
fn only_who_knows_the_token_and_comes_from_our_page_may_come_in() {
    let view = View::start(options(0)).unwrap();
    let host = host(&view);
    let own = format!("Host: {host}\r\n");
    for file in ["", "main.js", "style.css", "reference"] {
        let (status, text) = ask(&host, &format!("/{TOKEN}/{file}"), &own);
        assert_eq!(status, 200, "{file}");
        let head = text.to_ascii_lowercase();
        for guard in ["content-security-policy: default-src 'none'", "x-frame-options: deny", "nosniff"] {
            assert!(head.contains(guard), "{file}: {guard}");
        }
        for path in [format!("/{file}"), format!("/wrong/{file}"), format!("/{}/{file}", &TOKEN[1..])] {
            assert_eq!(ask(&host, &path, &own).0, 403, "{path}");
        }
        for foreign in ["Host: evil.example\r\n", "Host: 127.0.0.1.evil.example:80\r\n", ""] {
            assert_eq!(ask(&host, &format!("/{TOKEN}/{file}"), foreign).0, 403, "{foreign}");
        }
        let origin = format!("{own}Origin: http://evil.example\r\n");
        assert_eq!(ask(&host, &format!("/{TOKEN}/{file}"), &origin).0, 403);
    }
    for path in ["../Cargo.toml", "..%2fCargo.toml", "%2e%2e/%2e%2e/etc/passwd", "index.html/x", "a.exr"] {
        assert_eq!(ask(&host, &format!("/{TOKEN}/{path}"), &own).0, 404, "{path}");
    }
    let origin = format!("http://{host}");
    assert!(socket(&host, TOKEN, &[("origin", &origin)]).is_ok());
    assert!(socket(&host, "wrong", &[("origin", &origin)]).unwrap_err().contains("403"));
    assert!(socket(&host, TOKEN, &[("origin", "http://evil.example")]).unwrap_err().contains("403"));
    assert!(socket(&host, TOKEN, &[("origin", "null")]).unwrap_err().contains("403"));
    let rebound = [("host", "evil.example"), ("origin", "http://evil.example")];
    assert!(socket(&host, TOKEN, &rebound).unwrap_err().contains("403"));
}

#[test]
fn a_port_in_use_is_named() {
    let view = View::start(options(0)).unwrap();
    let port = host(&view).split(':').next_back().unwrap().parse().unwrap();
    let error = View::start(options(port)).err().expect("it is in use").to_string();
    assert!(
        error.contains(&format!("127.0.0.1:{port}")) && error.contains("another program uses that port"),
        "{error}"
    );
}

#[test]
fn every_page_gets_every_tile_at_its_own_pace() {
    with_render(|seen| {
        let [mut quick, mut slow] = [(); 2].map(|()| socket(&seen.host, TOKEN, &[]).unwrap());
        let text = read(&mut quick, |message| message.to_text().ok().map(str::to_owned));
        assert!(text.contains(r#""is":"session""#) && text.contains(r#""reference":[1,2]"#), "{text}");
        all_tiles(&mut quick, 0);
        send(&mut quick, r#"{"do":"look","layers":["samples","depth"],"tree":true}"#);
        all_tiles(&mut quick, 1);
        read(&mut quick, |message| matches!(message, Message::Binary(bytes) if bytes[0] == 3).then_some(()));
        // The other one never says that it took a batch: it gets two, then words alone.
        let (mut batches, mut status) = (0, 0);
        while status < 8 {
            let message = slow.read().unwrap();
            batches += u32::from(tiles(&message).is_some());
            status += u32::from(message.to_text().is_ok_and(|text| text.contains(r#""is":"status""#)));
        }
        assert_eq!(batches, 2);
        seen.goes_on();
    });
}

#[test]
fn the_values_of_a_pixel_come_exactly() {
    with_render(|seen| {
        let mut page = socket(&seen.host, TOKEN, &[]).unwrap();
        all_tiles(&mut page, 0);
        send(&mut page, r#"{"do":"probe","x":43,"y":19}"#);
        let text = read(&mut page, |message| {
            message.to_text().ok().filter(|text| text.contains(r#""is":"pixel""#)).map(str::to_owned)
        });
        assert!(text.contains(r#""x":43,"y":19"#) && text.contains(r#""depth":3.0"#), "{text}");
        // Outside of the picture there is nothing to tell, and nothing to break.
        send(&mut page, r#"{"do":"probe","x":44,"y":4000000000}"#);
        seen.goes_on();
    });
}

#[test]
fn who_sends_nonsense_is_shown_out_and_the_render_goes_on() {
    with_render(|seen| {
        let nonsense = [
            Message::text("nonsense"),
            Message::text(r#"{"do":"open","file":"/etc/passwd"}"#),
            Message::text(r#"{"do":"crop","window":[-1,0,1,1]}"#),
            Message::text(r#"{"do":"stop","and":"more"}"#),
            Message::binary(vec![0; 100]),
            Message::text("x".repeat(3 << 20)),
        ];
        for message in nonsense {
            let mut bad = socket(&seen.host, TOKEN, &[]).unwrap();
            // It may be shown out while it is still sending.
            let _ = bad.send(message.clone());
            assert!(is_closed(&mut bad), "{message:.40}");
        }
        // Some do not even speak the language, some vanish in the middle of a word.
        for bytes in [&b"\x00\xff\xfe garbage \r\n\r\n"[..], b"GET / HTTP/1.1\r\nHost: a", &[b'A'; 100_000]] {
            let mut stream = TcpStream::connect(&seen.host).unwrap();
            let _ = stream.write_all(bytes);
        }
        assert_eq!(seen.view.lock().unwrap().next_wish(Duration::ZERO), None, "nothing of it was followed");
        seen.goes_on();
        let mut good = socket(&seen.host, TOKEN, &[]).unwrap();
        all_tiles(&mut good, 0);
    });
}

#[test]
fn idle_connections_take_no_place_for_ever_and_pages_are_limited() {
    with_render(|seen| {
        let pages: Vec<_> = (0..16).map(|_| socket(&seen.host, TOKEN, &[]).unwrap()).collect();
        let end = Instant::now() + Duration::from_secs(20);
        while seen.view.lock().unwrap().clients() < 16 {
            assert!(Instant::now() < end, "pages are counted");
            std::thread::sleep(Duration::from_millis(5));
        }
        assert!(socket(&seen.host, TOKEN, &[]).unwrap_err().contains("503"));
        drop(pages);
        while seen.view.lock().unwrap().clients() > 0 {
            assert!(Instant::now() < end, "pages that vanish are forgotten");
            std::thread::sleep(Duration::from_millis(5));
        }
        all_tiles(&mut socket(&seen.host, TOKEN, &[]).unwrap(), 0);
    });
}

#[test]
fn wishes_reach_the_render() {
    with_render(|seen| {
        let mut page = socket(&seen.host, TOKEN, &[]).unwrap();
        send(&mut page, r#"{"do":"noise","percent":0.5}"#);
        assert_eq!(seen.wish(), Some(Wish::Noise(0.5)));
        send(&mut page, r#"{"do":"noise","percent":-1}"#);
        send(&mut page, r#"{"do":"crop","window":[1,2,3,4]}"#);
        let window = Window { x0: 1, y0: 2, x1: 3, y1: 4 };
        assert_eq!(seen.wish(), Some(Wish::Crop(Some(window))));
        send(&mut page, r#"{"do":"move","orbit":[0.5,0],"pan":[0,0],"dolly":0}"#);
        assert!(matches!(seen.wish(), Some(Wish::Move(motion)) if motion.orbit == [0.5, 0.0]));
        send(&mut page, r#"{"do":"pause"}"#);
        read(&mut page, |message| message.to_text().ok()?.contains(r#""state":"paused""#).then_some(()));
        // A visit may have been under way.
        std::thread::sleep(Duration::from_millis(200));
        let before = seen.samples.load(Ordering::Relaxed);
        std::thread::sleep(Duration::from_millis(200));
        assert_eq!(seen.samples.load(Ordering::Relaxed), before);
        send(&mut page, r#"{"do":"resume"}"#);
        seen.goes_on();
    });
}

/// As [`Slow`], and remembers when each tile was drawn first.
#[derive(Default)]
struct Timed(Mutex<HashMap<u32, Instant>>);

impl Tracer for Timed {
    fn render_tile(&self, work: &[PixelWork], sink: &mut impl SampleSink) -> TileCounts {
        let counts = Slow.render_tile(work, sink);
        let tile = work[0].y / 8 * SIZE[0].div_ceil(8) + work[0].x / 8;
        self.0.lock().unwrap().entry(tile).or_insert_with(Instant::now);
        counts
    }
}

/// `cargo test --release -p quietus-view --test server -- --ignored --nocapture` prints it.
#[test]
#[ignore = "a measurement: time from a tile's samples to the browser's end of the websocket"]
fn latency_of_tiles() {
    let mut latencies = Vec::new();
    for _ in 0..20 {
        let tracer = Timed::default();
        with_tracer(&tracer, |seen| {
            let mut page = socket(&seen.host, TOKEN, &[]).unwrap();
            let mut arrived = HashMap::new();
            while arrived.len() < TILES {
                let (_, indices) = read(&mut page, tiles);
                indices.iter().for_each(|&tile| _ = arrived.entry(tile).or_insert_with(Instant::now));
                send(&mut page, r#"{"do":"ack"}"#);
            }
            let drawn = tracer.0.lock().unwrap();
            latencies.extend(arrived.iter().map(|(tile, at)| at.duration_since(drawn[tile]).as_secs_f64()));
        });
    }
    latencies.sort_by(f64::total_cmp);
    let quantile = |share: f64| 1e3 * latencies[((latencies.len() - 1) as f64 * share) as usize];
    println!("median {:.0} ms, 95 % {:.0} ms, most {:.0} ms", quantile(0.5), quantile(0.95), quantile(1.0));
}
