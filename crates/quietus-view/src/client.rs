//! One browser: what it is told, as fast as it takes it, and what it asks for.

use std::sync::Arc;
use std::time::Duration;

use axum::extract::ws::{CloseFrame, Message, WebSocket, close_code};
use tokio::time::{Instant, sleep_until, timeout};

use crate::board::{Board, Content};
use crate::canvas::Cursor;
use crate::layer::{LAYERS, Layer};
use crate::message::{Request, TILES, Told, header};

/// Largest message of a client: no request is longer.
pub(crate) const LARGEST_REQUEST: usize = 1024;

/// Bytes of tiles in one message: small enough that a slow line sees the picture grow.
const BATCH_BYTES: usize = 1 << 18;

/// Batches that may be under way before the client has said that it took one.
const MOST_UNDER_WAY: u32 = 2;

/// Who takes nothing for this long is gone.
const PATIENCE: Duration = Duration::from_secs(30);

/// Least time between two requests of a client; who sends more is read more slowly.
const REQUEST_INTERVAL: Duration = Duration::from_millis(4);

/// Least time between two rounds of sending: batches grow instead of their number.
const SEND_INTERVAL: Duration = Duration::from_millis(15);

/// What a client has seen and wants to see.
struct Client {
    board: Arc<Board>,
    /// For what is asked by one and answered by another thread.
    id: u64,
    layers: Vec<Layer>,
    tree: bool,
    cursors: [Cursor; LAYERS],
    under_way: u32,
    session: u32,
    /// How many of each were sent, or had been there before.
    coarse: u64,
    trees: u64,
    has_history: bool,
    status: u64,
    notices: u64,
}

/// Tells one client everything until it goes away.
pub(crate) async fn serve(mut socket: WebSocket, board: Arc<Board>, id: u64) {
    let mut bell = board.listen();
    let mut client = Client::new(board, id);
    loop {
        while let Some(message) = client.next() {
            if !matches!(timeout(PATIENCE, socket.send(message)).await, Ok(Ok(()))) {
                return;
            }
        }
        let pause = Instant::now() + SEND_INTERVAL;
        tokio::select! {
            incoming = socket.recv() => match incoming {
                Some(Ok(message)) => {
                    if let Err(problem) = client.take(message) {
                        let frame = CloseFrame { code: close_code::POLICY, reason: problem.into() };
                        let _ = timeout(PATIENCE, socket.send(Message::Close(Some(frame)))).await;
                        return;
                    }
                    tokio::time::sleep(REQUEST_INTERVAL).await;
                }
                // Gone, or what it sent is no message, or too large a one.
                None | Some(Err(_)) => return,
            },
            _ = bell.changed() => sleep_until(pause).await,
        }
    }
}

impl Client {
    fn new(board: Arc<Board>, id: u64) -> Self {
        let layers = vec![Layer::Beauty];
        {
            let mut content = board.lock();
            content.count_client(1);
            content.count_looks(&layers, false, 1);
        }
        Self {
            board,
            id,
            layers,
            tree: false,
            cursors: [Cursor::default(); LAYERS],
            under_way: 0,
            session: 0,
            coarse: 0,
            trees: 0,
            has_history: false,
            status: 0,
            notices: 0,
        }
    }

    /// What it is to be told next, most important first; `None` when there is nothing, or it has enough to do.
    fn next(&mut self) -> Option<Message> {
        let board = Arc::clone(&self.board);
        let mut content = board.lock();
        if content.session_number == 0 {
            return None;
        }
        if self.session != content.session_number {
            return Some(self.begin(&content));
        }
        let is_new = std::mem::replace(&mut self.coarse, content.coarse.0) != content.coarse.0;
        if is_new && !content.coarse.1.is_empty() {
            return Some(binary(content.coarse.1.to_vec()));
        }
        if let Some(values) = content.answers.remove(&self.id) {
            return Some(told(&Told::Pixel(&values)));
        }
        if let Some(message) = self.next_notice(&content) {
            return Some(message);
        }
        if !std::mem::replace(&mut self.has_history, true) {
            return Some(told(&Told::History { moments: &content.moments }));
        }
        if self.status != content.status_count {
            self.status = content.status_count;
            let (state, remaining, moment) = (content.state, content.remaining, &content.now);
            let remaining_range = content.remaining_range;
            return Some(told(&Told::Status { state, remaining, remaining_range, moment }));
        }
        if self.tree && self.trees != content.tree.0 && !content.tree.1.is_empty() {
            self.trees = content.tree.0;
            return Some(binary(content.tree.1.to_vec()));
        }
        self.next_tiles(&content)
    }

    fn begin(&mut self, content: &Content) -> Message {
        self.session = content.session_number;
        self.cursors = [Cursor::default(); LAYERS];
        (self.trees, self.status, self.under_way, self.has_history) = (0, 0, 0, false);
        match &content.session {
            Some(session) => told(&Told::Session {
                number: self.session,
                reference: self.board.reference().map(|reference| reference.size),
                session,
            }),
            None => told(&Told::Notice { text: "nothing is drawn yet", wrong: false }),
        }
    }

    fn next_notice(&mut self, content: &Content) -> Option<Message> {
        let first = self.notices.max(content.notices_gone);
        let notice = content.notices.get((first - content.notices_gone) as usize)?;
        self.notices = first + 1;
        Some(told(&Told::Notice { text: &notice.text, wrong: notice.is_wrong }))
    }

    /// A batch of the first layer that has something new.
    fn next_tiles(&mut self, content: &Content) -> Option<Message> {
        let canvas = content.canvas.as_ref().filter(|_| self.under_way < MOST_UNDER_WAY)?;
        let (layer, tiles) = self.layers.iter().find_map(|&layer| {
            let most = BATCH_BYTES / layer.tile_bytes();
            let tiles = canvas.unseen(layer, &mut self.cursors[layer as usize], most);
            (!tiles.is_empty()).then_some((layer, tiles))
        })?;
        self.under_way += 1;
        let mut bytes = header(TILES, layer as u8, self.session);
        bytes.reserve(4 + tiles.len() * (4 + layer.tile_bytes()));
        bytes.extend((tiles.len() as u32).to_le_bytes());
        tiles.iter().for_each(|&tile| bytes.extend((tile as u32).to_le_bytes()));
        tiles.iter().for_each(|&tile| bytes.extend(canvas.tile(layer, tile)));
        Some(binary(bytes))
    }

    /// Takes what the client sent.
    ///
    /// # Errors
    /// When it is nothing that our page sends.
    fn take(&mut self, message: Message) -> Result<(), &'static str> {
        let text = match message {
            Message::Text(text) => text,
            Message::Binary(_) => return Err("expected text"),
            Message::Ping(_) | Message::Pong(_) | Message::Close(_) => return Ok(()),
        };
        let request = serde_json::from_str(&text).map_err(|_| "not a request")?;
        match request {
            Request::Ack {} => self.under_way = self.under_way.saturating_sub(1),
            Request::Look { layers, tree } => self.look(layers, tree),
            Request::Probe { x, y } => {
                self.board.lock().probes.insert(self.id, [x, y]);
            }
            request => self.board.ask(request),
        }
        Ok(())
    }

    fn look(&mut self, mut layers: Vec<Layer>, tree: bool) {
        layers.retain(|layer| *layer != Layer::Beauty);
        layers.truncate(LAYERS);
        layers.insert(0, Layer::Beauty);
        // What was looked at before is begun anew when it is asked for again: it may have been forgotten meanwhile.
        for layer in Layer::ALL.into_iter().filter(|layer| !self.layers.contains(layer)) {
            self.cursors[layer as usize] = Cursor::default();
        }
        let mut content = self.board.lock();
        content.count_looks(&layers, tree, 1);
        content.count_looks(&self.layers, self.tree, -1);
        drop(content);
        self.trees = if tree && !self.tree { 0 } else { self.trees };
        (self.layers, self.tree) = (layers, tree);
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        let mut content = self.board.lock();
        content.count_client(-1);
        content.count_looks(&self.layers, self.tree, -1);
        content.probes.remove(&self.id);
        content.answers.remove(&self.id);
    }
}

fn binary(bytes: Vec<u8>) -> Message {
    Message::Binary(bytes.into())
}

fn told(told: &Told<'_>) -> Message {
    // Strings, numbers and lists of them: nothing in it that JSON lacks.
    Message::Text(serde_json::to_string(told).unwrap_or_default().into())
}
