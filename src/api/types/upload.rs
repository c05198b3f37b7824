//! An upload in parts.

use super::answer;

answer! {
    /// Kind of an upload.
    enum UploadKind from crate::storage::UploadKind {
        /// One file.
        Whole,
        /// A part of a file; a final upload joins it with others.
        Partial,
        /// Joined from partial uploads.
        Final,
    }
}

answer! {
    /// State of an upload.
    enum UploadState from crate::storage::UploadState {
        /// Bytes are missing.
        Arriving,
        /// Every byte has arrived and is durable.
        Arrived,
        /// A final upload took it over.
        Joined,
        /// It became a clip.
        Finished,
        /// It cannot become a clip; its bytes are gone.
        Refused,
    }
}
