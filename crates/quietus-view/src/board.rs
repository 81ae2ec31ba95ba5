//! What render and browsers share: a notice board. The render pins up what there is, each client reads it when it has
//! time; nobody waits for anybody but for the moment that something is copied.

use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use axum::body::Bytes;
use quietus_render::Live;
use tokio::sync::watch;

use crate::canvas::Canvas;
use crate::layer::{LAYERS, Layer, PixelValues};
use crate::message::{Moment, Request, Session, State};

/// Most requests that wait to be followed; more are a fault of who sends them, and are dropped.
const MOST_REQUESTS: usize = 256;

/// Most moments that are kept for the curves: beyond, every other one is forgotten.
const MOST_MOMENTS: usize = 600;

/// Something to read, and whether something went wrong.
#[derive(Clone, Debug)]
pub(crate) struct Notice {
    pub(crate) text: String,
    pub(crate) is_wrong: bool,
}

/// The board itself, under one lock that is held for as long as something is copied.
pub(crate) struct Content {
    /// Counts the pictures that were begun; 0 before the first.
    pub(crate) session_number: u32,
    pub(crate) session: Option<Session>,
    pub(crate) canvas: Option<Canvas>,
    /// A whole message, and how many there were of them.
    pub(crate) coarse: (u64, Arc<Vec<u8>>),
    /// As `coarse`.
    pub(crate) tree: (u64, Arc<Vec<u8>>),
    pub(crate) state: State,
    pub(crate) remaining: Option<f64>,
    pub(crate) remaining_range: Option<[f64; 2]>,
    /// How often state or moments changed.
    pub(crate) status_count: u64,
    pub(crate) moments: Vec<Moment>,
    /// How many updates lie between two moments that are kept.
    pub(crate) stride: usize,
    pub(crate) now: Moment,
    updates: usize,
    /// All notices, and how many came before the first of these.
    pub(crate) notices: VecDeque<Notice>,
    pub(crate) notices_gone: u64,
    /// Clients that look at each layer, and at the trees.
    lookers: [u32; LAYERS],
    tree_lookers: u32,
    clients: u32,
    /// Pixels that clients ask for, and the answers.
    pub(crate) probes: HashMap<u64, [u32; 2]>,
    pub(crate) answers: HashMap<u64, PixelValues>,
    requests: VecDeque<Request>,
    /// The gate of a render that runs.
    pub(crate) live: Option<Arc<Live>>,
}

/// Shared between the render's thread and the server's.
pub(crate) struct Board {
    content: Mutex<Content>,
    /// Rung when something was pinned up.
    bell: watch::Sender<()>,
    asked: Condvar,
    /// A picture to compare with.
    reference: Option<Reference>,
}

/// A picture to compare with, as it goes to the browser.
pub(crate) struct Reference {
    /// Width and height.
    pub(crate) size: [u32; 2],
    /// Row by row, four half floats per pixel.
    pub(crate) bytes: Bytes,
}

/// Most notices that are kept for those who come later.
const MOST_NOTICES: usize = 8;

impl Board {
    pub(crate) fn new(reference: Option<Reference>) -> Self {
        let content = Content {
            session_number: 0,
            session: None,
            canvas: None,
            coarse: (0, Arc::default()),
            tree: (0, Arc::default()),
            state: State::Rendering,
            remaining: None,
            remaining_range: None,
            status_count: 0,
            moments: Vec::new(),
            stride: 1,
            now: Moment::default(),
            updates: 0,
            notices: VecDeque::new(),
            notices_gone: 0,
            lookers: [0; LAYERS],
            tree_lookers: 0,
            clients: 0,
            probes: HashMap::new(),
            answers: HashMap::new(),
            requests: VecDeque::new(),
            live: None,
        };
        Self { content: Mutex::new(content), bell: watch::Sender::new(()), asked: Condvar::new(), reference }
    }

    /// The content; whole at any time, also after a panic.
    pub(crate) fn lock(&self) -> MutexGuard<'_, Content> {
        self.content.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The picture to compare with.
    pub(crate) fn reference(&self) -> Option<&Reference> {
        self.reference.as_ref()
    }

    /// Wakes every client.
    pub(crate) fn ring(&self) {
        self.bell.send_replace(());
    }

    /// Hears the bell from now on.
    pub(crate) fn listen(&self) -> watch::Receiver<()> {
        self.bell.subscribe()
    }

    /// A request that the render has to follow. Holding and letting go are done at once.
    pub(crate) fn ask(&self, request: Request) {
        let mut content = self.lock();
        match (&request, &content.live) {
            (Request::Pause {}, Some(live)) => live.pause(),
            (Request::Resume {}, Some(live)) => live.resume(),
            _ if content.requests.len() < MOST_REQUESTS => content.requests.push_back(request),
            _ => (),
        }
        content.show_gate();
        drop(content);
        self.asked.notify_all();
        self.ring();
    }

    /// The next request, if one comes within `patience`.
    pub(crate) fn next_request(&self, patience: Duration) -> Option<Request> {
        let content = self.lock();
        let waited = self.asked.wait_timeout_while(content, patience, |content| content.requests.is_empty());
        let mut content = waited.unwrap_or_else(PoisonError::into_inner).0;
        content.requests.pop_front()
    }
}

impl Content {
    /// Begins a new picture.
    pub(crate) fn begin(&mut self, session: Session, canvas: Canvas, live: Arc<Live>) {
        self.session_number += 1;
        self.session = Some(session);
        self.canvas = Some(canvas);
        self.live = Some(live);
        self.tree = (self.tree.0 + 1, Arc::default());
        // Who has it keeps it below the tiles until they come; nobody else needs it.
        self.coarse.1 = Arc::default();
        self.state = State::Rendering;
        (self.remaining, self.remaining_range) = (None, None);
        (self.moments, self.stride, self.updates) = (Vec::new(), 1, 0);
        self.now = Moment::default();
        self.status_count += 1;
        self.probes.clear();
        self.answers.clear();
    }

    /// Follows the gate, where threads are drawing.
    pub(crate) fn show_gate(&mut self) {
        let gate = match &self.live {
            Some(live) if live.is_paused() => State::Paused,
            _ => State::Rendering,
        };
        if matches!(self.state, State::Rendering | State::Paused) && self.state != gate {
            self.state = gate;
            self.status_count += 1;
        }
    }

    /// Keeps the moment for the curves, in ever larger steps.
    pub(crate) fn push(&mut self, moment: Moment) {
        if self.updates.is_multiple_of(self.stride) {
            self.moments.push(moment.clone());
        }
        self.now = moment;
        self.updates += 1;
        self.status_count += 1;
        if self.moments.len() > MOST_MOMENTS {
            let mut index = 0;
            self.moments.retain(|_| {
                index += 1;
                index % 2 == 1
            });
            self.stride *= 2;
        }
    }

    pub(crate) fn notify(&mut self, notice: Notice) {
        self.notices.push_back(notice);
        if self.notices.len() > MOST_NOTICES {
            self.notices.pop_front();
            self.notices_gone += 1;
        }
    }

    /// A client comes or, with `-1`, goes.
    pub(crate) fn count_client(&mut self, change: i32) {
        self.clients = self.clients.saturating_add_signed(change);
    }

    pub(crate) fn clients(&self) -> u32 {
        self.clients
    }

    /// A client looks at `layers` and, perhaps, the tree; or, with `-1`, does so no longer.
    pub(crate) fn count_looks(&mut self, layers: &[Layer], tree: bool, change: i32) {
        for layer in layers {
            let lookers = &mut self.lookers[*layer as usize];
            *lookers = lookers.saturating_add_signed(change);
        }
        if tree {
            self.tree_lookers = self.tree_lookers.saturating_add_signed(change);
        }
    }

    /// Whether anybody looks at `layer`.
    pub(crate) fn wants(&self, layer: Layer) -> bool {
        self.lookers[layer as usize] > 0
    }

    /// Whether anybody looks at the trees.
    pub(crate) fn wants_tree(&self) -> bool {
        self.tree_lookers > 0
    }
}
