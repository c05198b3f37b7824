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

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::process::ExitStatusExt;

    #[test]
    fn only_signals_that_ask_count() {
        // Numbers of signal(7): HUP, INT, TERM; QUIT, ABRT, KILL, SEGV.
        for (signal, asks) in
            [(1, true), (2, true), (15, true), (3, false), (6, false), (9, false), (11, false)]
        {
            assert_eq!(was_asked_to_stop(ExitStatus::from_raw(signal)), asks, "{signal}");
        }
        // Exit codes 0 and 1.
        assert!(!was_asked_to_stop(ExitStatus::from_raw(0)));
        assert!(!was_asked_to_stop(ExitStatus::from_raw(1 << 8)));
    }
}
