//! Memory of the child's own process.

use std::io;

/// Limits the memory of this process to `more_bytes` in addition to what it has: an allocation beyond it ends
/// the process. If the whole system runs out of memory, this process goes before its parent.
#[cfg(target_os = "linux")]
pub(in crate::jobs) fn limit(more_bytes: u64) -> io::Result<()> {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    use std::fs;
    // It may be unwritable in a container; the limit holds nevertheless.
    let _ = fs::write("/proc/self/oom_score_adj", "1000");
    let status = fs::read_to_string("/proc/self/status")?;
    // Private writable mappings: neither the files of networks nor reserved addresses count.
    let has_kib =
        status.lines().find_map(|line| line.strip_prefix("VmData:")?.strip_suffix("kB")?.trim().parse().ok());
    let has_kib: u64 = has_kib.ok_or_else(|| io::Error::other("/proc/self/status has no VmData"))?;
    let most = has_kib.saturating_mul(1 << 10).saturating_add(more_bytes);
    let maximum = getrlimit(Resource::Data).maximum;
    let current = Some(maximum.map_or(most, |maximum| maximum.min(most)));
    Ok(setrlimit(Resource::Data, Rlimit { current, maximum: current })?)
}

/// Other systems have no such limit.
#[cfg(not(target_os = "linux"))]
pub(in crate::jobs) fn limit(_: u64) -> io::Result<()> {
    Ok(())
}
