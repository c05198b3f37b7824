//! Durations as arguments.

use std::ops::RangeInclusive;
use std::time::Duration;

/// Seconds of a job: a week at most.
const JOB_S: RangeInclusive<f64> = 1.0..=604_800.0;
/// Seconds that an unfinished upload may be idle: a client needs time for its next request; a year at most.
const PATIENCE_S: RangeInclusive<f64> = 1.0..=31_536_000.0;

/// Parses a duration in seconds.
pub fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse::<f64>().map_err(|error| error.to_string())?;
    Duration::try_from_secs_f64(seconds).map_err(|error| error.to_string())
}

/// Parses the time limit of a job in seconds.
pub fn job_seconds(text: &str) -> Result<Duration, String> {
    seconds_within(text, &JOB_S)
}

/// Parses the idle time of uploads in seconds.
pub fn patience_seconds(text: &str) -> Result<Duration, String> {
    seconds_within(text, &PATIENCE_S)
}

fn seconds_within(text: &str, range: &RangeInclusive<f64>) -> Result<Duration, String> {
    let duration = seconds(text)?;
    let is_within = range.contains(&duration.as_secs_f64());
    is_within.then_some(duration).ok_or_else(|| format!("it is {} to {} seconds", range.start(), range.end()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_have_bounds() {
        for (text, expected_s) in [("1", Some(1)), ("604800", Some(604_800)), ("0", None), ("604801", None)] {
            assert_eq!(job_seconds(text).ok(), expected_s.map(Duration::from_secs), "{text}");
        }
        for (text, expected_s) in
            [("86400", Some(86_400)), ("0.5", None), ("-1", None), ("nan", None), ("1e9", None)]
        {
            assert_eq!(patience_seconds(text).ok(), expected_s.map(Duration::from_secs), "{text}");
        }
    }
}
