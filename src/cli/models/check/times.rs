//! Run times of a network.

use anyhow::{Result, bail};
use std::fmt;
use std::time::Instant;

/// Milliseconds of each run.
pub(super) struct Times(Vec<f64>);

impl Times {
    /// Runs `work` several times and returns its last result.
    pub(super) fn of<T>(runs: u32, work: impl Fn() -> Result<T>) -> Result<(T, Times)> {
        let (mut last, mut times_ms) = (None, Vec::new());
        for _ in 0..runs {
            let start = Instant::now();
            last = Some(work()?);
            times_ms.push(start.elapsed().as_secs_f64() * 1e3);
        }
        let Some(last) = last else { bail!("the number of runs is 0; a network must run at least once") };
        Ok((last, Times(times_ms)))
    }
}

impl fmt::Display for Times {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Times(times_ms) = self;
        let first = times_ms.first().copied().unwrap_or_default();
        let mut sorted = times_ms.clone();
        sorted.sort_by(f64::total_cmp);
        let median = sorted.get(sorted.len() / 2).copied().unwrap_or_default();
        write!(f, "time:    first run {first:.1} ms; median of {} runs {median:.1} ms", times_ms.len())
    }
}
