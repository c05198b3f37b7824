//! Reasons why an attempt gave no answer, and whether they count against the clip.

use super::align_clip::{AlignJobError, Finished};
use serde::{Deserialize, Serialize};
use std::fmt::Display;
use tracing::{error, warn};
use viola_reconstruct::Reason;
use viola_storage::{AttemptEnd, Fault, StorageError};

/// Result of the method.
pub(super) type MethodResult = Result<Finished, AttemptError>;

/// Reason why the method gave no answer. A cause is for the log: a client cannot act on it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum AttemptError {
    /// The method was asked to stop.
    Cancelled,
    /// The clip or the map cannot be used; another attempt would end the same way.
    Refused(Reason),
    /// The method failed on this clip. The attempt counts.
    Broken { code: String, cause: String },
    /// The service had a fault that is not the clip's. The attempt does not count.
    Fault { fault: Fault, cause: String },
}

impl AttemptError {
    /// Returns the error of a method that panicked or broke one of its own rules.
    pub fn internal(cause: impl Display) -> AttemptError {
        AttemptError::Broken { code: "internal_error".to_owned(), cause: cause.to_string() }
    }

    /// Returns the error of a child process that died while it worked on this clip alone.
    pub fn died(cause: impl Display) -> AttemptError {
        AttemptError::Broken { code: "worker_died".to_owned(), cause: cause.to_string() }
    }

    pub fn system(cause: impl Display) -> AttemptError {
        AttemptError::Fault { fault: Fault::System, cause: cause.to_string() }
    }

    /// Returns the end of the attempt. The cause is only logged: a client cannot act on it.
    pub fn into_end(self) -> AttemptEnd {
        match self {
            AttemptError::Cancelled => AttemptEnd::GivenUp,
            AttemptError::Refused(reason) => AttemptEnd::Refused(reason),
            AttemptError::Broken { code, cause } => {
                error!(code, cause, "an attempt broke");
                let detail = match code.as_str() {
                    "worker_died" => {
                        "the process that worked on this clip alone died; it may need more memory than there is"
                    }
                    _ => "the service failed while it worked on this clip; its log has the cause",
                };
                AttemptEnd::Broken(Reason::new(&code, detail))
            }
            AttemptError::Fault { fault, cause } => {
                warn!(code = fault.code(), cause, "a fault ended an attempt, which does not count");
                AttemptEnd::Fault(fault)
            }
        }
    }
}

impl From<AlignJobError> for AttemptError {
    fn from(failure: AlignJobError) -> AttemptError {
        match failure {
            AlignJobError::Cancelled => AttemptError::Cancelled,
            failure if failure.is_service_fault() => AttemptError::system(failure),
            failure => AttemptError::Refused(failure.reason()),
        }
    }
}

impl From<StorageError> for AttemptError {
    fn from(error: StorageError) -> AttemptError {
        let cause = error.to_string();
        match error {
            // A file of this machine, such as its copy of the clip.
            StorageError::File { .. } => AttemptError::system(cause),
            // This includes a missing blob: its disk may be unavailable for a while.
            StorageError::DamagedFile { .. }
            | StorageError::Database(_)
            | StorageError::Blobs(_)
            | StorageError::Randomness(_)
            | StorageError::Unsettled(_)
            | StorageError::WritesFail { .. } => AttemptError::Fault { fault: Fault::Storage, cause },
            // Waiting would not help.
            _ => AttemptError::Broken { code: "storage_error".to_owned(), cause },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::io::Errno;
    use std::io;
    use viola_formats::clip::ClipError;
    use viola_formats::container::ContainerError;
    use viola_formats::lidar::LidarError;

    fn is_fault(error: impl Into<AttemptError>) -> bool {
        matches!(error.into(), AttemptError::Fault { .. })
    }

    fn unreadable(error: impl Into<io::Error>) -> ContainerError {
        ContainerError::Unreadable { name: "file".to_owned(), source: error.into() }
    }

    #[test]
    fn faults_of_the_machine_and_the_storage_are_told_from_those_of_a_clip() {
        for number in [Errno::MFILE, Errno::NFILE, Errno::NOMEM, Errno::NOSPC, Errno::IO] {
            assert!(is_fault(AlignJobError::Clip(ClipError::Container(unreadable(number)))), "{number:?}");
            assert!(is_fault(AlignJobError::Lidar(LidarError::Container(unreadable(number)))), "{number:?}");
            let source = number.into();
            let error = AttemptError::from(StorageError::File { path: "incoming".into(), source });
            assert!(matches!(error, AttemptError::Fault { fault: Fault::System, .. }), "{number:?}");
        }
        let missing = object_store::Error::NotFound { path: "clip".to_owned(), source: "it is away".into() };
        assert!(is_fault(StorageError::Blobs(missing)));
        assert!(is_fault(StorageError::Database(sqlx::Error::PoolTimedOut)));

        let damaged = unreadable(io::Error::from(io::ErrorKind::InvalidData));
        let error = AttemptError::from(AlignJobError::Clip(ClipError::Container(damaged)));
        assert!(matches!(error, AttemptError::Refused(reason) if reason.code == "unreadable"));
        let column = StorageError::Column { column: "state", detail: "of a newer version".to_owned() };
        assert!(
            matches!(AttemptError::from(column), AttemptError::Broken { code, .. } if code == "storage_error")
        );
        assert_eq!(AttemptError::from(AlignJobError::Cancelled), AttemptError::Cancelled);
    }
}
