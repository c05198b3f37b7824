//! Whether the database can write, for the readiness of the process.

use super::fault::DatabaseFault;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// A commit younger than this proves that the database can write.
const PROOF: Duration = Duration::from_secs(5);

/// The process is not ready for this long after a write failed. A check alone would not do: on a full disk a small write
/// still fits where a larger one does not.
const HOLD: Duration = Duration::from_secs(5);

/// The times of the last commit and of the last write that failed because the disk was full or the system failed.
#[derive(Default)]
pub struct WriteHealth {
    last: Mutex<Last>,
    /// Held during a check: there is one at a time, however many ask.
    pub check: tokio::sync::Mutex<()>,
}

#[derive(Default)]
struct Last {
    committed: Option<Instant>,
    failed: Option<(Instant, DatabaseFault)>,
}

/// What the last writes tell.
#[derive(Debug, PartialEq, Eq)]
pub enum Verdict {
    Works,
    Fails(DatabaseFault),
    Unknown,
}

impl WriteHealth {
    fn last(&self) -> MutexGuard<'_, Last> {
        // It holds two times; a panic leaves neither half written.
        self.last.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub fn committed(&self) {
        self.last().committed = Some(Instant::now());
    }

    pub fn failed(&self, error: &sqlx::Error) {
        let fault = DatabaseFault::of(error);
        if matches!(fault, DatabaseFault::Full | DatabaseFault::System) {
            let mut last = self.last();
            last.committed = None;
            last.failed = Some((Instant::now(), fault));
        }
    }

    pub fn verdict(&self) -> Verdict {
        let last = self.last();
        match (last.failed, last.committed) {
            (Some((at, fault)), _) if at.elapsed() < HOLD => Verdict::Fails(fault),
            (_, Some(at)) if at.elapsed() < PROOF => Verdict::Works,
            _ => Verdict::Unknown,
        }
    }
}
