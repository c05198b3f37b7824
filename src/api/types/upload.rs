//! An upload in parts.

use super::answer;

answer! {
    /// Kind of an upload.
    enum UploadKind from viola_storage::UploadKind {
        /// One file.
        Whole,
        /// A part of a file; a final upload joins it with others.
        Partial,
        /// Joined from partial uploads.
        Final,
    }
}

answer! {
    /// State of an upload:
    /// - `arriving`: bytes are missing. Send the rest, from `Upload-Offset` of HEAD on.
    /// - `arrived`: every byte is here and durable; do not send them again. The service makes the clip by itself, except that
    ///   a partial upload waits for its final one.
    /// - `joined`: a final upload took it over; look at that one.
    /// - `finished`: it became a clip.
    /// - `refused`: it cannot become a clip, and its bytes are gone; `problem` says why.
    enum UploadState from viola_storage::UploadState {
        Arriving,
        Arrived,
        Joined,
        Finished,
        Refused,
    }
}
