//! Ctrl-C and other signals that ask the program to end: the first asks the render to stop, the next ends the program at
//! once. While a scene is read there is nothing to write, and the first ends the program.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{Ending, Failure};
use crate::say;

/// Signals that were watched for.
pub(crate) struct Interrupts {
    /// Set by the first signal.
    asked: Arc<AtomicBool>,
    /// Whether there is a render that can stop and be written.
    draws: Arc<AtomicBool>,
}

impl Interrupts {
    /// Watches for signals from here on: on Unix SIGINT, SIGTERM, which render farms send, and SIGHUP, which comes when a
    /// terminal or its connection is closed; elsewhere Ctrl-C.
    ///
    /// # Errors
    /// When the system does not let us.
    pub(crate) fn watch() -> Result<Self, Failure> {
        let this = Self { asked: Arc::default(), draws: Arc::default() };
        let (asked, draws) = (Arc::clone(&this.asked), Arc::clone(&this.draws));
        signals::watch(move |may_be_twice| {
            // Relaxed: the flags guard no data, here and below.
            if !draws.load(Ordering::Relaxed) {
                say::aside("stopped before there was a picture to write");
                quit();
            }
            if !asked.swap(true, Ordering::Relaxed) {
                say::aside("stopping; the picture so far will be written (Ctrl-C again quits at once)");
            } else if !may_be_twice {
                quit();
            }
        })
        .map_err(|error| Failure::internal(format!("cannot watch for Ctrl-C: {error}")))?;
        Ok(this)
    }

    /// Calls `draw` with the flag that the first signal sets from here on; until then it ends the program.
    pub(crate) fn while_drawing<T>(&self, draw: impl FnOnce(&AtomicBool) -> T) -> T {
        self.draws.store(true, Ordering::Relaxed);
        let drawn = draw(&self.asked);
        self.draws.store(false, Ordering::Relaxed);
        drawn
    }
}

fn quit() -> ! {
    quietus_film::remove_unfinished();
    std::process::exit(Ending::Interrupted.code().into())
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
