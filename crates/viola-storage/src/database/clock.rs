//! The time of the service. On PostgreSQL it is the database's: processes of many machines compare leases and due times, and
//! the clock of one machine may be wrong. Between two readings of the database's clock, the time advances by the monotonic
//! clock of this machine, which nobody sets.

use crate::StorageError;
use crate::columns::parse_time;
use jiff::{SignedDuration, Timestamp};
use sqlx::postgres::PgPool;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Maximum age of a reading. The monotonic clocks of two machines differ by milliseconds after this time.
const MAX_AGE: Duration = Duration::from_mins(1);

/// A reading whose answer took longer is not used if there is an earlier one: its error is up to half of that time.
const MAX_ROUND_TRIP: Duration = Duration::from_secs(1);

/// Difference between the progress of the wall clock and that of the monotonic clock beyond which the database's clock is read
/// again: the machine slept, in which the monotonic clock may stand still, or its wall clock was set.
const MAX_PROGRESS_DIFFERENCE: SignedDuration = SignedDuration::from_secs(1);

/// Difference of this machine's clock and the database's beyond which a process warns: times in its log are of its own clock.
const MAX_CLOCK_DIFFERENCE: SignedDuration = SignedDuration::from_secs(5);

/// A time of the database, with the times of this machine's two clocks at which it was read.
#[derive(Debug, Clone, Copy)]
struct Reading {
    database: Timestamp,
    monotonic: Instant,
    wall: Timestamp,
}

impl Reading {
    /// Returns the database's time at a time of the monotonic clock.
    fn at(&self, monotonic: Instant) -> Timestamp {
        self.database + monotonic.saturating_duration_since(self.monotonic)
    }

    /// Returns whether the database's clock must be read again.
    fn is_old(&self, monotonic: Instant, wall: Timestamp) -> bool {
        let age = monotonic.saturating_duration_since(self.monotonic);
        let progress = SignedDuration::try_from(age).unwrap_or(SignedDuration::MAX);
        let difference = wall.duration_since(self.wall).saturating_sub(progress);
        age >= MAX_AGE || difference.abs() > MAX_PROGRESS_DIFFERENCE
    }

    /// Returns the time by which this machine's wall clock is ahead of the database's.
    fn wall_ahead(&self) -> SignedDuration {
        self.wall.duration_since(self.database)
    }
}

/// The newest reading; none on SQLite, whose only machine is this one.
#[derive(Default)]
pub struct Clock {
    last: Mutex<Option<Reading>>,
}

impl Clock {
    fn last(&self) -> MutexGuard<'_, Option<Reading>> {
        // It holds one value; a panic leaves it whole.
        self.last.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the time of the service.
    pub fn now(&self) -> Timestamp {
        self.last().map_or_else(Timestamp::now, |reading| reading.at(Instant::now()))
    }

    /// Returns whether the database's clock must be read.
    pub fn is_old(&self) -> bool {
        self.last().is_none_or(|reading| reading.is_old(Instant::now(), Timestamp::now()))
    }

    /// Reads the database's clock. Warns if this machine's clock differs from it and did not before.
    pub async fn read(&self, pool: &PgPool) -> Result<(), StorageError> {
        // Waiting for a connection is no part of the round trip.
        let mut connection = pool.acquire().await?;
        let asked = Instant::now();
        let now = "SELECT CAST(EXTRACT(EPOCH FROM clock_timestamp()) * 1000 AS BIGINT)";
        let database_ms: i64 = sqlx::query_scalar(now).fetch_one(&mut *connection).await?;
        let (monotonic, wall) = (Instant::now(), Timestamp::now());
        let round_trip = monotonic.saturating_duration_since(asked);
        let database = parse_time("clock_timestamp", database_ms)?;
        self.note(Reading { database: database + round_trip / 2, monotonic, wall }, round_trip);
        Ok(())
    }

    fn note(&self, reading: Reading, round_trip: Duration) {
        let mut last = self.last();
        if last.is_some() && round_trip > MAX_ROUND_TRIP {
            return;
        }
        let differs = |reading: &Reading| reading.wall_ahead().abs() > MAX_CLOCK_DIFFERENCE;
        if differs(&reading) && !last.as_ref().is_some_and(differs) {
            let seconds_ahead = reading.wall_ahead().as_secs_f64();
            tracing::warn!(
                seconds_ahead,
                "the clock of this machine differs from the database's, whose time is used for jobs and leases; set both \
                 clocks, as by NTP"
            );
        }
        *last = Some(reading);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: i64) -> Timestamp {
        Timestamp::from_second(1_800_000_000 + seconds).unwrap()
    }

    /// Returns a reading at the beginning of a test, on a machine whose wall clock is ahead.
    fn reading(ahead_s: i64) -> Reading {
        Reading { database: at(0), monotonic: Instant::now(), wall: at(ahead_s) }
    }

    #[test]
    fn the_time_is_the_databases_whatever_the_wall_clock_says() {
        for ahead_s in [-7200, -6, 0, 6, 7200] {
            let clock = Clock::default();
            clock.note(reading(ahead_s), Duration::ZERO);
            let passed = clock.now().duration_since(at(0));
            assert!((0..60).contains(&passed.as_secs()), "{ahead_s}: {passed}");
            let reading = reading(ahead_s);
            assert_eq!(reading.at(reading.monotonic + Duration::from_secs(30)), at(30), "{ahead_s}");
        }
    }

    #[test]
    fn a_reading_is_old_after_a_minute_and_after_a_jump_or_a_sleep() {
        // Seconds of the monotonic clock and of the wall clock since the reading.
        let table = [
            (0, 0, false),
            (59, 59, false),
            (60, 60, true),
            (30, 31, false),
            (30, 32, true),
            (30, 28, true),
            (1, 3600, true),
            (1, -3600, true),
        ];
        for (monotonic_s, wall_s, is_old) in table {
            for ahead_s in [-7200, 0, 7200] {
                let reading = reading(ahead_s);
                let monotonic = reading.monotonic + Duration::from_secs(monotonic_s);
                let found = reading.is_old(monotonic, at(ahead_s + wall_s));
                assert_eq!(found, is_old, "{monotonic_s} s, {wall_s} s, {ahead_s} s ahead");
            }
        }
    }

    #[test]
    fn a_slow_answer_replaces_no_reading() {
        let clock = Clock::default();
        assert!(clock.is_old());
        clock.note(reading(0), Duration::from_secs(9));
        let first = clock.last().unwrap().monotonic;
        clock.note(reading(0), Duration::from_secs(2));
        assert_eq!(clock.last().unwrap().monotonic, first);
        clock.note(reading(0), Duration::from_millis(2));
        assert!(clock.last().unwrap().monotonic >= first);
    }
}
