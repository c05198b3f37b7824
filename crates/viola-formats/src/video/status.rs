//! Exit status of processes.

use std::process::ExitStatus;

/// Returns whether a process ended by a signal that requests it. A stop of the service may signal all of its
/// processes, so such an end is no failure of the work.
#[cfg(unix)]
pub fn was_asked_to_stop(status: ExitStatus) -> bool {
    use rustix::process::Signal;
    use std::os::unix::process::ExitStatusExt;
    let asks = [Signal::TERM, Signal::INT, Signal::HUP];
    status.signal().is_some_and(|number| asks.iter().any(|signal| signal.as_raw() == number))
}

#[cfg(not(unix))]
pub fn was_asked_to_stop(_: ExitStatus) -> bool {
    false
}
