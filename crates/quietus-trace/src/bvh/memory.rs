//! Large memory in large pages: rays visit nodes all over the place, and with small pages nearly every visit
//! costs a page walk on top.

use std::mem::MaybeUninit;

/// Asks the system to back `memory`, which has not been touched yet, by huge pages. A hint: errors are ignored.
pub(super) fn prefer_huge_pages<T>(memory: &mut [MaybeUninit<T>]) {
    /// Below this a huge page (2 MiB where they are common) may not fit.
    const WORTH: usize = 4 << 20;
    let bytes = size_of_val(memory);
    if bytes >= WORTH {
        advise(memory.as_mut_ptr().cast(), bytes);
    }
}

#[cfg(target_os = "linux")]
fn advise(start: *mut u8, bytes: usize) {
    // SAFETY: sysconf has no preconditions.
    let page = unsafe { libc::sysconf(libc::_SC_PAGESIZE) };
    let Ok(page) = usize::try_from(page) else { return };
    let skip = start.align_offset(page);
    if let Some(bytes) = bytes.checked_sub(skip) {
        // SAFETY: the range lies within one allocation; the advice changes its backing, not its contents.
        unsafe { libc::madvise(start.wrapping_add(skip).cast(), bytes, libc::MADV_HUGEPAGE) };
    }
}

#[cfg(not(target_os = "linux"))]
fn advise(_start: *mut u8, _bytes: usize) {}
