//! The reasons of an attempt's outcome, for the log.

use viola_reconstruct::Reason;
use viola_storage::AttemptEnd;

/// Returns the details of the reasons that the clip has after an attempt; `None` without any. The cause of a fault is in an
/// event of its own.
pub(super) fn detail(ending: &AttemptEnd) -> Option<String> {
    let reasons: &[Reason] = match ending {
        AttemptEnd::Answered(alignment) => &alignment.reasons,
        AttemptEnd::Refused(reason) | AttemptEnd::Broken(reason) => std::slice::from_ref(reason),
        AttemptEnd::Fault(_) | AttemptEnd::GivenUp => &[],
    };
    let details: Vec<&str> = reasons.iter().map(|reason| reason.detail.as_str()).collect();
    (!details.is_empty()).then(|| details.join("; "))
}

#[cfg(test)]
mod tests {
    use super::super::metrics;
    use super::*;
    use viola_storage::Fault;

    #[test]
    fn the_log_tells_why_a_job_has_no_answer() {
        let reason = || Reason::new("no_floor", "no floor was seen");
        let table = [
            (AttemptEnd::Refused(reason()), "no_floor", Some("no floor was seen")),
            (AttemptEnd::Broken(reason()), "no_floor", Some("no floor was seen")),
            (AttemptEnd::Fault(Fault::Storage), "storage_fault", None),
            (AttemptEnd::GivenUp, "given_up", None),
        ];
        for (ending, name, told) in table {
            assert_eq!(detail(&ending).as_deref(), told);
            assert_eq!(metrics::outcome(&ending), name);
        }
    }
}
