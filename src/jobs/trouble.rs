//! Reasons why an attempt gave no answer, and whether they count against the clip.

use super::align_clip::{Failure, Finished};
use crate::storage::{Fault, StorageError};
use serde::{Deserialize, Serialize};
use std::fmt::Display;
use viola_reconstruct::Reason;

/// Result of the method.
pub(super) type Ended = Result<Finished, Trouble>;

/// Reason why the method gave no answer. A cause is for the log: a client cannot act on it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Trouble {
    /// The method was asked to stop.
    Cancelled,
    /// The clip or the map cannot be used; another attempt would end the same way.
    Refused(Reason),
    /// The method failed on this clip. The attempt counts.
    Broken { code: String, cause: String },
    /// The service had a fault that is not the clip's. The attempt does not count.
    Fault { fault: Fault, cause: String },
}

impl Trouble {
    /// Returns the trouble of a method that panicked or broke one of its own rules.
    pub fn internal(cause: impl Display) -> Trouble {
        Trouble::Broken { code: "internal_error".to_owned(), cause: cause.to_string() }
    }

    /// Returns the trouble of a child process that died while it worked on this clip alone.
    pub fn died(cause: impl Display) -> Trouble {
        Trouble::Broken { code: "worker_died".to_owned(), cause: cause.to_string() }
    }

    pub fn system(cause: impl Display) -> Trouble {
        Trouble::Fault { fault: Fault::System, cause: cause.to_string() }
    }
}

impl From<Failure> for Trouble {
    fn from(failure: Failure) -> Trouble {
        match failure {
            Failure::Cancelled => Trouble::Cancelled,
            failure if failure.is_ours() => Trouble::system(failure),
            failure => Trouble::Refused(failure.reason()),
        }
    }
}

impl From<StorageError> for Trouble {
    fn from(error: StorageError) -> Trouble {
        let cause = error.to_string();
        match error {
            // This includes a missing blob: its disk may be unavailable for a while.
            StorageError::File { .. }
            | StorageError::DamagedFile { .. }
            | StorageError::Database(_)
            | StorageError::Blobs(_)
            | StorageError::Randomness(_)
            | StorageError::Unsettled(_)
            | StorageError::WritesFail { .. } => Trouble::Fault { fault: Fault::Storage, cause },
            // Waiting would not help.
            _ => Trouble::Broken { code: "storage_error".to_owned(), cause },
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

    fn is_fault(trouble: impl Into<Trouble>) -> bool {
        matches!(trouble.into(), Trouble::Fault { .. })
    }

    fn unreadable(error: impl Into<io::Error>) -> ContainerError {
        ContainerError::Unreadable { name: "file".to_owned(), source: error.into() }
    }

    #[test]
    fn faults_of_the_machine_and_the_storage_are_told_from_those_of_a_clip() {
        for number in [Errno::MFILE, Errno::NFILE, Errno::NOMEM, Errno::NOSPC, Errno::IO] {
            assert!(is_fault(Failure::Clip(ClipError::Container(unreadable(number)))), "{number:?}");
            assert!(is_fault(Failure::Lidar(LidarError::Container(unreadable(number)))), "{number:?}");
            let source = number.into();
            assert!(is_fault(StorageError::File { path: "blobs".into(), source }), "{number:?}");
        }
        let missing = object_store::Error::NotFound { path: "clip".to_owned(), source: "it is away".into() };
        assert!(is_fault(StorageError::Blobs(missing)));
        assert!(is_fault(StorageError::Database(sqlx::Error::PoolTimedOut)));

        let damaged = unreadable(io::Error::from(io::ErrorKind::InvalidData));
        let trouble = Trouble::from(Failure::Clip(ClipError::Container(damaged)));
        assert!(matches!(trouble, Trouble::Refused(reason) if reason.code == "unreadable"));
        let column = StorageError::Column { column: "state", detail: "of a newer version".to_owned() };
        assert!(matches!(Trouble::from(column), Trouble::Broken { code, .. } if code == "storage_error"));
        assert_eq!(Trouble::from(Failure::Cancelled), Trouble::Cancelled);
    }
}
