//! Which files were read, and what was in them: so that a render that goes on later can tell whether its scene is still
//! the same.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// The content of a file that was read, in short.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Fingerprint {
    /// Where it was read.
    pub path: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// The 128 bits of XXH3 over its content. Two files that differ by mistake do not agree in it; somebody who wants
    /// to can make such.
    pub hash: u128,
}

/// Size and hash of every file read by this process, as of when it was read last. One list for the process: files are
/// read by many readers on many threads, and whoever asks wants to know of all.
static READ: Mutex<BTreeMap<PathBuf, (u64, u128)>> = Mutex::new(BTreeMap::new());

/// Every file that this process has read for a scene so far, environment maps included, by path.
pub fn files_read() -> Vec<Fingerprint> {
    let fingerprint = |(path, &(bytes, hash)): (&PathBuf, _)| Fingerprint { path: path.clone(), bytes, hash };
    files().iter().map(fingerprint).collect()
}

/// Takes down that `path` holds `content`.
pub(crate) fn note(path: &Path, content: &[u8]) {
    let entry = (content.len() as u64, xxhash_rust::xxh3::xxh3_128(content));
    files().insert(path.to_owned(), entry);
}

/// The map is whole at any time.
fn files() -> MutexGuard<'static, BTreeMap<PathBuf, (u64, u128)>> {
    READ.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_read_is_known_by_its_content() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        let read = |content: &str| {
            std::fs::write(&path, content).unwrap();
            crate::file::read(&path).unwrap();
            files_read().into_iter().find(|file| file.path == path).unwrap()
        };
        let [one, other, again] = ["one", "other", "one"].map(read);
        assert!(one == again && one.hash != other.hash);
        assert_eq!((one.bytes, other.bytes), (3, 5));
    }
}
