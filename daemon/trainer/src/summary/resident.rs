//! Memory of this process, as the kernel counts it.

/// The value that `/proc/self/status` gives for `key` (as "VmRSS:"), megabytes (10^6 bytes); `None` where the kernel does not
/// say.
pub fn memory_mb(key: &str) -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with(key))?;
    let kib: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some((kib * 1.024).round() / 1000.0)
}
