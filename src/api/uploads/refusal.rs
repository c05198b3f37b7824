//! Refusals of tus requests.

use crate::api::error::Error;
use axum::http::StatusCode;
use std::time::Duration;
use viola_storage::UploadError;

#[derive(Debug, thiserror::Error)]
pub(in crate::api) enum UploadRefusal {
    #[error(transparent)]
    State(UploadError),
    #[error("send the header Tus-Resumable: 1.0.0; no other version of the protocol is served")]
    OtherVersion,
    #[error("the body is sent as Content-Type: {expected}")]
    MediaType { expected: &'static str },
    #[error(
        "Upload-Length is 0, and an empty file is no clip; begin the upload when the recording is written"
    )]
    EmptyFile,
    #[error(
        "Upload-Length is {length}, and a file has at most {limit} bytes; split the recording into several clips"
    )]
    FileTooLarge { length: u64, limit: u64 },
    #[error("Upload-Checksum names an algorithm that is not served; OPTIONS lists those that are")]
    OtherChecksum,
    #[error("the body does not have its checksum; it was not kept, send it again")]
    ChecksumMismatch,
    #[error(
        "the file does not have the sha256 of its Upload-Metadata: bytes were damaged, or are of another file; send it again"
    )]
    FileMismatch,
    #[error(
        "the idempotency_key of its Upload-Metadata came with another recording before, or with an archive of this one that \
         failed; begin an upload with a new key"
    )]
    KeyReused,
    #[error("the service is stopping; retry in a few seconds")]
    Stopping,
    #[error("the body is too slow: {0}; ask for the offset (HEAD) and resume there")]
    Stalled(String),
    #[error("the process that opened this file died; the file is damaged or malicious")]
    Unreadable,
    /// The attempt failed for this cause, for which the service may be at fault.
    #[error(
        "the file is complete, but could not be opened yet; do not send it again, the service retries: {cause}"
    )]
    Waits { cause: String, pause: Duration },
}

impl From<UploadError> for Error {
    fn from(error: UploadError) -> Error {
        match error {
            UploadError::Storage(error) => error.into(),
            UploadError::TooLarge { limit } => Error::BodyTooLarge { limit },
            other => Error::Upload(UploadRefusal::State(other)),
        }
    }
}

impl UploadRefusal {
    /// Returns the status, the code and the title.
    pub fn mapping(&self) -> (StatusCode, &'static str, &'static str) {
        use StatusCode as S;
        use UploadError as E;
        match self {
            UploadRefusal::OtherVersion => {
                (S::PRECONDITION_FAILED, "tus_version_unsupported", "The protocol's version is not served")
            }
            UploadRefusal::MediaType { .. } => {
                (S::UNSUPPORTED_MEDIA_TYPE, "unsupported_media_type", "This kind of body is not understood")
            }
            UploadRefusal::EmptyFile => (S::UNPROCESSABLE_ENTITY, "body_empty", "The body is empty"),
            UploadRefusal::FileTooLarge { .. } => {
                (S::PAYLOAD_TOO_LARGE, "body_too_large", "The body is too large")
            }
            UploadRefusal::OtherChecksum => {
                (S::BAD_REQUEST, "unknown_checksum_algorithm", "The checksum's algorithm is not known")
            }
            UploadRefusal::ChecksumMismatch => {
                // Status of the checksum extension of tus.
                let status = S::from_u16(460).unwrap_or(S::BAD_REQUEST);
                (status, "checksum_mismatch", "The body was damaged on its way")
            }
            UploadRefusal::FileMismatch => {
                (S::UNPROCESSABLE_ENTITY, "checksum_mismatch", "The body was damaged on its way")
            }
            UploadRefusal::KeyReused => (
                S::UNPROCESSABLE_ENTITY,
                "idempotency_key_reused",
                "The Idempotency-Key was used for another file",
            ),
            UploadRefusal::Stopping => (S::SERVICE_UNAVAILABLE, "stopping", "The service is stopping"),
            UploadRefusal::Stalled(_) => {
                (S::SERVICE_UNAVAILABLE, "body_stalled", "The body did not arrive in time")
            }
            UploadRefusal::Waits { .. } => {
                (S::SERVICE_UNAVAILABLE, "unavailable", "The service cannot do this at this moment")
            }
            UploadRefusal::Unreadable => {
                (S::UNPROCESSABLE_ENTITY, "upload_unreadable", "The file cannot be opened")
            }
            UploadRefusal::State(error) => match error {
                E::NotFound | E::PartNotFound { .. } => {
                    (S::NOT_FOUND, "upload_not_found", "There is no such upload")
                }
                E::Gone | E::PartGone { .. } => (S::GONE, "upload_gone", "The upload is gone"),
                E::WrongOffset { .. } | E::Overtaken => {
                    (S::CONFLICT, "upload_offset_mismatch", "The offset is not the upload's")
                }
                E::LengthTold | E::LengthTooSmall { .. } | E::NotPartial { .. } => {
                    (S::BAD_REQUEST, "invalid_header", "A header is not valid")
                }
                E::Final => (S::FORBIDDEN, "upload_final", "A final upload takes no bytes"),
                E::TooMany { .. } => {
                    (S::TOO_MANY_REQUESTS, "too_many_uploads", "Too many uploads are unfinished")
                }
                E::TooManyPieces { .. } => {
                    (S::PAYLOAD_TOO_LARGE, "too_many_pieces", "The upload came in too many pieces")
                }
                E::PartUnfinished { .. } => {
                    (S::CONFLICT, "upload_unfinished", "A part of the upload is unfinished")
                }
                E::Lost => (S::GONE, "upload_lost", "Bytes of the upload were lost"),
                // Converted to other errors in `From` above.
                E::TooLarge { .. } | E::Storage(_) => {
                    (S::INTERNAL_SERVER_ERROR, "internal_error", "The service failed")
                }
            },
        }
    }

    /// Returns the time after which a retry may succeed.
    pub fn retry_after(&self) -> Option<Duration> {
        match self {
            UploadRefusal::Waits { pause, .. } => Some(*pause),
            UploadRefusal::Stalled(_) => Some(Duration::from_secs(1)),
            // Another process of the service may take it, or the next one when it has started.
            UploadRefusal::Stopping => Some(Duration::from_secs(2)),
            _ => None,
        }
    }

    pub fn field(&self) -> Option<&'static str> {
        match self {
            UploadRefusal::EmptyFile
            | UploadRefusal::FileTooLarge { .. }
            | UploadRefusal::State(UploadError::LengthTold | UploadError::LengthTooSmall { .. }) => {
                Some("Upload-Length")
            }
            UploadRefusal::State(
                UploadError::NotPartial { .. }
                | UploadError::PartNotFound { .. }
                | UploadError::PartGone { .. }
                | UploadError::PartUnfinished { .. },
            ) => Some("Upload-Concat"),
            UploadRefusal::State(UploadError::WrongOffset { .. }) => Some("Upload-Offset"),
            UploadRefusal::OtherChecksum | UploadRefusal::ChecksumMismatch => Some("Upload-Checksum"),
            UploadRefusal::FileMismatch | UploadRefusal::KeyReused => Some("Upload-Metadata"),
            UploadRefusal::OtherVersion => Some("Tus-Resumable"),
            UploadRefusal::MediaType { .. } => Some("Content-Type"),
            _ => None,
        }
    }
}
