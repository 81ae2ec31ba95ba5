//! A study: a scene with its bank and its reference, kept in a directory from one time to the next.

use std::path::{Path, PathBuf};

use crate::{
    Bank, BankSpec, EvalError, Look, Reference, ReferenceSpec, Subject, bank::open_or_record,
    reference::REFERENCE_SEED,
};

/// What bank and reference are made of.
#[derive(Clone, Debug)]
pub struct StudySpec {
    /// How scenes are looked at.
    pub look: Look,
    /// Streams of the bank.
    pub streams: u32,
    /// Samples in each.
    pub samples: u32,
    /// Seed of the bank.
    pub seed: u64,
    /// Samples of the reference, in [`Self::REFERENCE_STREAMS`] equal streams.
    pub reference_spp: u32,
}

impl StudySpec {
    /// Independent streams of a reference: enough for the variances they give.
    pub const REFERENCE_STREAMS: u32 = 32;

    /// Of the scene called `scene`.
    pub fn bank(&self, scene: &str) -> BankSpec {
        BankSpec {
            scene: scene.to_owned(),
            look: self.look.clone(),
            streams: self.streams,
            samples: self.samples,
            seed: self.seed,
        }
    }

    /// Of the scene called `scene`.
    pub fn reference(&self, scene: &str) -> ReferenceSpec {
        ReferenceSpec {
            scene: scene.to_owned(),
            look: self.look.clone(),
            streams: Self::REFERENCE_STREAMS,
            samples: self.reference_spp.div_ceil(Self::REFERENCE_STREAMS),
            seed: REFERENCE_SEED,
        }
    }

    /// Where the reference of the scene called `scene`, as it is shown, is in `directory`.
    pub fn shown_path(&self, directory: &Path, scene: &str) -> PathBuf {
        self.path(directory, scene, "shown-reference.exr")
    }

    /// Where the files of the scene called `scene` are in `directory`.
    fn path(&self, directory: &Path, scene: &str, rest: &str) -> PathBuf {
        let Look { width, height, max_depth, filter } = &self.look;
        let plain = |c: char| if c.is_alphanumeric() || c == '-' { c } else { '_' };
        let scene: String = scene.chars().map(plain).collect();
        directory.join(format!("{scene}-{width}x{height}-{filter}-{max_depth}-{rest}"))
    }
}

/// A bank and its reference.
#[derive(Debug)]
pub struct Study {
    /// What is replayed.
    pub bank: Bank,
    /// What it is compared with.
    pub reference: Reference,
}

impl Study {
    /// Takes from `directory` what is there and current, makes the rest and keeps it there. `tell` is told
    /// what is being made, and the share that is done.
    ///
    /// # Errors
    /// Where the scene cannot be drawn, or a file cannot be written.
    pub fn open(
        subject: &Subject,
        spec: &StudySpec,
        directory: &Path,
        mut tell: impl FnMut(&str, f64),
    ) -> Result<Self, EvalError> {
        let name = &subject.name;
        let (bank_spec, reference_spec) = (spec.bank(name), spec.reference(name));
        let bank = format!("{}x{}-seed-{}.bank", bank_spec.streams, bank_spec.samples, bank_spec.seed);
        let bank = spec.path(directory, name, &bank);
        let reference = format!("{}x{}.exr", reference_spec.streams, reference_spec.samples);
        let reference = spec.path(directory, name, &reference);
        Ok(Self {
            bank: open_or_record(subject, &bank_spec, &bank, |share| tell("bank", share))?,
            reference: Reference::open_or_render(subject, &reference_spec, &reference, || {
                tell("reference", 0.0);
            })?,
        })
    }
}
