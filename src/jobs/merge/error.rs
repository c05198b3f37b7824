//! Errors of merges.

use std::time::Duration;
use uuid::Uuid;
use viola_formats::lidar::LidarError;
use viola_geometry::progress::Cancelled;
use viola_storage::StorageError;

/// Reason why a map could not be merged.
#[derive(Debug, thiserror::Error)]
pub(in crate::jobs) enum MergeError {
    #[error(transparent)]
    Storage(#[from] StorageError),
    #[error("the merge panicked")]
    Panicked,
    #[error("no thread or process could be started for the merge: {0}")]
    NotStarted(std::io::Error),
    #[error("the process of the merge ended early: {0}")]
    Died(String),
    /// An error that the process of the merge told.
    #[error("{0}")]
    Told(String),
    #[error("the surface network cannot be used any more: {0}")]
    NoNetwork(String),
    #[error("a stored file of the last map is missing or damaged")]
    DamagedMap,
    #[error("the stored files of clip {clip} are missing or damaged; align the clip again")]
    DamagedClip { clip: Uuid },
    #[error("the LiDAR map cannot be read any more: {0}")]
    Lidar(#[from] LidarError),
    #[error("nobody waits for the merge any more")]
    Abandoned,
    #[error("the merge was asked to stop")]
    Cancelled,
    #[error("the merge took longer than {} s, the limit for its clips; it is repeated after a pause", .limit.as_secs())]
    TookTooLong { limit: Duration },
    #[error("the merge needs more memory than its process may have, {} MiB for its clips; it is repeated after a pause", .limit_bytes >> 20)]
    TooLarge { limit_bytes: u64 },
}

impl From<Cancelled> for MergeError {
    fn from(_: Cancelled) -> MergeError {
        MergeError::Cancelled
    }
}
