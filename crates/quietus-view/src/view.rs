//! The render's side of the view.

use std::net::IpAddr;
use std::sync::Arc;
use std::time::{Duration, Instant};

use half::f16;
use half::slice::HalfFloatSliceExt;
use quietus_film::{Film, Layout, Window};
use quietus_render::{Live, Statistics, Watched};

use crate::board::{Board, Notice, Reference};
use crate::canvas::Canvas;
use crate::guard::Token;
use crate::message::{COARSE, Moment, Request, Session, State, header};
use crate::orbit::Motion;
use crate::server::{ServeError, Server};
use crate::show::Shower;

/// Where the view is served, and what it knows from the beginning.
#[derive(Debug)]
pub struct Options {
    /// The address to listen at.
    pub bind: IpAddr,
    /// The port; 0 takes any that is free.
    pub port: u16,
    /// The secret in the address; a random one when absent.
    pub token: Option<Token>,
    /// A picture to compare with.
    pub reference: Option<ReferencePicture>,
}

/// A picture to compare with: linear Rec.709 and alpha, row by row, of the size of the frame.
#[derive(Debug)]
pub struct ReferencePicture {
    /// Width and height.
    pub size: [u32; 2],
    /// As many as the size says.
    pub pixels: Vec<[f32; 4]>,
}

/// What somebody at a browser asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wish {
    /// End the render, and write what there is.
    Stop,
    /// Go on to another noise, in per cent of white.
    Noise(f64),
    /// Draw this part of the frame alone; `None` for all of it.
    Crop(Option<Window>),
    /// Move the camera.
    Move(Motion),
    /// The camera as it was at first.
    Home,
}

/// The view of a render, or of several after each other. The server ends when it is dropped.
pub struct View {
    board: Arc<Board>,
    server: Server,
    token: Token,
    shower: Shower,
}

/// How often curves and figures are renewed.
const STATUS_INTERVAL: Duration = Duration::from_millis(250);

impl View {
    /// Starts the server.
    ///
    /// # Errors
    /// When address or port cannot be had.
    ///
    /// # Panics
    /// When the reference has not as many pixels as its size says.
    pub fn start(options: Options) -> Result<Self, ServeError> {
        let token = options.token.map_or_else(Token::random, Ok)?;
        let board = Arc::new(Board::new(options.reference.map(encoded)));
        let server = Server::start(options.bind, options.port, token.clone(), Arc::clone(&board))?;
        Ok(Self { board, server, token, shower: Shower::default() })
    }

    /// The address of the page, with its token.
    pub fn address(&self) -> String {
        format!("http://{}/{}/", self.server.address, self.token.as_str())
    }

    /// A new picture begins: what browsers have is of the past.
    pub fn begin(&mut self, session: Session, layout: Layout, live: Arc<Live>) {
        self.shower = Shower::default();
        self.board.lock().begin(session, Canvas::new(layout), live);
        self.board.ring();
    }

    /// Shows a running render. Called by its watcher, from one thread; costs next to nothing while nobody looks.
    pub fn show(&mut self, watched: &Watched<'_>, live: &Live) {
        self.shower.show(&self.board, watched.film, watched.sampling, live);
        if self.shower.is_status_due(STATUS_INTERVAL) {
            let moment = self.shower.moment(&watched.progress, watched.sampling);
            let mut content = self.board.lock();
            let progress = &watched.progress;
            content.remaining = progress.remaining.map(|left| left.as_secs_f64());
            content.remaining_range = progress.wide_range().map(|ends| ends.map(|end| end.as_secs_f64()));
            content.push(moment);
            content.show_gate();
        }
        self.board.ring();
    }

    /// Shows a render that has ended, for as long as somebody may look.
    pub fn show_still(&mut self, film: &Film, sampling: &quietus::AdaptiveSampling, live: &Live) {
        self.shower.show(&self.board, film, sampling, live);
        self.board.ring();
    }

    /// The render ended, with these figures: those that the last look at it missed, its noise above all.
    pub fn end(&mut self, state: State, statistics: &Statistics) {
        let mut content = self.board.lock();
        content.push(Moment {
            seconds: statistics.wall_seconds,
            spp: statistics.per_pixel.spp_mean,
            rate: statistics.samples as f64 / statistics.wall_seconds.max(1e-9),
            converged: statistics.converged_fraction,
            rebuild_ms: None,
            noise_asked: statistics.noise_asked,
            noise: statistics.noise_reached,
        });
        // It holds nothing any more, and pauses no clock.
        content.live.take().inspect(|live| live.resume());
        content.state = state;
        (content.remaining, content.remaining_range) = (None, None);
        drop(content);
        self.board.ring();
    }

    /// The render that ended goes on with the same picture.
    pub fn go_on(&mut self, live: Option<Arc<Live>>) {
        let mut content = self.board.lock();
        content.live = live;
        content.state = State::Rendering;
        content.status_count += 1;
        drop(content);
        self.board.ring();
    }

    /// Shows a small picture of `size` pixels in place of `window` until the tiles are there. Linear Rec.709 and alpha,
    /// row by row.
    ///
    /// # Panics
    /// When there are not as many pixels as `size` says.
    pub fn show_coarse(&mut self, window: [i32; 4], size: [u32; 2], pixels: &[[f32; 4]]) {
        assert_eq!(pixels.len(), size[0] as usize * size[1] as usize, "pixels of {size:?}");
        let mut content = self.board.lock();
        let mut bytes = header(COARSE, 0, content.session_number);
        window.iter().for_each(|side| bytes.extend(side.to_le_bytes()));
        size.iter().for_each(|side| bytes.extend(side.to_le_bytes()));
        bytes.extend(halves(pixels));
        content.coarse = (content.coarse.0 + 1, Arc::new(bytes));
        drop(content);
        self.board.ring();
    }

    /// Tells everybody who looks, now or a little later.
    pub fn say(&self, text: impl Into<String>, is_wrong: bool) {
        self.board.lock().notify(Notice { text: text.into(), is_wrong });
        self.board.ring();
    }

    /// The next thing that somebody asked for, if anybody does within `patience`.
    pub fn next_wish(&self, patience: Duration) -> Option<Wish> {
        let deadline = Instant::now() + patience;
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            let request = self.board.next_request(left)?;
            if let Some(wish) = wish(request) {
                return Some(wish);
            }
        }
    }

    /// How many browsers are connected.
    pub fn clients(&self) -> u32 {
        self.board.lock().clients()
    }
}

/// What the render itself has to follow.
fn wish(request: Request) -> Option<Wish> {
    match request {
        Request::Stop {} => Some(Wish::Stop),
        Request::Noise { percent } => (percent > 0.0 && percent.is_finite()).then_some(Wish::Noise(percent)),
        Request::Crop { window: [x0, y0, x1, y1] } => Some(Wish::Crop(Some(Window { x0, y0, x1, y1 }))),
        Request::Whole {} => Some(Wish::Crop(None)),
        Request::Move(motion) => Some(Wish::Move(motion)),
        Request::Home {} => Some(Wish::Home),
        _ => None,
    }
}

fn encoded(reference: ReferencePicture) -> Reference {
    let ReferencePicture { size, pixels } = reference;
    assert_eq!(pixels.len(), size[0] as usize * size[1] as usize, "pixels of {size:?}");
    Reference { size, bytes: halves(&pixels).into() }
}

/// As half floats; what those cannot hold becomes their largest.
fn halves(pixels: &[[f32; 4]]) -> Vec<u8> {
    let most = f16::MAX.to_f32();
    let floats: Vec<f32> = pixels.iter().flatten().map(|value| value.clamp(-most, most)).collect();
    let mut halves = vec![f16::ZERO; floats.len()];
    halves.convert_from_f32_slice(&floats);
    halves.iter().flat_map(|half| half.to_le_bytes()).collect()
}
