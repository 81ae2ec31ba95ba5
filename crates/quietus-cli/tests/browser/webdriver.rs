//! As much of WebDriver (W3C 2018) as these tests need: chromedriver in a process of its own, JSON over HTTP.
//!
//! The crates that speak all of it bring some sixty others along.

use std::io::{BufRead, BufReader, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

/// What makes Chromium run anywhere, and alone.
const FLAGS: [&str; 9] = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
];

/// How long anything on a page may take.
const PATIENCE: Duration = Duration::from_secs(30);

/// A chromedriver; it ends, with its browsers, when this is dropped.
pub(crate) struct Driver {
    process: Child,
    port: u16,
}

impl Driver {
    /// Starts it. `None` where it is not installed.
    pub(crate) fn start() -> Option<Self> {
        let mut process = Command::new("chromedriver")
            .arg("--port=0")
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .ok()?;
        let lines = BufReader::new(process.stdout.take().expect("it is piped")).lines();
        let port = lines
            .map_while(Result::ok)
            .find_map(|line| line.split_once("successfully on port ")?.1.trim_end_matches('.').parse().ok());
        Some(Self { process, port: port.expect("chromedriver says its port") })
    }

    fn send(&self, method: &str, path: &str, body: &Value) -> Result<Value, String> {
        let body = if method == "POST" { body.to_string() } else { String::new() };
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).map_err(|error| error.to_string())?;
        stream.set_read_timeout(Some(2 * PATIENCE)).expect("a time above 0");
        let head = format!(
            "{method} {path} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nContent-Type: application/json\r\n\
             Content-Length: {}\r\nConnection: close\r\n\r\n",
            self.port,
            body.len()
        );
        stream.write_all(format!("{head}{body}").as_bytes()).map_err(|error| error.to_string())?;
        let (status, body) =
            read_answer(BufReader::new(stream)).map_err(|error| format!("{method} {path}: {error}"))?;
        let mut value: Value = serde_json::from_slice(&body).map_err(|error| format!("{status}: {error}"))?;
        match status.starts_with("HTTP/1.1 200") {
            true => Ok(value["value"].take()),
            false => Err(format!("{method} {path}: {}", value["value"]["message"])),
        }
    }
}

/// First line and body. The driver keeps its connections open: only the length says where an answer ends.
fn read_answer(mut stream: impl BufRead) -> std::io::Result<(String, Vec<u8>)> {
    let (mut status, mut length) = (String::new(), 0);
    stream.read_line(&mut status)?;
    loop {
        let mut line = String::new();
        stream.read_line(&mut line)?;
        match line.trim_end().split_once(':') {
            Some((name, value)) if name.eq_ignore_ascii_case("content-length") => {
                length = value.trim().parse().map_err(std::io::Error::other)?;
            }
            Some(_) => (),
            None => break,
        }
    }
    let mut body = vec![0; length];
    stream.read_exact(&mut body)?;
    Ok((status, body))
}

impl Drop for Driver {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// A browser with one page.
pub(crate) struct Browser<'a> {
    driver: &'a Driver,
    path: String,
    /// Its profile: new and empty.
    _profile: tempfile::TempDir,
}

impl<'a> Browser<'a> {
    /// Opens a window of that size.
    pub(crate) fn open(driver: &'a Driver, [width, height]: [u32; 2]) -> Self {
        let profile = tempfile::tempdir().expect("a temporary directory");
        let mut flags: Vec<String> = FLAGS.map(str::to_owned).to_vec();
        flags.push(format!("--user-data-dir={}", profile.path().display()));
        flags.push(format!("--window-size={width},{height}"));
        let options = json!({ "args": flags });
        let wanted = json!({ "capabilities": { "alwaysMatch": { "goog:chromeOptions": options } } });
        let session = driver.send("POST", "/session", &wanted).expect("a browser starts");
        let path = format!("/session/{}", session["sessionId"].as_str().expect("a session has a name"));
        Self { driver, path, _profile: profile }
    }

    fn post(&self, command: &str, body: Value) -> Value {
        self.driver
            .send("POST", &format!("{}/{command}", self.path), &body)
            .unwrap_or_else(|error| panic!("{error}"))
    }

    /// Goes to an address.
    pub(crate) fn go(&self, address: &str) {
        self.post("url", json!({ "url": address }));
    }

    /// What a function of this body returns in the page; promises are waited for.
    pub(crate) fn run(&self, body: &str) -> Value {
        self.post("execute/sync", json!({ "script": body, "args": [] }))
    }

    /// Waits until an expression is true in the page.
    pub(crate) fn wait(&self, expression: &str) {
        let end = Instant::now() + PATIENCE;
        while self.run(&format!("return Boolean({expression})")) != Value::Bool(true) {
            let text = || self.run("return document.body.innerText");
            assert!(Instant::now() < end, "never became true: {expression}; the page says: {}", text());
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Clicks what a selector names, as a mouse does: it must be there to be clicked.
    pub(crate) fn click(&self, selector: &str) {
        let find = json!({ "using": "css selector", "value": selector });
        let element = self.post("element", find);
        let name = element.as_object().and_then(|object| object.values().next()).and_then(Value::as_str);
        let name = name.unwrap_or_else(|| panic!("{selector} is not on the page")).to_owned();
        self.post(&format!("element/{name}/click"), json!({}));
    }

    /// Types keys into what has the focus.
    pub(crate) fn keys(&self, keys: &str) {
        let down_up = |key: char| {
            [
                json!({ "type": "keyDown", "value": key.to_string() }),
                json!({ "type": "keyUp", "value": key.to_string() }),
            ]
        };
        let actions: Vec<Value> = keys.chars().flat_map(down_up).collect();
        self.post("actions", json!({ "actions": [{ "type": "key", "id": "keys", "actions": actions }] }));
    }

    /// Drags the mouse from one point of the page to another, in five steps.
    pub(crate) fn drag(&self, from: [i64; 2], to: [i64; 2]) {
        let place = |i: i64, axis: usize| from[axis] + (to[axis] - from[axis]) * i / 5;
        let moved = |i| json!({ "type": "pointerMove", "duration": 20, "x": place(i, 0), "y": place(i, 1) });
        let mut actions = vec![moved(0), json!({ "type": "pointerDown", "button": 0 })];
        actions.extend((1..=5).map(moved));
        actions.push(json!({ "type": "pointerUp", "button": 0 }));
        self.post(
            "actions",
            json!({ "actions": [{ "type": "pointer", "id": "mouse", "actions": actions }] }),
        );
    }

    /// Spreads two fingers on both sides of a point of the page, from one distance of it to another, in five steps.
    pub(crate) fn spread(&self, middle: [i64; 2], from: i64, to: i64) {
        let finger = |side: i64| {
            let x = |i: i64| middle[0] + side * (from + (to - from) * i / 5);
            let moved = |i| json!({ "type": "pointerMove", "duration": 20, "x": x(i), "y": middle[1] });
            let mut actions = vec![moved(0), json!({ "type": "pointerDown", "button": 0 })];
            actions.extend((1..=5).map(moved));
            actions.push(json!({ "type": "pointerUp", "button": 0 }));
            let kind = json!({ "pointerType": "touch" });
            json!({ "type": "pointer", "id": format!("finger {side}"), "parameters": kind, "actions": actions })
        };
        self.post("actions", json!({ "actions": [finger(-1), finger(1)] }));
    }

    /// The page as a PNG, in base64.
    pub(crate) fn screenshot(&self) -> String {
        let shot = self.driver.send("GET", &format!("{}/screenshot", self.path), &Value::Null);
        shot.expect("a picture of the page").as_str().unwrap_or_default().to_owned()
    }
}

impl Drop for Browser<'_> {
    fn drop(&mut self) {
        let _ = self.driver.send("DELETE", &self.path, &Value::Null);
    }
}
