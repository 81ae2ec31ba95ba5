//! A panic while rendering: which sample was it?

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

use quietus_trace::tile::{PixelWork, Sample, SampleSink};

use crate::tracer::Tracer;

/// The sample that made the tracer panic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// Column in the full frame.
    pub x: u32,
    /// Row in the full frame.
    pub y: u32,
    /// Replicate of the pixel.
    pub replicate: u8,
    /// Sample index within the replicate.
    pub index: u32,
    /// What the panic said.
    pub message: String,
}

struct Discard;

impl SampleSink for Discard {
    fn add(&mut self, _: &PixelWork, _: u32, _: &Sample) {}
}

/// The guilty sample among `work`, found by drawing its samples again one by one: a sample depends on nothing but
/// its own numbers, so it panics again. Where none does (a fault of the machine, or of the sink), the first
/// sample of the tile is named and the message says so.
pub(crate) fn locate(tracer: &impl Tracer, work: &[PixelWork], payload: &(dyn Any + Send)) -> Fault {
    let again = work.iter().flat_map(|run| {
        (0..run.count).map(|offset| PixelWork { first: run.first + offset, count: 1, ..*run })
    });
    for one in again {
        let outcome =
            catch_unwind(AssertUnwindSafe(|| tracer.render_tile(std::slice::from_ref(&one), &mut Discard)));
        if let Err(payload) = outcome {
            return fault(&one, message(payload.as_ref()));
        }
    }
    let note = format!("{} (somewhere in this tile; it did not happen again)", message(payload));
    match work.first() {
        Some(run) => fault(run, note),
        None => Fault { x: 0, y: 0, replicate: 0, index: 0, message: note },
    }
}

fn fault(run: &PixelWork, message: String) -> Fault {
    Fault { x: run.x, y: run.y, replicate: run.replicate, index: run.first, message }
}

fn message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().map(|s| (*s).to_owned());
    text.or_else(|| payload.downcast_ref::<String>().cloned()).unwrap_or_else(|| "unknown panic".into())
}
