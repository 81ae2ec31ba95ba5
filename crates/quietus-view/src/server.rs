//! The server: a thread of its own, an address, a page.

use std::net::{IpAddr, SocketAddr, TcpListener as StdListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use axum::Router;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{Path, State};
use axum::http::{StatusCode, header};
use axum::middleware;
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Semaphore, oneshot};

use crate::assets;
use crate::board::Board;
use crate::client::{self, LARGEST_REQUEST};
use crate::guard::{Token, guard};

/// Most browsers at once: a page is not a broadcast.
const MOST_CLIENTS: u32 = 16;

/// Most connections at once, so that the files of a render can always be opened.
const MOST_CONNECTIONS: usize = 64;

/// Who has not said what it wants by then is not waited for.
const HEADER_PATIENCE: Duration = Duration::from_secs(10);

/// Largest head of a request, in bytes; the least that the server takes.
const LARGEST_HEAD: usize = 8192;

/// Why there is no server.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The port is in use, or may not be used.
    #[error("cannot serve the view at {address}: {source}{}", hint(.source))]
    Bind {
        /// Where it was to be.
        address: SocketAddr,
        /// What the system said.
        source: std::io::Error,
    },
    /// The thread could not be started.
    #[error("cannot start the view's server: {0}")]
    Start(#[from] std::io::Error),
    /// No random numbers for the token.
    #[error("cannot make a token for the view's address: {0}")]
    Token(#[from] getrandom::Error),
}

fn hint(error: &std::io::Error) -> &'static str {
    match error.kind() {
        std::io::ErrorKind::AddrInUse => {
            "; another program uses that port: choose another one, or 0 for any that is free"
        }
        std::io::ErrorKind::PermissionDenied => {
            "; ports below 1024 are reserved: choose another one, or 0 for any that is free"
        }
        std::io::ErrorKind::AddrNotAvailable => "; this machine has no such address",
        _ => "",
    }
}

/// A running server. It ends when this is dropped.
pub(crate) struct Server {
    pub(crate) address: SocketAddr,
    end: Option<oneshot::Sender<()>>,
    thread: Option<std::thread::JoinHandle<()>>,
}

/// What every request may need.
#[derive(Clone)]
struct Site {
    board: Arc<Board>,
    /// Numbers clients.
    next_client: Arc<AtomicU64>,
}

impl Server {
    /// Binds, and serves from a thread of its own.
    pub(crate) fn start(ip: IpAddr, port: u16, token: Token, board: Arc<Board>) -> Result<Self, ServeError> {
        let address = SocketAddr::new(ip, port);
        let listener = StdListener::bind(address).map_err(|source| ServeError::Bind { address, source })?;
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        let (end, ended) = oneshot::channel();
        let router = router(token, Site { board, next_client: Arc::default() });
        let work = move || {
            runtime.block_on(async {
                if let Ok(listener) = TcpListener::from_std(listener) {
                    tokio::select! {
                        () = accept(listener, router) => (),
                        _ = ended => (),
                    }
                }
            });
            // Connections end with the runtime, whatever they are at.
            runtime.shutdown_background();
        };
        let thread = std::thread::Builder::new().name("view".to_owned()).spawn(work)?;
        Ok(Self { address, end: Some(end), thread: Some(thread) })
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        drop(self.end.take());
        if let Some(thread) = self.thread.take() {
            // A panic there was reported by its hook; there is nothing to add.
            let _ = thread.join();
        }
    }
}

fn router(token: Token, site: Site) -> Router {
    let pages = Router::new()
        .route("/{token}/", get(|| async { assets::answer("index.html") }))
        .route(
            "/{token}/{file}",
            get(|Path((_, file)): Path<(String, String)>| async move { assets::answer(&file) }),
        )
        .route("/{token}/ws", get(open_socket))
        .route("/{token}/reference", get(reference))
        .with_state(site);
    pages.layer(middleware::from_fn_with_state(Arc::new(token), guard))
}

async fn open_socket(State(site): State<Site>, upgrade: WebSocketUpgrade) -> Response {
    if site.board.lock().clients() >= MOST_CLIENTS {
        return (StatusCode::SERVICE_UNAVAILABLE, "Too many pages look at this render.\n").into_response();
    }
    let id = site.next_client.fetch_add(1, Ordering::Relaxed);
    upgrade
        .max_message_size(LARGEST_REQUEST)
        .max_frame_size(LARGEST_REQUEST)
        .on_upgrade(move |socket| client::serve(socket, site.board, id))
}

async fn reference(State(site): State<Site>) -> Response {
    match site.board.reference() {
        Some(reference) => {
            ([(header::CONTENT_TYPE, "application/octet-stream")], reference.bytes.clone()).into_response()
        }
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

/// Takes connections in, as many as there are places.
async fn accept(listener: TcpListener, router: Router) {
    let places = Arc::new(Semaphore::new(MOST_CONNECTIONS));
    loop {
        let Ok(place) = Arc::clone(&places).acquire_owned().await else { return };
        match listener.accept().await {
            Ok((stream, _)) => {
                let router = router.clone();
                tokio::spawn(async move {
                    serve(stream, router).await;
                    drop(place);
                });
            }
            // Out of files or memory, or it was gone again: better luck a little later.
            Err(_) => tokio::time::sleep(Duration::from_millis(100)).await,
        }
    }
}

async fn serve(stream: TcpStream, router: Router) {
    // Tiles are sent as they come; where that is impossible they are only late.
    let _ = stream.set_nodelay(true);
    let mut builder = http1::Builder::new();
    builder.timer(TokioTimer::new()).header_read_timeout(HEADER_PATIENCE).max_buf_size(LARGEST_HEAD);
    // What fails here fails because the other side went away or talks nonsense.
    let _ = builder
        .serve_connection(TokioIo::new(stream), TowerToHyperService::new(router))
        .with_upgrades()
        .await;
}
