//! Carries pictures of a running render to where they are wanted, on a thread of its own: whoever watches the render
//! only copies the film, and a recipient that is slow gets fewer pictures.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use quietus_film::{Film, Picture};
use quietus_render::{Watched, shown_error};

use crate::say;

/// Who gets pictures.
pub(super) trait Recipient: Send + 'static {
    /// Name of its thread.
    const NAME: &'static str;

    /// Takes a picture of a render that has gone on for so long. What goes wrong is said, and no reason to stop.
    fn receive(&mut self, picture: &Picture, elapsed: Duration);

    /// Takes the finished picture, where it is sent one.
    fn receive_last(&mut self, _: &Picture) {}
}

/// What the thread is sent.
enum Parcel {
    Picture(Picture, Duration),
    Last(Picture),
}

/// The way to one recipient.
pub(super) struct Courier {
    sender: SyncSender<Parcel>,
    thread: JoinHandle<()>,
    /// Whether the recipient waits for a picture.
    is_free: Arc<AtomicBool>,
    interval: Duration,
    due: Instant,
}

impl Courier {
    /// Starts the thread. The first picture is taken `first` from now, the others at least `interval` apart.
    /// `None` where no thread can be started: the render does without.
    pub(super) fn start<R: Recipient>(mut to: R, first: Duration, interval: Duration) -> Option<Self> {
        let (sender, parcels) = sync_channel(1);
        let is_free = Arc::new(AtomicBool::new(true));
        let free = Arc::clone(&is_free);
        let builder = std::thread::Builder::new().name(R::NAME.to_owned());
        match builder.spawn(move || serve(&mut to, &parcels, &free)) {
            Ok(thread) => Some(Self { sender, thread, is_free, interval, due: Instant::now() + first }),
            Err(error) => {
                say::warning(format_args!("{}: cannot start a thread: {error}", R::NAME));
                None
            }
        }
    }

    /// Sends a picture, where one is due and the recipient is done with the one before.
    pub(super) fn offer(&mut self, watched: &Watched<'_>) {
        let now = Instant::now();
        // Relaxed, here and below: the channel orders everything else.
        if now < self.due || !self.is_free.swap(false, Ordering::Relaxed) {
            return;
        }
        self.due = now + self.interval;
        let picture = watched.film.picture(shown_error);
        // Where the thread has panicked, its hook has said so.
        let _ = self.sender.try_send(Parcel::Picture(picture, watched.progress.elapsed));
    }

    /// Sends the finished picture, where there is one, and waits until everything has arrived.
    pub(super) fn finish(self, film: Option<&Film>) {
        if let Some(film) = film {
            let _ = self.sender.send(Parcel::Last(film.picture(shown_error)));
        }
        drop(self.sender);
        let _ = self.thread.join();
    }
}

fn serve(to: &mut impl Recipient, parcels: &Receiver<Parcel>, is_free: &AtomicBool) {
    for parcel in parcels {
        match parcel {
            Parcel::Picture(picture, elapsed) => to.receive(&picture, elapsed),
            Parcel::Last(picture) => to.receive_last(&picture),
        }
        is_free.store(true, Ordering::Relaxed);
    }
}
