//! Files that appear whole or not at all.

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A picture file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputFormat {
    /// OpenEXR with all channels.
    Exr,
    /// 8-bit sRGB.
    Png,
}

impl OutputFormat {
    /// The format a file name asks for.
    ///
    /// # Errors
    /// When the extension is neither `.exr` nor `.png`.
    pub fn of(path: &Path) -> Result<Self, OutputError> {
        let extension = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
        match extension.as_deref() {
            Some("exr") => Ok(Self::Exr),
            Some("png") => Ok(Self::Png),
            _ => Err(OutputError::Extension(path.to_owned())),
        }
    }
}

/// Why a file could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// Neither `.exr` nor `.png`.
    #[error("{}: unknown picture format: expected a name that ends in .exr or .png", .0.display())]
    Extension(PathBuf),
    /// The name belongs to something that is not a plain file.
    #[error("{}: exists and is not a regular file", .0.display())]
    NotAFile(PathBuf),
    /// The file system says no.
    #[error("{}: cannot write: {source}", .path.display())]
    Write {
        /// The file asked for.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The file system does not let it be read.
    #[error("{}: {}", .path.display(), unread(.source))]
    Read {
        /// The file asked for.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The encoder or decoder says no.
    #[error("{}: {message}", .path.display())]
    Format {
        /// The file asked for.
        path: PathBuf,
        /// What is wrong with it.
        message: String,
    },
}

/// Temporary files that exist now, for [`remove_unfinished`].
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn unfinished() -> MutexGuard<'static, Vec<PathBuf>> {
    // A list of paths is whole at any time.
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A file beside its destination, removed unless it was renamed to it.
struct Temporary {
    path: PathBuf,
}

impl Drop for Temporary {
    fn drop(&mut self) {
        unfinished().retain(|path| *path != self.path);
        // Renamed, it is not there any more; else nothing sensible is left to do when even this fails.
        let _ = fs::remove_file(&self.path);
    }
}

/// Removes the temporary files of all writes under way, for a program that is about to exit in the middle of them.
pub fn remove_unfinished() {
    for path in unfinished().iter() {
        // The program exits: there is nobody to tell.
        let _ = fs::remove_file(path);
    }
}

/// Removes what processes that were killed have left beside `target` while they wrote it. `is_running` tells of a
/// process, by its number, whether it may still be writing.
fn remove_abandoned(target: &Path, is_running: impl Fn(u32) -> bool) {
    let Some(name) = target.file_name().and_then(|name| name.to_str()) else { return };
    let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let process = entry.file_name().to_str().and_then(|part| {
            let number =
                part.strip_prefix('.')?.strip_prefix(name)?.strip_prefix('.')?.strip_suffix(".part")?;
            number.split_once('-')?.0.parse().ok()
        });
        if process.is_some_and(|process| !is_running(process)) {
            // Left by somebody who is gone; where it cannot be removed it does no harm.
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Whether there is a process of this number; true where the system does not tell.
fn is_running(process: u32) -> bool {
    #[cfg(unix)]
    {
        let pid = i32::try_from(process).ok().and_then(rustix::process::Pid::from_raw);
        pid.is_some_and(|pid| rustix::process::test_kill_process(pid) != Err(rustix::io::Errno::SRCH))
    }
    #[cfg(not(unix))]
    {
        let _ = process;
        true
    }
}

/// What gets replaced by writing `path`: the target of a symbolic link, not the link.
fn destination(path: &Path) -> PathBuf {
    fs::canonicalize(path).unwrap_or_else(|_| path.to_owned())
}

/// Creates a new file in the directory of what `path` stands for: only there is a rename atomic.
fn create_beside(path: &Path) -> Result<(Temporary, File), OutputError> {
    let failed = |source| OutputError::Write { path: path.to_owned(), source };
    let target = destination(path);
    let Some(name) = target.file_name() else {
        return Err(failed(io::Error::new(io::ErrorKind::InvalidInput, "the path names no file")));
    };
    match fs::metadata(path) {
        // Renaming would replace a device or pipe instead of writing to it.
        Ok(existing) if !existing.is_file() => return Err(OutputError::NotAFile(path.to_owned())),
        Ok(existing) if existing.permissions().readonly() => {
            return Err(failed(io::Error::new(io::ErrorKind::PermissionDenied, "the file is read-only")));
        }
        _ => {}
    }
    remove_abandoned(&target, is_running);
    let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut number = 0;
    loop {
        let mut hidden = OsString::from(".");
        hidden.push(name);
        hidden.push(format!(".{}-{number}.part", std::process::id()));
        let beside = target.with_file_name(hidden);
        match OpenOptions::new().write(true).create_new(true).open(&beside) {
            Ok(file) => {
                unfinished().push(beside.clone());
                return Ok((Temporary { path: beside }, file));
            }
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists && number < 100 => number += 1,
            Err(error) if error.kind() == io::ErrorKind::NotFound && !folder.is_dir() => {
                let message = format!("there is no folder {}", folder.display());
                return Err(failed(io::Error::new(error.kind(), message)));
            }
            Err(error) => return Err(failed(error)),
        }
    }
}

/// Why a file cannot be read.
fn unread(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::NotFound => "no such file".to_owned(),
        _ => format!("cannot read: {error}"),
    }
}

/// Finds out whether `path` could be written, leaving nothing behind.
///
/// # Errors
/// When its directory is missing or not writable, or `path` is a directory, a device or read-only.
pub fn check_writable(path: &Path) -> Result<(), OutputError> {
    create_beside(path).map(drop)
}

/// Writes `path` by way of a temporary file in the same directory that is renamed when everything is on the disk.
///
/// # Errors
/// When the file system refuses or `write` fails; `path` is then untouched and nothing is left beside it.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), OutputError>,
) -> Result<(), OutputError> {
    let failed = |source| OutputError::Write { path: path.to_owned(), source };
    let (temporary, file) = create_beside(path)?;
    let mut writer = BufWriter::new(file);
    write(&mut writer)?;
    writer.flush().map_err(failed)?;
    writer.get_ref().sync_all().map_err(failed)?;
    drop(writer);
    fs::rename(&temporary.path, destination(path)).map_err(failed)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(dir: &Path) -> Vec<String> {
        fs::read_dir(dir).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
    }

    #[test]
    fn what_killed_writers_left_is_removed_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let names =
            [".a.exr.7-0.part", ".a.exr.8-0.part", ".b.exr.7-0.part", "a.exr.7-0.part", ".a.exr.x-0.part"];
        names.iter().for_each(|name| fs::write(dir.path().join(name), "").unwrap());
        remove_abandoned(&dir.path().join("a.exr"), |process| process == 8);
        let left = names.map(|name| dir.path().join(name).exists());
        assert_eq!(left, [false, true, true, true, true]);
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        fs::write(&path, "old").unwrap();
        let error = write_atomically(&path, |w| {
            w.write_all(b"half").unwrap();
            Err(OutputError::Format { path: path.clone(), message: "broken".into() })
        });
        assert!(error.is_err());
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(entries(dir.path()), ["a.txt"]);
        write_atomically(&path, |w| w.write_all(b"new").map_err(|_| unreachable!())).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
        assert_eq!(entries(dir.path()), ["a.txt"]);
    }

    #[test]
    fn what_cannot_be_written_is_known_beforehand() {
        let dir = tempfile::tempdir().unwrap();
        check_writable(&dir.path().join("fine.png")).unwrap();
        assert!(entries(dir.path()).is_empty());
        assert!(matches!(check_writable(dir.path()), Err(OutputError::NotAFile(_))));
        let missing = check_writable(&dir.path().join("no/such/dir/a.png")).unwrap_err();
        assert!(missing.to_string().contains("no/such/dir/a.png: cannot write"), "{missing}");
        assert!(check_writable(Path::new("..")).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn a_symbolic_link_stays_one() {
        let (here, there) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let (link, target) = (here.path().join("a.txt"), there.path().join("b.txt"));
        fs::write(&target, "old").unwrap();
        std::os::unix::fs::symlink(&target, &link).unwrap();
        // While it is written, the unfinished file is where the target is: a rename cannot leave a file system.
        write_atomically(&link, |w| {
            assert_eq!((entries(here.path()).len(), entries(there.path()).len()), (1, 2));
            w.write_all(b"new").map_err(|_| unreachable!())
        })
        .unwrap();
        assert!(link.is_symlink());
        assert_eq!(fs::read_to_string(&target).unwrap(), "new");
        assert_eq!(entries(there.path()), ["b.txt"]);
    }

    #[test]
    fn formats_are_told_by_the_extension() {
        assert_eq!(OutputFormat::of(Path::new("a.EXR")).unwrap(), OutputFormat::Exr);
        assert_eq!(OutputFormat::of(Path::new("a.b.png")).unwrap(), OutputFormat::Png);
        let error = OutputFormat::of(Path::new("a.tif")).unwrap_err();
        assert_eq!(
            error.to_string(),
            "a.tif: unknown picture format: expected a name that ends in .exr or .png"
        );
        assert!(OutputFormat::of(Path::new("png")).is_err());
    }
}
