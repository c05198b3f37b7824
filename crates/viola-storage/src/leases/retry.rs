//! Retry policy of jobs.

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use std::time::Duration;
use viola_reconstruct::Reason;

/// Minimum number of consecutive faults before a job fails. Time alone does not count: the machine may have been off.
const MIN_FAULTS: u32 = 20;

/// Pauses between attempts, and the limit for attempts that end in faults of the service.
#[derive(Debug, Clone)]
pub struct RetryPolicy {
    /// Pause after the first failure; doubled with every further one.
    pub first_delay: Duration,
    /// Longest pause.
    pub longest_delay: Duration,
    /// Time after which a job with nothing but faults fails.
    pub patience: Duration,
}

impl Default for RetryPolicy {
    fn default() -> RetryPolicy {
        RetryPolicy {
            first_delay: Duration::from_secs(5),
            longest_delay: Duration::from_mins(30),
            patience: Duration::from_hours(24),
        }
    }
}

impl RetryPolicy {
    /// Returns the pause after a number of failures in a row.
    pub(crate) fn delay(&self, failures: u32) -> Duration {
        let doublings = failures.saturating_sub(1).min(20);
        self.first_delay.saturating_mul(1 << doublings).min(self.longest_delay)
    }

    /// Returns whether a job has met enough faults in a row to fail.
    pub(super) fn is_over(&self, faults: u32, first_fault_at: Timestamp, now: Timestamp) -> bool {
        let elapsed = Duration::try_from(now.duration_since(first_fault_at)).unwrap_or_default();
        faults >= MIN_FAULTS && elapsed >= self.patience
    }
}

/// A fault of the service that ended an attempt. The attempt does not count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fault {
    /// The database or the blob store failed, or a blob was missing.
    Storage,
    /// The machine lacked file descriptors, memory or disk space, or could not start a process.
    System,
    /// The worker's lease expired: its process was killed, or could not reach the database.
    WorkerLost,
}

impl Fault {
    /// Returns the code of the reason that a client sees.
    pub fn code(self) -> &'static str {
        match self {
            Fault::Storage => "storage_fault",
            Fault::System => "system_fault",
            Fault::WorkerLost => "worker_lost",
        }
    }

    fn detail(self) -> &'static str {
        match self {
            Fault::Storage => "the service's storage failed while it worked on this clip",
            Fault::System => "the machine that worked on this clip had a fault or lacked resources",
            Fault::WorkerLost => "the process that worked on this clip was lost",
        }
    }

    /// Returns the reason of a clip whose job is retried.
    pub(super) fn passing(self) -> Reason {
        Reason::new(self.code(), format!("{}; the service tries again by itself", self.detail()))
    }

    /// Returns the reason of a clip that failed because the fault did not pass.
    pub(super) fn lasting(self, policy: &RetryPolicy) -> Reason {
        let hours = policy.patience.as_secs() / 3600;
        let detail = format!(
            "{}, in every try for {hours} hours; align the clip again once the service is repaired",
            self.detail()
        );
        Reason::new(self.code(), detail)
    }
}
