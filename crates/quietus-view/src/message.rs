//! What goes over the websocket: JSON both ways, and tiles as they lie in memory, little-endian.
//!
//! Binary messages begin with a byte that says what they are ([`TILES`], [`COARSE`], [`TREE`]), one for the layer, two
//! of nothing, and the number of the session they belong to (u32); what follows is aligned to four bytes, so that the
//! browser can look at it as typed arrays.

use serde::{Deserialize, Serialize};

use crate::layer::Layer;

/// Tiles of a layer: their number n (u32), n indices (u32), n times the tile's bytes.
pub(crate) const TILES: u8 = 1;
/// A small picture of everything: the part of the frame it covers (x0, y0, x1, y1, i32), its width and height (u32),
/// and its pixels row by row, four half floats each.
pub(crate) const COARSE: u8 = 2;
/// Leaves of the region trees: the number of complete and of active ones (u32), then for each, complete ones first,
/// x0, y0, x1, y1 in pixels of the window (f32).
pub(crate) const TREE: u8 = 3;

/// The first eight bytes of a binary message.
pub(crate) fn header(kind: u8, layer: u8, session: u32) -> Vec<u8> {
    let mut bytes = vec![kind, layer, 0, 0];
    bytes.extend(session.to_le_bytes());
    bytes
}

/// What a page may ask for.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "do", rename_all = "lowercase", deny_unknown_fields)]
pub(crate) enum Request {
    /// It took a batch of tiles, and wants more.
    Ack {},
    /// What it wants to see beside the picture.
    Look {
        /// Besides the picture itself.
        layers: Vec<Layer>,
        /// The leaves of the trees.
        tree: bool,
    },
    /// The exact values of a pixel.
    Probe {
        /// Column in the frame.
        x: u32,
        /// Row in the frame.
        y: u32,
    },
    /// Hold the render.
    Pause {},
    /// Let it go on.
    Resume {},
    /// End it, and write what there is.
    Stop {},
    /// Go on to another noise, in per cent of white.
    Noise {
        /// Asked for.
        percent: f64,
    },
    /// Draw this part of the frame alone.
    Crop {
        /// x0, y0, x1, y1 in the frame.
        window: [u32; 4],
    },
    /// Draw the whole frame.
    Whole {},
    /// Move the camera and begin anew.
    Move(crate::orbit::Motion),
    /// Back to where the camera was at first.
    Home {},
}

/// What is drawn, told when it begins.
#[derive(Clone, Debug, Serialize)]
pub struct Session {
    /// What the page is headed with.
    pub title: String,
    /// Width and height of the full frame.
    pub frame: [u32; 2],
    /// x0, y0, x1, y1 of the part that is drawn.
    pub window: [u32; 4],
    /// Name of the way samples are spread.
    pub sampling: String,
    /// Whether there are trees to be seen.
    pub has_tree: bool,
    /// Whether the noise asked for can be changed.
    pub can_change_noise: bool,
    /// Whether crop and camera can be changed.
    pub can_restart: bool,
    /// What is written at the end.
    pub outputs: Vec<String>,
}

/// What a render is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// Samples are drawn.
    Rendering,
    /// Threads are held.
    Paused,
    /// The picture is as good as it was asked to be.
    Finished,
    /// It was stopped before.
    Stopped,
}

/// A moment of the render, kept for the curves.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(crate) struct Moment {
    /// Time since the render began in seconds, without pauses.
    pub seconds: f64,
    /// Mean samples per pixel.
    pub spp: f64,
    /// Samples per second.
    pub rate: f64,
    /// Share of pixels that are done.
    pub converged: f64,
    /// Slowest rebuild of a tree since the moment before, in milliseconds.
    pub rebuild_ms: Option<f64>,
    /// Noise asked for, in per cent of white.
    pub noise_asked: Option<f64>,
    /// Noise estimated, in per cent of white.
    pub noise: Option<f64>,
}

/// Everything that goes to a page as text.
#[derive(Serialize)]
#[serde(tag = "is", rename_all = "lowercase")]
pub(crate) enum Told<'a> {
    /// A new picture begins.
    Session {
        /// Its number.
        number: u32,
        /// The size of the picture to compare with, where there is one.
        reference: Option<[u32; 2]>,
        /// What it is.
        #[serde(flatten)]
        session: &'a Session,
    },
    /// How far it is.
    Status {
        /// What is being done.
        state: State,
        /// Guessed seconds left.
        remaining: Option<f64>,
        /// The range of it, where it is too wide for the guess alone to be told.
        remaining_range: Option<[f64; 2]>,
        /// Rays per second.
        #[serde(flatten)]
        moment: &'a Moment,
    },
    /// All moments so far.
    History {
        /// Oldest first.
        moments: &'a [Moment],
    },
    /// Exact values of a pixel.
    Pixel(&'a crate::layer::PixelValues),
    /// Something to read.
    Notice {
        /// The words.
        text: &'a str,
        /// Whether something went wrong.
        wrong: bool,
    },
}
