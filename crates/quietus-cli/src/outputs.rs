//! The files of a finished render: all that can be written are written, and what cannot be is kept elsewhere.

use std::io::Write;
use std::path::{Path, PathBuf};

use quietus_film::{Metadata, OutputError, OutputFormat, Picture, write_atomically, write_exr, write_png};
use quietus_render::{Rendered, shown_error};

use crate::error::{Ending, Failure};
use crate::report::{Settings, result_metadata, write_stats};

/// A finished render, and where it goes.
pub(crate) struct Outputs<'a> {
    /// Pictures to write.
    pub pictures: Vec<(PathBuf, OutputFormat)>,
    /// Where the tree goes.
    pub tree: Option<PathBuf>,
    /// Where the statistics go.
    pub stats: Option<PathBuf>,
    /// All settings.
    pub settings: &'a Settings,
    /// How long the scene took to load.
    pub load_seconds: f64,
}

/// What became of them.
pub(crate) struct Written {
    /// Pictures that are where they should be.
    pub pictures: Vec<PathBuf>,
    /// What went wrong, one sentence for each file.
    pub errors: Vec<String>,
}

impl Outputs<'_> {
    /// Writes everything. An error with one file keeps no other from being written.
    pub(crate) fn write(&self, rendered: &Rendered) -> Written {
        let picture = rendered.film.picture(shown_error);
        let mut metadata = self.settings.metadata();
        metadata.extend(result_metadata(rendered));
        let mut written = Written { pictures: Vec::new(), errors: Vec::new() };
        for (path, format) in &self.pictures {
            match write_picture(path, *format, &picture, &metadata) {
                Ok(()) => written.pictures.push(path.clone()),
                Err(error) => written.errors.push(rescue(path, *format, &picture, &metadata, &error)),
            }
        }
        let tree = self.tree.iter().map(|path| write_tree(path, rendered));
        let stats =
            self.stats.iter().map(|path| write_stats(path, self.settings, self.load_seconds, rendered));
        let errors = tree.chain(stats).filter_map(Result::err);
        written.errors.extend(errors.map(|error| error.to_string()));
        written
    }
}

impl Written {
    /// Whether all went well.
    ///
    /// # Errors
    /// When a file was not written.
    pub(crate) fn check(self) -> Result<(), Failure> {
        match self.errors.is_empty() {
            true => Ok(()),
            false => Err(Failure { ending: Ending::Output, message: self.errors.join("\n") }),
        }
    }
}

/// Writes a picture in the format that its name asks for.
pub(crate) fn write_picture(
    path: &Path,
    format: OutputFormat,
    picture: &Picture,
    metadata: &Metadata,
) -> Result<(), OutputError> {
    match format {
        OutputFormat::Exr => write_exr(path, picture, metadata),
        OutputFormat::Png => write_png(path, picture),
    }
}

/// Hours of work should not be lost for want of space: tries the directory for temporary files. Returns what to say.
fn rescue(
    path: &Path,
    format: OutputFormat,
    picture: &Picture,
    metadata: &Metadata,
    error: &OutputError,
) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let elsewhere = std::env::temp_dir().join(format!("quietus-{}-{name}", std::process::id()));
    match write_picture(&elsewhere, format, picture, metadata) {
        Ok(()) => format!("{error}; the picture is kept as {}", elsewhere.display()),
        Err(other) => format!("{error}; nor can it be kept elsewhere: {other}"),
    }
}

fn write_tree(path: &Path, rendered: &Rendered) -> Result<(), OutputError> {
    let svg = rendered.sampling.tree_svg();
    write_atomically(path, |writer| {
        let failed = |source| OutputError::Write { path: path.to_owned(), source };
        writer.write_all(svg.as_bytes()).map_err(failed)
    })
}
