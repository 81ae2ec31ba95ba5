//! `--save-every`: the picture so far, in the files that the finished one will be in.

use std::path::PathBuf;
use std::time::Duration;

use quietus_film::{Metadata, OutputFormat, Picture};

use super::courier::Recipient;
use crate::outputs::write_picture;
use crate::say;

/// Writes unfinished pictures.
pub(super) struct Saver {
    /// Files, formats.
    pub outputs: Vec<(PathBuf, OutputFormat)>,
    /// Settings of the render.
    pub metadata: Metadata,
    /// What went wrong the last time: it is said once.
    pub trouble: Option<String>,
}

impl Recipient for Saver {
    const NAME: &'static str = "--save-every";

    fn receive(&mut self, picture: &Picture, elapsed: Duration) {
        let _span = tracing::debug_span!("save").entered();
        let mut metadata = self.metadata.clone();
        metadata.push(("unfinished".to_owned(), format!("{:.1} s", elapsed.as_secs_f64())));
        let errors = self.outputs.iter().filter_map(|(path, format)| {
            write_picture(path, *format, picture, &metadata).err().map(|error| error.to_string())
        });
        let errors: Vec<_> = errors.collect();
        let trouble = (!errors.is_empty()).then(|| errors.join("; "));
        if trouble != self.trouble {
            match &trouble {
                Some(errors) => {
                    say::warning(format_args!("{errors}; the render goes on, and will try again"))
                }
                None => say::aside("the picture so far can be written again"),
            }
        }
        if trouble.is_none() {
            tracing::info!("saved the picture so far, after {:.1} s", elapsed.as_secs_f64());
        }
        self.trouble = trouble;
    }
}
