//! Write health of the database, for the readiness of the process.

use super::fault::DatabaseFault;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// A commit younger than this proves that the database can write.
const PROOF: Duration = Duration::from_secs(5);

/// The process is not ready for this long after a write failed. A check alone is not enough: on a full disk a
/// small write may succeed and a larger one fail.
const HOLD: Duration = Duration::from_secs(5);

/// Times of the last commit, and of the last write that a full disk or a fault of the system made fail.
#[derive(Default)]
pub struct WriteHealth {
    last: Mutex<Last>,
    /// Held during a check, so that one runs at a time.
    pub check: tokio::sync::Mutex<()>,
}

#[derive(Default)]
struct Last {
    committed: Option<Instant>,
    failed: Option<(Instant, DatabaseFault)>,
}

/// Verdict from the last writes.
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
