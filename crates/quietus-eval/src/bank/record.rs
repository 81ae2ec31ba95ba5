//! Recording: row by row, with the tracer that draws the pictures.

use std::io::Write;
use std::path::Path;

use quietus_trace::tile::{PixelWork, Sample, SampleSink, render_tile};
use quietus_trace::view::View;
use rayon::prelude::*;

use super::{Bank, BankSpec, REPLICATES, format::write_header};
use crate::{
    EvalError, Look, Subject,
    files::write_atomically,
    packed::{self, Negative},
};

/// Records the bank of `spec` at `path`, whole or not at all, on all threads of rayon's pool. `progress` is
/// told the share that is done, 0..=1.
///
/// # Errors
/// Where `spec` makes no sense, the scene cannot be drawn or draws negative light, or the file cannot be
/// written.
pub fn record(
    subject: &Subject,
    spec: &BankSpec,
    path: &Path,
    progress: impl FnMut(f64),
) -> Result<(), EvalError> {
    // Whatever is wrong with the request shows before anything is made.
    let views = views(subject, spec)?;
    write_atomically(path, |out| write_bank(subject, spec, &views, out, path, progress))
}

/// Records a bank that lives in memory.
///
/// # Errors
/// As [`record`].
pub fn record_in_memory(subject: &Subject, spec: &BankSpec) -> Result<Bank, EvalError> {
    let mut bytes = Vec::new();
    write_bank(subject, spec, &views(subject, spec)?, &mut bytes, Path::new(&spec.scene), |_| ())?;
    Bank::from_bytes(&spec.scene, bytes)
}

fn write_bank(
    subject: &Subject,
    spec: &BankSpec,
    views: &[View],
    out: &mut impl Write,
    path: &Path,
    mut progress: impl FnMut(f64),
) -> Result<(), EvalError> {
    write_header(spec, out).map_err(EvalError::io(path))?;
    let mut rays = Vec::with_capacity(spec.look.pixels());
    let rows: Vec<u32> = (0..spec.look.height).collect();
    // As many rows at once as keep all threads busy; they are written in order.
    for rows in rows.chunks(2 * rayon::current_num_threads()) {
        let recorded: Result<Vec<_>, _> =
            rows.par_iter().map(|&y| record_row(subject, spec, views, y)).collect();
        for row in recorded? {
            for word in &row.words {
                out.write_all(&word.to_le_bytes()).map_err(EvalError::io(path))?;
            }
            rays.extend(row.rays);
        }
        progress(f64::from(rows.last().map_or(0, |y| y + 1)) / f64::from(spec.look.height));
    }
    for mean in rays {
        out.write_all(&mean.to_le_bytes()).map_err(EvalError::io(path))?;
    }
    Ok(())
}

/// One view for each seed of a bank that makes sense.
fn views(subject: &Subject, spec: &BankSpec) -> Result<Vec<View>, EvalError> {
    spec.validate()?;
    let seeds = u64::from(spec.streams / REPLICATES);
    (0..seeds).map(|k| subject.view(&spec.look, spec.seed.wrapping_add(k))).collect()
}

struct Row {
    words: Vec<u64>,
    /// Mean rays of a sample, by pixel.
    rays: Vec<f32>,
}

fn record_row(subject: &Subject, spec: &BankSpec, views: &[View], y: u32) -> Result<Row, EvalError> {
    let per_pixel = spec.streams as usize * spec.samples as usize;
    let mut row = Row { words: Vec::with_capacity(spec.look.width as usize * per_pixel), rays: Vec::new() };
    for x in 0..spec.look.width {
        let mut rays = 0;
        for (k, view) in views.iter().enumerate() {
            let mut sink = Packer { words: &mut row.words, negative: None };
            let work = [0, 1].map(|replicate| work(x, y, replicate, spec.samples));
            rays += render_tile(&subject.scene, view, &work, &mut sink).rays;
            if let Some((work, index, Negative(value))) = sink.negative {
                return Err(EvalError::NegativeSample {
                    scene: subject.name.clone(),
                    seed: spec.seed.wrapping_add(k as u64),
                    x,
                    y,
                    replicate: work.replicate,
                    index,
                    value: value.to_array(),
                });
            }
        }
        row.rays.push((rays as f64 / per_pixel as f64) as f32);
    }
    Ok(row)
}

fn work(x: u32, y: u32, replicate: u8, count: u32) -> PixelWork {
    PixelWork { x, y, pixel: 0, replicate, first: 0, count }
}

/// Packs samples one after the other.
struct Packer<'a> {
    words: &'a mut Vec<u64>,
    negative: Option<(PixelWork, u32, Negative)>,
}

impl SampleSink for Packer<'_> {
    fn add(&mut self, work: &PixelWork, index: u32, sample: &Sample) {
        match packed::pack(sample.radiance, sample.alpha) {
            Ok(word) => self.words.push(word),
            Err(negative) => {
                self.words.push(packed::REJECTED);
                self.negative.get_or_insert((*work, index, negative));
            }
        }
    }
}

/// Pixels whose first samples are drawn again to see whether a file is what the tracer draws today.
const PROBES: usize = 64;
/// Samples of each of them.
const PROBE_SAMPLES: u32 = 8;

/// Draws the first `count` samples of replicate 0 of a few pixels, and tells them with the pixel's number.
fn probe(
    subject: &Subject,
    look: &Look,
    seed: u64,
    count: u32,
    mut tell: impl FnMut(usize, &[u64]),
) -> Result<(), EvalError> {
    let view = subject.view(look, seed)?;
    for probe in 0..PROBES {
        let pixel = (2 * probe + 1) * look.pixels() / (2 * PROBES);
        let (x, y) = (pixel as u32 % look.width, pixel as u32 / look.width);
        let mut words = Vec::new();
        let mut sink = Packer { words: &mut words, negative: None };
        render_tile(&subject.scene, &view, &[work(x, y, 0, count)], &mut sink);
        tell(pixel, &words);
    }
    Ok(())
}

/// Whether the tracer still draws what is in the bank, as far as a few samples tell.
pub(super) fn is_current(subject: &Subject, bank: &Bank) -> Result<bool, EvalError> {
    let spec = bank.spec();
    let mut same = true;
    probe(subject, &spec.look, spec.seed, PROBE_SAMPLES.min(spec.samples), |pixel, words| {
        let stored = bank.stream(pixel, 0).iter().map(|&bytes| u64::from_le_bytes(bytes));
        same &= words.iter().copied().eq(stored.take(words.len()));
    })?;
    Ok(same)
}

/// A number that changes when the tracer draws a few samples differently (FNV-1a over them).
pub(crate) fn fingerprint(subject: &Subject, look: &Look, seed: u64) -> Result<u64, EvalError> {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    probe(subject, look, seed, PROBE_SAMPLES, |_, words| {
        for byte in words.iter().flat_map(|word| word.to_le_bytes()) {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3);
        }
    })?;
    Ok(hash)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bank::open_or_record;

    fn spec() -> BankSpec {
        BankSpec { scene: "embedded".into(), look: Look::new(12, 9), streams: 4, samples: 16, seed: 7 }
    }

    #[test]
    fn a_bank_holds_the_samples_of_live_renders() {
        let subject = Subject::embedded().unwrap();
        let spec = spec();
        let bank = record_in_memory(&subject, &spec).unwrap();
        let view = subject.view(&spec.look, 8).unwrap();
        let mut words = Vec::new();
        let mut sink = Packer { words: &mut words, negative: None };
        render_tile(&subject.scene, &view, &[work(5, 3, 1, 16)], &mut sink);
        let stored: Vec<u64> = bank.stream(3 * 12 + 5, 3).iter().map(|&b| u64::from_le_bytes(b)).collect();
        assert_eq!(stored, words);
        assert!(bank.rays().iter().all(|&rays| rays >= 1.0) && bank.rays().len() == 108);
    }

    #[test]
    fn a_bank_is_kept_while_it_is_current_and_made_anew_where_it_is_not() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("box.bank");
        let subject = Subject::embedded().unwrap();
        let count = |spec: &BankSpec| {
            let mut recorded = 0;
            open_or_record(&subject, spec, &path, |_| recorded += 1).unwrap();
            recorded > 0
        };
        assert!(count(&spec()));
        assert!(!count(&spec()));
        assert!(count(&BankSpec { seed: 9, ..spec() }), "another seed");
        let mut bytes = std::fs::read(&path).unwrap();
        bytes[4096..][..8].copy_from_slice(&7u64.to_le_bytes());
        std::fs::write(&path, &bytes).unwrap();
        assert!(count(&BankSpec { seed: 9, ..spec() }), "another tracer");
    }

    #[test]
    fn a_damaged_bank_is_refused_with_what_is_wrong() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("box.bank");
        record(&Subject::embedded().unwrap(), &spec(), &path, |_| ()).unwrap();
        let whole = std::fs::read(&path).unwrap();
        let message = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            Bank::open(&path).unwrap_err().to_string()
        };
        let cut = message(&whole[..whole.len() - 1]);
        assert!(cut.contains("box.bank") && cut.contains("59823") && cut.contains("asks for 59824"), "{cut}");
        assert!(message(&whole[..100]).contains("ends within its header, after 100 bytes"));
        assert!(message(b"").contains("not a bank"));
        assert!(message(b"PNG and more").contains("expected it to start with \"quietus-bank 1\""));
        let text = String::from_utf8_lossy(&whole[..4096]).replace("\"streams\":4", "\"streams\":5");
        assert!(message(text.as_bytes()).contains("expected an even number"));
        assert!(
            message(text.replace("\"streams\":5", "\"strEams\":5").as_bytes())
                .contains("missing field `streams`")
        );
    }
}
