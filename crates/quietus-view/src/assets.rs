//! The page: files that are part of the program.

use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};

/// Every file with its type and content.
macro_rules! files {
    ($($name:literal: $kind:expr,)*) => {
        [$(($name, $kind, include_bytes!(concat!("../page/", $name)))),*]
    };
}

const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";

/// The file called `name`, or that there is none.
pub(crate) fn answer(name: &str) -> Response {
    const FILES: &[(&str, &str, &[u8])] = &files! {
        "index.html": HTML,
        "style.css": CSS,
        "main.js": SCRIPT,
        "link.js": SCRIPT,
        "store.js": SCRIPT,
        "surface.js": SCRIPT,
        "stage.js": SCRIPT,
        "hands.js": SCRIPT,
        "curves.js": SCRIPT,
        "legend.js": SCRIPT,
        "maps.js": SCRIPT,
        "tone.js": SCRIPT,
        "words.js": SCRIPT,
    };
    match FILES.iter().find(|(file, ..)| *file == name) {
        Some(&(_, kind, content)) => ([(header::CONTENT_TYPE, kind)], content).into_response(),
        None => StatusCode::NOT_FOUND.into_response(),
    }
}
