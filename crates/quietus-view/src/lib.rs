//! A running render in the browser: the picture as it converges, what the sampling knows, and controls.
//!
//! A [`View`] is a web server in a thread of its own. The render's watcher shows it film and sampling a few times a
//! second ([`View::show`]); the view copies out the tiles that changed, as far as somebody looks at them. Every browser
//! takes from there what it has not seen yet, at its own pace. What browsers ask for comes back as [`Wish`]es. So
//! nothing a browser does, or fails to do, makes the render wait. docs/view.md says how it is used and what it costs.

mod assets;
mod board;
mod canvas;
mod client;
mod guard;
mod layer;
mod message;
mod orbit;
mod server;
mod show;
mod view;

pub use guard::{Token, TokenError};
pub use message::{Session, State};
pub use orbit::{Motion, moved};
pub use server::ServeError;
pub use view::{Options, ReferencePicture, View, Wish};
