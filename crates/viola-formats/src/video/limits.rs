//! Limits of a decoding process.

use std::process::Command;
use std::time::Duration;

/// Limits of a child. The defaults suffice for the largest allowed pictures and a slow machine.
#[derive(Debug, Clone)]
pub struct Limits {
    /// Address space in bytes.
    pub memory_bytes: u64,
    /// Seconds of CPU time, plus half a second for each sample of the track.
    pub processor_s: u64,
    /// Timeout for a message while the parent waits.
    pub silence: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Limits { memory_bytes: 3 << 29, processor_s: 60, silence: Duration::from_secs(30) }
    }
}

impl Limits {
    /// Makes the system apply the limits to the child of `command` before its first instruction, and disables
    /// core dumps.
    #[cfg(unix)]
    pub(super) fn impose(&self, command: &mut Command, samples: usize) {
        use rustix::process::{Resource, Rlimit, setrlimit};
        use std::os::unix::process::CommandExt;
        let fixed = |most: u64| Rlimit { current: Some(most), maximum: Some(most) };
        let processor_s = self.processor_s + samples as u64 / 2;
        let limits = [
            (Resource::As, fixed(self.memory_bytes)),
            (Resource::Cpu, fixed(processor_s)),
            (Resource::Core, fixed(0)),
        ];
        // SAFETY: between fork and exec there are only system calls, no allocations and no locks.
        unsafe {
            command.pre_exec(move || {
                for (resource, limit) in limits {
                    // macOS refuses a limit of address space; the others apply there.
                    let set = setrlimit(resource, limit);
                    if cfg!(target_os = "linux") {
                        set?;
                    }
                }
                Ok(())
            });
        }
    }

    #[cfg(not(unix))]
    pub(super) fn impose(&self, _: &mut Command, _: usize) {}
}
