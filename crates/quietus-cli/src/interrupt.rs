//! Ctrl-C and other signals that ask the program to end: the first asks the render to stop, the next ends the program at
//! once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{Ending, Failure};
use crate::say;

/// Watches for signals from here on and returns the flag that the first one sets: on Unix SIGINT, SIGTERM, which render
/// farms send, and SIGHUP, which comes when a terminal or its connection is closed; elsewhere Ctrl-C.
///
/// # Errors
/// When the system does not let us.
pub(crate) fn watch() -> Result<Arc<AtomicBool>, Failure> {
    let asked = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&asked);
    signals::watch(move |may_be_twice| {
        // Relaxed: the flag guards no data.
        if !flag.swap(true, Ordering::Relaxed) {
            say::aside("stopping; the picture so far will be written (Ctrl-C again quits at once)");
        } else if !may_be_twice {
            quietus_film::remove_unfinished();
            std::process::exit(Ending::Interrupted.code().into());
        }
    })
    .map_err(|error| Failure::internal(format!("cannot watch for Ctrl-C: {error}")))?;
    Ok(asked)
}

#[cfg(unix)]
mod signals {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;

    /// Calls `on_signal` for each signal, on a thread of its own, and says whether it may come twice for one reason: the
    /// shell and the system both send SIGHUP.
    pub(super) fn watch(on_signal: impl Fn(bool) + Send + 'static) -> std::io::Result<()> {
        let hangup = (!ignores_hangup()).then_some(SIGHUP);
        let mut signals = Signals::new(hangup.into_iter().chain([SIGTERM, SIGINT]))?;
        let listen = move || signals.forever().for_each(|signal| on_signal(signal == SIGHUP));
        std::thread::Builder::new().name("signals".to_owned()).spawn(listen).map(drop)
    }

    /// Whether whoever started the program wants it to outlive the terminal, as `nohup` does. Only Linux tells; elsewhere a
    /// hangup ends the program as ever.
    fn ignores_hangup() -> bool {
        let Ok(status) = std::fs::read_to_string("/proc/self/status") else { return true };
        let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
        let mask = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
        mask.is_none_or(|mask| mask >> (SIGHUP - 1) & 1 == 1)
    }
}

#[cfg(not(unix))]
mod signals {
    /// Calls `on_signal` for each Ctrl-C, which does not come twice for one reason.
    pub(super) fn watch(on_signal: impl Fn(bool) + Send + 'static) -> Result<(), ctrlc::Error> {
        ctrlc::set_handler(move || on_signal(false))
    }
}
