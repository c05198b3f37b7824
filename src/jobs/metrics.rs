//! Metrics of jobs and merges.

use metrics::{Unit, counter, describe_counter, describe_histogram, histogram};
use std::time::Duration;
use viola_storage::{AttemptEnd, ClipState, Fault};

const ATTEMPTS: &str = "viola_job_attempts_total";
const ATTEMPT_SECONDS: &str = "viola_job_attempt_seconds";
const STAGE_SECONDS: &str = "viola_job_stage_seconds";
const START_SECONDS: &str = "viola_job_start_seconds";
const LEASES_LOST: &str = "viola_leases_lost_total";
const MERGES: &str = "viola_merges_total";
const MERGE_SECONDS: &str = "viola_merge_seconds";

/// Registers the descriptions of the metrics.
pub fn describe_metrics() {
    describe_counter!(
        ATTEMPTS,
        "Attempts at jobs, by how they ended; cancelled and superseded ones are no failures"
    );
    describe_histogram!(ATTEMPT_SECONDS, Unit::Seconds, "Time of an attempt");
    describe_histogram!(STAGE_SECONDS, Unit::Seconds, "Time of a stage of the method");
    describe_histogram!(START_SECONDS, Unit::Seconds, "From when a job was due to when a worker had it");
    describe_counter!(LEASES_LOST, "Attempts whose job went to another worker, was cancelled or removed");
    counter!(LEASES_LOST).increment(0);
    describe_counter!(MERGES, "Merges of homes, by how they ended");
    describe_histogram!(MERGE_SECONDS, Unit::Seconds, "Time of a merge");
    // An alert on an increase does not see the first count of a series that begins with it.
    for outcome in [Fault::Storage.code(), Fault::System.code(), "worker_died", "internal_error"] {
        counter!(ATTEMPTS, "outcome" => outcome).increment(0);
    }
    for outcome in ["failed", "lost"] {
        counter!(MERGES, "outcome" => outcome).increment(0);
    }
}

pub(super) fn started(waited: Duration) {
    histogram!(START_SECONDS).record(waited);
}

/// Returns the name of the end of an attempt.
pub(super) fn outcome(ending: &AttemptEnd) -> &str {
    match ending {
        AttemptEnd::Answered(alignment) => ClipState::from(alignment.state).name(),
        AttemptEnd::Refused(reason) | AttemptEnd::Broken(reason) => &reason.code,
        AttemptEnd::Fault(fault) => fault.code(),
        AttemptEnd::GivenUp => "given_up",
    }
}

/// Records the end of an attempt. `is_own`: whether the job was still its worker's; `None` if the end could not be recorded.
pub(super) fn ended(outcome: &str, ending: Option<&AttemptEnd>, is_own: Option<bool>, took: Duration) {
    counter!(ATTEMPTS, "outcome" => outcome.to_owned()).increment(1);
    histogram!(ATTEMPT_SECONDS).record(took);
    match (is_own, ending) {
        (Some(false), _) => counter!(LEASES_LOST).increment(1),
        (Some(true), Some(AttemptEnd::Answered(alignment))) => {
            for (stage, seconds) in &alignment.seconds {
                histogram!(STAGE_SECONDS, "stage" => stage.clone()).record(*seconds);
            }
        }
        (Some(true) | None, _) => {}
    }
}

pub(super) fn merged(outcome: &'static str, took: Duration) {
    counter!(MERGES, "outcome" => outcome).increment(1);
    histogram!(MERGE_SECONDS).record(took);
}
