//! Files: where banks and references are kept, and how they are written.

use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::EvalError;

/// Where banks and references are kept: `$XDG_CACHE_HOME/quietus/eval`, else `~/.cache/quietus/eval`, else
/// the system's directory for temporary files.
pub fn cache_directory() -> PathBuf {
    let set = |name| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let cache = set("XDG_CACHE_HOME").or_else(|| set("HOME").map(|home| home.join(".cache")));
    cache.unwrap_or_else(std::env::temp_dir).join("quietus").join("eval")
}

/// Writes `path` by way of a file beside it that is renamed when it is complete; makes missing directories.
pub(crate) fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), EvalError>,
) -> Result<(), EvalError> {
    let directory = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if directory.exists() && !directory.is_dir() {
        return Err(EvalError::format(directory, "is not a folder"));
    }
    fs::create_dir_all(directory).map_err(EvalError::io(directory))?;
    let mut beside = path.as_os_str().to_owned();
    beside.push(format!(".{}.part", std::process::id()));
    let beside = PathBuf::from(beside);
    let written = (|| {
        let mut out =
            BufWriter::with_capacity(1 << 20, File::create(&beside).map_err(EvalError::io(&beside))?);
        write(&mut out)?;
        out.flush().map_err(EvalError::io(&beside))?;
        fs::rename(&beside, path).map_err(EvalError::io(path))
    })();
    if written.is_err() {
        // Best effort: the first error is the one to tell.
        let _ = fs::remove_file(&beside);
    }
    written
}
