//! Ctrl-C: the first asks the render to stop, the second ends the program at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{Ending, Failure};
use crate::say;

/// Watches for Ctrl-C from here on and returns the flag that the first one sets.
///
/// # Errors
/// When the system does not let us.
pub(crate) fn watch() -> Result<Arc<AtomicBool>, Failure> {
    let asked = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&asked);
    let handler = move || {
        // Relaxed: the flag guards no data.
        if flag.swap(true, Ordering::Relaxed) {
            quietus_film::remove_unfinished();
            std::process::exit(Ending::Interrupted.code().into());
        }
        say::aside("stopping; the picture so far will be written (Ctrl-C again quits at once)");
    };
    ctrlc::set_handler(handler)
        .map_err(|error| Failure::internal(format!("cannot watch for Ctrl-C: {error}")))?;
    Ok(asked)
}
