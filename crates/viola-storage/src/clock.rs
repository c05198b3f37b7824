//! Times in rows that were written before the clock was set back.
//!
//! Such a time is further ahead than any that this service writes, and counts as past: otherwise work would rest
//! until the clock has caught up.

use jiff::Timestamp;
use std::time::Duration;

/// Longer than any lease, and than any pause of an upload.
const LONGEST_LEASE: Duration = Duration::from_mins(10);
/// Longer than any pause between the attempts at a job or a merge.
const LONGEST_PAUSE: Duration = Duration::from_mins(40);

/// Longer than any lead of a job's turn over the time at which it is queued.
const LONGEST_TURN: Duration = Duration::from_hours(3);
/// The same of a job that aligns a clip with an answer to a new LiDAR map.
const LONGEST_TURN_AGAIN: Duration = Duration::from_hours(15);
/// Longer than any delay of a delivery.
const LONGEST_DELAY: Duration = Duration::from_hours(25);

/// Sets the time of a clip's newest change. It does not go back with the clock: readers ask for the clips that changed since.
macro_rules! change_at {
    ($now:literal) => {
        concat!("updated_at = CASE WHEN updated_at < ", $now, " THEN ", $now, " ELSE updated_at END")
    };
}
pub(super) use change_at;

/// Returns the time after which a lease can only be of a clock that was ahead, in milliseconds.
pub(super) fn no_lease_after(now: Timestamp) -> i64 {
    (now + LONGEST_LEASE).as_millisecond()
}

/// Returns the time after which the due time of a job or a merge can only be of a clock that was ahead, in milliseconds.
pub(super) fn no_pause_after(now: Timestamp) -> i64 {
    (now + LONGEST_PAUSE).as_millisecond()
}

/// Returns the time after which the turn of a queued job can only be of a clock that was ahead, in milliseconds.
pub(super) fn no_turn_after(now: Timestamp) -> i64 {
    (now + LONGEST_TURN).as_millisecond()
}

/// Returns [`no_turn_after`] of jobs that align a clip with an answer to a new LiDAR map.
pub(super) fn no_turn_again_after(now: Timestamp) -> i64 {
    (now + LONGEST_TURN_AGAIN).as_millisecond()
}

/// Returns the time after which the due time of a delivery can only be of a clock that was ahead, in milliseconds.
pub(super) fn no_delivery_after(now: Timestamp) -> i64 {
    (now + LONGEST_DELAY).as_millisecond()
}
