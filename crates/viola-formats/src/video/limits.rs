//! What a process that decodes may take.

use std::process::Command;
use std::time::Duration;

/// Limits of a child. The defaults hold the largest pictures that are taken, and a slow machine.
#[derive(Debug, Clone)]
pub struct Limits {
    /// Address space in bytes.
    pub memory_bytes: u64,
    /// Seconds of processor time, to which half a second for each sample of the track is added.
    pub processor_s: u64,
    /// How long it may say nothing while it is being waited for.
    pub silence: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Limits { memory_bytes: 3 << 29, processor_s: 60, silence: Duration::from_secs(30) }
    }
}

impl Limits {
    /// Has the system hold the child of `command` to the limits from before its first instruction; it writes no
    /// core either.
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
        // SAFETY: between fork and exec only system calls are made; nothing is allocated and no lock is taken.
        unsafe {
            command.pre_exec(move || {
                for (resource, limit) in limits {
                    // macOS knows no limit of address space and refuses it; the others hold there.
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
