//! Leaving in the middle of a write. Alone in its process: what is removed are all unfinished files of a process.

use std::io::Write;

use quietus_film::{remove_unfinished, write_atomically};

#[test]
fn unfinished_files_can_be_removed_from_anywhere() {
    let dir = tempfile::tempdir().unwrap();
    let entries = || std::fs::read_dir(dir.path()).unwrap().count();
    let path = dir.path().join("a.txt");
    let broken = write_atomically(&path, |writer| {
        writer.write_all(b"half").unwrap();
        assert_eq!(entries(), 1);
        remove_unfinished();
        assert_eq!(entries(), 0);
        Ok(())
    });
    assert!(broken.is_err());
    assert_eq!(entries(), 0);
}
