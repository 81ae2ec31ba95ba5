//! What the operating system knows of this process.

use std::time::Duration;

/// CPU time of all threads of this process so far; `None` where the system does not tell.
pub(crate) fn cpu_time() -> Option<Duration> {
    #[cfg(unix)]
    {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
        Some(Duration::new(u64::try_from(time.tv_sec).ok()?, u32::try_from(time.tv_nsec).ok()?))
    }
    #[cfg(not(unix))]
    None
}

/// The most memory this process has held at once, in bytes; `None` where the system does not tell.
pub(crate) fn peak_rss_bytes() -> Option<u64> {
    kibibytes("/proc/self/status", "VmHWM:")
}

/// Memory that could be had without swapping, in bytes; `None` where the system does not tell.
pub fn available_memory() -> Option<u64> {
    kibibytes("/proc/meminfo", "MemAvailable:")
}

/// The line of a Linux status file that starts with `key`, given there in KiB.
fn kibibytes(file: &str, key: &str) -> Option<u64> {
    let text = std::fs::read_to_string(file).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(key))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn memory_and_time_are_known_and_plausible() {
        let filled = vec![1_u8; 64 << 20];
        assert!(peak_rss_bytes().unwrap() > std::hint::black_box(&filled).len() as u64);
        assert!(available_memory().unwrap() > 0);
        let before = cpu_time().unwrap();
        let mut x = 1.0_f64;
        (0..10_000_000).for_each(|_| x = std::hint::black_box(x.sin()));
        assert!(cpu_time().unwrap() > before);
    }
}
