//! `--tev`: the picture as it converges, in the viewer tev (<https://github.com/Tom94/tev>) by its protocol over TCP.
//!
//! A message is its length in bytes, itself included, as a 32-bit integer, a byte that says what it is, and its
//! fields; numbers are little-endian, texts end with a zero byte. `CreateImage` opens a picture,
//! `UpdateImageV3` replaces a rectangle of it.

use std::io::{self, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

use quietus_film::{Picture, Window};

use super::courier::Recipient;
use crate::say;

/// The port tev listens at.
const PORT: u16 = 14158;
/// A viewer on this or a near machine answers in that time.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(2);
/// A viewer that takes nothing for so long is given up, so that a render can end.
const WRITE_TIMEOUT: Duration = Duration::from_secs(5);
/// Between attempts to reach it.
const RETRY_INTERVAL: Duration = Duration::from_secs(5);
/// Side of the squares that are sent when anything in them has changed: few messages, and little that is the same.
const BLOCK: u32 = 64;

const CREATE_IMAGE: u8 = 4;
const UPDATE_IMAGE_V3: u8 = 6;
const CHANNELS: [&str; 6] = ["R", "G", "B", "A", "error", "samples"];

/// The address with the port that tev has by default, where none is given.
pub(super) fn parse_address(text: &str) -> Result<String, String> {
    let (host, port) = match text.rsplit_once(':') {
        // Several colons are an IPv6 address; brackets set it off from a port.
        Some((host, _)) if host.contains(':') && !host.ends_with(']') => (format!("[{text}]"), PORT),
        Some((host, port)) => {
            (host.to_owned(), port.parse().map_err(|_| "expected HOST:PORT, such as localhost:14158")?)
        }
        None => (text.to_owned(), PORT),
    };
    if host.is_empty() {
        Err("expected HOST:PORT, such as localhost:14158".to_owned())
    } else {
        Ok(format!("{host}:{port}"))
    }
}

/// The way to a viewer.
pub(super) struct Tev {
    address: String,
    /// What the viewer calls the picture.
    name: String,
    connection: Option<Connection>,
    next_try: Option<Instant>,
    /// Whether it was said that it is gone.
    has_warned: bool,
}

struct Connection {
    stream: TcpStream,
    /// What the viewer shows.
    shown: Option<Picture>,
}

impl Tev {
    pub(super) fn new(address: String, name: String) -> Self {
        Self { address, name, connection: None, next_try: None, has_warned: false }
    }

    fn show(&mut self, picture: &Picture) {
        if self.connection.is_none() && self.next_try.is_some_and(|next| Instant::now() < next) {
            return;
        }
        match self.try_to_show(picture) {
            Ok(()) => {
                if std::mem::take(&mut self.has_warned) {
                    say::aside(format_args!("tev at {} is there again", self.address));
                }
            }
            Err(error) => {
                self.connection = None;
                self.next_try = Some(Instant::now() + RETRY_INTERVAL);
                if !std::mem::replace(&mut self.has_warned, true) {
                    let address = &self.address;
                    say::warning(format_args!(
                        "tev at {address}: {error}; the render goes on, and will try again"
                    ));
                }
            }
        }
    }

    fn try_to_show(&mut self, picture: &Picture) -> io::Result<()> {
        let connection = match &mut self.connection {
            Some(connection) => connection,
            none => none.insert(Connection { stream: connect(&self.address)?, shown: None }),
        };
        connection.show(&self.name, picture)
    }
}

impl Recipient for Tev {
    const NAME: &'static str = "--tev";

    fn receive(&mut self, picture: &Picture, _: Duration) {
        self.show(picture);
    }

    fn receive_last(&mut self, picture: &Picture) {
        self.next_try = None;
        self.show(picture);
    }
}

fn connect(address: &str) -> io::Result<TcpStream> {
    let mut failed = io::Error::new(io::ErrorKind::NotFound, "the name stands for no address");
    for address in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, CONNECT_TIMEOUT) {
            Ok(stream) => {
                stream.set_write_timeout(Some(WRITE_TIMEOUT))?;
                stream.set_nodelay(true)?;
                return Ok(stream);
            }
            Err(error) => failed = error,
        }
    }
    Err(failed)
}

impl Connection {
    /// Sends what differs from what is shown.
    fn show(&mut self, name: &str, picture: &Picture) -> io::Result<()> {
        let shown = match self.shown.take() {
            Some(shown) => shown,
            None => {
                self.stream.write_all(&create_image(name, picture.window))?;
                Picture::empty(picture.frame, picture.window)
            }
        };
        for block in blocks(picture.window) {
            if rows(block).any(|row| {
                let row = index(picture, row);
                picture.samples[row.clone()] != shown.samples[row]
            }) {
                self.stream.write_all(&update_image(name, picture, block))?;
            }
        }
        self.shown = Some(picture.clone());
        Ok(())
    }
}

/// Squares that cover a window, in full-frame coordinates.
fn blocks(window: Window) -> impl Iterator<Item = Window> {
    let Window { x0, y0, x1, y1 } = window;
    let corners = (y0..y1)
        .step_by(BLOCK as usize)
        .flat_map(move |y| (x0..x1).step_by(BLOCK as usize).map(move |x| (x, y)));
    corners.map(move |(x, y)| Window { x0: x, y0: y, x1: x1.min(x + BLOCK), y1: y1.min(y + BLOCK) })
}

/// The rows of a window: first pixel and width.
fn rows(window: Window) -> impl Iterator<Item = (u32, u32, u32)> {
    (window.y0..window.y1).map(move |y| (window.x0, y, window.width()))
}

/// Where a picture's vectors hold a row.
fn index(picture: &Picture, (x, y, width): (u32, u32, u32)) -> std::ops::Range<usize> {
    let first = picture.index(x, y);
    first..first + width as usize
}

/// A message in the making.
struct Message(Vec<u8>);

impl Message {
    fn new(kind: u8, name: &str) -> Self {
        // Room for the length, the kind, and "no" to: bring the picture to the front.
        Self([&[0, 0, 0, 0, kind, 0], name.as_bytes(), &[0]].concat())
    }

    fn int(&mut self, value: u32) {
        self.0.extend_from_slice(&value.to_le_bytes());
    }

    fn channels(&mut self) {
        self.int(CHANNELS.len() as u32);
        self.0.extend_from_slice(&CHANNELS.map(|name| format!("{name}\0")).concat().into_bytes());
    }

    fn finished(mut self) -> Vec<u8> {
        let length = self.0.len() as u32;
        self.0[..4].copy_from_slice(&length.to_le_bytes());
        self.0
    }
}

fn create_image(name: &str, window: Window) -> Vec<u8> {
    let mut message = Message::new(CREATE_IMAGE, name);
    message.int(window.width());
    message.int(window.height());
    message.channels();
    message.finished()
}

/// The pixels of `block`, channels interleaved. tev's picture is the window: its corner is (0, 0).
fn update_image(name: &str, picture: &Picture, block: Window) -> Vec<u8> {
    let mut message = Message::new(UPDATE_IMAGE_V3, name);
    message.channels();
    message.int(block.x0 - picture.window.x0);
    message.int(block.y0 - picture.window.y0);
    message.int(block.width());
    message.int(block.height());
    let (count, mut long) =
        (CHANNELS.len() as u64, |value: u64| message.0.extend_from_slice(&value.to_le_bytes()));
    // Channel c of pixel p is float c + count p.
    (0..count).for_each(&mut long);
    (0..count).for_each(|_| long(count));
    for pixel in rows(block).flat_map(|row| index(picture, row)) {
        let [r, g, b, a] = picture.beauty[pixel];
        for value in [r, g, b, a, picture.error[pixel], picture.samples[pixel] as f32] {
            message.0.extend_from_slice(&value.to_le_bytes());
        }
    }
    message.finished()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_get_the_port_of_tev() {
        let cases = [
            ("localhost", "localhost:14158"),
            ("localhost:7", "localhost:7"),
            ("::1", "[::1]:14158"),
            ("[::1]:9", "[::1]:9"),
        ];
        for (text, expected) in cases {
            assert_eq!(parse_address(text).as_deref(), Ok(expected));
        }
        for bad in ["", ":1", "host:port", "host:70000"] {
            assert!(parse_address(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn messages_are_laid_out_as_tev_reads_them() {
        let window = Window { x0: 3, y0: 5, x1: 5, y1: 6 };
        let create = create_image("a", window);
        let expected = b"\x2a\0\0\0\x04\0a\0\x02\0\0\0\x01\0\0\0\x06\0\0\0R\0G\0B\0A\0error\0samples\0";
        assert_eq!(create, expected);
        let mut picture = Picture::empty([9, 9], window);
        picture.beauty[1] = [1.0, 0.0, 0.0, 0.0];
        picture.samples[1] = 2;
        let update = update_image("a", &picture, Window { x0: 4, ..window });
        assert_eq!(update.len(), 8 + 4 + 22 + 16 + 6 * 16 + 6 * 4);
        assert_eq!(update[..4], (update.len() as u32).to_le_bytes());
        let place: Vec<u8> = [1_u32, 0, 1, 1].iter().flat_map(|n| n.to_le_bytes()).collect();
        assert_eq!(update[34..50], place);
        let values: Vec<u8> =
            [1.0_f32, 0.0, 0.0, 0.0, 0.0, 2.0].iter().flat_map(|v| v.to_le_bytes()).collect();
        assert_eq!(update[update.len() - 24..], values);
    }

    #[test]
    fn blocks_cover_every_pixel_once() {
        let window = Window { x0: 5, y0: 1, x1: 5 + 130, y1: 1 + 65 };
        let pixels: usize = blocks(window).map(|block| block.pixels()).sum();
        assert_eq!((pixels, blocks(window).count()), (window.pixels(), 3 * 2));
    }
}
