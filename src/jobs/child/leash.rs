//! A running process that one thread waits for and another may kill.

use std::io;
use std::process::{Child, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

#[derive(Default)]
pub(in crate::jobs) struct Leash(Mutex<State>);

/// The ends of a process's pipes.
pub(in crate::jobs) struct Pipes {
    /// `None` if its standard input is no pipe.
    pub stdin: Option<ChildStdin>,
    pub stdout: ChildStdout,
}

pub(in crate::jobs) struct KilledOnDrop(pub Arc<Leash>);

impl Drop for KilledOnDrop {
    fn drop(&mut self) {
        self.0.kill();
    }
}

#[derive(Default)]
struct State {
    child: Option<Child>,
    is_killed: bool,
}

impl Leash {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Starts the process with a pipe for its standard output; returns `None` after a call of [`Leash::kill`]. The process ends
    /// with this thread.
    pub fn start(&self, command: &mut Command) -> io::Result<Option<Pipes>> {
        confine(command.stdout(Stdio::piped()));
        let mut state = self.lock();
        if state.is_killed {
            return Ok(None);
        }
        let mut child = command.spawn()?;
        let (stdin, stdout) = (child.stdin.take(), child.stdout.take());
        state.child = Some(child);
        Ok(stdout.map(|stdout| Pipes { stdin, stdout }))
    }

    pub fn kill(&self) {
        let mut state = self.lock();
        state.is_killed = true;
        if let Some(child) = &mut state.child {
            // It may have ended by itself.
            let _ = child.kill();
        }
    }

    /// Ends a process that closed its standard output; returns its status and whether it was killed before.
    pub fn end(&self) -> io::Result<(ExitStatus, bool)> {
        let mut state = self.lock();
        let is_killed = state.is_killed;
        let child = state.child.as_mut().ok_or_else(|| io::Error::other("there is no process"))?;
        // An ending process closes its files after its status is set: this kills only one that would live on.
        let _ = child.kill();
        Ok((child.wait()?, is_killed))
    }
}

/// Makes the system kill the process when the thread that starts it ends, even by the death of its process,
/// and write no core file.
#[cfg(target_os = "linux")]
fn confine(command: &mut Command) {
    use rustix::io::Errno;
    use rustix::process::{
        Resource, Rlimit, Signal, getpid, getppid, set_parent_process_death_signal, setrlimit,
    };
    use std::os::unix::process::CommandExt;
    let parent = getpid();
    // SAFETY: between fork and exec only system calls are made; nothing is allocated and no lock is taken.
    unsafe {
        command.pre_exec(move || {
            setrlimit(Resource::Core, Rlimit { current: Some(0), maximum: Some(0) })?;
            set_parent_process_death_signal(Some(Signal::KILL))?;
            // The parent may have died before that.
            if getppid() == Some(parent) { Ok(()) } else { Err(Errno::SRCH.into()) }
        });
    }
}

/// On other systems the process notices at its next message that nobody reads.
#[cfg(not(target_os = "linux"))]
fn confine(_: &mut Command) {}
