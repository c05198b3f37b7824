//! Pauses of a search that takes long.

use std::time::{Duration, Instant};

/// Pause after a search without a result, as a multiple of its time.
const PAUSE: u32 = 10;
/// Longest pause: a search may have waited for a slow database.
const LONGEST_PAUSE: Duration = Duration::from_secs(30);

/// The pause of a worker's search for merges. After a night of new LiDAR maps it reads all homes whose clips wait, so it must
/// not follow every job.
#[derive(Default)]
pub(super) struct Pace {
    /// Time of the next search; `None` for a search at once.
    next: Option<Instant>,
}

impl Pace {
    /// Returns the time until the next search; `None` if it is due.
    pub fn pause(&self, now: Instant) -> Option<Duration> {
        self.next?.checked_duration_since(now).filter(|pause| !pause.is_zero())
    }

    /// Records a search without a result, from `begun` to `now`.
    pub fn found_none(&mut self, begun: Instant, now: Instant) {
        let took = now.saturating_duration_since(begun);
        self.next = Some(now + took.saturating_mul(PAUSE).min(LONGEST_PAUSE));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_search_in_vain_takes_a_tenth_of_the_time() {
        let (begun, mut pace) = (Instant::now(), Pace::default());
        assert_eq!(pace.pause(begun), None);
        for (took_ms, pause_ms) in [(1, 10), (700, 7_000), (60_000, 30_000)] {
            let ended = begun + Duration::from_millis(took_ms);
            pace.found_none(begun, ended);
            let pause = Duration::from_millis(pause_ms);
            assert_eq!(pace.pause(ended), Some(pause), "{took_ms}");
            assert_eq!(pace.pause(ended + pause), None, "{took_ms}");
        }
    }
}
